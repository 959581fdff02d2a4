//! `flexura explain`: the page of a rule is the doc comment of its file; the one-line summaries of all codes are those of
//! the table in the manual.

use super::{Entry, RULES, find};
use std::fmt::Write;

/// The manual, which holds the table.
const MANUAL: &str = include_str!("../../docs/language.md");

/// Every code with its one-line summary, in the order of the manual's table.
pub fn codes() -> impl Iterator<Item = (&'static str, &'static str)> {
    MANUAL.lines().filter_map(|line| {
        let (code, rest) = line.strip_prefix("| ")?.split_once(" | ")?;
        let shape = code.len() == 5 && code.starts_with(['E', 'W', 'A']);
        let number = code.get(1..).is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()));
        (shape && number).then(|| (code, rest.trim_end_matches('|').trim_end()))
    })
}

/// The one-line summary of a code.
pub fn summary(code: &str) -> Option<&'static str> {
    codes().find(|(c, _)| *c == code).map(|(_, s)| s)
}

/// What a code's letter says.
fn kind(code: &str) -> &'static str {
    match code.chars().next() {
        Some('E') => "error",
        Some('W') => "warning",
        _ => "advice",
    }
}

/// How a rule's findings are told by themselves.
fn severity(entry: &Entry) -> &'static str {
    match entry.rule.severity {
        crate::diagnostic::Severity::Advice => "advice",
        _ => "warning",
    }
}

/// The page of a code, or of a rule by its name, as text of headings, paragraphs and samples; none where there is no
/// such code.
pub fn page(word: &str) -> Option<String> {
    let entry = find(word);
    let code = entry.map_or(word, |e| e.rule.code);
    let summary = summary(code)?;
    let mut page = String::new();
    match entry {
        Some(entry) => {
            let _ = writeln!(page, "# {code} {}: {summary}\n", entry.rule.name);
            let _ = writeln!(
                page,
                "A lint, told as {}, found from {}.\n",
                severity(entry),
                entry.rule.stage().name()
            );
            page.push_str(entry.page().trim());
            page.push('\n');
        }
        None => {
            let _ = writeln!(page, "# {code}: {summary}\n");
            let what = kind(code);
            let _ = match what {
                "error" => writeln!(
                    page,
                    "An error: the design cannot be built as it is written. The finding points at the place and says what to do next."
                ),
                _ => writeln!(
                    page,
                    "Told as {what} by the compiler itself. The finding points at the place and says what to do next; `allow {code} \"reason\"` silences it."
                ),
            };
        }
    }
    Some(page)
}

/// Every code with its summary, one a line, rules with their names.
pub fn list() -> String {
    let mut out = String::new();
    for (code, summary) in sorted() {
        let _ = match find(code) {
            Some(entry) => writeln!(out, "{code}  {summary} [{}]", entry.rule.name),
            None => writeln!(out, "{code}  {summary}"),
        };
    }
    out
}

/// A code for programs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Explained {
    /// The code.
    pub code: &'static str,
    /// Name of a rule.
    pub name: Option<&'static str>,
    /// `error`, `warning` or `advice`.
    pub severity: &'static str,
    /// What it needs, of a rule.
    pub stage: Option<&'static str>,
    /// One line.
    pub summary: &'static str,
    /// The whole page, where one code was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub page: Option<String>,
}

/// All codes for programs.
pub fn all() -> Vec<Explained> {
    sorted().into_iter().map(|(code, summary)| explained(code, summary)).collect()
}

/// One code, or a rule by its name, for programs.
pub fn one(word: &str) -> Option<Explained> {
    let code = find(word).map_or(word, |e| e.rule.code);
    let (code, summary) = codes().find(|(c, _)| *c == code)?;
    Some(Explained { page: page(code), ..explained(code, summary) })
}

fn explained(code: &'static str, summary: &'static str) -> Explained {
    let entry = find(code);
    Explained {
        code,
        name: entry.map(|e| e.rule.name),
        severity: entry.map_or_else(|| kind(code), severity),
        stage: entry.map(|e| e.rule.stage().name()),
        summary,
        page: None,
    }
}

fn sorted() -> Vec<(&'static str, &'static str)> {
    let mut all: Vec<_> = codes().collect();
    all.sort_by_key(|(code, _)| (code.get(1..), *code));
    all
}

/// Codes and names shown for one that is none, at most.
const MOST_NEAR: usize = 3;

/// The codes and names nearest to a word that is none, those of them that are equally near; none where it is like none.
pub fn nearest(word: &str) -> Vec<&'static str> {
    let all = codes().map(|(c, _)| c).chain(RULES.iter().map(|e| e.rule.name));
    let upper = word.to_uppercase();
    let distance = |c: &str| strsim::damerau_levenshtein(c, word).min(strsim::damerau_levenshtein(c, &upper));
    let mut near: Vec<(usize, &str)> =
        all.map(|c| (distance(c), c)).filter(|(d, c)| 3 * d <= c.len()).collect();
    near.sort_unstable();
    let least = near.first().map_or(0, |n| n.0);
    near.into_iter().take_while(|(d, _)| *d == least).take(MOST_NEAR).map(|(_, c)| c).collect()
}
