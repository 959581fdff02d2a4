//! Dead point forces: their potential with its derivatives, and equilibria under them (the loaded states of
//! Megaro et al. 2017, section 4.2).

use super::model::{Model, State};
use super::newton::{Begin, Equilibrium, Halt, SolveError, Solver};
use crate::math::Pose;
use crate::math::fronts::Factors;
use crate::rod::{RodForces, RodSystem};
use nalgebra::{DVector, Matrix3, SMatrix, SVector, Vector3};

/// Smallest part of the load that is still tried when the whole cannot be applied at once.
const LEAST_PART: f64 = 1.0 / 64.0;

/// A force that keeps its direction and size, at a point of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointForce {
    /// The body.
    pub body: usize,
    /// Where it acts, in the rest pose, mm.
    pub rest: Vector3<f64>,
    /// The force, N.
    pub force_n: Vector3<f64>,
}

impl PointForce {
    /// Potential −F·x, N·mm, zero in the rest pose.
    pub fn potential_n_mm(&self, pose: &Pose) -> f64 {
        -self.force_n.dot(&(pose.point(&self.rest) - self.rest))
    }

    /// Its first derivatives by the body's increments (du, dφ).
    pub fn gradient(&self, pose: &Pose) -> SVector<f64, 6> {
        let mut g = SVector::<f64, 6>::zeros();
        g.fixed_rows_mut::<3>(0).copy_from(&-self.force_n);
        g.fixed_rows_mut::<3>(3).copy_from(&-pose.arm(&self.rest).cross(&self.force_n));
        g
    }

    /// Its second derivatives: with x = c + u + exp(φ) r, ∇²(F·x) = sym(F rᵀ) − (F·r) I in φ.
    pub fn hessian(&self, pose: &Pose) -> SMatrix<f64, 6, 6> {
        let r = pose.arm(&self.rest);
        let m = self.force_n * r.transpose();
        let turning = Matrix3::identity() * self.force_n.dot(&r) - (m + m.transpose()) * 0.5;
        let mut h = SMatrix::<f64, 6, 6>::zeros();
        h.fixed_view_mut::<3, 3>(3, 3).copy_from(&turning);
        h
    }
}

/// How a [`PointForce`] changes with one design parameter, per unit of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointForceChange {
    /// Of the place in the rest pose, mm.
    pub rest: Vector3<f64>,
    /// Of the force, N.
    pub force_n: Vector3<f64>,
}

impl PointForce {
    /// Derivative of [`Self::gradient`] at a fixed pose when the force changes.
    pub fn gradient_change(&self, pose: &Pose, change: &PointForceChange) -> SVector<f64, 6> {
        let mut g = SVector::<f64, 6>::zeros();
        g.fixed_rows_mut::<3>(0).copy_from(&-change.force_n);
        let moved = pose.direction(&change.rest).cross(&self.force_n);
        g.fixed_rows_mut::<3>(3).copy_from(&-(moved + pose.arm(&self.rest).cross(&change.force_n)));
        g
    }
}

/// A case after its first iteration.
struct Begun {
    begin: Begin,
    /// Forces that each rod is to expect.
    expected: Vec<RodForces>,
    /// Of links and multipliers, at the state before.
    factors: Factors,
}

impl Solver {
    /// The equilibrium under `loads` with the drives held at `target`, from an equilibrium without them; in
    /// parts where the whole load moves it too far at once.
    ///
    /// # Errors
    /// [`SolveError`] where no part of the load finds an equilibrium.
    pub fn load(
        &mut self,
        model: &Model,
        from: &Equilibrium,
        target: &[f64],
        loads: &[PointForce],
    ) -> Result<Equilibrium, SolveError> {
        self.load_in_parts(model, &from.state, target, loads, 1.0)
    }

