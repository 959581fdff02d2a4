//! Lateral stability (Megaro et al. 2017, eq. 4): ½ Σ ‖z_t − z_t^load‖², the displacement of a traced point under
//! a dead force with the drives held, summed over two forces normal to the path.
//!
//! The directions are those of the *conventional* path, so they move with the design's geometry only: in-plane normal
//! and binormal, for planar mechanisms the hinge axis as binormal.

use super::{Objective, StateView, StatesSensitivity, trace_rows};
use crate::equilibrium::{Layout, LayoutChange, LayoutTrace, PointForce, PointForceChange};
use crate::ir::Design;
use crate::optimize::Normal;
use nalgebra::Vector3;
use std::ops::Range;

/// Steps of the path below this part of the largest have no direction of their own: cusps and stops.
const NO_DIRECTION: f64 = 1e-6;
/// Joint axes parallel to this make a planar mechanism.
const PARALLEL: f64 = 1e-9;

/// See the module.
pub struct Sway {
    name: String,
    trace: usize,
    cases: Range<usize>,
    /// Weight over scale², per mm².
    factor: f64,
}

/// One metre: without a scale, displacements count in SI.
const METRE_MM: f64 = 1000.0;

impl Sway {
    /// Trace number `trace` under the load cases `cases`; `scale_mm` is the length that counts as one.
    pub fn new(
        trace_name: &str,
        trace: usize,
        cases: Range<usize>,
        scale_mm: Option<f64>,
        weight: f64,
    ) -> Self {
        let scale = scale_mm.unwrap_or(METRE_MM);
        Self { name: format!("sway({trace_name})"), trace, cases, factor: weight / (scale * scale) }
    }

    /// Calls `f(load case, displacement)` for each load.
    fn for_each_case(&self, view: &StateView, mut f: impl FnMut(usize, Vector3<f64>)) {
        let trace = &view.model.layout.traces[self.trace];
        let free = view.equilibrium.state.poses[trace.body].point(&trace.rest);
        for case in self.cases.clone() {
            if let Some(loaded) = view.loaded.get(case) {
                f(case, loaded.poses[trace.body].point(&trace.rest) - free);
            }
        }
    }
}

impl Objective for Sway {
    fn name(&self) -> &str {
        &self.name
    }

    fn cost(&self, view: &StateView) -> f64 {
        let mut cost = 0.0;
        self.for_each_case(view, |_, d| cost += 0.5 * self.factor * view.share * d.norm_squared());
        cost
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal) {
        let rows = |state, sensitivity| trace_rows(view.model, state, sensitivity, self.trace);
        let free = rows(&view.equilibrium.state, &at.free);
        self.for_each_case(view, |case, displacement| {
            let (Some(state), Some(sensitivity)) = (view.loaded.get(case), at.loaded.get(case)) else {
                return;
            };
            let relative = rows(state, sensitivity) - &free;
            for c in 0..3 {
                let row: Vec<f64> = relative.row(c).iter().copied().collect();
                out.add(self.factor * view.share, displacement[c], &row);
            }
        });
    }
}

/// The two load cases of a trace: one force a state, normal and binormal of its conventional path.
pub fn load_cases(design: &Design, layout: &Layout, trace: usize, force_n: f64) -> [Vec<PointForce>; 2] {
    let t = &layout.traces[trace];
    let normals = path_normals(&t.path, layout.closed, plane(design));
    let force = |n: Vector3<f64>| PointForce { body: t.body, rest: t.rest, force_n: n * force_n };
    [0, 1].map(|k| normals.iter().map(|n| force(n[k])).collect())
}

