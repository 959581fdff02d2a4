//! Findings while typing: a thread of its own works them out, always for the newest texts.

use super::server::{Below, Fault, Texts, split};
use super::text::Lines;
use super::uri;
use crate::diagnostic::{Diagnostic, Origin, Severity, SourceMap};
use crate::elaborate::{Options, elaborate};
use crate::pipeline::{self, Compiler, Request};
use lsp_server::{Message, Notification};
use lsp_types::notification::{Notification as _, PublishDiagnostics};
use lsp_types::{
    DiagnosticRelatedInformation, DiagnosticSeverity, Location, NumberOrString, PublishDiagnosticsParams,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// Where messages go; an editor that went away needs none.
pub(super) type Out = Box<dyn Fn(Message) + Send>;

/// The other end of the thread.
pub(super) struct Findings {
    jobs: Sender<Job>,
    newest: Arc<AtomicU64>,
}

/// Texts to look at.
struct Job {
    number: u64,
    texts: Texts,
    versions: BTreeMap<String, i32>,
}

/// What was told of each text, so that the same is not told again.
type Told = BTreeMap<String, (i32, Vec<lsp_types::Diagnostic>)>;

/// Starts the thread; it ends when nobody can ask it any more.
pub(super) fn start(out: Out) -> Result<(Findings, JoinHandle<()>), Fault> {
    let (jobs, waiting) = channel();
    let newest = Arc::new(AtomicU64::new(0));
    let seen = Arc::clone(&newest);
    let thread =
        std::thread::Builder::new().name("findings".into()).spawn(move || work(&waiting, &seen, &out))?;
    Ok((Findings { jobs, newest }, thread))
}

impl Findings {
    /// Has the texts looked at as they are now; what was asked before and is not done is dropped.
    pub fn look(&self, texts: Texts, versions: BTreeMap<String, i32>) {
        let number = self.newest.fetch_add(1, Ordering::SeqCst) + 1;
        let _ = self.jobs.send(Job { number, texts, versions });
    }
}

fn work(waiting: &Receiver<Job>, newest: &AtomicU64, out: &Out) {
    let mut told = Told::new();
    while let Ok(job) = waiting.recv() {
        let job = waiting.try_iter().last().unwrap_or(job);
        let stale = || newest.load(Ordering::SeqCst) != job.number;
        told.retain(|path, _| {
            let open = job.versions.contains_key(path);
            if !open {
                publish(out, path, None, Vec::new());
            }
            open
        });
        // First what the text alone tells, at once; then what the conventional mechanism does.
        for deep in [false, true] {
            for (path, version) in &job.versions {
                if stale() {
                    break;
                }
                let found = look(path, &job.texts, deep);
                let new = (*version, found);
                if told.get(path) != Some(&new) && !stale() {
                    publish(out, path, Some(new.0), new.1.clone());
                    told.insert(path.clone(), new);
                }
            }
        }
    }
}

fn publish(out: &Out, path: &str, version: Option<i32>, diagnostics: Vec<lsp_types::Diagnostic>) {
    if let Some(uri) = uri::of(path) {
        let params = PublishDiagnosticsParams { uri, diagnostics, version };
        out(Notification::new(PublishDiagnostics::METHOD.into(), params).into());
    }
}

/// The findings of one text as the root of a design.
fn look(path: &str, texts: &Texts, deep: bool) -> Vec<lsp_types::Diagnostic> {
    let (folder, file) = split(path);
    let files = Below { folder, texts };
    let (found, sources) = if deep {
        let request = Request { source: file.into(), ..Request::default() };
        let out = pipeline::check(&request, &Compiler::default(), &files);
        (out.diagnostics, out.sources)
    } else {
        let out = elaborate(file, &files, &Options::default());
        (out.diagnostics, out.sources)
    };
    // A file of parts is no design, and need not be one.
    let text = sources.files.first().map_or("", |f| f.text.as_str());
    let parts = !crate::syntax::parse(0, text).file.items.is_empty();
    let told = found.iter().filter(|d| !(parts && d.code == "E0401"));
    told.map(|d| shown(d, folder, &sources)).collect()
}

/// A finding as the protocol has it. One in an imported file stands at the import, and leads there.
fn shown(d: &Diagnostic, folder: &str, sources: &SourceMap) -> lsp_types::Diagnostic {
    let place = |at: &Origin| -> Option<Location> {
        let file = sources.files.get(at.file as usize)?;
        let range = Lines::of(&file.text).range(&file.text, &(at.start as usize..at.end as usize));
        Some(Location::new(uri::of(&format!("{folder}/{}", file.name))?, range))
    };
    let primary = d.labels.first();
    let here = primary.is_none_or(|l| l.at.file == 0);
    let range = match primary {
        Some(l) if here => place(&l.at).map(|l| l.range).unwrap_or_default(),
        Some(l) => import(l.at.file, sources),
        None => Default::default(),
    };
    let mut message = d.message.clone();
    if let Some(file) = primary.filter(|_| !here).and_then(|l| sources.files.get(l.at.file as usize)) {
        message = format!("in `{}`: {message}", file.name);
    }
    for text in [primary.map(|l| l.text.as_str()), d.help.as_deref()].into_iter().flatten() {
        if !text.is_empty() {
            message.push_str(&format!("\n{text}"));
        }
    }
    let related: Vec<DiagnosticRelatedInformation> = d
        .labels
        .iter()
        .skip(usize::from(here))
        .filter_map(|l| {
            let message = if l.text.is_empty() { "here".into() } else { l.text.clone() };
            Some(DiagnosticRelatedInformation { location: place(&l.at)?, message })
        })
        .collect();
    lsp_types::Diagnostic {
        range,
        severity: Some(match d.severity {
            Severity::Error => DiagnosticSeverity::ERROR,
            Severity::Warning => DiagnosticSeverity::WARNING,
            Severity::Advice => DiagnosticSeverity::INFORMATION,
        }),
        code: Some(NumberOrString::String(d.code.clone())),
        source: Some("flexura".into()),
        message,
        related_information: (!related.is_empty()).then_some(related),
        ..Default::default()
    }
}

/// The line of the root file that imports another file, or its beginning.
fn import(file: u32, sources: &SourceMap) -> lsp_types::Range {
    let (Some(root), Some(other)) = (sources.files.first(), sources.files.get(file as usize)) else {
        return Default::default();
    };
    let names = super::names::Names::of(&crate::syntax::parse(0, &root.text).tree, &root.text);
    let found = names.uses.iter().find(|u| u.file && other.name == u.target);
    found.map(|u| Lines::of(&root.text).range(&root.text, &u.at)).unwrap_or_default()
}
