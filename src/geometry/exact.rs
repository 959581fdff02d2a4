//! Exact answers about points on a lattice: on which side of a plane, whether triangles meet. A tolerance would let
//! through what a program with exact arithmetic refuses: slivers that cross their neighbours by a rounding error.

use nalgebra::Vector3;
use std::cmp::Ordering;

/// Lattice points a millimetre: a millionth of a millimetre apart, a power of two so that `f32` holds them all below
/// 16 mm, and beyond every `f32` is one.
pub const LATTICE_PER_MM: f64 = 1_048_576.0;

/// Coordinates are kept below half a kilometre, so that a determinant fits into 128 bits.
const FARTHEST: f64 = (1_u64 << 39) as f64;

/// A point in lattice steps.
pub type Point = [i64; 3];

/// The nearest lattice point.
pub fn on_lattice(p: &Vector3<f64>) -> Point {
    [p.x, p.y, p.z].map(|x| (x * LATTICE_PER_MM).round().clamp(-FARTHEST, FARTHEST) as i64)
}

/// On which side of the plane through `a`, `b`, `c` a point lies: above (`Greater`) is where they run counter-clockwise.
pub fn side(a: &Point, b: &Point, c: &Point, p: &Point) -> Ordering {
    /// Rounding of the determinant by its sum of absolute values (Shewchuk 1997: 7 units of rounding, and a little).
    const ROUNDING: f64 = 1e-15;
    let from_a = |q: &Point| [q[0] - a[0], q[1] - a[1], q[2] - a[2]];
    let (u, v, w) = (from_a(b), from_a(c), from_a(p));
    // Flat faces of layers are the most of what is in one plane.
    if (0..3).any(|k| u[k] == 0 && v[k] == 0 && w[k] == 0) {
        return Ordering::Equal;
    }
    let [x, y, z] = [u, v, w].map(|d| d.map(|i| i as f64));
    let terms = [
        (x[1] * y[2], x[2] * y[1], z[0]),
        (x[2] * y[0], x[0] * y[2], z[1]),
        (x[0] * y[1], x[1] * y[0], z[2]),
    ];
    let sum: f64 = terms.iter().map(|(s, t, z)| (s - t) * z).sum();
    let size: f64 = terms.iter().map(|(s, t, z)| (s.abs() + t.abs()) * z.abs()).sum();
    if sum.abs() > ROUNDING * size {
        return sum.total_cmp(&0.0);
    }
    let [u, v, w] = [u, v, w].map(|d| d.map(i128::from));
    let exact = (u[1] * v[2] - u[2] * v[1]) * w[0]
        + (u[2] * v[0] - u[0] * v[2]) * w[1]
        + (u[0] * v[1] - u[1] * v[0]) * w[2];
    exact.cmp(&0)
}

/// On which side of the line from `a` to `b` a point lies, in the plane without coordinate `dropped`.
fn side_in_plane(a: &Point, b: &Point, p: &Point, dropped: usize) -> Ordering {
    let (i, j) = ((dropped + 1) % 3, (dropped + 2) % 3);
    let [x, y] = [b, p].map(|q| [q[i] - a[i], q[j] - a[j]]);
    // Differences are exact in floats, their products to half a unit each.
    let [s, t] = [x[0] as f64 * y[1] as f64, x[1] as f64 * y[0] as f64];
    if (s - t).abs() > 4.0 * f64::EPSILON * (s.abs() + t.abs()) {
        return s.total_cmp(&t);
    }
    let [x, y] = [x, y].map(|d| d.map(i128::from));
    (x[0] * y[1] - x[1] * y[0]).cmp(&0)
}

/// A coordinate without which the triangle still has an area; none: it has none.
fn seen_along([a, b, c]: &[Point; 3]) -> Option<usize> {
    (0..3).find(|k| side_in_plane(a, b, c, *k) != Ordering::Equal)
}

/// Whether a triangle has no area.
pub fn is_flat(t: &[Point; 3]) -> bool {
    seen_along(t).is_none()
}

/// Whether signs are not of both kinds.
fn agree(signs: [Ordering; 3]) -> bool {
    !(signs.contains(&Ordering::Less) && signs.contains(&Ordering::Greater))
}

/// Whether a segment and a triangle with an area have a point in common, borders included.
pub fn segment_meets(p: &Point, q: &Point, t: &[Point; 3]) -> bool {
    let [a, b, c] = t;
    match (side(a, b, c, p), side(a, b, c, q)) {
        (Ordering::Equal, Ordering::Equal) => {
            seen_along(t).is_some_and(|dropped| segment_meets_in_plane(p, q, t, dropped))
        }
        (s, r) if s == r => false,
        _ => agree([side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)]),
    }
}

