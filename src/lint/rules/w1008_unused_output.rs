//! ## What it finds
//!
//! An `output` that no requirement mentions. Told as advice.
//!
//! ## Why it matters
//!
//! The angle is shown, but a build passes whatever it is.
//!
//! ## Example
//!
//! ```text
//! output nod = angle(rocker about z)     // require span(nod) >= 5 deg is missing
//! ```
//!
//! ## Fix
//!
//! Add a requirement such as `require span(NAME) >= …`. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1008", name: "unused-output", severity: Severity::Advice, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    text.unused(|kind| match kind {
        StatementKind::Output { name, .. } => Some(name),
        _ => None,
    })
    .filter(|(name, _)| !text.dotted.contains(name.node.as_str()))
    .map(|(name, _)| {
        RULE.finds(format!("the angle `{}` is measured, but nothing is asked of it", name.node), name.at)
            .help(format!("add a requirement, such as `require span({}) >= …`", name.node))
    })
    .collect()
}
