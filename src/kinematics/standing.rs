//! Mechanisms without a drive: the conventional one stands as drawn, and its loads bend the compliant one. For that
//! its flexures must hold every body.

use super::constraint::Constraint;
use super::linear::Rows;
use super::mechanism::Mechanism;
use super::mobility::{loose, names};
use super::motion::State;
use crate::diagnostic::Diagnostic;
use crate::ir::JointKind;
use nalgebra::Vector3;

/// The one state of a mechanism that stands as drawn.
pub(super) fn drawn(mechanism: &Mechanism) -> State {
    State {
        angles_rad: vec![0.0; mechanism.design.aims.angles.len()],
        drives: Vec::new(),
        poses: mechanism.drawing.clone(),
        joint_values: vec![0.0; mechanism.values.len()],
        traces_mm: mechanism.trace_points(&mechanism.drawing),
    }
}

/// What is wrong with a mechanism without a drive: bodies that would move freely although every flexure holds its joint.
pub(super) fn diagnose(mechanism: &Mechanism) -> Option<Diagnostic> {
    let design = mechanism.design;
    let mut held = mechanism.clone();
    for (id, joint) in design.joints.iter().enumerate().filter(|(_, j)| j.is_compliant()) {
        for pair in joint.pairs() {
            let at = mechanism.joint_points[id];
            let made = Constraint::of_joint(JointKind::Fixed, pair, at, &Vector3::z(), None);
            held.constraints.extend(made.into_iter().map(|c| (c, id)));
        }
    }
    held.arrange();
    let rank = Rows::at(&held, &held.drawing, &[]).rank(true);
    if rank.null.is_empty() {
        return None;
    }
    let bodies = loose(&held, &rank);
    let at = bodies.first().and_then(|b| design.bodies.get(*b)).map_or(design.origin, |b| b.origin);
    let names = names(bodies.iter().filter_map(|b| design.bodies.get(*b)).map(|b| &b.name));
    Some(
        Diagnostic::error("E0502", format!("nothing is driven, and no flexure holds {names}"), at)
            .label("free to move")
            .help("drive a joint, or make one compliant: `as TEMPLATE`"),
    )
}
