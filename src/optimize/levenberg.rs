//! Bounded Levenberg–Marquardt as an argmin solver: Gauss–Newton matrix plus λ times its diagonal
//! (Marquardt, J. SIAM 11 (1963) 431), steps from the quadratic model in the box, λ by Nielsen's rule
//! (IMM-REP-1999-05, Technical University of Denmark).

use super::box_qp::Quadratic;
use super::problem::{Derivatives, Problem, Trial};
use super::shared::Shared;
use argmin::core::{Error, IterState, KV, Problem as Counted, Solver, TerminationReason, TerminationStatus};
use nalgebra::DVector;

/// The state argmin carries: position in the unit box, gradient, nothing else of its own.
pub type LmState = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

/// λ at the start, relative to the diagonal.
const START: f64 = 1e-2;
/// Largest step of a variable in one iteration, in widths of its bounds.
const TRUST: f64 = 0.25;
/// Rejected steps before an iteration gives up.
const TRIES: usize = 12;
/// Diagonal entries below this part of the largest are lifted to it.
const FLOOR: f64 = 1e-6;
/// Lengths that are tried of a step beyond the limits of sound rods: all of it, a half, …
const SHORTENINGS: usize = 4;
/// A step counts when the cost falls by at least this part of what the model promised.
const ACCEPT: f64 = 1e-4;
/// The run ends when the cost falls by less than this part of itself over [`WINDOW`] iterations: the rms error then by half of it …
const FALL: f64 = 1e-2;
/// … or by less than what an rms error of this part of a scale costs (see [`Problem::cost_of_error`]): where every goal can be met the
/// cost tends to zero and never settles relatively. A tenth of the 0.1 mm of Chebyshev's linkage is half of what
/// the model of 20 edges knows of the motion …
const UNSEEN: f64 = 0.1;
/// … or, for terms without a scale, by less than this part of the design's own start (a run that goes on from an old
/// solution has little left to gain).
const FALL_OF_START: f64 = 1e-7;
/// See [`FALL`].
const WINDOW: usize = 5;

/// See the module.
pub struct LevenbergMarquardt<'a, 'd> {
    shared: &'a Shared<'d>,
    lambda: f64,
    growth: f64,
    current: Option<(Trial<'d>, Derivatives)>,
    history: Vec<f64>,
    /// What [`FALL_OF_START`] is a part of.
    start: f64,
    stuck: bool,
}

impl<'a, 'd> LevenbergMarquardt<'a, 'd> {
    /// A run over the shared problem.
    pub fn new(shared: &'a Shared<'d>) -> Self {
        let history = Vec::new();
        Self { shared, lambda: START, growth: 2.0, current: None, history, start: 0.0, stuck: false }
    }

    /// Where a step leads and the fall it promises, as far as the rods stay sound there, which is known before anything is
    /// simulated: their limits are curved, and a step along which the model takes them for straight may end far beyond. Shortened, it
    /// keeps its damping. None if that takes too much of it.
    fn sound_part(&self, trial: &Trial, at: &Derivatives, step: &DVector<f64>) -> Option<(Vec<f64>, f64)> {
        let model = Quadratic { a: &at.normal.gauss_newton, g: &at.normal.gradient, hinges: &at.hinges };
        let here = model.value(&DVector::zeros(step.len()));
        let now = trial.terms.last().copied().unwrap_or(0.0);
        let mut part = step.clone();
        for _ in 0..SHORTENINGS {
            let promised = here - model.value(&part);
            let x: Vec<f64> = trial.x.iter().zip(part.iter()).map(|(x, d)| (x + d).clamp(0.0, 1.0)).collect();
            let shape = self.shared.problem.shape_cost(&x)?;
            if shape <= now + promised {
                return Some((x, promised));
            }
            part *= 0.5;
        }
        None
    }

    fn refuse(&mut self) {
        self.lambda *= self.growth;
        self.growth *= 2.0;
    }

