//! One plain diagnostic for every stage. Renderers (terminal, JSON) live beside it, one a file;
//! nothing here knows how a finding is shown.

mod fix;
pub mod json;
pub mod sarif;
pub mod terminal;

pub use fix::{Edit, Fix, apply};
use serde::{Deserialize, Serialize};

/// A byte range in one source file. Opaque to the numerical stages: they carry it so that a
/// finding of the solver can point at the line that asked for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
pub struct Origin {
    /// Index into the source map.
    pub file: u32,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing.
    Advice,
    /// Compiles, but a real part may suffer.
    Warning,
    /// The design cannot be built as written.
    Error,
}

/// A place and what is to be said there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Label {
    /// Where.
    pub at: Origin,
    /// What to say there (may be empty: underline only).
    pub text: String,
}

/// One finding: what, where, why, and the next action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// Stable code, e.g. `E0103`.
    pub code: String,
    /// Severity.
    pub severity: Severity,
    /// One line: what is wrong.
    pub message: String,
    /// Places, the primary one first.
    pub labels: Vec<Label>,
    /// The next action, in one line.
    pub help: Option<String>,
    /// Repairs, the best first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixes: Vec<Fix>,
}

impl Diagnostic {
    /// An error with `code` at `at`.
    pub fn error(code: &str, message: impl Into<String>, at: Origin) -> Self {
        Self::new(Severity::Error, code, message, at)
    }

    /// A warning with `code` at `at`.
    pub fn warning(code: &str, message: impl Into<String>, at: Origin) -> Self {
        Self::new(Severity::Warning, code, message, at)
    }

    /// Advice with `code` at `at`.
    pub fn advice(code: &str, message: impl Into<String>, at: Origin) -> Self {
        Self::new(Severity::Advice, code, message, at)
    }

    fn new(severity: Severity, code: &str, message: impl Into<String>, at: Origin) -> Self {
        Self {
            code: code.into(),
            severity,
            message: message.into(),
            labels: vec![Label { at, text: String::new() }],
            help: None,
            fixes: Vec::new(),
        }
    }

    /// Text for the primary label.
    pub fn label(mut self, text: impl Into<String>) -> Self {
        if let Some(first) = self.labels.first_mut() {
            first.text = text.into();
        }
        self
    }

    /// A further place.
    pub fn also(mut self, at: Origin, text: impl Into<String>) -> Self {
        self.labels.push(Label { at, text: text.into() });
        self
    }

    /// The next action.
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }

    /// A repair.
    pub fn fix(mut self, fix: Fix) -> Self {
        self.fixes.push(fix);
        self
    }

    /// Whether this is an error.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

/// The files a compilation has read, in the order of first use. `Origin::file` indexes it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceMap {
    /// Name as shown to the user (path relative to the design's folder, or `std/...`) and text.
    pub files: Vec<SourceFile>,
}

/// One file of a [`SourceMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceFile {
    /// Name as shown to the user.
    pub name: String,
    /// Whole text.
    pub text: String,
}

impl SourceMap {
    /// Adds a file and returns its index.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> u32 {
        self.files.push(SourceFile { name: name.into(), text: text.into() });
        (self.files.len() - 1) as u32
    }
}
