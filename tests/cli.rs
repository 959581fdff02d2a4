//! The command line as scripts see it: exit codes, where output goes, and what is refused.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::process::{Command, Output};

fn flexura(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flexura")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn wrong_usage_is_2() {
    let dir = tempfile::tempdir().unwrap();
    for arguments in [
        &[][..],
        &["bake", "a.mech"],
        &["build"],
        &["build", "a.mech", "--set", "r"],
        &["build", "a.mech", "--set", "=3 mm"],
        &["build", "a.mech", "--steps", "0"],
        &["build", "a.mech", "--threads", "many"],
        &["build", "a.mech", "--fresh", "--frozen"],
        &["build", "a.mech", "--fresh", "--resume"],
        &["build", "a.mech", "--resume", "--frozen"],
        &["build", "a.mech", "--format", "xml"],
        &["check", "a.mech", "--rigid"],
        &["build", "a.mech", "--variant", "../../up"],
        &["build", "a.mech", "--variant", "large", "--all-variants"],
    ] {
        let output = flexura(dir.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(!output.stderr.is_empty(), "{arguments:?}");
    }
}

#[test]
fn help_and_version_are_0() {
    let dir = tempfile::tempdir().unwrap();
    let help = flexura(dir.path(), &["--help"]);
    assert_eq!(help.status.code(), Some(0));
    for command in ["check", "build", "simulate", "ir", "test", "diff"] {
        assert!(text(&help.stdout).contains(command), "{command}");
        assert_eq!(flexura(dir.path(), &[command, "--help"]).status.code(), Some(0));
    }
    assert!(text(&flexura(dir.path(), &["--version"]).stdout).starts_with("flexura "));
}

#[test]
fn an_unreadable_source_is_1_and_says_why() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("folder.mech")).unwrap();
    std::fs::write(dir.path().join("bytes.mech"), [0xff, 0xfe, 0x00]).unwrap();
    for (source, reason) in
        [("none.mech", "does not exist"), ("folder.mech", "not a file"), ("bytes.mech", "not UTF-8")]
    {
        for command in ["check", "build", "simulate", "ir"] {
            let output = flexura(dir.path(), &[command, source]);
            assert_eq!(output.status.code(), Some(1), "{command} {source}");
            let said = text(&output.stderr);
            assert!(said.contains("E0730") && said.contains(reason), "{command} {source}: {said}");
            assert!(output.stdout.is_empty());
        }
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "nothing is written");
}

#[test]
fn json_goes_to_the_standard_output_alone() {
    let dir = tempfile::tempdir().unwrap();
    let output = flexura(dir.path(), &["build", "none.mech", "--format", "json"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stderr.is_empty());
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    let mut expected =
        vec!["design_parameters", "iterations", "before", "after", "seconds", "artefacts", "diagnostics"];
    expected.sort_unstable();
    assert_eq!(keys, expected);
    assert_eq!(value["diagnostics"][0]["code"], "E0730");
    assert_eq!(value["before"], serde_json::Value::Null);
}

#[test]
fn nothing_is_coloured_away_from_a_terminal() {
    let dir = tempfile::tempdir().unwrap();
    let output = flexura(dir.path(), &["check", "none.mech"]);
    assert!(!text(&output.stderr).contains('\x1b'));
}

/// The example with five mistakes that have nothing to do with each other.
fn five_mistakes() -> (String, Vec<(usize, &'static str)>) {
    let text = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/chebyshev/chebyshev.mech"),
    )
    .unwrap();
    let mistakes = [
        ("let   half = 2.5 * r", "let   half = 2.5 * R", "E0101"),
        ("point O = (0 mm, 0 mm)", "point O = (0, 0 mm)", "E0202"),
        ("link   rocker  { B, D }", "lnik   rocker  { B, D }", "E0002"),
        ("drive motor from 0 deg to 360 deg", "drive motor from 0 mm to 360 deg", "E0201"),
        ("export stl", "export slt", "E0110"),
    ];
    let mut broken = text;
    let mut expected = Vec::new();
    for (right, wrong, code) in mistakes {
        let at = broken.find(right).unwrap_or_else(|| panic!("the example no longer says {right}"));
        expected.push((broken[..at].matches('\n').count() + 1, code));
        broken = broken.replacen(right, wrong, 1);
    }
    (broken, expected)
}

#[test]
fn five_mistakes_are_five_errors_each_at_its_place() {
    let dir = tempfile::tempdir().unwrap();
    let (text, expected) = five_mistakes();
    std::fs::write(dir.path().join("five.mech"), text).unwrap();
    for command in ["check", "build", "simulate", "ir"] {
        let output = flexura(dir.path(), &[command, "five.mech", "--format", "json"]);
        assert_eq!(output.status.code(), Some(1), "{command}");
        assert!(output.stderr.is_empty(), "{command}");
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let found: Vec<(usize, &str)> = value["diagnostics"]
            .as_array()
            .unwrap()
            .iter()
            .map(|d| {
                assert_eq!(d["severity"], "error");
                (d["labels"][0]["start"]["line"].as_u64().unwrap() as usize, d["code"].as_str().unwrap())
            })
            .collect();
        let mut sorted = found.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, expected, "{command}: {value:#}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is written");
}

/// An output folder that is a file: nothing is lost, and the reason is told.
#[test]
fn what_cannot_be_written_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/chebyshev/chebyshev.mech");
    std::fs::write(dir.path().join("taken"), "mine").unwrap();
    let output = flexura(dir.path(), &["build", source, "--frozen", "--out", "taken", "--format", "json"]);
    assert_eq!(output.status.code(), Some(1));
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let errors = value["diagnostics"].as_array().unwrap().iter().filter(|d| d["severity"] == "error");
    let codes: Vec<&str> = errors.map(|d| d["code"].as_str().unwrap()).collect();
    assert_eq!(codes, ["E0731"], "{value:#}");
    assert_eq!(std::fs::read_to_string(dir.path().join("taken")).unwrap(), "mine");
}
