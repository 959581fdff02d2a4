//! Rest shape of a rod: a cubic Hermite curve cut at equal arc length, clamped at the midpoints of its
//! first and last edge, framed by the joint axis; generic over dual numbers, so that every rest quantity
//! has exact derivatives by the parameters (the arc-length inversion by one Newton step in dual numbers,
//! which is the implicit function theorem). Megaro et al. 2017, sec. 3.1; discretisation of Bergou et al.
//! 2008 and 2010.

use super::options::{RestFrames, RodOptions};
use super::section::{RodMaterial, Stiffness};
use crate::math::dual::Real;
use nalgebra::Vector3;
use std::fmt;

/// Number of parameters of one rod.
pub const PARAMETERS: usize = 19;
/// Fewest edges: below, the stretch correction of the two end edges would meet.
pub const MIN_EDGES: usize = 6;
/// Panels of the arc-length quadrature, eight Gauss points each.
const PANELS: usize = 8;
/// Least speed |dP/du| relative to the length: below, arc length cannot be inverted smoothly.
const MIN_SPEED: f64 = 1e-3;
/// Least sine between joint axis and rest edge: the material frame turns as 1/sine.
const MIN_AXIS_SINE: f64 = 1e-2;
/// Gauss–Legendre nodes on [−1, 1] (positive half) and weights, 8 points.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// The 19 numbers of a rod, rest world coordinates, mm. Their order in arrays is the order of the fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodParameters {
    /// Attachment on link A: P(0).
    pub position_a: Vector3<f64>,
    /// Hermite derivative dP/du at u = 0.
    pub derivative_a: Vector3<f64>,
    /// Attachment on link B: P(1).
    pub position_b: Vector3<f64>,
    /// Hermite derivative dP/du at u = 1.
    pub derivative_b: Vector3<f64>,
    /// Joint axis (any length): m₂ is its projection normal to each rest edge, or with
    /// [`RestFrames::Transport`] to the first.
    pub axis: Vector3<f64>,
    /// Half width along m₁ (thin; of an ellipse the semi-axis), of a tapered rod at end A, mm.
    pub a: f64,
    /// Half width along m₂ (wide), of a tapered rod at end A, mm.
    pub b: f64,
    /// Half width along m₁ at end B; without meaning unless [`RodOptions::taper`], mm.
    pub a_to: f64,
    /// Half width along m₂ at end B; without meaning unless [`RodOptions::taper`], mm.
    pub b_to: f64,
}

impl RodParameters {
    /// A straight rod from `from` to `to` in its natural parametrisation.
    pub fn straight(from: Vector3<f64>, to: Vector3<f64>, axis: Vector3<f64>, a: f64, b: f64) -> Self {
        let d = to - from;
        Self {
            position_a: from,
            derivative_a: d,
            position_b: to,
            derivative_b: d,
            axis,
            a,
            b,
            a_to: a,
            b_to: b,
        }
    }

    /// As an array.
    pub fn to_array(&self) -> [f64; PARAMETERS] {
        let mut q = [0.0; PARAMETERS];
        let vectors =
            [&self.position_a, &self.derivative_a, &self.position_b, &self.derivative_b, &self.axis];
        for (to, v) in q.chunks_exact_mut(3).zip(vectors) {
            to.copy_from_slice(v.as_slice());
        }
        q[15..].copy_from_slice(&[self.a, self.b, self.a_to, self.b_to]);
        q
    }

    /// From an array.
    pub fn from_array(q: &[f64; PARAMETERS]) -> Self {
        let v = |i: usize| Vector3::new(q[i], q[i + 1], q[i + 2]);
        Self {
            position_a: v(0),
            derivative_a: v(3),
            position_b: v(6),
            derivative_b: v(9),
            axis: v(12),
            a: q[15],
            b: q[16],
            a_to: q[17],
            b_to: q[18],
        }
    }
}

