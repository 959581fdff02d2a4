//! ## What it finds
//!
//! A compliant hinge whose axis does not stand on the printed layers (within 30°), in a process whose parts are weak across them:
//! one that states `across` below 80 %.
//!
//! ## Why it matters
//!
//! A leaf that lies across the layers is bent by pulling them apart, where a filament print has half its strength. A leaf within
//! the layers bends along the filaments. What stands on the bed is taken to be the stacking axis, z in space.
//!
//! ## Example
//!
//! ```text
//! print on fdm
//! hinge shoulder: body to humerus at H axis x as crossed_leaves     // the layers are normal to z
//! ```
//!
//! ## Fix
//!
//! Draw the mechanism so that its hinges stand on the bed, or print it by a process of equal strength (`mjf`, `sls`, `polyjet`).
//! There is no repair by itself.
use crate::ir::JointKind;
use crate::lint::prelude::*;
use nalgebra::Vector3;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1209", name: "bends-across-layers", severity: Severity::Warning, check: Check::Flexures(check) };

/// Processes stronger than this across the layers may print leaves in any direction.
const ENOUGH: f64 = 0.8;
/// Cosine of the largest angle between axis and stacking direction (30°).
const UPRIGHT: f64 = 0.866;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let design = view.of.design;
    let Some(across) = design.process.machine.across.filter(|a| *a < ENOUGH) else { return Vec::new() };
    let up = Vector3::from(design.layers.axis);
    let leaning = design.joints.iter().filter(|j| {
        j.is_compliant() && j.kind == JointKind::Hinge && Vector3::from(j.axis).dot(&up).abs() < UPRIGHT
    });
    leaning
        .map(|j| {
            let message = format!(
                "`{}` bends across the layers, where `{}` has {:.0} % of its strength",
                j.name,
                design.process.name,
                100.0 * across
            );
            RULE.finds(message, j.origin)
                .help("let its axis stand on the bed, or print it by a process of equal strength")
        })
        .collect()
}
