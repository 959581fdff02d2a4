//! ## What it finds
//!
//! A compliant joint that has to turn more than 90° away from the rest pose. (One that would have to turn fully is an error,
//! E0504.)
//!
//! ## Why it matters
//!
//! Leaves that bend so far are long, wander far from the axis, and get into each other's way. Printed plastics bear it for a few
//! hundred turns.
//!
//! ## Example
//!
//! Jansen's leg printed as drawn asks one hinge for 128°; printed at 132° of the crank it asks none for more than 67°.
//!
//! ## Fix
//!
//! Print it in the middle of its motion (`rest`, see W1107), turn less, or leave the joint an ordinary one. There is no
//! repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1106", name: "wide-turn", severity: Severity::Warning, check: Check::Motion(check) };

/// Further than this a flexure is a poor hinge, rad (90°).
const MOST_RAD: f64 = std::f64::consts::FRAC_PI_2;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    let turning = |(id, joint): (usize, &crate::ir::Joint)| {
        let hinge = joint.kind == crate::ir::JointKind::Hinge && joint.is_compliant();
        let turn = view.motion.span(id).from_rest_rad;
        (hinge && turn > MOST_RAD).then(|| {
            let message = format!("`{}` has to bend by {:.0} deg from its rest pose", joint.name, turn.to_degrees());
            RULE.finds(message, joint.origin)
                .help("print it in the middle of its motion (`rest`), turn less, or leave out `as …`")
        })
    };
    design.joints.iter().enumerate().filter_map(turning).collect()
}
