//! The manners of the command: formatting files, completions and pages, colour, configuration, watching.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flexura"));
    command.args(arguments).current_dir(folder);
    for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
        command.env_remove(name);
    }
    command
}

fn flexura(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

const UGLY: &str = "material  m{\nE=2 MPa // soft\n  nu = 0.3\n}\n";
const NEAT: &str = "material m {\n    E  = 2 MPa  // soft\n    nu = 0.3\n}\n";

#[test]
fn fmt_writes_what_check_shows() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(dir.path().join("parts/.hidden")).unwrap();
    for name in ["a.mech", "parts/b.mech", "parts/.hidden/c.mech", "parts/d.txt"] {
        std::fs::write(dir.path().join(name), UGLY).unwrap();
    }
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let checked = flexura(dir.path(), &["fmt", "--check", "a.mech", "parts"]);
    assert_eq!(checked.status.code(), Some(1));
    let shown = text(&checked.stdout);
    assert!(shown.contains("--- a.mech\n") && shown.contains("--- parts/b.mech\n"), "{shown}");
    assert!(shown.contains("-material  m{\n") && shown.contains("+material m {\n"), "{shown}");
    assert_eq!(read("a.mech"), UGLY, "a check writes nothing");
    let done = flexura(dir.path(), &["fmt"]);
    assert_eq!((done.status.code(), text(&done.stdout)), (Some(0), String::new()));
    assert_eq!((read("a.mech"), read("parts/b.mech")), (NEAT.into(), NEAT.into()));
    assert_eq!((read("parts/.hidden/c.mech"), read("parts/d.txt")), (UGLY.into(), UGLY.into()));
    assert_eq!(flexura(dir.path(), &["fmt", "--check", "a.mech", "parts"]).status.code(), Some(0));
    assert_eq!(flexura(dir.path(), &["fmt", "none.mech"]).status.code(), Some(1));
    assert!(text(&flexura(dir.path(), &["fmt", "none.mech"]).stderr).contains("E0730"));
}

#[test]
fn fmt_reads_the_standard_input() {
    let dir = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str], input: &[u8]| {
        let mut child = command(dir.path(), arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(input).unwrap();
        child.wait_with_output().unwrap()
    };
    let done = run(&["fmt", "-"], UGLY.as_bytes());
    assert_eq!((done.status.code(), text(&done.stdout)), (Some(0), NEAT.into()));
    assert_eq!(run(&["fmt", "--check", "-"], UGLY.as_bytes()).status.code(), Some(1));
    let broken = run(&["fmt", "-"], b"material  m{\n  E==2\n}\n");
    assert_eq!(text(&broken.stdout), "material m {\n  E==2\n}\n");
    // At the word that cannot be understood.
    let told = text(&broken.stderr);
    assert!(told.contains("W0751") && told.contains("[standard input:2:3]"), "{told}");
    let refused = run(&["fmt", "-"], &[0xff, 0xfe]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("E0730"));
}

#[test]
fn completions_and_pages_know_every_command() {
    let dir = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let made = text(&flexura(dir.path(), &["completions", shell]).stdout);
        for word in ["check", "build", "simulate", "fmt", "frozen"] {
            assert!(made.contains(word), "{shell}: {word}");
        }
    }
    let wrong = flexura(dir.path(), &["completions", "cmd"]);
    assert_eq!(wrong.status.code(), Some(2));
    let said = text(&wrong.stderr);
    assert!(said.contains("E0752") && said.contains("bash"), "{said}");

    assert!(text(&flexura(dir.path(), &["man"]).stdout).contains(".TH flexura 1"));
    assert_eq!(flexura(dir.path(), &["man", "--out", "man"]).status.code(), Some(0));
    for page in ["flexura.1", "flexura-build.1", "flexura-fmt.1"] {
        let page = std::fs::read_to_string(dir.path().join("man").join(page)).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains("color"), "{page}");
    }
    // What roff makes of it must not be empty: the shell's own check, where it is installed.
    if let Ok(output) = Command::new("mandoc")
        .args(["-T", "lint", "-W", "error", "man/flexura.1"])
        .current_dir(dir.path())
        .output()
    {
        assert!(output.status.success(), "{}", text(&output.stdout));
    }
}

