//! ## What it finds
//!
//! Free values that the solution leaves on one of their bounds. Told as advice, once a design, with the first of them.
//!
//! ## Why it matters
//!
//! There the bound decided, not the objective: the part would be better beyond it. Where the bound is the printer's or the
//! room's, that is as it should be; where it was a guess, widen it.
//!
//! ## Example
//!
//! A thickness at 0.6 mm, the least the process prints, because thin is soft.
//!
//! ## Fix
//!
//! Widen the bounds that were guesses. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1309", name: "rests-on-bound", severity: Severity::Advice, check: Check::Solution(check) };

/// A value is on a bound when it is nearer than this part of the room between them.
const ON_BOUND: f64 = 1e-6;
/// Names that are told.
const NAMES: usize = 5;

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let design = view.of.design;
    if design.all_objectives().next().is_none() {
        return Vec::new();
    }
    let on_bound: Vec<_> = design
        .free
        .iter()
        .zip(view.solved)
        .filter(|(f, v)| {
            let room = ON_BOUND * (f.upper - f.lower);
            room > 0.0 && (**v - f.lower <= room || f.upper - **v <= room)
        })
        .map(|(f, _)| f)
        .collect();
    let Some(first) = on_bound.first() else { return Vec::new() };
    let mut names: Vec<String> = on_bound.iter().take(NAMES).map(|f| format!("`{}`", f.path)).collect();
    if on_bound.len() > NAMES {
        names.push(format!("{} more", on_bound.len() - NAMES));
    }
    let message = format!("{} of {} free values rest on a bound: {}", on_bound.len(), design.free.len(), names.join(", "));
    let own = on_bound.iter().find(|f| view.of.text.owns(f.origin)).unwrap_or(first);
    let at = if view.of.text.owns(own.origin) { own.origin } else { design.origin };
    vec![RULE.finds(message, at).help("there the bound decided, not the objective: widen it where it was a guess")]
}
