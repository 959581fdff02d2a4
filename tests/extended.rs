//! What takes long: other sizes and resolutions of the example, the other optimiser, a real Ctrl-C. Runs where
//! `FLEXURA_EXTENDED` is set and says so where it is not.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{example, skipped, table};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("chebyshev.mech"), example("chebyshev.mech")).unwrap();
    dir
}

fn flexura(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flexura")).args(arguments).current_dir(folder).output().unwrap()
}

/// Builds and reads the report.
fn built(folder: &Path, arguments: &[&str]) -> Value {
    let mut all = vec!["build", "chebyshev.mech", "--format", "json"];
    all.extend(arguments);
    let output = flexura(folder, &all);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}: {output:?}"))
}

fn largest_error(measures: &Value) -> f64 {
    measures["traces"]["tip"]["max_error_mm"].as_f64().unwrap()
}

#[test]
fn other_sizes_are_solved_too() {
    if skipped() {
        return;
    }
    for r in [15.0, 30.0] {
        let dir = folder();
        let report = built(dir.path(), &["--set", &format!("r={r} mm")]);
        let (before, after) = (largest_error(&report["before"]), largest_error(&report["after"]));
        println!("r = {r} mm: largest error {before} → {after} mm, {}", report["seconds"]);
        assert!(after < 0.2 * before, "r = {r} mm: {before} → {after}");
        assert!(
            !dir.path().join("chebyshev.lock").exists(),
            "the lock of a trial goes into the output folder"
        );
        assert!(dir.path().join("out/chebyshev.lock").exists());
    }
}

/// Four times as many steps see the same motion.
#[test]
fn more_steps_show_the_same_motion() {
    if skipped() {
        return;
    }
    let dir = folder();
    let simulated = |steps: &str| {
        let output = flexura(dir.path(), &["simulate", "chebyshev.mech", "--fresh", "--steps", steps]);
        table(std::str::from_utf8(&output.stdout).unwrap()).1
    };
    let (coarse, fine) = (simulated("60"), simulated("240"));
    for (s, row) in coarse.iter().enumerate() {
        for (a, b) in row.iter().zip(&fine[4 * s]).skip(1) {
            assert!((a - b).abs() < 1e-6 * a.abs().max(1.0), "state {s}: {a} {b}");
        }
    }
}

#[test]
fn the_other_optimiser_goes_the_same_way_only_slower() {
    if skipped() {
        return;
    }
    let dir = folder();
    let lm = built(dir.path(), &["--fresh", "--optimizer", "lm"]);
    let lbfgs = built(dir.path(), &["--fresh", "--optimizer", "lbfgs"]);
    println!("lm    {} iterations {} {}", lm["iterations"], lm["after"], lm["seconds"]);
    println!("lbfgs {} iterations {} {}", lbfgs["iterations"], lbfgs["after"], lbfgs["seconds"]);
    assert!(largest_error(&lbfgs["after"]) < 0.5 * largest_error(&lbfgs["before"]));
    assert!(
        largest_error(&lm["after"]) <= 1.5 * largest_error(&lbfgs["after"]),
        "the default is the better one"
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_best_point() {
    if skipped() {
        return;
    }
    let dir = folder();
    // Many steps, so that it is still at work when the signal comes.
    let child = Command::new(env!("CARGO_BIN_EXE_flexura"))
        .args(["build", "chebyshev.mech", "--steps", "600", "--format", "json"])
        .current_dir(dir.path())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(2));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let codes: Vec<&str> =
        report["diagnostics"].as_array().unwrap().iter().filter_map(|d| d["code"].as_str()).collect();
    assert!(codes.contains(&"W0713"), "{codes:?}");
    assert!(largest_error(&report["after"]) <= largest_error(&report["before"]));
    let lock = std::fs::read_to_string(dir.path().join("out/chebyshev.lock")).unwrap();
    assert!(lock.contains("converged false"), "{lock}");
    assert!(dir.path().join("out/chebyshev_lambda_base.stl").exists(), "the parts are still made");
}
