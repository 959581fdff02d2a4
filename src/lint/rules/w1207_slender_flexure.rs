//! ## What it finds
//!
//! A flexure longer than a hundred times its thickness.
//!
//! ## Why it matters
//!
//! It is a hair: it buckles under the weight of the links, flutters, is bent by the support material, and printers cannot hold its
//! thickness over such a length.
//!
//! ## Example
//!
//! ```text
//! hinge heel: rocker to base at D as leaf { size = 60 mm, thickness = 0.6 mm }
//! ```
//!
//! ## Fix
//!
//! Make it shorter (`size`) or thicker. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1207", name: "slender-flexure", severity: Severity::Warning, check: Check::Flexures(check) };

/// Printed flexures are at most this many times as long as thick.
const MOST: f64 = 100.0;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let ratio = |f: &crate::lint::Flexure| f.length_mm / f.thick_mm;
    walk::worst_of_joints(view, |f| (ratio(f) > MOST).then(|| ratio(f)))
        .into_iter()
        .map(|(joint, f)| {
            let message = format!(
                "a flexure of `{}` is {:.0} mm long and {:.1} mm thick: a hair",
                joint.name, f.length_mm, f.thick_mm
            );
            RULE.finds(message, joint.origin).help("make it shorter or thicker: a hair buckles, and prints badly")
        })
        .collect()
}
