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

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1303", name: "strain-repeated", severity: Severity::Warning, check: Check::Solution(check) };

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let (design, material) = (view.of.design, &view.of.design.material);
    let Some(bears) = material.strain_repeated else { return Vec::new() };
    let Some((stress, place)) = &view.simulation.worst.stress else { return Vec::new() };
    let strain = stress / material.e_mpa;
    if strain <= bears || material.strain_once.is_some_and(|once| strain > once) {
        return Vec::new();
    }
    let message = format!(
        "the largest strain is {:.2} % {}; `{}` bears {:.2} % again and again",
        100.0 * strain,
        place.told(),
        material.name,
        100.0 * bears
    );
    vec![
        RULE.finds(message, walk::joint_of(design, place).unwrap_or(design.origin))
            .help(format!("stay below {:.0} MPa, or accept that the part wears out", bears * material.e_mpa)),
    ]
}