/// How they change with each of the layout's changes: per case, change and state.
pub fn load_case_changes(
    design: &Design,
    layout: &Layout,
    trace: usize,
    force_n: f64,
) -> [Vec<Vec<PointForceChange>>; 2] {
    let path = &layout.traces[trace].path;
    let mut out = [Vec::new(), Vec::new()];
    for change in layout.changes.iter().flatten() {
        let moved = &change.traces[trace];
        let normals = moving_normals(path, &moved.path, layout.closed, plane(design));
        for (k, case) in out.iter_mut().enumerate() {
            let force = |n: &[Moving; 2]| PointForceChange { rest: moved.rest, force_n: n[k].rate * force_n };
            case.push(normals.iter().map(force).collect());
        }
    }
    out
}

/// Axis of a planar mechanism.
fn plane(design: &Design) -> Option<Vector3<f64>> {
    let axis = Vector3::from(design.layers.axis);
    let planar = design.joints.iter().all(|j| Vector3::from(j.axis).cross(&axis).norm() < PARALLEL);
    planar.then_some(axis)
}

/// The one load case of a stated direction.
pub fn load_along(layout: &Layout, trace: usize, force_n: f64, along: [f64; 3]) -> Vec<PointForce> {
    let LayoutTrace { body, rest, .. } = &layout.traces[trace];
    let force_n = Vector3::from(along) * force_n;
    vec![PointForce { body: *body, rest: *rest, force_n }; layout.states()]
}

/// How it changes with each of the layout's changes: per change and state.
pub fn load_along_change(layout: &Layout, trace: usize) -> Vec<Vec<PointForceChange>> {
    let moved = |change: &LayoutChange| PointForceChange {
        rest: change.traces[trace].rest,
        force_n: Vector3::zeros(),
    };
    layout.changes.iter().flatten().map(|c| vec![moved(c); layout.states()]).collect()
}

/// Normal and binormal of a path at each of its points. Where the path stops or turns back the line of the
/// tangent is carried on, so that neither direction jumps.
pub fn path_normals(
    path: &[Vector3<f64>],
    closed: bool,
    axis: Option<Vector3<f64>>,
) -> Vec<[Vector3<f64>; 2]> {
    let still = vec![Vector3::zeros(); path.len()];
    moving_normals(path, &still, closed, axis).into_iter().map(|pair| pair.map(|n| n.value)).collect()
}

/// A vector and its derivative by a parameter.
#[derive(Clone, Copy)]
struct Moving {
    value: Vector3<f64>,
    rate: Vector3<f64>,
}

impl Moving {
    fn fixed(value: Vector3<f64>) -> Self {
        Self { value, rate: Vector3::zeros() }
    }

    fn turned_back(self) -> Self {
        Self { value: -self.value, rate: -self.rate }
    }

    /// None below the length `least`.
    fn unit(self, least: f64) -> Option<Self> {
        let value = self.value.try_normalize(least)?;
        Some(Self { value, rate: (self.rate - value * value.dot(&self.rate)) / self.value.norm() })
    }

    fn cross(self, other: Self) -> Self {
        let rate = self.rate.cross(&other.value) + self.value.cross(&other.rate);
        Self { value: self.value.cross(&other.value), rate }
    }

    /// The part normal to a unit vector.
    fn beside(self, unit: Self) -> Self {
        let along = self.value.dot(&unit.value);
        let by_along = self.rate.dot(&unit.value) + self.value.dot(&unit.rate);
        Self {
            value: self.value - unit.value * along,
            rate: self.rate - unit.rate * along - unit.value * by_along,
        }
    }

    fn any_normal(self) -> Self {
        let d = self.value;
        let seed = if d.x.abs() <= d.y.abs().min(d.z.abs()) {
            Vector3::x()
        } else if d.y.abs() <= d.z.abs() {
            Vector3::y()
        } else {
            Vector3::z()
        };
        self.cross(Self::fixed(seed)).unit(0.0).unwrap_or(Self::fixed(Vector3::x()))
    }
}

