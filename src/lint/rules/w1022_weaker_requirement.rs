//! ## What it finds
//!
//! A requirement that follows from a stricter one on the same quantity.
//!
//! ## Why it matters
//!
//! It can never be the one that fails. When somebody loosens it later, nothing changes, and nobody sees why.
//!
//! ## Example
//!
//! ```text
//! require max(error(tip)) <= 1 mm
//! require max(error(tip)) <= 2 mm
//! ```
//!
//! ## Fix
//!
//! Remove the weaker one: `--fix` does that. It is safe: what it asks is asked still.
use crate::lint::prelude::*;
use crate::ir::Requirement;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1022", name: "weaker-requirement", severity: Severity::Warning, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let all = &of.design.requirements;
    // Of two that ask the same, the later one is the weaker.
    let implies = |i: usize, a: &Requirement, j: usize, b: &Requirement| {
        let same = a.aggregate == b.aggregate && a.quantity == b.quantity && a.at_most == b.at_most;
        let tighter = if a.at_most { a.bound < b.bound } else { a.bound > b.bound };
        let equal = a.bound == b.bound && (a.strict && !b.strict || a.strict == b.strict && i < j);
        same && i != j && (tighter || equal)
    };
    let mut found = Vec::new();
    for (j, b) in all.iter().enumerate() {
        if let Some((_, a)) = all.iter().enumerate().find(|(i, a)| implies(*i, a, j, b)) {
            found.push(
                RULE.finds("this requirement follows from a stricter one", b.origin)
                    .also(a.origin, "the stricter one")
                    .help("keep one of the two")
                    .fix(of.text.remove(b.origin)),
            );
        }
    }
    found
}
