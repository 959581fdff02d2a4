//! ## What it finds
//!
//! Two links with the same points in the same layer.
//!
//! ## Why it matters
//!
//! They are two bodies that stand in the same place: they fuse when printed, and the mechanism that moves on the screen is
//! not the one on the table. Two bars of a fork lie in different layers.
//!
//! ## Example
//!
//! ```text
//! link left  { A, B }
//! link right { A, B }            // meant: layer 1
//! ```
//!
//! ## Fix
//!
//! Give one of them a layer of its own, or remove it. There is no repair by itself.
use crate::lint::prelude::*;
use std::collections::BTreeMap;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1017", name: "same-bodies", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for block in &text.blocks {
        let mut seen: BTreeMap<(Vec<&str>, &str), &Ident> = BTreeMap::new();
        for s in block.statements {
            let StatementKind::Body { ground: false, name, points, layer } = &s.kind else { continue };
            let mut names: Vec<&str> = points.iter().map(|p| p.node.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            if names.len() < 2 {
                continue;
            }
            let layer = layer.as_ref().map_or("0", |e| text.at(e.at));
            match seen.get(&(names.clone(), layer)) {
                Some(first) => found.push(
                    RULE.finds(format!("`{}` is drawn where `{}` is", name.node, first.node), name.at)
                        .also(first.at, "the same points in the same layer")
                        .help("give one of them a layer of its own, or remove it"),
                ),
                None => drop(seen.insert((names, layer), name)),
            }
        }
    }
    found
}
