//! ## What it finds
//!
//! A point that stands twice in the list of one body.
//!
//! ## Why it matters
//!
//! The second one does nothing; mostly it is a slip for another point, which the body then lacks.
//!
//! ## Example
//!
//! ```text
//! link coupler { A, B, A }       // meant: { A, B, P }
//! ```
//!
//! ## Fix
//!
//! Write the point that was meant, or remove the second one: `--fix` does that. It is safe, since it does nothing.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1018", name: "point-listed-twice", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for s in text.blocks.iter().flat_map(|b| b.statements) {
        let StatementKind::Body { name, points, .. } = &s.kind else { continue };
        for (i, point) in points.iter().enumerate() {
            let earlier = points.iter().take(i);
            let Some(before) = earlier.clone().next_back() else { continue };
            if !earlier.clone().any(|p| p.node == point.node) {
                continue;
            }
            let gap = Origin { start: before.at.end, ..point.at };
            found.push(
                RULE.finds(format!("`{}` stands twice in `{}`", point.node, name.node), point.at)
                    .help("write the point that was meant, or remove this one")
                    .fix(Fix::safe("remove it", vec![Edit::replace(gap, "")])),
            );
        }
    }
    found
}