/// Why a rod cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RodError {
    /// Fewer than [`MIN_EDGES`] edges.
    TooFewEdges {
        /// Edges asked for.
        edges: usize,
    },
    /// A parameter is not finite.
    NotFinite,
    /// A semi-axis or modulus is not positive.
    BadSection,
    /// The Hermite curve nearly stops: its end tangents are too short, too long or opposed.
    DegenerateCurve {
        /// Curve parameter of the slowest sampled point.
        u: f64,
        /// Speed there relative to the length.
        relative_speed: f64,
    },
    /// The joint axis is nearly parallel to a rest edge.
    AxisParallel {
        /// The edge.
        edge: usize,
    },
}

impl fmt::Display for RodError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewEdges { edges } => write!(f, "a rod needs at least {MIN_EDGES} edges, not {edges}"),
            Self::NotFinite => write!(f, "a rod parameter is not a finite number"),
            Self::BadSection => write!(f, "semi-axes and moduli must be positive"),
            Self::DegenerateCurve { u, relative_speed } => write!(
                f,
                "the rest curve nearly stops at u = {u:.3} (speed {relative_speed:.2e} of its length)"
            ),
            Self::AxisParallel { edge } => {
                write!(f, "the joint axis is nearly parallel to edge {edge} of the rest curve")
            }
        }
    }
}

impl std::error::Error for RodError {}

type V<T> = [T; 3];

