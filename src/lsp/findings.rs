//! Findings while typing. Threads beside the loop work them out, always for the newest texts: one what the text alone
//! tells, one what the conventional mechanism does, one what the solver finds (`solver`). None waits for a slower one,
//! and what was found of older texts is dropped.

use super::server::{Below, Fault, Texts, split};
use super::shown::Shown;
use super::{Work, solver, uri};
use crate::diagnostic::{Diagnostic, SourceMap};
use crate::elaborate::{Options, elaborate};
use crate::pipeline::{self, Compiler, Request};
use lsp_server::{Message, Notification};
use lsp_types::PublishDiagnosticsParams;
use lsp_types::notification::{Notification as _, PublishDiagnostics};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Where messages go; an editor that went away needs none.
pub(super) type Out = Arc<dyn Fn(Message) + Send + Sync>;

/// The mechanism is looked at once nothing has been typed for so long: until then the text's findings are what counts.
const PAUSE: Duration = Duration::from_millis(60);

/// Texts to look at.
pub(super) struct Job {
    pub number: u64,
    pub texts: Texts,
    pub versions: BTreeMap<String, i32>,
    /// The file that was opened or saved just now: it is solved as well.
    pub settled: Option<String>,
}

/// How much a set of findings knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Depth {
    Text,
    Mechanism,
    Solver,
}

/// Findings of a design, with the texts they point into.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    pub diagnostics: Vec<Diagnostic>,
    pub sources: SourceMap,
}

struct Told {
    number: u64,
    depth: Depth,
    version: i32,
    shown: Vec<lsp_types::Diagnostic>,
    found: Arc<Found>,
}

/// What the editor has been told of each text.
pub(super) struct Board {
    out: Out,
    newest: AtomicU64,
    told: Mutex<BTreeMap<String, Told>>,
    /// What the solver found of each design, with the key of its texts.
    pub solved: Mutex<BTreeMap<String, (String, Found)>>,
    /// The solver's process.
    pub running: Mutex<Option<Arc<dyn Work>>>,
}

pub(super) fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Board {
    /// Whether the texts have moved on since.
    pub fn stale(&self, number: u64) -> bool {
        self.newest.load(Ordering::SeqCst) != number
    }

    /// Tells the findings of a text, unless it has moved on or more is known of it. The same is not told twice.
    pub fn tell(&self, job: &Job, path: &str, depth: Depth, found: Found) {
        let Some(version) = job.versions.get(path).copied() else { return };
        let shown = as_shown(path, &found);
        let mut told = lock(&self.told);
        let known = told.get(path);
        if self.stale(job.number) || known.is_some_and(|t| t.number == job.number && t.depth > depth) {
            return;
        }
        if known.is_none_or(|t| t.version != version || t.shown != shown) {
            self.publish(path, Some(version), shown.clone());
        }
        told.insert(path.into(), Told { number: job.number, depth, version, shown, found: Arc::new(found) });
    }

    /// The findings of a text as it is now, if any are known yet.
    pub fn newest(&self, path: &str) -> Option<Arc<Found>> {
        let told = lock(&self.told);
        told.get(path).filter(|t| !self.stale(t.number)).map(|t| Arc::clone(&t.found))
    }

    /// Takes back what was told of files that are no longer open.
    fn forget(&self, job: &Job) {
        lock(&self.told).retain(|path, _| {
            let open = job.versions.contains_key(path);
            if !open {
                self.publish(path, None, Vec::new());
            }
            open
        });
    }

    fn publish(&self, path: &str, version: Option<i32>, diagnostics: Vec<lsp_types::Diagnostic>) {
        if let Some(uri) = uri::of(path) {
            let params = PublishDiagnosticsParams { uri, diagnostics, version };
            (self.out)(Notification::new(PublishDiagnostics::METHOD.into(), params).into());
        }
    }

    /// Ends the solver's process, if there is one.
    pub fn stop(&self) {
        if let Some(work) = lock(&self.running).take() {
            work.stop();
        }
    }
}

/// The other end of the threads.
pub(super) struct Findings {
    pub board: Arc<Board>,
    threads: Vec<Sender<Arc<Job>>>,
    last: Mutex<Option<Arc<Job>>>,
}

