//! The formatter's changes as small edits: what stays is not touched.

use crate::syntax::format::format;
use similar::{ChangeTag, TextDiff};
use std::ops::Range;

/// Replacements of whole lines, in order; empty where the text has its look, or cannot be formatted.
pub fn formatting(text: &str) -> Vec<(Range<usize>, String)> {
    format(0, text).map(|new| difference(text, &new.text)).unwrap_or_default()
}

/// Replacements that turn one text into another, line by line.
pub fn difference(old: &str, new: &str) -> Vec<(Range<usize>, String)> {
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    let mut at = 0;
    for change in TextDiff::from_lines(old, new).iter_all_changes() {
        let value = change.value();
        let last = edits.last_mut().filter(|(range, _)| range.end == at);
        match (change.tag(), last) {
            (ChangeTag::Equal, _) => at += value.len(),
            (ChangeTag::Delete, last) => {
                match last {
                    Some((range, _)) => range.end += value.len(),
                    None => edits.push((at..at + value.len(), String::new())),
                }
                at += value.len();
            }
            (ChangeTag::Insert, Some((_, text))) => text.push_str(value),
            (ChangeTag::Insert, None) => edits.push((at..at, value.to_string())),
        }
    }
    edits
}

/// What of one text has to be replaced to have the other: without what both begin and end with; none where they agree.
pub fn smallest(old: &str, new: &str) -> Option<(Range<usize>, String)> {
    if old == new {
        return None;
    }
    let same = |(a, b): &(char, char)| a == b;
    let length = |pairs: &mut dyn Iterator<Item = (char, char)>| -> usize {
        pairs.take_while(same).map(|(c, _)| c.len_utf8()).sum()
    };
    let start = length(&mut old.chars().zip(new.chars()));
    let (rest, with) = (old.get(start..)?, new.get(start..)?);
    let end = length(&mut rest.chars().rev().zip(with.chars().rev()));
    let text = with.get(..with.len() - end)?;
    Some((start..old.len() - end, text.into()))
}
