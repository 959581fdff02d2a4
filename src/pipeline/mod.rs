//! The whole way from text to artefacts, as one function to be read from top to bottom. No I/O here:
//! files come in through [`Files`], artefacts go out as names and bytes, time and threads come from outside.

mod aims;
mod assembly;
mod bill;
mod code;
mod compiler;
mod examine;
mod gravity;
mod history;
mod joined;
mod lay;
mod lints;
mod manifest;
mod measure;
mod page;
mod parameters;
mod products;
mod progress;
mod reach;
mod refit;
mod report;
mod scene;
mod solids;
mod stability;
mod stages;

pub use aims::{AimSeries, DirectionMeasures, OutputMeasures};
pub use compiler::{Compiler, EDGES};
pub use examine::{Examined, Extent, Values, examine};
pub use history::History;
pub use joined::Planned;
pub use manifest::COMPILER;
pub use measure::{aggregate, check_requirements, is_closed, measure};
pub use parameters::{Parameter, of as parameters};
pub use progress::{Iteration, Progress, Stage};
pub use report::{
    Artefact, BuildOutcome, DriveMeasures, GapMeasures, Kept, Measures, Origin, Place, RequirementResult,
    Seconds, StressMeasures, TraceMeasures, Worst,
};
pub use stability::{DriveValues, LimitPoint, RestState, SnapThrough, Stability};
pub use stages::{
    Between, Checked, Failed, Made, NothingMade, Parts, Plans, Response, Simulation, Solved, Stages,
};

use crate::diagnostic::{Diagnostic, Severity};
pub use crate::elaborate::{FileError, Files, MOST_SOLID_BYTES, SolidFile};
use crate::emit::lock::{Lock, LockState};
use crate::ir::{Assembly, Design, Solution};
use crate::lint::{Levels, Stage as Reached};
use std::sync::atomic::AtomicBool;

/// What is to be built.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Path of the source, relative to the design's folder.
    pub source: String,
    /// `--set NAME=EXPRESSION`.
    pub overrides: Vec<(String, String)>,
    /// `--steps`.
    pub steps: Option<usize>,
    /// `--variant`.
    pub variant: Option<String>,
    /// Of [`simulate`] only: under this load case.
    pub case: Option<String>,
    /// The lock as it stands: its name and text.
    pub lock: Option<(String, String)>,
    /// Ignore the lock, and what has been made before.
    pub fresh: bool,
    /// Go on from a lock whose solution had not converged.
    pub resume: bool,
    /// Refuse to solve: the lock must be current.
    pub frozen: bool,
    /// Which findings are told, and how loudly.
    pub levels: Levels,
}

/// Which motion `simulate` shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Show {
    /// The conventional mechanism's.
    pub rigid: bool,
    /// With the pose of every moving body.
    pub poses: bool,
}