    /// The model's step, box around x and trust region together, and the fall it promises.
    fn step(&self, at: &Derivatives, x: &[f64]) -> Option<(DVector<f64>, f64)> {
        let n = x.len();
        let b = &at.normal.gauss_newton;
        let largest = b.diagonal().amax().max(f64::MIN_POSITIVE);
        let mut damped = b.clone();
        for i in 0..n {
            damped[(i, i)] += self.lambda * b[(i, i)].max(FLOOR * largest);
        }
        let lower = DVector::from_fn(n, |i, _| (-x[i]).max(-TRUST));
        let upper = DVector::from_fn(n, |i, _| (1.0 - x[i]).min(TRUST));
        let (g, hinges) = (&at.normal.gradient, &at.hinges[..]);
        let step = Quadratic { a: &damped, g, hinges }.minimize(&lower, &upper)?;
        let model = Quadratic { a: b, g, hinges };
        let promised = model.value(&DVector::zeros(n)) - model.value(&step);
        Some((step, promised))
    }
}

impl<'d> Solver<&Problem<'d>, LmState> for LevenbergMarquardt<'_, 'd> {
    fn name(&self) -> &str {
        "Levenberg-Marquardt in a box"
    }

    fn init(
        &mut self,
        problem: &mut Counted<&Problem<'d>>,
        mut state: LmState,
    ) -> Result<(LmState, Option<KV>), Error> {
        let x = state.take_param().unwrap_or_default();
        let trial = problem.problem("simulations", |p| Ok(p.simulate(&x)))?;
        let trial = trial.ok_or_else(|| Error::msg("the start cannot be simulated"))?;
        let at = problem.problem("derivatives", |p| Ok(p.differentiate(&trial)))?;
        let at = at.ok_or_else(|| Error::msg("the start cannot be differentiated"))?;
        self.history.push(trial.cost);
        self.start = trial.cost;
        let own = self.shared.problem.start();
        if own != trial.x {
            let own = problem.problem("simulations", |p| Ok(p.simulate(&own)))?;
            self.start = own.map_or(trial.cost, |own| own.cost.max(trial.cost));
        }
        self.shared.report(0, &trial);
        let state = state.param(x).cost(trial.cost).gradient(at.gradient().as_slice().to_vec());
        self.current = Some((trial, at));
        Ok((state, None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Counted<&Problem<'d>>,
        state: LmState,
    ) -> Result<(LmState, Option<KV>), Error> {
        let Some((trial, at)) = self.current.take() else {
            return Err(Error::msg("not initialised"));
        };
        let mut accepted = None;
        for _ in 0..TRIES {
            if self.shared.cancelled() {
                break;
            }
            let Some((step, promised)) = self.step(&at, &trial.x) else { break };
            if promised <= f64::EPSILON * trial.cost {
                break;
            }
            let Some((x, promised)) = self.sound_part(&trial, &at, &step) else {
                self.refuse();
                continue;
            };
            let next = problem.problem("simulations", |p| Ok(p.simulate(&x)))?;
            let ratio = next.as_ref().map_or(-1.0, |n| (trial.cost - n.cost) / promised);
            if ratio > ACCEPT
                && let Some(next) = next
                && let Some(derivatives) = problem.problem("derivatives", |p| Ok(p.differentiate(&next)))?
            {
                self.lambda *= (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0);
                self.growth = 2.0;
                accepted = Some((next, derivatives));
                break;
            }
            self.refuse();
        }
        self.stuck = accepted.is_none();
        let (trial, at) = accepted.unwrap_or((trial, at));
        self.history.push(trial.cost);
        self.shared.report(self.history.len() - 1, &trial);
        let state = state.param(trial.x.clone()).cost(trial.cost).gradient(at.gradient().as_slice().to_vec());
        self.current = Some((trial, at));
        Ok((state, None))
    }

    fn terminate(&mut self, state: &LmState) -> TerminationStatus {
        if self.shared.cancelled() {
            return TerminationStatus::Terminated(TerminationReason::Interrupt);
        }
        let before = self.history.len().checked_sub(1 + WINDOW).map(|i| self.history[i]);
        let unseen = self.shared.problem.cost_of_error(UNSEEN).max(FALL_OF_START * self.start);
        let settled = before.is_some_and(|b| b - state.get_cost() <= (FALL * b).max(unseen));
        if self.stuck || settled {
            return TerminationStatus::Terminated(TerminationReason::SolverConverged);
        }
        TerminationStatus::NotTerminated
    }
}
