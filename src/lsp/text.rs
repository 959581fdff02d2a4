//! Places in texts: bytes here, lines and UTF-16 units in the protocol; and changes of texts.

use lsp_types::{Position, Range as LspRange, TextDocumentContentChangeEvent};
use std::ops::Range;

/// Starts of the lines of a text.
#[derive(Clone, Debug)]
pub struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    /// Of a text; a line ends with `\n`, `\r\n` or `\r`.
    pub fn of(text: &str) -> Self {
        let bytes = text.as_bytes();
        let ends = |(i, b): (usize, &u8)| {
            (*b == b'\n' || *b == b'\r' && bytes.get(i + 1) != Some(&b'\n')).then_some(i + 1)
        };
        Self { starts: std::iter::once(0).chain(bytes.iter().enumerate().filter_map(ends)).collect() }
    }

    /// Line and UTF-16 column of a byte.
    pub fn position(&self, text: &str, byte: usize) -> Position {
        let line = self.starts.partition_point(|s| *s <= byte).saturating_sub(1);
        let start = self.starts.get(line).copied().unwrap_or(0);
        let units = text.get(start..byte).map_or(0, |t| t.encode_utf16().count());
        Position::new(line as u32, units as u32)
    }

    /// Byte of a place; beyond a line's end it is the line's end.
    pub fn byte(&self, text: &str, at: Position) -> usize {
        let Some(start) = self.starts.get(at.line as usize).copied() else { return text.len() };
        let line = text.get(start..).unwrap_or("");
        let line = line.get(..line.find(['\n', '\r']).unwrap_or(line.len())).unwrap_or("");
        let mut units = 0;
        for (i, c) in line.char_indices() {
            if units >= at.character {
                return start + i;
            }
            units += c.len_utf16() as u32;
        }
        start + line.len()
    }

    /// A range of bytes as the protocol has it.
    pub fn range(&self, text: &str, range: &Range<usize>) -> LspRange {
        LspRange::new(self.position(text, range.start), self.position(text, range.end))
    }
}

/// Applies changes in their order.
pub fn change(text: &mut String, changes: Vec<TextDocumentContentChangeEvent>) {
    for change in changes {
        match change.range {
            None => *text = change.text,
            Some(range) => {
                let lines = Lines::of(text);
                let (from, to) = (lines.byte(text, range.start), lines.byte(text, range.end));
                if from <= to {
                    text.replace_range(from..to, &change.text);
                }
            }
        }
    }
}

/// The word around a place: letters, digits and `_`.
pub fn word(text: &str, at: usize) -> Range<usize> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '%' || c == '°';
    let before = text.get(..at).unwrap_or("");
    let start = before.char_indices().rev().take_while(|(_, c)| is_word(*c)).last().map_or(at, |(i, _)| i);
    let behind = text.get(at..).unwrap_or("");
    let end = behind.find(|c| !is_word(c)).map_or(text.len(), |n| at + n);
    start..end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_utf16_units() {
        let text = "a\n𝛼µb\r\nc\rd";
        let lines = Lines::of(text);
        for (byte, line, column) in [(0, 0, 0), (2, 1, 0), (6, 1, 2), (8, 1, 3), (11, 2, 0), (13, 3, 0)] {
            let at = Position::new(line, column);
            assert_eq!((lines.position(text, byte), lines.byte(text, at)), (at, byte));
        }
        assert_eq!(lines.byte(text, Position::new(0, 99)), 1);
        assert_eq!(lines.byte(text, Position::new(99, 0)), text.len());
    }

    #[test]
    fn changes_apply_in_order() {
        let mut text = "one\ntwo\n".to_string();
        let at = |l1, c1, l2, c2| Some(LspRange::new(Position::new(l1, c1), Position::new(l2, c2)));
        let new = |range, text: &str| TextDocumentContentChangeEvent {
            range,
            range_length: None,
            text: text.into(),
        };
        change(&mut text, vec![new(at(0, 0, 0, 1), "O"), new(at(0, 3, 1, 0), ""), new(at(0, 6, 0, 6), "!")]);
        assert_eq!(text, "Onetwo!\n");
        change(&mut text, vec![new(None, "all")]);
        assert_eq!(text, "all");
    }
}
