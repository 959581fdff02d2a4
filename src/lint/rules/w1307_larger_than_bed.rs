//! ## What it finds
//!
//! A printed part whose bounding box does not fit into the build volume that the process states (`bed_width`, `bed_depth`, `bed_height`), in
//! whatever of the six ways its sides are laid along those of the bed.
//!
//! ## Why it matters
//!
//! It cannot be printed in one piece, and a compliant part cannot be glued from two.
//!
//! ## Example
//!
//! A leg 310 mm long on a printer of 220 mm.
//!
//! ## Fix
//!
//! Make it smaller (`--set`, `scale`), or state the volume of your own printer in a `process` of your own. Laid diagonally it may fit.
//! There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1307", name: "larger-than-bed", severity: Severity::Warning, check: Check::Parts(check) };

fn check(view: &OfParts) -> Vec<Diagnostic> {
    let Some(process) = view.assembly.designs.first().map(|d| &d.process) else { return Vec::new() };
    let Some(mut bed) = process.machine.bed_mm else { return Vec::new() };
    bed.sort_by(f64::total_cmp);
    let mut found = Vec::new();
    for part in view.parts {
        let corners = || part.triangles.iter().flatten();
        let mut sides = [0, 1, 2].map(|k| {
            let (low, high) =
                corners().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[k]), h.max(p[k])));
            high - low
        });
        sides.sort_by(f64::total_cmp);
        if sides.iter().zip(bed).any(|(s, b)| *s > b) {
            let show = |s: [f64; 3]| s.map(|x| format!("{x:.0}")).join(" x ");
            let message =
                format!("`{}` is {} mm; `{}` prints {} mm", part.name, show(sides), process.name, show(bed));
            let at = walk::export(view.assembly);
            found.push(RULE.finds(message, at).help("make it smaller, or state your own printer's volume in a `process`"));
        }
    }
    found
}
