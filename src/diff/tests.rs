//! Versions of one design, compared without simulating them.

use super::*;
use crate::pipeline::{Compiler, Extent, Request, Values, examine};
use std::collections::BTreeMap;

const DESIGN: &str = include_str!("../../examples/chebyshev/chebyshev.mech");
const LOCK: &str = include_str!("../../examples/chebyshev/chebyshev.lock");

fn version(text: &str, lock: Option<&str>) -> Examined {
    let files = BTreeMap::from([("a.mech".to_string(), text.to_string())]);
    let lock = lock.map(|text| ("a.lock".to_string(), text.to_string()));
    let request = Request { source: "a.mech".into(), lock, ..Request::default() };
    examine(&request, Values::LockOrStart, Extent::Values, &Compiler::default(), &files)
}

fn replaced(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(DESIGN.to_string(), |text, (from, to)| {
        assert!(text.contains(from), "the example no longer says {from}");
        text.replace(from, to)
    })
}

fn changes(text: &str) -> Diff {
    compare(&version(DESIGN, None), &version(text, None))
}

#[test]
fn comments_format_and_order_are_no_change() {
    // The statements of the mechanism the other way round.
    let (head, body) = DESIGN.split_once("mechanism").unwrap();
    let mut lines: Vec<&str> = body.lines().collect();
    let first = lines.iter().position(|l| l.trim_start().starts_with("point")).unwrap();
    let last = lines.iter().rposition(|l| l.trim_start().starts_with("point")).unwrap();
    assert!(last > first + 2);
    lines[first..=last].reverse();
    let text = format!("// Another day.\n{head}mechanism{}\n", lines.join("  // why\n"));
    let diff = changes(&text.replace("  // why\n    export", "\n\n    export"));
    assert!(diff.unchanged, "{diff:?}");
    assert_eq!(diff.values, [Simulated::Start; 2]);
}

#[test]
fn a_renamed_joint_is_one_change() {
    let diff = changes(&DESIGN.replace("knee", "elbow"));
    assert_eq!((diff.names.len(), diff.lines.len(), diff.numbers.len()), (1, 0, 0), "{diff:?}");
    let name = &diff.names[0];
    assert_eq!((name.change, name.kind.as_str(), name.name.as_str()), (NameChange::Renamed, "joint", "knee"));
    assert_eq!(name.to.as_deref(), Some("elbow"));
}

#[test]
fn several_names_at_a_time_and_the_mechanism_itself() {
    let mut text = String::new();
    for word in DESIGN.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_')) {
        let end = word.trim_end_matches(|c: char| !(c.is_alphanumeric() || c == '_'));
        let new = match end {
            "coupler" => "bar",
            "knee" => "elbow",
            "heel" => "ankle",
            "tip" => "toe",
            "chebyshev_lambda" => "stepper_leg",
            other => other,
        };
        text.push_str(&word.replacen(end, new, 1));
    }
    let diff = changes(&text);
    assert!(diff.lines.is_empty() && diff.numbers.is_empty(), "{diff:?}");
    assert!(diff.names.iter().all(|n| n.change == NameChange::Renamed), "{diff:?}");
    let told: Vec<&str> = diff.names.iter().map(|n| n.name.as_str()).collect();
    for name in ["chebyshev_lambda", "coupler", "knee", "heel", "tip"] {
        assert!(told.contains(&name), "{name}: {told:?}");
    }
}

#[test]
fn what_has_nothing_in_common_is_no_rename() {
    let text = replaced(&[
        ("    point U = B + 0.5 * (B - D) ", "    point Far = (400 mm, 1 mm, 7 mm) "),
        ("toward U ", "toward B + (9 mm, 9 mm) "),
    ]);
    let diff = changes(&text);
    let told: Vec<_> = diff.names.iter().map(|n| (n.change, n.name.as_str())).collect();
    assert_eq!(told, [(NameChange::Added, "Far"), (NameChange::Removed, "U")], "{diff:?}");
    assert_eq!(diff.lines.iter().map(|l| l.what.as_str()).collect::<Vec<_>>(), ["joint knee"]);
}

#[test]
fn a_parameter_changes_its_line_and_the_lengths_that_follow() {
    let diff = changes(&replaced(&[("param r: length = 20 mm", "param r: length = 25 mm")]));
    assert!(diff.names.is_empty(), "{diff:?}");
    let lines: Vec<_> =
        diff.lines.iter().map(|l| (l.what.as_str(), l.before.as_str(), l.after.as_str())).collect();
    assert_eq!(lines, [("param r", ": length = 20 mm", ": length = 25 mm")]);
    let crank = diff.numbers.iter().find(|n| n.kind == "length" && n.name == "crank O-A").unwrap();
    assert!((crank.before - 20.0).abs() < 1e-9 && (crank.after - 25.0).abs() < 1e-9, "{crank:?}");
}

#[test]
fn solved_values_are_compared_where_both_locks_are_current() {
    let solved = version(DESIGN, Some(LOCK));
    assert!(compare(&solved, &version(DESIGN, Some(LOCK))).unchanged);
    let design = solved.outcome.design.clone().unwrap();
    let mut solution = crate::emit::lock::Lock::parse(LOCK, 0).unwrap().solution;
    let path = design.free[0].path.clone();
    *solution.values.get_mut(&path).unwrap() = 0.5 * (design.free[0].lower + design.free[0].upper);
    let other = crate::emit::lock::Lock::new(&design, solution).write();
    let diff = compare(&solved, &version(DESIGN, Some(&other)));
    let told: Vec<_> = diff.numbers.iter().map(|n| (n.kind, n.name.as_str())).collect();
    assert_eq!(told, [("solved value", path.as_str())]);
    assert_eq!(diff.values, [Simulated::Lock; 2]);
    let diff = compare(&solved, &version(DESIGN, None));
    assert_eq!(diff.values, [Simulated::Lock, Simulated::Start]);
    assert!(!diff.unchanged, "one of them is not solved");
}

#[test]
fn a_version_with_errors_is_still_compared_by_its_lines() {
    let diff = changes(&replaced(&[("let   half = 2.5 * r", "let   half = 2.5 * R")]));
    assert_eq!(diff.lines.len(), 1, "{diff:?}");
    assert_eq!(diff.values, [Simulated::Start, Simulated::Not]);
}
