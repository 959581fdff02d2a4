//! ## What it finds
//!
//! A `trace` that no term of the objective, no requirement and no target mentions. Told as advice.
//!
//! ## Why it matters
//!
//! The point is watched and shown, but nothing keeps it where it should be: the optimiser does not know it, and a build
//! passes wherever it goes.
//!
//! ## Example
//!
//! ```text
//! trace tip = P on coupler
//! minimize { stress() }                  // track(tip) is missing
//! ```
//!
//! ## Fix
//!
//! Add `track(NAME)` or `require max(error(NAME)) <= …`. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1006", name: "unused-trace", severity: Severity::Advice, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    text.unused(|kind| match kind {
        StatementKind::Trace { name, .. } => Some(name),
        _ => None,
    })
    .filter(|(name, _)| !text.dotted.contains(name.node.as_str()))
    .map(|(name, _)| {
        RULE.finds(format!("`{}` is watched, but nothing is asked of it", name.node), name.at)
            .help(format!("add `track({0})` to `minimize`, or `require max(error({0})) <= …`", name.node))
    })
    .collect()
}
