//! ## What it finds
//!
//! A `let` to which nothing refers.
//!
//! ## Why it matters
//!
//! A length that was named and then not used is mostly one that somebody wrote as a number a second time. When the design
//! is changed, only one of the two follows.
//!
//! ## Example
//!
//! ```text
//! let half = 2.5 * r
//! point B = meet(circle(A, 50 mm), circle(D, 50 mm), left)    // meant: half
//! ```
//!
//! ## Fix
//!
//! Use it, or remove it: `--fix` does that. It is safe, since nothing depends on the value.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1002", name: "unused-let", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    text.unused(|kind| match kind {
        // A free value that nothing depends on has a finding of its own.
        StatementKind::Let { name, value } if !walk::is_free(value) => Some(name),
        _ => None,
    })
    .map(|(name, at)| {
        RULE.finds(format!("nothing uses the value `{}`", name.node), name.at)
            .help("use it where the number stands now, or remove it")
            .fix(text.remove(at))
    })
    .collect()
}
