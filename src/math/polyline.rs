//! Nearest places of a piecewise straight curve.

use nalgebra::Vector3;

/// The place of a curve nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The place.
    pub place: Vector3<f64>,
    /// Unit direction in which the place moves with the point; none at a corner, where it stays.
    pub along: Option<Vector3<f64>>,
    /// Index of the corner where its side begins.
    pub corner: usize,
    /// Part of the side before it.
    pub share: f64,
}

/// Place of the curve through `corners` (one at least) nearest to `point`; of several the first.
pub fn nearest(corners: &[Vector3<f64>], point: &Vector3<f64>) -> Nearest {
    let first = corners.first().copied().unwrap_or_default();
    let mut best = Nearest { place: first, along: None, corner: 0, share: 0.0 };
    let mut least = (point - first).norm_squared();
    for (corner, pair) in corners.windows(2).enumerate() {
        let [a, b] = [pair[0], pair[1]];
        let chord = b - a;
        let length2 = chord.norm_squared();
        let share = if length2 > 0.0 { (point - a).dot(&chord) / length2 } else { 0.0 };
        let inside = share > 0.0 && share < 1.0;
        let place = if inside {
            a + chord * share
        } else if share >= 1.0 {
            b
        } else {
            a
        };
        let distance = (point - place).norm_squared();
        if distance < least {
            least = distance;
            let along = inside.then(|| chord / length2.sqrt());
            best = Nearest { place, along, corner, share: share.clamp(0.0, 1.0) };
        }
    }
    best
}

/// A smooth curve through points at equal times, cut into `pieces` chords an interval: Catmull–Rom, fourth-order
/// accurate inside. A `closed` one's last point is its first.
pub fn refined(points: &[Vector3<f64>], closed: bool, pieces: usize) -> Vec<Vector3<f64>> {
    let last = points.len().saturating_sub(1);
    if last < 2 || pieces < 2 {
        return points.to_vec();
    }
    let slope = |i: usize| match i {
        0 if closed => (points[1] - points[last - 1]) / 2.0,
        0 => (points[1] * 4.0 - points[0] * 3.0 - points[2]) / 2.0,
        i if i == last && closed => (points[1] - points[last - 1]) / 2.0,
        i if i == last => (points[last] * 3.0 - points[last - 1] * 4.0 + points[last - 2]) / 2.0,
        i => (points[i + 1] - points[i - 1]) / 2.0,
    };
    let mut out = Vec::with_capacity(last * pieces + 1);
    for i in 0..last {
        let (p0, p1, m0, m1) = (points[i], points[i + 1], slope(i), slope(i + 1));
        for k in 0..pieces {
            let u = k as f64 / pieces as f64;
            let (u2, u3) = (u * u, u * u * u);
            out.push(
                p0 * (2.0 * u3 - 3.0 * u2 + 1.0)
                    + m0 * (u3 - 2.0 * u2 + u)
                    + p1 * (3.0 * u2 - 2.0 * u3)
                    + m1 * (u3 - u2),
            );
        }
    }
    out.push(points[last]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64) -> Vector3<f64> {
        Vector3::new(x, y, 0.0)
    }

    #[test]
    fn the_foot_lies_inside_a_side_or_at_a_corner() {
        let corners = [v(0.0, 0.0), v(4.0, 0.0), v(4.0, 3.0)];
        let side = nearest(&corners, &v(1.0, 2.0));
        assert_eq!((side.place, side.along), (v(1.0, 0.0), Some(v(1.0, 0.0))));
        let corner = nearest(&corners, &v(5.0, -1.0));
        assert_eq!((corner.place, corner.along), (v(4.0, 0.0), None));
        assert_eq!(nearest(&corners, &v(-2.0, 1.0)).place, v(0.0, 0.0));
        assert_eq!(nearest(&corners, &v(4.5, 9.0)).place, v(4.0, 3.0));
        // A repeated corner is no side.
        let twice = [v(1.0, 0.0), v(1.0, 0.0), v(2.0, 0.0)];
        assert_eq!(nearest(&twice, &v(0.0, 0.0)).place, v(1.0, 0.0));
    }

    #[test]
    fn a_refined_circle_is_nearly_one() {
        let at = |i: usize, n: usize| {
            let (s, c) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
            v(c, s)
        };
        let circle: Vec<_> = (0..=30).map(|i| at(i, 30)).collect();
        let off = |curve: &[Vector3<f64>]| {
            (0..777).map(|i| (nearest(curve, &at(i, 777)).place - at(i, 777)).norm()).fold(0.0, f64::max)
        };
        let fine = refined(&circle, true, 8);
        assert_eq!(fine.len(), 241);
        assert!(off(&circle) > 5e-3 && off(&fine) < 2e-4, "{} {}", off(&circle), off(&fine));
        // An open piece of it is as good up to its ends.
        let open = refined(&circle[..11], false, 8);
        let end = (0..=10).map(|i| at(2 * i + 1, 60)).take(10);
        assert!(end.map(|p| (nearest(&open, &p).place - p).norm()).fold(0.0, f64::max) < 2e-3);
    }
}
