//! ## What it finds
//!
//! Two values (`param`, `let`, `point`), or two things (bodies, joints, traces, …), whose names differ only by case.
//!
//! ## Why it matters
//!
//! Both exist, so a slip of the shift key is no error: the joint sits at the wrong point, and the part is printed so. A
//! point `F` and a link `f` are no such pair, because one cannot stand where the other does.
//!
//! ## Example
//!
//! ```text
//! let R = 20 mm
//! let r = 8 mm
//! ```
//!
//! ## Fix
//!
//! Give one of them a name that tells it apart. There is no repair by itself.
use crate::lint::prelude::*;
use std::collections::BTreeMap;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1009", name: "similar-names", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for block in &text.blocks {
        let mut seen: BTreeMap<(bool, String), &Ident> = BTreeMap::new();
        for (name, value) in block.statements.iter().filter_map(|s| walk::declared(&s.kind)) {
            let key = (value, name.node.to_ascii_lowercase());
            match seen.get(&key) {
                Some(first) if first.node != name.node => found.push(
                    RULE.finds(format!("`{}` and `{}` differ only by case", first.node, name.node), name.at)
                        .also(first.at, "the other one")
                        .help("give one of them a name that tells it apart"),
                ),
                Some(_) => {}
                None => drop(seen.insert(key, name)),
            }
        }
    }
    found
}
