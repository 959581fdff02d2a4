//! ## What it finds
//!
//! A file of the design that does not say by which edition of the language it is written. Told as advice.
//!
//! ## Why it matters
//!
//! Words may come to mean something else in a later edition. A file that says `edition 1` keeps its meaning.
//!
//! ## Example
//!
//! ```text
//! use std.materials.rigur                 // edition 1 is missing above
//! ```
//!
//! ## Fix
//!
//! `--fix` writes `edition 1` above everything else. It is safe: that is how the file is read anyway.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1033", name: "no-edition", severity: Severity::Advice, check: Check::Text(check) };

fn check(text: &Text) -> Vec<Diagnostic> {
    let silent = text.files.iter().filter(|f| f.ast.edition.is_none() && !f.ast.items.is_empty());
    silent
        .map(|file| {
            // Below the description of the file.
            let source = text.of(file.id);
            let mark = if source.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
            let body = source.get(mark..).unwrap_or("");
            let head: usize = body.split_inclusive('\n').take_while(|l| l.starts_with("//!")).map(str::len).sum();
            let at = Origin { file: file.id, start: (mark + head) as u32, end: (mark + head) as u32 };
            let line = source.get(mark + head..).and_then(|s| s.split('\n').next()).map_or(0, str::len) as u32;
            RULE.finds("this file does not say its edition", Origin { end: at.start + line, ..at })
                .help("write `edition 1` at its head")
                .fix(Fix::safe("write it", vec![Edit::replace(at, "edition 1\n")]))
        })
        .collect()
}
