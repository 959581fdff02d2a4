//! ## What it finds
//!
//! A `free` value whose bounds are equal.
//!
//! ## Why it matters
//!
//! It cannot vary, but counts as a variable: it stands in the lock and is shown as something that was decided.
//!
//! ## Example
//!
//! ```text
//! gap = free 0.5 mm in 0.5 mm .. 0.5 mm
//! ```
//!
//! ## Fix
//!
//! Write the number alone: `--fix` does that. It is safe, since there was no other value.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1013", name: "equal-bounds", severity: Severity::Warning, check: Check::Design(check) };

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let stuck = of.design.free.iter().filter(|f| f.upper <= f.lower && of.text.owns(f.origin));
    stuck
        .map(|free| {
            let d = RULE
                .finds("this free value cannot vary: its bounds are equal", free.origin)
                .help("write the number alone, or give it room");
            match walk::free_at(of.text.statements(free.origin), free.origin) {
                Some([start, ..]) => {
                    let text = of.text.at(start.at).to_string();
                    d.fix(Fix::safe(format!("write `{text}`"), vec![Edit::replace(free.origin, text)]))
                }
                None => d,
            }
        })
        .collect()
}
