//! Least distance of two slots: Gilbert, Johnson and Keerthi's algorithm (GJK, 1988) on their cores,
//! the balls taken off afterwards. Closest points of a simplex after Ericson, "Real-Time Collision
//! Detection" (2005), chapter 5.

use super::slot::Slot;
use nalgebra::Vector3;

/// Relative gap between bounds at which GJK stops: the distance is then good to about 1e-6 mm at
/// the sizes of a mechanism. Measured on discs and capsules against closed forms.
const RELATIVE_GAP: f64 = 1e-9;
/// Steps after which the best bound is returned; discs need up to about 40.
const MOST_STEPS: usize = 128;
/// Cores nearer than this count as crossing, mm.
const CROSSING_MM: f64 = 1e-7;
/// Sine of the angle up to which axes count as parallel and segments as normal to them: at 1 m off by 1e-6 mm.
const ALIGNED: f64 = 1e-9;

/// Distance of two solids and where it is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Gap, mm; negative: depth of penetration. When even the cores cross it is minus the sum of
    /// the edge radii, a lower bound of the true depth's size.
    pub gap_mm: f64,
    /// Point half-way between the closest points of the cores.
    pub at: Vector3<f64>,
}

/// The convex core of a solid: all of it but the ball round each of its points.
pub(super) trait Core {
    /// Its farthest point in a direction.
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64>;
    /// Any point of it.
    fn start(&self) -> Vector3<f64>;
    /// Radius of the ball, mm.
    fn round_mm(&self) -> f64;
}

impl Core for Slot {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        Slot::support(self, direction)
    }

    fn start(&self) -> Vector3<f64> {
        self.start
    }

    fn round_mm(&self) -> f64 {
        self.round_mm
    }
}

/// A triangle.
impl Core for [Vector3<f64>; 3] {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let [a, b, c] = self.map(|p| p.dot(direction));
        if a >= b && a >= c { self[0] } else { self[if b >= c { 1 } else { 2 }] }
    }

    fn start(&self) -> Vector3<f64> {
        self[0]
    }

    fn round_mm(&self) -> f64 {
        0.0
    }
}

#[derive(Clone, Copy)]
struct Vertex {
    w: Vector3<f64>,
    on_a: Vector3<f64>,
}

