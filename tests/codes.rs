//! Every code of the manual's table has a case that says exactly where its finding points. The places are kept in snapshots
//! (annotated files know lines only); the pairs of `tests/lint` say theirs themselves. A new code without a case fails.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "codes/built.rs"]
mod built;
mod common;

use common::folder::Folder;
use flexura::diagnostic::{Diagnostic, SourceMap};
use flexura::elaborate::{Options, elaborate};
use flexura::emit::lock::Lock;
use flexura::lint::{RULES, baseline::Baseline, config, explain};
use flexura::pipeline::{self, Compiler, Request};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const MANUAL: &str = include_str!("../docs/language.md");

/// About the command and its surroundings: there is no text to point into.
const PLACELESS: &[&str] = &[
    "E0730", "E0731", "E0752", "W0753", "E0754", "E0755", "E0756", "E0757", "E0760", "E0761", "E0762",
    "E0763", "E0764", "E0770", "W0727",
];
/// The compiler's own faults, told instead of a panic: no text is known that leads there.
const OWN_FAULTS: &[&str] =
    &["E0630", "E0631", "E0643", "E0646", "E0647", "E0648", "W0659", "E0720", "E0750"];
/// Held to their places where they arise: in `kinematics.rs`, `pipeline/judged_tests.rs`, `manners.rs` and `coupon/tests.rs`.
const ELSEWHERE: &[&str] = &["E0501", "W0604", "W0605", "W0606", "W0751", "E0771", "E0772", "W0770"];
/// Annotated designs whose findings later stages make.
const FINDINGS: &str = "findings";
const ANNOTATED: [&str; 2] = ["elaborate/errors", "syntax/errors"];

fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests")
}

fn designs(folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(tests().join(folder)).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|n| n.ends_with(".mech")).collect();
    names.sort();
    names
}

/// Code, file, line, and what is pointed at; of something long its two ends.
fn told(d: &Diagnostic, sources: &SourceMap) -> String {
    let Some(at) = d.labels.first().map(|l| l.at) else { return format!("{} nowhere", d.code) };
    let file = &sources.files[at.file as usize];
    let line = file.text[..at.start as usize].matches('\n').count() + 1;
    let pointed =
        file.text[at.start as usize..at.end as usize].split_whitespace().collect::<Vec<_>>().join(" ");
    let chars: Vec<char> = pointed.chars().collect();
    let shown: String = match chars.len() {
        0..=60 => pointed,
        n => chars[..28].iter().chain(&[' ', '…', ' ']).chain(&chars[n - 28..]).collect(),
    };
    format!("{} {}:{line} `{shown}`", d.code, file.name)
}

#[test]
fn annotated_files_point_at_exact_places() {
    let mut all = String::new();
    for folder in ANNOTATED {
        for name in designs(folder) {
            all.push_str(&format!("{folder}/{name}\n"));
            let out = elaborate(&name, &Folder(tests().join(folder)), &Options::default());
            out.diagnostics.iter().for_each(|d| all.push_str(&format!("    {}\n", told(d, &out.sources))));
        }
    }
    insta::assert_snapshot!(all);
}

/// Blocks of the manual behind a fence.
fn sample(fence: &str, index: usize) -> String {
    let open = format!("```{fence}\n");
    let block = MANUAL.split(&open).nth(index + 1).unwrap();
    block[..block.find("```").unwrap()].to_string()
}

/// The manual's first design with parts put in place of others, each of which must be there.
fn changed(edits: &[(&str, &str)]) -> String {
    edits.iter().fold(sample("mech", 0), |text, (from, to)| {
        assert!(text.contains(from), "no `{from}`");
        text.replacen(from, to, 1)
    })
}

fn checked(text: &str, change: impl FnOnce(&mut Request)) -> Vec<String> {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let mut request = Request { source: "main.mech".into(), ..Request::default() };
    change(&mut request);
    let out = pipeline::check(&request, &Compiler::default(), &files);
    out.diagnostics.iter().map(|d| told(d, &out.sources)).collect()
}

fn in_file(name: &str, text: &str, found: &[Diagnostic]) -> Vec<String> {
    let mut sources = SourceMap::default();
    sources.add(name, text);
    found.iter().map(|d| told(d, &sources)).collect()
}

