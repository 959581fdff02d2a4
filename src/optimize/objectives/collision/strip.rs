//! What the term measures distances of: strips. A strip is a fan of capsules side by side: a piece of a flexure (an
//! edge of its rod) or of a link (a slot of its skeleton), in world coordinates at a state.

use super::extent::{Extent, Window};
use super::kernel::{GAUSS_3, near};
use crate::equilibrium::{Model, Sensitivity};
use crate::geometry::SkeletonCapsule;
use crate::math::{Pose, skew};
use crate::optimize::objectives::StatesSensitivity;
use crate::rod::{Rod, RodState, SectionShape};
use nalgebra::{DMatrix, DVector, Matrix3xX, Vector3};

/// Simpson's rule on −1..1, weights of sum 1.
const SIMPSON: [(f64, f64); 3] = [(-1.0, 1.0 / 6.0), (0.0, 4.0 / 6.0), (1.0, 1.0 / 6.0)];
/// What the outline of a link's fan may recede between its copies, mm …
const DIP_MM: f64 = 0.06;
/// … as long as that takes no more copies on either side of the middle.
const MOST_PAIRS: f64 = 16.0;
/// Most panels a link's length is summed in.
const MOST_PANELS: f64 = 64.0;
/// Numbers a strip is made of: two ends, fan direction, spread, radius.
pub const NUMBERS: usize = 11;

/// A fan of capsules: axes `ends + fan · spread · ξ`, −1 ≤ ξ ≤ 1.
#[derive(Clone, Copy, Debug)]
pub struct Strip {
    pub ends: [Vector3<f64>; 2],
    pub fan: Vector3<f64>,
    pub spread: f64,
    pub radius: f64,
    /// How many capsules stand for the fan.
    pub copies: usize,
    /// In how many panels its length is summed.
    pub panels: usize,
    /// Whether it counts with its round ends: the pieces of a flexure do not, they go on.
    pub capped: bool,
}

/// Derivatives by the numbers of a strip.
#[derive(Clone, Copy, Debug, Default)]
pub struct StripGradient {
    pub ends: [Vector3<f64>; 2],
    pub fan: Vector3<f64>,
    pub spread: f64,
    pub radius: f64,
}

impl StripGradient {
    /// Adds `scale` times the gradient's own row J ᵀ g to `row`.
    pub fn chain(&self, jacobian: &DMatrix<f64>, row: &mut DVector<f64>) {
        let mut g = [0.0; NUMBERS];
        for (to, v) in g.chunks_mut(3).zip([&self.ends[0], &self.ends[1], &self.fan]) {
            to.copy_from_slice(v.as_slice());
        }
        (g[9], g[10]) = (self.spread, self.radius);
        row.gemv_tr(1.0, jacobian, &DVector::from_column_slice(&g), 1.0);
    }
}

impl Strip {
    /// Length that counts: of a link's capsule over its round ends.
    fn measure(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm() + if self.capped { 2.0 * self.radius } else { 0.0 }
    }

    fn add_measure(&self, factor: f64, to: &mut StripGradient) {
        if let Some(u) = (self.ends[1] - self.ends[0]).try_normalize(f64::MIN_POSITIVE.sqrt()) {
            to.ends[1] += u * factor;
            to.ends[0] -= u * factor;
        }
        if self.capped {
            to.radius += 2.0 * factor;
        }
    }

    /// Position of capsule number k in the fan, −1..1.
    pub fn place(&self, k: usize) -> f64 {
        if self.copies < 2 { 0.0 } else { 2.0 * k as f64 / (self.copies - 1) as f64 - 1.0 }
    }

    /// Places lengthwise, 0..1, with weights of sum one: of a link to the tips of its axis, of a flexure's edge
    /// inside it.
    fn samples(&self) -> impl Iterator<Item = (f64, f64)> + use<> {
        let (panels, rule) = (self.panels, if self.capped { SIMPSON } else { GAUSS_3 });
        (0..panels).flat_map(move |k| {
            rule.map(|(x, w)| ((k as f64 + 0.5 * (1.0 + x)) / panels as f64, w / panels as f64))
        })
    }
}

/// The penalty of two strips: the mean over both fans of the double integral over both lengths, mm², with its
/// derivatives; none if it is zero.
pub fn strips(
    (a, at): (&Strip, &Extent),
    (b, bt): (&Strip, &Extent),
    gap_mm: f64,
) -> Option<(f64, [StripGradient; 2])> {
    let reach = a.radius + b.radius + gap_mm;
    if at.bounds.far(&bt.bounds, reach) || at.apart(bt, reach) {
        return None;
    }
    within(a, b, reach, &Window::new(at, b, bt, reach))
}

