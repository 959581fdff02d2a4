//! How diagnostics are shown.

use flexura::diagnostic::json::{position, render as json};
use flexura::diagnostic::terminal::{Style, render};
use flexura::diagnostic::{Diagnostic, Origin, SourceMap};
use flexura::syntax::parse;

const FIVE: &str = include_str!("errors/five.mech");

fn without_annotations(text: &str) -> String {
    text.lines().filter(|l| !l.trim_start().starts_with("//~")).map(|l| format!("{l}\n")).collect()
}

#[test]
fn five_mistakes_on_a_terminal() {
    let text = without_annotations(FIVE);
    let mut sources = SourceMap::default();
    let file = sources.add("five.mech", text.clone());
    let diagnostics = parse(file, &text).diagnostics;
    assert_eq!(diagnostics.len(), 5);
    crate::snapshot("five_terminal", render(&diagnostics, &sources, Style { color: false, width: 80 }));
    crate::snapshot("five_json", json(&diagnostics[..2], &sources).unwrap());
}

/// A finding with places in two files, tabs, wide characters and control characters.
fn two_files() -> (Vec<Diagnostic>, SourceMap) {
    let mut sources = SourceMap::default();
    let a = sources.add("a.mech", "mechanism m {\n\tlet ü = r + 3 mm // \u{1b}[31m ☃\n}\n");
    let b = sources.add("std/b.mech", "param r = 2 N\r\n");
    let at = |file, start, end| Origin { file, start, end };
    let diagnostics = vec![
        Diagnostic::error("E0201", "a force and a length cannot be added", at(a, 24, 32))
            .label("force + length")
            .also(at(a, 24, 25), "a force")
            .also(at(a, 28, 32), "a length")
            .also(at(b, 10, 13), "`r` is a force by this")
            .help("multiply or divide to get equal dimensions"),
        Diagnostic::warning("W0001", "no place in any file", at(9, 3, 4)),
        Diagnostic::error("E0001", "expected a value", at(b, 13, 13)).label("here"),
    ];
    (diagnostics, sources)
}

#[test]
fn places_in_two_files_on_a_terminal() {
    let (diagnostics, sources) = two_files();
    let plain = render(&diagnostics, &sources, Style { color: false, width: 72 });
    assert!(!plain.contains('\u{1b}'), "text of a file must not control the terminal");
    crate::snapshot("two_files_terminal", plain);
    let color = render(&diagnostics, &sources, Style { color: true, width: 72 });
    assert!(color.contains("\u{1b}[") && !color.contains("\u{1b}[31m ☃"));
}

#[test]
fn places_in_two_files_as_json() {
    let (diagnostics, sources) = two_files();
    let text = json(&diagnostics, &sources).unwrap();
    crate::snapshot("two_files_json", text.clone());
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value[0]["labels"][0]["start"], serde_json::json!({ "byte": 24, "line": 2, "column": 10 }));
    assert_eq!(value[0]["labels"][3]["file"], "std/b.mech");
    assert_eq!(value[1]["labels"][0]["file"], serde_json::Value::Null);
}

#[test]
fn lines_and_columns_count_characters_from_one() {
    let text = "ab\ncü☃d\r\ne\rf";
    let places = ['a', 'c', 'd', 'e', 'f'].map(|c| {
        let p = position(text, text.find(c).unwrap() as u32);
        (p.line, p.column)
    });
    assert_eq!(places, [(1, 1), (2, 1), (2, 4), (3, 1), (4, 1)]);
    // Beyond the end, and inside a character: the nearest place before.
    assert_eq!((position(text, 99).line, position(text, 99).column), (4, 2));
    assert_eq!((position(text, 5).line, position(text, 5).column), (2, 2));
}
