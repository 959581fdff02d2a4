//! The language server as an editor sees it: every answer on designs with imports and with errors, and the same answers
//! after thousands of keystrokes as after a fresh start.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
#[path = "common/keys.rs"]
mod keys;

use common::skipped;
use flexura::elaborate::{FileError, Options, elaborate, std_source};
use flexura::emit::lock::Lock;
use flexura::lsp::server::{Connection, serve};
use flexura::lsp::{Host, Work, apply, complete, edits, outline, signature, space};
use flexura::syntax::starting_words;
use flexura::syntax::tree::Kind;
use lsp_server::{Message, Notification, Request, RequestId};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Files in memory, below `/d`.
struct Memory(BTreeMap<String, String>);

impl Host for Memory {
    fn read(&self, folder: &str, path: &str) -> Result<String, FileError> {
        self.0.get(&format!("{folder}/{path}")).cloned().ok_or(FileError::NotFound)
    }
    fn list(&self, folder: &str) -> Vec<String> {
        self.0.keys().filter(|p| p.starts_with(folder) && p.ends_with(".mech")).cloned().collect()
    }
    fn library(&self, module: &str) -> Option<String> {
        std_source(module).map(|_| format!("/std/{module}"))
    }
    fn start(&self, _: &str, _: &[String], _: String) -> Result<Arc<dyn Work>, String> {
        Err("nothing is solved here".into())
    }
}

fn example(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(path)).unwrap()
}

/// An editor with a server of its own.
struct Editor {
    connection: Connection,
    server: Option<JoinHandle<()>>,
    next: i32,
    version: i32,
    /// The newest findings by address.
    found: BTreeMap<String, (i64, Value)>,
}

impl Editor {
    fn new(files: &[(&str, &str)]) -> Self {
        let (server, connection) = Connection::memory();
        let host = Memory(files.iter().map(|(p, t)| (format!("/d/{p}"), t.to_string())).collect());
        let server = std::thread::spawn(move || serve(server, Box::new(host)).unwrap());
        let mut editor =
            Self { connection, server: Some(server), next: 0, version: 0, found: BTreeMap::new() };
        let answer = editor.ask("initialize", json!({ "capabilities": {} })).unwrap();
        assert_eq!(answer["capabilities"]["textDocumentSync"]["change"], 2, "incremental");
        editor.tell("initialized", json!({}));
        editor
    }

    fn tell(&self, method: &str, params: Value) {
        self.connection.sender.send(Notification::new(method.into(), params).into()).unwrap();
    }

    fn post(&mut self, method: &str, params: Value) -> i32 {
        self.next += 1;
        let request = Request::new(RequestId::from(self.next), method.into(), params);
        self.connection.sender.send(request.into()).unwrap();
        self.next
    }

    fn receive(&mut self) -> Option<(RequestId, Result<Value, i32>)> {
        let message = self.connection.receiver.recv_timeout(Duration::from_secs(60)).unwrap();
        self.take(message)
    }

    /// What comes by itself.
    fn wait_a_little(&mut self) {
        if let Ok(message) = self.connection.receiver.recv_timeout(Duration::from_millis(50)) {
            assert!(self.take(message).is_none());
        }
    }

    fn take(&mut self, message: Message) -> Option<(RequestId, Result<Value, i32>)> {
        match message {
            Message::Response(r) => {
                let answer = r.response_result.map_err(|e| e.code);
                Some((r.id, answer))
            }
            Message::Notification(n) => {
                let uri = n.params["uri"].as_str().unwrap().to_string();
                let version = n.params["version"].as_i64().unwrap_or(-1);
                self.found.insert(uri, (version, n.params["diagnostics"].clone()));
                None
            }
            Message::Request(r) => panic!("{r:?}"),
        }
    }

    fn ask(&mut self, method: &str, params: Value) -> Result<Value, i32> {
        let id = RequestId::from(self.post(method, params));
        loop {
            if let Some((got, answer)) = self.receive() {
                assert_eq!(got, id);
                return answer;
            }
        }
    }

    fn open(&mut self, name: &str, text: &str) {
        self.version += 1;
        self.tell(
            "textDocument/didOpen",
            json!({ "textDocument": { "uri": uri(name), "languageId": "mech", "version": self.version, "text": text } }),
        );
    }

