//! ## What it finds
//!
//! A term of the objective that stands twice with the same arguments.
//!
//! ## Why it matters
//!
//! The objective is a sum: a term that stands twice counts twice as much as written. Mostly another trace or drive was meant.
//!
//! ## Example
//!
//! ```text
//! minimize { track(tip)  track(tip) }    // meant: track(heel)
//! ```
//!
//! ## Fix
//!
//! Write what was meant, or one term with the sum of the weights. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1023", name: "repeated-term", severity: Severity::Warning, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let all = &of.design.objectives;
    let mut found = Vec::new();
    for (j, b) in all.iter().enumerate() {
        if let Some(a) = all.iter().take(j).find(|a| a.kind == b.kind) {
            found.push(
                RULE.finds("this term stands twice: it counts twice as much as written", b.origin)
                    .also(a.origin, "first here")
                    .help("write what was meant, or one term with the sum of the weights"),
            );
        }
    }
    found
}