/// The same, of what the window lets through.
fn within(a: &Strip, b: &Strip, reach: f64, window: &Window) -> Option<(f64, [StripGradient; 2])> {
    let mut mean = 0.0;
    let mut by = [StripGradient::default(); 2];
    let share = 1.0 / (a.copies * b.copies) as f64;
    for (s, weight) in a.samples() {
        let on_axis = a.ends[0] * (1.0 - s) + a.ends[1] * s;
        let seen = window.see(&on_axis);
        if window.misses(&seen) {
            continue;
        }
        for i in 0..a.copies {
            let xi = a.place(i);
            let copies = window.copies(&seen, xi);
            if copies.is_empty() {
                continue;
            }
            let x = on_axis + a.fan * (a.spread * xi);
            for k in copies {
                let eta = b.place(k);
                let offset = b.fan * (b.spread * eta);
                let ends = [b.ends[0] + offset, b.ends[1] + offset];
                let Some(n) = near(&x, [&ends[0], &ends[1]], reach) else { continue };
                let w = weight * share;
                mean += w * n.value;
                let [ga, gb] = &mut by;
                ga.ends[0] += n.by_point * (w * (1.0 - s));
                ga.ends[1] += n.by_point * (w * s);
                ga.fan += n.by_point * (w * a.spread * xi);
                ga.spread += w * xi * n.by_point.dot(&a.fan);
                ga.radius += w * n.by_reach;
                gb.ends[0] += n.by_ends[0] * w;
                gb.ends[1] += n.by_ends[1] * w;
                let moved = n.by_ends[0] + n.by_ends[1];
                gb.fan += moved * (w * b.spread * eta);
                gb.spread += w * eta * moved.dot(&b.fan);
                gb.radius += w * n.by_reach;
            }
        }
    }
    if mean <= 0.0 {
        return None;
    }
    let (la, lb) = (a.measure(), b.measure());
    for g in &mut by {
        let scale = la * lb;
        g.ends.iter_mut().for_each(|e| *e *= scale);
        g.fan *= scale;
        g.spread *= scale;
        g.radius *= scale;
    }
    a.add_measure(mean * lb, &mut by[0]);
    b.add_measure(mean * la, &mut by[1]);
    Some((mean * la * lb, by))
}

/// The edges of a rod between its attachment planes, the middles of its first and last edge, each as wide
/// as the rod is there.
pub fn rod_strips(state: &RodState, rod: &Rod, copies: usize) -> Vec<Strip> {
    let last = state.m1.len() - 1;
    let shape = rod.options().section;
    (0..=last)
        .map(|j| {
            let mut ends = [state.vertices[j], state.vertices[j + 1]];
            let middle = (ends[0] + ends[1]) * 0.5;
            let t = (ends[1] - ends[0]).normalize();
            let [a, b] = rod.edge_half_widths_mm(j);
            if j == 0 {
                ends[0] = middle;
            }
            if j == last {
                ends[1] = middle;
            }
            Strip {
                ends,
                fan: t.cross(&state.m1[j]),
                spread: spread(shape, a, b),
                radius: a,
                copies,
                panels: 1,
                capped: false,
            }
        })
        .collect()
}

/// Half the width of a section's fan: inside an ellipse, round the corners of a rectangle.
fn spread(shape: SectionShape, a: f64, b: f64) -> f64 {
    match shape {
        SectionShape::Ellipse => (b - a).max(0.0),
        SectionShape::Rectangle => b,
    }
}

/// Derivatives of the strip of edge `j` of rod `r` by the n design parameters, 11 × n.
pub fn rod_jacobian(model: &Model, at: &StatesSensitivity, r: usize, j: usize) -> Option<DMatrix<f64>> {
    let (rod, edge) = (model.rods.get(r)?, at.workspace.edge(model, &at.free, r, j)?);
    let [first, second] = &edge.vertices;
    let mut out = DMatrix::zeros(NUMBERS, first.ncols());
    let middle = || (first + second) * 0.5;
    let start = if j == 0 { middle() } else { first.clone() };
    let end = if j + 1 == rod.rod.edges() { middle() } else { second.clone() };
    out.rows_mut(0, 3).copy_from(&start);
    out.rows_mut(3, 3).copy_from(&end);
    out.rows_mut(6, 3).copy_from(&edge.m2);
    let [a, b] = rod.rod.edge_half_widths_mm(j);
    let u = rod.rod.taper_at_edge(j);
    let by = |from: usize, to: usize| rod.dq_dp.row(from) * (1.0 - u) + rod.dq_dp.row(to) * u;
    let (by_a, by_b) = (by(15, 17), by(16, 18));
    match rod.rod.options().section {
        SectionShape::Ellipse if b > a => out.row_mut(9).copy_from(&(&by_b - &by_a)),
        SectionShape::Ellipse => {}
        SectionShape::Rectangle => out.row_mut(9).copy_from(&by_b),
    }
    out.row_mut(10).copy_from(&by_a);
    Some(out)
}

