//! What the language server does rather than says: repairs, optimised values, and commands that take their time, spoken
//! with over the pipes of a real `flexura lsp` in a folder of its own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use lsp_server::{Message, Notification, Request, RequestId, Response};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufReader, BufWriter};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// A bar on one flexure, with an import too many, a poor rest pose, and one thing to optimise.
const DESIGN: &str = "edition 1
use std.materials.rigur
use std.processes.polyjet
use std.motors.nema17
use std.flexures.leaf
use std.flexures.wire

mechanism flap {
    point O = (0 mm, 0 mm)
    point B = (-25 mm, 0 mm)
    point P = (30 mm, 0 mm)
    ground base { B, O }
    link   arm  { O, P }
    hinge bend: base to arm at O  into base toward B  into arm toward P  as leaf { thickness = free 0.8 mm in 0.6 mm .. 1.4 mm }
    material rigur
    print on polyjet
    cycle 4 steps over 1 s
    drive bend from 0 deg to 20 deg with nema17
    trace tip = P on arm
    minimize { stress(below = 5 MPa) }
    require max(error(tip)) <= 50 mm
    export csv, report
}
";

/// An editor over the pipes of a server.
struct Editor {
    folder: tempfile::TempDir,
    child: Child,
    to: BufWriter<ChildStdin>,
    from: Receiver<Message>,
    next: i32,
    version: i32,
    found: BTreeMap<String, Value>,
    /// What the server asked and told besides answers and findings: method and parameters.
    heard: Vec<(String, Value)>,
    answers: BTreeMap<String, Result<Value, (i32, String)>>,
}

