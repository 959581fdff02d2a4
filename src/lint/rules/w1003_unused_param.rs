//! ## What it finds
//!
//! A `param` of a mechanism or a flexure to which nothing in it refers.
//!
//! ## Why it matters
//!
//! A parameter is a promise: whoever sets it expects the part to change. Setting this one changes nothing.
//!
//! ## Example
//!
//! ```text
//! param gap: length = process.clearance
//! let wide = (layer_height - 0.4 mm) / 2      // meant: gap
//! ```
//!
//! ## Fix
//!
//! Use it, or remove it: `--unsafe-fixes` does that. It is not safe where somebody sets the parameter from outside, by
//! `--set` or in `as TEMPLATE { … }`.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1003", name: "unused-param", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    text.unused(|kind| match kind {
        StatementKind::Param { name, value, .. } if !walk::is_free(value) => Some(name),
        _ => None,
    })
    .map(|(name, at)| {
        let edit = Edit::remove(text.of(at.file), at);
        RULE.finds(format!("the parameter `{}` changes nothing", name.node), name.at)
            .help("use it where its value stands now, or remove it")
            .fix(Fix::risky("remove it", vec![edit]))
    })
    .collect()
}
