//! ## What it finds
//!
//! A flexure shorter than five times its thickness.
//!
//! ## Why it matters
//!
//! It is computed as a rod, which is long against its thickness. A stubby one is a notch: stress concentrates at its ends, and it is
//! stiffer than computed by tens of per cent.
//!
//! ## Example
//!
//! ```text
//! hinge heel: rocker to base at D as leaf { size = 1 mm, thickness = 1 mm }
//! ```
//!
//! ## Fix
//!
//! Make it longer (`size`) or thinner. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1206", name: "stubby-flexure", severity: Severity::Warning, check: Check::Flexures(check) };

/// Rods are at least this many times as long as thick.
const LEAST: f64 = 5.0;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let ratio = |f: &crate::lint::Flexure| f.length_mm / f.most_thick_mm;
    walk::worst_of_joints(view, |f| (ratio(f) < LEAST).then(|| -ratio(f)))
        .into_iter()
        .map(|(joint, f)| {
            let message = format!(
                "a flexure of `{}` is {:.1} mm long and {:.1} mm thick: no rod",
                joint.name, f.length_mm, f.most_thick_mm
            );
            RULE.finds(message, joint.origin)
                .help("make it at least five times as long as thick: what is shorter is stiffer than computed")
        })
        .collect()
}
