//! Diagnostics as SARIF 2.1.0 (OASIS), which code review services and editors read.
//!
//! Findings with a place are results; those of the tool itself (a file that cannot be read) are notifications of its
//! run, because readers expect every result to have a place.

use super::json::position;
use super::{Diagnostic, Label, Severity, SourceMap};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Where the format is described.
const SCHEMA: &str = "https://json.schemastore.org/sarif-2.1.0.json";

/// What is said about the program.
pub struct Tool<'a> {
    /// Its version, `MAJOR.MINOR.PATCH`.
    pub version: &'a str,
    /// One line on what a code stands for, where it is known.
    pub summary: &'a dyn Fn(&str) -> Option<String>,
}

/// A log of one run. Paths are those of the source map: relative ones stay relative, with `/`.
pub fn log(found: &[Diagnostic], sources: &SourceMap, tool: &Tool) -> Value {
    let codes: BTreeMap<&str, Severity> = found.iter().map(|d| (d.code.as_str(), d.severity)).collect();
    let rules: Vec<Value> = codes.iter().map(|(code, severity)| rule(code, *severity, tool)).collect();
    let index = |code: &str| codes.keys().position(|c| *c == code);
    let (placed, placeless): (Vec<&Diagnostic>, Vec<&Diagnostic>) =
        found.iter().partition(|d| d.labels.first().is_some_and(|l| located(l, sources)));
    let results: Vec<Value> = placed.iter().map(|d| result(d, index(&d.code), sources)).collect();
    let notifications: Vec<Value> = placeless
        .iter()
        .map(|d| {
            let rule = json!({ "id": d.code, "index": index(&d.code) });
            json!({ "descriptor": rule, "level": level(d.severity), "message": { "text": text(d) } })
        })
        .collect();
    let ran = !placeless.iter().any(|d| d.is_error());
    let mut invocation = json!({ "executionSuccessful": ran });
    if let (Some(fields), false) = (invocation.as_object_mut(), notifications.is_empty()) {
        fields.insert("toolExecutionNotifications".into(), Value::Array(notifications));
    }
    json!({
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "flexura",
                "semanticVersion": tool.version,
                "rules": rules,
            }},
            "columnKind": "unicodeCodePoints",
            "invocations": [invocation],
            "results": results,
        }],
    })
}

fn rule(code: &str, severity: Severity, tool: &Tool) -> Value {
    let mut rule = Map::new();
    rule.insert("id".into(), json!(code));
    if let Some(summary) = (tool.summary)(code) {
        rule.insert("shortDescription".into(), json!({ "text": summary }));
    }
    rule.insert("defaultConfiguration".into(), json!({ "level": level(severity) }));
    Value::Object(rule)
}

fn level(severity: Severity) -> &'static str {
    match severity {
        Severity::Advice => "note",
        Severity::Warning => "warning",
        Severity::Error => "error",
    }
}

/// What is wrong, what to say at its place, and the next action: viewers show little else than this.
fn text(d: &Diagnostic) -> String {
    let label = d.labels.first().map(|l| l.text.as_str()).filter(|t| !t.is_empty());
    let mut text = d.message.clone();
    if let Some(label) = label {
        text.push_str(": ");
        text.push_str(label);
    }
    if let Some(help) = &d.help {
        text.push('\n');
        text.push_str(help);
    }
    text
}

fn result(d: &Diagnostic, rule: Option<usize>, sources: &SourceMap) -> Value {
    let mut fields = Map::new();
    fields.insert("ruleId".into(), json!(d.code));
    fields.insert("ruleIndex".into(), json!(rule));
    fields.insert("level".into(), json!(level(d.severity)));
    fields.insert("message".into(), json!({ "text": text(d) }));
    let mut places = d.labels.iter().filter(|l| located(l, sources));
    let primary: Vec<Value> =
        places.next().map(|l| json!({ "physicalLocation": physical(l, sources) })).into_iter().collect();
    fields.insert("locations".into(), Value::Array(primary));
    let related: Vec<Value> = places
        .enumerate()
        .map(|(i, l)| {
            let place = physical(l, sources);
            let said = if l.text.is_empty() { "see here" } else { &l.text };
            json!({ "id": i + 1, "physicalLocation": place, "message": { "text": said } })
        })
        .collect();
    if !related.is_empty() {
        fields.insert("relatedLocations".into(), Value::Array(related));
    }
    Value::Object(fields)
}

fn located(label: &Label, sources: &SourceMap) -> bool {
    sources.files.get(label.at.file as usize).is_some()
}

