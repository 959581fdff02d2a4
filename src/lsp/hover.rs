//! What to say about a name, unit, function or keyword.

use super::answers::Evaluated;
use super::names::{Symbol, What};
use super::space::Space;
use super::{text, vocabulary};
use crate::elaborate::units;
use crate::syntax::statement_form;
use std::ops::Range;

/// Markdown about what stands at a byte of a file, and its place.
pub fn hover(space: &Space, file: &str, byte: usize, known: &Evaluated) -> Option<(Range<usize>, String)> {
    if let Some((place, at)) = space.at(file, byte) {
        let symbol = space.symbol(&place)?;
        let source = &space.files.get(&place.0)?.text;
        let mut out = format!("```mech\n{}\n```\n", head(symbol, source));
        if !symbol.doc.is_empty() {
            out.push_str(&format!("\n{}\n", symbol.doc));
        }
        if let Some(value) = known.value(&place.0, &symbol.at) {
            out.push_str(&format!("\n{value}\n"));
        }
        if place.0 != file {
            out.push_str(&format!("\nfrom `{}`\n", place.0));
        }
        return Some((at, out));
    }
    let source = &space.files.get(file)?.text;
    let at = text::word(source, byte);
    let word = source.get(at.clone())?;
    if word.is_empty() {
        return None;
    }
    let number =
        source.get(..at.start)?.trim_end().ends_with(|c: char| c.is_ascii_digit() || "*/".contains(c));
    if let (true, Some(unit)) = (number, units::find(word)) {
        return Some((at, format!("`{word}`: {}", unit.dimension)));
    }
    if let Some(f) =
        vocabulary::named(word).filter(|_| source.get(at.end..).is_some_and(|t| t.starts_with('(')))
    {
        return Some((at, format!("```mech\n{}({})\n```\n{}", f.name, f.parameters.join(", "), f.gives)));
    }
    let form = statement_form(word)?;
    Some((at, format!("```mech\n{}\n```", form.replace("` or `", "\n"))))
}

/// The first line of a declaration, without what it opens.
fn head(symbol: &Symbol, source: &str) -> String {
    let whole = source.get(symbol.whole.clone()).unwrap_or("");
    let line = whole.lines().next().unwrap_or("");
    let head = match symbol.what {
        What::Mechanism
        | What::Flexure
        | What::Material
        | What::Process
        | What::Motor
        | What::Rod
        | What::Case => line.trim_end_matches(['{', ' ']),
        _ => line,
    };
    head.split_whitespace().collect::<Vec<_>>().join(" ")
}
