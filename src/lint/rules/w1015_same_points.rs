//! ## What it finds
//!
//! Two points of different names, both in bodies, at the same place.
//!
//! ## Why it matters
//!
//! Changing one of them later tears the mechanism apart without an error, since each is a valid point by itself. And what
//! is drawn twice was often meant to be somewhere else.
//!
//! ## Example
//!
//! ```text
//! point B = (40 mm, 50 mm)
//! point C = (40 mm, 50 mm)
//! ```
//!
//! ## Fix
//!
//! Use one of them for both, or move the other. There is no repair by itself.
use crate::lint::prelude::*;
use std::collections::BTreeMap;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1015", name: "same-points", severity: Severity::Warning, check: Check::Design(check) };

/// Points nearer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

fn check(of: &OfDesign) -> Vec<Diagnostic> {
    let declared: BTreeMap<&str, &Ident> = of
        .statements()
        .iter()
        .filter_map(|s| match &s.kind {
            StatementKind::Point { name, .. } => Some((name.node.as_str(), name)),
            _ => None,
        })
        .collect();
    let mut seen: BTreeMap<[i64; 3], &Ident> = BTreeMap::new();
    let mut told: Vec<&str> = Vec::new();
    let mut found = Vec::new();
    for point in of.design.bodies.iter().flat_map(|b| &b.skeleton) {
        let Some(name) = declared.get(point.name.as_str()) else { continue };
        let at: [f64; 3] = of.point(point.position).into();
        let first = *seen.entry(at.map(|x| (x / SAME_MM).round() as i64)).or_insert(name);
        if first.node != name.node && !told.contains(&name.node.as_str()) {
            told.push(&name.node);
            found.push(
                RULE.finds(format!("`{}` lies where `{}` lies", name.node, first.node), name.at)
                    .also(first.at, "the same place")
                    .help("use one of them for both, or move this one"),
            );
        }
    }
    found
}
