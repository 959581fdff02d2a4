//! ## What it finds
//!
//! A flexure of a hinge that is attached further from its joint than the next joint of that body is, by a
//! fifth.
//!
//! ## Why it matters
//!
//! It runs past the next joint, through what moves there. Mostly `size` is a number that was right before a link was made shorter.
//!
//! ## Example
//!
//! ```text
//! hinge knee: coupler to rocker at B as crossed_leaves { size = 60 mm }     // the rocker is 50 mm long
//! ```
//!
//! ## Fix
//!
//! Take a smaller `size`, or leave it out: templates take a third of the shorter link. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1211", name: "reaches-past-joint", severity: Severity::Warning, check: Check::Flexures(check) };

/// Ends this much further out than the next joint pass it; one a little further lies beside it.
const PAST: f64 = 1.2;

fn check(view: &OfFlexures) -> Vec<Diagnostic> {
    let design = view.of.design;
    let points = &view.motion.joint_points;
    let mut found = Vec::new();
    for (id, joint) in design.joints.iter().enumerate() {
        let mut worst: Option<(f64, f64, &str)> = None;
        for (rod, f) in design.rods.iter().zip(view.flexures).filter(|(_, f)| f.joint == id) {
            for (end, reach) in [&rod.from, &rod.to].into_iter().zip(f.reach_mm) {
                let aimed = joint.toward.iter().any(|(b, _)| *b == end.body);
                let others = design.joints.iter().zip(points).enumerate();
                let next = others
                    .filter(|(j, (other, _))| *j != id && other.bodies.contains(&end.body))
                    .filter_map(|(_, (_, p))| Some((p - points.get(id)?).norm()))
                    .filter(|d| *d > 1.0)
                    .fold(f64::INFINITY, f64::min);
                // One that is aimed elsewhere passes beside the next joint.
                if !aimed && reach > PAST * next && worst.is_none_or(|w| reach - next > w.0 - w.1) {
                    let name = design.bodies.get(end.body).map_or("", |b| b.name.as_str());
                    worst = Some((reach, next, name));
                }
            }
        }
        if let Some((reach, next, body)) = worst {
            let message = format!(
                "a flexure of `{}` is attached {reach:.1} mm out on `{body}`, whose next joint is at {next:.1} mm",
                joint.name
            );
            found.push(RULE.finds(message, joint.origin).help("take a smaller `size`, or leave it out"));
        }
    }
    found
}