    /// Replaces a range of lines and UTF-16 columns.
    fn change(&mut self, name: &str, range: [u32; 4], text: &str) {
        self.version += 1;
        let [l1, c1, l2, c2] = range;
        let range =
            json!({ "start": { "line": l1, "character": c1 }, "end": { "line": l2, "character": c2 } });
        self.tell(
            "textDocument/didChange",
            json!({
                "textDocument": { "uri": uri(name), "version": self.version },
                "contentChanges": [{ "range": range, "text": text }],
            }),
        );
    }

    /// Asks at the end of a needle in a text.
    fn at(&mut self, method: &str, name: &str, text: &str, needle: &str, more: Value) -> Value {
        let end = text.find(needle).unwrap_or_else(|| panic!("no {needle:?}")) + needle.len();
        let line = text[..end].matches('\n').count();
        let column = text[..end].rsplit('\n').next().unwrap().encode_utf16().count();
        let mut params = json!({ "textDocument": { "uri": uri(name) }, "position": { "line": line, "character": column } });
        params.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.ask(method, params).unwrap_or_else(|code| panic!("{method} at {needle:?}: {code}"))
    }

    /// Findings of the newest version, once they have come: of the text alone, then with the mechanism's.
    fn findings(&mut self, name: &str) -> Value {
        while self.found.get(&uri(name)).is_none_or(|(v, _)| *v != i64::from(self.version)) {
            self.receive();
        }
        self.found[&uri(name)].1.clone()
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.ask("shutdown", Value::Null).unwrap();
            self.tell("exit", Value::Null);
            self.server.take().unwrap().join().unwrap();
        }
    }
}

fn uri(name: &str) -> String {
    format!("file:///d/{name}")
}

/// The text a location leads to.
fn there<'a>(location: &Value, text: &'a str) -> &'a str {
    let byte = |p: &Value| {
        let line = p["line"].as_u64().unwrap() as usize;
        let start: usize = text.split_inclusive('\n').take(line).map(str::len).sum();
        start + p["character"].as_u64().unwrap() as usize
    };
    &text[byte(&location["range"]["start"])..byte(&location["range"]["end"])]
}

