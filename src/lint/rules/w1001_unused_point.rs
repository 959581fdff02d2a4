//! ## What it finds
//!
//! A `point` to which nothing refers.
//!
//! ## Why it matters
//!
//! It is in no body, joint or trace, so nothing is printed there. Mostly a body or `into` was meant to go through it, and
//! the part lacks a bar or a bracket that the drawing has.
//!
//! ## Example
//!
//! ```text
//! point S = D - (0 mm, 25 mm)                               // meant for the heel's bracket
//! hinge heel: rocker to base at D as crossed_leaves         // which lacks `into base toward S`
//! ```
//!
//! ## Fix
//!
//! Use it, or remove it: `--fix` does that. It is safe, since nothing depends on the point.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1001", name: "unused-point", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    text.unused(|kind| match kind {
        StatementKind::Point { name, .. } => Some(name),
        _ => None,
    })
    .map(|(name, at)| {
        RULE.finds(format!("nothing uses the point `{}`", name.node), name.at)
            .help("put it into a body, a joint or a trace, or remove it")
            .fix(text.remove(at))
    })
    .collect()
}
