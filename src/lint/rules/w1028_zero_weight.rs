//! ## What it finds
//!
//! A term of the objective with the weight 0.
//!
//! ## Why it matters
//!
//! It is worked out at every step of the optimiser and counts nothing. Left over from an experiment, it makes the reader
//! believe that the part was designed for it.
//!
//! ## Example
//!
//! ```text
//! torque(motor) weight 0
//! ```
//!
//! ## Fix
//!
//! Remove the term: `--fix` does that where it stands on a line of its own. It is safe, since it counts nothing.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1028", name: "zero-weight", severity: Severity::Warning, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let idle = of.design.all_objectives().filter(|o| o.weight == 0.0);
    idle.map(|o| {
        let d = RULE.finds("this term has the weight 0: it counts nothing", o.origin).help("remove it, or give it a weight");
        let edit = Edit::remove(of.text.of(o.origin.file), o.origin);
        // Among others on a line a comma would be left over.
        if edit.at == o.origin { d } else { d.fix(Fix::safe("remove it", vec![edit])) }
    })
    .collect()
}
