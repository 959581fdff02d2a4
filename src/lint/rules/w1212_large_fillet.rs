//! ## What it finds
//!
//! A flexure of whose length the two fillets take more than a fifth, or a fillet with a radius above three times the thickness.
//!
//! ## Why it matters
//!
//! A fillet begins so far before the link that the flexure bends as the computed one does. That holds to first order: of a
//! long fillet on a short flexure the thick ends follow the load in another way than a rod of that length, and the thin rest is
//! shorter and bends more sharply. Above three thicknesses nothing was computed.
//!
//! ## Example
//!
//! ```text
//! links fillet 3 mm
//! hinge heel: rocker to base at D as leaf { size = 4 mm, thickness = 0.8 mm }
//! ```
//!
//! ## Fix
//!
//! Take a smaller radius: at 0.6 times the thickness the stress at the root is a quarter above the flexure's own, and falls slowly from
//! there on. There is no repair by itself.
use crate::lint::prelude::*;
use crate::rod::extra_length_mm;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1212", name: "large-fillet", severity: Severity::Warning, check: Check::Flexures(check) };

/// Part of its length that a flexure may give to both fillets.
const PART: f64 = 0.2;
/// Largest radius by the thickness.
const RATIO: f64 = 3.0;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let part = |f: &crate::lint::Flexure| {
        2.0 * extra_length_mm(f.most_thick_mm, f.fillet_mm, f.most_thick_mm / f.wide_mm) / f.length_mm
    };
    let worst = |f: &crate::lint::Flexure| {
        (part(f) > PART || f.fillet_mm > RATIO * f.thick_mm).then(|| part(f))
    };
    walk::worst_of_joints(view, worst)
        .into_iter()
        .map(|(joint, f)| {
            let message = format!(
                "fillets of {:.2} mm are large for a flexure of `{}`, {:.1} mm long and {:.2} mm thick",
                f.fillet_mm, joint.name, f.length_mm, f.thick_mm
            );
            RULE.finds(message, joint.origin).help(format!(
                "its ends take {:.0} % of its length; a radius of {:.2} mm, 0.6 of its thickness, takes most of the stress away",
                100.0 * part(f),
                0.6 * f.thick_mm
            ))
        })
        .collect()
}
