//! ## What it finds
//!
//! `free` values in a mechanism without `minimize`.
//!
//! ## Why it matters
//!
//! Nothing says what a good value is, so all stay at their start: the part that is printed was never optimised.
//!
//! ## Example
//!
//! ```text
//! hinge heel: rocker to base at D as crossed_leaves      // many free values
//! // no minimize { … }
//! ```
//!
//! ## Fix
//!
//! Add `minimize { track(tip) … }`, or write numbers. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1029", name: "free-without-goal", severity: Severity::Warning, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let (design, count) = (of.design, of.design.free.len());
    if count == 0 || design.all_objectives().next().is_some() {
        return Vec::new();
    }
    // Only what the text itself frees: a template's own values are its starts, and may be good enough.
    let Some(first) = design.free.iter().find(|f| of.text.owns(f.origin)) else { return Vec::new() };
    let message = format!("nothing says what is good: the {count} free values stay at their starts");
    vec![RULE.finds(message, first.origin).label("free").help("add `minimize { … }`, or write numbers")]
}
