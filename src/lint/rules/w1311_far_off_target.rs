//! ## What it finds
//!
//! A traced point that is off its target by more than a twentieth of the length of its path, on the mean over the cycle.
//!
//! ## Why it matters
//!
//! It goes another way than was drawn. Either the objective does not ask for it, or flexures of this size cannot do it: their axes
//! wander when they bend.
//!
//! ## Example
//!
//! A path 200 mm long that is missed by 15 mm.
//!
//! ## Fix
//!
//! Add `track(TRACE)`, give the flexures more free values, or turn less. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1311", name: "far-off-target", severity: Severity::Warning, check: Check::Solution(check) };

/// Part of the path by which it may be missed.
const MOST_PART: f64 = 0.05;

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let design = view.of.design;
    let mut found = Vec::new();
    for (i, trace) in design.traces.iter().enumerate() {
        // By form only, where the same time means nothing.
        let by_form = design.objectives.iter().any(
            |o| matches!(o.kind, crate::ir::ObjectiveKind::TrackAs { trace, closest: true, .. } if trace == i),
        );
        let simulation = view.simulation;
        let errors = if by_form { simulation.aims.closest_mm.get(i) } else { simulation.errors_mm.get(i) };
        let Some(errors) = errors.filter(|e| !e.is_empty()) else { continue };
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let path = walk::path_mm(simulation, i);
        if path > 0.0 && mean > MOST_PART * path {
            let message = format!("`{}` misses its target by {mean:.1} mm on the mean; its path is {path:.0} mm long", trace.name);
            found.push(
                RULE.finds(message, trace.origin)
                    .help("add `track(…)`, give the flexures more free values, or turn less"),
            );
        }
    }
    found
}
