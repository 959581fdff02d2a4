//! Continuation over the cycle: from the unstressed rest pose to the nearest state, then forward to
//! the last and backward to the first, each step predicted along the tangent by drive values and loads. The loads grow
//! from zero to those of that state before the drives move.

use super::model::{Model, State};
use super::newton::{Equilibrium, SolveError, Solver};
use nalgebra::DVector;

/// Smallest part of a step that is still tried when whole ones fail.
const LEAST_PART: f64 = 1.0 / 128.0;

/// Equilibria of all states 0..=N.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// One per state.
    pub states: Vec<Equilibrium>,
}

/// The mechanism could not be followed through its cycle.
#[derive(Clone, Debug)]
pub struct SweepError {
    /// The state that could not be reached.
    pub state: usize,
    /// Drive values of the last equilibrium before it, relative to the drawing pose, rad or mm.
    pub last_drives: Vec<f64>,
    /// What went wrong there.
    pub error: SolveError,
}

/// Follows the mechanism through its cycle. The forward and the backward part are independent.
///
/// # Errors
/// [`SweepError`] at the first state that no step size reaches.
pub fn sweep(model: &Model) -> Result<Cycle, SweepError> {
    let count = model.layout.states();
    let drives = model.layout.drives.len();
    let target = |s: usize| model.layout.controls(s);
    // How far from rest: by the drives, of which a design under loads may have none.
    let judged = if drives > 0 { 0..drives } else { 0..model.layout.loads.len() };
    let distance = |s: usize| target(s)[judged.clone()].iter().map(|v| v * v).sum::<f64>();
    let nearest = (0..count).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0);

    let mut solver = Solver::new(model);
    let start = Walker::at_rest(model, &mut solver);
    let mut first = start?;
    let mut loaded = target(nearest);
    loaded.iter_mut().take(drives).for_each(|d| *d = 0.0);
    first.walk(model, &mut solver, nearest, &loaded)?;
    first.walk(model, &mut solver, nearest, &target(nearest))?;
    let middle = first.equilibrium.clone();
    let run = |states: &mut dyn Iterator<Item = usize>| -> Result<Vec<Equilibrium>, SweepError> {
        let mut solver = Solver::new(model);
        let mut walker = first.clone();
        let mut out = Vec::new();
        for s in states {
            walker.walk(model, &mut solver, s, &target(s))?;
            out.push(walker.equilibrium.clone());
        }
        Ok(out)
    };
    let (forward, backward) = rayon::join(|| run(&mut (nearest + 1..count)), || run(&mut (0..nearest).rev()));
    let mut states = backward?;
    states.reverse();
    states.push(middle);
    states.extend(forward?);
    Ok(Cycle { states })
}

/// A followed equilibrium and the controls it belongs to.
#[derive(Clone)]
struct Walker {
    equilibrium: Equilibrium,
    controls: Vec<f64>,
}

impl Walker {
    fn at_rest(model: &Model, solver: &mut Solver) -> Result<Self, SweepError> {
        let controls = vec![0.0; model.layout.drives.len() + model.layout.loads.len()];
        let equilibrium = solver
            .solve(model, model.rest_state(), &controls)
            .map_err(|error| Self::lost(model, &controls, 0, error))?;
        Ok(Self { equilibrium, controls })
    }

    fn lost(model: &Model, controls: &[f64], state: usize, error: SolveError) -> SweepError {
        let last_drives = controls.iter().zip(&model.layout.drives).map(|(v, d)| v + d.rest).collect();
        SweepError { state, last_drives, error }
    }

    /// Goes to `target`, in one step where that works.
    fn walk(
        &mut self,
        model: &Model,
        solver: &mut Solver,
        state: usize,
        target: &[f64],
    ) -> Result<(), SweepError> {
        let mut part = 1.0;
        let mut fresh = true;
        loop {
            let change: Vec<f64> = target.iter().zip(&self.controls).map(|(t, d)| t - d).collect();
            if change.iter().all(|c| c.abs() < 1e-15) {
                return Ok(());
            }
            let next: Vec<f64> = if part >= 1.0 {
                target.to_vec()
            } else {
                self.controls.iter().zip(&change).map(|(d, c)| d + part * c).collect()
            };
            match self.try_step(model, solver, &next, fresh) {
                Ok(equilibrium) => {
                    self.equilibrium = equilibrium;
                    self.controls = next;
                    fresh = false;
                    if part >= 1.0 {
                        return Ok(());
                    }
                    // The rest of the way counts as the new whole: try twice the step just made.
                    part = (2.0 * part / (1.0 - part)).min(1.0);
                }
                Err(error) => {
                    part *= 0.5;
                    fresh = true;
                    if part < LEAST_PART {
                        return Err(Self::lost(model, &self.controls, state, error));
                    }
                }
            }
        }
    }

    /// One predicted and corrected step. With `fresh` the solver's factors belong to another state
    /// and are made anew.
    fn try_step(
        &self,
        model: &Model,
        solver: &mut Solver,
        next: &[f64],
        fresh: bool,
    ) -> Result<Equilibrium, SolveError> {
        let mut state: State = self.equilibrium.state.clone();
        if fresh {
            state = solver.solve(model, state, &self.controls)?.state;
        }
        let mut tangent = DVector::zeros(model.layout.dofs() + model.rows());
        let drives = model.layout.drives.len();
        for (i, (to, from)) in
            next.iter().zip(&self.controls).enumerate().filter(|(_, (to, from))| to != from)
        {
            let by_one = match i.checked_sub(drives) {
                None => solver.drive_tangent(model, i),
                Some(load) => solver.load_tangent(model, &state, load),
            };
            tangent += by_one * (to - from);
        }
        solver.advance(model, &mut state, &tangent, 1.0)?;
        solver.solve(model, state, next)
    }
}