#[test]
fn a_design_with_imports_is_understood_throughout() {
    let (finger, hand) = (example("hand/finger.mech"), example("hand/hand.mech"));
    let mut editor = Editor::new(&[("finger.mech", &finger), ("hand.mech", &hand)]);
    editor.open("finger.mech", &finger);

    // Hover: value, unit and documentation; of the library too; units, functions and keywords.
    let hover = |e: &mut Editor, needle: &str| {
        let answer = e.at("textDocument/hover", "finger.mech", &finger, needle, json!({}));
        answer["contents"]["value"].as_str().unwrap_or("").to_string()
    };
    let said = hover(&mut editor, "point P1 = (0 mm, 40 mm * s");
    assert!(said.contains("param s = 2") && said.contains("Size of everything"), "{said}");
    assert!(hover(&mut editor, "point P1").contains("(0 mm, 80 mm, 0 mm)"));
    let said = hover(&mut editor, "<= rigur");
    assert!(said.contains("material rigur") && said.contains("std/materials/rigur.mech"), "{said}");
    assert!(hover(&mut editor, "param bound: stress = 24 MPa").contains("stress"));
    assert!(hover(&mut editor, "max(error").contains("error(TRACE"));
    assert!(hover(&mut editor, "cycle").contains("cycle NUMBER steps"));

    // Definitions: in the file, in an imported one, in the library, of overrides and of what an instance has.
    let go = |e: &mut Editor, name: &str, text: &str, needle: &str| {
        e.at("textDocument/definition", name, text, needle, json!({}))
    };
    let place = go(&mut editor, "finger.mech", &finger, "mcp:   palm");
    assert_eq!(there(&place, &finger), "palm");
    let place = go(&mut editor, "finger.mech", &finger, "as crossed_leaves");
    assert_eq!(place["uri"], "file:///std/flexures/crossed_leaves.mech");
    assert_eq!(there(&place, std_source("flexures/crossed_leaves.mech").unwrap()), "crossed_leaves");
    let place = go(&mut editor, "finger.mech", &finger, "as crossed_leaves { size");
    assert_eq!(there(&place, std_source("flexures/crossed_leaves.mech").unwrap()), "size");
    editor.open("hand.mech", &hand);
    let place = go(&mut editor, "hand.mech", &hand, "place index  = finger");
    assert_eq!((&place["uri"], there(&place, &finger)), (&json!(uri("finger.mech")), "finger"));
    let place = go(&mut editor, "hand.mech", &hand, "span(index.curl");
    assert_eq!((&place["uri"], there(&place, &finger)), (&json!(uri("finger.mech")), "curl"));
    let place = go(&mut editor, "hand.mech", &hand, "merging palm");
    assert_eq!(there(&place, &finger), "palm");
    let place = go(&mut editor, "hand.mech", &hand, "use \"fing");
    assert_eq!(place["uri"], uri("finger.mech"));

    // References and renaming, across files.
    let places = editor.at(
        "textDocument/references",
        "finger.mech",
        &finger,
        "output curl",
        json!({ "context": { "includeDeclaration": true } }),
    );
    let places: Vec<&str> = places.as_array().unwrap().iter().map(|l| l["uri"].as_str().unwrap()).collect();
    assert_eq!(places, [uri("finger.mech"), uri("hand.mech")]);
    let renamed =
        editor.at("textDocument/rename", "hand.mech", &hand, "merging palm", json!({ "newName": "wrist" }));
    let code = |line: &str| line.split("//").next().unwrap().matches("palm").count();
    let written: usize = finger.lines().map(code).sum();
    let edits = |name: &str| renamed["changes"][uri(name)].as_array().unwrap().len();
    assert_eq!((edits("finger.mech"), edits("hand.mech")), (written, 5), "not in comments");
    let taken = editor.ask(
        "textDocument/rename",
        json!({ "textDocument": { "uri": uri("hand.mech") }, "position": { "line": 4, "character": 12 }, "newName": "finger" }),
    );
    assert_eq!(taken, Err(lsp_server::ErrorCode::RequestFailed as i32));

    // Outline, folding, tokens, hints.
    let ask = |e: &mut Editor, method: &str, name: &str| {
        e.ask(method, json!({ "textDocument": { "uri": uri(name) } })).unwrap()
    };
    let outline = ask(&mut editor, "textDocument/documentSymbol", "finger.mech");
    let names: Vec<&str> = outline.as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["layered_polyjet", "finger"]);
    let inner = outline[1]["children"].as_array().unwrap();
    assert!(inner.iter().any(|s| s["name"] == "guide" && s["detail"] == "joint"), "{inner:?}");
    let folds = ask(&mut editor, "textDocument/foldingRange", "finger.mech");
    assert!(folds.as_array().unwrap().len() >= 4, "{folds}");
    let tokens = ask(&mut editor, "textDocument/semanticTokens/full", "finger.mech");
    assert!(tokens["data"].as_array().unwrap().len() > 5 * 400);
    let hints = ask(&mut editor, "textDocument/inlayHint", "finger.mech");
    let at = finger[..finger.find("point P1").unwrap()].matches('\n').count();
    let hint = hints.as_array().unwrap().iter().find(|h| h["position"]["line"] == at).unwrap();
    assert_eq!(hint["label"], "= (0 mm, 80 mm, 0 mm)");
    assert_eq!(ask(&mut editor, "textDocument/formatting", "finger.mech"), json!([]), "it has its look");
    assert_eq!(editor.findings("hand.mech"), json!([]));
}

