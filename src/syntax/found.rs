//! What stands at a place of the text, in the user's words, and what a stray character meant.

use super::words::COMMON_STATEMENTS;

/// Whether a character belongs to a word (of any language: a name has ASCII letters only).
pub(super) fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Byte offset of the comment on a line, if any.
pub(super) fn comment_start(line: &str) -> Option<usize> {
    let mut quoted = false;
    let mut last = ' ';
    for (at, c) in line.char_indices() {
        if c == '"' {
            quoted = !quoted;
        }
        if c == '/' && last == '/' && !quoted {
            return Some(at - 1);
        }
        last = c;
    }
    None
}

/// The word a text starts with; empty if it starts with something else.
pub(super) fn first_word(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(text.len());
    let word = text.get(..end).unwrap_or("");
    if word.starts_with(|c: char| c.is_ascii_digit()) { "" } else { word }
}

/// `KIND NAME:`, whatever the kind.
pub(super) fn looks_like_joint(text: &str) -> bool {
    let rest = text.get(first_word(text).len()..).unwrap_or("").trim_start_matches([' ', '\t']);
    let name = first_word(rest);
    let rest = rest.get(name.len()..).unwrap_or("").trim_start_matches([' ', '\t']);
    !name.is_empty() && rest.starts_with(':')
}

pub(super) fn unclosed(text: &str) -> bool {
    let line = text.lines().next().unwrap_or("");
    line.matches('"').count() < 2
}

/// Message and help for a character that the language does not have, with what was meant.
pub(super) fn odd(rest: &str) -> Option<(String, String)> {
    let c = rest.chars().next()?;
    if c.is_ascii_graphic() && !"`'@#$&|;?\\~!".contains(c) || " \t\n\r".contains(c) {
        return None;
    }
    let meant = match c {
        '\u{2212}' | '–' | '—' => "write `-` for minus",
        '×' | '·' | '⋅' => "write `*` for a product",
        '÷' => "write `/` for a quotient",
        '≤' => "write `<=`",
        '≥' => "write `>=`",
        '²' => "write `^2`",
        '³' => "write `^3`",
        '“' | '”' | '„' | '«' | '»' | '\'' | '‘' | '’' => {
            "texts stand in straight double quotes: `\"…\"`"
        }
        '…' => "write `..` for a range",
        ';' => "one declaration a line: remove it, the line end suffices",
        '#' => "comments start with `//`",
        '\u{A0}' | '\u{2007}' | '\u{202F}' => "replace it by an ordinary space",
        c if c.is_alphabetic() => "names are made of `a`–`z`, `A`–`Z`, `0`–`9` and `_`",
        c if c.is_control() => "the file may not be text, or not in UTF-8",
        _ => "remove it; it may stand in comments and texts only",
    };
    let (_, shown) = found(rest, 0);
    Some((format!("{shown} has no meaning here"), meant.into()))
}

/// Length and description of what stands at a place.
pub(super) fn found(source: &str, at: usize) -> (usize, String) {
    let rest = source.get(at..).unwrap_or("");
    let Some(c) = rest.chars().next() else { return (0, "the end of the file".into()) };
    let run = |f: &dyn Fn(char) -> bool| rest.find(|c| !f(c)).unwrap_or(rest.len());
    let after = rest.trim_start_matches([' ', '\t']);
    if after.is_empty() || after.starts_with(['\n', '\r']) || after.starts_with("//") {
        return (0, "the end of the line".into());
    }
    if after.len() < rest.len() {
        return (rest.len() - after.len(), "a space".into());
    }
    let length = match c {
        c if c.is_ascii_digit() => run(&|c| c.is_ascii_alphanumeric() || c == '.'),
        c if c.is_alphanumeric() || c == '_' => run(&|c| c.is_alphanumeric() || c == '_'),
        '<' | '>' | '=' => run(&|c| "<>=".contains(c)),
        _ => c.len_utf8(),
    };
    if c.is_control() || c.is_whitespace() || c == '\u{FEFF}' {
        return (length, format!("the character U+{:04X}", c as u32));
    }
    // A long run is named by its beginning.
    let text: String = rest.get(..length).unwrap_or("").chars().take(40).collect();
    (length, format!("`{text}`"))
}

pub(super) fn list(items: &[String]) -> String {
    match items {
        [] => "something else".into(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// The words a line may start with; of a long list the first, which are the common ones.
pub(super) fn starts(what: &str, known: &[&str]) -> String {
    let more = if known.len() > COMMON_STATEMENTS { ", …" } else { "" };
    let common: Vec<&str> = known.iter().take(COMMON_STATEMENTS).copied().collect();
    format!("{what}s start with {}{more}", common.join(", "))
}

pub(super) fn article(noun: &str) -> &'static str {
    if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" }
}
