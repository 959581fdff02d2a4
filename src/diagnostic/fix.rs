//! Repairs: texts in place of byte ranges. Nothing here knows why; the finding that carries one does.

use super::{Origin, SourceMap};
use serde::{Deserialize, Serialize};

/// A repair that a finding knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fix {
    /// What it does, as an order: `remove the line`.
    pub title: String,
    /// It leaves what is built as it is. Others change the design, or guess what was meant.
    pub safe: bool,
    /// Texts in place of ranges that do not overlap.
    pub edits: Vec<Edit>,
}

/// A text in place of a byte range.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Edit {
    /// What is replaced; where empty, the text is inserted there.
    pub at: Origin,
    /// What stands there afterwards.
    pub text: String,
}

impl Fix {
    /// A repair that leaves what is built as it is.
    pub fn safe(title: impl Into<String>, edits: Vec<Edit>) -> Self {
        Self { title: title.into(), safe: true, edits }
    }

    /// A repair that changes the design, or a guess.
    pub fn risky(title: impl Into<String>, edits: Vec<Edit>) -> Self {
        Self { title: title.into(), safe: false, edits }
    }
}

impl Edit {
    /// `text` in place of what stands at `at`.
    pub fn replace(at: Origin, text: impl Into<String>) -> Self {
        Self { at, text: text.into() }
    }

    /// Takes a statement out of `source`, its file's text, with the doc comments above and the comment behind it; the
    /// whole lines, where nothing else stands on them.
    pub fn remove(source: &str, at: Origin) -> Self {
        let (start, end) = (at.start as usize, at.end as usize);
        let line_start = |i: usize| source.get(..i).and_then(|s| s.rfind('\n')).map_or(0, |n| n + 1);
        let line_end =
            |i: usize| source.get(i..).and_then(|s| s.find('\n')).map_or(source.len(), |n| i + n + 1);
        let before = source.get(line_start(start)..start).unwrap_or("x");
        let behind = source.get(end..line_end(end)).unwrap_or("x").trim();
        if !before.trim().is_empty() || !(behind.is_empty() || behind.starts_with("//")) {
            return Self { at, text: String::new() };
        }
        let mut from = line_start(start);
        while from > 0 {
            let above = line_start(from - 1);
            let line = source.get(above..from).unwrap_or("").trim();
            if !line.starts_with("///") {
                break;
            }
            from = above;
        }
        let place = Origin { start: from as u32, end: line_end(end) as u32, ..at };
        Self { at: place, text: String::new() }
    }
}

/// The files that `fixes` change, by their index, with their new texts and how many fixes each took. A fix that
/// overlaps an earlier one, or reaches beyond its file, is left out as a whole.
pub fn apply<'f>(sources: &SourceMap, fixes: impl IntoIterator<Item = &'f Fix>) -> Vec<(u32, String, usize)> {
    let mut taken: Vec<&Edit> = Vec::new();
    let mut counts: std::collections::BTreeMap<u32, usize> = std::collections::BTreeMap::new();
    for fix in fixes {
        let fits = |e: &Edit| {
            let text = sources.files.get(e.at.file as usize).map_or("", |f| f.text.as_str());
            let (start, end) = (e.at.start as usize, e.at.end as usize);
            start <= end && text.is_char_boundary(start) && text.is_char_boundary(end)
        };
        let meets = |e: &Edit| {
            taken.iter().any(|t| {
                let same = t.at.file == e.at.file;
                same && (t.at.start < e.at.end && e.at.start < t.at.end || t.at == e.at)
            })
        };
        if fix.edits.is_empty() || !fix.edits.iter().all(|e| fits(e) && !meets(e)) {
            continue;
        }
        for file in fix.edits.iter().map(|e| e.at.file).collect::<std::collections::BTreeSet<_>>() {
            *counts.entry(file).or_default() += 1;
        }
        taken.extend(&fix.edits);
    }
    taken.sort_by_key(|e| (e.at.file, e.at.start, e.at.end));
    let changed = |(file, count): (&u32, &usize)| {
        let old = sources.files.get(*file as usize)?.text.as_str();
        let (mut new, mut from) = (String::with_capacity(old.len()), 0);
        for edit in taken.iter().filter(|e| e.at.file == *file) {
            new.push_str(old.get(from..edit.at.start as usize)?);
            new.push_str(&edit.text);
            from = edit.at.end as usize;
        }
        new.push_str(old.get(from..)?);
        Some((*file, new, *count))
    };
    counts.iter().filter_map(changed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(start: u32, end: u32) -> Origin {
        Origin { file: 0, start, end }
    }

    #[test]
    fn a_statement_goes_with_its_line_docs_and_comment() {
        let text = "a\n  /// about b\n  let b = 1 // behind\nc { d }\n";
        let b = text.find("let b").unwrap() as u32;
        let edit = Edit::remove(text, at(b, b + 9));
        assert_eq!(
            text.get(edit.at.start as usize..edit.at.end as usize),
            Some("  /// about b\n  let b = 1 // behind\n")
        );
        let d = text.find('d').unwrap() as u32;
        let d = Edit::remove(text, at(d, d + 1));
        assert_eq!(d.at.end - d.at.start, 1, "c stands on the same line");
    }

    #[test]
    fn fixes_that_overlap_wait_for_the_next_round() {
        let mut sources = SourceMap::default();
        sources.add("x", "0123456789");
        let fix = |start, end, text: &str| Fix::safe("", vec![Edit::replace(at(start, end), text)]);
        let fixes = [fix(5, 7, "B"), fix(0, 2, "A"), fix(6, 8, "no"), fix(20, 21, "no"), fix(9, 9, "+")];
        assert_eq!(apply(&sources, &fixes), [(0, "A234B78+9".to_string(), 3)]);
    }
}