fn segment_meets_in_plane(p: &Point, q: &Point, t: &[Point; 3], dropped: usize) -> bool {
    let side = |a: &Point, b: &Point, x: &Point| side_in_plane(a, b, x, dropped);
    let inside = |x: &Point| agree([0, 1, 2].map(|k| side(&t[k], &t[(k + 1) % 3], x)));
    let between = |a: &Point, b: &Point, x: &Point| {
        (0..3).all(|k| a[k].min(b[k]) <= x[k] && x[k] <= a[k].max(b[k])) && side(a, b, x) == Ordering::Equal
    };
    let crosses = |a: &Point, b: &Point| {
        let (ends, others) = ((side(a, b, p), side(a, b, q)), (side(p, q, a), side(p, q, b)));
        let apart = |s: (Ordering, Ordering)| s.0 != Ordering::Equal && s.0 == s.1.reverse();
        (apart(ends) && apart(others))
            || between(a, b, p)
            || between(a, b, q)
            || between(p, q, a)
            || between(p, q, b)
    };
    inside(p) || inside(q) || (0..3).any(|k| crosses(&t[k], &t[(k + 1) % 3]))
}

/// Directions in which neighbours at a corner are parted first: axes and diagonals.
const WAYS: [Point; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, -1, 0],
    [1, 0, 1],
    [1, 0, -1],
    [0, 1, 1],
    [0, 1, -1],
    [1, 1, 1],
    [1, 1, -1],
    [1, -1, 1],
    [-1, 1, 1],
];

/// Whether two triangles with one corner in common lie on both sides of a plane through it that one of them leaves there: most
/// neighbours do for one of a few planes, which costs less than to ask where they meet.
fn parted(s_ids: &[usize; 3], s: &[Point; 3], t_ids: &[usize; 3], t: &[Point; 3]) -> bool {
    let Some(k) = (0..3).find(|k| t_ids.contains(&s_ids[*k])) else { return false };
    let Some(l) = (0..3).find(|l| t_ids[*l] == s_ids[k]) else { return false };
    let from = |q: &Point| [q[0] - s[k][0], q[1] - s[k][1], q[2] - s[k][2]];
    let corners = [&s[(k + 1) % 3], &s[(k + 2) % 3], &t[(l + 1) % 3], &t[(l + 2) % 3]].map(from);
    WAYS.iter().any(|way| {
        // Below 2^42.
        let [a, b, c, d] = corners.map(|q| q[0] * way[0] + q[1] * way[1] + q[2] * way[2]);
        let (low, high) = ((a.max(b), a.min(b)), (c.max(d), c.min(d)));
        let below = low.0 <= 0 && high.1 >= 0 && (low.0 < 0 || high.1 > 0);
        let above = low.1 >= 0 && high.0 <= 0 && (low.1 > 0 || high.0 < 0);
        below || above
    })
}

