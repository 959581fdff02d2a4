//! Commands of the editor. Each works on a thread of its own, and what takes seconds in a process; the answer comes when
//! it is done. Files are written by the `flexura` command alone, texts are changed by the editor alone.

use super::actions::{Edits, repairs};
use super::changes::workspace_edit;
use super::findings::{self, Findings, Found, lock};
use super::running::{Client, Event, Job, Running, log};
use super::server::{Below, Server, Texts, split};
use super::solver::{self, Question, Reply, lock_name, summary};
use super::space::Space;
use super::{apply, uri};
use crate::diagnostic::Diagnostic;
use crate::pipeline::Measures;
use lsp_server::{ErrorCode, RequestId, Response};
use lsp_types::notification::{Notification as _, ShowMessage};
use lsp_types::request::{
    ApplyWorkspaceEdit, CodeLensRefresh, InlayHintRefreshRequest, Request as _, ShowDocument,
};
use lsp_types::{ApplyWorkspaceEditParams, MessageType, ShowDocumentParams, ShowMessageParams};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub(super) const BUILD: &str = "flexura.build";
pub(super) const SIMULATE: &str = "flexura.simulate";
pub(super) const SHOW_REPORT: &str = "flexura.showReport";
pub(super) const APPLY: &str = "flexura.applyOptimised";
pub(super) const BETTER_REST: &str = "flexura.betterRest";

/// All commands, with what they do.
pub(super) const ALL: [(&str, &str); 5] = [
    (BUILD, "Building"),
    (SIMULATE, "Simulating"),
    (SHOW_REPORT, "Making the report of"),
    (APPLY, "Applying the optimised values to"),
    (BETTER_REST, "Looking for a better rest pose of"),
];

type Refusal = (ErrorCode, String);

fn refuse<T>(why: impl Into<String>) -> Result<T, Refusal> {
    Err((ErrorCode::RequestFailed, why.into()))
}

/// What a command works with: the texts as they were when it was asked for.
struct Ask {
    path: String,
    texts: Texts,
    versions: BTreeMap<String, i32>,
    number: u64,
    findings: Arc<Findings>,
    running: Arc<Running>,
    out: findings::Out,
    client: Client,
    lock_changed: Arc<AtomicBool>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Params {
    command: String,
    #[serde(default)]
    arguments: Vec<Value>,
    work_done_token: Option<lsp_types::ProgressToken>,
}

/// Begins a command; an answer where it could not be begun, else it comes later.
pub(super) fn execute(server: &Server, id: RequestId, params: Value) -> Option<Response> {
    let refused = |code: ErrorCode, why: String| Some(Response::new_err(id.clone(), code as i32, why));
    let params: Params = match serde_json::from_value(params) {
        Ok(params) => params,
        Err(e) => return refused(ErrorCode::InvalidParams, e.to_string()),
    };
    let Some((command, verb)) = ALL.iter().find(|(c, _)| *c == params.command).copied() else {
        return refused(ErrorCode::InvalidParams, format!("there is no command `{}`", params.command));
    };
    // An editor that sends no argument means the file it worked on last.
    let given = params.arguments.first().cloned().and_then(|a| serde_json::from_value(a).ok());
    let Some(path) = given.map(|u| uri::path(&u)).or_else(|| server.touched.clone()) else {
        return refused(ErrorCode::InvalidParams, "its argument is the address of a design".into());
    };
    let name = format!("{verb} {}", split(&path).1);
    let Some(job) = server.running.begin(&server.out, server.client, &id, name, params.work_done_token)
    else {
        return refused(ErrorCode::RequestFailed, "it is at work already".into());
    };
    let ask = Ask {
        path,
        texts: server.texts.clone(),
        versions: server.versions.clone(),
        number: server.findings.number(),
        findings: Arc::clone(&server.findings),
        running: Arc::clone(&server.running),
        out: Arc::clone(&server.out),
        client: server.client,
        lock_changed: Arc::clone(&server.lock_changed),
    };
    let (began, own) = (Arc::clone(&server.running), id.clone());
    let thread = std::thread::Builder::new().name(command.into()).spawn(move || {
        let answer = match command {
            BUILD => ask.build(&job).map(|(done, _)| done),
            SIMULATE => ask.simulate(&job),
            SHOW_REPORT => ask.show_report(&job),
            APPLY => ask.apply_optimised(),
            _ => ask.better_rest(),
        };
        let ended = answer.as_ref().err().map_or("done", |(_, why)| why.as_str());
        ask.running.end(&own, ended);
        let response = match answer {
            Ok(value) => Response::new_ok(own, value),
            Err((code, why)) => Response::new_err(own, code as i32, why),
        };
        (ask.out)(response.into());
    });
    match thread {
        Ok(_) => None,
        Err(e) => {
            began.end(&id, "not begun");
            Some(Response::new_err(id, ErrorCode::InternalError as i32, e.to_string()))
        }
    }
}

impl Ask {
    fn folder(&self) -> &str {
        split(&self.path).0
    }

