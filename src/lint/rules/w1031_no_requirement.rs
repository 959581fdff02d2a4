//! ## What it finds
//!
//! A design that exports parts and has no `require` line. Told as advice.
//!
//! ## Why it matters
//!
//! A design carries its own acceptance tests. Without one, every change passes, also one that doubles the stress.
//!
//! ## Example
//!
//! ```text
//! export stl                              // but nothing is required
//! ```
//!
//! ## Fix
//!
//! Require what the part is for: `require max(error(tip)) <= 1 mm`, `require max(stress()) <= rigur.strength / 1.5`. There is
//! no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1031", name: "no-requirement", severity: Severity::Advice, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let Some(export) = of.assembly.exports.first() else { return Vec::new() };
    if of.requirements().next().is_some() || of.assembly.designs.iter().any(|d| d.all_requirements().next().is_some()) {
        return Vec::new();
    }
    vec![
        RULE.finds("parts are made of this design, but nothing is required of them", export.export.origin)
            .help("say what the part is for, such as `require max(stress()) <= MATERIAL.strength / 1.5`"),
    ]
}
