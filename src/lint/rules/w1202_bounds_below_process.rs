//! ## What it finds
//!
//! A `free` thickness whose bounds reach below the least wall of the process, though it starts above.
//!
//! ## Why it matters
//!
//! Thin flexures are soft, and softness is what most objectives ask for: the optimiser goes to the bound, and the part
//! cannot be printed.
//!
//! ## Example
//!
//! ```text
//! print on fdm                                            // least wall 0.8 mm
//! thickness = free 1 mm in 0.4 mm .. 2 mm
//! ```
//!
//! ## Fix
//!
//! `--unsafe-fixes` writes the least wall as the lower bound. It is not safe: another solution may come out.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1202", name: "bounds-below-process", severity: Severity::Warning, check: Check::Flexures(check) };

/// Walls may miss the least one by this, mm.
const TOLERANCE_MM: f64 = 1e-6;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let design = view.of.design;
    let least = design.process.least_wall_mm;
    let below = |f: &crate::lint::Flexure| {
        let thin = f.least_thick_mm < least - TOLERANCE_MM && f.thick_mm >= least - TOLERANCE_MM;
        thin.then(|| -f.least_thick_mm)
    };
    let mut found = Vec::new();
    for (joint, f) in walk::worst_of_joints(view, below) {
        let rods = design.rods.iter().filter(|r| design.joints.get(r.joint).is_some_and(|j| j.name == joint.name));
        let halves: Vec<_> = rods.map(|r| r.section.half_widths()[0]).collect();
        let moved = design.exprs.free_variables(&halves);
        let own = moved.iter().filter_map(|i| design.free.get(*i)).find(|v| view.of.text.owns(v.origin));
        let message = format!(
            "the bounds let `{}` become {:.2} mm thin; `{}` prints {least:.2} mm at least",
            joint.name, f.least_thick_mm, design.process.name
        );
        let mut d = RULE
            .finds(message, own.map_or(joint.origin, |v| v.origin))
            .help("raise the lower bound: the optimiser goes there, because thin is soft");
        // The variable is the thickness itself where its bound is.
        if let Some(v) = own.filter(|v| v.unit == "mm" && (v.lower - f.least_thick_mm).abs() < TOLERANCE_MM)
            && let Some([_, lower, _]) = walk::free_at(view.of.text.statements(v.origin), v.origin)
            && let Some(text) = walk::quantity(least, "mm")
        {
            d = d.fix(Fix::risky(format!("bound it at {text}"), vec![Edit::replace(lower.at, text)]));
        }
        found.push(d);
    }
    found
}