#[test]
fn help_has_examples_and_exit_codes() {
    let dir = tempfile::tempdir().unwrap();
    let help = text(&flexura(dir.path(), &["--help"]).stdout);
    assert!(help.contains("Exit codes:") && help.contains("130"), "{help}");
    for name in ["check", "build", "simulate", "ir", "fmt", "completions", "man"] {
        let help = text(&flexura(dir.path(), &[name, "--help"]).stdout);
        assert!(help.contains("Examples:") && help.contains(&format!("flexura {name}")), "{name}: {help}");
        assert!(help.lines().all(|l| l.chars().count() <= 120), "{name}");
    }
}

#[test]
fn wrong_usage_is_a_finding_with_a_next_action() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, reason, action) in [
        (&["build", "a.mech", "--outt", "x"][..], "--outt", "--out"),
        (&["chekc", "a.mech"], "chekc", "check"),
        (&["build", "a.mech", "--set", "r"], "NAME=VALUE", "--help"),
        (&["build", "a.mech", "--quiet", "--verbose"], "--quiet", "Usage"),
    ] {
        let output = flexura(dir.path(), arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("E0752") && said.contains(reason) && said.contains("help:"), "{said}");
        assert!(said.split("help:").nth(1).unwrap().contains(action), "{said}");
    }
}

#[test]
fn colour_is_as_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let coloured = |flag: Option<&str>, variables: &[(&str, &str)]| {
        let mut run = command(dir.path(), &["check", "none.mech"]);
        run.args(flag.map(|f| format!("--color={f}"))).envs(variables.iter().copied());
        text(&run.output().unwrap().stderr).contains('\x1b')
    };
    assert!(!coloured(None, &[]) && !coloured(Some("never"), &[("CLICOLOR_FORCE", "1")]));
    assert!(coloured(Some("always"), &[("NO_COLOR", "1")]) && coloured(None, &[("CLICOLOR_FORCE", "1")]));
}

/// A design that `check` likes, and one that it does not.
fn design(ok: bool) -> String {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/chebyshev/chebyshev.mech");
    let text = std::fs::read_to_string(example).unwrap();
    if ok { text } else { text.replace("export stl", "export slt") }
}

#[test]
fn quiet_says_errors_only_and_verbose_what_was_read() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.mech"), design(true)).unwrap();
    let quiet = flexura(dir.path(), &["check", "a.mech", "-q"]);
    assert_eq!((text(&quiet.stdout), text(&quiet.stderr)), (String::new(), String::new()));
    let verbose = text(&flexura(dir.path(), &["check", "a.mech", "-v"]).stderr);
    assert!(
        verbose.contains("read ") && verbose.contains("a.mech") && verbose.contains("took "),
        "{verbose}"
    );
    std::fs::write(dir.path().join("a.mech"), design(false)).unwrap();
    assert!(text(&flexura(dir.path(), &["check", "a.mech", "-q"]).stderr).contains("E0110"));
}

