//! What the pipeline tells while it works, and the clock it is given: time comes from outside.

/// The parts of a build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading and elaboration.
    Check,
    /// Optimisation.
    Solve,
    /// Simulation of the result.
    Simulate,
    /// Solids.
    Mesh,
    /// Artefacts.
    Emit,
}

/// State of the optimiser after an iteration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Iteration {
    /// Number, from 0 for the start.
    pub number: usize,
    /// Objective.
    pub objective: f64,
    /// Its terms, by name.
    pub terms: Vec<(String, f64)>,
    /// Largest error of any trace, mm; none without a tracked one.
    pub max_error_mm: Option<f64>,
    /// Largest von Mises stress, MPa; none if not computed.
    pub max_stress_mpa: Option<f64>,
}

/// Told what goes on; asked for the time.
pub trait Progress {
    /// Seconds since some fixed moment.
    fn seconds(&self) -> f64;
    /// A stage begins.
    fn stage(&self, _stage: Stage) {}
    /// One of several designs is solved next.
    fn design(&self, _name: &str) {}
    /// The optimiser has done an iteration.
    fn iteration(&self, _iteration: &Iteration) {}
}
