//! ## What it finds
//!
//! `minimize` in a mechanism without any `free` value.
//!
//! ## Why it matters
//!
//! There is nothing to decide: the objective is not even worked out. Mostly every joint is an ordinary one, and `as TEMPLATE` was
//! forgotten, or overrides fixed all that a template leaves free.
//!
//! ## Example
//!
//! ```text
//! hinge knee: coupler to rocker at B      // as crossed_leaves is missing
//! minimize { track(tip) }
//! ```
//!
//! ## Fix
//!
//! Make a joint a flexure, or write `free START in LEAST .. MOST`. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1030", name: "goal-without-free", severity: Severity::Warning, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let first = of.design.all_objectives().next().filter(|_| of.design.free.is_empty());
    let found = first.map(|o| {
        RULE.finds("nothing may vary: there is nothing to minimise by", o.origin)
            .help("make a joint a flexure with `as TEMPLATE`, or write `free START in LEAST .. MOST`")
    });
    found.into_iter().collect()
}
