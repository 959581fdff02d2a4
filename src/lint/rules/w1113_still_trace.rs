//! ## What it finds
//!
//! A traced point that does not move over the cycle.
//!
//! ## Why it matters
//!
//! Tracking it is always perfect, whatever the part does. Mostly the wrong body was named, or a point on the axis.
//!
//! ## Example
//!
//! ```text
//! trace tip = D on rocker         // D is where the rocker turns; meant: B
//! ```
//!
//! ## Fix
//!
//! Name the body that carries the point. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1113", name: "still-trace", severity: Severity::Warning, check: Check::Motion(check) };

/// A path shorter than this is none, mm.
const NO_PATH_MM: f64 = 1e-6;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    if !design.is_driven() {
        return Vec::new();
    }
    let still = design.traces.iter().enumerate().filter(|(i, _)| {
        let path = view.motion.trace_path(*i);
        path.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>() < NO_PATH_MM
    });
    still
        .map(|(_, t)| {
            RULE.finds(format!("`{}` does not move over the cycle", t.name), t.origin)
                .help("is it on the right body? A point on the axis stands still")
        })
        .collect()
}