#[test]
fn optimised_values_stand_beside_each_free() {
    let (text, lock) = (example("jansen/jansen.mech"), example("jansen/jansen.lock"));
    let mut editor = Editor::new(&[("jansen.mech", &text), ("jansen.lock", &lock)]);
    editor.open("jansen.mech", &text);
    let hints = editor
        .ask("textDocument/inlayHint", json!({ "textDocument": { "uri": uri("jansen.mech") } }))
        .unwrap();
    let line = text[..text.find("rest  motor").unwrap()].matches('\n').count();
    let hint = hints.as_array().unwrap().iter().find(|h| h["position"]["line"] == line).unwrap();
    let shown = hint["label"].as_str().unwrap();
    let rest = lock.lines().find(|l| l.starts_with("motor") && l.ends_with("rad")).unwrap();
    let value: f64 = rest.split([' ', '=']).find_map(|w| w.parse().ok()).unwrap();
    let wanted = value.to_degrees();
    let got: f64 = shown.trim_start_matches("→ ").trim_end_matches(" deg").parse().unwrap();
    assert!((got - wanted).abs() < 0.01, "{shown}: {rest}");
    // A lock of another design says nothing.
    let line = text[..text.find("param u: length").unwrap()].matches('\n').count() as u32;
    editor.change("jansen.mech", [line, 0, line + 1, 0], "    param u: length = 1.3 mm\n");
    let hints = editor
        .ask("textDocument/inlayHint", json!({ "textDocument": { "uri": uri("jansen.mech") } }))
        .unwrap();
    assert!(
        hints.as_array().unwrap().iter().all(|h| !h["label"].as_str().unwrap().starts_with('→')),
        "{hints}"
    );
}

/// The text with all replacements of one file made.
fn replaced(text: &str, edits: &[(std::ops::Range<usize>, String)]) -> String {
    let mut text = text.to_string();
    for (at, new) in edits.iter().rev() {
        text.replace_range(at.clone(), new);
    }
    text
}

#[test]
fn optimised_values_are_written_into_the_text_where_it_has_a_place_for_them() {
    // What six hinges share is written where all of them came to the same, such as a bound.
    for (name, written) in [("jansen/jansen", 10), ("chebyshev/chebyshev", 1), ("hand/finger", 9)] {
        let (text, lock) = (example(&format!("{name}.mech")), example(&format!("{name}.lock")));
        let files = BTreeMap::from([("a.mech".to_string(), text.clone())]);
        let applied = apply::optimised("a.mech", &files, Some(&lock), None).unwrap();
        println!("{name}: {}", applied.told());
        assert_eq!(applied.count() + applied.there, written, "{name}: {applied:?}");
        let new = replaced(&text, &applied.edits["a.mech"]);
        // Nothing but start values has changed, and they are the optimised ones.
        let starts = |text: &str| {
            let files = BTreeMap::from([("a.mech".to_string(), text.to_string())]);
            let out = elaborate("a.mech", &files, &Options::default());
            assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:?}", out.diagnostics);
            out.assembly.unwrap().designs.remove(0).free
        };
        let lock = Lock::parse(&lock, 0).unwrap();
        let mut moved = 0;
        for (old, new) in starts(&text).iter().zip(starts(&new)) {
            let wanted = lock.solution.values[&new.path];
            moved += usize::from(old.start != new.start);
            assert!(
                old.start == new.start || (new.start - wanted).abs() < 1e-4 * wanted.abs(),
                "{}",
                new.path
            );
            assert_eq!((&old.path, old.lower, old.upper), (&new.path, new.lower, new.upper));
        }
        assert!(moved >= applied.count(), "{moved}");
        // Whoever applies them twice has nothing to write, once the design is built again.
        let again = BTreeMap::from([("a.mech".to_string(), new)]);
        let stale = apply::optimised("a.mech", &again, Some(&lock.write()), None);
        assert!(stale.unwrap_err().contains("build it first"));
    }
    let (text, lock) = (example("jansen/jansen.mech"), example("jansen/jansen.lock"));
    let files = BTreeMap::from([("a.mech".to_string(), text.replace("mm", "mmm"))]);
    assert!(apply::optimised("a.mech", &files, Some(&lock), None).unwrap_err().contains("errors"));
}

/// A design with a broken statement, an unknown name and a wrong dimension.
fn broken() -> String {
    example("chebyshev/chebyshev.mech")
        .replace("point O = (0 mm, 0 mm)", "point O = (0 mm, 0 mm")
        .replace("cycle 60 steps over 2 s", "cycle 60 steps over 2 mm")
        .replace("trace tip = P on coupler", "trace tip = P on couplerr")
}

