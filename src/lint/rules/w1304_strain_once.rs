//! ## What it finds
//!
//! A solution whose largest strain (stress over Young's modulus) is above what the material bears even once.
//!
//! ## Why it matters
//!
//! The part breaks, or stays bent, in its first turn. The computed stress is that of an elastic material, so it may well be
//! above the strength.
//!
//! ## Example
//!
//! 45 MPa in `rigur` (1900 MPa) is a strain of 2.4 %; it bears 2 % once.
//!
//! ## Fix
//!
//! Lower the stress: longer, thinner flexures, a better rest pose (W1107), a smaller motion. There is no repair by itself.
use crate::lint::prelude::*;
use crate::lint::strain::Bears;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1304", name: "strain-once", severity: Severity::Warning, check: Check::Solution(check) };

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    Bears::Once.solved(&RULE, view, |_| {
        "take longer or thinner flexures, a better rest pose, or a smaller motion".into()
    })
}
