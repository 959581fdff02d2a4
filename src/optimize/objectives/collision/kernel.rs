//! What it costs a point to be near a segment: the mean over the segment of the penalty of the distance.
//!
//! P(d) = ((D² − d²)/D²)³ for d < D (Megaro et al. 2017, eq. 7), carried on linearly below D/√5, where its slope is
//! steepest: so P is convex, its second derivative continuous, and its slope does not die at d = 0. The integral is
//! exact: no nearest point is asked for, so nothing jumps where a segment turns parallel to another.

use nalgebra::Vector3;

/// P of the linear part at d = 0: 0.8³ + 6·0.8²/5.
const LINEAR_AT_ZERO: f64 = 1.28;
/// Its slope times −D: 6·0.8²/√5.
const LINEAR_SLOPE: f64 = 1.717_300_206_719_839_6;
/// Squared ratio of d and D below which P is linear.
const LINEAR_BELOW: f64 = 0.2;
/// Segments shorter than this part of D are summed at three points: the closed form would cancel.
const SHORT: f64 = 0.02;
/// Least distance from the segment's line relative to D, for the logarithm.
const LEAST: f64 = 1e-9;
/// Gauss–Legendre nodes on −1..1 and weights of sum 1: three points …
pub(super) const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 4.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];
/// … and four, exact for the cubic part's polynomials of degree 6.
const GAUSS_4: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.173_927_422_568_726_93),
    (-0.339_981_043_584_856_26, 0.326_072_577_431_273_07),
    (0.339_981_043_584_856_26, 0.326_072_577_431_273_07),
    (0.861_136_311_594_052_6, 0.173_927_422_568_726_93),
];

/// Mean penalty and its first derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Near {
    /// Mean over the segment.
    pub value: f64,
    /// By the point.
    pub by_point: Vector3<f64>,
    /// By the segment's ends.
    pub by_ends: [Vector3<f64>; 2],
    /// By D.
    pub by_reach: f64,
}

/// Sums over the segment, s from 0 to 1 on it.
#[derive(Default)]
struct Sums {
    value: f64,
    by_reach: f64,
    /// Of ∂P/∂(d²) s^k.
    moments: [f64; 3],
}

/// P, ∂P/∂(d²) and ∂P/∂D.
fn penalty(square: f64, reach: f64) -> (f64, f64, f64) {
    let part = square / (reach * reach);
    if part >= 1.0 {
        return (0.0, 0.0, 0.0);
    }
    if part < LINEAR_BELOW {
        let d = square.sqrt().max(LEAST * reach);
        let slope = LINEAR_SLOPE / reach;
        return (LINEAR_AT_ZERO - slope * d, -0.5 * slope / d, slope * d / reach);
    }
    let u = 1.0 - part;
    (u * u * u, -3.0 * u * u / (reach * reach), 6.0 * u * u * part / reach)
}

/// Mean penalty of `point` over the segment between `ends`, with penalties below the distance `reach`; none if it is zero.
pub fn near(point: &Vector3<f64>, ends: [&Vector3<f64>; 2], reach: f64) -> Option<Near> {
    let (e, w) = (ends[1] - ends[0], ends[0] - point);
    let length = e.norm();
    let mut sums = Sums::default();
    if length < SHORT * reach {
        for (x, weight) in GAUSS_3 {
            let s = 0.5 * (1.0 + x);
            sums.add(weight, s, penalty((w + e * s).norm_squared(), reach));
        }
    } else {
        let from = w.dot(&e) / length;
        let off2 = (w.norm_squared() - from * from).max(0.0);
        let outer2 = reach * reach - off2;
        if outer2 <= 0.0 {
            return None;
        }
        let outer = outer2.sqrt();
        let (low, high) = (from.max(-outer), (from + length).min(outer));
        if low >= high {
            return None;
        }
        let line = Line { from, length, off2, reach };
        let inner2 = LINEAR_BELOW * reach * reach - off2;
        if inner2 > 0.0 {
            let inner = inner2.sqrt();
            line.cubic(&mut sums, low, high.min(-inner));
            line.linear(&mut sums, low.max(-inner), high.min(inner));
            line.cubic(&mut sums, low.max(inner), high);
        } else {
            line.cubic(&mut sums, low, high);
        }
    }
    if sums.value <= 0.0 {
        return None;
    }
    let [j0, j1, j2] = sums.moments;
    Some(Near {
        value: sums.value,
        by_point: (w * j0 + e * j1) * -2.0,
        by_ends: [(w * (j0 - j1) + e * (j1 - j2)) * 2.0, (w * j1 + e * j2) * 2.0],
        by_reach: sums.by_reach,
    })
}

impl Sums {
    fn add(&mut self, weight: f64, s: f64, (value, by_square, by_reach): (f64, f64, f64)) {
        self.value += weight * value;
        self.by_reach += weight * by_reach;
        for (k, moment) in self.moments.iter_mut().enumerate() {
            *moment += weight * by_square * s.powi(k as i32);
        }
    }
}

/// A segment as the point sees it: τ along it from the foot of the perpendicular, mm.
struct Line {
    from: f64,
    length: f64,
    /// Square of the perpendicular.
    off2: f64,
    reach: f64,
}

impl Line {
    fn cubic(&self, sums: &mut Sums, low: f64, high: f64) {
        if low >= high {
            return;
        }
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let scale = (high - low) / self.length;
        for (x, weight) in GAUSS_4 {
            let tau = middle + half * x;
            let part = (self.off2 + tau * tau) / (self.reach * self.reach);
            let u = 1.0 - part;
            let at = (u * u * u, -3.0 * u * u / (self.reach * self.reach), 6.0 * u * u * part / self.reach);
            sums.add(weight * scale, (tau - self.from) / self.length, at);
        }
    }