/// Whether two triangles with areas have more in common than the corners given by the same index: two neighbours more than
/// their edge, others more than their corner.
pub fn triangles_meet(s_ids: &[usize; 3], s: &[Point; 3], t_ids: &[usize; 3], t: &[Point; 3]) -> bool {
    let own =
        |ids: &[usize; 3], others: &[usize; 3]| (0..3).find(|k| !others.contains(&ids[*k])).unwrap_or(0);
    let common = |ids: &[usize; 3], others: &[usize; 3]| (0..3).find(|k| others.contains(&ids[*k]));
    // Nearly all pairs are told apart here: what they do not share of one lies on one side of the other's plane.
    let beside = |ids: &[usize; 3], x: &[Point; 3], others: &[usize; 3], y: &[Point; 3]| {
        let mut sides =
            (0..3).filter(|k| !others.contains(&ids[*k])).map(|k| side(&y[0], &y[1], &y[2], &x[k]));
        sides.next().is_some_and(|first| first != Ordering::Equal && sides.all(|s| s == first))
    };
    if beside(s_ids, s, t_ids, t) || beside(t_ids, t, s_ids, s) {
        return false;
    }
    match s_ids.iter().filter(|i| t_ids.contains(i)).count() {
        0 => {
            (0..3).any(|k| segment_meets(&s[k], &s[(k + 1) % 3], t))
                || (0..3).any(|k| segment_meets(&t[k], &t[(k + 1) % 3], s))
        }
        1 if parted(s_ids, s, t_ids, t) => false,
        1 => {
            let opposite = |ids: &[usize; 3], others: &[usize; 3], x: &[Point; 3], y: &[Point; 3]| {
                common(ids, others).is_some_and(|k| segment_meets(&x[(k + 1) % 3], &x[(k + 2) % 3], y))
            };
            opposite(s_ids, t_ids, s, t) || opposite(t_ids, s_ids, t, s)
        }
        2 => {
            let (i, j) = (own(s_ids, t_ids), own(t_ids, s_ids));
            let (a, b) = (&s[(i + 1) % 3], &s[(i + 2) % 3]);
            let folded = |k| side_in_plane(a, b, &s[i], k) == side_in_plane(a, b, &t[j], k);
            side(a, b, &s[i], &t[j]) == Ordering::Equal && seen_along(s).is_some_and(folded)
        }
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: [Point; 3] = [[0, 0, 0], [8, 0, 0], [0, 8, 0]];

    #[test]
    fn sides_are_exact_where_rounding_would_decide() {
        // A plane through points a kilometre apart, and points one step off it.
        let far = 1_i64 << 38;
        let (a, b, c) = ([0, 0, 0], [far, 1, far - 1], [1, far, far + 3]);
        let sum = [b[0] + c[0], b[1] + c[1], b[2] + c[2]];
        assert_eq!(side(&a, &b, &c, &sum), Ordering::Equal);
        assert_eq!(side(&a, &b, &c, &[sum[0], sum[1], sum[2] + 1]), Ordering::Greater);
        assert_eq!(side(&a, &b, &c, &[sum[0], sum[1], sum[2] - 1]), Ordering::Less);
    }

    #[test]
    fn segments_touch_with_their_borders() {
        for (p, q, meets) in [
            ([1, 1, -1], [1, 1, 1], true),
            ([5, 5, -1], [5, 5, 1], false),
            ([4, 4, -1], [4, 4, 1], true),
            ([0, 0, 0], [0, 0, 9], true),
            ([1, 1, 1], [2, 2, 9], false),
            // In its plane: inside, across, along an edge, beside.
            ([1, 1, 0], [2, 2, 0], true),
            ([-9, 3, 0], [9, 3, 0], true),
            ([-4, 0, 0], [12, 0, 0], true),
            ([9, 0, 0], [12, 0, 0], false),
            ([5, 5, 0], [9, 9, 0], false),
        ] {
            assert_eq!(segment_meets(&p, &q, &T), meets, "{p:?} {q:?}");
            assert_eq!(segment_meets(&q, &p, &T), meets, "{q:?} {p:?}");
        }
    }

    /// Whatever is parted does not meet, and most that does not meet is parted.
    #[test]
    fn parted_neighbours_have_their_corner_only() {
        let noise = |k: usize| ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0);
        // On few places, so that much of it is aligned.
        let place = |k: usize| [3 * k, 3 * k + 1, 3 * k + 2].map(|k| (noise(k) * 7.0) as i64 - 3);
        let (mut parts, mut apart, mut meet) = (0, 0, 0);
        for k in 0..20_000 {
            let c = place(5 * k);
            let (s, t) = ([c, place(5 * k + 1), place(5 * k + 2)], [place(5 * k + 3), c, place(5 * k + 4)]);
            if is_flat(&s) || is_flat(&t) {
                continue;
            }
            let meets = segment_meets(&s[1], &s[2], &t) || segment_meets(&t[2], &t[0], &s);
            let parted = parted(&[0, 1, 2], &s, &[3, 0, 4], &t);
            assert!(!(meets && parted), "{s:?} {t:?}");
            assert_eq!(triangles_meet(&[0, 1, 2], &s, &[3, 0, 4], &t), meets);
            parts += usize::from(parted);
            apart += usize::from(!meets);
            meet += usize::from(meets);
        }
        assert!(meet > 1000 && parts > apart / 2, "{parts} of {apart} are parted, {meet} meet");
    }

    #[test]
    fn neighbours_meet_only_where_they_fold_or_cross() {
        let over = |p: Point| triangles_meet(&[0, 1, 2], &T, &[1, 0, 3], &[T[1], T[0], p]);
        assert!(!over([3, -5, 0]) && !over([3, 5, 1]) && over([3, 5, 0]));
        let corner = |p: Point, q: Point| triangles_meet(&[0, 1, 2], &T, &[0, 3, 4], &[T[0], p, q]);
        assert!(!corner([-3, 0, 0], [0, -3, 0]) && !corner([3, 3, 1], [4, 3, 1]));
        assert!(corner([3, 3, 1], [3, 3, -1]) && corner([9, 9, 0], [9, 8, 0]));
        assert!(is_flat(&[[0, 0, 0], [1, 2, 3], [2, 4, 6]]) && !is_flat(&T));
    }
}