    fn file(&self) -> &str {
        split(&self.path).1
    }

    fn files(&self) -> Below<'_> {
        Below { folder: self.folder(), texts: &self.texts }
    }

    /// The command reads the disk: what it would read there must be what is in the editor.
    fn saved(&self) -> Result<(), Refusal> {
        let space = Space::read(self.file(), &self.files());
        for (name, text) in space.files.iter().filter(|(name, _)| !name.starts_with("std/")) {
            if self.texts.host.read(self.folder(), name).ok().as_deref() != Some(text.text.as_str()) {
                return refuse(format!("`{name}` has changes that are not saved"));
            }
        }
        Ok(())
    }

    /// Builds; also the paths of what was made.
    fn build(&self, job: &Job) -> Result<(Value, Vec<String>), Refusal> {
        self.saved()?;
        let arguments = ["build", self.file(), "--events", "--format", "json"].map(String::from);
        let work = self.texts.host.start(self.folder(), &arguments, String::new());
        let work = work.or_else(refuse)?;
        let (mut files, mut found, mut good) = (Vec::new(), None, false);
        let output = job.run(work, &mut |line| match serde_json::from_str::<Event>(line) {
            Ok(Event::Stage(stage)) => job.report(stage),
            Ok(Event::Iteration(n, objective)) => {
                job.report(format!("optimising, iteration {}: objective {objective:.3e}", n + 1));
            }
            Ok(Event::Found(diagnostics, sources, fine)) => {
                (found, good) = (Some(Found { diagnostics, sources }), fine);
            }
            Ok(Event::Files(paths)) => files = paths,
            Err(_) => log(&self.out, line.into()),
        });
        let Some(output) = output else { return Err((ErrorCode::RequestCanceled, "cancelled".into())) };
        let Some(found) = found else { return refuse("the build ended before its end; the log says why") };
        let errors = found.diagnostics.iter().filter(|d| d.is_error()).count();
        self.learnt(found);
        let after =
            serde_json::from_str::<Value>(&output).ok().and_then(|mut v| v.get_mut("after").map(Value::take));
        let measures = after.and_then(|v| serde_json::from_value::<Measures>(v).ok());
        let told = match (good, measures) {
            (true, Some(m)) => format!("{} is built: {}", self.file(), summary(&m)),
            (true, None) => format!("{} is built", self.file()),
            (false, _) => format!("{}: {errors} errors", self.file()),
        };
        self.say(if good { MessageType::INFO } else { MessageType::ERROR }, told.clone());
        Ok((json!({ "good": good, "summary": told, "files": files }), files))
    }

    fn simulate(&self, job: &Job) -> Result<Value, Refusal> {
        let question = Question::new(&self.path, &self.texts).text();
        let arguments = ["lsp", "--solve"].map(String::from);
        let work = self.texts.host.start(self.folder(), &arguments, question).or_else(refuse)?;
        let output = job.run(work, &mut |line| log(&self.out, line.into()));
        let Some(output) = output else { return Err((ErrorCode::RequestCanceled, "cancelled".into())) };
        let Ok(reply) = serde_json::from_str::<Reply>(&output) else {
            return refuse("the simulation ended before its end; the log says why");
        };
        let errors = reply.diagnostics.iter().filter(|d| d.is_error()).count();
        let good = reply.summary.is_some() && errors == 0;
        let told = match reply.summary {
            Some(summary) => format!("{} {summary}", self.file()),
            None => format!("{}: {errors} errors", self.file()),
        };
        self.learnt(Found { diagnostics: reply.diagnostics, sources: reply.sources });
        self.say(if good { MessageType::INFO } else { MessageType::ERROR }, told.clone());
        Ok(json!({ "good": good, "summary": told }))
    }

