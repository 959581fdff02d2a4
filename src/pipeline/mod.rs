//! The whole way from text to artefacts, as one function to be read from top to bottom. No I/O here:
//! files come in through [`Files`], artefacts go out as names and bytes, time and threads come from outside.

mod aims;
mod compiler;
mod measure;
mod progress;
mod report;
mod solids;
mod stability;
mod stages;

pub use aims::{AimSeries, DirectionMeasures, OutputMeasures};
pub use compiler::{Compiler, EDGES};
pub use measure::{aggregate, check_requirements, is_closed, measure};
pub use progress::{Iteration, Progress, Stage};
pub use report::{
    Artefact, BuildOutcome, DriveMeasures, GapMeasures, Measures, Origin, RequirementResult, Seconds,
    StressMeasures, TraceMeasures,
};
pub use stability::{DriveValues, LimitPoint, RestState, SnapThrough, Stability};
pub use stages::{Checked, Failed, Simulation, Solved, Stages};

use crate::diagnostic::{Diagnostic, Severity};
pub use crate::elaborate::{FileError, Files};
use crate::emit::arduino::Sketch;
use crate::emit::lock::{Lock, LockState};
use crate::ir::{Design, ExportKind, Solution};
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
    /// The lock as it stands: its name and text.
    pub lock: Option<(String, String)>,
    /// Ignore the lock.
    pub fresh: bool,
    /// Refuse to solve: the lock must be current.
    pub frozen: bool,
}

/// Which motion `simulate` shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Show {
    /// The conventional mechanism's.
    pub rigid: bool,
    /// With the pose of every moving body.
    pub poses: bool,
}

