//! Builds what is shown. One thread follows the newest text and the newest parameters: first the outline, which takes a
//! moment, then the optimisation where one is due; another one makes solids once nothing has changed for a while. What
//! comes too late is thrown away, and nobody who asks for the page waits for any of it.

use super::super::Common;
use super::super::artefacts::write_atomic;
use super::super::commands::{Opened, open};
use super::super::lints::LintFlags;
use super::super::sources;
use super::files::{Input, Snapshot};
use super::stages::Shown;
use super::state::{Solving, Told, sliders};
use flexura::diagnostic::{Diagnostic, Severity, SourceMap, terminal};
use flexura::emit::lock::{Lock, LockState};
use flexura::ir::Assembly;
use flexura::pipeline::{
    self, BuildOutcome, Compiler, Iteration, NothingMade, Parameter, Progress, Request, Stage, Stages,
    placeless,
};
use std::collections::{BTreeMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Solids are begun when nothing has changed for so long: a slider that moves needs none.
const QUIET: Duration = Duration::from_millis(500);
/// Solved values that are remembered: going back to an earlier text or slider finds its own.
const REMEMBERED: usize = 16;
/// Columns of a finding in the page.
const WIDTH: usize = 96;

/// What is asked of the view as a whole.
pub struct Asked {
    /// The design.
    pub common: Common,
    /// Which findings are told.
    pub lints: LintFlags,
    /// The real work.
    pub compiler: Compiler,
}

/// See the module.
pub struct Engine {
    asked: Asked,
    inner: Mutex<Inner>,
    changed: Condvar,
}

#[derive(Default)]
struct Inner {
    /// Rises with everything that is told.
    serial: u64,
    told: Told,
    page: Option<Arc<String>>,
    /// Number of the newest wish, and of the one that was taken up last.
    wanted: u64,
    taken: u64,
    /// Parameters in place of those that are written.
    set: BTreeMap<String, String>,
    /// An optimisation was asked for.
    solve: bool,
    /// Of the run at work.
    cancel: Arc<AtomicBool>,
    ended: bool,
    inputs: Vec<Input>,
    known: Vec<Parameter>,
    /// Locks of this session, the newest last.
    locks: VecDeque<String>,
    solids: Option<Solids>,
}

/// What the second thread has to do.
struct Solids {
    wish: u64,
    request: Request,
    files: Arc<Snapshot>,
    since: Instant,
}

/// A wish as it was when it was taken up.
struct Wish {
    number: u64,
    set: BTreeMap<String, String>,
    solve: bool,
    cancel: Arc<AtomicBool>,
}

impl Engine {
    /// Nothing is shown yet; the first wish is there.
    pub fn new(asked: Asked) -> Self {
        let inner = Inner { wanted: 1, ..Inner::default() };
        Self { asked, inner: Mutex::new(inner), changed: Condvar::new() }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is told, and tells it.
    fn tell(&self, change: impl FnOnce(&mut Inner)) {
        let mut inner = self.inner();
        change(&mut inner);
        inner.serial += 1;
        drop(inner);
        self.changed.notify_all();
    }

    /// The page, if there is one, and its number.
    pub fn page(&self) -> (u64, Option<Arc<String>>) {
        let inner = self.inner();
        (inner.told.version, inner.page.clone())
    }

    /// What goes on as JSON with its number, as soon as that is not `after`; none when nothing has changed for so long,
    /// or all has ended.
    pub fn next(&self, after: u64, patience: Duration) -> Option<(u64, String)> {
        let inner = self.inner();
        let waits = |inner: &mut Inner| inner.serial == after && !inner.ended;
        let (inner, _) =
            self.changed.wait_timeout_while(inner, patience, waits).unwrap_or_else(PoisonError::into_inner);
        if inner.serial == after || inner.ended {
            return None;
        }
        Some((inner.serial, serde_json::to_string(&inner.told).ok()?))
    }

    /// Whether all has ended.
    pub fn has_ended(&self) -> bool {
        self.inner().ended
    }

    /// What the last run has read.
    pub fn inputs(&self) -> Vec<Input> {
        self.inner().inputs.clone()
    }

    // ---- wishes ----

    fn wish(&self, change: impl FnOnce(&mut Inner)) {
        self.tell(|inner| {
            change(inner);
            inner.wanted += 1;
            inner.cancel.store(true, Ordering::SeqCst);
        });
    }

    /// A file has changed.
    pub fn saved(&self) {
        self.wish(|inner| inner.solve = false);
    }

    /// Sets a parameter; false where there is none of this name.
    pub fn set(&self, path: &str, value: &str) -> bool {
        let known = self.inner().told.parameters.iter().find(|p| p.path == path).cloned();
        let Some(known) = known else { return false };
        let value = value.trim().to_string();
        if known.set.as_deref().unwrap_or(&known.text) != value {
            self.wish(|inner| {
                inner.solve = false;
                if value == known.text {
                    inner.set.remove(path)
                } else {
                    inner.set.insert(path.into(), value)
                };
            });
        }
        true
    }

    /// All parameters as they are written.
    pub fn reset(&self) {
        self.wish(|inner| {
            inner.solve = false;
            inner.set.clear();
        });
    }

    /// Optimises with the present parameters.
    pub fn solve(&self) {
        if !self.inner().told.solving.as_ref().is_some_and(|s| s.running) {
            self.wish(|inner| inner.solve = true);
        }
    }

    /// Ends an optimisation; its best point is kept.
    pub fn stop(&self) {
        self.inner().cancel.store(true, Ordering::SeqCst);
    }

    /// Ends everything.
    pub fn end(&self) {
        self.tell(|inner| {
            inner.ended = true;
            inner.cancel.store(true, Ordering::SeqCst);
        });
    }

    // ---- the first thread ----

    /// Follows the wishes until the end.
    pub fn follow(&self) {
        loop {
            let inner = self.inner();
            let waits = |inner: &mut Inner| inner.wanted == inner.taken && !inner.ended;
            let mut inner = self.changed.wait_while(inner, waits).unwrap_or_else(PoisonError::into_inner);
            if inner.ended {
                return;
            }
            inner.taken = inner.wanted;
            inner.cancel = Arc::default();
            inner.solids = None;
            // Its curve is of other parameters or another text.
            inner.told.solving = None;
            let wish = Wish {
                number: inner.wanted,
                set: inner.set.clone(),
                solve: std::mem::take(&mut inner.solve),
                cancel: Arc::clone(&inner.cancel),
            };
            drop(inner);
            self.phase("reading");
            // Whatever happens to one text, the next one is looked at.
            if catch_unwind(AssertUnwindSafe(|| self.grant(&wish))).is_err() {
                let message = "the compiler has met a fault of its own with this text; please report it";
                let fault = placeless(Severity::Error, "E0757", message);
                self.fault(&wish, &[fault], &SourceMap::default());
            }
        }
    }

    fn phase(&self, phase: &'static str) {
        self.tell(|inner| inner.told.phase = phase);
    }

    fn is_late(&self, wish: u64) -> bool {
        self.inner().wanted != wish
    }

    fn grant(&self, wish: &Wish) {
        sources::forget();
        let levels = match open(&self.asked.common) {
            Ok(opened) => self.asked.lints.levels(opened.folder.root()).map(|levels| (opened, levels)),
            Err((path, why)) => {
                // Whatever it becomes is another one.
                self.tell(|inner| inner.inputs = vec![(source_of(&self.asked.common), None)]);
                let message = format!("cannot read `{}`: {why}", path.display());
                return self.fault(
                    wish,
                    &[placeless(Severity::Error, "E0730", message)],
                    &SourceMap::default(),
                );
            }
        };
        let seen = sources::seen().into_iter().filter(|(p, _)| p.extension().is_some_and(|e| e == "toml"));
        let seen: Vec<Input> = seen.collect();
        let (mut opened, levels) = match levels {
            Ok(both) => both,
            Err(stopped) => {
                self.tell(|inner| inner.inputs.extend(seen));
                return self.fault(wish, &stopped.diagnostics, &stopped.sources);
            }
        };
        let lock_path = match opened.read_lock(&self.asked.common, std::path::Path::new("out")) {
            Ok(path) => path,
            Err((path, why)) => {
                let message = format!("cannot read `{}`: {why}", path.display());
                return self.fault(
                    wish,
                    &[placeless(Severity::Error, "E0730", message)],
                    &SourceMap::default(),
                );
            }
        };
        let Opened { folder, mut request, .. } = opened;
        request.levels = levels;
        let files = Arc::new(Snapshot::of(folder));
        let quick = Shown { compiler: self.asked.compiler, whole: false };

        // As it is written: what its parameters are, whatever they are set to.
        let variant = request.variant.clone();
        let check =
            |set: &[(String, String)]| quick.check(&request.source, set, None, variant.as_deref(), &*files);
        let written = check(&[]);
        let known = pipeline::parameters(&written);
        let errors = written.diagnostics.iter().any(Diagnostic::is_error);
        let is_there = |path: &String| errors || known.iter().any(|p| p.path == *path);
        let set: BTreeMap<String, String> =
            wish.set.iter().filter(|(path, _)| is_there(path)).map(|(p, v)| (p.clone(), v.clone())).collect();
        self.tell(|inner| {
            inner.inputs = files.inputs();
            inner.inputs.extend(seen);
            if inner.wanted == wish.number {
                inner.set.clone_from(&set);
            }
            if !errors {
                inner.told.parameters = sliders(&known, &inner.set);
                inner.known.clone_from(&known);
            }
        });
        let Some(assembly) = written.assembly.filter(|_| !errors) else {
            return self.fault(wish, &written.diagnostics, &written.sources);
        };
        request.overrides = set.into_iter().collect();
        let assembly = if request.overrides.is_empty() {
            assembly
        } else {
            let under = check(&request.overrides);
            match under.assembly.filter(|_| !under.diagnostics.iter().any(Diagnostic::is_error)) {
                Some(assembly) => assembly,
                None => return self.fault(wish, &under.diagnostics, &under.sources),
            }
        };

        // The values: a lock of this text if there is one, else those of the newest one as they are.
        let stored = request.lock.take().map(|(_, text)| text);
        let locks: Vec<String> = stored.into_iter().chain(self.inner().locks.iter().rev().cloned()).collect();
        let current = locks.iter().find(|text| fits(&assembly, text)).cloned();
        let newest = self.inner().locks.back().cloned();
        let start = current.clone().or(newest).or(locks.first().cloned());
        let name = lock_path.display().to_string();
        request.lock = start.map(|text| (name.clone(), text));
        let finished = current.as_deref().is_some_and(is_converged);
        let solvable =
            assembly.designs.iter().any(|d| !d.free.is_empty() && d.all_objectives().next().is_some());
        let due = solvable && (current.is_none() && request.overrides.is_empty() || wish.solve && !finished);
        self.tell(|inner| {
            inner.told.stale = solvable && current.is_none();
            inner.told.unfinished = solvable && current.is_some() && !finished;
            inner.told.solvable = solvable;
        });

        let idle = Shown { compiler: Compiler { iterations: 0, ..self.asked.compiler }, whole: false };
        let mut out = self.build(&request, &idle, &files, &Quiet, &wish.cancel);
        if !self.publish(wish.number, &mut out, false) {
            return self.failed(wish, &out);
        }
        // The values that are shown, whatever they are worth: solids are made of these.
        let shown = out.lock.take().map(|text| (name.clone(), text)).or(request.lock.clone());
        if !due {
            return self.hand_on(wish, Request { lock: shown, ..request }, files);
        }

        request.resume = wish.solve;
        let watched = Watched { engine: self, wish: wish.number, began: Instant::now() };
        self.tell(|inner| {
            inner.told.phase = "optimising";
            inner.told.solving = Some(Solving { running: true, ..Solving::default() });
        });
        let mut out = self.build(&request, &quick, &files, &watched, &wish.cancel);
        self.tell(|inner| {
            if let Some(solving) = &mut inner.told.solving {
                solving.running = false;
            }
            if let Some(lock) = &out.lock {
                inner.locks.push_back(lock.clone());
                if inner.locks.len() > REMEMBERED {
                    inner.locks.pop_front();
                }
            }
        });
        let Some(text) = out.lock.take() else { return self.failed(wish, &out) };
        // A newer text goes on from the best point found, and only its own result is worth a file.
        if request.overrides.is_empty()
            && !self.is_late(wish.number)
            && let Err(e) = write_atomic(&lock_path, text.as_bytes())
        {
            out.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
            return self.failed(wish, &out);
        }
        let finished = is_converged(&text);
        self.tell(|inner| {
            if inner.wanted == wish.number {
                (inner.told.stale, inner.told.unfinished) = (false, !finished);
            }
        });
        if !self.publish(wish.number, &mut out, false) {
            return self.failed(wish, &out);
        }
        request.resume = false;
        self.hand_on(wish, Request { lock: Some((name, text)), ..request }, files);
    }

    fn build(
        &self,
        request: &Request,
        stages: &Shown,
        files: &Snapshot,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> BuildOutcome {
        let out = pipeline::build_upon(request, &NothingMade, stages, files, progress, cancel);
        // What only a build reads is watched as well.
        let more = files.inputs();
        self.tell(|inner| {
            let new =
                more.into_iter().filter(|m| inner.inputs.iter().all(|i| i.0 != m.0)).collect::<Vec<_>>();
            inner.inputs.extend(new);
        });
        out
    }

    /// Shows the report of an outcome, if it has one and nothing newer is wanted; whether it has one.
    fn publish(&self, wish: u64, out: &mut BuildOutcome, whole: bool) -> bool {
        let page = out.artefacts.iter_mut().find(|a| a.name.ends_with(".html"));
        let Some(text) = page.and_then(|a| String::from_utf8(std::mem::take(&mut a.bytes)).ok()) else {
            return false;
        };
        self.tell(|inner| {
            if inner.wanted == wish {
                inner.page = Some(Arc::new(text));
                inner.told.version += 1;
                inner.told.whole = whole;
                inner.told.fault = None;
            }
        });
        true
    }

    fn failed(&self, wish: &Wish, out: &BuildOutcome) {
        self.fault(wish, &out.diagnostics, &out.sources);
    }

    /// Tells why there is no newer page.
    fn fault(&self, wish: &Wish, found: &[Diagnostic], sources: &SourceMap) {
        let mut found = found.to_vec();
        found.sort_by_key(|d| std::cmp::Reverse(d.severity));
        let text = terminal::render(&found, sources, terminal::Style { color: false, width: WIDTH });
        self.tell(|inner| {
            if inner.wanted == wish.number {
                inner.told.fault = Some(text.trim().to_string());
                inner.told.phase = "";
            }
        });
    }

    /// Leaves the rest to the other thread.
    fn hand_on(&self, wish: &Wish, request: Request, files: Arc<Snapshot>) {
        self.tell(|inner| {
            if inner.wanted == wish.number {
                inner.told.phase = "solids";
                inner.solids = Some(Solids { wish: wish.number, request, files, since: Instant::now() });
            }
        });
    }

    // ---- the second thread ----

    /// Makes solids until the end.
    pub fn make_solids(&self) {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(rayon::current_num_threads().saturating_sub(1).max(1));
        let pool = pool.build().ok();
        loop {
            let inner = self.inner();
            let waits = |inner: &mut Inner| inner.solids.is_none() && !inner.ended;
            let mut inner = self.changed.wait_while(inner, waits).unwrap_or_else(PoisonError::into_inner);
            if inner.ended {
                return;
            }
            let rest =
                inner.solids.as_ref().map_or(Duration::ZERO, |s| QUIET.saturating_sub(s.since.elapsed()));
            if !rest.is_zero() {
                drop(inner);
                std::thread::sleep(rest);
                continue;
            }
            let Some(job) = inner.solids.take() else { continue };
            drop(inner);
            // Values as they are: nothing is optimised here.
            let compiler = Compiler { iterations: 0, ..self.asked.compiler };
            let all = Shown { compiler, whole: true };
            let cancel = AtomicBool::new(false);
            let run = || pipeline::build_upon(&job.request, &NothingMade, &all, &*job.files, &Quiet, &cancel);
            let made = catch_unwind(AssertUnwindSafe(|| match &pool {
                Some(pool) => pool.install(run),
                None => run(),
            }));
            if let Ok(mut out) = made {
                self.publish(job.wish, &mut out, true);
            }
            self.tell(|inner| {
                if inner.wanted == job.wish {
                    inner.told.phase = "";
                }
            });
        }
    }
}

/// Whether a lock holds the values of just these designs.
fn fits(assembly: &Assembly, text: &str) -> bool {
    let Ok(lock) = Lock::parse(text, 0) else { return false };
    let several = assembly.designs.len() > 1;
    assembly.designs.iter().all(|d| {
        let own = if several { lock.part(&d.name) } else { lock.clone() };
        own.state(d) == LockState::Current
    })
}

fn is_converged(text: &str) -> bool {
    Lock::parse(text, 0).is_ok_and(|lock| match lock.named.is_empty() {
        true => lock.solution.converged,
        false => lock.named.values().all(|h| h.converged),
    })
}

/// Tells nothing.
struct Quiet;

impl Progress for Quiet {
    fn seconds(&self) -> f64 {
        0.0
    }
}

/// Tells the page what the optimiser does.
struct Watched<'e> {
    engine: &'e Engine,
    wish: u64,
    began: Instant,
}

impl Progress for Watched<'_> {
    fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn stage(&self, stage: Stage) {
        if stage == Stage::Simulate {
            self.engine.tell(|inner| {
                if inner.wanted == self.wish {
                    inner.told.phase = "simulating";
                }
            });
        }
    }

    fn design(&self, name: &str) {
        self.engine.tell(|inner| {
            inner.told.solving = Some(Solving { design: name.into(), running: true, ..Solving::default() });
        });
    }

    fn iteration(&self, iteration: &Iteration) {
        self.engine.tell(|inner| {
            if let Some(solving) = &mut inner.told.solving {
                solving.note(iteration);
            }
        });
    }
}

/// Where the source stands: it is watched also while it is missing.
pub fn source_of(common: &Common) -> PathBuf {
    std::path::absolute(&common.source).unwrap_or_else(|_| common.source.clone())
}
