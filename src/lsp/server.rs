//! The protocol: messages in, answers out. Keeps the texts as the editor has them and asks the pure functions beside it.
//!
//! The loop only ever does what takes milliseconds: findings are worked out by threads beside it, which always take the
//! newest texts and drop what became of older ones, and commands by processes. Of what came in together, a request about a text that has moved
//! on since is answered by "content modified", and one that was cancelled is not worked on.

use super::answers::Evaluated;
use super::findings::{self, Findings, Found, Out};
use super::running::{Client, Running};
use super::space::Space;
use super::text::{Lines, change};
use super::{Host, commands, requests, uri};
use crate::elaborate::{FileError, Files, SolidFile};
pub use lsp_server::Connection;
use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types as lsp;
use lsp_types::notification::{
    Cancel, DidChangeTextDocument, DidCloseTextDocument, DidOpenTextDocument, DidSaveTextDocument,
    Notification as _, WorkDoneProgressCancel,
};
use lsp_types::request::{ExecuteCommand, Request as _};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why serving ended.
pub type Fault = Box<dyn std::error::Error + Send + Sync>;

/// The texts that an editor holds, by absolute path.
#[derive(Clone)]
pub(super) struct Texts {
    pub open: BTreeMap<String, Arc<str>>,
    pub host: Arc<dyn Host>,
}

/// The files below a folder: as the editor has them, else as the disk does.
pub(super) struct Below<'a> {
    pub folder: &'a str,
    pub texts: &'a Texts,
}

impl Files for Below<'_> {
    fn read(&self, path: &str) -> Result<String, FileError> {
        match self.texts.open.get(&format!("{}/{path}", self.folder)) {
            Some(text) => Ok(text.to_string()),
            None => self.texts.host.read(self.folder, path),
        }
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        self.texts.host.solid(self.folder, path)
    }
}

/// Folder and name of an absolute path.
pub(super) fn split(path: &str) -> (&str, &str) {
    path.rsplit_once('/').unwrap_or(("", path))
}

/// What is known of one file as the root of a design.
pub(super) struct View {
    /// Its folder.
    pub folder: String,
    /// Its name in the folder.
    pub file: String,
    pub space: Space,
    pub known: Evaluated,
    /// What the text alone tells.
    pub found: Arc<Found>,
    /// What is built of it; none where there are errors.
    pub built: Option<Built>,
    pub lines: Lines,
}

/// What a file builds.
pub(super) struct Built {
    /// The mechanism.
    pub name: String,
    /// It makes a report.
    pub report: bool,
}

pub(super) struct Server {
    pub texts: Texts,
    pub versions: BTreeMap<String, i32>,
    /// The file that was opened, changed or saved last.
    pub touched: Option<String>,
    /// The views of the texts as they are now.
    views: BTreeMap<String, Arc<View>>,
    pub findings: Arc<Findings>,
    pub running: Arc<Running>,
    pub client: Client,
    pub out: Out,
    /// A command has written a lock: what the views show of it is old.
    pub lock_changed: Arc<AtomicBool>,
}

/// Serves one editor until it says goodbye.
///
/// # Errors
/// Where the editor does not keep to the protocol or goes away.
pub fn serve(connection: Connection, host: Box<dyn Host>) -> Result<(), Fault> {
    let params = connection.initialize(serde_json::to_value(requests::capabilities())?)?;
    let texts = Texts { open: BTreeMap::new(), host: Arc::from(host) };
    let sender = connection.sender.clone();
    let out: Out = Arc::new(move |message| drop(sender.send(message)));
    let (findings, workers) = findings::start(Arc::clone(&out))?;
    let mut server = Server {
        texts,
        versions: BTreeMap::new(),
        touched: None,
        views: BTreeMap::new(),
        findings,
        running: Arc::default(),
        client: Client::of(&params),
        out,
        lock_changed: Arc::default(),
    };
    let served = server.run(&connection);
    server.running.cancel_all();
    server.findings.board.stop();
    // The workers end when nobody can ask them any more.
    drop(server);
    drop(connection);
    for worker in workers {
        let _ = worker.join();
    }
    served
}

impl Server {
    fn run(&mut self, connection: &Connection) -> Result<(), Fault> {
        while let Ok(first) = connection.receiver.recv() {
            let batch: Vec<Message> = std::iter::once(first).chain(connection.receiver.try_iter()).collect();
            let outdated = outdated(&batch);
            for message in batch {
                match message {
                    Message::Request(request) => {
                        if connection.handle_shutdown(&request)? {
                            return Ok(());
                        }
                        let response = match outdated.get(&request.id) {
                            Some(code) => Some(refusal(request.id, *code)),
                            None => self.answer(request),
                        };
                        if let Some(response) = response {
                            connection.sender.send(response.into())?;
                        }
                    }
                    Message::Notification(note) => self.note(note),
                    Message::Response(_) => {}
                }
            }
        }
        Ok(())
    }

    /// The answer, unless it comes later.
    fn answer(&mut self, request: Request) -> Option<Response> {
        let id = request.id.clone();
        if request.method == ExecuteCommand::METHOD {
            return commands::execute(self, id, request.params);
        }
        Some(match requests::answer(self, &request.method, request.params) {
            Ok(value) => Response::new_ok(id, value),
            Err((code, why)) => Response::new_err(id, code as i32, why),
        })
    }