#[test]
fn a_design_with_errors_is_helped_with() {
    let text = broken();
    let mut editor = Editor::new(&[("a.mech", &text)]);
    editor.open("a.mech", &text);
    let found = editor.findings("a.mech");
    let codes: Vec<&str> = found.as_array().unwrap().iter().map(|d| d["code"].as_str().unwrap()).collect();
    assert!(codes.contains(&"E0001") && codes.contains(&"E0201"), "{found:#}");
    let line = text[..text.find("point O").unwrap()].matches('\n').count();
    assert!(found.as_array().unwrap().iter().any(|d| d["range"]["start"]["line"] == line), "{found:#}");

    // What stands around the mistakes is known as before.
    let place = editor.at("textDocument/definition", "a.mech", &text, "hinge knee:  coupler", json!({}));
    assert_eq!(there(&place, &text), "coupler");
    let hover = editor.at("textDocument/hover", "a.mech", &text, "let   half = 2.5 * r", json!({}));
    assert!(hover["contents"]["value"].as_str().unwrap().contains("20 mm"), "{hover}");
    // Only lines that are not as they should be are touched.
    let ugly = text.replace("    material rigur\n", "  material   rigur\n");
    let lines = ugly.matches('\n').count() as u32;
    editor.change("a.mech", [0, 0, lines, 0], &ugly);
    let edits =
        editor.ask("textDocument/formatting", json!({ "textDocument": { "uri": uri("a.mech") } })).unwrap();
    assert_eq!(edits.as_array().unwrap().len(), 1, "{edits}");
    assert_eq!(edits[0]["newText"], "    material rigur\n");

    // Mended, nothing is left to say.
    let good = example("chebyshev/chebyshev.mech");
    editor.change("a.mech", [0, 0, 9999, 0], &good);
    assert_eq!(editor.findings("a.mech"), json!([]));
}

#[test]
fn a_mistake_in_an_import_stands_at_the_import() {
    let parts = "material own {\n    E = 2000 mm\n    nu = 0.4\n}\n";
    let text =
        format!("use \"parts.mech\"\n{}", example("chebyshev/chebyshev.mech").replace("edition 1\n", ""))
            .replace("material rigur", "material own");
    let mut editor = Editor::new(&[("parts.mech", parts), ("a.mech", &text)]);
    editor.open("a.mech", &text);
    let found = editor.findings("a.mech");
    let of = found
        .as_array()
        .unwrap()
        .iter()
        .find(|d| d["message"].as_str().unwrap().starts_with("in `parts.mech`"));
    let of = of.unwrap_or_else(|| panic!("{found:#}"));
    assert_eq!(of["range"]["start"]["line"], 0);
    assert_eq!(of["relatedInformation"][0]["location"]["uri"], uri("parts.mech"));
    // A file of parts need not be a design, and what is typed into it counts at once.
    editor.open("parts.mech", parts);
    let own = editor.findings("parts.mech");
    assert!(own.as_array().unwrap().iter().all(|d| d["code"] != "E0401"), "{own:#}");
    editor.change("parts.mech", [1, 13, 1, 15], "MPa");
    while editor.found[&uri("a.mech")]
        .1
        .as_array()
        .unwrap()
        .iter()
        .any(|d| d["message"].as_str().unwrap().starts_with("in `parts"))
    {
        editor.receive();
    }
}

/// A place is marked by `|`.
fn proposed(text: &str) -> Vec<String> {
    let at = text.find('|').unwrap();
    let text = text.replacen('|', "", 1);
    let files = BTreeMap::from([
        ("a.mech".to_string(), text),
        ("b.mech".to_string(), "mechanism leg {\n    point Q = (0 mm, 0 mm)\n}\n".to_string()),
    ]);
    let space = space::Space::read("a.mech", &files);
    complete::complete(&space, "a.mech", at, &["b.mech".into()]).into_iter().map(|p| p.label).collect()
}

