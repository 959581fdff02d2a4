//! What the pages say holds: samples compile, the table of diagnostics is complete, the readme's design is the example.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::example;
use flexura::elaborate::{Options, elaborate};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const LANGUAGE: &str = include_str!("../docs/language.md");
const TUTORIAL: &str = include_str!("../docs/tutorial.md");
const GUIDE: &str = include_str!("../docs/guide-linkage.md");
const README: &str = include_str!("../README.md");

/// The blocks that begin with this fence.
fn blocks(page: &str, fence: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut open: Option<String> = None;
    for line in page.lines() {
        match &mut open {
            Some(_) if line == "```" => found.extend(open.take()),
            Some(block) => {
                block.push_str(line);
                block.push('\n');
            }
            None if line == format!("```{fence}") => open = Some(String::new()),
            None => {}
        }
    }
    found
}

fn errors(text: &str) -> Vec<String> {
    let block = include_str!("elaborate/errors/solids/block.stl");
    let files = BTreeMap::from([("page.mech", text), ("body.stl", block)].map(|(n, t)| (n.into(), t.into())));
    let out = elaborate("page.mech", &files, &Options::default());
    out.diagnostics.iter().map(|d| format!("{} {}", d.code, d.message)).collect()
}

/// What a statement is called: a fragment's takes the place of the design's own.
fn called(line: &str) -> String {
    let mut words = line.split_whitespace();
    let first = words.next().unwrap_or("");
    match first {
        "hinge" | "point" | "param" | "let" | "drive" | "trace" => {
            format!("{first} {}", words.next().unwrap_or(""))
        }
        _ => first.into(),
    }
}

#[test]
fn samples_of_the_manual_compile() {
    let whole = blocks(LANGUAGE, "mech");
    let fragments = blocks(LANGUAGE, "mech mechanism");
    assert!(whole.len() >= 3 && fragments.len() >= 3, "{} {}", whole.len(), fragments.len());
    let design = &whole[0];
    assert_eq!(errors(design), [""; 0]);
    for fragment in &fragments {
        let replaced: BTreeSet<String> = fragment.lines().map(called).collect();
        let (mut host, mut inside) = (String::new(), false);
        for line in design.lines() {
            if inside && line == "}" {
                host.push_str(fragment);
            }
            inside |= line.starts_with("mechanism");
            if !(inside && line.starts_with("    ") && replaced.contains(&called(line))) {
                host.push_str(line);
                host.push('\n');
            }
        }
        assert_eq!(errors(&host), [""; 0], "{host}");
    }
    // Whole files besides.
    let files = blocks(LANGUAGE, "mech file");
    assert!(files.len() >= 3);
    for text in &files {
        assert_eq!(errors(text), [""; 0], "{text}");
    }
    // Mechanisms that place the design.
    let instances = blocks(LANGUAGE, "mech instances");
    assert!(!instances.is_empty());
    for text in &instances {
        assert_eq!(errors(&format!("{design}\n{text}")), [""; 0]);
    }
    // Templates and records: used by the design in place of its own.
    let parts: String = whole[1..].concat();
    let own = design
        .replace("use std.", "// use std.")
        .replace("crossed_leaves", "single_leaf")
        .replace("material rigur", "material my_print")
        .replace("polyjet", "my_printer")
        .replace("nema17", "my_stepper");
    assert_eq!(errors(&format!("{own}\n{parts}")), [""; 0]);
}

/// The file with a change made to it: a line takes the place of the one that declares the same, or goes before the last brace.
fn changed(text: &str, change: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    let key = |line: &str| {
        let declares =
            line.starts_with("    ") && !line.starts_with("     ") && !line.trim().starts_with(['}', '/']);
        declares.then(|| line.split_whitespace().take(2).collect::<Vec<_>>().join(" "))
    };
    for line in change.lines() {
        let old = key(line).and_then(|k| lines.iter().position(|l| key(l).as_ref() == Some(&k)));
        match old {
            Some(at) => lines[at] = line.into(),
            None if line.starts_with("use ") => {
                let at = lines.iter().rposition(|l| l.starts_with("use ")).map_or(0, |i| i + 1);
                lines.insert(at, line.into());
            }
            None => {
                let end = lines.iter().rposition(|l| l == "}").unwrap();
                lines.insert(end, line.into());
            }
        }
    }
    lines.join("\n") + "\n"
}

/// Goes through a page as a reader does: writes its files, makes its changes, runs its commands and compares what they answer.
/// Every line that is shown stands in the answer, in this order; `…` leaves something out, within a line its rest.
fn follow(page: &str) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let (mut file, mut text, mut answer) = (String::new(), String::new(), String::new());
    let mut compared = 0;
    let mut rest = page.lines();
    while let Some(line) = rest.next() {
        let Some(fence) = line.strip_prefix("```") else { continue };
        let block: Vec<&str> = rest.by_ref().take_while(|l| *l != "```").collect();
        match fence.split_once(' ').unwrap_or((fence, "")) {
            ("mech", "change") => text = changed(&text, &block.join("\n")),
            ("mech", name) => (file, text) = (name.into(), block.join("\n") + "\n"),
            ("sh", _) => {
                std::fs::write(folder.path().join(&file), &text).unwrap();
                for command in block {
                    // Words, those in quotes as one.
                    let words: Vec<String> = command
                        .split('"')
                        .enumerate()
                        .flat_map(|(i, part)| match i % 2 {
                            0 => part.split_whitespace().map(String::from).collect(),
                            _ => vec![part.to_string()],
                        })
                        .collect();
                    assert_eq!(words[0], "flexura", "{command}");
                    let out = std::process::Command::new(env!("CARGO_BIN_EXE_flexura"))
                        .args(&words[1..])
                        .current_dir(folder.path())
                        .output()
                        .unwrap();
                    answer = [out.stderr, out.stdout].map(|b| String::from_utf8(b).unwrap()).concat();
                }
            }
            ("text", _) => {
                let mut lines = answer.lines();
                for shown in block.into_iter().filter(|l| *l != "…" && !l.is_empty()) {
                    let is = |l: &str| match shown.split_once('…') {
                        Some((begins, ends)) => l.starts_with(begins) && l.ends_with(ends),
                        None => l == shown,
                    };
                    assert!(
                        lines.any(is),
                        "not in the answer, or not in this order: {shown}\n{text}\n{answer}"
                    );
                    compared += 1;
                }
            }
            other => panic!("what is {other:?}?"),
        }
    }
    compared
}

