//! ## What it finds
//!
//! A joint that at some state turns more than eight times as fast as the drive. The finding says how fast, and where.
//!
//! ## Why it matters
//!
//! The mechanism passes near a dead point. There the torque of the drive multiplies, an error of a step of the motor is eight times an
//! error of the joint, and the bent mechanism, which is not quite the drawn one, may take another way or snap.
//!
//! ## Example
//!
//! A four-bar linkage whose crank is nearly as long as the loop allows.
//!
//! ## Fix
//!
//! Change the lengths, or drive it over less. There is no repair by itself.
use crate::ir::{DriveUnit, JointKind};
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1104", name: "fast-joint", severity: Severity::Warning, check: Check::Motion(check) };

/// Joints that turn faster than this many times the drive are near a dead point.
const MOST: f64 = 8.0;
/// Steps of the drive shorter than this say nothing about a rate, rad.
const LEAST_STEP_RAD: f64 = 1e-6;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    let [drive] = design.drives.as_slice() else { return Vec::new() };
    if drive.unit != DriveUnit::Rad {
        return Vec::new();
    }
    let mut found = Vec::new();
    for (id, joint) in design.joints.iter().enumerate().filter(|(_, j)| j.kind == JointKind::Hinge) {
        let rates = view.motion.states.windows(2).filter_map(|pair| {
            let [a, b] = pair else { return None };
            let step = b.drives.first()? - a.drives.first()?;
            let turn = b.joint_values.get(id)? - a.joint_values.get(id)?;
            (step.abs() > LEAST_STEP_RAD).then(|| ((turn / step).abs(), a))
        });
        let Some((rate, state)) = rates.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        if rate > MOST {
            let at = walk::drives_at(view, state);
            let message = format!("`{}` turns {rate:.0} times as fast as the drive, where {at}", joint.name);
            found.push(
                RULE.finds(message, joint.origin)
                    .also(drive.origin, "driven here")
                    .help("this is near a dead point: change the lengths, or drive it over less"),
            );
        }
    }
    found
}
