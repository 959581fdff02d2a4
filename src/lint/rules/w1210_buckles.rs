//! ## What it finds
//!
//! A compliant joint whose flexures together would buckle under half of the largest `load` of the design or less, by Euler's
//! formula for clamped ends: 4π²EI / L² each.
//!
//! ## Why it matters
//!
//! If that force goes through the joint, its leaves fold: the part collapses without breaking, and the solver finds no
//! equilibrium (E0602, W0603). It is an estimate: which part of the force goes through which joint, only the solution tells.
//!
//! ## Example
//!
//! A leaf 0.6 mm thick, 5 mm wide and 40 mm long of `rigur` folds under 4 N.
//!
//! ## Fix
//!
//! Make the flexures thicker, wider or shorter, or let the load pull. There is no repair by itself.
use crate::ir::{LoadKind, Section};
use crate::lint::prelude::*;
use std::f64::consts::PI;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1210", name: "buckles", severity: Severity::Warning, check: Check::Flexures(check) };

/// Part of the buckling load that may be used.
const MOST: f64 = 0.5;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let design = view.of.design;
    let steps = design.cycle.steps.max(1);
    let forces = design.all_loads().filter(|l| matches!(l.kind, LoadKind::Force { .. })).map(|l| {
        let sizes = (0..=steps).map(|s| l.size(s as f64 / steps as f64).abs());
        (sizes.fold(0.0, f64::max), l)
    });
    let Some((force, load)) = forces.max_by(|a, b| a.0.total_cmp(&b.0)) else { return Vec::new() };
    let mut found = Vec::new();
    for (id, joint) in design.joints.iter().enumerate().filter(|(_, j)| j.is_compliant()) {
        let rods = design.rods.iter().zip(view.flexures).filter(|(_, f)| f.joint == id);
        let bears: f64 = rods
            .map(|(rod, f)| {
                let (a, b) = (f.thick_mm / 2.0, f.wide_mm / 2.0);
                let (a, b) = (a.min(b), a.max(b));
                let second_moment_mm4 = match rod.section {
                    Section::Rect { .. } => 4.0 / 3.0 * a.powi(3) * b,
                    Section::Ellipse { .. } | Section::Round { .. } => PI / 4.0 * a.powi(3) * b,
                };
                4.0 * PI * PI * design.material.e_mpa * second_moment_mm4 / f.length_mm.powi(2)
            })
            .sum();
        if force > MOST * bears {
            let message = format!("`{}` would fold under {bears:.1} N; the largest load is {force:.1} N", joint.name);
            found.push(
                RULE.finds(message, joint.origin)
                    .also(load.origin, "this load")
                    .help("make its flexures thicker, wider or shorter, or let the load pull instead of push"),
            );
        }
    }
    found
}
