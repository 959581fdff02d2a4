//! ## What it finds
//!
//! A `drive` whose value stays the same over the whole cycle.
//!
//! ## Why it matters
//!
//! A motor that only holds is either a mistake in the profile, or a joint that could be `fixed` and needs no motor.
//!
//! ## Example
//!
//! ```text
//! drive motor from 30 deg to 30 deg
//! ```
//!
//! ## Fix
//!
//! Give it a motion, or make the joint `fixed`. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1026", name: "still-drive", severity: Severity::Warning, check: Check::Design(check) };

/// Values that differ by less are the same, rad or mm.
const SAME: f64 = 1e-9;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let steps = of.design.cycle.steps.max(1);
    let still = of.design.drives.iter().filter(|d| {
        let first = d.value(0.0);
        (1..=steps).all(|s| (d.value(s as f64 / steps as f64) - first).abs() < SAME)
    });
    still
        .map(|d| {
            RULE.finds(format!("`{}` is driven, but does not move", d.name), d.origin)
                .help("give it a motion, or make the joint `fixed`")
        })
        .collect()
}
