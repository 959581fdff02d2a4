//! ## What it finds
//!
//! Two links of a planar mechanism in the same layer that cross at some state of the cycle, but not in the rest pose. The
//! finding says where first.
//!
//! In a mechanism in space lines hardly ever cross, and links have no layers: there the solids are compared, by a build (W0635).
//!
//! ## Why it matters
//!
//! They run into each other: the part jams or breaks there. A build tells it too, by the solids, but only after solving.
//!
//! ## Example
//!
//! A crank that sweeps over a bar of the base in its own layer.
//!
//! ## Fix
//!
//! Give one of them another layer. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1109", name: "links-cross-on-the-way", severity: Severity::Warning, check: Check::Motion(check) };

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let bars = walk::bars(view);
    for [a, b] in walk::strangers(view) {
        if walk::cross(view, &bars, &view.motion.rest, [a, b]) {
            continue;
        }
        if let Some(state) = view.motion.states.iter().find(|s| walk::cross(view, &bars, s, [a, b])) {
            let (Some(a), Some(b)) = (view.of.design.bodies.get(a), view.of.design.bodies.get(b)) else { continue };
            let at = walk::drives_at(view, state);
            let message = format!("`{}` and `{}` cross in layer {}, where {at}", a.name, b.name, a.layer);
            found.push(
                RULE.finds(message, b.origin)
                    .also(a.origin, "in the same layer")
                    .help("give one of them another `layer`, or drive the mechanism over less"),
            );
        }
    }
    found
}