/// [`path_normals`] of a path that moves by `rates`.
fn moving_normals(
    path: &[Vector3<f64>],
    rates: &[Vector3<f64>],
    closed: bool,
    axis: Option<Vector3<f64>>,
) -> Vec<[Moving; 2]> {
    let last = path.len().saturating_sub(1);
    let chord = |s: usize| {
        // A closed path's last point is its first.
        let before = if s > 0 {
            s - 1
        } else if closed {
            last.saturating_sub(1)
        } else {
            0
        };
        let after = if s < last {
            s + 1
        } else if closed {
            1.min(last)
        } else {
            last
        };
        Moving { value: path[after] - path[before], rate: rates[after] - rates[before] }
    };
    let chords: Vec<Moving> = (0..path.len()).map(chord).collect();
    let largest = chords.iter().map(|c| c.value.norm()).fold(0.0, f64::max);
    let direction = |c: &Moving| c.unit(NO_DIRECTION * largest);
    let any = Moving::fixed(axis.unwrap_or_else(Vector3::z)).any_normal();
    let mut tangent = chords.iter().find_map(direction).unwrap_or(any);
    let mut binormal = axis.map_or_else(|| tangent.any_normal(), Moving::fixed);
    chords
        .iter()
        .map(|c| {
            if let Some(t) = direction(c) {
                tangent = if t.value.dot(&tangent.value) < 0.0 { t.turned_back() } else { t };
            }
            // Carried along: the part of the former binormal that is normal to the new tangent.
            binormal = binormal.beside(tangent).unit(1e-6).unwrap_or_else(|| tangent.any_normal());
            [binormal.cross(tangent), binormal]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planar_path_keeps_the_axis_and_its_normal() {
        let circle: Vec<Vector3<f64>> = (0..=12)
            .map(|s| (s as f64 / 12.0 * std::f64::consts::TAU).sin_cos())
            .map(|(s, c)| Vector3::new(c, s, 0.0))
            .collect();
        for (p, [normal, binormal]) in circle.iter().zip(path_normals(&circle, true, Some(Vector3::z()))) {
            assert!((normal + p).norm() < 1e-12, "towards the centre: {normal}");
            assert_eq!(binormal, Vector3::z());
        }
    }

    #[test]
    fn a_path_that_turns_back_keeps_its_normals() {
        let there_and_back: Vec<Vector3<f64>> =
            [0.0, 1.0, 2.0, 1.0, 0.0].map(|x| Vector3::new(x, 0.0, 0.0)).to_vec();
        for axis in [None, Some(Vector3::z())] {
            let all = path_normals(&there_and_back, true, axis);
            assert!(all.iter().all(|n| *n == all[0]), "{all:?}");
            assert!(all[0][0].x.abs() < 1e-15 && all[0][1].x.abs() < 1e-15);
        }
    }

    #[test]
    fn a_path_in_space_has_orthonormal_continuous_normals() {
        let helix: Vec<Vector3<f64>> =
            (0..=40).map(|s| f64::from(s) * 0.2).map(|t| Vector3::new(t.cos(), t.sin(), 0.3 * t)).collect();
        let all = path_normals(&helix, false, None);
        for (k, pair) in all.windows(2).enumerate() {
            let tangent = helix[k + 2 - usize::from(k + 2 > 40)] - helix[k];
            let [n, b] = pair[1];
            assert!((n.norm() - 1.0).abs() < 1e-12 && (b.norm() - 1.0).abs() < 1e-12);
            assert!(
                n.dot(&b).abs() < 1e-12 && n.dot(&tangent).abs() < 1e-12 && b.dot(&tangent).abs() < 1e-12
            );
            assert!(pair[0][0].dot(&n) > 0.9 && pair[0][1].dot(&b) > 0.9, "step {k}");
        }
    }

    #[test]
    fn a_point_that_stays_has_normals_too() {
        for [n, b] in path_normals(&[Vector3::zeros(); 4], true, Some(Vector3::z())) {
            assert!((n.norm() - 1.0).abs() < 1e-12 && b == Vector3::z());
        }
    }
}