/// Cases that no annotated file can hold: code, and all that is found.
fn cases() -> Vec<(&'static str, Vec<String>)> {
    let plain = |text: &str| checked(text, |_| {});
    let parsed = |text: &str| in_file("main.mech", text, &flexura::syntax::parse(0, text).diagnostics);
    let lock = |text: &str| in_file("main.lock", text, &Lock::parse(text, 0).unwrap_err());
    let set = |name: &str, value: &str| {
        checked(&changed(&[]), |r| r.overrides.push((name.to_string(), value.to_string())))
    };
    let circle = {
        let one = "use \"b.mech\"\nmechanism m { }\n".to_string();
        let two = "use \"a.mech\"\nflexure f replaces hinge { }\n".to_string();
        let files = BTreeMap::from([("a.mech".to_string(), one), ("b.mech".to_string(), two)]);
        let out = elaborate("a.mech", &files, &Options::default());
        out.diagnostics.iter().map(|d| told(d, &out.sources)).collect()
    };
    let sum = format!("    let long = {}1\n    export stl", "1 + ".repeat(5000));
    let deep = format!("    let deep = {}1{}\n    export stl", "(".repeat(300), ")".repeat(300));
    let toml = "[lints]\nW1 = \"allow\"\n";
    let torn = "[lints\n";
    let header = "# flexura lock 1\n";
    vec![
        ("E0005", parsed(&"// ".repeat(400_000))),
        ("E0006", plain(&changed(&[("    export stl", &deep)]))),
        ("E0013", plain(&changed(&[("    export stl", &sum)]))),
        ("E0014", parsed(&changed(&[("    export stl", &"    pojnt = 3\n".repeat(200))]))),
        ("E0106", circle),
        ("E0115", set("r", "3 *")),
        ("E0117", checked(&changed(&[]), |r| r.variant = Some("none".into()))),
        ("E0118", plain(&changed(&[("mechanism", "allow W9999 \"none\"\nmechanism")]))),
        ("E0119", plain(&changed(&[("mechanism", "allow W1001 \"\"\nmechanism")]))),
        ("E0120", {
            let files = BTreeMap::from([("main.mech".to_string(), changed(&[]))]);
            let request =
                Request { source: "main.mech".into(), case: Some("none".into()), ..Request::default() };
            let show = pipeline::Show { rigid: true, ..pipeline::Show::default() };
            let (out, _) = pipeline::simulate(&request, show, &Compiler::default(), &files);
            out.diagnostics.iter().map(|d| told(d, &out.sources)).collect()
        }),
        (
            "E0412",
            plain(&format!(
                "{}mechanism many {{\n    for i in 0 .. 1000 {{ place a[i] = lambda at (0 mm, 0 mm) }}\n}}\n",
                changed(&[])
            )),
        ),
        ("E0500", plain(&changed(&[("to 360 deg", "to 1e9 deg")]))),
        ("E0503", plain(&changed(&[("2.5 * r", "1.25 * r")]))),
        ("E0504", plain(&changed(&[("layer -1  pin 3 mm", "layer -1  as crossed_leaves")]))),
        ("E0505", plain(&changed(&[("meet(circle(A, half), circle(D, half), left)", "A + 0.5 * (D - A)")]))),
        ("A0508", plain(&sample("mech file", 0))),
        ("E0701", lock("what is this\n")),
        ("E0702", lock(&format!("{header}<<<<<<< ours\n"))),
        ("E0703", lock(&format!("{header}r = many\n"))),
        ("E0704", lock(&format!("{header}r = 1\nr = 2\n"))),
        ("E0705", lock(header)),
        ("E0740", in_file("flexura.toml", torn, &config::parse(torn, 0).unwrap_err())),
        ("E0741", in_file("flexura.toml", toml, &config::parse(toml, 0).unwrap_err())),
        ("E0742", {
            let text = "no baseline";
            in_file("known.toml", text, &Baseline::parse(text, 0).err().unwrap())
        }),
    ]
}

#[test]
fn what_no_annotated_file_can_hold_points_at_exact_places() {
    let mut all = String::new();
    let mut missing = Vec::new();
    let built = built::cases().into_iter().map(|(code, find)| (code, find()));
    for (code, found) in cases().into_iter().chain(built) {
        let own: Vec<&String> = found.iter().filter(|f| f.starts_with(code)).collect();
        own.iter().for_each(|f| all.push_str(&format!("{f}\n")));
        if own.is_empty() {
            missing.push((code, found));
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    insta::assert_snapshot!(all);
}

#[test]
fn every_code_of_the_manual_has_a_case() {
    let mut seen: BTreeSet<String> = RULES.iter().map(|r| r.rule.code.to_string()).collect();
    let listed = [PLACELESS, OWN_FAULTS, ELSEWHERE].concat();
    seen.extend(cases().into_iter().map(|c| c.0.to_string()));
    seen.extend(built::cases().into_iter().map(|c| c.0.to_string()));
    for folder in ANNOTATED.into_iter().chain([FINDINGS]) {
        for name in designs(folder) {
            let text = std::fs::read_to_string(tests().join(folder).join(name)).unwrap();
            let codes = text.lines().filter_map(|l| l.trim().strip_prefix("//~")?.split_whitespace().next());
            seen.extend(codes.map(String::from));
        }
    }
    let missing: Vec<&str> =
        explain::codes().map(|c| c.0).filter(|c| !seen.contains(*c) && !listed.contains(c)).collect();
    assert_eq!(missing, [""; 0], "without a case");
    let needless: Vec<&&str> = listed.iter().filter(|c| seen.contains(**c)).collect();
    assert!(needless.is_empty(), "these have a case: {needless:?}");
    assert!(listed.iter().all(|c| explain::summary(c).is_some()));
}
