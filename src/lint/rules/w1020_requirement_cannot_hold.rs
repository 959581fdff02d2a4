//! ## What it finds
//!
//! A requirement that no part meets: a size (an error, a stress, a torque, a force, a span) that is to be below zero, or
//! exactly zero.
//!
//! ## Why it matters
//!
//! The build fails after all the work, whatever the optimiser found.
//!
//! ## Example
//!
//! ```text
//! require max(error(tip)) <= 0 mm    // meant: 0.5 mm
//! ```
//!
//! ## Fix
//!
//! Give a bound that can be met. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule = Rule {
    code: "W1020",
    name: "requirement-cannot-hold",
    severity: Severity::Warning,
    check: Check::Design(check),
};

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let never = of.requirements().filter(|r| walk::is_size(r) && r.at_most && r.bound <= 0.0);
    never
        .map(|r| {
            RULE.finds("no part meets this requirement: a size is never below zero", r.origin)
                .help("give a bound that can be met")
        })
        .collect()
}
