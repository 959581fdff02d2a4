//! ## What it finds
//!
//! A requirement that lets the stress rise above the strength of the material (where that is not stated, above its yield
//! stress).
//!
//! ## Why it matters
//!
//! It passes a part that breaks.
//!
//! ## Example
//!
//! ```text
//! material rigur                          // strength 40 MPa
//! require max(stress()) <= 60 MPa
//! ```
//!
//! ## Fix
//!
//! Ask for a part of the strength: `MATERIAL.strength / 1.5`. `--unsafe-fixes` writes that; it is not safe, because the part may
//! not meet it.
use crate::lint::prelude::*;
use crate::ir::{Aggregate, Quantity};

/// See the module.
pub const RULE: Rule = Rule {
    code: "W1021",
    name: "requirement-above-strength",
    severity: Severity::Warning,
    check: Check::Design(check),
};

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let material = &of.design.material;
    let (limit, field) = match (material.strength_mpa, material.yield_mpa) {
        (Some(s), _) => (s, "strength"),
        (None, Some(y)) => (y, "yield"),
        (None, None) => return Vec::new(),
    };
    let above = of
        .requirements()
        .filter(|r| r.quantity == Quantity::Stress && r.aggregate == Aggregate::Max && r.at_most && r.bound > limit);
    above
        .map(|r| {
            let safe = format!("{}.{field} / 1.5", material.name);
            let message = format!("this allows {:.0} MPa, but `{}` bears {limit:.0} MPa", r.bound, material.name);
            let d = RULE.finds(message, r.origin).help(format!("ask for `{safe}` or less"));
            match of.text.statement(r.origin).map(|s| &s.kind) {
                Some(StatementKind::Require { left, right, op }) => {
                    let less = matches!(op.node, ast::Compare::Less | ast::Compare::LessEqual);
                    let bound = if less { right } else { left };
                    d.fix(Fix::risky(format!("write `{safe}`"), vec![Edit::replace(bound.at, safe)]))
                }
                _ => d,
            }
        })
        .collect()
}
