//! ## What it finds
//!
//! A printed part of which more than 2 % of the surface faces down more steeply than the process prints without support
//! (`overhang`, from the upright), as it lies: the stacking axis upwards. What lies on the bed does not count.
//!
//! ## Why it matters
//!
//! Support grows between the leaves, where no tool reaches it: taking it out breaks them, leaving it in stops them. A process
//! that needs no support (`polyjet` washes it out, `mjf` and `sls` lie in powder) states no `overhang`.
//!
//! ## Example
//!
//! A crank's eye that hangs over the base in a layer above it, on `fdm`.
//!
//! ## Fix
//!
//! Print it lying on another side, take another process, or put what hangs into the lowest layer. There is no repair by itself.
use crate::lint::prelude::*;
use nalgebra::Vector3;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1308", name: "overhang", severity: Severity::Warning, check: Check::Parts(check) };

/// Part of the surface that may hang.
const MOST_PART: f64 = 0.02;
/// What is lower than this above the lowest point lies on the bed, mm: bars that meet differ by a little in height.
const ON_BED_MM: f64 = 0.6;

fn check(view: &OfParts) -> Vec<Diagnostic> {
    let Some(design) = view.assembly.designs.first() else { return Vec::new() };
    let Some(allowed) = design.process.machine.overhang_rad else { return Vec::new() };
    let up = Vector3::from(design.layers.axis);
    let mut found = Vec::new();
    for part in view.parts {
        let heights = || part.triangles.iter().flatten().map(|p| p.dot(&up));
        let bed = heights().fold(f64::INFINITY, f64::min);
        let (mut hanging, mut whole) = (0.0, 0.0);
        for [a, b, c] in &part.triangles {
            let area = 0.5 * (b - a).cross(&(c - a));
            let size = area.norm();
            whole += size;
            let lies = [a, b, c].iter().all(|p| p.dot(&up) < bed + ON_BED_MM);
            // A face leans by the angle of its normal below the level.
            let leans = (-area.dot(&up) / size.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0).asin();
            if !lies && leans > allowed {
                hanging += size;
            }
        }
        if hanging > MOST_PART * whole {
            let message = format!(
                "{:.0} % of the surface of `{}` hangs over by more than {:.0} deg",
                100.0 * hanging / whole,
                part.name,
                allowed.to_degrees()
            );
            found.push(
                RULE.finds(message, walk::export(view.assembly))
                    .help("print it on another side or by a process without support: support between leaves breaks them"),
            );
        }
    }
    found
}
