//! What the pages say holds: samples compile, the table of diagnostics is complete, the readme's design is the example.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::example;
use flexura::elaborate::{Options, elaborate};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const LANGUAGE: &str = include_str!("../docs/language.md");
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
    let files = BTreeMap::from([("page.mech".to_string(), text.to_string())]);
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