#[test]
fn what_is_proposed_fits_the_place() {
    let inside = |line: &str| {
        format!(
            "use std.materials.rigur\nuse std.flexures.leaf\nuse std.motors.nema17\nuse std.processes.polyjet\nuse \"b.mech\"\n\
             mechanism m {{\n    param r: length = 2 mm\n    point P = (0 mm, r)\n    ground base {{ P }}\n    link arm {{ P }}\n    \
             hinge knee: base to arm at P  as leaf\n    place one = leg at P\n    {line}\n}}\n"
        )
    };
    for (line, with, without) in [
        (
            "|",
            &["hinge", "minimize", "param", "for", "variant", "case", "workspace"][..],
            &["rod", "spring"][..],
        ),
        ("case push {\n        |\n    }", &["load", "minimize", "require"], &["hinge", "for"]),
        ("for i in 0 .. 2 {\n        |\n    }", &["place", "export"], &["load"]),
        ("export |", &["stl", "3mf", "glb", "ros2", "report"], &["step"]),
        ("hinge h: |", &["base", "arm"], &["P", "r"]),
        ("hinge h: base to |", &["base", "arm"], &["P"]),
        ("hinge h: base to arm at P as |", &["leaf"], &["rigur", "m"]),
        ("hinge h: base to arm at P as leaf { |", &["size", "thickness"], &["r"]),
        ("hinge h: base to arm at P as leaf { size = |", &["r", "sqrt", "free"], &["thickness"]),
        ("link k { |", &["P"], &["base"]),
        ("material |", &["rigur"], &["leaf"]),
        ("print on |", &["polyjet"], &["rigur"]),
        ("drive knee from 0 deg to 1 deg with |", &["nema17"], &["rigur"]),
        ("drive |", &["knee"], &["base"]),
        ("let x = 3 |", &["mm", "deg", "N"], &["r"]),
        ("let x = r + |", &["r", "P", "polar", "rigur"], &["mm"]),
        ("require max(stress()) <= rigur.|", &["strength", "E"], &["r"]),
        ("require max(x(one.|", &["Q"], &["r"]),
        ("hinge h: base to arm at P axis |", &["x", "y", "z"], &["base"]),
        ("place two = |", &["leg", "m"], &["rigur"]),
        ("// a |", &[], &["hinge"]),
    ] {
        let got = proposed(&inside(line));
        for label in with {
            assert!(got.iter().any(|g| g == label), "{line}: no {label} in {got:?}");
        }
        for label in without {
            assert!(!got.iter().any(|g| g == label), "{line}: {label} in {got:?}");
        }
    }
    let folders = proposed("use std.|");
    assert!(
        ["flexures", "materials", "motors", "processes"].iter().all(|f| folders
            .iter()
            .filter(|g| g == f)
            .count()
            == 1)
    );
    assert!(proposed("use std.materials.|").contains(&"petg".to_string()));
    assert!(proposed("use |").contains(&"\"b.mech\"".to_string()));
    assert!(proposed("use \"|").contains(&"b.mech".to_string()));
    assert!(proposed("|").contains(&"mechanism".to_string()));
    assert!(proposed("flexure f replaces |").contains(&"ball".to_string()));
}

#[test]
fn the_parameter_in_hand_is_known() {
    for (text, label, active) in [
        ("let a = polar(|", "polar(r, φ)", 0),
        ("let a = polar(max(1, 2), |", "polar(r, φ)", 1),
        ("let a = polar(max(1, |", "max(a, b, …)", 1),
        (
            "track(tip, scale = 1 mm, |",
            "track(TRACE, scale = LENGTH, form = closest, emphasis = EXPRESSION)",
            2,
        ),
    ] {
        let found = signature::signature(&text.replace('|', ""), text.find('|').unwrap()).unwrap();
        assert_eq!((found.label.as_str(), found.active), (label, active), "{text}");
    }
    assert_eq!(signature::signature("let a = (1, 2", 13), None);
    assert_eq!(signature::signature("let ü(1", 8), None);
}

#[test]
fn edits_turn_one_text_into_the_other() {
    for (old, new) in
        [("a\nb\nc\n", "a\nB\nc\n"), ("", "x\n"), ("a\n", ""), ("a\nb\n", "b\nx\n"), ("a", "a\n")]
    {
        let mut text = old.to_string();
        for (range, with) in edits::difference(old, new).into_iter().rev() {
            text.replace_range(range, &with);
        }
        assert_eq!(text, new);
    }
}

