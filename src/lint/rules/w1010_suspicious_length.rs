//! ## What it finds
//!
//! A body with two points more than 2 m apart, or nearer to each other than 0.2 mm without being the same.
//!
//! ## Why it matters
//!
//! Nothing in this language's reach is so large or so small: a unit was mistaken (`200 m` for `200 mm`), or two points that
//! should be one were worked out in two ways. Small distances make bars shorter than their own thickness.
//!
//! ## Example
//!
//! ```text
//! point B = (200 m, 0 mm)
//! ```
//!
//! ## Fix
//!
//! Correct the unit, or use one point for both. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1010", name: "suspicious-length", severity: Severity::Warning, check: Check::Design(check) };

/// Links beyond this are a mistaken unit, mm.
const MOST_MM: f64 = 2000.0;
/// Points nearer than this, but not the same, were meant to be one, mm.
const LEAST_MM: f64 = 0.2;
/// Points nearer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for body in of.design.bodies.iter().filter(|b| b.owner.is_none()) {
        let points: Vec<_> = body.skeleton.iter().map(|p| (&p.name, of.point(p.position))).collect();
        let mut worst: Option<(f64, &String, &String)> = None;
        for (i, (p, at)) in points.iter().enumerate() {
            for (q, other) in points.iter().skip(i + 1) {
                let distance = (at - other).norm();
                let odd = distance > MOST_MM || (SAME_MM..LEAST_MM).contains(&distance);
                if odd && worst.is_none_or(|w| distance > w.0) {
                    worst = Some((distance, p, q));
                }
            }
        }
        if let Some((distance, p, q)) = worst {
            let shown = if distance > MOST_MM { format!("{:.1} m", distance / 1e3) } else { format!("{distance:.3} mm") };
            let message = format!("`{p}` and `{q}` of `{}` are {shown} apart", body.name);
            found.push(RULE.finds(message, body.origin).help("is a unit mistaken? Lengths here are usually given in mm"));
        }
    }
    found
}
