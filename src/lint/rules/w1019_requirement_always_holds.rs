//! ## What it finds
//!
//! A requirement that holds for every part: a size that is to be at least zero, an angle between directions that is to be at most 180°.
//!
//! ## Why it matters
//!
//! It looks like a test and tests nothing. Mostly the comparison points the wrong way.
//!
//! ## Example
//!
//! ```text
//! require max(stress()) >= 0 MPa     // meant: <= 25 MPa
//! ```
//!
//! ## Fix
//!
//! Turn the comparison round, or give a bound that can fail. There is no repair by itself.
use crate::lint::prelude::*;
use crate::ir::Quantity;

/// See the module.
pub const RULE: Rule = Rule {
    code: "W1019",
    name: "requirement-always-holds",
    severity: Severity::Warning,
    check: Check::Design(check),
};

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let always = of.requirements().filter(|r| {
        let least = walk::is_size(r) && !r.at_most && (r.bound < 0.0 || r.bound == 0.0 && !r.strict);
        let most = matches!(r.quantity, Quantity::AimError(_)) && r.at_most && r.bound >= std::f64::consts::PI;
        least || most
    });
    always
        .map(|r| {
            RULE.finds("this requirement holds whatever the part does", r.origin)
                .help("turn the comparison round, or give a bound that can fail")
        })
        .collect()
}
