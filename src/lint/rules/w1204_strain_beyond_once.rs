//! ## What it finds
//!
//! A flexure that would be strained beyond what its material bears even once, if it bent evenly at the least thickness that
//! its bounds allow: thickness · angle / (2 · length). Real flexures bend less evenly, so more.
//!
//! ## Why it matters
//!
//! No choice of the optimiser within these bounds and this length saves it: it breaks in the first turn.
//!
//! ## Example
//!
//! A leaf 2 mm thick and 8 mm long that is to turn by 40°: 8.7 %, where `rigur` bears 2 %.
//!
//! ## Fix
//!
//! Make it thinner or longer (`size`), turn less (see W1107), or take a material that bears more. There is no repair by itself.
use crate::lint::prelude::*;
use crate::lint::strain::Bears;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1204", name: "strain-beyond-once", severity: Severity::Warning, check: Check::Flexures(check) };

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    Bears::Once.at_the_least(&RULE, view)
}
