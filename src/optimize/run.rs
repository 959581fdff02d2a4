//! One optimisation run: argmin's executor around the chosen solver, progress, interruption, and the
//! best point kept whatever happens.

use super::cma_es::cma_es;
use super::lbfgs::Unbounded;
use super::levenberg::LevenbergMarquardt;
use super::problem::Problem;
use super::shared::{Iteration, Shared};
use argmin::core::{Executor, State, TerminationReason, TerminationStatus};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use std::sync::atomic::AtomicBool;

/// Pairs L-BFGS remembers.
const MEMORY: usize = 10;

/// Which solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Bounded Levenberg–Marquardt.
    LevenbergMarquardt,
    /// L-BFGS on sine-transformed variables.
    Lbfgs,
    /// CMA-ES, without derivatives.
    CmaEs,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// By its own stopping rule.
    Converged,
    /// At the limit of iterations.
    Limit,
    /// By the user.
    Interrupted,
    /// The start could not be simulated.
    NoStart,
}

/// What a run found.
#[derive(Clone, Debug)]
pub struct Optimized {
    /// Best design parameters.
    pub p: Vec<f64>,
    /// Their cost.
    pub cost: f64,
    /// Iterations taken.
    pub iterations: usize,
    /// Cycles simulated.
    pub simulations: usize,
    /// How it ended.
    pub ending: Ending,
}

/// Minimises the design's objective from `start` (design parameters), at most `limit` iterations.
/// `progress` is called after every iteration; `cancel` ends the run at the next step. The best
/// point found is returned in every case; the start itself where nothing better was found.
pub fn optimize<'d>(
    problem: Problem<'d>,
    method: Method,
    start: &[f64],
    limit: usize,
    cancel: &'d AtomicBool,
    progress: &'d dyn Fn(&Iteration),
) -> Optimized {
    let x = problem.to_unit(start);
    let shared = Shared::new(problem, cancel, progress);
    let (iterations, ending) = match method {
        Method::LevenbergMarquardt => levenberg_marquardt(&shared, x, limit),
        Method::Lbfgs => lbfgs(&shared, &x, limit),
        Method::CmaEs => cma_es(&shared, &x, limit),
    };
    let best = shared.best();
    let simulations = shared.problem.simulations();
    match best {
        // The start itself is returned as it was given, not through the unit box.
        Some((cost, x)) if x != shared.problem.to_unit(start) => {
            Optimized { p: shared.problem.to_parameters(&x), cost, iterations, simulations, ending }
        }
        Some((cost, _)) => Optimized { p: start.to_vec(), cost, iterations, simulations, ending },
        None => Optimized {
            p: start.to_vec(),
            cost: f64::INFINITY,
            iterations: 0,
            simulations,
            ending: if shared.cancelled() { Ending::Interrupted } else { Ending::NoStart },
        },
    }
}

fn levenberg_marquardt(shared: &Shared, x: Vec<f64>, limit: usize) -> (usize, Ending) {
    let solver = LevenbergMarquardt::new(shared);
    let run = Executor::new(&shared.problem, solver)
        .configure(|state| state.param(x).max_iters(limit as u64))
        .timer(false)
        .run();
    match run {
        Ok(result) => ended(shared, result.state.get_iter() as usize, result.state.get_termination_status()),
        Err(_) => (0, if shared.cancelled() { Ending::Interrupted } else { Ending::NoStart }),
    }
}

fn lbfgs(shared: &Shared, x: &[f64], limit: usize) -> (usize, Ending) {
    let z = Unbounded::to_z(x);
    let solver: LBFGS<_, Vec<f64>, Vec<f64>, f64> = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY);
    let mut done = 0;
    let mut ending = Ending::Limit;
    let run = Executor::new(Unbounded::new(shared), solver)
        .configure(|state| state.param(z).max_iters(limit as u64))
        .timer(false)
        .run();
    if let Ok(result) = run {
        (done, ending) =
            ended(shared, result.state.get_iter() as usize, result.state.get_termination_status());
    } else if shared.cancelled() {
        ending = Ending::Interrupted;
    }
    (done, ending)
}

fn ended(shared: &Shared, iterations: usize, status: &TerminationStatus) -> (usize, Ending) {
    let ending = match status {
        _ if shared.cancelled() => Ending::Interrupted,
        TerminationStatus::Terminated(TerminationReason::MaxItersReached) => Ending::Limit,
        TerminationStatus::Terminated(TerminationReason::Interrupt) => Ending::Interrupted,
        _ => Ending::Converged,
    };
    (iterations, ending)
}
