//! Shows diagnostics: chooses colour, width and stream for the renderers of `flexura::diagnostic`.

use super::Format;
use super::manners::Manners;
use super::style::Style;
use flexura::diagnostic::json::{JsonDiagnostic, diagnostics};
use flexura::diagnostic::{Diagnostic, Severity, SourceMap, terminal};
use flexura::pipeline::placeless;
use serde_json::json;
use std::io::Write;

/// Columns where the standard error is no terminal.
const WIDTH: usize = 100;
/// Lines longer than this are hard to read on a wide terminal.
const MOST_WIDTH: usize = 120;

/// Writes to the standard error; a reader that went away is no reason to panic.
pub fn tell(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Shows diagnostics on the standard error, for people.
pub fn show(found: &[Diagnostic], sources: &SourceMap) {
    let width = terminal_size::terminal_size_of(std::io::stderr())
        .map_or(WIDTH, |(width, _)| usize::from(width.0).min(MOST_WIDTH));
    let quiet = Manners::chosen().quiet;
    let found: Vec<Diagnostic> = found.iter().filter(|d| d.is_error() || !quiet).cloned().collect();
    let style = terminal::Style { color: Style::stderr().is_coloured(), width };
    tell(&terminal::render(&found, sources, style));
}

/// Shows diagnostics for people, or as `{"diagnostics": […]}` on the standard output.
pub fn report(found: &[Diagnostic], sources: &SourceMap, format: Format) {
    match format {
        Format::Human => show(found, sources),
        Format::Json => {
            super::commands::print(&format!("{}\n", json!({ "diagnostics": json(found, sources) })));
        }
        Format::Sarif => {
            super::sarif::print(found, sources);
        }
    }
}

/// Tells an error of the command itself, without a place in any file; its exit code.
pub fn refuse(code: &str, message: String, format: Format) -> u8 {
    report(&[placeless(Severity::Error, code, message)], &SourceMap::default(), format);
    super::commands::FAILED
}

/// How many errors and warnings there are, e.g. `2 errors, 1 warning`; empty if there are none.
pub fn counts(found: &[Diagnostic]) -> String {
    let of = |severity, one: &str| {
        let n = found.iter().filter(|d| d.severity == severity).count();
        (n > 0).then(|| format!("{n} {one}{}", if n == 1 { "" } else { "s" }))
    };
    [of(Severity::Error, "error"), of(Severity::Warning, "warning")]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(", ")
}

/// Diagnostics as JSON.
pub fn json<'a>(found: &'a [Diagnostic], sources: &'a SourceMap) -> Vec<JsonDiagnostic<'a>> {
    diagnostics(found, sources)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexura::diagnostic::Origin;

    #[test]
    fn findings_are_counted() {
        let at = Origin::default();
        let error = Diagnostic::error("E0001", "wrong", at);
        let warning = Diagnostic::warning("W0001", "doubtful", at);
        assert_eq!(counts(&[]), "");
        assert_eq!(counts(std::slice::from_ref(&error)), "1 error");
        assert_eq!(counts(&[error.clone(), warning, error]), "2 errors, 1 warning");
    }
}
