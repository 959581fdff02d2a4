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

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1304", name: "strain-once", severity: Severity::Warning, check: Check::Solution(check) };

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let (design, material) = (view.of.design, &view.of.design.material);
    let Some(bears) = material.strain_once else { return Vec::new() };
    let Some((stress, place)) = &view.simulation.worst.stress else { return Vec::new() };
    let strain = stress / material.e_mpa;
    if strain <= bears {
        return Vec::new();
    }
    let message = format!(
        "the largest strain is {:.2} % {}; `{}` bears {:.2} % once",
        100.0 * strain,
        place.told(),
        material.name,
        100.0 * bears
    );
    vec![
        RULE.finds(message, walk::joint_of(design, place).unwrap_or(design.origin))
            .help("take longer or thinner flexures, a better rest pose, or a smaller motion"),
    ]
}
