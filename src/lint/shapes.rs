//! The flexures of a design at the start, in the few numbers that estimates need.

use super::views::OfDesign;
use crate::ir::{JointId, JointKind};
use crate::kinematics::Motion;
use crate::kinematics::motion::State;
use crate::math::log_so3;
use nalgebra::Vector3;

/// A rod between two bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Flexure {
    /// The joint it belongs to.
    pub joint: JointId,
    /// Length of its centreline, mm.
    pub length_mm: f64,
    /// Full thickness, at its thinner end, mm.
    pub thick_mm: f64,
    /// Full thickness at its thicker end, mm.
    pub most_thick_mm: f64,
    /// The least thickness that the bounds of its free values allow, mm.
    pub least_thick_mm: f64,
    /// Full width along the axis, at its narrower end, mm.
    pub wide_mm: f64,
    /// What it covers along the joint's axis, mm.
    pub along_mm: [f64; 2],
    /// How far its ends stand from the joint, across the axis, mm.
    pub reach_mm: [f64; 2],
    /// Radius of its fillets, mm; 0: none.
    pub fillet_mm: f64,
    /// A round wire.
    pub round: bool,
    /// Largest turn of its one end against the other, from the rest pose; none with a body of the template's own, rad.
    pub turn_rad: Option<f64>,
    /// Largest shift of its one end against the other, of a slider; mm.
    pub shift_mm: f64,
}

impl Flexure {
    /// Largest strain if it bends evenly: thickness · angle / (2 · length), of a slider's leaf in an S 3 · thickness ·
    /// shift / length². Real ones bend less evenly, so more.
    pub fn even_strain(&self, thick_mm: f64) -> Option<f64> {
        let bent = thick_mm * self.turn_rad? / (2.0 * self.length_mm);
        Some(bent + 3.0 * thick_mm * self.shift_mm / (self.length_mm * self.length_mm))
    }
}

/// The flexures of a design; `lengths_mm` has one a rod.
pub fn flexures(of: &OfDesign, motion: &Motion, lengths_mm: &[f64]) -> Vec<Flexure> {
    let design = of.design;
    let lower = |rod: &crate::ir::Rod| {
        let sections = [Some(&rod.section), rod.section_to.as_ref()];
        let halves: Vec<_> = sections.iter().flatten().map(|s| s.half_widths()[0]).collect();
        let moved = design.exprs.free_variables(&halves);
        let at = |end: fn(&crate::ir::FreeVariable) -> f64| {
            let p: Vec<f64> = design
                .free
                .iter()
                .enumerate()
                .map(|(i, f)| if moved.contains(&i) { end(f) } else { f.start })
                .collect();
            let values = design.exprs.values(&p);
            let thick = halves.iter().map(|id| values.get(id.0 as usize).map_or(f64::NAN, |v| 2.0 * v));
            thick.fold(f64::INFINITY, f64::min)
        };
        at(|f| f.start).min(at(|f| f.lower)).min(at(|f| f.upper))
    };
    design
        .rods
        .iter()
        .zip(lengths_mm)
        .map(|(rod, length)| {
            let sections = [Some(&rod.section), rod.section_to.as_ref()];
            let widths: Vec<[f64; 2]> =
                sections.iter().flatten().map(|s| s.half_widths().map(|id| 2.0 * of.value(id))).collect();
            let over =
                |k: usize, f: fn(f64, f64) -> f64| widths.iter().map(|w| w[k]).reduce(f).unwrap_or(f64::NAN);
            let ends = [&rod.from, &rod.to].map(|e| of.point(e.position));
            let half = over(1, f64::max) / 2.0;
            let slides = design.joints.get(rod.joint).is_some_and(|j| j.kind == JointKind::Slider);
            let bodies = [rod.from.body, rod.to.body];
            let own = bodies.iter().any(|b| design.bodies.get(*b).is_some_and(|b| b.owner.is_some()));
            let turn = |s: &State| turn(s, &motion.rest, bodies);
            Flexure {
                joint: rod.joint,
                length_mm: *length,
                thick_mm: over(0, f64::min),
                most_thick_mm: over(0, f64::max),
                least_thick_mm: lower(rod),
                wide_mm: over(1, f64::min),
                along_mm: [ends[0].z.min(ends[1].z) - half, ends[0].z.max(ends[1].z) + half],
                reach_mm: ends.map(|e| Vector3::new(e.x, e.y, 0.0).norm()),
                fillet_mm: rod.fillet_mm,
                round: matches!(rod.section, crate::ir::Section::Round { .. }),
                turn_rad: (!own).then(|| motion.states.iter().map(turn).fold(0.0, f64::max)),
                shift_mm: if slides && !own { motion.span(rod.joint).from_rest_rad } else { 0.0 },
            }
        })
        .collect()
}

/// How far two bodies have turned against each other from one state to another, rad.
pub fn turn(state: &State, from: &State, bodies: [usize; 2]) -> f64 {
    let relative = |s: &State| {
        let [a, b] = bodies.map(|b| s.poses.get(b));
        Some(a?.rotation.transpose() * b?.rotation)
    };
    match (relative(state), relative(from)) {
        (Some(now), Some(then)) => log_so3(&(then.transpose() * now)).norm(),
        _ => 0.0,
    }
}