fn physical(label: &Label, sources: &SourceMap) -> Value {
    let file = sources.files.get(label.at.file as usize);
    let text = file.map_or("", |f| f.text.as_str());
    let (start, end) = (position(text, label.at.start), position(text, label.at.end));
    json!({
        "artifactLocation": { "uri": uri(file.map_or("", |f| f.name.as_str())) },
        "region": {
            "startLine": start.line,
            "startColumn": start.column,
            "endLine": end.line,
            "endColumn": end.column,
            "byteOffset": label.at.start,
            "byteLength": label.at.end.saturating_sub(label.at.start),
        },
    })
}

/// A path as a URI reference. The standard library is part of the program: it has no path.
fn uri(name: &str) -> String {
    let name = name.replace('\\', "/");
    let mut out = String::new();
    let plain = match name.strip_prefix("std/") {
        Some(rest) => {
            out.push_str("flexura:std/");
            rest
        }
        None => {
            if name.starts_with('/') {
                out.push_str("file://");
            }
            name.as_str()
        }
    };
    for byte in plain.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' | b'@' => {
                out.push(char::from(byte));
            }
            // A colon in the first part of a relative path would make it a scheme; all of them are written out.
            other => out.push_str(&format!("%{other:02X}")),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostic::Origin;

    fn tool() -> Tool<'static> {
        Tool { version: "1.2.3", summary: &|code| (code == "E0101").then(|| "an unknown name".into()) }
    }

    #[test]
    fn findings_become_results_with_places() {
        let mut sources = SourceMap::default();
        let main = sources.add("parts/a b.mech", "let x = ö\nlet y = q\n");
        let std = sources.add("std/materials/rigur.mech", "material rigur {\n}\n");
        let at = |file, start, end| Origin { file, start, end };
        let found = [
            Diagnostic::error("E0101", "`q` is not declared", at(main, 19, 20))
                .label("not found here")
                .also(at(std, 9, 14), "")
                .help("did you mean `x`?"),
            Diagnostic::warning("W0101", "this import is not used", at(main, 0, 3)),
        ];
        let log = log(&found, &sources, &tool());
        let run = &log["runs"][0];
        let rules = json!([
            {
                "id": "E0101",
                "shortDescription": { "text": "an unknown name" },
                "defaultConfiguration": { "level": "error" },
            },
            { "id": "W0101", "defaultConfiguration": { "level": "warning" } },
        ]);
        assert_eq!(run["tool"]["driver"]["rules"], rules);
        let error = &run["results"][0];
        assert_eq!(
            (&error["ruleId"], &error["ruleIndex"], &error["level"]),
            (&json!("E0101"), &json!(0), &json!("error"))
        );
        assert_eq!(error["message"]["text"], "`q` is not declared: not found here\ndid you mean `x`?");
        // The second line, in characters and not in bytes; the path as a URI.
        let place = json!({
            "artifactLocation": { "uri": "parts/a%20b.mech" },
            "region": {
                "startLine": 2, "startColumn": 9, "endLine": 2, "endColumn": 10, "byteOffset": 19, "byteLength": 1,
            },
        });
        assert_eq!(error["locations"], json!([{ "physicalLocation": place }]));
        let related = &error["relatedLocations"][0];
        assert_eq!(
            related["physicalLocation"]["artifactLocation"]["uri"],
            "flexura:std/materials/rigur.mech"
        );
        assert_eq!((&related["id"], &related["message"]["text"]), (&json!(1), &json!("see here")));
        let warning = &run["results"][1];
        assert_eq!((&warning["ruleIndex"], &warning["level"]), (&json!(1), &json!("warning")));
        assert!(warning.get("relatedLocations").is_none());
    }

    #[test]
    fn an_empty_run_and_one_that_could_not_read() {
        let empty = log(&[], &SourceMap::default(), &tool());
        assert_eq!(empty["runs"][0]["results"], json!([]));
        assert_eq!(empty["runs"][0]["invocations"][0], json!({ "executionSuccessful": true }));
        let lost =
            Diagnostic { labels: Vec::new(), ..Diagnostic::error("E0730", "cannot read", Origin::default()) };
        let log = log(&[lost], &SourceMap::default(), &tool());
        assert_eq!(log["runs"][0]["results"], json!([]));
        let invocation = &log["runs"][0]["invocations"][0];
        assert_eq!(invocation["executionSuccessful"], json!(false));
        assert_eq!(invocation["toolExecutionNotifications"][0]["descriptor"]["id"], json!("E0730"));
    }

    #[test]
    fn paths_are_uri_references() {
        assert_eq!(uri("parts/a b.mech"), "parts/a%20b.mech");
        assert_eq!(uri("/tmp/x.mech"), "file:///tmp/x.mech");
        assert_eq!(uri("std/materials/rigur.mech"), "flexura:std/materials/rigur.mech");
        assert_eq!(uri("c:x.mech"), "c%3Ax.mech");
    }
}
