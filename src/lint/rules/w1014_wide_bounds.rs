//! ## What it finds
//!
//! A `free` value with bounds absurdly far apart: an angle with more than two turns of room, a length with more than 1 m, or
//! one whose upper bound is a thousand times its lower one.
//!
//! ## Why it matters
//!
//! The optimiser works in the room between the bounds. Where nearly all of it makes no part at all, its steps are far too
//! long, and it may settle where a rod is wound up.
//!
//! ## Example
//!
//! ```text
//! thickness = free 0.8 mm in 0.6 mm .. 2 m       // meant: 2 mm
//! ```
//!
//! ## Fix
//!
//! Give the room that the part can have. There is no repair by itself.
use crate::lint::prelude::*;
use std::f64::consts::TAU;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1014", name: "wide-bounds", severity: Severity::Warning, check: Check::Design(check) };

/// More room than this for an angle says nothing, rad.
const MOST_RAD: f64 = 2.0 * TAU;
/// More room than this for a length is a mistaken unit, mm.
const MOST_MM: f64 = 1000.0;
/// Bounds whose quotient is larger were not thought about.
const MOST_RATIO: f64 = 1000.0;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let wide = of.design.free.iter().filter(|f| {
        let room = f.upper - f.lower;
        let far = match f.unit.as_str() {
            "rad" => room > MOST_RAD,
            "mm" => room > MOST_MM,
            _ => false,
        };
        let ratio = f.unit != "rad" && f.lower > 0.0 && f.upper / f.lower > MOST_RATIO;
        (far || ratio) && of.text.owns(f.origin)
    });
    wide.map(|f| {
        RULE.finds("the bounds of this free value are absurdly far apart", f.origin)
            .help("is a unit mistaken? Give the room that a part can have")
    })
    .collect()
}
