//! Values beside the text: what a computed `let`, `param` or `point` comes to, and what the optimiser chose.

use super::answers::Evaluated;
use super::names::What;
use super::space::Space;

/// Most values shown beside one `free` that several joints share.
const MOST: usize = 3;

/// Hints of a file: byte behind which each stands, and text.
pub fn hints(space: &Space, file: &str, known: &Evaluated) -> Vec<(usize, String)> {
    let Some(text) = space.files.get(file) else { return Vec::new() };
    let mut all = Vec::new();
    for symbol in &text.names.symbols {
        let computed = matches!(symbol.what, What::Let | What::Param | What::Point);
        let written = text.text.get(symbol.whole.clone()).and_then(|t| t.split_once('=')).map_or("", |t| t.1);
        // What is written down needs no hint.
        let sum = written.contains(['+', '*', '/', '^']);
        let plain = !sum && literal(written);
        let free = written.trim_start().starts_with("free ");
        if let Some(value) = known.value(file, &symbol.at)
            && computed
            && !free
            && !plain
            && written.trim() != value
        {
            all.push((symbol.whole.end, format!("= {value}")));
        }
    }
    for ((name, end), values) in &known.solved {
        if name == file {
            let more = if values.len() > MOST { ", …" } else { "" };
            let shown = values.iter().take(MOST).cloned().collect::<Vec<_>>().join(", ");
            all.push((*end, format!("→ {shown}{more}")));
        }
    }
    all.sort();
    all
}

/// Whether a value names nothing: numbers, units and signs only.
fn literal(written: &str) -> bool {
    written
        .split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.'))
        .filter(|w| w.starts_with(|c: char| c.is_alphabetic()))
        .all(|w| crate::elaborate::units::find(w).is_some())
}