    fn show_report(&self, job: &Job) -> Result<Value, Refusal> {
        let (built, files) = self.build(job)?;
        let Some(page) = files.iter().find(|f| f.ends_with(".html")) else {
            return refuse(format!("{} makes no report: write `export report` into it", self.file()));
        };
        match uri::of(page).filter(|_| self.client.show_document) {
            Some(uri) => {
                let params =
                    ShowDocumentParams { uri, external: Some(true), take_focus: None, selection: None };
                self.running.ask(&self.out, ShowDocument::METHOD, params);
            }
            None => self.say(MessageType::INFO, format!("the report: {page}")),
        }
        Ok(json!({ "good": built.get("good"), "report": page }))
    }

    fn apply_optimised(&self) -> Result<Value, Refusal> {
        let lock = self.texts.host.read(self.folder(), &lock_name(self.file())).ok();
        let applied = apply::optimised(self.file(), &self.files(), lock.as_deref(), None).or_else(refuse)?;
        let told = applied.told();
        self.change("Apply the optimised values", &applied.edits)?;
        self.say(MessageType::INFO, told.clone());
        Ok(json!({ "summary": told, "written": applied.count() }))
    }

    fn better_rest(&self) -> Result<Value, Refusal> {
        let found = findings::checked(&self.texts, &self.path);
        if found.diagnostics.iter().any(Diagnostic::is_error) {
            return refuse("the design has errors: mend them first");
        }
        let better = found.diagnostics.iter().filter(|d| d.code == "W1107");
        let better = better.map(|d| (d, repairs(d, &found.sources))).next();
        let Some((d, mut fixes)) = better else {
            return refuse("no state of the cycle would be a clearly better rest pose");
        };
        if fixes.is_empty() {
            return refuse(format!("{}, but its place in the text is not clear", d.message));
        }
        let (fix, edits) = fixes.swap_remove(0);
        self.change("Choose the better rest pose", &edits)?;
        self.say(MessageType::INFO, format!("{}: {}", fix.title, d.message));
        Ok(json!({ "summary": fix.title }))
    }

    /// Has the editor change its texts, if they are still those that were looked at.
    fn change(&self, label: &str, edits: &Edits) -> Result<(), Refusal> {
        if self.findings.number() != self.number {
            return Err((ErrorCode::ContentModified, "the text has moved on".into()));
        }
        if !edits.is_empty() {
            let versions = self.client.document_changes.then_some(&self.versions);
            let edit = workspace_edit(self.folder(), edits, &self.texts, versions);
            let params = ApplyWorkspaceEditParams { label: Some(label.into()), edit };
            self.running.ask(&self.out, ApplyWorkspaceEdit::METHOD, params);
        }
        Ok(())
    }

    /// What was found counts for these texts until they change; hints and lenses may show another lock.
    fn learnt(&self, found: Found) {
        let key = solver::key(&self.path, &self.texts);
        lock(&self.findings.board.solved).insert(self.path.clone(), (key, found));
        self.lock_changed.store(true, Ordering::SeqCst);
        self.findings.again(&self.path);
        let methods = [InlayHintRefreshRequest::METHOD, CodeLensRefresh::METHOD];
        for (method, _) in methods.into_iter().zip(self.client.refresh).filter(|(_, can)| *can) {
            self.running.ask(&self.out, method, Value::Null);
        }
    }

    fn say(&self, typ: MessageType, message: String) {
        let params = ShowMessageParams { typ, message };
        (self.out)(lsp_server::Notification::new(ShowMessage::METHOD.into(), params).into());
    }
}
