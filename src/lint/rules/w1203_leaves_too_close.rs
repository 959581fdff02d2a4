//! ## What it finds
//!
//! Two flexures of one joint that lie beside each other along its axis with less than the process's clearance between them.
//!
//! ## Why it matters
//!
//! They cross, so they touch: printed nearer than the clearance they are one piece, and the hinge is a block.
//!
//! ## Example
//!
//! ```text
//! hinge heel: rocker to base at D as crossed_leaves { gap = 0.1 mm }      // polyjet keeps 0.4 mm apart
//! ```
//!
//! ## Fix
//!
//! Leave `gap` out (templates take the clearance), or give the clearance. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1203", name: "leaves-too-close", severity: Severity::Warning, check: Check::Flexures(check) };

/// Gaps may miss the clearance by this, mm.
const TOLERANCE_MM: f64 = 1e-6;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let design = view.of.design;
    let clearance = design.process.clearance_mm;
    let mut found = Vec::new();
    for (id, joint) in design.joints.iter().enumerate() {
        let mut along: Vec<[f64; 2]> = view.flexures.iter().filter(|f| f.joint == id).map(|f| f.along_mm).collect();
        along.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let gaps = along.windows(2).map(|w| w[1][0] - w[0][1]);
        // Those that overlap lie beside each other across the axis, not along it.
        let least = gaps.filter(|g| *g > TOLERANCE_MM).fold(f64::INFINITY, f64::min);
        if least < clearance - TOLERANCE_MM {
            let message = format!(
                "the flexures of `{}` leave {least:.2} mm between them; `{}` keeps {clearance:.2} mm apart",
                joint.name, design.process.name
            );
            found.push(
                RULE.finds(message, joint.origin)
                    .help("leave `gap` out, or give it the process's clearance: what is nearer is printed as one piece"),
            );
        }
    }
    found
}
