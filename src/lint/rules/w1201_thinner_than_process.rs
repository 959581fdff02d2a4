//! ## What it finds
//!
//! A flexure that at the start is thinner, or narrower along its axis, than the least wall of the process.
//!
//! ## Why it matters
//!
//! The printer leaves it out, closes it to a line of its own width, or prints it so that it breaks in the first bend.
//!
//! ## Example
//!
//! ```text
//! print on fdm                                            // least wall 0.8 mm
//! hinge heel: rocker to base at D as leaf { thickness = 0.5 mm }
//! ```
//!
//! ## Fix
//!
//! Make it thicker, or print it finer. There is no repair by itself: a thicker flexure is a stiffer one, and has to be longer.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1201", name: "thinner-than-process", severity: Severity::Warning, check: Check::Flexures(check) };

/// Walls may miss the least one by this, mm.
const TOLERANCE_MM: f64 = 1e-6;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let process = &view.of.design.process;
    let size = |f: &crate::lint::Flexure| f.thick_mm.min(f.wide_mm);
    walk::worst_of_joints(view, |f| {
        (size(f) < process.least_wall_mm - TOLERANCE_MM).then(|| -size(f))
    })
    .into_iter()
    .map(|(joint, f)| {
        let message = format!(
            "a flexure of `{}` is {:.2} mm thin; `{}` prints {:.2} mm at least",
            joint.name,
            size(f),
            process.name,
            process.least_wall_mm
        );
        RULE.finds(message, joint.origin).help("make it thicker, give it more height, or print it by a finer process")
    })
    .collect()
}
