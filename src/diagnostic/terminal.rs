//! Diagnostics for people: source excerpt, labels and help, drawn by miette (its only client).

use super::{Diagnostic, Label, Origin, Severity, SourceFile, SourceMap};
use miette::{
    GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError, MietteSpanContents, SourceCode,
    SourceSpan, SpanContents,
};
use std::fmt;

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// Use ANSI colours.
    pub color: bool,
    /// Columns of the terminal.
    pub width: usize,
}

impl Default for Style {
    fn default() -> Self {
        Self { color: false, width: 100 }
    }
}

/// Draws a list of diagnostics, one after the other. Labels may lie in several files.
pub fn render(diagnostics: &[Diagnostic], sources: &SourceMap, style: Style) -> String {
    let theme = if style.color { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme)
        .with_width(style.width.max(20))
        .with_links(false)
        .with_context_lines(1)
        .tab_width(4);
    let mut out = String::new();
    for diagnostic in diagnostics {
        let report = Report::new(diagnostic, sources);
        // Writing to a string fails only where miette finds a label outside of its source.
        if handler.render_report(&mut out, &report).is_err() {
            out.push_str(&format!("{}: {}\n", diagnostic.code, printable(&diagnostic.message)));
        }
        out.push('\n');
    }
    out
}

/// One diagnostic in miette's terms. miette draws one source a report: labels in other files
/// become reports of their own, shown below.
struct Report {
    code: Option<String>,
    severity: Severity,
    message: String,
    help: Option<String>,
    labels: Vec<LabeledSpan>,
    source: Option<Source>,
    related: Vec<Report>,
}

impl Report {
    fn new(diagnostic: &Diagnostic, sources: &SourceMap) -> Self {
        let main = diagnostic.labels.first().map(|l| l.at.file);
        let source = main.and_then(|file| sources.files.get(file as usize));
        let (here, elsewhere): (Vec<&Label>, Vec<&Label>) =
            diagnostic.labels.iter().partition(|l| Some(l.at.file) == main);
        Self {
            code: Some(printable(&diagnostic.code)),
            severity: diagnostic.severity,
            message: printable(&diagnostic.message),
            help: help(diagnostic),
            labels: here.iter().enumerate().filter_map(|(i, l)| span(l, i == 0, source)).collect(),
            source: source.map(named),
            related: elsewhere.into_iter().map(|label| Self::elsewhere(label, sources)).collect(),
        }
    }

    fn elsewhere(label: &Label, sources: &SourceMap) -> Self {
        let source = sources.files.get(label.at.file as usize);
        Self {
            code: None,
            severity: Severity::Advice,
            message: printable(&label.text),
            help: None,
            labels: span(&Label { text: String::new(), ..label.clone() }, true, source).into_iter().collect(),
            source: source.map(named),
            related: Vec::new(),
        }
    }
}

/// The next action, and by which flag the compiler takes it.
fn help(diagnostic: &Diagnostic) -> Option<String> {
    let fix = diagnostic.fixes.first().map(|f| {
        let flag = if f.safe { "--fix" } else { "--unsafe-fixes" };
        format!("`check {flag}` does it: {}", f.title)
    });
    let lines: Vec<&str> = diagnostic.help.as_deref().into_iter().chain(fix.as_deref()).collect();
    (!lines.is_empty()).then(|| lines.iter().map(|l| printable(l)).collect::<Vec<_>>().join("\n"))
}

/// A file's name and text as shown. Like miette's own sources, but columns count characters, not bytes.
struct Source {
    name: String,
    text: String,
}

impl SourceCode for Source {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let read = self.text.read_span(span, before, after)?;
        let until = self.text.get(..read.span().offset()).unwrap_or("");
        let column = until.chars().rev().take_while(|c| *c != '\n').count();
        Ok(Box::new(MietteSpanContents::new_named(
            self.name.clone(),
            read.data(),
            *read.span(),
            read.line(),
            column,
            read.line_count(),
        )))
    }
}

fn named(file: &SourceFile) -> Source {
    Source { name: printable(&file.name), text: shown(&file.text) }
}

/// A label as miette wants it, within its file and on character boundaries.
fn span(label: &Label, primary: bool, source: Option<&SourceFile>) -> Option<LabeledSpan> {
    let Origin { start, end, .. } = label.at;
    let text = &source?.text;
    let start = floor_boundary(text, start as usize);
    let end = floor_boundary(text, end as usize).max(start);
    let span = SourceSpan::new(start.into(), end - start);
    let text = (!label.text.is_empty()).then(|| printable(&label.text));
    Some(if primary {
        LabeledSpan::new_primary_with_span(text, span)
    } else {
        LabeledSpan::new_with_span(text, span)
    })
}

/// The last character boundary at or before a byte offset.
pub(super) fn floor_boundary(text: &str, offset: usize) -> usize {
    let mut at = offset.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// Source text as it may be sent to a terminal: control characters and marks that reorder the
/// line are replaced by others of as many bytes, so that offsets stay right.
fn shown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        out.push(match c {
            '\n' | '\t' => c,
            '\r' if chars.peek() == Some(&'\n') => c,
            c if is_unsafe(c) => match c.len_utf8() {
                1 => '?',
                2 => '¿',
                _ => '\u{FFFD}',
            },
            c => c,
        });
    }
    out
}

/// A message on one line, without control characters.
fn printable(text: &str) -> String {
    text.chars().map(|c| if is_unsafe(c) { '\u{FFFD}' } else { c }).collect()
}

fn is_unsafe(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}' | '\u{FEFF}')
}

impl fmt::Debug for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Report {}

impl miette::Diagnostic for Report {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.code.as_ref().map(|c| Box::new(c) as Box<dyn fmt::Display>)
    }

    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.severity {
            Severity::Advice => miette::Severity::Advice,
            Severity::Warning => miette::Severity::Warning,
            Severity::Error => miette::Severity::Error,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|h| Box::new(h) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|s| s as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        (!self.labels.is_empty())
            .then(|| Box::new(self.labels.iter().cloned()) as Box<dyn Iterator<Item = _>>)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        (!self.related.is_empty()).then(|| {
            Box::new(self.related.iter().map(|r| r as &dyn miette::Diagnostic)) as Box<dyn Iterator<Item = _>>
        })
    }
}
