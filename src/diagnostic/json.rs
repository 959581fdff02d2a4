//! Diagnostics for programs: plain JSON objects with places as bytes and as line and column.

use super::terminal::floor_boundary;
use super::{Diagnostic, Severity, SourceMap};
use serde::Serialize;

/// A diagnostic as JSON shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JsonDiagnostic<'a> {
    /// Stable code, e.g. `E0103`.
    pub code: &'a str,
    /// `advice`, `warning` or `error`.
    pub severity: Severity,
    /// One line: what is wrong.
    pub message: &'a str,
    /// Places, the primary one first.
    pub labels: Vec<JsonLabel<'a>>,
    /// The next action, or null.
    pub help: Option<&'a str>,
    /// Repairs, the best first; absent where none is known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixes: Vec<JsonFix<'a>>,
}

/// A repair as JSON shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JsonFix<'a> {
    /// What it does.
    pub title: &'a str,
    /// It leaves what is built as it is.
    pub safe: bool,
    /// Texts in place of ranges that do not overlap.
    pub edits: Vec<JsonEdit<'a>>,
}

/// A text in place of a range, as JSON shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JsonEdit<'a> {
    /// File name as in the source map; null if the file is not in it.
    pub file: Option<&'a str>,
    /// First byte.
    pub start: JsonPosition,
    /// One past the last byte.
    pub end: JsonPosition,
    /// What stands there afterwards.
    pub text: &'a str,
}

/// A place as JSON shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JsonLabel<'a> {
    /// File name as in the source map; null if the file is not in it.
    pub file: Option<&'a str>,
    /// What to say there, possibly empty.
    pub text: &'a str,
    /// First byte.
    pub start: JsonPosition,
    /// One past the last byte.
    pub end: JsonPosition,
}

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct JsonPosition {
    /// Offset in bytes, from 0.
    pub byte: u32,
    /// Line, from 1. A line ends with `\n`, `\r\n` or `\r`.
    pub line: usize,
    /// Column in characters (Unicode scalar values), from 1.
    pub column: usize,
}

/// The list of diagnostics, ready to be serialised or to become a part of a larger object.
pub fn diagnostics<'a>(diagnostics: &'a [Diagnostic], sources: &'a SourceMap) -> Vec<JsonDiagnostic<'a>> {
    let place = |at: super::Origin| {
        let file = sources.files.get(at.file as usize);
        let text = file.map_or("", |f| f.text.as_str());
        (file.map(|f| f.name.as_str()), position(text, at.start), position(text, at.end))
    };
    let edit = |e: &'a super::Edit| {
        let (file, start, end) = place(e.at);
        JsonEdit { file, start, end, text: &e.text }
    };
    let fix = |f: &'a super::Fix| JsonFix {
        title: &f.title,
        safe: f.safe,
        edits: f.edits.iter().map(edit).collect(),
    };
    let one = |d: &'a Diagnostic| JsonDiagnostic {
        code: &d.code,
        severity: d.severity,
        message: &d.message,
        labels: d
            .labels
            .iter()
            .map(|l| {
                let (file, start, end) = place(l.at);
                JsonLabel { file, text: &l.text, start, end }
            })
            .collect(),
        help: d.help.as_deref(),
        fixes: d.fixes.iter().map(fix).collect(),
    };
    diagnostics.iter().map(one).collect()
}

/// The list of diagnostics as indented JSON text.
///
/// # Errors
/// What serde_json reports; for these types that does not happen.
pub fn render(list: &[Diagnostic], sources: &SourceMap) -> Result<String, serde_json::Error> {
    serde_json::to_string_pretty(&diagnostics(list, sources))
}

/// Line and column of a byte offset.
pub fn position(text: &str, byte: u32) -> JsonPosition {
    let before = text.get(..floor_boundary(text, byte as usize)).unwrap_or("");
    let mut line = 1;
    let mut start = 0;
    let bytes = before.as_bytes();
    for (at, c) in bytes.iter().enumerate() {
        let ends = *c == b'\n' || *c == b'\r' && text.as_bytes().get(at + 1) != Some(&b'\n');
        if ends {
            line += 1;
            start = at + 1;
        }
    }
    let column = before.get(start..).unwrap_or("").chars().count() + 1;
    JsonPosition { byte, line, column }
}
