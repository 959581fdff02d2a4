//! Newton's step on links and multipliers, with the rods following.

use super::load::scatter_loads;
use super::model::{Model, State};
use super::newton::{SolveError, Solver};
use super::saddle::{gather, scatter};
use crate::math::Pose;
use crate::rod::RodState;
use nalgebra::DVector;

/// Largest rotation of a link in one iteration, rad: beyond it the chart's linearisation is poor.
const ROTATION_STEP_RAD: f64 = 0.4;
/// Largest displacement of a link in one iteration, in lever lengths.
const TRANSLATION_STEP: f64 = 0.5;

impl Solver {
    /// Newton's step with the factors at hand, shortened where a link or rod would move too far; by which fraction.
    pub(super) fn step(
        &mut self,
        model: &Model,
        state: &mut State,
        target: &[f64],
    ) -> Result<f64, SolveError> {
        let step = self.newton_step(model, state, target);
        if step.iter().any(|v| !v.is_finite()) {
            return Err(SolveError::NotFinite);
        }
        let fraction = step_fraction(model, &step);
        self.advance(model, state, &step, fraction)
    }

    /// Right-hand side of the scaled system for a full Newton step, and its solution: link
    /// increments, then the change of the multipliers.
    fn newton_step(&mut self, model: &Model, state: &State, target: &[f64]) -> DVector<f64> {
        let n = model.layout.dofs();
        let mut rhs = DVector::zeros(n + model.rows());
        let mut gradient = DVector::zeros(n);
        for (rod, system) in model.rods.iter().zip(&self.systems) {
            scatter(model, rod.bodies, &system.condensed_gradient, &mut gradient);
        }
        self.for_each_row(model, state, target, |row, bodies, lambda, residual, _, row_gradient| {
            scatter(model, bodies, &(row_gradient * lambda), &mut gradient);
            rhs[n + row] = -residual;
        });
        scatter_loads(model, state, &self.loads, |first, g| {
            let mut rows = gradient.fixed_rows_mut::<6>(first);
            rows += g;
        });
        self.add_load_gradient(model, state, &mut gradient);
        for i in 0..n {
            rhs[i] = -gradient[i];
        }
        self.solve_scaled(&mut rhs);
        rhs
    }

    /// Derivative of links and multipliers by drive value `drive` at the last solved state.
    pub(super) fn drive_tangent(&self, model: &Model, drive: usize) -> DVector<f64> {
        let n = model.layout.dofs();
        let m = model.rows();
        let mut rhs = DVector::zeros(n + m);
        rhs[n + m - model.layout.drives.len() + drive] = 1.0;
        self.solve_scaled(&mut rhs);
        rhs
    }

    /// Moves the state along `step` (links, multipliers) with the rods following; by which fraction.
    fn advance(
        &mut self,
        model: &Model,
        state: &mut State,
        step: &DVector<f64>,
        mut fraction: f64,
    ) -> Result<f64, SolveError> {
        // A frame that would turn by more than a right angle leaves the branch of its twist: shorten.
        for _ in 0..8 {
            let systems = &mut self.systems;
            let follow = |r: usize, rod_state: &mut RodState, poses: &[Pose]| {
                let (rod, system) = (model.rods.get(r)?, systems.get_mut(r)?);
                let inside = system.back_substitute(&gather(model, rod.bodies, step));
                let scaled: Vec<f64> = inside.iter().map(|v| v * fraction).collect();
                let [a, b] = rod.bodies;
                rod.rod.retract(rod_state, &scaled, &poses[a], &poses[b]).ok()?;
                system.expect(&rod.rod, fraction);
                Some(())
            };
            if let Some(next) = moved(model, state, step, fraction, follow) {
                *state = next;
                return Ok(fraction);
            }
            fraction *= 0.5;
        }
        Err(SolveError::NotConverged)
    }
}

/// The state moved by a fraction of increments of links and multipliers (`step`), while `follow` moves each rod's state to
/// the links' new poses; none where a rod cannot follow.
pub(super) fn moved(
    model: &Model,
    state: &State,
    step: &DVector<f64>,
    fraction: f64,
    mut follow: impl FnMut(usize, &mut RodState, &[Pose]) -> Option<()>,
) -> Option<State> {
    let n = model.layout.dofs();
    let mut next = state.clone();
    for (pose, body) in next.poses.iter_mut().zip(&model.layout.bodies) {
        if let Some(first) = body.first_dof {
            let d = step.fixed_rows::<6>(first) * fraction;
            *pose = pose.retract(&d.fixed_rows::<3>(0).into(), &d.fixed_rows::<3>(3).into());
        }
    }
    for (r, rod_state) in next.rods.iter_mut().enumerate() {
        follow(r, rod_state, &next.poses)?;
    }
    for (l, d) in next.lambda.iter_mut().zip(step.rows(n, model.rows()).iter()) {
        *l += fraction * d;
    }
    for (value, drive) in next.drives.iter_mut().zip(&model.layout.drives) {
        *value = drive.joint.value(&next.poses, *value);
    }
    for (turn, load) in next.turns.iter_mut().zip(&model.layout.loads) {
        *turn = load.turn(&next.poses, *turn);
    }
    Some(next)
}

fn step_fraction(model: &Model, step: &DVector<f64>) -> f64 {
    let mut fraction = 1.0f64;
    for body in &model.layout.bodies {
        if let Some(first) = body.first_dof {
            let du = step.fixed_rows::<3>(first).norm();
            let dphi = step.fixed_rows::<3>(first + 3).norm();
            fraction = fraction.min(TRANSLATION_STEP * model.layout.length_mm / du.max(f64::MIN_POSITIVE));
            fraction = fraction.min(ROTATION_STEP_RAD / dphi.max(f64::MIN_POSITIVE));
        }
    }
    fraction
}