/// Whether two slots are nearer to each other than a bound: most are told apart without the distance itself.
pub fn nearer_than(a: &Slot, b: &Slot, bound_mm: f64) -> bool {
    if let Some(s) = aligned(a, b) {
        return s.gap_mm < bound_mm;
    }
    let (center, radius) = b.bounding_sphere();
    let e = a.end - a.start;
    let along = ((center - a.start).dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let around = a.disc_radius_mm.hypot(a.half_height_mm) + a.round_mm;
    let apart = (a.start + e * along - center).norm() - around - radius;
    apart < bound_mm && until_apart(a, b, bound_mm).gap_mm < bound_mm
}

/// Signed distance of two slots.
pub fn separation(a: &Slot, b: &Slot) -> Separation {
    aligned(a, b).unwrap_or_else(|| until_apart(a, b, f64::INFINITY))
}

/// In closed form where both slots stand upright on one plane, as nearly all do in layers: the cores are then
/// stadiums of some height, whose distance is that of the segments in plan and that of the heights.
fn aligned(a: &Slot, b: &Slot) -> Option<Separation> {
    let is_capsule = |s: &Slot| s.disc_radius_mm == 0.0 && s.half_height_mm == 0.0;
    // A capsule has no axis of its own; two of them lie in two planes along what is normal to both.
    let axis = match (is_capsule(a), is_capsule(b)) {
        (true, true) => {
            let both = (a.end - a.start).cross(&(b.end - b.start));
            both.try_normalize(ALIGNED).unwrap_or(b.axis)
        }
        (true, false) => b.axis,
        (false, _) => a.axis,
    };
    let upright = |s: &Slot| is_capsule(s) || s.axis.cross(&axis).norm_squared() < ALIGNED * ALIGNED;
    let lies = |s: &Slot| {
        let d = s.end - s.start;
        d.dot(&axis).powi(2) <= ALIGNED * ALIGNED * d.norm_squared()
    };
    if !(upright(a) && upright(b) && lies(a) && lies(b)) {
        return None;
    }
    let (p, q) = closest_in_plan(a, b, &axis);
    let way = q - p;
    let up = way.dot(&axis);
    let flat = way - axis * up;
    let across = flat.norm();
    let aside = (across - a.disc_radius_mm - b.disc_radius_mm).max(0.0);
    let above = (up.abs() - a.half_height_mm - b.half_height_mm).max(0.0);
    let balls = a.round_mm + b.round_mm;
    // Half-way between the closest points: what both cores share in plan and in height is halved.
    let between = |distance: f64, from: f64, to: f64| {
        let (low, high) = ((distance - to).max(-from), from.min(distance + to));
        if low <= high { (low + high) / 2.0 } else { (from + distance - to) / 2.0 }
    };
    let along = if across > 0.0 {
        flat * (between(across, a.disc_radius_mm, b.disc_radius_mm) / across)
    } else {
        Vector3::zeros()
    };
    let at = p + along + axis * between(up.abs(), a.half_height_mm, b.half_height_mm).copysign(up);
    Some(Separation { gap_mm: (aside * aside + above * above).sqrt() - balls, at })
}

/// Points of two segments that are closest seen along an axis, which both are normal to.
fn closest_in_plan(a: &Slot, b: &Slot, axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let (d, e, r) = (a.end - a.start, b.end - b.start, a.start - b.start);
    let r = r - axis * r.dot(axis);
    let (dd, ee, de, dr, er) = (d.dot(&d), e.dot(&e), d.dot(&e), d.dot(&r), e.dot(&r));
    let ratio = |x: f64, y: f64| if y > 0.0 { (x / y).clamp(0.0, 1.0) } else { 0.0 };
    let on_b = |s: f64| ratio(er + de * s, ee);
    let on_a = |t: f64| ratio(de * t - dr, dd);
    // Inside of both lines, or else at one of the four ends.
    let inner = ratio(de * er - dr * ee, dd * ee - de * de);
    let candidates =
        [(inner, on_b(inner)), (0.0, on_b(0.0)), (1.0, on_b(1.0)), (on_a(0.0), 0.0), (on_a(1.0), 1.0)];
    let apart = |(s, t): (f64, f64)| (r + d * s - e * t).norm_squared();
    let mut best = candidates[0];
    for next in &candidates[1..] {
        if apart(*next) < apart(best) {
            best = *next;
        }
    }
    (a.start + d * best.0, b.start + e * best.1)
}

/// Signed distance, or some gap of at least `enough_mm` as soon as the true one is known to be as large.
pub(super) fn until_apart(a: &impl Core, b: &impl Core, enough_mm: f64) -> Separation {
    let balls = a.round_mm() + b.round_mm();
    let support = |d: &Vector3<f64>| {
        let on_a = a.support(&-d);
        Vertex { w: on_a - b.support(d), on_a }
    };
    let mut simplex = vec![support(&((a.start() - b.start()) + Vector3::new(1e-3, 2e-3, 3e-3)))];
    let mut v = simplex[0].w;
    let mut on_a = simplex[0].on_a;
    for _ in 0..MOST_STEPS {
        let distance2 = v.norm_squared();
        if distance2 < CROSSING_MM * CROSSING_MM {
            break;
        }
        let next = support(&v);
        let advance = distance2 - v.dot(&next.w);
        // Both cores lie on their sides of a plane this far apart.
        if v.dot(&next.w) >= (enough_mm + balls) * distance2.sqrt() {
            return Separation { gap_mm: v.norm() - balls, at: on_a - v / 2.0 };
        }
        if advance <= RELATIVE_GAP * distance2 || simplex.iter().any(|s| s.w == next.w) {
            break;
        }
        simplex.push(next);
        let weights = closest(&simplex);
        let mut kept = Vec::with_capacity(4);
        (v, on_a) = (Vector3::zeros(), Vector3::zeros());
        for (s, weight) in simplex.iter().zip(weights) {
            if weight > 0.0 {
                v += s.w * weight;
                on_a += s.on_a * weight;
                kept.push(*s);
            }
        }
        if kept.len() == 4 || v.norm_squared() >= distance2 {
            // The simplex holds the origin, or rounding stops further progress.
            if kept.len() == 4 {
                v = Vector3::zeros();
            }
            break;
        }
        simplex = kept;
    }
    Separation { gap_mm: v.norm() - balls, at: on_a - v / 2.0 }
}

/// Barycentric weights of the point of a simplex (one to four points) nearest to the origin.
fn closest(s: &[Vertex]) -> [f64; 4] {
    match s {
        [_] => [1.0, 0.0, 0.0, 0.0],
        [p, q] => {
            let [a, b] = segment(&p.w, &q.w);
            [a, b, 0.0, 0.0]
        }
        [p, q, r] => {
            let [a, b, c] = triangle(&p.w, &q.w, &r.w);
            [a, b, c, 0.0]
        }
        [p, q, r, t] => tetrahedron([&p.w, &q.w, &r.w, &t.w]),
        _ => [1.0, 0.0, 0.0, 0.0],
    }
}

/// The point of a triangle nearest to a point.
pub(super) fn point_triangle(p: &Vector3<f64>, corners: &[Vector3<f64>; 3]) -> Vector3<f64> {
    let [a, b, c] = corners.map(|q| q - p);
    let [u, v, w] = triangle(&a, &b, &c);
    corners[0] * u + corners[1] * v + corners[2] * w
}

fn segment(p: &Vector3<f64>, q: &Vector3<f64>) -> [f64; 2] {
    let d = q - p;
    let n = d.norm_squared();
    let u = if n > 0.0 { (-p.dot(&d) / n).clamp(0.0, 1.0) } else { 0.0 };
    [1.0 - u, u]
}

fn triangle(p: &Vector3<f64>, q: &Vector3<f64>, r: &Vector3<f64>) -> [f64; 3] {
    let n = (q - p).cross(&(r - p));
    let n2 = n.norm_squared();
    // Signed areas opposite each corner of the origin's projection.
    let areas = [q.cross(r).dot(&n), r.cross(p).dot(&n), p.cross(q).dot(&n)];
    if n2 > 0.0 && areas.iter().all(|x| *x >= 0.0) {
        let sum: f64 = areas.iter().sum();
        if sum > 0.0 {
            return areas.map(|x| x / sum);
        }
    }
    let edges = [(0, 1, segment(p, q)), (1, 2, segment(q, r)), (2, 0, segment(r, p))];
    let points = [p, q, r];
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for (i, j, [a, b]) in edges {
        let distance2 = (points[i] * a + points[j] * b).norm_squared();
        if distance2 < best.1 {
            let mut weights = [0.0; 3];
            weights[i] = a;
            weights[j] = b;
            best = (weights, distance2);
        }
    }
    best.0
}

fn tetrahedron(p: [&Vector3<f64>; 4]) -> [f64; 4] {
    let det = |a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>| a.dot(&b.cross(c));
    // Weights of the origin by Cramer's rule; all of one sign: it is inside.
    let w = [det(p[1], p[2], p[3]), -det(p[0], p[2], p[3]), det(p[0], p[1], p[3]), -det(p[0], p[1], p[2])];
    let sum: f64 = w.iter().sum();
    let scale = p.iter().map(|x| x.norm()).fold(0.0, f64::max).powi(3);
    if sum.abs() > 1e-14 * scale && w.iter().all(|x| x * sum.signum() > 0.0) {
        return w.map(|x| x / sum);
    }
    let mut best = ([1.0, 0.0, 0.0, 0.0], f64::INFINITY);
    for skip in 0..4 {
        let ids: Vec<usize> = (0..4).filter(|i| *i != skip).collect();
        let weights = triangle(p[ids[0]], p[ids[1]], p[ids[2]]);
        let point = p[ids[0]] * weights[0] + p[ids[1]] * weights[1] + p[ids[2]] * weights[2];
        if point.norm_squared() < best.1 {
            let mut all = [0.0; 4];
            for (i, weight) in ids.iter().zip(weights) {
                all[*i] = weight;
            }
            best = (all, point.norm_squared());
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in −1..1 from a counter.
    fn noise(k: usize) -> f64 {
        2.0 * ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 1.0
    }

    fn plan(k: usize) -> Vector3<f64> {
        Vector3::new(12.0 * noise(k), 12.0 * noise(k + 1), 6.0 * noise(k + 2))
    }

    /// Both ways agree on stadiums, discs, leaves and capsules in layers, and on capsules in space.
    #[test]
    fn the_closed_form_is_what_the_iteration_finds() {
        let (mut apart, mut crossing) = (0, 0);
        for k in 0..4000 {
            let seed = 40 * k;
            let z = Vector3::z();
            let slot = |seed: usize, kind: usize| {
                let (p, q) = (plan(seed), plan(seed + 3));
                let flat = Vector3::new(q.x, q.y, p.z);
                let size = |i: usize| 0.2 + 2.0 * noise(seed + 6 + i).abs();
                match kind % 5 {
                    0 => Slot::bar(p, flat, z, 0.3 + size(0), size(1), 0.3),
                    1 => Slot::bar(p, p, -z, 0.3 + size(0), size(1), 0.3),
                    2 => Slot { disc_radius_mm: 0.0, ..Slot::bar(p, flat, z, 0.4, size(1), 0.4) },
                    3 => Slot::capsule(p, flat, size(0)),
                    _ => Slot::capsule(p, q, size(0)),
                }
            };
            let (a, b) = (slot(seed, k), slot(seed + 20, k / 5));
            let Some(exact) = aligned(&a, &b) else {
                assert!(k % 5 == 4 || k / 5 % 5 == 4, "{a:?} {b:?}");
                continue;
            };
            let found = until_apart(&a, &b, f64::INFINITY);
            assert!((exact.gap_mm - found.gap_mm).abs() < 1e-6, "{a:?} {b:?}: {exact:?} {found:?}");
            // The place is on the way from one to the other.
            if exact.gap_mm > 0.0 {
                apart += 1;
                let half = exact.gap_mm / 2.0;
                for s in [&a, &b] {
                    let point = Slot::capsule(exact.at, exact.at, 0.0);
                    let way = until_apart(s, &point, f64::INFINITY).gap_mm;
                    assert!(way >= half - s.round_mm.max(1e-6) - 1e-6, "{way} {half}");
                }
            } else {
                crossing += 1;
            }
        }
        assert!(apart > 500 && crossing > 200, "{apart} {crossing}");
    }
}
