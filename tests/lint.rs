//! Every rule has a design that must trigger it, with exact places, and a sound one that must not; every repair is made,
//! and what comes out compiles and is free of the finding. The test walks the table, so a rule without its pair fails.
//!
//! `tests/lint/CODE/bad.mech` says itself what is found: behind a line, `//~ CODE the first line of what is pointed at`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use flexura::diagnostic::{Diagnostic, apply};
use flexura::lint::{Check, Entry, Level, Levels, RULES, Selector, Stage, explain};
use flexura::pipeline::{self, BuildOutcome, Compiler, Files, Request};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/lint")
}

/// What is found in a text, by as much work as the rule needs.
fn run(text: &str, stage: Stage, levels: Levels) -> BuildOutcome {
    let files: BTreeMap<String, String> = [("main.mech".to_string(), text.to_string())].into();
    run_files(&files, stage, levels)
}

fn run_files(files: &dyn Files, stage: Stage, levels: Levels) -> BuildOutcome {
    let request = Request { source: "main.mech".into(), levels, ..Request::default() };
    let compiler = Compiler { iterations: 1, ..Compiler::default() };
    match stage {
        Stage::Solution | Stage::Parts => {
            pipeline::build(&request, &compiler, files, &common::NoClock, &AtomicBool::new(false))
        }
        _ => pipeline::check(&request, &compiler, files),
    }
}

/// Line of a finding, and the first line of what it points at.
fn place(d: &Diagnostic, out: &BuildOutcome) -> (usize, String) {
    let at = d.labels[0].at;
    assert_eq!(at.file, 0, "{}: {} points into another file", d.code, d.message);
    let text = &out.sources.files[0].text;
    let line = text[..at.start as usize].matches('\n').count() + 1;
    let pointed = &text[at.start as usize..at.end as usize];
    (line, pointed.lines().next().unwrap_or("").trim().to_string())
}

/// The findings of `code` that a text says it has: line and what is pointed at.
fn expected(text: &str, code: &str) -> Vec<(usize, String)> {
    let mut line = 0;
    let mut list = Vec::new();
    for (number, l) in text.lines().enumerate() {
        match l.trim().strip_prefix("//~ ") {
            Some(rest) if rest.starts_with(code) => list.push((line, rest[code.len()..].trim().to_string())),
            Some(rest) => panic!("{code}: an annotation of another code: {rest}"),
            None => line = number + 1,
        }
    }
    list
}

fn pair(entry: &Entry) -> (String, String) {
    let code = entry.rule.code;
    let read = |name: &str| {
        let path = folder().join(code).join(name);
        std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{code} has no {}: {e}", path.display()))
    };
    (read("bad.mech"), read("good.mech"))
}

fn errors(out: &BuildOutcome) -> Vec<String> {
    out.diagnostics.iter().filter(|d| d.is_error()).map(|d| format!("{} {}", d.code, d.message)).collect()
}

