//! Shows diagnostics: the seam to the renderers of `flexura::diagnostic`.

use super::Format;
use super::style::Style;
use flexura::diagnostic::{Diagnostic, Origin, Severity, SourceMap};
use serde_json::{Value, json};

/// Shows diagnostics on the standard error, for people.
pub fn show(found: &[Diagnostic], sources: &SourceMap) {
    let style = Style::stderr();
    for diagnostic in found {
        eprint!("{}", text(diagnostic, sources, style));
    }
}

/// Shows diagnostics for people, or as `{"diagnostics": […]}` on the standard output.
pub fn report(found: &[Diagnostic], sources: &SourceMap, format: Format) {
    match format {
        Format::Human => show(found, sources),
        Format::Json => println!("{}", json!({ "diagnostics": json(found, sources) })),
    }
}

/// Diagnostics as JSON.
pub fn json(found: &[Diagnostic], sources: &SourceMap) -> Vec<Value> {
    let label = |at: Origin, text: &str| {
        let (file, start, end) = place(at, sources)?;
        Some(json!({ "file": file, "start": start, "end": end, "text": text }))
    };
    let one = |d: &Diagnostic| {
        let labels: Vec<Value> = d.labels.iter().filter_map(|l| label(l.at, &l.text)).collect();
        json!({
            "code": d.code, "severity": d.severity, "message": d.message, "labels": labels, "help": d.help,
        })
    };
    found.iter().map(one).collect()
}

fn text(diagnostic: &Diagnostic, sources: &SourceMap, style: Style) -> String {
    let kind = match diagnostic.severity {
        Severity::Error => style.red("error"),
        Severity::Warning => style.bold("warning"),
        Severity::Advice => style.bold("advice"),
    };
    let mut out = format!("{kind}[{}]: {}\n", diagnostic.code, style.bold(&diagnostic.message));
    for label in &diagnostic.labels {
        let Some((file, start, _)) = place(label.at, sources) else { continue };
        out.push_str(&format!("  {file}:{}:{}", start.line, start.column));
        if !label.text.is_empty() {
            out.push_str(&format!(": {}", label.text));
        }
        out.push('\n');
    }
    if let Some(help) = &diagnostic.help {
        out.push_str(&format!("  help: {help}\n"));
    }
    out
}

/// A place as people count: from one, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
struct Position {
    line: usize,
    column: usize,
}

fn place(at: Origin, sources: &SourceMap) -> Option<(&str, Position, Position)> {
    let file = sources.files.get(at.file as usize)?;
    let position = |byte: u32| {
        let before = file.text.get(..byte as usize).unwrap_or(&file.text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        Position {
            line: before.matches('\n').count() + 1,
            column: before.get(line_start..).unwrap_or("").chars().count() + 1,
        }
    };
    Some((&file.name, position(at.start), position(at.end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_at_line_and_column() {
        let mut sources = SourceMap::default();
        sources.add("a.mech", "one\nzwölf drei\n");
        let at = Origin { file: 0, start: 11, end: 15 };
        let found = [Diagnostic::error("E0001", "wrong", at).label("here").help("mend it")];
        assert_eq!(
            text(&found[0], &sources, Style::plain()),
            "error[E0001]: wrong\n  a.mech:2:7: here\n  help: mend it\n"
        );
        let value = json(&found, &sources);
        assert_eq!(value[0]["labels"][0]["start"], json!({ "line": 2, "column": 7 }));
        assert_eq!(value[0]["severity"], "error");
    }
}
