//! Designs in version control and on build servers: `test`, `diff`, SARIF, JUnit, and the hook that the manual offers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::path::Path;
use std::process::{Command, Output};

const DESIGN: &str = include_str!("../examples/chebyshev/chebyshev.mech");
const LOCK: &str = include_str!("../examples/chebyshev/chebyshev.lock");

fn run(folder: &Path, program: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder);
    // Neither the developer's settings nor a surrounding hook's repository.
    for (name, _) in std::env::vars().filter(|(n, _)| n.starts_with("GIT_")) {
        command.env_remove(name);
    }
    let who = ["GIT_AUTHOR_NAME", "GIT_AUTHOR_EMAIL", "GIT_COMMITTER_NAME", "GIT_COMMITTER_EMAIL"];
    command.envs(who.map(|name| (name, "somebody@example.org")));
    command.env("GIT_CONFIG_GLOBAL", "/dev/null").env("GIT_CONFIG_SYSTEM", "/dev/null");
    // The hook finds the program as a user's shell would.
    let own = Path::new(env!("CARGO_BIN_EXE_flexura")).parent().unwrap().to_path_buf();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let all = std::iter::once(own).chain(std::env::split_paths(&path));
    command.env("PATH", std::env::join_paths(all).unwrap());
    command.output().unwrap()
}

fn flexura(folder: &Path, arguments: &[&str]) -> Output {
    run(folder, env!("CARGO_BIN_EXE_flexura"), arguments)
}

fn git(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, "git", arguments);
    let said = text(&output.stderr);
    assert!(output.status.success(), "git {arguments:?}: {said}");
    text(&output.stdout)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {} {}", text(&output.stdout), text(&output.stderr)))
}

/// Without git these tests say so and pass, unless `FLEXURA_EXTERNAL` demands it.
fn no_git() -> bool {
    let none = Command::new("git").arg("--version").output().is_err();
    if none {
        assert!(std::env::var_os("FLEXURA_EXTERNAL").is_none(), "FLEXURA_EXTERNAL is set: git is needed");
        eprintln!("skipped: there is no git");
    }
    none
}

/// Runs one of `tests/external`'s scripts; without its modules it says so and gives nothing.
fn asked(script: &str, module: &str, files: &[&Path]) -> Option<String> {
    let python = std::env::var("FLEXURA_PYTHON").unwrap_or_else(|_| "python3".into());
    let has = Command::new(&python).args(["-c", &format!("import {module}")]).output();
    if !has.is_ok_and(|o| o.status.success()) {
        assert!(
            std::env::var_os("FLEXURA_EXTERNAL").is_none(),
            "FLEXURA_EXTERNAL is set: {python} needs {module}"
        );
        eprintln!("skipped: {python} needs {module}");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/external").join(script);
    let output = Command::new(&python).arg(script).args(files).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    Some(text(&output.stdout))
}

/// A folder of designs: one that holds, one that fails, one without a lock, one that is no design, a part.
fn designs() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("a/good.mech", DESIGN);
    write("a/good.lock", LOCK);
    write("b.mech", &DESIGN.replace("<= 1 mm", "<= 0.0001 mm"));
    write("b.lock", LOCK);
    write("c.mech", &DESIGN.replace("length = 20 mm", "length = 21 mm"));
    write("c.lock", LOCK);
    write("material.mech", "material clay {\n    E = 1 MPa\n    nu = 0.4\n}\n");
    write(
        "whole.mech",
        "use \"part.mech\"\nmechanism whole {\n    ground g { }\n    place one = chebyshev_lambda at (0 mm, 0 mm) merging base into g\n}\n",
    );
    write("whole.lock", "no lock\n");
    write("part.mech", DESIGN);
    write(".hidden/d.mech", "nonsense");
    dir
}