#[test]
fn folds_are_blocks_and_runs() {
    let text = space::Text::new(
        "// a\n// b\n\nuse \"x.mech\"\nuse \"y.mech\"\nmechanism m {\n    minimize {\n    }\n}\n".into(),
    );
    let folds: Vec<_> = outline::folds(&text).into_iter().map(|(r, c)| (text.text[r].len(), c)).collect();
    assert_eq!(folds, [(9, true), (25, false), (36, false), (16, false)]);
}

#[test]
fn what_has_moved_on_or_was_cancelled_is_not_answered() {
    let text = example("chebyshev/chebyshev.mech");
    let mut editor = Editor::new(&[("a.mech", &text)]);
    editor.open("a.mech", &text);
    editor.findings("a.mech");
    // So many at once that those behind wait together while the first are worked on.
    let params = json!({ "textDocument": { "uri": uri("a.mech") } });
    let mut answers = BTreeMap::new();
    let mut refused = 0;
    for round in 0..50 {
        let first = editor.post("textDocument/semanticTokens/full", params.clone());
        let second = editor.post("textDocument/documentSymbol", params.clone());
        editor.tell("$/cancelRequest", json!({ "id": second }));
        editor.change("a.mech", [0, 0, 0, 0], if round % 2 == 0 { "// x\n" } else { "" });
        for _ in 0..2 {
            let (id, answer) = loop {
                if let Some(answer) = editor.receive() {
                    break answer;
                }
            };
            if let Err(code) = answer {
                let wanted = if id == RequestId::from(first) { -32801 } else { -32800 };
                assert_eq!(code, wanted);
                refused += 1;
            }
            answers.insert(id.to_string(), ());
        }
    }
    assert_eq!(answers.len(), 100, "each is answered once");
    println!("{refused} of 100 refused");
    assert!(refused > 0, "nothing was ever refused");
}

/// Resident memory, MB; none where the system does not say.
fn resident_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}

/// Memory may grow by so much from the third part of a record to its end, MB: allocators keep what was freed. Measured
/// over ten thousand keys: 0 to 3.
const GROWTH_MB: f64 = 16.0;

/// What can be asked of a whole text.
const OF_A_TEXT: [&str; 6] =
    ["semanticTokens/full", "documentSymbol", "foldingRange", "inlayHint", "formatting", "codeLens"];

/// Plays a record of work at a design; compares with a fresh start.
fn replay(wanted: usize) {
    let text = example("jansen/jansen.mech");
    let mut editor = Editor::new(&[("a.mech", &text)]);
    editor.open("a.mech", &text);
    let mut hand = keys::Hand::new(&text, 1);
    let (mut times, mut typed, mut early) = (Vec::new(), 0, None);
    let document = json!({ "textDocument": { "uri": uri("a.mech") } });
    while typed < wanted {
        for key in hand.next() {
            let began = Instant::now();
            editor.change("a.mech", key.range, &key.text);
            typed += 1;
            if typed % 10 == 0 {
                editor.findings("a.mech");
                times.push(began.elapsed());
            }
        }
        // As editors do, whenever somebody pauses.
        for method in ["semanticTokens/full", "inlayHint"] {
            editor.ask(&format!("textDocument/{method}"), document.clone()).unwrap();
        }
        if early.is_none() && 3 * typed > wanted {
            early = resident_mb();
        }
    }
    times.sort_unstable();
    println!(
        "{typed} keys; findings: median {:?}, 95th percentile {:?}, most {:?}",
        times[times.len() / 2],
        times[times.len() * 95 / 100],
        times[times.len() - 1]
    );
    if let (Some(early), Some(late)) = (early, resident_mb()) {
        println!("memory: {early:.1} MB after a third, {late:.1} MB at the end");
        // In its first second it is still taking what it needs.
        assert!(wanted < 5000 || late - early < GROWTH_MB, "{early} MB → {late} MB");
    }
    let now = hand.text;
    assert!(now != text && now.contains("point typed"), "something of it stays");
    let mut fresh = Editor::new(&[("a.mech", &now)]);
    fresh.open("a.mech", &now);
    for method in OF_A_TEXT {
        let ask = |e: &mut Editor| e.ask(&format!("textDocument/{method}"), document.clone()).unwrap();
        let (old, new) = (ask(&mut editor), ask(&mut fresh));
        assert_eq!(old, new, "{method}");
        assert!(method == "formatting" || new.as_array().is_none_or(|a| !a.is_empty()), "{method}: nothing");
    }
    let lines = now.lines().count();
    for line in (0..lines).step_by(1 + lines / 60) {
        let at = json!({ "line": line, "character": 14 });
        for method in ["hover", "definition", "completion"] {
            let params = json!({ "textDocument": { "uri": uri("a.mech") }, "position": at });
            let ask = |e: &mut Editor| e.ask(&format!("textDocument/{method}"), params.clone()).unwrap();
            assert_eq!(ask(&mut editor), ask(&mut fresh), "{method} in line {line}");
        }
    }
    // The mechanism's findings come a little later; that points are not used is among them.
    let began = Instant::now();
    let newest = |e: &Editor| e.found.get(&uri("a.mech")).map(|(_, found)| found.clone()).unwrap_or_default();
    let lint = |found: &Value| found.as_array().is_some_and(|f| f.iter().any(|d| d["code"] == "W1001"));
    while newest(&editor) != newest(&fresh) || !lint(&newest(&fresh)) {
        assert!(began.elapsed() < Duration::from_secs(60), "{:#}\n{:#}", newest(&editor), newest(&fresh));
        editor.wait_a_little();
        fresh.wait_a_little();
    }
}

