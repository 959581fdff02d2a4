//! ## What it finds
//!
//! A solution whose largest strain (stress over Young's modulus) is above what the material bears again and again, but not above
//! what it bears once.
//!
//! ## Why it matters
//!
//! The part works on the day it is printed and cracks after some hundreds or thousands of turns: at the ends of a leaf, where the
//! largest strain is.
//!
//! ## Example
//!
//! A bound of 25 MPa on `rigur` (1900 MPa) is a strain of 1.3 %; it bears 1 % again and again.
//!
//! ## Fix
//!
//! Lower `stress(below = …)` to E times the repeated strain, turn less, or accept it for a part that is shown rather than
//! used: `allow W1303 "…"`. There is no repair by itself.
use crate::lint::prelude::*;
use crate::lint::strain::Bears;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1303", name: "strain-repeated", severity: Severity::Warning, check: Check::Solution(check) };

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    Bears::Repeatedly.solved(&RULE, view, |mpa| {
        format!("stay below {mpa:.0} MPa, or accept that the part wears out")
    })
}
