//! ## What it finds
//!
//! A loop that at some state of the cycle is nearly stretched out or folded: if its links were shorter by the process's clearance (or by
//! 1 % of their lengths, where that is more), it could not be assembled there. The finding says what is left, and where.
//!
//! Only mechanisms that are planar and fall apart into pairs of links hinged to what moves already are looked at: of such a pair two
//! lengths and a distance decide. In space, that a loop opens is an error (E0503) with the drive's value; how much is left is not told.
//!
//! ## Why it matters
//!
//! What is drawn goes round; what is printed, with lengths a little off and pins with play, jams. And flexures are no
//! ideal hinges: their axes wander by more than that.
//!
//! ## Example
//!
//! A crank of 20 mm, links of 50 mm and 50 mm, and a base of 79 mm: stretched out, 1 mm is left.
//!
//! ## Fix
//!
//! Make the loop's links longer, or keep the drive away from there. There is no repair by itself.
use crate::lint::dyads::dyads;
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1105", name: "loop-nearly-opens", severity: Severity::Warning, check: Check::Motion(check) };

/// Part of the two lengths that is to be left.
const LEAST_PART: f64 = 0.01;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for dyad in dyads(view) {
        let left = |[a, b, c]: [nalgebra::Vector3<f64>; 3]| {
            let (u, v, across) = ((a - b).norm(), (c - b).norm(), (c - a).norm());
            // Of a pair of equal links the folded state is one point, through which it may well go.
            let folded = across - (u - v).abs();
            let stretched = u + v - across;
            (if folded < stretched { folded } else { stretched }, LEAST_PART * (u + v), folded < stretched)
        };
        let states = view.motion.states.iter().filter_map(|s| Some((left(dyad.at(view, s)?), s)));
        let Some(((least, part, folded), state)) = states.min_by(|a, b| a.0.0.total_cmp(&b.0.0)) else { continue };
        let enough = part.max(view.of.design.process.clearance_mm);
        let Some(joint) = view.of.design.joints.get(dyad.inner).filter(|_| least < enough) else { continue };
        let names = dyad.bodies.map(|b| view.of.design.bodies.get(b).map_or("", |b| b.name.as_str()));
        let how = if folded { "folded" } else { "stretched out" };
        let message = format!(
            "`{}` and `{}` are nearly {how}: {least:.2} mm are left, where {}",
            names[0],
            names[1],
            walk::drives_at(view, state)
        );
        found.push(
            RULE.finds(message, joint.origin)
                .help("make these links longer, or keep the drive away from there: printed lengths are never exact"),
        );
    }
    found
}