fn dot<T: Real>(a: &V<T>, b: &V<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<T: Real>(a: &V<T>, b: &V<T>) -> V<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn axpy<T: Real>(a: &V<T>, s: T, b: &V<T>) -> V<T> {
    std::array::from_fn(|i| a[i] + s * b[i])
}

fn norm<T: Real>(a: &V<T>) -> T {
    dot(a, a).sqrt()
}

fn unit<T: Real>(a: &V<T>) -> V<T> {
    let l = norm(a);
    a.map(|x| x / l)
}

/// Rest quantities of a rod with N edges; indices as in the paper: vertices 0..=N, edges 0..N, inner
/// vertices 1..N (entry 0 of the per-vertex lists is unused).
#[derive(Clone, Debug)]
pub(crate) struct RestShape<T> {
    pub length: T,
    pub vertices: Vec<V<T>>,
    pub m1: Vec<V<T>>,
    /// |ē_j| per edge.
    pub edge_lengths: Vec<T>,
    /// Voronoi length l̄_i per vertex.
    pub voronoi: Vec<T>,
    /// Integrated rest curvatures κ̄₁, κ̄₂ and twist τ̄ per vertex.
    pub measures: Vec<[T; 3]>,
    /// Section stiffnesses per edge.
    pub stiffness: Vec<Stiffness<T>>,
    /// Half widths (a, b) per edge.
    pub sections: Vec<[T; 2]>,
    /// Shear compliance per edge, mm/N: its length between the attachment planes over k_s G A. Empty
    /// without shear.
    pub shear: Vec<T>,
    /// E ∫r² dA and E ∫r⁴ dA per edge. Empty without Wagner's strain.
    pub polar: Vec<[T; 2]>,
}

/// A cubic Hermite curve.
struct Hermite<T> {
    p: [V<T>; 4],
}

impl<T: Real> Hermite<T> {
    fn combine(&self, w: [T; 4]) -> V<T> {
        std::array::from_fn(|i| {
            w[0] * self.p[0][i] + w[1] * self.p[1][i] + w[2] * self.p[2][i] + w[3] * self.p[3][i]
        })
    }

    fn point(&self, u: T) -> V<T> {
        let one = T::constant(1.0);
        let (u2, v) = (u * u, one - u);
        let (h1, h2) = (u2 * (T::constant(3.0) - u.scale(2.0)), u * v * v);
        self.combine([one - h1, h2, h1, -(u2 * v)])
    }

    /// |dP/du| at a constant parameter.
    fn speed(&self, u: f64) -> T {
        let w = [6.0 * u * (u - 1.0), (1.0 - u) * (1.0 - 3.0 * u), 6.0 * u * (1.0 - u), u * (3.0 * u - 2.0)];
        let d: V<T> = std::array::from_fn(|i| {
            self.p[0][i].scale(w[0])
                + self.p[1][i].scale(w[1])
                + self.p[2][i].scale(w[2])
                + self.p[3][i].scale(w[3])
        });
        norm(&d)
    }

    /// Arc length of [u0, u1] by one Gauss panel.
    fn panel(&self, u0: f64, u1: f64) -> T {
        let (mid, half) = (0.5 * (u0 + u1), 0.5 * (u1 - u0));
        let mut s = T::constant(0.0);
        for (x, w) in GAUSS {
            s += (self.speed(mid - half * x) + self.speed(mid + half * x)).scale(w * half);
        }
        s
    }
}

/// Start of quadrature panel `k`.
fn knot(k: usize) -> f64 {
    k as f64 / PANELS as f64
}

/// Cumulative arc length at the knots.
fn cumulative<T: Real>(curve: &Hermite<T>) -> [T; PANELS + 1] {
    let mut s = [T::constant(0.0); PANELS + 1];
    for k in 0..PANELS {
        s[k + 1] = s[k] + curve.panel(knot(k), knot(k + 1));
    }
    s
}

/// Newton inversion of arc length: the parameter where it is `target`, and its panel.
fn invert(curve: &Hermite<f64>, s: &[f64; PANELS + 1], target: f64) -> (usize, f64) {
    let panel = (1..PANELS).take_while(|&k| s[k] <= target).count();
    let (mut lo, mut hi) = (knot(panel), knot(panel + 1));
    let mut u = lo + (hi - lo) * (target - s[panel]) / (s[panel + 1] - s[panel]);
    // Quadratic from within an eighth of the curve: a handful of steps; bisection keeps it inside.
    for _ in 0..60 {
        let r = s[panel] + curve.panel(knot(panel), u) - target;
        if r > 0.0 {
            hi = u
        } else {
            lo = u
        }
        let mut next = u - r / curve.speed(u);
        if !(next >= lo && next <= hi) {
            next = 0.5 * (lo + hi);
        }
        let step = (next - u).abs();
        u = next;
        if step <= 4.0 * f64::EPSILON {
            break;
        }
    }
    (panel, u)
}

/// Builds the rest shape with the stiffnesses of its section, or `stiffness` if given (then constant).
pub(crate) fn rest_shape<T: Real>(
    q: &[T; PARAMETERS],
    material: &RodMaterial,
    edges: usize,
    options: &RodOptions,
    stiffness: Option<Stiffness>,
) -> Result<RestShape<T>, RodError> {
    if edges < MIN_EDGES {
        return Err(RodError::TooFewEdges { edges });
    }
    if q.iter().any(|x| !x.value().is_finite()) {
        return Err(RodError::NotFinite);
    }
    let positive = |x: f64| x.is_finite() && x > 0.0;
    let last = if options.taper { PARAMETERS } else { PARAMETERS - 2 };
    if !q[15..last].iter().all(|x| positive(x.value()))
        || !positive(material.e_mpa)
        || !material.shear_modulus_mpa().is_finite()
        || !positive(material.shear_modulus_mpa())
    {
        return Err(RodError::BadSection);
    }
    if stiffness.is_some_and(|s| ![s.ea, s.ei1, s.ei2, s.gj].into_iter().all(positive)) {
        return Err(RodError::BadSection);
    }
    let v = |i: usize| -> V<T> { [q[i], q[i + 1], q[i + 2]] };
    let curve = Hermite { p: [v(0), v(3), v(6), v(9)] };
    let plain = Hermite { p: curve.p.map(|p| p.map(|x| x.value())) };
    let s_plain = cumulative(&plain);
    let (slowest_u, slowest) = (0..=8 * PANELS)
        .map(|k| k as f64 / (8 * PANELS) as f64)
        .map(|u| (u, plain.speed(u) / s_plain[PANELS]))
        .fold((0.0, f64::INFINITY), |best, x| if x.1 < best.1 { x } else { best });
    // A curve of no length has a speed of NaN times its length.
    if slowest.is_nan() || slowest < MIN_SPEED || !slowest.is_finite() {
        return Err(RodError::DegenerateCurve { u: slowest_u, relative_speed: slowest });
    }

    let s = cumulative(&curve);
    let length = s[PANELS];
    let n = edges;
    let h = length.scale(1.0 / (n - 1) as f64);
    let half = h.scale(0.5);
    let (ta, tb) = (unit(&curve.p[1]), unit(&curve.p[3]));
    let mut vertices = Vec::with_capacity(n + 1);
    vertices.push(axpy(&curve.p[0], -half, &ta));
    vertices.push(axpy(&curve.p[0], half, &ta));
    for k in 2..=n - 2 {
        let fraction = (k as f64 - 0.5) / (n - 1) as f64;
        let (panel, u) = invert(&plain, &s_plain, fraction * s_plain[PANELS]);
        let residual = s[panel] + curve.panel(knot(panel), u) - length.scale(fraction);
        vertices.push(curve.point(T::constant(u) - residual / curve.speed(u)));
    }
    vertices.push(axpy(&curve.p[2], -half, &tb));
    vertices.push(axpy(&curve.p[2], half, &tb));

    let axis = unit(&v(12));
    let mut frames: Vec<[V<T>; 3]> = Vec::with_capacity(n);
    let mut edge_lengths = Vec::with_capacity(n);
    for (j, x) in vertices.windows(2).enumerate() {
        let e = axpy(&x[1], T::constant(-1.0), &x[0]);
        let l = norm(&e);
        let t = e.map(|c| c / l);
        let frame = match (options.frames, frames.last()) {
            (RestFrames::Axis, _) => project(&axis, &t).ok_or(RodError::AxisParallel { edge: j })?,
            (RestFrames::Transport, None) => project(&axis, &t).unwrap_or_else(|| any_frame(&t)),
            (RestFrames::Transport, Some(last)) => {
                let folded = RodError::DegenerateCurve { u: j as f64 / n as f64, relative_speed: 0.0 };
                transport(last, &t).ok_or(folded)?
            }
        };
        frames.push(frame);
        edge_lengths.push(l);
    }
    let zero = T::constant(0.0);
    let mut voronoi = vec![zero; n];
    let mut measures = vec![[zero; 3]; n];
    for i in 1..n {
        voronoi[i] = (edge_lengths[i - 1] + edge_lengths[i]).scale(0.5);
        measures[i] = integrated_measures(&frames[i - 1], &frames[i]);
    }
    let sections: Vec<[T; 2]> = (0..n).map(|j| widths(q, j, n, options.taper)).collect();
    let stiffness = match stiffness {
        Some(s) => {
            let constant = Stiffness {
                ea: T::constant(s.ea),
                ei1: T::constant(s.ei1),
                ei2: T::constant(s.ei2),
                gj: T::constant(s.gj),
            };
            vec![constant; n]
        }
        None => section_stiffnesses(&sections, length, material, options),
    };
    let mut shear = Vec::new();
    if options.corrections.shear {
        let factor = options.section.shear_factor() * material.shear_modulus_mpa() / material.e_mpa;
        // The clamped edges lie half between the attachment planes.
        let part = |j: usize| if j == 0 || j == n - 1 { 0.5 } else { 1.0 };
        let edges = edge_lengths.iter().zip(&stiffness).enumerate();
        shear.extend(edges.map(|(j, (l, s))| l.scale(part(j)) / s.ea.scale(factor)));
    }
    let mut polar = Vec::new();
    if options.corrections.wagner {
        polar.extend(sections.iter().map(|[a, b]| options.section.polar_moments(*a, *b, material)));
    }
    Ok(RestShape {
        length,
        m1: frames.iter().map(|f| f[0]).collect(),
        vertices,
        edge_lengths,
        voronoi,
        measures,
        stiffness,
        sections,
        shear,
        polar,
    })
}

/// Half widths at the middle of edge `j` of `n`, which lies j/(n − 1) along the rod: of a tapered rod linear in
/// arc length, and those of the ends in the clamped edges.
fn widths<T: Real>(q: &[T; PARAMETERS], j: usize, n: usize, taper: bool) -> [T; 2] {
    let [a, b, a_to, b_to] = [q[15], q[16], q[17], q[18]];
    if !taper {
        return [a, b];
    }
    let u = j as f64 / (n - 1) as f64;
    [a.scale(1.0 - u) + a_to.scale(u), b.scale(1.0 - u) + b_to.scale(u)]
}

/// Stiffnesses per edge with the corrections. Those of width and warping come from the clamps and were measured
/// for whole rods: they are one factor a rod, of its mean widths, which to first order in the taper is the mean
/// of local ones.
fn section_stiffnesses<T: Real>(
    sections: &[[T; 2]],
    length: T,
    material: &RodMaterial,
    options: &RodOptions,
) -> Vec<Stiffness<T>> {
    let at = |[a, b]: [T; 2]| options.section.stiffness(a, b, material);
    let (Some(&first), Some(&last)) = (sections.first(), sections.last()) else { return Vec::new() };
    let mut all = if options.taper {
        sections.iter().map(|s| at(*s)).collect()
    } else {
        vec![at(first); sections.len()]
    };
    if options.corrections.width || options.corrections.warping {
        let mean = |k: usize| if options.taper { (first[k] + last[k]).scale(0.5) } else { first[k] };
        let f = options.factors(mean(0), mean(1), length, material.nu);
        for s in &mut all {
            *s = Stiffness { ea: s.ea, ei1: s.ei1 * f[0], ei2: s.ei2 * f[1], gj: s.gj * f[2] };
        }
    }
    all
}

/// Frame (m₁, m₂, t) with m₂ the projection of a unit `axis`, unless that is nearly parallel.
fn project<T: Real>(axis: &V<T>, t: &V<T>) -> Option<[V<T>; 3]> {
    let across = axpy(axis, -dot(axis, t), t);
    let sine = norm(&across);
    if sine.value().is_nan() || sine.value() < MIN_AXIS_SINE {
        return None;
    }
    let m2 = across.map(|c| c / sine);
    Some([cross(&m2, t), m2, *t])
}

/// Some frame of `t`: m₂ as near as can be to the coordinate axis that is least along it.
fn any_frame<T: Real>(t: &V<T>) -> [V<T>; 3] {
    let least = (0..3).min_by(|&i, &j| t[i].value().abs().total_cmp(&t[j].value().abs())).unwrap_or(0);
    let axis: V<T> = std::array::from_fn(|i| T::constant(if i == least { 1.0 } else { 0.0 }));
    let m2 = unit(&axpy(&axis, -t[least], t));
    [cross(&m2, t), m2, *t]
}

/// The frame carried to direction `t` by the least rotation; none for a fold.
fn transport<T: Real>(from: &[V<T>; 3], t: &V<T>) -> Option<[V<T>; 3]> {
    let chi = T::constant(1.0) + dot(&from[2], t);
    if chi.value().is_nan() || chi.value() < MIN_AXIS_SINE {
        return None;
    }
    let axis = cross(&from[2], t);
    let v = &from[0];
    let (once, one) = (cross(&axis, v), T::constant(1.0));
    let carried = axpy(&axpy(v, one, &once), one / chi, &cross(&axis, &once));
    // Rounding would add up along the rod.
    let m1 = unit(&axpy(&carried, -dot(&carried, t), t));
    Some([m1, cross(t, &m1), *t])
}

/// Integrated curvatures κ₁, κ₂ and twist τ between two frames (m₁, m₂, t). With k = 2 t₀×t₁/(1 + t₀·t₁):
/// κ_α = (t₁·m_α⁰ − t₀·m_α¹)/(1 + t₀·t₁), which is ½k·(m₂⁰ + m₂¹) and −½k·(m₁⁰ + m₁¹).
fn integrated_measures<T: Real>(f0: &[V<T>; 3], f1: &[V<T>; 3]) -> [T; 3] {
    let chi = T::constant(1.0) + dot(&f0[2], &f1[2]);
    let kappa = |i: usize| (dot(&f0[i], &f1[2]) - dot(&f0[2], &f1[i])) / chi;
    let sine = dot(&f0[1], &f1[0]) - dot(&f0[0], &f1[1]);
    let cosine = dot(&f0[0], &f1[0]) + dot(&f0[1], &f1[1]);
    [kappa(0), kappa(1), sine.atan2(cosine)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::rod::derivative_tests::{MATERIAL, curved};
    use crate::rod::{Rod, RodSystem};
    use nalgebra::DMatrix;

    /// A semicircle as a Hermite curve is not exact; equal arc length is a property of any curve.
    #[test]
    fn vertices_are_at_equal_arc_length() {
        let q = curved();
        let edges = 12;
        let shape = rest_shape::<f64>(&q.to_array(), &MATERIAL, edges, &RodOptions::default(), None).unwrap();
        let curve = Hermite {
            p: [q.position_a, q.derivative_a, q.position_b, q.derivative_b].map(|v| [v.x, v.y, v.z]),
        };
        // Arc length and curve by brute force.
        let steps = 200_000;
        let (mut s, mut k) = (0.0, 2);
        let mut last = curve.point(0.0);
        let h = shape.length / (edges - 1) as f64;
        for i in 1..=steps {
            let p = curve.point(f64::from(i) / f64::from(steps));
            s += norm(&axpy(&p, -1.0, &last));
            if k < edges - 1 && s >= (k as f64 - 0.5) * h {
                assert!(norm(&axpy(&p, -1.0, &shape.vertices[k])) < 1e-3, "vertex {k}");
                k += 1;
            }
            last = p;
        }
        assert_eq!(k, edges - 1);
        assert!((s / shape.length - 1.0).abs() < 1e-9, "{s} {}", shape.length);
        // The clamp planes halve the end edges.
        for (j, at) in [(0, q.position_a), (edges - 1, q.position_b)] {
            let middle = axpy(&shape.vertices[j], 1.0, &shape.vertices[j + 1]).map(|x| 0.5 * x);
            assert!((Vector3::from(middle) - at).norm() < 1e-12);
        }
    }

    #[test]
    fn bad_rods_are_typed_errors() {
        let good = curved();
        let build = |q: &RodParameters, n| Rod::new(q, MATERIAL, n).map(|_| ());
        assert_eq!(build(&good, 6), Ok(()));
        assert_eq!(build(&good, 5), Err(RodError::TooFewEdges { edges: 5 }));
        assert_eq!(build(&RodParameters { a: 0.0, ..good }, 9), Err(RodError::BadSection));
        assert_eq!(build(&RodParameters { b: f64::NAN, ..good }, 9), Err(RodError::NotFinite));
        let straight = RodParameters::straight(Vector3::zeros(), Vector3::x() * 9.0, Vector3::x(), 1.0, 1.0);
        assert_eq!(build(&straight, 9), Err(RodError::AxisParallel { edge: 0 }));
        let no_axis = RodParameters { axis: Vector3::zeros(), ..good };
        assert_eq!(build(&no_axis, 9), Err(RodError::AxisParallel { edge: 0 }));
        let still = RodParameters { derivative_a: Vector3::zeros(), ..good };
        assert!(matches!(build(&still, 9), Err(RodError::DegenerateCurve { .. })));
        let point = RodParameters::straight(Vector3::x(), Vector3::x(), Vector3::z(), 1.0, 1.0);
        assert!(matches!(build(&point, 9), Err(RodError::DegenerateCurve { .. })));
        let rigid = RodMaterial { e_mpa: f64::INFINITY, nu: 0.3 };
        assert_eq!(Rod::new(&good, rigid, 9).map(|_| ()), Err(RodError::BadSection));
        assert_eq!(RodParameters::from_array(&good.to_array()), good);
    }

    /// The rest shape is stress-free for every parameter: at fixed links the condensed gradient does not
    /// change, and the inside follows the rest shape.
    #[test]
    fn rest_shape_stays_stress_free_along_every_parameter() {
        let rod = Rod::with_derivatives(&curved(), MATERIAL, 15).unwrap();
        let state = rod.rest_state();
        let (a, b) = (Pose::rest(Vector3::zeros()), Pose::rest(Vector3::x() * 20.0));
        let mut system = RodSystem::new(&rod);
        system.assemble(&rod, &state, &a, &b);
        system.factor();
        system.condense();
        let columns = system.parameter_columns(&rod, &a, &b).unwrap();
        let scale = system.condensed_hessian().amax();
        assert!(columns.amax() < 1e-9 * scale, "{:e} {scale:e}", columns.amax());
        let d = system
            .internal_sensitivity(&DMatrix::zeros(12, PARAMETERS), &DMatrix::identity(PARAMETERS, PARAMETERS))
            .unwrap();
        let rest = rod.derivatives.as_deref().unwrap();
        for c in 0..PARAMETERS {
            for k in 2..=13 {
                for i in 0..3 {
                    assert!((d[(4 * k - 7 + i, c)] - rest.vertices[k][i].eps[c]).abs() < 1e-8);
                }
            }
            for j in 1..=13 {
                let t = (state.vertices[j + 1] - state.vertices[j]).normalize();
                let m2 = t.cross(&state.m1[j]);
                let turn: f64 = (0..3).map(|i| m2[i] * rest.m1[j][i].eps[c]).sum();
                assert!((d[(4 * j - 4, c)] - turn).abs() < 1e-8);
            }
        }
    }

    /// A wire may run along the axis; its frames have no rest twist, its end is unstressed, and how its
    /// first frame is turned changes no energy.
    #[test]
    fn wires_do_not_know_their_axis() {
        let wire = RodOptions { frames: RestFrames::Transport, ..RodOptions::default() };
        let q = RodParameters { a: 0.5, b: 0.5, ..curved() };
        let energy = |axis: Vector3<f64>| {
            let q = RodParameters { axis, ..q };
            let rod = Rod::with_options(&q, MATERIAL, 14, wire, true).unwrap();
            assert!((1..14).all(|i| rod.rest_measures[i][2].abs() < 1e-14), "{:?}", rod.rest_measures);
            let mut system = RodSystem::new(&rod);
            let mut state = rod.rest_state();
            let (a, b) = (Pose::rest(Vector3::zeros()), Pose::rest(q.position_b));
            system.assemble(&rod, &state, &a, &b);
            system.factor();
            assert!(system.condense().0.norm() < 1e-9);
            let mut d = nalgebra::SVector::<f64, 12>::zeros();
            d.fixed_rows_mut::<6>(6).copy_from_slice(&[0.3, -0.2, 0.5, 0.1, 0.2, -0.15]);
            let inner = system.back_substitute(&d).to_vec();
            let b = b.retract(&d.fixed_rows::<3>(6).into(), &d.fixed_rows::<3>(9).into());
            rod.retract(&mut state, &inner, &a, &b).unwrap();
            rod.energy(&state)
        };
        let want = energy(q.axis);
        for axis in [Vector3::x() + Vector3::y(), q.derivative_a, q.position_b - q.position_a] {
            let got = energy(axis);
            assert!(want > 0.1 && (got / want - 1.0).abs() < 1e-9, "{got} {want}");
        }
        // A leaf whose axis lies along the rod has no frames.
        let leaf = RodParameters { axis: q.derivative_a, ..q };
        assert_eq!(Rod::new(&leaf, MATERIAL, 14).map(|_| ()), Err(RodError::AxisParallel { edge: 0 }));
    }
}
