//! ## What it finds
//!
//! A traced point that gives way by more than a tenth of the length of its path, or 5 mm, whichever is more, to a force of 0.1 N (10 g) across
//! the path, with the drives held.
//!
//! ## Why it matters
//!
//! It is where it should be only while nobody touches it. The weight of the part itself, cables and friction move it further
//! than the errors that were optimised.
//!
//! ## Example
//!
//! A leg on single leaves 0.6 mm thick, whose foot sags by 8 mm under its own battery.
//!
//! ## Fix
//!
//! Add `sway(TRACE, force = …)` to `minimize`, take `crossed_leaves` in place of `leaf`, or make the links higher. There is no
//! repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1305", name: "gives-way", severity: Severity::Warning, check: Check::Solution(check) };

/// Part of the path that a newton may move the point.
const MOST_PART: f64 = 0.1;
/// The force, N: about what such parts weigh themselves.
const FORCE_N: f64 = 0.1;
/// What is always borne, mm.
const LEAST_MM: f64 = 5.0;

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for (i, (trace, give)) in view.of.design.traces.iter().zip(&view.simulation.sway_mm).enumerate() {
        let limit = (MOST_PART * walk::path_mm(view.simulation, i)).max(LEAST_MM);
        let give = FORCE_N * give;
        if give > limit {
            let message = format!("{FORCE_N} N across its path moves `{}` by {give:.1} mm", trace.name);
            found.push(
                RULE.finds(message, trace.origin)
                    .help(format!("add `sway({}, force = 0.2 N, scale = 5 mm)`, or take flexures that are firm across", trace.name)),
            );
        }
    }
    found
}
