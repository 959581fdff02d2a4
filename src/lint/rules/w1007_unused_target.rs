//! ## What it finds
//!
//! A `target` for a trace that neither the objective nor a requirement mentions.
//!
//! ## Why it matters
//!
//! The path was drawn for the part to follow, and nothing compares the part with it.
//!
//! ## Example
//!
//! ```text
//! target tip = path("tip.csv")
//! minimize { stress() }                  // track(tip) is missing
//! ```
//!
//! ## Fix
//!
//! Add `track(NAME)` or a requirement on `error(NAME)`. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1007", name: "unused-target", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for block in &text.blocks {
        let targets = block.statements.iter().filter_map(|s| match &s.kind {
            StatementKind::Target { trace, .. } => Some(trace),
            _ => None,
        });
        for trace in targets {
            let mut asked = text.dotted.contains(trace.node.as_str());
            for s in block.statements.iter().filter(|s| !matches!(s.kind, StatementKind::Target { .. })) {
                walk::references(s, &mut |name| asked |= name.node == trace.node);
            }
            if !asked {
                found.push(
                    RULE.finds(format!("nothing compares `{}` with its target", trace.node), trace.at)
                        .help(format!("add `track({0})` to `minimize`, or `require max(error({0})) <= …`", trace.node)),
                );
            }
        }
    }
    found
}
