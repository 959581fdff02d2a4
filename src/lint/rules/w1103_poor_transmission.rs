//! ## What it finds
//!
//! A pair of links that at some state of the cycle meet at less than 20°, or nearly in line: the transmission angle, by which a
//! force goes from one to the other. The finding says the least angle, and where.
//!
//! Only mechanisms that are planar and fall apart into pairs of links hinged to what moves already are looked at. In space
//! the angle depends on where the force goes on to, which the text does not say: there, look at the torque (W1302).
//!
//! ## Why it matters
//!
//! Near such a dead point a large force in the links makes a small one at the output: friction and the stiffness of the
//! flexures eat it, and play decides where the part goes. Books ask for 40°, for slow and light mechanisms for 30°.
//!
//! ## Example
//!
//! A four-bar linkage whose coupler and rocker stretch out into nearly one line.
//!
//! ## Fix
//!
//! Change the lengths, or drive it over less. There is no repair by itself.
use crate::lint::dyads::dyads;
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1103", name: "poor-transmission", severity: Severity::Warning, check: Check::Motion(check) };

/// Angles below this transmit badly even where nothing is heavy, rad (20°).
const LEAST_RAD: f64 = 20.0 / 180.0 * std::f64::consts::PI;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for dyad in dyads(view) {
        let angle = |[a, b, c]: [nalgebra::Vector3<f64>; 3]| {
            let angle = (a - b).angle(&(c - b));
            angle.min(std::f64::consts::PI - angle)
        };
        let states = view.motion.states.iter();
        let all = states.filter_map(|s| Some((angle(dyad.at(view, s)?), s)));
        let Some((least, state)) = all.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        let Some(joint) = view.of.design.joints.get(dyad.inner).filter(|_| least < LEAST_RAD) else { continue };
        let names = dyad.bodies.map(|b| view.of.design.bodies.get(b).map_or("", |b| b.name.as_str()));
        let message = format!(
            "`{}` and `{}` meet at {:.0} deg only, where {}",
            names[0],
            names[1],
            least.to_degrees(),
            walk::drives_at(view, state)
        );
        found.push(
            RULE.finds(message, joint.origin)
                .help("change their lengths, or drive the mechanism over less: 30 deg to 40 deg is usual at least"),
        );
    }
    found
}