    fn note(&mut self, note: Notification) {
        match note.method.as_str() {
            DidOpenTextDocument::METHOD => {
                if let Ok(p) = serde_json::from_value::<lsp::DidOpenTextDocumentParams>(note.params) {
                    let document = p.text_document;
                    let path = uri::path(&document.uri);
                    self.set(path.clone(), document.version, document.text);
                    self.look(Some(path));
                }
            }
            DidChangeTextDocument::METHOD => {
                if let Ok(p) = serde_json::from_value::<lsp::DidChangeTextDocumentParams>(note.params) {
                    let path = uri::path(&p.text_document.uri);
                    let mut text = self.texts.open.get(&path).map(|t| t.to_string()).unwrap_or_default();
                    change(&mut text, p.content_changes);
                    self.set(path, p.text_document.version, text);
                    self.look(None);
                }
            }
            DidCloseTextDocument::METHOD => {
                if let Ok(p) = serde_json::from_value::<lsp::DidCloseTextDocumentParams>(note.params) {
                    let path = uri::path(&p.text_document.uri);
                    self.texts.open.remove(&path);
                    self.versions.remove(&path);
                    self.views.clear();
                    self.look(None);
                }
            }
            DidSaveTextDocument::METHOD => {
                if let Ok(p) = serde_json::from_value::<lsp::DidSaveTextDocumentParams>(note.params) {
                    // The lock or a file that is not open may have changed with it.
                    let path = uri::path(&p.text_document.uri);
                    self.touched = Some(path.clone());
                    self.views.clear();
                    self.look(Some(path));
                }
            }
            Cancel::METHOD => {
                let id = note.params.get("id").cloned();
                if let Some(id) = id.and_then(|id| serde_json::from_value(id).ok()) {
                    self.running.cancel(&id);
                }
            }
            WorkDoneProgressCancel::METHOD => {
                if let Ok(p) = serde_json::from_value::<lsp::WorkDoneProgressCancelParams>(note.params) {
                    self.running.cancel_token(&p.token);
                }
            }
            _ => {}
        }
    }

    fn set(&mut self, path: String, version: i32, text: String) {
        self.texts.open.insert(path.clone(), text.into());
        self.versions.insert(path.clone(), version);
        self.touched = Some(path);
        self.views.clear();
    }

    /// Has all open texts looked at: any may import the one that changed.
    fn look(&mut self, settled: Option<String>) {
        self.findings.look(self.texts.clone(), self.versions.clone(), settled);
    }

    /// What is known of a file; worked out once for each state of the texts.
    pub(super) fn view(&mut self, path: &str) -> Arc<View> {
        if self.lock_changed.swap(false, Ordering::SeqCst) {
            self.views.clear();
        }
        if let Some(view) = self.views.get(path) {
            return Arc::clone(view);
        }
        let (folder, file) = split(path);
        let files = Below { folder, texts: &self.texts };
        let space = Space::read(file, &files);
        let lock = self.texts.host.read(folder, &format!("{}.lock", file.trim_end_matches(".mech"))).ok();
        let (known, out) = Evaluated::of(file, &files, lock.as_deref());
        let found = Arc::new(Found { diagnostics: out.diagnostics, sources: out.sources });
        let built = out.assembly.map(|a| {
            let report = a.exports.iter().any(|e| e.export.kind == crate::ir::ExportKind::Report);
            Built { name: a.name, report }
        });
        let lines = Lines::of(space.files.get(file).map_or("", |t| t.text.as_str()));
        let view =
            Arc::new(View { folder: folder.into(), file: file.into(), space, known, found, built, lines });
        self.views.insert(path.into(), Arc::clone(&view));
        view
    }
}

/// Requests that need no answer any more, with the reason: cancelled, or about a text that changed after them.
fn outdated(batch: &[Message]) -> BTreeMap<RequestId, ErrorCode> {
    let document = |params: &serde_json::Value| {
        params.pointer("/textDocument/uri").and_then(|u| u.as_str()).map(str::to_owned)
    };
    let mut changed: BTreeSet<String> = BTreeSet::new();
    let mut cancelled: BTreeSet<RequestId> = BTreeSet::new();
    let mut all = BTreeMap::new();
    for message in batch.iter().rev() {
        match message {
            Message::Notification(note) if note.method == DidChangeTextDocument::METHOD => {
                changed.extend(document(&note.params));
            }
            Message::Notification(note) if note.method == Cancel::METHOD => {
                let id = note.params.get("id").cloned();
                cancelled.extend(id.and_then(|id| serde_json::from_value::<RequestId>(id).ok()));
            }
            Message::Request(request) if cancelled.contains(&request.id) => {
                all.insert(request.id.clone(), ErrorCode::RequestCanceled);
            }
            Message::Request(request) if document(&request.params).is_some_and(|d| changed.contains(&d)) => {
                all.insert(request.id.clone(), ErrorCode::ContentModified);
            }
            _ => {}
        }
    }
    all
}

fn refusal(id: RequestId, code: ErrorCode) -> Response {
    let why = match code {
        ErrorCode::RequestCanceled => "cancelled",
        _ => "the text has moved on",
    };
    Response::new_err(id, code as i32, why.into())
}
