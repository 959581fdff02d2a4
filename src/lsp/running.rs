//! Commands at work: each on a thread of its own, with its progress in the editor, until it ends or is cancelled.

use super::Work;
use super::findings::{Out, lock};
use crate::diagnostic::{Diagnostic, SourceMap};
use lsp_server::{Message, Notification, Request, RequestId};
use lsp_types::notification::{LogMessage, Notification as _, Progress};
use lsp_types::request::{Request as _, WorkDoneProgressCreate};
use lsp_types::{
    LogMessageParams, MessageType, NumberOrString, ProgressParams, ProgressParamsValue, ProgressToken,
    WorkDoneProgress, WorkDoneProgressBegin, WorkDoneProgressEnd, WorkDoneProgressReport,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex};

/// What a build tells while it works, a line each (`flexura build --events`).
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Event {
    /// What it does now.
    Stage(String),
    /// The optimiser has done an iteration: its number, and the objective.
    Iteration(usize, f64),
    /// What it found, with the texts that this points into, and whether the design is as it should be.
    Found(Vec<Diagnostic>, SourceMap, bool),
    /// Paths of what was written or stands.
    Files(Vec<String>),
}

/// What the editor can do.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Client {
    pub progress: bool,
    pub show_document: bool,
    pub document_changes: bool,
    pub refresh: [bool; 2],
}

impl Client {
    /// By what it says of itself.
    pub fn of(initialize: &serde_json::Value) -> Self {
        let can = |path: &str| {
            let path = format!("/capabilities/{path}");
            initialize.pointer(&path).and_then(serde_json::Value::as_bool).unwrap_or(false)
        };
        Self {
            progress: can("window/workDoneProgress"),
            show_document: can("window/showDocument/support"),
            document_changes: can("workspace/workspaceEdit/documentChanges"),
            refresh: [can("workspace/inlayHint/refreshSupport"), can("workspace/codeLens/refreshSupport")],
        }
    }
}

/// What is at work, by the request that asked for it.
#[derive(Default)]
pub(super) struct Running {
    all: Mutex<BTreeMap<RequestId, Arc<Job>>>,
    next: AtomicI32,
}

/// One command.
pub(super) struct Job {
    /// What it does with which file.
    pub name: String,
    token: Option<ProgressToken>,
    cancelled: AtomicBool,
    work: Mutex<Option<Arc<dyn Work>>>,
    out: Out,
}

impl Running {
    /// Asks the editor something; the answer is not waited for.
    pub fn ask(&self, out: &Out, method: &str, params: impl Serialize) {
        let id = RequestId::from(format!("flexura-{}", self.next.fetch_add(1, Ordering::SeqCst)));
        out(Request::new(id, method.into(), params).into());
    }

    /// Begins a command; none where the same is at work already.
    pub fn begin(
        &self,
        out: &Out,
        client: Client,
        id: &RequestId,
        name: String,
        token: Option<ProgressToken>,
    ) -> Option<Arc<Job>> {
        let mut all = lock(&self.all);
        if all.values().any(|job| job.name == name) {
            return None;
        }
        let token = token.or_else(|| {
            let token = NumberOrString::String(format!("flexura-{id}"));
            client.progress.then(|| {
                let params = lsp_types::WorkDoneProgressCreateParams { token: token.clone() };
                self.ask(out, WorkDoneProgressCreate::METHOD, params);
                token
            })
        });
        let (cancelled, work) = (AtomicBool::new(false), Mutex::new(None));
        let job = Arc::new(Job { name, token, cancelled, work, out: Arc::clone(out) });
        job.tell(WorkDoneProgress::Begin(WorkDoneProgressBegin {
            title: job.name.clone(),
            cancellable: Some(true),
            ..Default::default()
        }));
        all.insert(id.clone(), Arc::clone(&job));
        Some(job)
    }

    /// Takes a command that has ended out.
    pub fn end(&self, id: &RequestId, message: &str) {
        if let Some(job) = lock(&self.all).remove(id) {
            job.tell(WorkDoneProgress::End(WorkDoneProgressEnd { message: Some(message.into()) }));
        }
    }

    /// Cancels the command that a request asked for.
    pub fn cancel(&self, id: &RequestId) {
        if let Some(job) = lock(&self.all).get(id) {
            job.cancel();
        }
    }

    /// Cancels the command with this token.
    pub fn cancel_token(&self, token: &ProgressToken) {
        lock(&self.all).values().filter(|j| j.token.as_ref() == Some(token)).for_each(|j| j.cancel());
    }

    /// Cancels all: the editor goes away.
    pub fn cancel_all(&self) {
        lock(&self.all).values().for_each(|job| job.cancel());
    }
}

impl Job {
    /// Runs a process, telling its lines; none where it was cancelled.
    pub fn run(&self, work: Arc<dyn Work>, told: &mut dyn FnMut(&str)) -> Option<String> {
        *lock(&self.work) = Some(Arc::clone(&work));
        if self.cancelled() {
            work.stop();
        }
        let output = work.wait(told);
        if self.cancelled() { None } else { output }
    }

    /// Whether it was cancelled.
    pub fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::SeqCst)
    }

    /// Says what goes on.
    pub fn report(&self, message: String) {
        let message = Some(message);
        self.tell(WorkDoneProgress::Report(WorkDoneProgressReport { message, ..Default::default() }));
    }

    fn cancel(&self) {
        self.cancelled.store(true, Ordering::SeqCst);
        if let Some(work) = &*lock(&self.work) {
            work.stop();
        }
    }

    fn tell(&self, value: WorkDoneProgress) {
        if let Some(token) = self.token.clone() {
            let params = ProgressParams { token, value: ProgressParamsValue::WorkDone(value) };
            (self.out)(Message::Notification(Notification::new(Progress::METHOD.into(), params)));
        }
    }
}

/// Writes into the editor's log of the server.
pub(super) fn log(out: &Out, message: String) {
    let params = LogMessageParams { typ: MessageType::LOG, message };
    out(Notification::new(LogMessage::METHOD.into(), params).into());
}
