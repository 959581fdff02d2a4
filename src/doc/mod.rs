//! Documentation from doc comments: of the standard library, and of any file in the language. `read` makes the pages, `text` and `html`
//! show them.

pub mod html;
mod read;
pub mod text;

use crate::elaborate::{std_modules, std_text};
use serde::Serialize;

/// Everything that is said about one file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Page {
    /// `std.flexures.wire`, or the path of a file as the user wrote it.
    pub path: String,
    /// What the file says of itself (`//!` lines).
    pub about: String,
    /// Pages of the standard library that it imports.
    pub imports: Vec<String>,
    /// What it declares, in order; private names are left out.
    pub items: Vec<Entry>,
}

/// One declaration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// `mechanism`, `flexure`, `material`, `process` or `motor`.
    pub kind: String,
    /// Its name.
    pub name: String,
    /// The kind of joint that a flexure replaces.
    pub replaces: Option<String>,
    /// Its doc comment.
    pub about: String,
    /// What may be set from outside.
    pub parameters: Vec<Parameter>,
    /// Its own free values that are no parameters: name of the value, start and bounds.
    pub free: Vec<Parameter>,
    /// What it states or consists of: fields of a record; bodies, joints, drives and traces of a mechanism; rods of a flexure.
    pub facts: Vec<Fact>,
    /// How it is used, as text of the language: a whole line or more.
    pub example: String,
}

/// A parameter, as written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its declared type, e.g. `length`.
    pub kind: Option<String>,
    /// The unit in which a quantity of that type is usually given.
    pub unit: Option<String>,
    /// The default, or where a free one starts.
    pub default: String,
    /// Bounds, where it is free.
    pub bounds: Option<(String, String)>,
    /// Its doc comment.
    pub about: String,
}

/// A line of the table of facts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fact {
    /// Of what kind: `section`, `link`, `hinge`, or the name of a field.
    pub label: String,
    /// As written.
    pub value: String,
    /// Its doc comment.
    pub about: String,
}

impl Page {
    /// Its page about the text of a file. What cannot be understood is left out.
    pub fn of(path: &str, text: &str) -> Self {
        read::page(path, text)
    }

    /// First sentence about the file, or about its first declaration.
    pub fn summary(&self) -> String {
        let about = if self.about.is_empty() {
            self.items.first().map(|i| i.about.as_str()).unwrap_or_default()
        } else {
            &self.about
        };
        first_sentence(about)
    }

    /// The folder of the library: `flexures` of `std.flexures.wire`.
    pub fn group(&self) -> &str {
        self.path.strip_prefix("std.").and_then(|p| p.split('.').next()).unwrap_or("")
    }
}

/// All pages of the standard library, sorted by path.
pub fn library() -> Vec<Page> {
    std_modules()
        .iter()
        .map(|module| Page::of(&format!("std.{module}"), std_text(module).unwrap_or_default()))
        .collect()
}

/// Up to the first full stop that ends a sentence.
fn first_sentence(text: &str) -> String {
    let line = text.split("\n\n").next().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
    // `J. C. Klann` and `Fig. 3` end no sentence: an initial stands before the stop, or a number after it.
    let ends = |at: usize| {
        let (before, after) = (line.get(..at).unwrap_or_default(), line.get(at + 2..).unwrap_or_default());
        let word = before.rsplit(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
        (before.ends_with(')') || word.chars().count() > 2)
            && !after.starts_with(|c: char| c.is_ascii_digit())
    };
    match line.match_indices(". ").find(|(at, _)| ends(*at)) {
        Some((at, _)) => line.get(..=at).unwrap_or_default().to_string(),
        None => line,
    }
}

/// Paragraphs of a doc comment, each as pieces of plain text and of code (between backquotes).
pub(crate) fn paragraphs(text: &str) -> Vec<Vec<(bool, String)>> {
    let blocks = text.split("\n\n").map(|p| p.split_whitespace().collect::<Vec<_>>().join(" "));
    let pieces = |p: String| {
        let piece = |(i, s): (usize, &str)| (!s.is_empty()).then(|| (i % 2 == 1, s.to_string()));
        p.split('`').enumerate().filter_map(piece).collect()
    };
    blocks.filter(|p| !p.is_empty()).map(pieces).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_ends_at_its_own_stop() {
        assert_eq!(
            first_sentence("Klann's leg (J. C. Klann, 2001). More."),
            "Klann's leg (J. C. Klann, 2001)."
        );
        assert_eq!(first_sentence("One line\nover two\n\nand more. Yes."), "One line over two");
        assert_eq!(first_sentence("Leaves (section 3, Fig. 3). More."), "Leaves (section 3, Fig. 3).");
        assert_eq!(first_sentence(""), "");
    }

    #[test]
    fn code_stands_between_backquotes() {
        let found = paragraphs("a `b` c\n\n`d`");
        let own = |code, s: &str| (code, s.to_string());
        assert_eq!(found, [vec![own(false, "a "), own(true, "b"), own(false, " c")], vec![own(true, "d")]]);
    }
}
