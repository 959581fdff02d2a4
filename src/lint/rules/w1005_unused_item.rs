//! ## What it finds
//!
//! A flexure, material, process or motor that is declared and used nowhere: a private one (its name begins with `_`) in
//! any file, any other one in the file that is built.
//!
//! ## Why it matters
//!
//! Its numbers look as if the part were made by them. Mostly another one of nearly the same name is used.
//!
//! ## Example
//!
//! ```text
//! material my_print { E = 2100 MPa  nu = 0.38 }
//! mechanism lambda { material rigur … }
//! ```
//!
//! ## Fix
//!
//! Use it, or remove it: `--fix` does that. It is safe, since nothing depends on it.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1005", name: "unused-item", severity: Severity::Warning, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for (f, file) in text.files.iter().enumerate() {
        let builds = f == 0 && file.ast.items.iter().any(|i| matches!(i, ast::Item::Mechanism(_)));
        for item in &file.ast.items {
            let (kind, name, at) = match item {
                ast::Item::Mechanism(_) => continue,
                ast::Item::Flexure(flexure) => ("flexure", &flexure.name, flexure.at),
                ast::Item::Record(record) => (record.kind.node.as_str(), &record.name, record.at),
            };
            let hidden = builds || name.node.starts_with('_');
            if hidden && !text.items.contains(name.node.as_str()) {
                found.push(
                    RULE.finds(format!("nothing uses the {kind} `{}`", name.node), name.at)
                        .help("use it, or remove it")
                        .fix(text.remove(at)),
                );
            }
        }
    }
    found
}
