//! ## What it finds
//!
//! A fillet with a radius below half of what the process prints: of a line's width, or where that is not stated of the least wall.
//!
//! ## Why it matters
//!
//! A printer rounds every inner corner by half of its line. A smaller radius is not in the part, and the stress concentration that
//! the print sheet tells for it is not that of the part.
//!
//! ## Example
//!
//! ```text
//! print on fdm                                            // lines of 0.42 mm
//! links fillet 0.1 mm
//! ```
//!
//! ## Fix
//!
//! Take a larger radius, or leave `fillet` out. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1213", name: "small-fillet", severity: Severity::Warning, check: Check::Flexures(check) };

/// Radii may miss the least one by this, mm.
const TOLERANCE_MM: f64 = 1e-6;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let process = &view.of.design.process;
    let line = process.machine.line_mm;
    let least = line.unwrap_or(process.least_wall_mm) / 2.0;
    walk::worst_of_joints(view, |f| {
        (f.fillet_mm > 0.0 && f.fillet_mm < least - TOLERANCE_MM).then_some(-f.fillet_mm)
    })
    .into_iter()
    .map(|(joint, f)| {
        let message = format!(
            "fillets of {:.2} mm at `{}` are finer than `{}` prints",
            f.fillet_mm, joint.name, process.name
        );
        let why = match line {
            Some(_) => format!("its lines round inner corners by {least:.2} mm anyway"),
            None => format!("what has walls of {:.2} mm at least does not hold such corners", process.least_wall_mm),
        };
        RULE.finds(message, joint.origin).help(format!("{why}: take {least:.2} mm or more, or leave `fillet` out"))
    })
    .collect()
}
