//! ## What it finds
//!
//! A flexure of a hinge whose section is thicker across the axis than wide along it.
//!
//! ## Why it matters
//!
//! It is stiff where it is to bend and soft where it is to hold: the hinge turns about the wrong axis. Mostly `thick` and
//! `wide` are mixed up, or the layer is too low for its leaves.
//!
//! ## Example
//!
//! ```text
//! section rect(thick = 6 mm, wide = 0.8 mm)       // meant the other way round
//! ```
//!
//! ## Fix
//!
//! Exchange the two, or make the links higher (`links height`). There is no repair by itself.
use crate::ir::JointKind;
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1208", name: "turned-section", severity: Severity::Warning, check: Check::Flexures(check) };

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let hinge = |f: &crate::lint::Flexure| {
        view.of.design.joints.get(f.joint).is_some_and(|j| j.kind == JointKind::Hinge)
    };
    walk::worst_of_joints(view, |f| {
        (hinge(f) && !f.round && f.most_thick_mm > f.wide_mm).then(|| f.most_thick_mm / f.wide_mm)
    })
    .into_iter()
    .map(|(joint, f)| {
        let message = format!(
            "a flexure of `{}` is {:.1} mm thick and only {:.1} mm wide along the axis",
            joint.name, f.most_thick_mm, f.wide_mm
        );
        RULE.finds(message, joint.origin)
            .help("are `thick` and `wide` mixed up? A leaf is wide along the axis about which it bends")
    })
    .collect()
}