#[test]
fn many_designs_are_tested_in_the_order_of_their_names() {
    let dir = designs();
    let output = flexura(dir.path(), &["test", ".", "--format", "json"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    let value = json(&output);
    let told: Vec<(&str, &str)> = value["designs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|d| (d["source"].as_str().unwrap(), d["status"].as_str().unwrap()))
        .collect();
    let expected = [
        ("./a/good.mech", "pass"),
        ("./b.mech", "fail"),
        ("./c.mech", "error"),
        ("./material.mech", "skipped"),
        ("./part.mech", "skipped"),
        ("./whole.mech", "error"),
    ];
    assert_eq!(told, expected, "{value:#}");
    let stale = &value["designs"][2]["diagnostics"][0];
    assert_eq!(stale["code"], "E0714");
    assert!(stale["help"].as_str().unwrap().contains("flexura build ./c.mech"), "{stale}");
    let failing = &value["designs"][1]["requirements"][0];
    assert_eq!(failing["pass"], false);
    // The same bytes on one thread and on two.
    for format in ["human", "json", "junit"] {
        let on = |threads| flexura(dir.path(), &["test", ".", "--threads", threads, "--format", format]);
        assert_eq!(on("1"), on("2"), "{format}");
    }
    assert_eq!(flexura(dir.path(), &["test", "a"]).status.code(), Some(0));
    // What was named is not passed over.
    for named in ["material.mech", "part.mech", "none.mech", ".hidden"] {
        assert_eq!(flexura(dir.path(), &["test", named]).status.code(), Some(1), "{named}");
    }
    assert_eq!(flexura(dir.path(), &["test"]).status.code(), Some(2));
    assert!(!dir.path().join("part.lock").exists(), "nothing is written");
}

#[test]
fn a_reader_of_junit_finds_the_same_sums() {
    let dir = designs();
    let output = flexura(dir.path(), &["test", ".", "--format", "junit"]);
    assert_eq!(output.status.code(), Some(1));
    let report = text(&output.stdout);
    let document = roxmltree::Document::parse(&report).unwrap();
    let count = |tag: &str| document.descendants().filter(|n| n.has_tag_name(tag)).count();
    assert_eq!((count("testsuite"), count("testcase")), (6, 12));
    assert_eq!((count("failure"), count("error"), count("skipped")), (1, 2, 2));
    let path = dir.path().join("report.xml");
    std::fs::write(&path, &report).unwrap();
    if let Some(sums) = asked("check_junit.py", "junitparser", &[&path]) {
        let sums: serde_json::Value = serde_json::from_str(&sums).unwrap();
        assert_eq!((&sums["suites"], &sums["cases"]), (&6.into(), &12.into()));
        assert_eq!(sums["failures"], serde_json::json!(["require max(error(tip)) <= 0.0001 mm"]));
    }
}

/// A design that is fine, one that does not parse, one with a warning in a file beside it, and one that is not there.
#[test]
fn findings_as_sarif_are_valid() {
    let dir = designs();
    std::fs::write(dir.path().join("broken.mech"), "mechanism x {\n lnik y\n").unwrap();
    let mut logs = Vec::new();
    for (source, results, code) in
        [("a/good.mech", 0, 0), ("broken.mech", 2, 1), ("material.mech", 1, 1), ("none.mech", 0, 1)]
    {
        let output = flexura(dir.path(), &["check", source, "--format", "sarif"]);
        assert_eq!(output.status.code(), Some(code), "{source}");
        let log = json(&output);
        let found = log["runs"][0]["results"].as_array().unwrap();
        let told = found.iter().filter(|r| r["level"] != "note").count();
        assert!(told >= results && (results > 0 || told == 0), "{source}: {log:#}");
        for result in found {
            let place = &result["locations"][0]["physicalLocation"];
            assert_eq!(place["artifactLocation"]["uri"], source);
            let rules = &log["runs"][0]["tool"]["driver"]["rules"];
            let rule = &rules[result["ruleIndex"].as_u64().unwrap() as usize];
            assert_eq!(rule["id"], result["ruleId"]);
            assert!(rule["shortDescription"]["text"].is_string(), "{rule}");
        }
        let path = dir.path().join(format!("{}.sarif", logs.len()));
        std::fs::write(&path, &output.stdout).unwrap();
        logs.push(path);
    }
    let build = flexura(dir.path(), &["build", "c.mech", "--frozen", "--format", "sarif"]);
    assert_eq!(json(&build)["runs"][0]["results"][0]["ruleId"], "E0710");
    for command in ["simulate", "ir", "diff"] {
        let output = flexura(dir.path(), &[command, "a/good.mech", "--format", "sarif"]);
        assert_eq!(output.status.code(), Some(2), "{command}");
    }
    asked("check_sarif.py", "jsonschema", &logs.iter().map(|p| p.as_path()).collect::<Vec<_>>());
}

#[test]
fn two_files_are_compared_by_what_they_do() {
    let dir = designs();
    let same = flexura(dir.path(), &["diff", "a/good.mech", "part.mech", "--format", "json"]);
    assert_eq!(same.status.code(), Some(0));
    // The same text, but only one of them is solved.
    assert_eq!(json(&same)["values"], serde_json::json!(["lock", "start"]));
    std::fs::write(dir.path().join("noted.mech"), format!("// A note.\n{DESIGN}")).unwrap();
    let noted = flexura(dir.path(), &["diff", "part.mech", "noted.mech"]);
    assert!(text(&noted.stdout).contains("no change of the design"), "{}", text(&noted.stdout));
    let other = json(&flexura(dir.path(), &["diff", "a/good.mech", "c.mech", "--format", "json"]));
    assert_eq!(other["unchanged"], false);
    assert_eq!(other["lines"][0]["what"], "param r");
    let rows = other["behaviour"].as_array().unwrap();
    for name in ["tip, largest error", "motor, largest torque", "largest stress", "least gap", "volume"] {
        let row = rows.iter().find(|r| r["name"] == name).unwrap_or_else(|| panic!("{name}: {other:#}"));
        assert!(row["before"].is_number() && row["after"].is_number(), "{row}");
    }
    let required = rows.iter().find(|r| r["name"] == "require max(error(tip))").unwrap();
    assert_eq!(required["holds"][0], true);
    let broken = flexura(dir.path(), &["diff", "part.mech", "none.mech"]);
    assert_eq!(broken.status.code(), Some(1));
    assert!(text(&broken.stderr).contains("E0730"));
}

/// Only the variant that does something else is told, with what it does.
#[test]
fn variants_are_compared_by_what_they_do() {
    let dir = tempfile::tempdir().unwrap();
    let with = |wide: &str| {
        let at = DESIGN.rfind("    export stl").unwrap();
        let variants = format!("    variant wide {{ r = {wide} }}\n    variant same {{ r = 21 mm }}\n\n");
        let text = format!("{}{variants}{}", &DESIGN[..at], &DESIGN[at..]);
        text.replace("cycle 60 steps", "cycle 12 steps")
    };
    for (name, wide) in [("old.mech", "22 mm"), ("new.mech", "24 mm")] {
        std::fs::write(dir.path().join(name), with(wide)).unwrap();
    }
    let found = json(&flexura(dir.path(), &["diff", "old.mech", "new.mech", "--format", "json"]));
    let variants = found["variants"].as_object().unwrap();
    assert_eq!(variants.keys().collect::<Vec<_>>(), ["wide"], "{found:#}");
    let rows = variants["wide"]["behaviour"].as_array().unwrap();
    for name in ["tip, largest error", "largest stress", "volume"] {
        let row = rows.iter().find(|r| r["name"] == name).unwrap_or_else(|| panic!("{name}: {found:#}"));
        let [before, after] = ["before", "after"].map(|side| row[side].as_f64().unwrap());
        assert!((before - after).abs() > 0.01 * before.abs(), "{row}");
    }
    let told = text(&flexura(dir.path(), &["diff", "old.mech", "new.mech"]).stdout);
    let wide = told.split("variant wide").last().unwrap();
    assert!(wide.contains("tip, largest error") && !told.contains("variant same"), "{told}");
}

/// A repository with one commit of the example.
fn repository() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    git(dir.path(), &["init", "-q", "-b", "main", "."]);
    std::fs::create_dir(dir.path().join("legs")).unwrap();
    std::fs::write(dir.path().join("legs/leg.mech"), DESIGN).unwrap();
    std::fs::write(dir.path().join("legs/leg.lock"), LOCK).unwrap();
    git(dir.path(), &["add", "."]);
    git(dir.path(), &["commit", "-q", "-m", "one"]);
    dir
}

#[test]
fn revisions_are_compared_each_with_its_own_lock() {
    if no_git() {
        return;
    }
    let dir = repository();
    let file = dir.path().join("legs/leg.mech");
    let told = |folder: &Path, versions: &[&str]| {
        let output = flexura(folder, &[&["diff", "--format", "json"], versions].concat());
        assert_eq!(output.status.code(), Some(0), "{versions:?}: {}", text(&output.stdout));
        json(&output)
    };
    assert_eq!(told(dir.path(), &["legs/leg.mech"])["unchanged"], true);
    std::fs::write(&file, DESIGN.replace("knee", "elbow")).unwrap();
    for versions in
        [&["legs/leg.mech"][..], &["HEAD", "legs/leg.mech"], &["HEAD:legs/leg.mech", "legs/leg.mech"]]
    {
        let diff = told(dir.path(), versions);
        assert_eq!(diff["names"][0]["to"], "elbow", "{versions:?}");
        assert_eq!(diff["values"], serde_json::json!(["lock", "start"]), "{versions:?}");
    }
    // From within the folder, as git itself counts paths.
    let inside = dir.path().join("legs");
    assert_eq!(told(&inside, &["HEAD", "leg.mech"])["names"][0]["to"], "elbow");
    assert_eq!(told(&inside, &["HEAD:./leg.mech", "leg.mech"])["names"][0]["to"], "elbow");
    git(dir.path(), &["commit", "-q", "-a", "-m", "two"]);
    assert_eq!(told(dir.path(), &["HEAD~1:legs/leg.mech", "HEAD:legs/leg.mech"])["names"][0]["to"], "elbow");
    for (versions, why) in [
        (["nowhere", "legs/leg.mech"], "no revision `nowhere`"),
        (["HEAD:leg.mech", "legs/leg.mech"], "does not exist"),
    ] {
        let output = flexura(dir.path(), &["diff", versions[0], versions[1]]);
        assert_eq!(output.status.code(), Some(1));
        assert!(text(&output.stderr).contains(why), "{}", text(&output.stderr));
    }
}

#[test]
fn git_calls_it_for_designs() {
    if no_git() {
        return;
    }
    let dir = repository();
    std::fs::write(dir.path().join(".gitattributes"), "*.mech diff=flexura\n").unwrap();
    git(dir.path(), &["config", "diff.flexura.command", "flexura diff"]);
    let file = dir.path().join("legs/leg.mech");
    std::fs::write(&file, format!("// A note.\n{DESIGN}")).unwrap();
    let noted = git(dir.path(), &["diff"]);
    assert!(noted.contains("no change of the design"), "{noted}");
    std::fs::write(&file, DESIGN.replace("length = 20 mm", "length = 21 mm")).unwrap();
    let changed = git(dir.path(), &["diff"]);
    assert!(changed.contains("param r") && changed.contains("largest stress"), "{changed}");
    // Between commits, the lock of the old one is found by its content.
    git(dir.path(), &["commit", "-q", "-a", "-m", "two"]);
    let between = git(dir.path(), &["diff", "HEAD~1", "HEAD"]);
    assert!(between.contains("param r") && between.contains("values of its lock"), "{between}");
    git(dir.path(), &["mv", "legs/leg.mech", "legs/other.mech"]);
    let moved = git(dir.path(), &["diff", "--cached", "-M", "HEAD"]);
    assert!(moved.contains("legs/leg.mech") && moved.contains("legs/other.mech"), "{moved}");
    std::fs::write(dir.path().join("legs/new.mech"), DESIGN).unwrap();
    git(dir.path(), &["add", "."]);
    let new = git(dir.path(), &["diff", "--cached", "--", "legs/new.mech"]);
    assert!(new.contains("does not exist") && new.contains("+ mechanism chebyshev_lambda"), "{new}");
    // Of other files as git shows them, where it asks about all.
    std::fs::write(dir.path().join("note.txt"), "a\n").unwrap();
    git(dir.path(), &["add", "."]);
    std::fs::write(dir.path().join("note.txt"), "b\n").unwrap();
    let mut all = vec!["-c", "diff.external=flexura diff"];
    all.extend(["diff", "--", "note.txt"]);
    let lines = git(dir.path(), &all);
    assert!(lines.contains("-a") && lines.contains("+b"), "{lines}");
}

#[test]
fn the_hook_lets_through_what_holds() {
    if no_git() {
        return;
    }
    let dir = repository();
    let hook = dir.path().join(".git/hooks/pre-commit");
    std::fs::create_dir_all(hook.parent().unwrap()).unwrap();
    // Copied with its permissions, as the manual has it.
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/ci/pre-commit"), &hook).unwrap();
    let file = dir.path().join("legs/leg.mech");
    let commit = || run(dir.path(), "git", &["commit", "-q", "-m", "try"]);
    // A comment, and a file that is no design.
    std::fs::write(&file, format!("// A note.\n{DESIGN}")).unwrap();
    std::fs::write(dir.path().join("other.lock"), "of another program\n").unwrap();
    git(dir.path(), &["add", "."]);
    let fine = commit();
    assert!(fine.status.success(), "{}{}", text(&fine.stdout), text(&fine.stderr));
    // What is committed counts, not what lies in the working tree.
    let changed = DESIGN.replace("length = 20 mm", "length = 21 mm");
    std::fs::write(&file, &changed).unwrap();
    git(dir.path(), &["add", "."]);
    std::fs::write(&file, DESIGN).unwrap();
    let stale = commit();
    assert!(!stale.status.success());
    assert!(text(&stale.stderr).contains("E0714") && text(&stale.stderr).contains("not committed"));
    git(dir.path(), &["reset", "-q", "--hard"]);
    // A lock that is taken away.
    git(dir.path(), &["rm", "-q", "legs/leg.lock"]);
    assert!(!commit().status.success());
    git(dir.path(), &["reset", "-q", "--hard"]);
    std::fs::write(&file, DESIGN.replace("<= 1 mm", "<= 0.0001 mm")).unwrap();
    git(dir.path(), &["add", "."]);
    assert!(!commit().status.success());
    git(dir.path(), &["commit", "-q", "--no-verify", "-m", "all the same"]);
}

#[test]
fn the_build_servers_script_leaves_its_reports() {
    if no_git() {
        return;
    }
    let ci = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/ci");
    let script = std::fs::read_to_string(ci.join("check-designs.sh")).unwrap();
    let dir = repository();
    std::fs::write(dir.path().join("legs/clay.mech"), "material clay {\n    E = 1 MPa\n    nu = 0.4\n}\n")
        .unwrap();
    git(dir.path(), &["add", "."]);
    let go = || run(dir.path(), "sh", &[ci.join("check-designs.sh").to_str().unwrap()]);
    let output = go();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report = |name: &str| std::fs::read_to_string(dir.path().join("reports").join(name)).unwrap();
    roxmltree::Document::parse(&report("flexura.xml")).unwrap();
    let log: serde_json::Value = serde_json::from_str(&report("1.sarif")).unwrap();
    assert_eq!(log["version"], "2.1.0");
    assert!(!dir.path().join("reports/2.sarif").exists(), "a material is no design");
    std::fs::write(dir.path().join("legs/leg.mech"), DESIGN.replace("half = 2.5", "half = 2.6")).unwrap();
    assert_eq!(go().status.code(), Some(1));
    // The workflow's step is the script, line by line.
    let workflow = std::fs::read_to_string(ci.join("flexura.yml")).unwrap();
    let (_, after) = workflow.split_once("        run: |\n").unwrap();
    let step = after.lines().map_while(|l| l.strip_prefix("          "));
    let lines: Vec<&str> = script.lines().filter(|l| !l.starts_with('#')).collect();
    assert_eq!(step.collect::<Vec<_>>(), lines);
}

/// A design with nothing to solve, and one variant.
#[test]
fn variants_have_locks_and_folders_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let design = "use std.materials.rigur\nuse std.processes.polyjet\nmechanism crank {\n    param r: length = 20 mm\n    \
         let slack = free 1 mm in 0.5 mm .. 2 mm\n    point O = (0 mm, 0 mm)\n    point A = (0 mm, r + slack)\n    \
         ground base { O }\n    link arm { O, A }\n    hinge axle: base to arm at O\n    material rigur\n    print on polyjet\n    \
         cycle 4 steps over 1 s\n    drive axle from 0 deg to 30 deg\n    trace tip = A on arm\n    \
         require max(error(tip)) <= 0.1 mm\n    variant large { r = 30 mm }\n}\n";
    std::fs::write(dir.path().join("crank.mech"), design).unwrap();
    let statuses = || -> Vec<(String, String)> {
        let value = json(&flexura(dir.path(), &["test", "crank.mech", "--format", "json"]));
        let of =
            |d: &serde_json::Value| (d["variant"].to_string(), d["status"].as_str().unwrap().to_string());
        value["designs"].as_array().unwrap().iter().map(of).collect()
    };
    let told = |plain: &str, large: &str| {
        [("null".to_string(), plain.to_string()), ("\"large\"".to_string(), large.to_string())]
    };
    assert_eq!(statuses(), told("error", "error"));
    let one = flexura(dir.path(), &["build", "crank.mech", "--variant", "large", "--format", "json"]);
    assert_eq!(one.status.code(), Some(0), "{}", text(&one.stdout));
    assert!(
        dir.path().join("crank.large.lock").exists() && dir.path().join("out/large/crank.manifest").exists()
    );
    assert!(!dir.path().join("crank.lock").exists());
    assert_eq!(statuses(), told("error", "pass"));
    let all = flexura(dir.path(), &["build", "crank.mech", "--all-variants", "--format", "json"]);
    assert_eq!(all.status.code(), Some(0), "{}", text(&all.stdout));
    let builds = json(&all)["builds"].clone();
    assert_eq!((&builds[0]["variant"], &builds[1]["variant"]), (&serde_json::Value::Null, &"large".into()));
    assert_eq!(statuses(), told("pass", "pass"));
    let wrong = flexura(dir.path(), &["build", "crank.mech", "--variant", "larg"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(text(&wrong.stderr).contains("E0117") && text(&wrong.stderr).contains("`large`"));
    let stale = flexura(dir.path(), &["test", "crank.mech", "--solve", "--format", "json"]);
    assert_eq!(stale.status.code(), Some(0));
}
