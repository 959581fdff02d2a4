//! ## What it finds
//!
//! A `free` value whose start lies on one of its own bounds.
//!
//! ## Why it matters
//!
//! The optimiser can leave it in one direction only, and the first step of a quadratic model sees half of the room. Often the
//! bound was meant to be wider.
//!
//! ## Example
//!
//! ```text
//! thickness = free 0.6 mm in 0.6 mm .. 1.4 mm
//! ```
//!
//! ## Fix
//!
//! Start inside: `--unsafe-fixes` writes a start a tenth of the room away from the bound. It is not safe, because another start may
//! lead to another solution.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1012", name: "start-at-bound", severity: Severity::Warning, check: Check::Design(check) };

/// The start is on a bound when it is nearer than this part of the room between them.
const ON_BOUND: f64 = 1e-9;
/// How far inside the repair starts, as a part of the room.
const INSIDE: f64 = 0.1;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let own = of.design.free.iter().filter(|f| f.upper > f.lower && of.text.owns(f.origin));
    let mut found = Vec::new();
    for free in own {
        let room = free.upper - free.lower;
        let low = free.start - free.lower <= ON_BOUND * room;
        if !low && free.upper - free.start > ON_BOUND * room {
            continue;
        }
        let (which, inside) = if low {
            ("lower", free.lower + INSIDE * room)
        } else {
            ("upper", free.upper - INSIDE * room)
        };
        let mut d = RULE
            .finds(format!("this free value starts on its {which} bound"), free.origin)
            .help("start inside, or widen the bound if it was meant to be wider");
        if let (Some([start, ..]), Some(text)) =
            (walk::free_at(of.text.statements(free.origin), free.origin), walk::quantity(inside, &free.unit))
        {
            d = d.fix(Fix::risky(format!("start at {text}"), vec![Edit::replace(start.at, text)]));
        }
        found.push(d);
    }
    found
}
