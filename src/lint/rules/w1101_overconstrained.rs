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
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1101", name: "overconstrained", severity: Severity::Warning, check: Check::Motion(check) };

/// Redundant constraints of a planar loop: its hinges are parallel.
const PLANAR: usize = 3;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    let pairs: usize = design.joints.iter().map(|j| j.bodies.len().saturating_sub(1)).sum();
    let loops = pairs.saturating_sub(view.motion.mobility.moving_bodies);
    let natural = if view.of.is_planar() { PLANAR * loops } else { 0 };
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
