//! ## What it finds
//!
//! A second `ground` body that no joint joins to anything.
//!
//! ## Why it matters
//!
//! It is printed as a piece of its own that holds nothing, and the joints that were meant for it are somewhere else. (A
//! `link` without a joint is an error: it would fall.)
//!
//! ## Example
//!
//! ```text
//! ground base  { O, D }
//! ground stand { F }                      // no joint goes to the stand
//! ```
//!
//! ## Fix
//!
//! Join something to it, or remove it. There is no repair by itself: which of the two is meant cannot be known.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1004", name: "unused-ground", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let several = |b: &&Block| {
        let ground = |s: &&ast::Statement| matches!(s.kind, StatementKind::Body { ground: true, .. });
        b.statements.iter().filter(ground).count() > 1
    };
    let unused = text.blocks.iter().filter(several).flat_map(|b| {
        b.statements.iter().filter_map(|s| match &s.kind {
            StatementKind::Body { ground: true, name, .. } if !b.used.contains(name.node.as_str()) => Some(name),
            _ => None,
        })
    });
    unused
        .map(|name| {
            RULE.finds(format!("no joint joins anything to the ground `{}`", name.node), name.at)
                .help("join a link to it, or remove it: it would be printed as a loose piece")
        })
        .collect()
}
