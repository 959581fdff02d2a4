//! ## What it finds
//!
//! A flexure that would be strained beyond what its material bears again and again, but not beyond what it bears once, if it
//! bent evenly at the least thickness that its bounds allow: thickness · angle / (2 · length).
//!
//! ## Why it matters
//!
//! It works on the day it is printed, and cracks after some hundreds or thousands of turns. No choice of the optimiser within these
//! bounds and this length saves it.
//!
//! ## Example
//!
//! A leaf 0.6 mm thick and 31 mm long that turns by 67°: 1.1 %, where `rigur` bears 1 % again and again.
//!
//! ## Fix
//!
//! Make it thinner or longer (`size`), turn less (see W1107), take another material, or accept it for a part that is shown rather
//! than used: `allow W1205 "…"`. There is no repair by itself.
use crate::lint::prelude::*;
use crate::lint::strain::Bears;

/// See the module.
pub const RULE: Rule = Rule {
    code: "W1205",
    name: "strain-beyond-repeated",
    severity: Severity::Warning,
    check: Check::Flexures(check),
};

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    Bears::Repeatedly.at_the_least(&RULE, view)
}