/// Text to artefacts, into an empty folder.
pub fn build(
    request: &Request,
    stages: &dyn Stages,
    files: &dyn Files,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> BuildOutcome {
    build_upon(request, &NothingMade, stages, files, progress, cancel)
}

/// Text to artefacts. Where `made` holds those of just this design, the outcome only tells what their build told.
pub fn build_upon(
    request: &Request,
    made: &dyn Made,
    stages: &dyn Stages,
    files: &dyn Files,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> BuildOutcome {
    let began = progress.seconds();
    let mut out = BuildOutcome::default();
    run_build(request, made, stages, files, progress, cancel, &mut out);
    lints::finish(request, &mut out);
    out.seconds.total = progress.seconds() - began;
    out
}

/// `None` ends the way early; `out` then holds what was reached and why not more.
fn run_build(
    request: &Request,
    made: &dyn Made,
    stages: &dyn Stages,
    files: &dyn Files,
    progress: &dyn Progress,
    cancel: &AtomicBool,
    out: &mut BuildOutcome,
) -> Option<()> {
    // Text to design, and the conventional mechanism as a check of it.
    let clock = Clock::start(progress, Stage::Check);
    let assembly = front_end(request, stages, files, out);
    clock.stop(&mut out.seconds.check);
    let assembly = assembly?;
    let checked = out.diagnostics.len();
    // What is denied and known by now need not be solved first.
    if lints::denied(request, out) {
        return None;
    }

    // Designs to values.
    let clock = Clock::start(progress, Stage::Solve);
    let solutions = solve_all(request, &assembly, stages, progress, cancel, out);
    clock.stop(&mut out.seconds.solve);
    let solutions = solutions?;
    let pairs = || assembly.designs.iter().zip(&solutions);
    let values: Vec<Vec<f64>> = pairs().map(|(design, solution)| values_of(design, solution)).collect();

    // Nothing to do where all of it has been done.
    let clock = Clock::start(progress, Stage::Emit);
    let mut fingerprint = manifest::Fingerprint::of(&assembly, &values);
    if page::is_asked(&assembly) {
        fingerprint = fingerprint.with(&page::told_early(request, out, checked));
    }
    let recalled = if request.fresh { None } else { manifest::recall(made, &request.source, &fingerprint) };
    clock.stop(&mut out.seconds.emit);
    if let Some(recalled) = recalled {
        (out.before, out.after, out.kept) = (recalled.before, recalled.after, recalled.kept);
        (out.requirements, out.unchanged) = (recalled.requirements, true);
        out.reached = Reached::Parts;
        out.diagnostics.extend(recalled.diagnostics);
        return Some(());
    }
    let told = out.diagnostics.len();
    out.reached = Reached::Flexures;

    // Values to numbers: before, after, and what was required.
    let clock = Clock::start(progress, Stage::Simulate);
    let start = |d: &Design| stages.simulate(d, &starts(d));
    let before: Option<Vec<Simulation>> = assembly.designs.iter().map(|d| start(d).ok()).collect();
    let before = before.map(|b| {
        let between = stages.between(&assembly, &b);
        let placed = assembly::place(&assembly, &b);
        out.before = Some(assembly::measure_all(&assembly, &placed, &between));
        page::Motion { whole: assembly::combine(&assembly, placed.clone(), &between), placed }
    });
    let after = assembly.designs.iter().zip(&values);
    let after = after.map(|(d, v)| stages.simulate(d, v)).collect::<Result<Vec<Simulation>, Failed>>();
    let simulations = keep(after, &mut out.diagnostics);
    let between = simulations.as_ref().map(|s| stages.between(&assembly, s)).unwrap_or_default();
    clock.stop(&mut out.seconds.solve);
    let simulations = simulations?;
    tell_once(simulations.iter().flat_map(|s| s.diagnostics.iter().cloned()), out);
    tell_once(between.diagnostics.iter().cloned(), out);
    let placed = assembly::place(&assembly, &simulations);
    out.after = Some(assembly::measure_all(&assembly, &placed, &between));
    lints::solved(&assembly, &values, &simulations, stages, out);
    out.requirements = assembly::check_all(&assembly, &simulations, &placed, &between, &mut out.diagnostics);

    // Values to files.
    let clock = Clock::start(progress, Stage::Mesh);
    let mut shown = None;
    if assembly.exports.iter().any(|e| e.export.kind.of_solids()) {
        let plans = Plans::of(&simulations, &between);
        match keep(stages.parts(&assembly, &values, &plans), &mut out.diagnostics) {
            Some(parts) => {
                out.artefacts.extend(parts.artefacts);
                shown = parts.shown;
                tell_once(parts.diagnostics, out);
                lints::parts(&assembly, out);
            }
            // What cannot be printed can be looked at.
            None if page::is_asked(&assembly) => shown = stages.outline(&assembly, &values).ok(),
            None => {}
        }
    }
    clock.stop(&mut out.seconds.mesh);
    let clock = Clock::start(progress, Stage::Emit);
    code::emit(&assembly, &values, stages, out);
    out.reached = Reached::Parts;
    if let Some((scene, plate)) = &shown {
        let whole = assembly::combine(&assembly, placed.clone(), &between);
        let after = page::Motion { whole, placed };
        let (solutions, values) = (&solutions, &values);
        let known = page::Known { assembly: &assembly, solutions, values, before, after, scene, plate };
        page::emit(request, &known, stages, out);
    }
    let manifest = manifest::write(out, told, &fingerprint);
    out.manifest = manifest.map(|bytes| Artefact { name: manifest::name(&request.source), bytes });
    clock.stop(&mut out.seconds.emit);
    Some(())
}

/// Findings of the variants that the design as it stands has not.
fn check_variants(variants: &[Assembly], stages: &dyn Stages, out: &mut BuildOutcome) {
    for (name, assembly) in out.variants.clone().iter().zip(variants) {
        let (sources, files) = (out.sources.clone(), out.files.clone());
        let mut other = BuildOutcome { sources, files, ..BuildOutcome::default() };
        proved(assembly, stages, &mut other);
        for mut d in other.diagnostics {
            let place = |d: &Diagnostic| d.labels.first().map(|l| l.at);
            let same = |o: &Diagnostic| o.code == d.code && o.message == d.message && place(o) == place(&d);
            if !out.diagnostics.iter().any(same) {
                d.message.push_str(&format!(" (variant `{name}`)"));
                out.diagnostics.push(d);
            }
        }
    }
}

/// Text to a design without errors, and where no variant is chosen, all its variants too.
pub fn check(request: &Request, stages: &dyn Stages, files: &dyn Files) -> BuildOutcome {
    let mut out = BuildOutcome::default();
    let read = read(request, stages, files, &mut out);
    let proved = read.and_then(|(assembly, others)| Some((proved(&assembly, stages, &mut out)?, others)));
    if let Some((assembly, others)) = proved {
        // Where the lock is current, the solution can be looked at for the price of a sweep.
        let simulated = lints::from_lock(request, &assembly, stages, &mut out);
        if let Some((values, simulations)) = simulated {
            lints::solved(&assembly, &values, &simulations, stages, &mut out);
        }
        check_variants(&others, stages, &mut out);
    }
    lints::finish(request, &mut out);
    out
}

/// The motion over the cycle: of the lock's values where it is current, else of the design's start.
pub fn simulate(
    request: &Request,
    show: Show,
    stages: &dyn Stages,
    files: &dyn Files,
) -> (BuildOutcome, Option<Simulation>) {
    let mut out = BuildOutcome::default();
    let simulation = front_end(request, stages, files, &mut out).and_then(|assembly| {
        // Where nothing of the geometry is free, the conventional motion needs no lock.
        let drawn = assembly.designs.iter().all(|d| d.geometry_variables().is_empty());
        let mut between = Between::default();
        let simulations = if show.rigid && drawn {
            let rigid = assembly.designs.iter().map(|d| stages.rigid(d, &starts(d)));
            keep(rigid.collect::<Result<Vec<_>, Failed>>(), &mut out.diagnostics)?
        } else {
            let mut found = Vec::new();
            for (design, lock) in assembly.designs.iter().zip(read_locks(request, &assembly, &mut out).ok()?)
            {
                let solution = match lock {
                    Some((lock, LockState::Current)) => lock.solution,
                    _ if request.frozen => {
                        out.diagnostics.push(frozen(design, request));
                        return None;
                    }
                    _ => Solution { values: start_of(design), ..Solution::default() },
                };
                let values = values_of(design, &solution);
                let shown =
                    if show.rigid { stages.rigid(design, &values) } else { stages.simulate(design, &values) };
                found.push(keep(shown, &mut out.diagnostics)?);
            }
            // The conventional motion's findings have been told by the check.
            if !show.rigid {
                tell_once(found.iter().flat_map(|s| s.diagnostics.iter().cloned()), &mut out);
                between = stages.between(&assembly, &found);
                tell_once(between.diagnostics.iter().cloned(), &mut out);
            }
            found
        };
        let mut placed = assembly::place(&assembly, &simulations);
        if let Some(case) = &request.case {
            placed = keep(assembly::under(&assembly, placed, case), &mut out.diagnostics)?;
            between = Between::default();
        }
        let mut simulation = assembly::combine(&assembly, placed, &between);
        if !show.poses {
            simulation.motion.bodies.clear();
        }
        Some(simulation)
    });
    (out, simulation)
}

fn front_end(
    request: &Request,
    stages: &dyn Stages,
    files: &dyn Files,
    out: &mut BuildOutcome,
) -> Option<Assembly> {
    let (assembly, _) = read(request, stages, files, out)?;
    proved(&assembly, stages, out)
}

/// Text to what is built, and to what its variants build where none is chosen.
fn read(
    request: &Request,
    stages: &dyn Stages,
    files: &dyn Files,
    out: &mut BuildOutcome,
) -> Option<(Assembly, Vec<Assembly>)> {
    let checked =
        stages.check(&request.source, &request.overrides, request.steps, request.variant.as_deref(), files);
    out.parameters = parameters::of(&checked);
    out.sources = checked.sources;
    out.variants = checked.variants;
    out.files = checked.files;
    out.diagnostics.extend(checked.diagnostics);
    out.diagnostics.extend(crate::lint::levels::judge(&out.files));
    if out.diagnostics.iter().any(Diagnostic::is_error) {
        return None;
    }
    Some((checked.assembly?, checked.others))
}

/// That it can be assembled all the way is part of being right; with what lints say until then.
fn proved(assembly: &Assembly, stages: &dyn Stages, out: &mut BuildOutcome) -> Option<Assembly> {
    let told = out.diagnostics.len();
    lints::text(assembly, out);
    let mut motions = Vec::new();
    keep(solids::all_closed(assembly), &mut out.diagnostics)?;
    for design in &assembly.designs {
        let rigid = keep(stages.rigid(design, &starts(design)), &mut out.diagnostics)?;
        tell_once(rigid.diagnostics, out);
        motions.push(rigid.conventional);
    }
    lints::moving(assembly, &motions, stages, out);
    lints::sort(out, told);
    out.design = assembly.single().cloned();
    out.assembly = Some(assembly.clone());
    Some(assembly.clone())
}

/// Findings that another design of the same mechanism has not given yet.
fn tell_once(found: impl IntoIterator<Item = Diagnostic>, out: &mut BuildOutcome) {
    for d in found {
        if !out.diagnostics.contains(&d) {
            out.diagnostics.push(d);
        }
    }
}

/// Solves every design that the lock does not know; writes the lock anew if there was one.
fn solve_all(
    request: &Request,
    assembly: &Assembly,
    stages: &dyn Stages,
    progress: &dyn Progress,
    cancel: &AtomicBool,
    out: &mut BuildOutcome,
) -> Option<Vec<Solution>> {
    let locks = read_locks(request, assembly, out).ok()?;
    let mut origins = Vec::new();
    let mut solved: Vec<(String, Lock)> = Vec::new();
    out.histories.clear();
    for (design, lock) in assembly.designs.iter().zip(locks) {
        if assembly.designs.len() > 1 {
            progress.design(&design.name);
        }
        let (solution, history) = solve(request, design, lock, stages, progress, cancel, out)?;
        origins.push(out.solved_from);
        out.histories.push(history.clone());
        solved.push((design.name.clone(), Lock { history, ..Lock::new(design, solution) }));
    }
    let solutions = solved.iter().map(|(_, l)| l.solution.clone()).collect();
    let lock = match (assembly.designs.as_slice(), solved.as_slice()) {
        ([_], [(_, only)]) => only.clone(),
        _ => Lock::join(solved),
    };
    out.solution = Some(lock.solution.clone());
    let new = origins.iter().find(|o| **o != Origin::Lock);
    out.solved_from = new.copied().unwrap_or(out.solved_from);
    out.lock = new.map(|_| lock.write());
    Some(solutions)
}

/// The lock's values if it is current, else the optimiser's.
fn solve(
    request: &Request,
    design: &Design,
    lock: Option<(Lock, LockState)>,
    stages: &dyn Stages,
    progress: &dyn Progress,
    cancel: &AtomicBool,
    out: &mut BuildOutcome,
) -> Option<(Solution, History)> {
    let start = match lock {
        Some((lock, LockState::Current)) if !request.resume || lock.solution.converged => {
            if !lock.solution.converged {
                out.diagnostics.push(not_converged(design));
            }
            out.solved_from = Origin::Lock;
            return Some((lock.solution, lock.history));
        }
        _ if request.frozen => {
            out.diagnostics.push(frozen(design, request));
            return None;
        }
        Some((lock, state)) => {
            if state == LockState::Edited {
                out.diagnostics.push(
                    Diagnostic::warning("W0711", "the lock was changed since it was written", design.origin)
                        .help("its values were only taken as a start"),
                );
            }
            out.solved_from = Origin::OldLock;
            lock.start_values(design)
        }
        None => {
            out.solved_from = Origin::Start;
            design.free.iter().map(|v| v.start).collect()
        }
    };
    let recorder = history::Recorder::default();
    let solved = if design.free.is_empty() || design.all_objectives().next().is_none() {
        // Nothing to decide, or nothing to decide it by.
        let values = design.free.iter().map(|v| v.path.clone()).zip(start).collect();
        Solved { solution: Solution { values, iterations: 0, converged: true }, ..Solved::default() }
    } else {
        let told = |iteration: &Iteration| {
            recorder.note(iteration);
            progress.iteration(iteration);
        };
        keep(stages.optimize(design, &start, &told, cancel), &mut out.diagnostics)?
    };
    out.diagnostics.extend(solved.diagnostics);
    if solved.interrupted {
        out.diagnostics.push(
            Diagnostic::warning("W0713", "the optimisation was interrupted", design.origin)
                .help("the best point found is kept in the lock; `--resume` goes on from it"),
        );
    }
    Some((solved.solution, recorder.history()))
}

/// The lock and what it is worth for each design; `Err` if it cannot be understood.
fn read_locks(
    request: &Request,
    assembly: &Assembly,
    out: &mut BuildOutcome,
) -> Result<Vec<Option<(Lock, LockState)>>, ()> {
    let several = assembly.designs.len() > 1;
    let Some((name, text)) = request.lock.as_ref().filter(|_| !request.fresh) else {
        return Ok(vec![None; assembly.designs.len()]);
    };
    let file = out.sources.add(name, text);
    match Lock::parse(text, file) {
        Ok(lock) => {
            let own = |d: &Design| if several { lock.part(&d.name) } else { lock.clone() };
            let judged = |d: &Design| Some((own(d), own(d).state(d)));
            Ok(assembly.designs.iter().map(judged).collect())
        }
        Err(found) => {
            out.diagnostics.extend(found);
            Err(())
        }
    }
}

/// The lock's solution of every design for which it is current; if it `must` be, others are errors unless they have
/// nothing to decide.
fn check_locked(
    request: &Request,
    assembly: &Assembly,
    must: bool,
    out: &mut BuildOutcome,
) -> Option<Vec<Option<Solution>>> {
    let locks = read_locks(request, assembly, out).ok()?;
    let mut solutions = Vec::new();
    let mut missing = Vec::new();
    for (design, lock) in assembly.designs.iter().zip(locks) {
        let current = lock.filter(|(_, state)| *state == LockState::Current).map(|(lock, _)| lock.solution);
        match &current {
            Some(solution) if !solution.converged => out.diagnostics.push(not_converged(design)),
            None if must && !design.free.is_empty() => missing.push(examine::not_locked(request, design)),
            _ => {}
        }
        solutions.push(current);
    }
    tell_once(missing.iter().cloned(), out);
    missing.is_empty().then_some(solutions)
}

fn not_converged(design: &Design) -> Diagnostic {
    Diagnostic::warning("W0712", "the lock's solution had not converged", design.origin)
        .help("`--resume` goes on from it, `--fresh` solves the design from its own start")
}

fn frozen(design: &Design, request: &Request) -> Diagnostic {
    let message = match request.lock {
        Some(_) => "the lock does not belong to this design, and `--frozen` forbids solving",
        None => "there is no lock, and `--frozen` forbids solving",
    };
    Diagnostic::error("E0710", message, design.origin).help("build without `--frozen` and keep the new lock")
}

fn starts(design: &Design) -> Vec<f64> {
    design.free.iter().map(|v| v.start).collect()
}

fn start_of(design: &Design) -> std::collections::BTreeMap<String, f64> {
    design.free.iter().map(|v| (v.path.clone(), v.start)).collect()
}

/// Values of the free variables in the design's order.
fn values_of(design: &Design, solution: &Solution) -> Vec<f64> {
    design.free.iter().map(|v| solution.values.get(&v.path).copied().unwrap_or(v.start)).collect()
}

fn keep<T>(result: Result<T, Failed>, found: &mut Vec<Diagnostic>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(why) => {
            found.extend(why);
            None
        }
    }
}

/// Adds the time from start to stop.
struct Clock<'a> {
    progress: &'a dyn Progress,
    began: f64,
}

impl<'a> Clock<'a> {
    fn start(progress: &'a dyn Progress, stage: Stage) -> Self {
        progress.stage(stage);
        Self { progress, began: progress.seconds() }
    }

    fn stop(self, seconds: &mut f64) {
        *seconds += self.progress.seconds() - self.began;
    }
}

/// A finding without a place in any file.
pub fn placeless(severity: Severity, code: &str, message: impl Into<String>) -> Diagnostic {
    Diagnostic {
        code: code.into(),
        severity,
        message: message.into(),
        labels: Vec::new(),
        help: None,
        fixes: Vec::new(),
    }
}

#[cfg(test)]
mod judged_tests;
#[cfg(test)]
mod tests;
