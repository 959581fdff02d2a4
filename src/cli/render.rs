//! Shows diagnostics: chooses colour, width and stream for the renderers of `flexura::diagnostic`.

use super::Format;
use super::style::Style;
use flexura::diagnostic::json::{JsonDiagnostic, diagnostics};
use flexura::diagnostic::{Diagnostic, SourceMap, terminal};
use serde_json::json;

/// Columns where the standard error is no terminal.
const WIDTH: usize = 100;
/// Lines longer than this are hard to read on a wide terminal.
const MOST_WIDTH: usize = 120;

/// Shows diagnostics on the standard error, for people.
pub fn show(found: &[Diagnostic], sources: &SourceMap) {
    let width = terminal_size::terminal_size_of(std::io::stderr())
        .map_or(WIDTH, |(width, _)| usize::from(width.0).min(MOST_WIDTH));
    let style = terminal::Style { color: Style::stderr().is_coloured(), width };
    eprint!("{}", terminal::render(found, sources, style));
}

/// Shows diagnostics for people, or as `{"diagnostics": […]}` on the standard output.
pub fn report(found: &[Diagnostic], sources: &SourceMap, format: Format) {
    match format {
        Format::Human => show(found, sources),
        Format::Json => {
            super::commands::print(&format!("{}\n", json!({ "diagnostics": json(found, sources) })));
        }
    }
}

/// Diagnostics as JSON.
pub fn json<'a>(found: &'a [Diagnostic], sources: &'a SourceMap) -> Vec<JsonDiagnostic<'a>> {
    diagnostics(found, sources)
}
