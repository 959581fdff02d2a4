//! ## What it finds
//!
//! Terms of the objective with a `scale` beside terms of the same sum that could have one and have none.
//!
//! ## Why it matters
//!
//! With a `scale` a term is 1 where it is off by one scale. Without, it is in SI units with the weights of the paper: an error
//! of 1 mm then counts 0.1, and a stress of 1 MPa a million. Their sum weighs nothing that anybody chose.
//!
//! ## Example
//!
//! ```text
//! minimize {
//!     track(tip, scale = 0.1 mm)
//!     stress(below = 25 MPa)              // scale = 0.2 MPa is missing
//! }
//! ```
//!
//! ## Fix
//!
//! Give every term a `scale`, or none. There is no repair by itself.
use crate::lint::prelude::*;
use crate::ir::ObjectiveKind as K;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1034", name: "mixed-scales", severity: Severity::Warning, check: Check::Design(check) };

/// Whether a term that may have a scale has one.
fn scaled(kind: &K) -> Option<bool> {
    Some(match kind {
        K::Track { scale_mm, .. } | K::TrackAs { scale_mm, .. } => scale_mm.is_some(),
        K::Sway { scale_mm, .. } | K::SwayAlong { scale_mm, .. } => scale_mm.is_some(),
        K::StressBelow { scale_mpa, .. } | K::Stress { scale_mpa } | K::PaperStress { scale_mpa } => scale_mpa.is_some(),
        K::Aim { scale_rad, .. } => scale_rad.is_some(),
        _ => return None,
    })
}

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let with = of.design.all_objectives().find(|o| scaled(&o.kind) == Some(true));
    let without = of.design.all_objectives().find(|o| scaled(&o.kind) == Some(false) && o.weight != 0.0);
    let (Some(with), Some(without)) = (with, without) else { return Vec::new() };
    vec![
        RULE.finds("this term has no `scale`, and another one has", without.origin)
            .label("in SI units")
            .also(with.origin, "in scales")
            .help("give every term a `scale`, so that 1 means \"off by one\" in all of them"),
    ]
}
