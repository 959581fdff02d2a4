//! ## What it finds
//!
//! A drive that needs more than a fifth of the torque (of what slides, of the force) at which its motor stalls.
//!
//! ## Why it matters
//!
//! Stall torque is what a motor holds for a moment and burns by. Makers of servos want a fifth of it in steady motion; a stepper loses
//! steps well below it when it turns fast.
//!
//! ## Example
//!
//! `sg90` stalls at 180 N·mm; a mechanism that needs 50 N·mm is told.
//!
//! ## Fix
//!
//! Take a stronger motor, softer flexures (`torque(DRIVE)` in `minimize`), or a smaller drum. There is no repair by itself.
use crate::ir::DriveUnit;
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1302", name: "torque-near-stall", severity: Severity::Warning, check: Check::Solution(check) };

/// Part of the stall torque that may be used.
const MOST: f64 = 0.2;

fn check(view: &OfSolution) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for (i, drive) in view.of.design.drives.iter().enumerate() {
        let (limit, unit) = match drive.unit {
            DriveUnit::Rad => (drive.motor.as_ref().map(|m| m.stall_n_mm), "N·mm"),
            DriveUnit::Mm => (drive.stall_force_n(), "N"),
        };
        let Some(limit) = limit else { continue };
        let loads = view.simulation.motion.states.iter().filter_map(|s| s.drive_loads.get(i));
        let most = loads.fold(0.0, |m, l| f64::max(m, l.abs()));
        if most > MOST * limit {
            let motor = drive.motor.as_ref().map_or("", |m| m.name.as_str());
            let message = format!("`{}` needs {most:.1} {unit}; `{motor}` stalls at {limit:.0} {unit}", drive.name);
            found.push(
                RULE.finds(message, drive.origin)
                    .help("stay below a fifth: a stronger motor, softer flexures, or `torque(…)` in `minimize`"),
            );
        }
    }
    found
}
