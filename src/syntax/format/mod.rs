//! One look for all files: the formatter, on the lossless tree.
//!
//! Line breaks are the author's; indentation, spaces and columns are the formatter's. Neighbouring lines of one kind
//! are a table, as people set them by hand: names, `at`, clauses and comments stand below each other until a blank
//! line. What could not be understood stays as it is, byte by byte.

mod cells;
mod layout;
mod lines;

use super::tree::{Kind, Node};
use crate::diagnostic::{Diagnostic, Origin};

/// What [`format()`] gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Formatted {
    /// The text with its new look.
    pub text: String,
    /// How many parts have errors and were left as they are.
    pub left: usize,
    /// Where the first of them begins, a byte of the old text.
    pub first_left: Option<u32>,
}

/// Formats a `.mech` file; `file` is its index in the source map.
///
/// # Errors
/// A diagnostic, and the text should stay as it is: it is beyond what is read at all, or the new text would not
/// say the same (a fault of the formatter, caught here).
pub fn format(file: u32, text: &str) -> Result<Formatted, Box<Diagnostic>> {
    let parse = super::parse(file, text);
    if let [only] = &*parse.tree.children
        && only.kind == Kind::Junk
        && let Some(why) =
            parse.diagnostics.into_iter().find(|d| matches!(d.code.as_str(), "E0005" | "E0006"))
    {
        return Err(Box::new(why));
    }
    let (lines, left) = lines::lines(&parse.tree, text);
    let end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mark = if text.starts_with('\u{FEFF}') { "\u{FEFF}" } else { "" };
    // A mark behind empty lines is none: at the very start it would become one.
    // What ends with spaces only has an end of its own, too.
    let behind = text.trim_end_matches(lines::BLANK).len();
    let open = !text.get(behind..).unwrap_or("").contains(['\n', '\r']);
    let printed = layout::print(lines, end, open);
    let first = if mark.is_empty() && printed.starts_with('\u{FEFF}') { end } else { mark };
    let new = format!("{first}{printed}");
    match difference(&parse.tree, text, &super::parse(file, &new).tree, &new) {
        None => Ok(Formatted { text: new, left: left.len(), first_left: left.first().copied() }),
        Some(at) => {
            let at = Origin { file, start: at, end: at };
            let message = "the formatter would have changed what this file says; it was left as it is";
            Err(Box::new(
                Diagnostic::error(FAULT, message, at)
                    .label("from here on")
                    .help("this is a fault of the formatter: please report it with the file"),
            ))
        }
    }
}

/// The formatter caught itself.
pub const FAULT: &str = "E0750";

/// Where two texts first say different things: tokens, their nesting, or comments and their places. White space, and
/// what stands at the end of a comment, is not looked at.
fn difference(old: &Node, old_text: &str, new: &Node, new_text: &str) -> Option<u32> {
    let (mut a, mut b) = (Vec::new(), Vec::new());
    said(old, old_text, &mut a);
    said(new, new_text, &mut b);
    let same = a.iter().zip(&b).take_while(|(a, b)| (a.0, a.1) == (b.0, b.1)).count();
    if same == a.len() && same == b.len() {
        return None;
    }
    Some(a.get(same).map_or(old.end, |(_, _, at)| *at))
}

/// Nodes in order: kind, text of leaves, place.
fn said<'a>(node: &Node, text: &'a str, out: &mut Vec<(Kind, &'a str, u32)>) {
    match node.kind {
        Kind::Space | Kind::Newline => return,
        kind if node.children.is_empty() => {
            out.push((kind, text.get(node.range()).unwrap_or("").trim_end_matches(lines::BLANK), node.start));
        }
        kind => out.push((kind, "", node.start)),
    }
    for child in &node.children {
        said(child, text, out);
    }
}