    fn linear(&self, sums: &mut Sums, low: f64, high: f64) {
        if low >= high {
            return;
        }
        let off = self.off2.sqrt().max(LEAST * self.reach);
        let off2 = off * off;
        let slope = LINEAR_SLOPE / self.reach;
        // Integrals of 1/d, τ/d, τ²/d and d from 0.
        let at = |tau: f64| {
            let (d, log) = ((off2 + tau * tau).sqrt(), (tau / off).asinh());
            [log, d, 0.5 * (tau * d - off2 * log), 0.5 * (tau * d + off2 * log)]
        };
        let (a, b) = (at(low), at(high));
        let [t0, t1, t2, distance] = std::array::from_fn(|k| (b[k] - a[k]) / self.length);
        let width = (high - low) / self.length;
        sums.value += LINEAR_AT_ZERO * width - slope * distance;
        sums.by_reach += slope * distance / self.reach;
        // s = (τ − from)/length
        let (f, l) = (self.from, self.length);
        let moments = [t0, (t1 - f * t0) / l, (t2 - 2.0 * f * t1 + f * f * t0) / (l * l)];
        for (to, m) in sums.moments.iter_mut().zip(moments) {
            *to -= 0.5 * slope * m;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points beside, beyond, near and on a segment of 10 mm, with reach 4 mm.
    const POINTS: [[f64; 3]; 9] = [
        [5.0, 3.0, 0.5],
        [5.0, 1.0, 0.5],
        [-1.5, 2.0, 1.0],
        [11.0, 0.3, -0.2],
        [0.2, 1.7, 0.4],
        [9.5, -0.6, 1.5],
        [5.0, 0.01, 0.0],
        [-3.5, 0.2, 0.1],
        [4.0, 1.788, 0.0],
    ];

    fn ends() -> [Vector3<f64>; 2] {
        [Vector3::new(0.0, 0.1, -0.2), Vector3::new(10.0, -0.1, 0.2)]
    }

    #[test]
    fn the_closed_form_is_the_integral() {
        let [a, b] = ends();
        for p in POINTS.map(Vector3::from) {
            let steps = 400_000;
            let s = |k: i32| (f64::from(k) + 0.5) / f64::from(steps);
            let sum: f64 = (0..steps).map(|k| penalty((a + (b - a) * s(k) - p).norm_squared(), 4.0).0).sum();
            let (want, got) = (sum / f64::from(steps), near(&p, [&a, &b], 4.0).unwrap().value);
            assert!((got / want - 1.0).abs() < 1e-7, "{p} {got} {want}");
        }
        assert_eq!(near(&Vector3::new(5.0, 4.2, 0.0), [&a, &b], 4.0), None);
        assert_eq!(near(&Vector3::new(-4.1, 0.0, 0.0), [&a, &b], 4.0), None);
    }

    #[test]
    fn derivatives_match_differences() {
        for shrink in [1.0, 0.5, 1e-3, 0.0] {
            let [a, b] = ends();
            let b = a + (b - a) * shrink;
            for p in POINTS.map(Vector3::from) {
                let mut all = [p.x, p.y, p.z, a.x, a.y, a.z, b.x, b.y, b.z, 4.0];
                let at = |v: &[f64; 10]| {
                    let x = |i: usize| Vector3::new(v[i], v[i + 1], v[i + 2]);
                    near(&x(0), [&x(3), &x(6)], v[9])
                };
                let Some(exact) = at(&all) else { continue };
                let vectors = [exact.by_point, exact.by_ends[0], exact.by_ends[1]];
                let mut exact: Vec<f64> = vectors.iter().flat_map(|v| v.iter().copied()).collect();
                exact.push(at(&all).unwrap().by_reach);
                let largest = exact.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                for (i, exact) in exact.iter().enumerate() {
                    let mut value = |h: f64| {
                        all[i] += h;
                        let v = at(&all).unwrap_or_default().value;
                        all[i] -= h;
                        v
                    };
                    let h = 1e-4;
                    let d =
                        (value(-2.0 * h) - 8.0 * value(-h) + 8.0 * value(h) - value(2.0 * h)) / (12.0 * h);
                    assert!((d - exact).abs() < 1e-6 * largest, "{shrink} {p} {i}: {d} {exact}");
                }
            }
        }
    }

    /// Value, slope and curvature of P are continuous where it turns linear, and where it ends.
    #[test]
    fn the_linear_part_joins_smoothly() {
        for (at, value) in [(4.0 / 5.0f64.sqrt(), 0.512), (4.0, 0.0)] {
            let p = |d: f64| penalty(d * d, 4.0).0;
            let h = 1e-4;
            let slope = |d: f64| (p(d + h) - p(d - h)) / (2.0 * h);
            let curvature = |d: f64| (p(d + h) - 2.0 * p(d) + p(d - h)) / (h * h);
            assert!((p(at) - value).abs() < 1e-12);
            assert!((slope(at + 2.0 * h) - slope(at - 2.0 * h)).abs() < 1e-6);
            assert!((curvature(at + 2.0 * h) - curvature(at - 2.0 * h)).abs() < 1e-3);
        }
        assert!(penalty(0.0, 4.0).0 > penalty(0.1, 4.0).0, "it falls from the axis on");
        // Cutting a segment in two halves changes nothing.
        let ([a, b], x) = (ends(), Vector3::new(3.0, 0.7, 0.4));
        let middle = (a + b) / 2.0;
        let [whole, first, second] =
            [[a, b], [a, middle], [middle, b]].map(|[p, q]| near(&x, [&p, &q], 4.0).unwrap().value);
        assert!((whole - 0.5 * (first + second)).abs() < 1e-14);
    }
}
