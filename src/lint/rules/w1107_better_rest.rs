//! ## What it finds
//!
//! A state of the cycle that would be a better rest pose: printed there, the joint that turns furthest would turn at least a fifth
//! and at least 5° less. The finding says which value of the drive that is.
//!
//! ## Why it matters
//!
//! A flexure that is bent to both sides bends half as far as one that is bent to one side only. The rest pose matters more
//! than any parameter of a flexure, and costs nothing.
//!
//! ## Example
//!
//! ```text
//! drive motor from 0 deg to 60 deg        // rest motor at 30 deg is missing: 60° become 30°
//! ```
//!
//! ## Fix
//!
//! `--unsafe-fixes` writes the value. It is not safe: the part is another one, and an old lock only a start for it. Where a
//! `free` rest pose is written, the optimiser chooses, and nothing is told; nor of a string, which cannot push back from the middle.
use crate::kinematics::motion::State;
use crate::lint::prelude::*;
use crate::lint::shapes::turn;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1107", name: "better-rest", severity: Severity::Warning, check: Check::Motion(check) };

/// A better rest pose saves this part of the largest turn …
const SAVES: f64 = 0.2;
/// … and at least this, rad (5°).
const SAVES_RAD: f64 = 5.0 / 180.0 * std::f64::consts::PI;
/// States compared at most: every pair of them is.
const STATES: usize = 96;

fn check(view: &OfMotion) -> Vec<Diagnostic> {
    let design = view.of.design;
    // With several drives the best state of the cycle is one value of each; that the optimiser cannot be asked twice is
    // why a free rest pose is left alone.
    let Some(first) = design.drives.first() else { return Vec::new() };
    if design.drives.iter().any(|d| d.free_rest.is_some() || d.joint().is_none()) {
        return Vec::new();
    }
    let compliant: Vec<(usize, [usize; 2])> = design
        .joints
        .iter()
        .enumerate()
        .filter(|(_, j)| j.is_compliant())
        .flat_map(|(id, j)| j.pairs().map(move |pair| (id, pair)))
        .collect();
    if compliant.is_empty() {
        return Vec::new();
    }
    let step = view.motion.states.len().div_ceil(STATES).max(1);
    let states: Vec<&State> = view.motion.states.iter().step_by(step).collect();
    let furthest = |from: &State| {
        let mut most = (0.0, 0);
        for (id, pair) in &compliant {
            for s in &states {
                let angle = turn(s, from, *pair);
                if angle > most.0 {
                    most = (angle, *id);
                }
            }
        }
        most
    };
    let (now, joint) = furthest(&view.motion.rest);
    let best = states.iter().map(|s| (furthest(s).0, *s)).min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((then, state)) = best.filter(|b| now - b.0 > (SAVES * now).max(SAVES_RAD)) else { return Vec::new() };
    let name = design.joints.get(joint).map_or("", |j| j.name.as_str());
    let message = format!(
        "`{name}` bends by {:.0} deg from this rest pose; by {:.0} deg at most from the one where {}",
        now.to_degrees(),
        then.to_degrees(),
        walk::drives_at(view, state)
    );
    let rest = view.of.statements().iter().find(|s| matches!(&s.kind, StatementKind::Rest { .. }));
    let mut fixes = Vec::new();
    for (drive, value) in design.drives.iter().zip(&state.drives) {
        // A crank that has gone round once is where it was.
        let value = match drive.unit {
            crate::ir::DriveUnit::Rad if value.abs() >= std::f64::consts::TAU => value % std::f64::consts::TAU,
            _ => *value,
        };
        fixes.extend(walk::rest_fix(view.of, &drive.name, value, drive.unit));
    }
    let d = RULE
        .finds(message, rest.map_or(first.origin, |s| s.at))
        .help("print it there: a flexure that bends to both sides bends half as far");
    if fixes.len() < design.drives.len() {
        return vec![d];
    }
    let title = fixes.iter().map(|f| f.title.as_str()).collect::<Vec<_>>().join(", ");
    let edits = fixes.into_iter().flat_map(|f| f.edits).collect();
    vec![d.fix(Fix::risky(title, edits))]
}
