//! How long an editor waits for findings after a keystroke, as Markdown: a record of typing, deleting, pasting and taking
//! back over a whole design and over one of a thousand lines; and what the server's memory does meanwhile.
//!
//! `cargo bench --bench editor [-- --keys N --limit MS]`: beyond the limit for the 95th percentile of the first it fails.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

#[path = "../tests/common/keys.rs"]
mod keys;

use flexura::elaborate::FileError;
use flexura::lsp::server::{Connection, serve};
use flexura::lsp::{Host, Work};
use lsp_server::{Message, Notification, Request, RequestId};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};

struct Nothing;

impl Host for Nothing {
    fn read(&self, _: &str, _: &str) -> Result<String, FileError> {
        Err(FileError::NotFound)
    }
    fn list(&self, _: &str) -> Vec<String> {
        Vec::new()
    }
    fn library(&self, _: &str) -> Option<String> {
        None
    }
    fn start(&self, _: &str, _: &[String], _: String) -> Result<Arc<dyn Work>, String> {
        Err("nothing is solved here".into())
    }
}

/// A design of a thousand lines: its mechanism again and again, each elaborated.
fn thousand(text: &str) -> String {
    let (head, mechanism) = text.split_at(text.find("\nmechanism jansen").unwrap() + 1);
    let mut all = head.to_string();
    let mut n = 0;
    while all.lines().count() < 1000 {
        n += 1;
        all.push_str(&mechanism.replacen("mechanism jansen", &format!("mechanism jansen{n}"), 1));
        all.push('\n');
    }
    all
}

/// Resident memory of this process, MB; none where the system does not say.
fn resident_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}

/// Plays a record; the 95th percentile, ms.
fn replay(name: &str, text: &str, wanted: usize) -> f64 {
    let (server, editor) = Connection::memory();
    let server = std::thread::spawn(move || serve(server, Box::new(Nothing)).unwrap());
    let ask = |method: &str, params: Value| {
        editor.sender.send(Request::new(RequestId::from(1), method.into(), params).into()).unwrap();
        while !matches!(editor.receiver.recv().unwrap(), Message::Response(_)) {}
    };
    let tell = |method: &str, params: Value| {
        editor.sender.send(Notification::new(method.into(), params).into()).unwrap();
    };
    ask("initialize", json!({ "capabilities": {} }));
    tell("initialized", json!({}));
    let uri = "file:///d/a.mech";
    let document = json!({ "uri": uri, "languageId": "mech", "version": 0, "text": text });
    tell("textDocument/didOpen", json!({ "textDocument": document }));
    let mut hand = keys::Hand::new(text, 1);
    let mut times: Vec<Duration> = Vec::new();
    let (mut early, mut version) = (None, 0);
    while times.len() < wanted {
        for keys::Key { range: [l1, c1, l2, c2], text } in hand.next() {
            version += 1;
            let range =
                json!({ "start": { "line": l1, "character": c1 }, "end": { "line": l2, "character": c2 } });
            let began = Instant::now();
            tell(
                "textDocument/didChange",
                json!({
                    "textDocument": { "uri": uri, "version": version },
                    "contentChanges": [{ "range": range, "text": text }],
                }),
            );
            loop {
                match editor.receiver.recv().unwrap() {
                    Message::Notification(n) if n.params["version"] == version => break,
                    _ => {}
                }
            }
            times.push(began.elapsed());
        }
        if early.is_none() && times.len() > wanted / 10 {
            early = resident_mb();
        }
    }
    let late = resident_mb();
    times.sort_unstable();
    let at = |part: f64| times[((times.len() - 1) as f64 * part) as usize].as_secs_f64() * 1e3;
    let memory = early.zip(late).map_or("unknown".into(), |(a, b)| format!("{a:.1} → {b:.1}"));
    println!(
        "| {name} | {} | {} | {:.1} | {:.1} | {:.1} | {memory} |",
        text.lines().count(),
        times.len(),
        at(0.5),
        at(0.95),
        at(1.0),
    );
    ask("shutdown", Value::Null);
    tell("exit", Value::Null);
    server.join().unwrap();
    at(0.95)
}

fn main() {
    let (mut wanted, mut limit_ms) = (10_000, f64::INFINITY);
    // cargo itself adds `--bench`.
    let mut rest = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = rest.next() {
        match (name.as_str(), rest.next()) {
            ("--keys", Some(n)) => wanted = n.parse().expect("a number of keys"),
            ("--limit", Some(ms)) => limit_ms = ms.parse().expect("milliseconds"),
            _ => panic!("there is no {name}: --keys N, --limit MS"),
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/jansen/jansen.mech");
    let text = std::fs::read_to_string(path).unwrap();
    println!(
        "| design | lines | keys | median, ms | 95th percentile, ms | most, ms | memory after a tenth and at the end, MB |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let waited_ms = replay("jansen.mech", &text, wanted);
    replay("seven times jansen.mech", &thousand(&text), wanted);
    assert!(waited_ms < limit_ms, "findings take {waited_ms:.1} ms, more than {limit_ms} ms");
}
