//! Limits checked before the grammar runs, so that no text can exhaust memory or the stack.

use super::words;
use crate::diagnostic::{Diagnostic, Origin};

/// Largest file in bytes. The largest sample has 4 kB; a tree takes about 20 times its text.
pub const MAX_BYTES: usize = 1 << 20;

/// Deepest nesting of brackets. Measured in the development build: 128 fit in half a mebibyte of
/// stack (not in 3/8), 1024 in eight. Samples stay below 6.
pub const MAX_NESTING: usize = 128;

/// A diagnostic if `text` is beyond what the grammar is given.
pub(super) fn check(file: u32, text: &str) -> Option<Diagnostic> {
    if text.len() > MAX_BYTES {
        let at = Origin { file, start: 0, end: 0 };
        let message = format!("this file has {} bytes, more than {MAX_BYTES}", text.len());
        return Some(
            Diagnostic::error("E0005", message, at)
                .label("too large to read")
                .help("split the design into several files and import them with `use`"),
        );
    }
    let start = too_deep(text)?;
    let at = Origin { file, start: start as u32, end: start as u32 + 1 };
    Some(
        Diagnostic::error("E0006", format!("brackets are nested more than {MAX_NESTING} deep"), at)
            .label("this one is too deep")
            .help("close what is open, or give inner expressions names with `let`"),
    )
}

/// Byte offset of the first bracket that is nested too deep. Strings and comments are passed
/// over as the grammar does it.
fn too_deep(text: &str) -> Option<usize> {
    let mut open: Vec<u8> = Vec::new();
    let bytes = text.as_bytes();
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let rest = bytes.get(at + 1..).unwrap_or(&[]);
        let to = |stop: &[u8]| rest.iter().position(|b| stop.contains(b));
        match byte {
            b'"' => {
                // A string that does not end on its line is an ordinary character.
                if let Some(end) = to(b"\"\r\n")
                    && rest.get(end) == Some(&b'"')
                {
                    at += end + 1;
                }
            }
            b'/' if rest.first() == Some(&b'/') => at += to(b"\r\n").unwrap_or(rest.len()),
            // No parenthesis reaches over a line that starts a statement.
            b'\n' | b'\r' if words::starts_statement(text.get(at + 1..).unwrap_or("")) => {
                let inner = open.iter().rposition(|b| *b == b'{').map_or(0, |i| i + 1);
                open.truncate(inner);
            }
            b'(' | b'{' => {
                if open.len() >= MAX_NESTING {
                    return Some(at);
                }
                open.push(byte);
            }
            b')' if open.last() == Some(&b'(') => drop(open.pop()),
            b'}' => {
                // A brace ends whatever parentheses were left open inside it.
                let outer = open.iter().rposition(|b| *b == b'{');
                open.truncate(outer.unwrap_or(0));
            }
            _ => {}
        }
        at += 1;
    }
    None
}
