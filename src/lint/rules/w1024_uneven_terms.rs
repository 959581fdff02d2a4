//! ## What it finds
//!
//! Terms of the objective whose contributions at the start lie more than a million apart. A term that is zero there, such as
//! a bound that is kept, does not count.
//!
//! ## Why it matters
//!
//! The objective is a sum. A term that is a millionth of another decides nothing: the part comes out as if it were not written.
//!
//! ## Example
//!
//! ```text
//! minimize {
//!     track(tip, scale = 1 um)           // 1e7 at the start
//!     torque(motor)                      // 1e-3 at the start
//! }
//! ```
//!
//! ## Fix
//!
//! Give each term a `scale` of what you would call "off by one", so that both are of order one. There is no repair by itself.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1024", name: "uneven-terms", severity: Severity::Warning, check: Check::Solution(check) };

/// Terms further apart than this do not see each other.
const MOST_RATIO: f64 = 1e6;

fn check(of: &OfSolution) -> Vec<Diagnostic> {
    // What keeps rods rods follows the terms of the text.
    let terms = of.of.design.objectives.iter().zip(of.terms).filter(|(_, (_, value))| *value > 0.0);
    let by = |a: &(&crate::ir::Objective, &(String, f64)), b: &(&crate::ir::Objective, &(String, f64))| {
        a.1.1.total_cmp(&b.1.1)
    };
    let (Some(least), Some(most)) = (terms.clone().min_by(by), terms.max_by(by)) else { return Vec::new() };
    if most.1.1 <= MOST_RATIO * least.1.1 {
        return Vec::new();
    }
    let message =
        format!("at the start `{}` is {:.0e} times smaller than `{}`", least.1.0, most.1.1 / least.1.1, most.1.0);
    vec![
        RULE.finds(message, least.0.origin)
            .label("decides nothing")
            .also(most.0.origin, "decides everything")
            .help("give each a `scale` that you would call \"off by one\", or a `weight`"),
    ]
}