/// Text to artefacts.
pub fn build(
    request: &Request,
    stages: &dyn Stages,
    files: &dyn Files,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> BuildOutcome {
    let began = progress.seconds();
    let mut out = BuildOutcome::default();
    run_build(request, stages, files, progress, cancel, &mut out);
    out.seconds.total = progress.seconds() - began;
    out
}

/// `None` ends the way early; `out` then holds what was reached and why not more.
fn run_build(
    request: &Request,
    stages: &dyn Stages,
    files: &dyn Files,
    progress: &dyn Progress,
    cancel: &AtomicBool,
    out: &mut BuildOutcome,
) -> Option<()> {
    // Text to design, and the conventional mechanism as a check of it.
    let clock = Clock::start(progress, Stage::Check);
    let design = front_end(request, stages, files, out);
    clock.stop(&mut out.seconds.check);
    let design = design?;

    // Design to values.
    let clock = Clock::start(progress, Stage::Solve);
    let solution = solve(request, &design, stages, progress, cancel, out);
    clock.stop(&mut out.seconds.solve);
    let solution = solution?;
    let values = values_of(&design, &solution);

    // Values to numbers: before, after, and what was required.
    let clock = Clock::start(progress, Stage::Simulate);
    let starts: Vec<f64> = design.free.iter().map(|v| v.start).collect();
    out.before = stages.simulate(&design, &starts).ok().map(|s| measure(&design, &s));
    let simulation = keep(stages.simulate(&design, &values), &mut out.diagnostics);
    clock.stop(&mut out.seconds.solve);
    let simulation = simulation?;
    out.diagnostics.extend(simulation.diagnostics.iter().cloned());
    out.after = Some(measure(&design, &simulation));
    out.requirements = check_requirements(&design, &simulation, &mut out.diagnostics);

    // Values to files.
    let clock = Clock::start(progress, Stage::Mesh);
    if design.exports.iter().any(|e| e.kind == ExportKind::Stl)
        && let Some((parts, found)) = keep(stages.mesh(&design, &values), &mut out.diagnostics)
    {
        out.artefacts.extend(parts);
        out.diagnostics.extend(found);
    }
    clock.stop(&mut out.seconds.mesh);
    let clock = Clock::start(progress, Stage::Emit);
    emit_sketches(&design, &values, out);
    clock.stop(&mut out.seconds.emit);
    Some(())
}

/// Text to a design without errors.
pub fn check(request: &Request, stages: &dyn Stages, files: &dyn Files) -> BuildOutcome {
    let mut out = BuildOutcome::default();
    front_end(request, stages, files, &mut out);
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
    let simulation = front_end(request, stages, files, &mut out).and_then(|design| {
        let start = Solution { values: start_of(&design), ..Solution::default() };
        // Where nothing of the geometry is free, the conventional motion needs no lock.
        let result = if show.rigid && design.geometry_variables().is_empty() {
            stages.rigid(&design, &values_of(&design, &start))
        } else {
            let solution = match read_lock(request, &design, &mut out) {
                Ok(Some((lock, LockState::Current))) => lock.solution,
                Ok(_) if request.frozen => {
                    out.diagnostics.push(frozen(&design, request));
                    return None;
                }
                Ok(_) => start,
                Err(()) => return None,
            };
            let values = values_of(&design, &solution);
            if show.rigid { stages.rigid(&design, &values) } else { stages.simulate(&design, &values) }
        };
        let mut simulation = keep(result, &mut out.diagnostics)?;
        if !show.rigid {
            // The conventional motion's findings have been told by the check.
            out.diagnostics.append(&mut simulation.diagnostics);
        }
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
) -> Option<Design> {
    let checked = stages.check(&request.source, &request.overrides, request.steps, files);
    out.sources = checked.sources;
    out.diagnostics.extend(checked.diagnostics);
    if out.diagnostics.iter().any(Diagnostic::is_error) {
        return None;
    }
    let design = checked.design?;
    let starts: Vec<f64> = design.free.iter().map(|v| v.start).collect();
    // That it can be assembled all the way is part of being right.
    let rigid = keep(stages.rigid(&design, &starts), &mut out.diagnostics)?;
    out.diagnostics.extend(rigid.diagnostics);
    out.design = Some(design.clone());
    Some(design)
}

/// The lock's values if it is current, else the optimiser's.
fn solve(
    request: &Request,
    design: &Design,
    stages: &dyn Stages,
    progress: &dyn Progress,
    cancel: &AtomicBool,
    out: &mut BuildOutcome,
) -> Option<Solution> {
    let lock = read_lock(request, design, out).ok()?;
    let start = match lock {
        Some((lock, LockState::Current)) => {
            if !lock.solution.converged {
                out.diagnostics.push(
                    Diagnostic::warning("W0712", "the lock's solution had not converged", design.origin)
                        .help("`--fresh` solves the design again"),
                );
            }
            out.solved_from = Origin::Lock;
            out.solution = Some(lock.solution.clone());
            return Some(lock.solution);
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
    let solved = if design.free.is_empty() || design.objectives.is_empty() {
        // Nothing to decide, or nothing to decide it by.
        let values = design.free.iter().map(|v| v.path.clone()).zip(start).collect();
        Solved { solution: Solution { values, iterations: 0, converged: true }, ..Solved::default() }
    } else {
        let told = |iteration: &Iteration| progress.iteration(iteration);
        keep(stages.optimize(design, &start, &told, cancel), &mut out.diagnostics)?
    };
    out.diagnostics.extend(solved.diagnostics);
    if solved.interrupted {
        out.diagnostics.push(
            Diagnostic::warning("W0713", "the optimisation was interrupted", design.origin)
                .help("the best point found is kept in the lock; `--fresh` solves the design again"),
        );
    }
    out.lock = Some(Lock::new(design, solved.solution.clone()).write());
    out.solution = Some(solved.solution.clone());
    Some(solved.solution)
}

/// The lock and what it is worth; `Err` if it cannot be understood.
fn read_lock(
    request: &Request,
    design: &Design,
    out: &mut BuildOutcome,
) -> Result<Option<(Lock, LockState)>, ()> {
    let Some((name, text)) = request.lock.as_ref().filter(|_| !request.fresh) else {
        return Ok(None);
    };
    let file = out.sources.add(name, text);
    match Lock::parse(text, file) {
        Ok(lock) => {
            let state = lock.state(design);
            Ok(Some((lock, state)))
        }
        Err(found) => {
            out.diagnostics.extend(found);
            Err(())
        }
    }
}

fn frozen(design: &Design, request: &Request) -> Diagnostic {
    let message = match request.lock {
        Some(_) => "the lock does not belong to this design, and `--frozen` forbids solving",
        None => "there is no lock, and `--frozen` forbids solving",
    };
    Diagnostic::error("E0710", message, design.origin).help("build without `--frozen` and keep the new lock")
}

fn emit_sketches(design: &Design, values: &[f64], out: &mut BuildOutcome) {
    for export in &design.exports {
        let ExportKind::Arduino(drive) = export.kind else { continue };
        match Sketch::of(design, drive, values).and_then(|s| Ok((s.name(), s.render()?))) {
            Ok((name, text)) => {
                out.artefacts.push(Artefact { name: format!("{name}/{name}.ino"), bytes: text.into_bytes() })
            }
            Err(e) => {
                let message = format!("no sketch can be written: {e}");
                out.diagnostics.push(Diagnostic::error("E0720", message, export.origin));
            }
        }
    }
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
    Diagnostic { code: code.into(), severity, message: message.into(), labels: Vec::new(), help: None }
}

#[cfg(test)]
mod tests;