#[test]
fn a_configuration_gives_defaults_and_its_mistakes_have_places() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.mech"), design(true)).unwrap();
    std::fs::create_dir_all(dir.path().join("sub")).unwrap();
    let config = |text: &str| std::fs::write(dir.path().join("flexura.toml"), text).unwrap();
    // No iteration, five steps: the lock of a trial goes into the folder that is configured.
    config("[build]\nout = \"made\"\niterations = 0\n\n[lints]\nall = \"warn\"\n");
    let run = |more: &[&str]| {
        let mut arguments = vec!["build", "../a.mech", "--steps", "5", "--format", "json"];
        arguments.extend(more);
        flexura(&dir.path().join("sub"), &arguments)
    };
    let built = run(&[]);
    let report: serde_json::Value = serde_json::from_slice(&built.stdout).unwrap();
    assert_eq!(report["iterations"], 0, "{report:#}");
    assert!(dir.path().join("made/a.lock").exists());
    run(&["--out", "here"]);
    assert!(dir.path().join("sub/here/a.lock").exists(), "what is said counts more");

    for (text, place) in [
        ("[build]\nout = 3\n", 2),
        ("[build]\niterations = -1\n", 2),
        ("[build]\noptimiser = \"lm\"\n", 2),
        ("[build]\noptimizer = \"newton\"\n", 2),
        ("[bild]\n", 1),
        ("[build\n", 1),
    ] {
        config(text);
        let output = flexura(dir.path(), &["check", "a.mech", "--format", "json"]);
        assert_eq!(output.status.code(), Some(1), "{text}");
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let found = &value["diagnostics"][0];
        assert_eq!(
            (&found["code"], &found["labels"][0]["start"]["line"]),
            (&"E0740".into(), &place.into()),
            "{text}"
        );
        assert!(found["help"].as_str().is_some_and(|h| h.contains("[build]")));
    }
}

/// A command that watches; its words come line by line.
struct Watching {
    child: Child,
    lines: Receiver<String>,
}

impl Watching {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child =
            command(folder, arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (sender, lines) = channel();
        let streams: [Box<dyn std::io::Read + Send>; 2] =
            [Box::new(child.stdout.take().unwrap()), Box::new(child.stderr.take().unwrap())];
        for stream in streams {
            let sender = sender.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(stream).lines().map_while(Result::ok) {
                    let _ = sender.send(line);
                }
            });
        }
        Self { child, lines }
    }

    /// Waits until a line holds this.
    fn until(&self, wanted: &str) {
        let mut said = Vec::new();
        loop {
            match self.lines.recv_timeout(Duration::from_secs(60)) {
                Ok(line) if line.contains(wanted) => return,
                Ok(line) => said.push(line),
                Err(e) => panic!("waiting for {wanted:?}: {e}: {said:#?}"),
            }
        }
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn watching_survives_broken_files_and_sees_imports_and_configuration() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let importing = format!("use \"parts/own.mech\"\n{}", design(true).replace("edition 1\n", ""))
        .replace("material rigur", "material own");
    let own = "material own {\n    E  = 2000 MPa\n    nu = 0.4\n    strength = 40 MPa\n}\n";
    write("a.mech", &importing);
    let watching = Watching::start(dir.path(), &["check", "a.mech", "--watch"]);
    // The import does not exist yet, not even its folder.
    watching.until("E0107");
    watching.until("watching");
    std::fs::create_dir(dir.path().join("parts")).unwrap();
    write("parts/own.mech", own);
    watching.until("own.mech has changed");
    watching.until("watching");
    write("parts/own.mech", "material own {\n");
    watching.until("E0003");
    watching.until("watching");
    write("parts/own.mech", own);
    watching.until("watching");
    // As editors do it: a new file takes the place of the old one.
    write("b.tmp", &importing.replace("export stl", "export slt"));
    std::fs::rename(dir.path().join("b.tmp"), dir.path().join("a.mech")).unwrap();
    watching.until("E0110");
    watching.until("watching");
    std::fs::remove_file(dir.path().join("a.mech")).unwrap();
    watching.until("E0730");
    watching.until("watching");
    write("a.mech", &importing);
    watching.until("a.mech has changed");
    watching.until("watching");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_watching() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.mech"), design(false)).unwrap();
    for name in ["check", "build"] {
        let mut watching = Watching::start(dir.path(), &[name, "a.mech", "--watch"]);
        watching.until("watching");
        let id = watching.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        let ended = (0..200).any(|_| {
            std::thread::sleep(Duration::from_millis(50));
            watching.child.try_wait().unwrap().is_some()
        });
        assert!(ended, "{name} --watch goes on");
    }
}
