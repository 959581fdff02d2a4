//! What the solver finds: the compliant mechanism is simulated after a text was opened or saved, with the lock's values
//! where it is current, else with the design's start. It takes seconds, so it is done by a process of its own, which ends
//! at the next keystroke.

use super::Host;
use super::findings::{Board, Depth, Found, Job, lock, settled};
use super::server::{Below, Texts, split};
use super::space::Space;
use crate::diagnostic::{Diagnostic, SourceMap};
use crate::lint::Stage;
use crate::pipeline::{self, BuildOutcome, Compiler, Extent, Measures, Origin, Request, Values};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

/// What the process is asked: a design, and the texts that the editor has instead of the disk.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Question {
    /// Absolute path of the root file.
    path: String,
    /// By absolute path.
    open: BTreeMap<String, String>,
}

/// What it answers.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Reply {
    pub diagnostics: Vec<Diagnostic>,
    pub sources: SourceMap,
    /// One line of numbers; none where nothing could be simulated.
    pub summary: Option<String>,
}

impl Question {
    pub fn new(path: &str, texts: &Texts) -> Self {
        let open = texts.open.iter().map(|(p, t)| (p.clone(), t.to_string())).collect();
        Self { path: path.into(), open }
    }

    /// As the process reads it.
    pub fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Answers a question of the language server in a process of its own: JSON in, JSON out.
///
/// # Errors
/// Where it is none.
pub fn solve(question: &str, host: Arc<dyn Host>) -> Result<String, String> {
    let question: Question = serde_json::from_str(question).map_err(|e| e.to_string())?;
    let open = question.open.into_iter().map(|(p, t)| (p, t.into())).collect();
    let texts = Texts { open, host };
    serde_json::to_string(&solved(&question.path, &texts)).map_err(|e| e.to_string())
}

/// Everything that can be said of a design without changing its values or meshing it.
fn solved(path: &str, texts: &Texts) -> Reply {
    let (folder, file) = split(path);
    let files = Below { folder, texts };
    let name = lock_name(file);
    let lock = texts.host.read(folder, &name).ok().map(|text| (name, text));
    let levels = texts.host.levels(folder);
    let request = Request { source: file.into(), lock, levels, ..Request::default() };
    let checked = pipeline::check(&request, &Compiler::default(), &files);
    let mut reply = Reply { diagnostics: checked.diagnostics, sources: checked.sources, ..Reply::default() };
    if reply.diagnostics.iter().any(Diagnostic::is_error) {
        return reply;
    }
    let found =
        pipeline::examine(&request, Values::LockOrStart, Extent::Measures, &Compiler::default(), &files);
    let BuildOutcome { mut diagnostics, after, requirements, solved_from, .. } = found.outcome;
    let same = |a: &Diagnostic, b: &Diagnostic| {
        let place = |d: &Diagnostic| d.labels.first().map(|l| l.at);
        a.code == b.code && a.message == b.message && place(a) == place(b)
    };
    // What is required is required of the solution, not of the start.
    let locked = solved_from == Origin::Lock;
    request.levels.apply(&mut diagnostics, &reply.sources, &checked.files, Stage::Text);
    for d in diagnostics {
        if (locked || d.code != "E0801") && !reply.diagnostics.iter().any(|o| same(o, &d)) {
            reply.diagnostics.push(d);
        }
    }
    reply.summary = after.map(|after| {
        let from = if locked { "with the lock's values" } else { "at the start, not solved yet" };
        let hold = requirements.iter().filter(|r| r.pass).count();
        let required = match requirements.len() {
            0 => String::new(),
            all => format!("; {hold} of {all} requirements hold"),
        };
        format!("{from}: {}{required}", summary(&after))
    });
    reply
}

/// The measures in one line.
pub(super) fn summary(m: &Measures) -> String {
    let mut parts = Vec::new();
    parts.extend(
        m.traces
            .iter()
            .filter(|(_, t)| t.max_error_mm.is_finite())
            .map(|(name, t)| format!("{name} is {:.2} mm off its target at most", t.max_error_mm)),
    );
    parts.extend(m.drives.iter().map(|(name, d)| {
        let (_, size, unit) = d.parts();
        format!("{name} needs {size:.1} {unit} at most")
    }));
    parts.extend(m.stress.max_mpa.map(|s| format!("stress up to {s:.1} MPa")));
    parts.extend(m.gap.least_mm.map(|g| format!("gaps down to {g:.2} mm")));
    parts.join(", ")
}

/// The lock of a design.
pub(super) fn lock_name(file: &str) -> String {
    format!("{}.lock", file.trim_end_matches(".mech"))
}

/// Digest of all that a design is made of: its files and its lock.
pub(super) fn key(path: &str, texts: &Texts) -> String {
    let (folder, file) = split(path);
    let space = Space::read(file, &Below { folder, texts });
    let mut hash = Sha256::new();
    for (name, text) in &space.files {
        for part in [name, &text.text] {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
    }
    hash.update(texts.host.read(folder, &lock_name(file)).unwrap_or_default());
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

/// The thread.
pub(super) fn work(waiting: &Receiver<Arc<Job>>, board: &Board) {
    while let Some(job) = settled(waiting) {
        lock(&board.solved).retain(|path, _| job.versions.contains_key(path));
        let first = job.settled.iter();
        let rest = job.versions.keys().filter(|p| job.settled.as_ref() != Some(p));
        for path in first.chain(rest).filter(|p| job.versions.contains_key(*p)) {
            if board.stale(job.number) {
                break;
            }
            let key = key(path, &job.texts);
            let known = lock(&board.solved).get(path).filter(|(of, _)| *of == key).map(|(_, f)| f.clone());
            // Known where an edit was taken back, or another file was opened.
            if let Some(found) = known {
                board.tell(&job, path, Depth::Solver, found);
            } else if job.settled.is_some()
                && let Some(Reply { diagnostics, sources, .. }) = ask(path, &job, board)
            {
                let found = Found { diagnostics, sources };
                lock(&board.solved).insert(path.clone(), (key, found.clone()));
                board.tell(&job, path, Depth::Solver, found);
            }
        }
    }
}

/// Has a process simulate a design; none where it was stopped or could not be started.
fn ask(path: &str, job: &Job, board: &Board) -> Option<Reply> {
    let (folder, _) = split(path);
    let arguments = ["lsp".to_string(), "--solve".to_string()];
    let question = Question::new(path, &job.texts).text();
    let work = job.texts.host.start(folder, &arguments, question).ok()?;
    *lock(&board.running) = Some(Arc::clone(&work));
    // The text may have moved on before there was anything to stop.
    if board.stale(job.number) {
        board.stop();
    }
    let reply = work.wait(&mut |_| ());
    lock(&board.running).take();
    serde_json::from_str(&reply?).ok()
}