impl Editor {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let mut child = Command::new(env!("CARGO_BIN_EXE_flexura"))
            .arg("lsp")
            .env("XDG_CACHE_HOME", folder.path().join("cache"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let to = BufWriter::new(child.stdin.take().unwrap());
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let (sender, from) = channel();
        std::thread::spawn(move || {
            while let Ok(Some(message)) = Message::read(&mut out) {
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        let (found, heard, answers) = Default::default();
        let mut editor = Self { folder, child, to, from, next: 0, version: 0, found, heard, answers };
        let capabilities = json!({
            "window": { "workDoneProgress": true, "showDocument": { "support": true } },
            "workspace": { "workspaceEdit": { "documentChanges": true }, "inlayHint": { "refreshSupport": true } },
        });
        let answer = editor.ask("initialize", json!({ "capabilities": capabilities })).unwrap();
        let commands = &answer["capabilities"]["executeCommandProvider"]["commands"];
        assert_eq!(commands.as_array().unwrap().len(), 5);
        editor.tell("initialized", json!({}));
        editor
    }

    fn send(&mut self, message: Message) {
        message.write(&mut self.to).unwrap();
        std::io::Write::flush(&mut self.to).unwrap();
    }

    fn tell(&mut self, method: &str, params: Value) {
        self.send(Notification::new(method.into(), params).into());
    }

    fn post(&mut self, method: &str, params: Value) -> String {
        self.next += 1;
        let id = RequestId::from(self.next);
        self.send(Request::new(id.clone(), method.into(), params).into());
        id.to_string()
    }

    fn receive(&mut self) {
        match self.from.recv_timeout(Duration::from_secs(120)).unwrap() {
            Message::Response(r) => {
                let answer = r.response_result.map_err(|e| (e.code, e.message));
                self.answers.insert(r.id.to_string(), answer);
            }
            Message::Notification(n) if n.method == "textDocument/publishDiagnostics" => {
                self.found.insert(n.params["uri"].as_str().unwrap().into(), n.params);
            }
            Message::Notification(n) => self.heard.push((n.method, n.params)),
            Message::Request(r) => {
                self.heard.push((r.method, r.params));
                self.send(Response::new_ok(r.id, Value::Null).into());
            }
        }
    }

    fn answer(&mut self, id: &str) -> Result<Value, (i32, String)> {
        loop {
            if let Some(answer) = self.answers.remove(id) {
                return answer;
            }
            self.receive();
        }
    }

    fn ask(&mut self, method: &str, params: Value) -> Result<Value, (i32, String)> {
        let id = self.post(method, params);
        self.answer(&id)
    }

    fn uri(&self, name: &str) -> String {
        format!("file://{}", self.folder.path().canonicalize().unwrap().join(name).display())
    }

    fn open(&mut self, name: &str) {
        let text = std::fs::read_to_string(self.folder.path().join(name)).unwrap();
        self.version += 1;
        let uri = self.uri(name);
        self.tell(
            "textDocument/didOpen",
            json!({ "textDocument": { "uri": uri, "languageId": "mech", "version": self.version, "text": text } }),
        );
    }

    /// Changes the whole text, as far as the server knows.
    fn write(&mut self, name: &str, text: &str) {
        self.version += 1;
        let uri = self.uri(name);
        self.tell(
            "textDocument/didChange",
            json!({ "textDocument": { "uri": uri, "version": self.version }, "contentChanges": [{ "text": text }] }),
        );
    }

    fn save(&mut self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).unwrap();
        let uri = self.uri(name);
        self.tell("textDocument/didSave", json!({ "textDocument": { "uri": uri } }));
    }

    fn command(&mut self, command: &str, name: &str) -> Result<Value, (i32, String)> {
        let uri = self.uri(name);
        self.ask("workspace/executeCommand", json!({ "command": command, "arguments": [uri] }))
    }

    /// Waits for findings of the newest version in which `wanted` is found.
    fn until(&mut self, name: &str, wanted: impl Fn(&[String]) -> bool) -> Vec<String> {
        let uri = self.uri(name);
        loop {
            if let Some(found) = self.found.get(&uri).filter(|f| f["version"] == self.version) {
                let codes = found["diagnostics"].as_array().unwrap().iter();
                let codes: Vec<String> = codes.map(|d| d["code"].as_str().unwrap().into()).collect();
                if wanted(&codes) {
                    return codes;
                }
            }
            self.receive();
        }
    }

    fn actions(&mut self, name: &str, line: usize, only: Value) -> Vec<Value> {
        let uri = self.uri(name);
        let (from, to) = (json!({ "line": line, "character": 0 }), json!({ "line": line, "character": 200 }));
        let params = json!({
            "textDocument": { "uri": uri },
            "range": { "start": from, "end": to },
            "context": { "diagnostics": [], "only": only },
        });
        self.ask("textDocument/codeAction", params).unwrap().as_array().unwrap().clone()
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let _ = self.child.kill();
        } else {
            self.ask("shutdown", Value::Null).unwrap();
            self.tell("exit", Value::Null);
            assert!(self.child.wait().unwrap().success());
        }
    }
}

/// A text after the edits that a `WorkspaceEdit` has for it; all texts here are ASCII.
fn edited(text: &str, edit: &Value, uri: &str, version: i32) -> (String, usize) {
    let mut all: Vec<(usize, usize, String)> = Vec::new();
    for change in edit["documentChanges"].as_array().unwrap() {
        assert_eq!(
            (&change["textDocument"]["uri"], &change["textDocument"]["version"]),
            (&json!(uri), &json!(version))
        );
        for e in change["edits"].as_array().unwrap() {
            let byte = |p: &Value| {
                let line = p["line"].as_u64().unwrap() as usize;
                let start: usize = text.split_inclusive('\n').take(line).map(str::len).sum();
                start + p["character"].as_u64().unwrap() as usize
            };
            let (from, to) = (byte(&e["range"]["start"]), byte(&e["range"]["end"]));
            all.push((from, to, e["newText"].as_str().unwrap().into()));
        }
    }
    let touched = all.iter().map(|(from, to, new)| (to - from) + new.len()).sum();
    let mut text = text.to_string();
    all.sort();
    for (from, to, new) in all.into_iter().rev() {
        text.replace_range(from..to, &new);
    }
    (text, touched)
}

fn line_of(text: &str, needle: &str) -> usize {
    text[..text.find(needle).unwrap()].matches('\n').count()
}

#[test]
fn repairs_are_offered_where_the_finding_is_and_touch_nothing_else() {
    // A misspelt name, with an error elsewhere in the text.
    let broken =
        DESIGN.replace("trace tip = P on arm", "trace tip = P on armm").replace("over 1 s", "over 1 mm");
    let mut editor = Editor::new(&[("a.mech", &broken)]);
    let uri = editor.uri("a.mech");
    editor.open("a.mech");
    editor.until("a.mech", |c| c.contains(&"E0101".into()) && c.contains(&"E0201".into()));
    let line = line_of(&broken, "trace tip");
    let actions = editor.actions("a.mech", line, json!(["quickfix"]));
    assert_eq!(actions.len(), 1, "{actions:#?}");
    assert_eq!(actions[0]["title"], "Write `arm` (E0101)");
    let (mended, touched) = edited(&broken, &actions[0]["edit"], &uri, editor.version);
    assert_eq!(mended, broken.replace("armm", "arm"));
    assert_eq!(touched, 1, "one letter goes");
    assert!(editor.actions("a.mech", 1, json!(["quickfix"])).is_empty(), "nothing is wrong there");

    // Of a sound design: safe repairs alone and together, unsafe ones alone.
    editor.write("a.mech", DESIGN);
    editor.until("a.mech", |c| c.contains(&"W0101".into()) && c.contains(&"W1107".into()));
    let import = editor.actions("a.mech", line_of(DESIGN, "use std.flexures.wire"), Value::Null);
    let titles: Vec<&str> = import.iter().map(|a| a["title"].as_str().unwrap()).collect();
    assert_eq!(titles, ["Remove it (W0101)", "Make 1 safe repair"]);
    let without = DESIGN.replace("use std.flexures.wire\n", "");
    for action in &import {
        assert_eq!(edited(DESIGN, &action["edit"], &uri, editor.version).0, without);
    }
    let rest = editor.actions("a.mech", line_of(DESIGN, "drive bend"), json!(["quickfix"]));
    let rest = rest.iter().find(|a| a["title"].as_str().unwrap().ends_with("(W1107)")).unwrap();
    let better = DESIGN.replace("with nema17\n", "with nema17\n    rest bend at 10 deg\n");
    assert_eq!(edited(DESIGN, &rest["edit"], &uri, editor.version).0, better);
    let all = editor.actions("a.mech", 0, json!(["source.fixAll"]));
    assert_eq!(all.len(), 1, "asked for on saving, wherever the cursor is");
    assert_eq!(all[0]["kind"], "source.fixAll.flexura");
}

#[test]
fn a_design_is_built_shown_applied_and_rested_from_the_editor() {
    let mut editor = Editor::new(&[("flap.mech", DESIGN)]);
    let uri = editor.uri("flap.mech");
    editor.open("flap.mech");
    editor.until("flap.mech", |c| c.contains(&"W1107".into()));
    let lenses = editor.ask("textDocument/codeLens", json!({ "textDocument": { "uri": uri } })).unwrap();
    let titles = |lenses: &Value| -> Vec<String> {
        let all = lenses.as_array().unwrap().iter();
        all.map(|l| l["command"]["title"].as_str().unwrap().to_string()).collect()
    };
    assert_eq!(titles(&lenses), ["Build", "Simulate", "Show the report", "Choose the better rest pose"]);
    assert_eq!(lenses[0]["range"]["start"]["line"], line_of(DESIGN, "mechanism flap"));
    let (code, why) = editor.command("flexura.applyOptimised", "flap.mech").unwrap_err();
    assert!(code == -32803 && why.contains("no lock"), "{code} {why}");

    // What is not saved is not built.
    editor.write("flap.mech", &DESIGN.replace("30 mm", "31 mm"));
    let (code, why) = editor.command("flexura.build", "flap.mech").unwrap_err();
    assert!(code == -32803 && why.contains("not saved"), "{code} {why}");
    editor.write("flap.mech", DESIGN);

    // Built, with progress; it writes what the command writes, there where the command does.
    let built = editor.command("flexura.showReport", "flap.mech").unwrap();
    assert_eq!(built["good"], true, "{built}");
    let report = built["report"].as_str().unwrap().to_string();
    assert!(report.ends_with("/out/flap.html") && Path::new(&report).exists(), "{report}");
    let mut made: Vec<String> = std::fs::read_dir(editor.folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|n| n != "cache")
        .collect();
    made.sort();
    assert_eq!(made, ["flap.lock", "flap.mech", "out"]);
    let heard = |e: &Editor, method: &str| e.heard.iter().filter(|(m, _)| m == method).count();
    assert_eq!(heard(&editor, "window/showDocument"), 1);
    assert!(heard(&editor, "window/workDoneProgress/create") >= 1);
    let kinds: Vec<&str> = editor
        .heard
        .iter()
        .filter(|(m, p)| m == "$/progress" && p["value"]["kind"] != "begin")
        .filter_map(|(_, p)| p["value"]["message"].as_str())
        .collect();
    assert!(kinds.iter().any(|k| k.starts_with("optimising, iteration")), "{kinds:?}");
    assert!(kinds.contains(&"writing"), "{kinds:?}");
    assert_eq!(heard(&editor, "workspace/inlayHint/refresh"), 1);
    // Its findings stay in the margin until the text moves on: one of the solution is among them.
    let solved = editor.until("flap.mech", |c| c.iter().any(|c| c.starts_with("W13")));
    println!("after the build: {solved:?}");

    // The optimised value stands in the text, and nothing else has changed.
    let lenses = editor.ask("textDocument/codeLens", json!({ "textDocument": { "uri": uri } })).unwrap();
    assert!(titles(&lenses).contains(&"Apply the optimised values".to_string()), "{lenses}");
    let one = editor.actions("flap.mech", line_of(DESIGN, "hinge bend"), json!(["refactor"]));
    assert!(one[0]["title"].as_str().unwrap().starts_with("Start where it was optimised to: "), "{one:#?}");
    let applied = editor.command("flexura.applyOptimised", "flap.mech").unwrap();
    assert_eq!(applied["written"], 1, "{applied}");
    assert!(
        applied["summary"].as_str().unwrap().contains("stay in the lock"),
        "of the library's leaf: {applied}"
    );
    let (_, asked) = editor.heard.iter().rev().find(|(m, _)| m == "workspace/applyEdit").unwrap().clone();
    let (text, _) = edited(DESIGN, &asked["edit"], &uri, editor.version);
    let lock = std::fs::read_to_string(editor.folder.path().join("flap.lock")).unwrap();
    let value = lock.lines().find_map(|l| l.strip_prefix("bend.thickness = ")?.strip_suffix(" mm")).unwrap();
    let value: f64 = value.parse().unwrap();
    let start = text.split("free ").nth(1).unwrap().split(" mm").next().unwrap();
    assert!((start.parse::<f64>().unwrap() - value).abs() < 1e-4, "{start} {value}");
    assert!((value - 0.8).abs() > 1e-3, "the optimiser moved it");
    assert_eq!(text, DESIGN.replace("free 0.8 mm", &format!("free {start} mm")));
    assert_eq!(edited(DESIGN, &one[0]["edit"], &uri, editor.version).0, text);

    // A better rest pose, as an edit.
    let rested = editor.command("flexura.betterRest", "flap.mech").unwrap();
    assert_eq!(rested["summary"], "rest at 10 deg");
    let (_, asked) = editor.heard.iter().rev().find(|(m, _)| m == "workspace/applyEdit").unwrap().clone();
    let (text, _) = edited(DESIGN, &asked["edit"], &uri, editor.version);
    assert!(text.contains("\n    rest bend at 10 deg\n"));
    editor.write("flap.mech", &text);
    let (_, why) = editor.command("flexura.betterRest", "flap.mech").unwrap_err();
    assert!(why.contains("no state of the cycle"), "{why}");
    let told = editor.command("flexura.simulate", "flap.mech").unwrap();
    assert!(
        told["summary"].as_str().unwrap().contains("bend needs"),
        "simulated as it is in the editor: {told}"
    );
}

/// The lines of the solver come after a save without anything being asked, and go with the next key.
#[test]
fn the_solver_s_findings_come_after_a_save_and_go_when_the_text_moves_on() {
    // Far too thick for so far a bend: the material does not bear it.
    let poor = DESIGN
        .replace("as leaf { thickness = free 0.8 mm in 0.6 mm .. 1.4 mm }", "as leaf { thickness = 2 mm }");
    let poor = poor.replace("to 20 deg", "to 80 deg").replace("minimize { stress(below = 5 MPa) }\n", "");
    let poor = poor.replace("require max(error(tip)) <= 50 mm", "require max(stress()) <= 1 MPa");
    let mut editor = Editor::new(&[("a.mech", &poor)]);
    let build = Command::new(env!("CARGO_BIN_EXE_flexura"))
        .args(["build", "a.mech", "--iterations", "0"])
        .current_dir(editor.folder.path())
        .output()
        .unwrap();
    assert_eq!(build.status.code(), Some(1), "the requirement fails: {build:?}");
    let other = poor.replace("30 mm", "32 mm");
    std::fs::write(editor.folder.path().join("a.mech"), &other).unwrap();
    editor.open("a.mech");
    editor.until("a.mech", |c| c.contains(&"W1107".into()));
    editor.write("a.mech", &poor);
    editor.save("a.mech", &poor);
    editor.until("a.mech", |c| c.contains(&"E0801".into()));
    // The text moves on: what the solver found of the old one goes.
    editor.write("a.mech", &other);
    let codes = editor.until("a.mech", |c| c.contains(&"W1107".into()));
    assert!(!codes.contains(&"E0801".into()), "{codes:?}");
    // Taken back it is known at once, without a save.
    editor.write("a.mech", &poor);
    editor.until("a.mech", |c| c.contains(&"E0801".into()));
}

/// A build that would take minutes: while it works, questions are answered; cancelled, it leaves nothing.
#[test]
fn a_long_build_blocks_nothing_and_can_be_cancelled() {
    let long = DESIGN.replace("cycle 4 steps", "cycle 20000 steps");
    let mut editor = Editor::new(&[("a.mech", &long)]);
    let uri = editor.uri("a.mech");
    editor.open("a.mech");
    for by_token in [false, true] {
        editor.heard.clear();
        let build = json!({ "command": "flexura.build", "arguments": [uri] });
        let id = editor.post("workspace/executeCommand", build.clone());
        while !editor.heard.iter().any(|(m, p)| m == "$/progress" && p["value"]["kind"] == "report") {
            editor.receive();
        }
        let began = std::time::Instant::now();
        for _ in 0..20 {
            editor.ask("textDocument/documentSymbol", json!({ "textDocument": { "uri": uri } })).unwrap();
        }
        println!("20 answers while it builds: {:?}", began.elapsed());
        assert!(began.elapsed() < Duration::from_secs(5));
        let (_, why) = editor.ask("workspace/executeCommand", build).unwrap_err();
        assert!(why.contains("at work already"), "{why}");
        if by_token {
            let (_, begun) = editor.heard.iter().find(|(m, _)| m == "$/progress").unwrap();
            let token = begun["token"].clone();
            editor.tell("window/workDoneProgress/cancel", json!({ "token": token }));
        } else {
            editor.tell("$/cancelRequest", json!({ "id": id.parse::<i32>().unwrap() }));
        }
        assert_eq!(editor.answer(&id), Err((-32800, "cancelled".into())));
    }
    assert!(!editor.folder.path().join("a.lock").exists());
    assert!(!editor.folder.path().join("out").exists());
}
