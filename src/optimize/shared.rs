//! What the solvers of one run share: the problem, the wish to stop, and the best point so far.

use super::problem::{Problem, Trial};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// One iteration, for progress.
#[derive(Clone, Debug, PartialEq)]
pub struct Iteration {
    /// 0 is the start.
    pub number: usize,
    /// Weighted sum.
    pub cost: f64,
    /// Contribution of each term.
    pub terms: Vec<f64>,
    /// Largest distance of any trace from its target, mm; none without a trace.
    pub max_error_mm: Option<f64>,
    /// True largest von Mises stress, MPa.
    pub max_stress_mpa: f64,
}

/// What solver, observer and caller share.
pub struct Shared<'d> {
    /// The problem.
    pub problem: Problem<'d>,
    cancel: &'d AtomicBool,
    progress: &'d dyn Fn(&Iteration),
    best: Mutex<Option<(f64, Vec<f64>)>>,
    latest: Mutex<Option<Iteration>>,
}

impl<'d> Shared<'d> {
    /// Nothing found yet.
    pub fn new(problem: Problem<'d>, cancel: &'d AtomicBool, progress: &'d dyn Fn(&Iteration)) -> Self {
        Self { problem, cancel, progress, best: Mutex::new(None), latest: Mutex::new(None) }
    }

    /// Cost and position of the best point so far.
    pub fn best(&self) -> Option<(f64, Vec<f64>)> {
        self.best.lock().ok().and_then(|b| b.clone())
    }

    /// Set when the user asks to stop.
    pub fn stop(&self) -> &'d AtomicBool {
        self.cancel
    }

    /// Whether the user asked to stop.
    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// Remembers a simulated point if it is the best so far.
    pub fn keep(&self, trial: &Trial<'d>) {
        if let Ok(mut best) = self.best.lock()
            && best.as_ref().is_none_or(|(cost, _)| trial.cost < *cost)
        {
            *best = Some((trial.cost, trial.x.clone()));
            if let Ok(mut latest) = self.latest.lock() {
                *latest = Some(Iteration {
                    number: 0,
                    cost: trial.cost,
                    terms: trial.terms.clone(),
                    max_error_mm: trial.max_error_mm(),
                    max_stress_mpa: trial.max_stress_mpa(),
                });
            }
        }
    }

    /// Remembers and announces an accepted iterate.
    pub fn report(&self, number: usize, trial: &Trial<'d>) {
        self.keep(trial);
        self.announce(number);
    }

    /// Announces the best point so far.
    pub fn announce(&self, number: usize) {
        let latest = self.latest.lock().ok().and_then(|l| l.clone());
        if let Some(latest) = latest {
            (self.progress)(&Iteration { number, ..latest });
        }
    }
}