/// Starts the threads; they end when nobody can ask them any more.
pub(super) fn start(out: Out) -> Result<(Arc<Findings>, Vec<JoinHandle<()>>), Fault> {
    let newest = AtomicU64::new(0);
    let (told, solved, running) = Default::default();
    let board = Arc::new(Board { out, newest, told, solved, running });
    let (mut threads, mut handles) = (Vec::new(), Vec::new());
    type Thread = fn(&Receiver<Arc<Job>>, &Board);
    let all: [(&str, Thread); 3] = [("text", text), ("mechanism", mechanism), ("solver", solver::work)];
    for (name, thread) in all {
        let (jobs, waiting) = channel();
        let board = Arc::clone(&board);
        let run = move || thread(&waiting, &board);
        handles.push(std::thread::Builder::new().name(name.into()).spawn(run)?);
        threads.push(jobs);
    }
    Ok((Arc::new(Findings { board, threads, last: Mutex::new(None) }), handles))
}

impl Findings {
    /// Has the texts looked at as they are now; what was asked before and is not done is dropped.
    pub fn look(&self, texts: Texts, versions: BTreeMap<String, i32>, settled: Option<String>) {
        let mut last = lock(&self.last);
        let number = self.board.newest.fetch_add(1, Ordering::SeqCst) + 1;
        self.board.stop();
        let job = Arc::new(Job { number, texts, versions, settled });
        for thread in &self.threads {
            let _ = thread.send(Arc::clone(&job));
        }
        *last = Some(job);
    }

    /// Has the same texts looked at again: something beside them has changed, such as the lock.
    pub fn again(&self, path: &str) {
        let last = lock(&self.last).clone();
        if let Some(job) = last {
            self.look(job.texts.clone(), job.versions.clone(), Some(path.into()));
        }
    }

    /// The number of the texts as they are now.
    pub fn number(&self) -> u64 {
        self.board.newest.load(Ordering::SeqCst)
    }
}

fn text(waiting: &Receiver<Arc<Job>>, board: &Board) {
    while let Ok(job) = waiting.recv() {
        let job = waiting.try_iter().last().unwrap_or(job);
        board.forget(&job);
        for path in job.versions.keys() {
            if board.stale(job.number) {
                break;
            }
            let (folder, file) = split(path);
            let out = elaborate(file, &Below { folder, texts: &job.texts }, &Options::default());
            let found = Found { diagnostics: out.diagnostics, sources: out.sources };
            board.tell(&job, path, Depth::Text, found);
        }
    }
}

fn mechanism(waiting: &Receiver<Arc<Job>>, board: &Board) {
    while let Some(job) = settled(waiting) {
        for path in job.versions.keys() {
            if board.stale(job.number) {
                break;
            }
            board.tell(&job, path, Depth::Mechanism, checked(&job.texts, path));
        }
    }
}

/// The newest job, once no other has come for a while.
pub(super) fn settled(waiting: &Receiver<Arc<Job>>) -> Option<Arc<Job>> {
    let mut job = waiting.recv().ok()?;
    loop {
        match waiting.recv_timeout(PAUSE) {
            Ok(newer) => job = newer,
            Err(RecvTimeoutError::Timeout) => return Some(job),
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
}

/// What `flexura check` would say of a text as the root of a design, without its lock.
pub(super) fn checked(texts: &Texts, path: &str) -> Found {
    let (folder, file) = split(path);
    let levels = texts.host.levels(folder);
    let request = Request { source: file.into(), levels, ..Request::default() };
    let out = pipeline::check(&request, &Compiler::default(), &Below { folder, texts });
    Found { diagnostics: out.diagnostics, sources: out.sources }
}

fn as_shown(path: &str, found: &Found) -> Vec<lsp_types::Diagnostic> {
    let (folder, _) = split(path);
    // A file of parts is no design, and need not be one.
    let parts = || {
        let text = found.sources.files.first().map_or("", |f| f.text.as_str());
        !crate::syntax::parse(0, text).file.items.is_empty()
    };
    let told = found.diagnostics.iter().filter(|d| d.code != "E0401" || !parts());
    let mut shown = Shown::new(folder, &found.sources);
    told.map(|d| shown.of(d)).collect()
}