#[test]
fn every_rule_finds_what_it_is_for_and_nothing_in_a_sound_design() {
    let mut failures = Vec::new();
    for entry in RULES {
        let code = entry.rule.code;
        let (bad, good) = pair(entry);
        let wanted = expected(&bad, code);
        assert!(!wanted.is_empty(), "{code}: bad.mech expects nothing");
        let stage = entry.rule.stage();
        let out = run(&bad, stage, Levels::default());
        let found: Vec<_> = out.diagnostics.iter().filter(|d| d.code == code).collect();
        let mut places: Vec<_> = found.iter().map(|d| place(d, &out)).collect();
        places.sort();
        if places != wanted || !errors(&out).is_empty() {
            let told: Vec<_> =
                out.diagnostics.iter().map(|d| format!("  {} {}", d.code, d.message)).collect();
            failures.push(format!("{code} bad: {places:?}, wanted {wanted:?}\n{}", told.join("\n")));
        }
        for d in &found {
            assert_eq!(d.severity, entry.rule.severity, "{code}");
            assert!(d.help.is_some(), "{code} says no next action");
        }
        let out = run(&good, stage, Levels::default());
        let again: Vec<_> = out.diagnostics.iter().filter(|d| d.code == code || d.is_error()).collect();
        if !again.is_empty() {
            let told: Vec<_> = again.iter().map(|d| format!("  {} {}", d.code, d.message)).collect();
            failures.push(format!("{code} good:\n{}", told.join("\n")));
        }
    }
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

#[test]
fn every_repair_compiles_and_takes_its_finding_away() {
    let mut repaired = Vec::new();
    for entry in RULES {
        let code = entry.rule.code;
        let (bad, _) = pair(entry);
        let out = run(&bad, entry.rule.stage(), Levels::default());
        let fixes: Vec<_> = out
            .diagnostics
            .iter()
            .filter(|d| d.code == code)
            .flat_map(|d| d.fixes.iter().map(move |f| (d, f)))
            .collect();
        for (d, fix) in &fixes {
            repaired.push(code);
            let new = apply(&out.sources, [*fix]);
            assert_eq!(new.len(), 1, "{code}: {}", fix.title);
            let after = run(&new[0].1, entry.rule.stage(), Levels::default());
            assert_eq!(errors(&after), [""; 0], "{code}: {}\n{}", fix.title, new[0].1);
            let left = after.diagnostics.iter().filter(|l| l.code == code).count();
            let before = out.diagnostics.iter().filter(|l| l.code == code).count();
            assert!(left < before, "{code}: `{}` does not take away: {}\n{}", fix.title, d.message, new[0].1);
        }
        // What the page says of repairs holds.
        let page = entry.page().split_whitespace().collect::<Vec<_>>().join(" ");
        let says = |word: &str| page.contains(word);
        assert_eq!(fixes.iter().any(|(_, f)| f.safe), says("`--fix`"), "{code}: the page and safe repairs");
        assert_eq!(
            fixes.iter().any(|(_, f)| !f.safe),
            says("`--unsafe-fixes`"),
            "{code}: the page and risky repairs"
        );
        assert_eq!(fixes.is_empty(), says("no repair by itself"), "{code}: the page and no repair");
    }
    repaired.dedup();
    assert!(repaired.len() >= 12, "{repaired:?}");
}

#[test]
fn pages_are_complete_and_the_manual_lists_every_rule() {
    assert!(RULES.len() >= 40, "{}", RULES.len());
    for pair in RULES.windows(2) {
        assert!(pair[0].rule.code < pair[1].rule.code, "{}", pair[1].rule.code);
    }
    for entry in RULES {
        let (code, name) = (entry.rule.code, entry.rule.name);
        assert!(code.starts_with("W1") && explain::summary(code).is_some(), "{code}");
        let page = explain::page(code).unwrap();
        for heading in ["## What it finds", "## Why it matters", "## Example", "## Fix"] {
            assert!(page.contains(heading), "{code} has no {heading}");
        }
        assert!(page.starts_with(&format!("# {code} {name}: ")), "{code}");
        assert!(!page.contains("use crate"), "{code}: only the head of the file");
        assert_eq!(explain::page(name), Some(page), "by its name");
        assert!(matches!(entry.rule.check, Check::Findings) || entry.rule.stage() <= Stage::Parts);
    }
    // Codes of the other stages have a page too.
    assert!(explain::page("E0101").unwrap().contains("declared nowhere"));
    assert!(explain::page("W0635").unwrap().contains("allow W0635"));
    assert_eq!(explain::page("W9999"), None);
    let list = explain::list();
    assert_eq!(list.lines().count(), explain::codes().count());
    assert!(list.contains("W1107  ") && list.contains("[better-rest]"));
}

const UNUSED: &str = "    point X = (1 mm, 2 mm)\n    point Y = (2 mm, 3 mm)\n";

/// The sound design of W1001 with two points too many.
fn two_unused() -> String {
    let good = std::fs::read_to_string(folder().join("W1001/good.mech")).unwrap();
    good.replacen("    ground", &format!("{UNUSED}\n    ground"), 1)
}

fn codes(out: &BuildOutcome) -> Vec<&str> {
    out.diagnostics.iter().map(|d| d.code.as_str()).filter(|c| c.starts_with("W10")).collect()
}

#[test]
fn an_allow_covers_its_statement_its_block_or_its_file() {
    let text = two_unused();
    let told = |text: &str| codes(&run(text, Stage::Flexures, Levels::default())).join(" ");
    assert_eq!(told(&text), "W1001 W1001");
    let above = text.replace("    point X", "    allow W1001 \"later\"\n    point X");
    assert_eq!(told(&above), "W1001", "only the statement below");
    let both = above.replace("    point Y", "    allow W1001 \"later\"\n    // why\n    point Y");
    assert_eq!(told(&both), "", "a comment may stand between");
    let block = text.replace("    point X", "    allow W1001 \"later\"\n\n    point X");
    assert_eq!(told(&block), "", "set apart it covers the mechanism");
    let file = text.replacen("use std", "allow W1001 \"later\"\n\nuse std", 1);
    assert_eq!(told(&file), "", "outside of blocks the file");
    let needless =
        block.replace(UNUSED.lines().next().unwrap(), "").replace(UNUSED.lines().nth(1).unwrap(), "");
    assert_eq!(told(&needless), "W1000", "{needless}");
    // What only a build looks for is not judged by a check.
    let later = text.replace("    point X", "    allow W1301 \"later\"\n\n    point X");
    assert_eq!(told(&later), "W1001 W1001");
    let error = |text: &str| {
        let out = run(text, Stage::Flexures, Levels::default());
        out.diagnostics
            .iter()
            .filter(|d| d.is_error())
            .map(|d| (d.code.clone(), place(d, &out).1))
            .collect::<Vec<_>>()
    };
    assert_eq!(error(&block.replace("W1001", "W1999")), [("E0118".to_string(), "W1999".to_string())]);
    assert_eq!(error(&block.replace("W1001", "E0101")), [("E0118".to_string(), "E0101".to_string())]);
    assert_eq!(error(&block.replace("\"later\"", "\" \"")), [("E0119".to_string(), "\" \"".to_string())]);
}

#[test]
fn levels_of_flags_and_configuration() {
    let text = two_unused();
    let with = |flags: &[(&str, Level)], config: &[(&str, Level)]| {
        let list =
            |l: &[(&str, Level)]| l.iter().map(|(s, l)| (s.parse::<Selector>().unwrap(), *l)).collect();
        let levels = Levels { flags: list(flags), config: list(config), baseline: None };
        let out = run(&text, Stage::Flexures, levels);
        let found = out.diagnostics.iter().filter(|d| d.code == "W1001");
        (found.clone().filter(|d| d.is_error()).count(), found.count())
    };
    assert_eq!(with(&[], &[]), (0, 2));
    assert_eq!(with(&[("warnings", Level::Deny)], &[]), (2, 2));
    assert_eq!(with(&[("W1001", Level::Allow)], &[]), (0, 0));
    assert_eq!(with(&[("unused-point", Level::Allow)], &[]), (0, 0), "by its name");
    assert_eq!(
        with(&[("warnings", Level::Deny), ("W1001", Level::Warn)], &[]),
        (0, 2),
        "one goes before many"
    );
    assert_eq!(with(&[], &[("W1001", Level::Deny)]), (2, 2));
    assert_eq!(with(&[("all", Level::Warn)], &[("W1001", Level::Deny)]), (0, 2), "flags go before the file");
    assert!(
        "E0101".parse::<Selector>().is_err()
            && "W10011".parse::<Selector>().unwrap_err().contains("did you mean")
    );
}

#[test]
fn a_denied_finding_ends_a_build_before_it_solves() {
    let levels = Levels { flags: vec![(Selector::Warnings, Level::Deny)], ..Levels::default() };
    let out = run(&two_unused(), Stage::Parts, levels);
    assert!(out.failed() && out.solution.is_none() && out.artefacts.is_empty());
}

#[test]
fn a_baseline_knows_findings_again_wherever_they_move() {
    use flexura::lint::baseline::Baseline;
    let text = two_unused();
    let out = run(&text, Stage::Flexures, Levels::default());
    let written = Baseline::of(&out.diagnostics, &out.sources, &out.files).write().unwrap();
    let told = |text: &str| {
        let baseline = Baseline::parse(&written, 0).unwrap();
        let out = run(text, Stage::Flexures, Levels { baseline: Some(baseline), ..Levels::default() });
        codes(&out).join(" ")
    };
    assert_eq!(told(&text), "");
    assert_eq!(told(&format!("// moved\n\n{text}")), "", "lines do not matter");
    let third = text.replace("    point X", "    point Z = (7 mm, 7 mm)\n    point X");
    assert_eq!(told(&third), "W1001", "what is new is told");
    let wrong = Baseline::parse("{ \"about\": 1 }", 4).unwrap_err();
    assert_eq!((wrong[0].code.as_str(), wrong[0].labels[0].at.file), ("E0742", 4));
}

#[test]
fn repairs_of_other_findings_compile() {
    let good = std::fs::read_to_string(folder().join("W1001/good.mech")).unwrap();
    for (from, to, code) in [
        ("meet(", "met(", "E0110"),
        ("{ O, A }", "{ O, Aa }", "E0101"),
        ("material rigur", "materal rigur", "E0002"),
        ("use std.materials.rigur\n", "", "E0101"),
        ("use std.materials.rigur", "use std.materials.riguur", "E0107"),
        ("50 mm", "50 mmm", "E0112"),
        ("use std.materials.rigur", "use std.materials.rigur\nuse std.materials.petg", "W0101"),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let out = run(&text, Stage::Flexures, Levels::default());
        let d = out.diagnostics.iter().find(|d| d.code == code && !d.fixes.is_empty());
        let d = d.unwrap_or_else(|| panic!("{code} has no repair: {:?}", out.diagnostics));
        let new = apply(&out.sources, d.fixes.first());
        let after = run(&new[0].1, Stage::Flexures, Levels::default());
        let left: Vec<_> = after.diagnostics.iter().filter(|d| d.code == code || d.is_error()).collect();
        assert!(left.is_empty(), "{code}: {left:?}\n{}", new[0].1);
    }
}

/// `flexura` with these arguments in a folder: exit code, standard output, standard error.
fn flexura(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_flexura"));
    let out = command.current_dir(folder).args(arguments).output().unwrap();
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    (out.status.code().unwrap(), text(&out.stdout), text(&out.stderr))
}

#[test]
fn the_command_repairs_files_and_knows_configuration_and_baseline() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    let source = at.join("main.mech");
    let risky = "drive motor from 0 deg to 360 deg with nema17\n    rest  motor at 30 deg";
    let text = two_unused().replace(risky, "drive motor from 0 deg to 360 deg with nema17");
    std::fs::write(&source, &text).unwrap();

    let (code, _, told) = flexura(at, &["check", "main.mech", "--deny", "warnings"]);
    assert!(code == 1 && told.contains("W1001") && told.contains("`check --fix` does it"), "{told}");
    let (code, _, told) = flexura(at, &["check", "main.mech", "--deny", "W1001x"]);
    assert!(code == 2 && told.contains("did you mean") && told.contains("`W1001`?"), "{told}");

    // What is known is not told again.
    let (code, _, told) = flexura(at, &["check", "main.mech", "--write-baseline", "known.json"]);
    assert!(code == 0 && told.contains("known from now on"), "{told}");
    let (code, _, told) =
        flexura(at, &["check", "main.mech", "--baseline", "known.json", "--deny", "warnings"]);
    assert_eq!(code, 0, "{told}");
    std::fs::write(at.join("bad.json"), "{}").unwrap();
    let (code, _, told) = flexura(at, &["check", "main.mech", "--baseline", "bad.json"]);
    assert!(code == 1 && told.contains("E0742"), "{told}");

    // The configuration beside it.
    std::fs::write(at.join("flexura.toml"), "[lints]\nwarnings = \"deny\"\n").unwrap();
    assert_eq!(flexura(at, &["check", "main.mech"]).0, 1);
    std::fs::write(at.join("flexura.toml"), "[lints]\nwarnings = \"dny\"\n").unwrap();
    let (code, _, told) = flexura(at, &["check", "main.mech"]);
    assert!(code == 1 && told.contains("E0741") && told.contains("dny"), "{told}");
    std::fs::remove_file(at.join("flexura.toml")).unwrap();

    // Safe repairs first, then the others.
    let (code, _, told) = flexura(at, &["check", "main.mech", "--fix"]);
    assert!(code == 0 && told.contains("2 repaired") && !told.contains("W1001"), "{told}");
    let fixed = std::fs::read_to_string(&source).unwrap();
    assert_eq!(fixed, text.replace(UNUSED, ""));
    std::fs::write(&source, fixed.replace("{ O, D }", "{ O, Dd }").replace("point P =", "point P  ="))
        .unwrap();
    let before = std::fs::read_to_string(&source).unwrap();
    let (code, _, _) = flexura(at, &["check", "main.mech", "--fix"]);
    assert!(code == 1 && std::fs::read_to_string(&source).unwrap() == before, "a guess is not safe");
    let (code, _, told) = flexura(at, &["check", "main.mech", "--unsafe-fixes"]);
    let after = std::fs::read_to_string(&source).unwrap();
    assert!(code == 0 && after.contains("{ O, D }") && after.contains("point P  ="), "{told}\n{after}");
    let names: Vec<_> = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 3, "nothing is left beside the files: {names:?}");
}

