//! ## What it finds
//!
//! A body with several points that all lie in one place.
//!
//! ## Why it matters
//!
//! A bar of no length has no direction: flexures cannot tell where to leave it, and it is printed as a lump.
//!
//! ## Example
//!
//! ```text
//! link coupler { A, B }          // with point B = A
//! ```
//!
//! ## Fix
//!
//! Move a point. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1016", name: "short-body", severity: Severity::Warning, check: Check::Design(check) };

/// Points nearer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let short = of.design.bodies.iter().filter(|b| {
        let mut points = b.skeleton.iter().map(|p| of.point(p.position));
        let Some(first) = points.next() else { return false };
        b.owner.is_none() && b.skeleton.len() > 1 && points.all(|p| (p - first).norm() < SAME_MM)
    });
    short
        .map(|b| {
            RULE.finds(format!("all points of `{}` lie in one place", b.name), b.origin)
                .help("move one of them: a bar of no length has no direction")
        })
        .collect()
}