    /// The states under each of several loads, as [`Self::load`] finds them: the step from the state without them
    /// shares its rods.
    ///
    /// # Errors
    /// [`SolveError`] where one finds no equilibrium.
    pub fn load_each(
        &mut self,
        model: &Model,
        from: &Equilibrium,
        target: &[f64],
        cases: &[&[PointForce]],
    ) -> Result<Vec<State>, SolveError> {
        let begun = self.begin_each(model, &from.state, target, cases);
        let rods_factored = self.rods_factored;
        let find = |(loads, begun): (&&[PointForce], Option<Begun>)| {
            let mut part = 1.0;
            if let Some(Begun { mut begin, expected, factors }) = begun {
                expected.iter().zip(&mut self.systems).for_each(|(f, s)| s.expect_forces(f));
                self.factors = Some(factors);
                begin.factors_at_hand = self.rods_factored == rods_factored;
                match self.go_on(model, begin, target, loads) {
                    Ok(state) => return Ok(state),
                    Err(Halt::FactorsGone) => {}
                    Err(Halt::Failed(_)) => part = 0.5,
                }
            }
            Ok(self.load_in_parts(model, &from.state, target, loads, part)?.state)
        };
        cases.iter().zip(begun).map(find).collect()
    }

    /// The first iteration of each case; none where there is no such step.
    fn begin_each(
        &mut self,
        model: &Model,
        from: &State,
        target: &[f64],
        cases: &[&[PointForce]],
    ) -> Vec<Option<Begun>> {
        self.take_sizes(model, target);
        let rods = self.assemble_rods(model, from, true);
        let mut begin = |loads: &&[PointForce]| {
            self.take_loads(loads);
            let residual = self.residual(model, from, target, &rods);
            if residual.small() || !residual.is_finite() {
                return None;
            }
            self.factor_links(model, from, false);
            let mut state = from.clone();
            let taken = self.step(model, &mut state, target).ok()?;
            let before_n = (taken >= 1.0).then_some(residual.force_n);
            let expected = self.systems.iter().map(|s| s.expected.clone()).collect();
            Some(Begun {
                begin: Begin { iteration: 1, before_n, ..state.into() },
                expected,
                factors: self.factors.take()?,
            })
        };
        let begun = cases.iter().map(&mut begin).collect();
        self.systems.iter_mut().for_each(RodSystem::forget_expected);
        begun
    }

    fn load_in_parts(
        &mut self,
        model: &Model,
        from: &State,
        target: &[f64],
        loads: &[PointForce],
        mut part: f64,
    ) -> Result<Equilibrium, SolveError> {
        let mut state = from.clone();
        let mut done = 0.0;
        loop {
            let next = (done + part).min(1.0);
            let scaled: Vec<PointForce> =
                loads.iter().map(|l| PointForce { force_n: l.force_n * next, ..*l }).collect();
            match self.solve_loaded(model, state.clone(), target, &scaled) {
                Ok(equilibrium) if next >= 1.0 => return Ok(equilibrium),
                Ok(equilibrium) => {
                    state = equilibrium.state;
                    done = next;
                }
                Err(error) => {
                    part *= 0.5;
                    if part < LEAST_PART {
                        return Err(error);
                    }
                }
            }
        }
    }

    /// First-order response of links and multipliers to `loads` at the last solved state.
    pub fn response(&self, model: &Model, state: &State, loads: &[PointForce]) -> DVector<f64> {
        let mut rhs = DVector::zeros(model.layout.dofs() + model.rows());
        scatter_loads(model, state, loads, |first, g| {
            let mut rows = rhs.fixed_rows_mut::<6>(first);
            rows -= g;
        });
        self.solve_scaled(&mut rhs);
        rhs
    }
}

/// Calls `f(first unknown of the body, gradient)` for every load on a moving body.
pub(super) fn scatter_loads(
    model: &Model,
    state: &State,
    loads: &[PointForce],
    mut f: impl FnMut(usize, SVector<f64, 6>),
) {
    for load in loads {
        if let Some(first) = model.layout.bodies[load.body].first_dof {
            f(first, load.gradient(&state.poses[load.body]));
        }
    }
}