/// How finely a link's capsules are summed: copies and panels, these no longer than a capsule is thick.
pub fn fineness(capsule: &SkeletonCapsule) -> (usize, usize) {
    // Half-way between two copies at a distance e the outline recedes by e²/8D, D at least two radii.
    let step = (16.0 * DIP_MM * capsule.radius_mm).sqrt();
    let pairs = (capsule.spread_mm / step).ceil().clamp(1.0, MOST_PAIRS) as usize;
    let length = (capsule.ends[1] - capsule.ends[0]).norm();
    let panels = (length / (2.0 * capsule.radius_mm)).ceil().clamp(1.0, MOST_PANELS) as usize;
    (if capsule.spread_mm > 0.0 { 1 + 2 * pairs } else { 1 }, panels)
}

/// A link's capsules at a pose.
pub fn link_strip(capsule: &SkeletonCapsule, pose: &Pose, (copies, panels): (usize, usize)) -> Strip {
    Strip {
        ends: capsule.ends.map(|p| pose.point(&p)),
        fan: pose.direction(&capsule.fan),
        spread: capsule.spread_mm,
        radius: capsule.radius_mm,
        copies,
        panels,
        capped: true,
    }
}

/// Derivatives of a link's strip by the n design parameters, 11 × n.
pub fn link_jacobian(
    model: &Model,
    at: &Sensitivity,
    capsule: &SkeletonCapsule,
    pose: &Pose,
) -> DMatrix<f64> {
    let n = at.links.ncols();
    let mut out = DMatrix::zeros(NUMBERS, n);
    let turned = |d: &Matrix3xX<f64>| pose.rotation * d;
    let mut rows = [turned(&capsule.d_ends_dp[0]), turned(&capsule.d_ends_dp[1]), turned(&capsule.d_fan_dp)];
    if let Some(first) = model.layout.bodies[capsule.body].first_dof {
        let (du, dphi) = (at.links.rows(first, 3), at.links.rows(first + 3, 3));
        for (row, end) in rows.iter_mut().zip(&capsule.ends) {
            *row += du - skew(&pose.arm(end)) * dphi;
        }
        rows[2] -= skew(&pose.direction(&capsule.fan)) * dphi;
    }
    for (k, row) in rows.iter().enumerate() {
        out.rows_mut(3 * k, 3).copy_from(row);
    }
    out.row_mut(9).copy_from(&capsule.d_spread_dp);
    out.row_mut(10).copy_from(&capsule.d_radius_dp);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in −1..1 from a counter.
    fn noise(k: usize) -> f64 {
        2.0 * ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 1.0
    }

    fn strip(seed: usize) -> Strip {
        let vector = |k: usize, size: f64| {
            Vector3::new(noise(seed + k), noise(seed + k + 1), noise(seed + k + 2)) * size
        };
        let (middle, way) = (vector(0, 9.0), vector(3, 6.0));
        // Lengths down to none, fans across and askew, single capsules.
        let way = match seed % 5 {
            0 => Vector3::zeros(),
            1 => way * 1e-3,
            _ => way,
        };
        let askew = vector(6, 1.0).normalize();
        let across = (askew - way * (askew.dot(&way) / way.norm_squared().max(1e-12))).normalize();
        Strip {
            ends: [middle - way, middle + way],
            fan: if seed.is_multiple_of(3) { askew } else { across },
            spread: 2.0 * noise(seed + 9).abs(),
            radius: 0.2 + noise(seed + 10).abs(),
            copies: [1, 2, 5, 12][seed % 4],
            panels: 1 + seed % 3,
            capped: seed.is_multiple_of(2),
        }
    }

    /// What is left out for being far away adds nothing: the sums are the same to the last bit.
    #[test]
    fn nothing_in_reach_is_left_out() {
        let (mut met, mut missed) = (0, 0);
        for k in 0..20_000 {
            let (a, b) = (strip(31 * k), strip(31 * k + 17 + k % 7));
            let gap = 0.5 + 0.5 * noise(k);
            let (at, bt) = (Extent::new(&a), Extent::new(&b));
            let reach = a.radius + b.radius + gap;
            let all = within(&a, &b, reach, &Window::new(&at, &b, &bt, f64::INFINITY));
            match (strips((&a, &at), (&b, &bt), gap), all) {
                (Some((value, by)), Some((want, by_want))) => {
                    assert_eq!(value.to_bits(), want.to_bits(), "{a:?} {b:?}");
                    for (g, w) in by.iter().zip(&by_want) {
                        assert_eq!((g.ends, g.fan), (w.ends, w.fan));
                        assert_eq!((g.spread, g.radius), (w.spread, w.radius));
                    }
                    met += 1;
                }
                (None, None) => missed += 1,
                // Where they barely meet, the cube of what rounding leaves.
                (None, Some((value, _))) => assert!(value < 1e-30, "{value} {a:?} {b:?}"),
                (Some(_), None) => panic!("{a:?} {b:?}"),
            }
        }
        assert!(met > 500 && missed > 2_000, "{met} {missed}");
    }
}