#[test]
fn the_command_explains() {
    let here = folder();
    let (code, page, _) = flexura(&here, &["explain", "W1107"]);
    assert!(
        code == 0 && page.starts_with("W1107 better-rest: ") && page.contains("Why it matters"),
        "{page}"
    );
    assert_eq!(flexura(&here, &["explain", "better-rest"]).1, page);
    let (code, list, _) = flexura(&here, &["explain", "--list", "--format", "json"]);
    let list: serde_json::Value = serde_json::from_str(&list).unwrap();
    assert_eq!((code, list["codes"].as_array().unwrap().len()), (0, explain::codes().count()));
    let (code, one, _) = flexura(&here, &["explain", "e0101", "--format", "json"]);
    let one: serde_json::Value = serde_json::from_str(&one).unwrap();
    assert_eq!((code, one["code"].as_str(), one["severity"].as_str()), (0, Some("E0101"), Some("error")));
    let (code, _, told) = flexura(&here, &["explain", "W1170"]);
    assert!(code == 1 && told.contains("did you mean"), "{told}");
}

/// With their locks, so that what the solution shows counts too.
#[test]
fn the_examples_are_free_of_warnings() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let mut count = 0;
    for entry in std::fs::read_dir(&examples).unwrap() {
        for file in std::fs::read_dir(entry.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|e| e == "mech") {
                count += 1;
                let (code, _, told) =
                    flexura(&examples, &["check", path.to_str().unwrap(), "--deny", "warnings"]);
                assert_eq!(code, 0, "{}\n{told}", path.display());
            }
        }
    }
    assert_eq!(count, 9);
}
