//! ## What it finds
//!
//! Bodies or flexures that over the cycle come nearer to each other than the process's clearance, without touching. Only a build
//! measures it. (What touches is W0635 and W0636; what is too near already in the rest pose is W0634.)
//!
//! ## Why it matters
//!
//! The clearance is what the process needs to keep two faces apart, and about what printed parts are off. At less, some parts touch.
//!
//! ## Example
//!
//! A rocker that passes the base at 0.15 mm, printed on `polyjet` (0.4 mm).
//!
//! ## Fix
//!
//! Add `collision(gap = …)` to `minimize`, aim a flexure elsewhere (`into`), or give a link another layer. There is no repair
//! by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1312", name: "gap-near-clearance", severity: Severity::Warning, check: Check::Solution(check) };

/// Gaps may miss the clearance by this, mm: flexures are meshed to about as much.
const TOLERANCE_MM: f64 = 0.01;

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let design = view.of.design;
    let clearance = design.process.clearance_mm;
    let Some((gap, place)) = &view.simulation.worst.gap else { return Vec::new() };
    if *gap <= 0.0 || *gap >= clearance - TOLERANCE_MM {
        return Vec::new();
    }
    let message = format!("the least gap is {gap:.2} mm {}; `{}` keeps {clearance:.2} mm apart", place.told(), design.process.name);
    let at = walk::joint_of(design, place)
        .or_else(|| design.bodies.iter().find(|b| place.of.contains(&b.name)).map(|b| b.origin));
    vec![
        RULE.finds(message, at.unwrap_or(design.origin))
            .help("add `collision(gap = …)`, aim a flexure elsewhere with `into`, or give a link another layer"),
    ]
}
