//! `flexura new` and `flexura doc` as a user meets them: what is begun with checks clean, and nothing is overwritten.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use flexura::elaborate::std_modules;
use std::path::Path;
use std::process::{Command, Output};

const COMPLIANT: [&str; 5] = ["hinge", "four_bar", "chebyshev", "jansen", "klann"];

fn flexura(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flexura")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Every start: those with flexures and the library's mechanisms.
fn starts() -> Vec<String> {
    let others = std_modules().into_iter().filter_map(|m| m.strip_prefix("mechanisms.").map(String::from));
    let mut all: Vec<String> = COMPLIANT.iter().map(|s| s.to_string()).chain(others).collect();
    all.sort();
    all.dedup();
    all
}

#[test]
fn every_start_checks_clean() {
    let dir = tempfile::tempdir().unwrap();
    let all = starts();
    assert!(all.len() > 12, "{all:?}");
    for start in &all {
        let name = format!("my-{start}");
        let made = flexura(dir.path(), &["new", &name, "--from", start]);
        assert_eq!(made.status.code(), Some(0), "{start}: {}", text(&made.stderr));
        let file = format!("{name}/{name}.mech");
        assert!(text(&made.stdout).starts_with(&file), "{}", text(&made.stdout));
        let source = std::fs::read_to_string(dir.path().join(&file)).unwrap();
        assert!(source.contains(&format!("mechanism my_{start} {{")), "{source}");
        assert!(source.matches("//").count() >= 6, "{start} is commented");
        let checked = flexura(dir.path(), &["check", &file]);
        assert_eq!(checked.status.code(), Some(0), "{start}: {}", text(&checked.stderr));
        // Advice is no fault, such as a rod between two balls that may turn idly. Linkages in space that move only by
        // their proportions are warned of.
        let told = text(&checked.stderr);
        let warned = told.matches('⚠').count();
        let may = if ["bennett", "hooke"].contains(&start.as_str()) { 1 } else { 0 };
        assert!(warned <= may && !told.contains('×'), "{start}: {told}");
        assert_eq!(std::fs::read_to_string(dir.path().join(&name).join(".gitignore")).unwrap(), "out/\n");
    }
}

#[test]
fn nothing_is_overwritten_and_mistakes_are_told() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(flexura(dir.path(), &["new", "leg"]).status.code(), Some(0));
    let file = dir.path().join("leg/leg.mech");
    std::fs::write(&file, "mine").unwrap();
    std::fs::write(dir.path().join("arm"), "also mine").unwrap();
    for (arguments, code, words) in [
        (vec!["new", "leg"], "E0762", "there already"),
        (vec!["new", "arm"], "E0762", "there already"),
        (vec!["new", "foot", "--from", "jansn"], "E0761", "--from jansen"),
        (vec!["new", "foot", "--from", "x"], "E0761", "pantograph"),
        (vec!["new", "../foot"], "E0763", "begin with a letter"),
        (vec!["new", "2legs"], "E0763", "begin with a letter"),
        (vec!["new", ""], "E0763", "begin with a letter"),
        (vec!["doc", "std.flexures.wier"], "E0760", "wire"),
        (vec!["doc", "qqqqqq"], "E0760", "lists all pages"),
        (vec!["doc", "none.mech"], "E0730", "does not exist"),
    ] {
        let out = flexura(dir.path(), &arguments);
        assert_eq!(out.status.code(), Some(1), "{arguments:?}");
        let told = text(&out.stderr);
        assert!(told.contains(code) && told.contains(words), "{arguments:?}: {told}");
        assert!(out.stdout.is_empty());
    }
    assert_eq!(std::fs::read_to_string(file).unwrap(), "mine");
    let mut names: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["arm", "leg"]);
}

#[test]
fn the_library_and_own_files_can_be_browsed() {
    let dir = tempfile::tempdir().unwrap();
    flexura(dir.path(), &["new", "leg", "--from", "klann"]);
    let show = |arguments: &[&str]| {
        let out = flexura(dir.path(), arguments);
        assert_eq!(out.status.code(), Some(0), "{arguments:?}: {}", text(&out.stderr));
        text(&out.stdout)
    };
    let list = show(&["doc"]);
    for module in std_modules() {
        assert!(list.contains(&format!("std.{module} ")), "{module}");
    }
    assert_eq!(show(&["doc", "std.flexures.wire"]), show(&["doc", "wire"]));
    assert!(show(&["doc", "materials"]).matches("\nmaterial ").count() > 10);
    assert!(show(&["doc", "leg/leg.mech"]).contains("step: length = 150 mm\n"));
    let json: serde_json::Value = serde_json::from_str(&show(&["doc", "wire", "--format", "json"])).unwrap();
    assert_eq!(json["pages"][0]["items"][0]["parameters"][1]["name"], "diameter");
    show(&["doc", "leg/leg.mech", "--html", "--out", "site"]);
    let index = std::fs::read_to_string(dir.path().join("site/index.html")).unwrap();
    assert!(index.contains("leg_leg.html") && dir.path().join("site/leg_leg.html").exists());
    assert!(dir.path().join("site/std.flexures.wire.html").exists());
    assert_eq!(flexura(dir.path(), &["doc", "--html"]).status.code(), Some(2));
}

/// The requirements of what is begun with hold after a build.
fn builds(start: &str) {
    let dir = tempfile::tempdir().unwrap();
    flexura(dir.path(), &["new", "first", "--from", start]);
    let out = flexura(dir.path(), &["build", "first/first.mech", "--format", "json"]);
    assert_eq!(out.status.code(), Some(0), "{start}: {}", text(&out.stdout));
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let made: Vec<&str> =
        report["artefacts"].as_array().unwrap().iter().map(|a| a.as_str().unwrap()).collect();
    assert!(made.iter().any(|a| a.ends_with(".stl")), "{made:?}");
    println!("{start}: {} iterations", report["iterations"]);
}

#[test]
fn the_default_start_builds() {
    builds("hinge");
}

/// Without flexures and loads every torque is a rounding error: such a mechanism rests wherever it is put.
#[test]
fn ordinary_hinges_rest_nowhere_in_particular() {
    let dir = tempfile::tempdir().unwrap();
    flexura(dir.path(), &["new", "first", "--from", "watt"]);
    let out = flexura(dir.path(), &["build", "first/first.mech"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let told = text(&out.stdout);
    assert!(told.contains("least gap") && !told.contains("rests"), "{told}");
}

#[test]
fn other_starts_build_too() {
    if common::skipped() {
        return;
    }
    for start in ["four_bar", "klann", "peaucellier"] {
        builds(start);
    }
}
