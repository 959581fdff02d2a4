//! ## What it finds
//!
//! A servo that uses more than nine tenths of its range. (More than all of it is an error, E0410.)
//!
//! ## Why it matters
//!
//! Near its ends a servo's scale is worst, the horn is never mounted exactly in the middle (its teeth are 15° apart), and one that
//! runs into its stop draws its stall current until it burns.
//!
//! ## Example
//!
//! ```text
//! drive arm from -85 deg to 85 deg with sg90      // 170° of 180°
//! ```
//!
//! ## Fix
//!
//! Drive it over less, use a longer lever, or a servo of a wider range. There is no repair by itself.
use crate::ir::MotorInterface;
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1111", name: "servo-range", severity: Severity::Warning, check: Check::Design(check) };

/// Part of the range that may be used.
const MOST: f64 = 0.9;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let steps = of.design.cycle.steps.max(1);
    let mut found = Vec::new();
    for drive in of.design.drives.iter().filter(|d| !d.continuous) {
        let Some(motor) = &drive.motor else { continue };
        let (MotorInterface::Pwm { range_rad } | MotorInterface::Dynamixel { range_rad }) = motor.interface else {
            continue;
        };
        let angles = (0..=steps).filter_map(|s| drive.motor_angle_rad(s as f64 / steps as f64, drive.rest));
        let (low, high) = angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if high - low > MOST * range_rad {
            let message = format!(
                "`{}` turns by {:.0} deg of its {:.0} deg",
                motor.name,
                (high - low).to_degrees(),
                range_rad.to_degrees()
            );
            found.push(
                RULE.finds(message, drive.origin)
                    .help("leave a tenth: horns are mounted a few degrees off, and a servo at its stop burns"),
            );
        }
    }
    found
}
