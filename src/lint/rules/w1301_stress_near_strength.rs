//! ## What it finds
//!
//! A solution whose largest stress is above two thirds of the material's strength (of its yield stress, where that is stated and
//! lower).
//!
//! ## Why it matters
//!
//! Printed strength scatters by a quarter, from machine to machine and with age. Without a margin of 1.5 some parts break.
//!
//! ## Example
//!
//! `rigur` bears 40 MPa; a hinge of 30 MPa is told.
//!
//! ## Fix
//!
//! Lower the bound in `stress(below = …)`, give the flexures more room, or turn less. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1301", name: "stress-near-strength", severity: Severity::Warning, check: Check::Solution(check) };

/// Part of the strength that may be used.
const MOST: f64 = 1.0 / 1.5;

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let design = view.of.design;
    let limits = [design.material.strength_mpa, design.material.yield_mpa];
    let Some(limit) = limits.into_iter().flatten().reduce(f64::min) else { return Vec::new() };
    let Some((stress, place)) = &view.simulation.worst.stress else { return Vec::new() };
    if *stress <= MOST * limit {
        return Vec::new();
    }
    let message = format!("the largest stress is {stress:.1} MPa {}; `{}` bears {limit:.0} MPa", place.told(), design.material.name);
    vec![
        RULE.finds(message, walk::joint_of(design, place).unwrap_or(design.origin))
            .help("leave a margin of 1.5: lower `stress(below = …)`, give the flexure more room, or turn less"),
    ]
}
