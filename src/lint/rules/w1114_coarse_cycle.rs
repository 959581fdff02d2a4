//! ## What it finds
//!
//! A cycle with so few steps that a compliant joint turns more than 15° from one state to the next.
//!
//! ## Why it matters
//!
//! Stress, errors and gaps are looked at in the states only. What is worst in between is not seen, and a snap may pass
//! unnoticed.
//!
//! ## Example
//!
//! ```text
//! cycle 8 steps over 2 s
//! drive motor from 0 deg to 360 deg
//! ```
//!
//! ## Fix
//!
//! Take more steps; 60 are usual for a whole turn. There is no repair by itself, since a finer cycle takes longer to solve.
use crate::lint::prelude::*;
use crate::lint::shapes::turn;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1114", name: "coarse-cycle", severity: Severity::Warning, check: Check::Motion(check) };

/// Joints may turn this far between two states, rad (15°).
const MOST_RAD: f64 = 15.0 / 180.0 * std::f64::consts::PI;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    let mut most = (0.0, "");
    for joint in design.joints.iter().filter(|j| j.is_compliant()) {
        for pair in joint.pairs() {
            for w in view.motion.states.windows(2) {
                let angle = turn(&w[1], &w[0], pair);
                if angle > most.0 {
                    most = (angle, joint.name.as_str());
                }
            }
        }
    }
    if most.0 <= MOST_RAD {
        return Vec::new();
    }
    let message = format!("`{}` turns by {:.0} deg from one state to the next", most.1, most.0.to_degrees());
    let steps = (design.cycle.steps as f64 * most.0 / MOST_RAD).ceil();
    vec![
        RULE.finds(message, design.cycle.origin)
            .help(format!("take at least {steps} steps: between states nothing is looked at")),
    ]
}
