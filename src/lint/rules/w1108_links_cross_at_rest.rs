//! ## What it finds
//!
//! Two links of a planar mechanism in the same layer that lie across each other in the rest pose, without a joint between
//! them. Only the lines between their points are looked at; the solids, which are wider, a build looks at.
//!
//! In a mechanism in space lines hardly ever cross, and links have no layers: there the solids are compared, by a build (E0633).
//!
//! ## Why it matters
//!
//! They are printed as one piece, and nothing moves.
//!
//! ## Example
//!
//! ```text
//! link left  { A, B }
//! link right { C, D }            // crosses it; layer 1 is missing
//! ```
//!
//! ## Fix
//!
//! Give one of them another layer. There is no repair by itself: which layers are free where they pass cannot be known.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1108", name: "links-cross-at-rest", severity: Severity::Warning, check: Check::Motion(check) };

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let bars = walk::bars(view);
    for [a, b] in walk::strangers(view) {
        if walk::cross(view, &bars, &view.motion.rest, [a, b]) {
            let (Some(a), Some(b)) = (view.of.design.bodies.get(a), view.of.design.bodies.get(b)) else { continue };
            let message = format!("`{}` and `{}` lie across each other in layer {}", a.name, b.name, a.layer);
            found.push(
                RULE.finds(message, b.origin)
                    .also(a.origin, "in the same layer")
                    .help("give one of them another `layer`: they would be printed as one piece"),
            );
        }
    }
    found
}
