//! ## What it finds
//!
//! Joints that demand the same thing twice, beyond what every planar mechanism does: the mechanism moves only because lengths
//! or axes agree exactly. The finding says how many constraints are too many.
//!
//! ## Why it matters
//!
//! Printed lengths differ by a tenth of a millimetre. An ordinary mechanism of this kind jams or needs play; with flexures it
//! moves, but fights itself, and the stress that comes of it is in no drawing. (Three constraints a loop are redundant in every
//! planar mechanism, because its hinges are parallel; these do not count.)
//!
//! ## Example
//!
//! A parallelogram with a third, equal crank; a hinge on each side of a door frame that is closed already.
//!
//! ## Fix
//!
//! Take the extra link out, or replace a hinge by a ball or a slider. There is no repair by itself.
use crate::ir::{Design, Joint, JointKind};
use crate::lint::prelude::*;
use nalgebra::Vector3;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1101", name: "overconstrained", severity: Severity::Warning, check: Check::Motion(check) };

/// Redundant constraints of a planar loop: its hinges are parallel.
const PLANAR: usize = 3;
/// Cosine from which on axes count as parallel, and sine up to which a slider lies in the plane: 0.08° and the like.
const PARALLEL: f64 = 1.0 - 1e-6;
const SQUARE: f64 = 1e-3;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    // Loops of parallel hinges, and of sliders square to them, by the direction of the hinges.
    let mut axes: Vec<Vector3<f64>> = Vec::new();
    for joint in design.joints.iter().filter(|j| j.kind == JointKind::Hinge) {
        let axis = Vector3::from(joint.axis);
        if !axes.iter().any(|a| a.dot(&axis).abs() > PARALLEL) {
            axes.push(axis);
        }
    }
    let planar = |axis: &Vector3<f64>| {
        let within = |j: &&Joint| match j.kind {
            JointKind::Hinge => Vector3::from(j.axis).dot(axis).abs() > PARALLEL,
            JointKind::Slider => Vector3::from(j.axis).dot(axis).abs() < SQUARE,
            _ => false,
        };
        loops(design, design.joints.iter().filter(within))
    };
    let natural: usize = axes.iter().map(|a| PLANAR * planar(a)).sum();
    let extra = view.motion.mobility.redundant.saturating_sub(natural);
    if extra == 0 {
        return Vec::new();
    }
    // The last joint is the one without which the others would have done.
    let at = design.joints.last().map_or(design.origin, |j| j.origin);
    let many = if extra == 1 { "one constraint is".into() } else { format!("{extra} constraints are") };
    let message = format!("{many} demanded twice: it moves only if lengths or axes agree exactly");
    vec![RULE.finds(message, at).help("take a link out, or make a hinge a ball or a slider")]
}

/// Independent loops of some joints: those that join what the others have joined already. All grounds are one body.
fn loops<'a>(design: &Design, joints: impl Iterator<Item = &'a Joint>) -> usize {
    let mut group: Vec<usize> = (0..design.bodies.len()).collect();
    let first_ground = design.bodies.iter().position(|b| b.ground).unwrap_or(0);
    for (g, _) in group.iter_mut().zip(&design.bodies).filter(|(_, b)| b.ground) {
        *g = first_ground;
    }
    let mut count = 0;
    for [a, b] in joints.flat_map(Joint::pairs) {
        let (Some(from), Some(to)) = (group.get(a).copied(), group.get(b).copied()) else { continue };
        if from == to {
            count += 1;
        }
        group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
    }
    count
}
