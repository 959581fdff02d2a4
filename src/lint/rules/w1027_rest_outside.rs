//! ## What it finds
//!
//! A drive whose value in the rest pose lies outside of what it passes through in the cycle. (0, as drawn, where no `rest`
//! is written.)
//!
//! ## Why it matters
//!
//! The part is printed unstressed in the rest pose. If that is never visited, every flexure is bent all the time, further
//! than it need be, and creeps: plastics take a set under a strain that never ends.
//!
//! ## Example
//!
//! ```text
//! drive motor from 40 deg to 80 deg       // rest motor at 60 deg is missing
//! ```
//!
//! ## Fix
//!
//! Rest in the middle of the motion. `--unsafe-fixes` writes that (see also W1107, which looks for the best place). It is not
//! safe: another rest pose is another part.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1027", name: "rest-outside", severity: Severity::Warning, check: Check::Design(check) };

/// As far outside as this is no matter, as a part of the way.
const TOLERANCE: f64 = 1e-6;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let steps = of.design.cycle.steps.max(1);
    let mut found = Vec::new();
    if of.design.rods.is_empty() {
        return found;
    }
    for drive in of.design.drives.iter().filter(|d| d.free_rest.is_none() && d.joint().is_some()) {
        let values = (0..=steps).map(|s| drive.value(s as f64 / steps as f64));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let way = high - low;
        let turns = drive.unit == crate::ir::DriveUnit::Rad && way >= std::f64::consts::TAU * (1.0 - TOLERANCE);
        let outside = drive.rest < low - TOLERANCE * way || drive.rest > high + TOLERANCE * way;
        if !outside || turns || way <= 0.0 {
            continue;
        }
        let show = |v: f64| drive.unit.show(v);
        let message = format!(
            "`{}` rests at {}, outside of its motion from {} to {}",
            drive.name,
            show(drive.rest),
            show(low),
            show(high)
        );
        let d = RULE.finds(message, drive.origin).help("rest in the middle of the motion: nothing is bent all the time then");
        found.push(match walk::rest_fix(of, &drive.name, 0.5 * (low + high), drive.unit) {
            Some(fix) => d.fix(fix),
            None => d,
        });
    }
    found
}