#[test]
fn the_tutorial_can_be_followed() {
    assert!(follow(TUTORIAL) >= 30);
    // It ends where the default start begins.
    let start = include_str!("../starts/hinge.mech");
    for line in ["stress(below = 18 MPa, scale = 0.2 MPa)", "require max(stress())   <= petg.yield / 2"] {
        assert!(TUTORIAL.contains(line) && start.contains(line), "{line}");
    }
}

#[test]
fn the_guide_can_be_followed() {
    assert!(follow(GUIDE) > 6);
}

/// Every word of the grammar, function, unit, type, field, flexure and mechanism stands in the manual, words and functions in
/// a sample that compiles.
#[test]
fn the_manual_is_complete() {
    let grammar = include_str!("../grammar/mech.pest");
    let samples: String = ["mech", "mech mechanism", "mech instances", "mech file"]
        .iter()
        .flat_map(|fence| blocks(LANGUAGE, fence))
        .collect();
    let word =
        |text: &str, word: &str| text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|w| w == word);
    let quoted = |line: &str| line.split('"').nth(1).map(String::from);
    let keywords: Vec<String> =
        grammar.lines().filter(|l| l.starts_with("kw_") && l.contains("!idch")).filter_map(quoted).collect();
    assert!(keywords.len() > 60, "{}", keywords.len());
    for k in &keywords {
        assert!(word(&samples, k), "no sample of the manual has the word `{k}`");
    }
    // Lists of names in the elaborator: what follows a constant up to its `;`.
    let list = |text: &'static str, name: &str| -> Vec<&'static str> {
        let at = text.find(&format!("const {name}: ")).unwrap_or_else(|| panic!("{name}"));
        text[at..].split(';').next().unwrap().split('"').skip(1).step_by(2).collect()
    };
    let functions = include_str!("../src/elaborate/functions.rs");
    let terms = include_str!("../src/elaborate/terms.rs");
    let require = include_str!("../src/elaborate/require.rs");
    let goals = include_str!("../src/elaborate/goals.rs");
    let mut called: Vec<&str> = list(functions, "FUNCTIONS");
    called.extend(list(terms, "TERMS"));
    called.extend(list(require, "AGGREGATES").into_iter().chain(list(require, "QUANTITIES")));
    called.extend(list(goals, "EXPORTS"));
    called.extend(["cyl", "sph", "ellipse", "rect", "round", "points"]);
    assert!(called.len() > 35, "{}", called.len());
    for f in &called {
        assert!(word(&samples, f), "no sample of the manual has `{f}`");
    }
    for unit in flexura::elaborate::units::UNITS {
        assert!(LANGUAGE.contains(unit.symbol), "{}", unit.symbol);
    }
    for name in flexura::elaborate::dimension::Dimension::type_names() {
        assert!(word(LANGUAGE, name), "type {name}");
    }
    let records = include_str!("../src/elaborate/records.rs");
    for field in records.lines().filter(|l| l.contains("field(\"")).filter_map(quoted) {
        assert!(word(&samples, &field), "no sample of the manual has the field `{field}`");
    }
    for module in flexura::elaborate::std_modules() {
        let (folder, name) = module.split_once('.').unwrap();
        let shown = matches!(folder, "flexures" | "mechanisms" | "motors" | "processes");
        assert!(!shown || LANGUAGE.contains(&format!("`{name}`")), "{module}");
    }
}

#[test]
fn every_diagnostic_is_in_the_manual() {
    fn collect(folder: &Path, codes: &mut BTreeSet<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, codes);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                // Codes in tests may be made up.
                let text = text.split("#[cfg(test)]").next().unwrap_or("");
                codes.extend(text.split('"').filter(|s| is_code(s)).map(String::from));
            }
        }
    }
    let mut used = BTreeSet::new();
    collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut used);
    let listed: BTreeSet<String> = LANGUAGE
        .lines()
        .filter_map(|l| l.strip_prefix("| ")?.split(' ').next())
        .filter(|w| is_code(w))
        .map(String::from)
        .collect();
    assert!(used.len() > 60, "{}", used.len());
    assert_eq!(used, listed);
}

fn is_code(text: &str) -> bool {
    text.len() == 5 && text.starts_with(['E', 'W', 'A']) && text[1..].bytes().all(|b| b.is_ascii_digit())
}

/// Each line of the readme's design stands in the example, in this order; `…` leaves something out.
#[test]
fn the_readme_shows_the_example() {
    let squeeze = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let text = squeeze(&example("chebyshev.mech"));
    let mut rest = text.as_str();
    let shown = blocks(README, "mech").concat();
    assert!(shown.lines().count() > 25);
    for line in shown.lines() {
        for part in line.split('…').map(squeeze).filter(|p| !p.is_empty()) {
            let at = rest
                .find(&part)
                .unwrap_or_else(|| panic!("not in the example, or not in this order: {part}"));
            rest = &rest[at + part.len()..];
        }
    }
}
