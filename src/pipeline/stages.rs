//! The stages as the pipeline sees them: what goes in, what comes out, nothing of how. [`Compiler`] is the
//! real thing; tests put small mechanisms with known answers in its place.

use super::files::Files;
use super::progress::Iteration;
use super::report::Artefact;
use crate::diagnostic::{Diagnostic, Severity, SourceMap};
use crate::emit::csv::MotionTable;
use crate::ir::{Design, Solution};
use std::sync::atomic::AtomicBool;

/// Findings of a stage that gave nothing.
pub type Failed = Vec<Diagnostic>;

/// What the front end gives.
#[derive(Clone, Debug, Default)]
pub struct Checked {
    /// The files read.
    pub sources: SourceMap,
    /// The design, if there were no errors.
    pub design: Option<Design>,
    /// Findings.
    pub diagnostics: Vec<Diagnostic>,
}

/// A simulated cycle.
#[derive(Clone, Debug, Default)]
pub struct Simulation {
    /// Drives, traces, forces and poses at every state.
    pub motion: MotionTable,
    /// Distance of each trace from its target at every state, mm.
    pub errors_mm: Vec<Vec<f64>>,
    /// Least distance between bodies over the cycle, mm, where asked for.
    pub least_gap_mm: Option<f64>,
}

/// What the optimiser gives.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// The best point found.
    pub solution: Solution,
    /// It was stopped from outside.
    pub interrupted: bool,
    /// Findings.
    pub diagnostics: Vec<Diagnostic>,
}

/// The stages. `values` are the free variables in the design's order.
pub trait Stages {
    /// Text to design. `overrides` are `--set` names and expressions; `steps` overrides the cycle's.
    fn check(
        &self,
        source: &str,
        overrides: &[(String, String)],
        steps: Option<usize>,
        files: &dyn Files,
    ) -> Checked;

    /// Motion of the conventional mechanism.
    ///
    /// # Errors
    /// Where it cannot be assembled, or its mobility does not match its drives.
    fn rigid(&self, design: &Design) -> Result<Simulation, Failed>;

    /// One sweep of the compliant mechanism from its unstressed rest pose.
    ///
    /// # Errors
    /// Where no equilibrium is found.
    fn simulate(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed>;

    /// The best design from a start; stops early when `cancel` is set.
    ///
    /// # Errors
    /// Where the start itself cannot be simulated.
    fn optimize(
        &self,
        design: &Design,
        start: &[f64],
        on_iteration: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed>;

    /// One file a printed part.
    ///
    /// # Errors
    /// Where no closed solid comes out.
    fn mesh(&self, design: &Design, values: &[f64]) -> Result<Vec<Artefact>, Failed>;
}

/// The real stages. This is the only place where the pipeline touches them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Compiler;

/// A stage that this version does not have.
fn not_available(stage: &str) -> Failed {
    vec![Diagnostic {
        code: "E0900".into(),
        severity: Severity::Error,
        message: format!("{stage} is not available yet"),
        labels: Vec::new(),
        help: None,
    }]
}

impl Stages for Compiler {
    fn check(
        &self,
        _source: &str,
        _overrides: &[(String, String)],
        _steps: Option<usize>,
        _files: &dyn Files,
    ) -> Checked {
        Checked { diagnostics: not_available("reading a design"), ..Checked::default() }
    }

    fn rigid(&self, _design: &Design) -> Result<Simulation, Failed> {
        Err(not_available("the conventional motion"))
    }

    fn simulate(&self, _design: &Design, _values: &[f64]) -> Result<Simulation, Failed> {
        Err(not_available("simulation"))
    }

    fn optimize(
        &self,
        _design: &Design,
        _start: &[f64],
        _on_iteration: &dyn Fn(&Iteration),
        _cancel: &AtomicBool,
    ) -> Result<Solved, Failed> {
        Err(not_available("optimisation"))
    }

    fn mesh(&self, _design: &Design, _values: &[f64]) -> Result<Vec<Artefact>, Failed> {
        Err(not_available("meshing"))
    }
}