#[test]
fn hundreds_of_keystrokes() {
    replay(300);
}

#[test]
fn ten_thousand_keystrokes() {
    if !skipped() {
        replay(10_000);
    }
}

/// Words in quotes of the rules of the grammar whose names `wanted` picks.
fn grammar_words(wanted: impl Fn(&str) -> bool) -> BTreeSet<String> {
    let grammar = include_str!("../grammar/mech.pest");
    let mut words = BTreeSet::new();
    let mut inside = false;
    for line in grammar.lines() {
        let rule = line.split(' ').next().unwrap_or("");
        if line.contains("= @{") || line.contains("= _{") {
            inside = wanted(rule);
        }
        if inside {
            let quoted = line.split('"').skip(1).step_by(2);
            words.extend(quoted.filter(|w| w.chars().all(|c| c.is_ascii_lowercase())).map(String::from));
        }
        inside &= !line.trim_end().ends_with('}');
    }
    words
}

#[test]
fn the_lists_of_words_are_the_grammars() {
    let starts = |rule: &str| matches!(rule, "reserved_word" | "joint_word");
    let listed = [Kind::File, Kind::Mechanism, Kind::Flexure].into_iter().flat_map(starting_words);
    let listed: BTreeSet<String> = listed.map(String::from).collect();
    assert_eq!(listed, grammar_words(starts));
    let later = grammar_words(|rule| rule == "later_word");
    assert!(later.contains("spring") && listed.is_disjoint(&later));
}

/// Where no language server gives colours, the editors' own files do: no word may be missing there.
#[test]
fn every_word_of_the_grammar_is_in_the_editors_files() {
    let wanted =
        |rule: &str| rule.starts_with("kw_") || matches!(rule, "reserved_word" | "joint_word" | "later_word");
    let words = grammar_words(wanted);
    assert!(words.len() > 80 && words.contains("case") && words.contains("weight"), "{words:?}");
    for (name, text) in [
        ("Neovim", include_str!("../editors/neovim/syntax/mech.vim")),
        ("VS Code", include_str!("../editors/vscode/syntaxes/mech.tmLanguage.json")),
        ("tree-sitter", include_str!("../editors/tree-sitter-flexura/grammar.js")),
        ("tree-sitter's colours", include_str!("../editors/tree-sitter-flexura/queries/highlights.scm")),
    ] {
        let known: BTreeSet<&str> = text.split(|c: char| !c.is_ascii_lowercase()).collect();
        // All kinds of joints have one colour there.
        let joints = if name.ends_with("colours") {
            grammar_words(|rule| rule == "joint_word")
        } else {
            BTreeSet::new()
        };
        let missing: Vec<&String> =
            words.iter().filter(|w| !known.contains(w.as_str()) && !joints.contains(*w)).collect();
        assert!(missing.is_empty(), "{name}: {missing:?}");
    }
}
