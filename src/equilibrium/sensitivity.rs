//! Derivatives of an equilibrium by the design parameters (Megaro et al. 2017, eqs. 18–19), in the
//! forward form: one back-substitution per parameter with the factors of the accepted state.

use super::change::LayoutChange;
use super::load::{PointForce, PointForceChange};
use super::model::{Model, State};
use super::newton::{Equilibrium, SolveError, Solver};
use super::saddle::scatter;
use crate::math::Pose;
use crate::rod::{EdgeJacobian, ParameterMatrix, Rod, RodSystem, SensitivityError, StrainJacobian};
use nalgebra::{DMatrix, DVector};

/// First derivatives of one equilibrium by the n design parameters.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    /// Link increments (du, dφ per free body), dofs × n: motions of all that a body carries. What moves within its body
    /// (a traced point) adds that, turned by the pose.
    pub links: DMatrix<f64>,
    /// Multipliers, rows × n.
    pub lambda: DMatrix<f64>,
}

/// How much of a rod's derivatives is worked out.
type ColumnsOf = fn(&mut RodSystem, &Rod, &Pose, &Pose) -> Result<ParameterMatrix, SensitivityError>;

/// Reused by one thread.
pub struct SensitivityWorkspace {
    solver: Solver,
}

impl SensitivityWorkspace {
    /// For models of this size.
    pub fn new(model: &Model) -> Self {
        Self { solver: Solver::new(model) }
    }

    /// Derivatives at an accepted equilibrium with the drives held.
    ///
    /// # Errors
    /// [`SolveError`] if the equilibrium given is none.
    pub fn at(
        &mut self,
        model: &Model,
        equilibrium: &Equilibrium,
        target: &[f64],
    ) -> Result<Sensitivity, SolveError> {
        self.differentiate(model, &equilibrium.state, target, &[], &[], RodSystem::parameter_columns)
    }

    /// Of links and multipliers alone, in a state under dead forces that change with the geometry: `load_changes` has, for each
    /// of the layout's changes, one a load. [`Self::edge`] and [`Self::strains`] do not follow from it.
    ///
    /// # Errors
    /// [`SolveError`] if the state given is no equilibrium, or the layout has no derivatives.
    pub fn of_links(
        &mut self,
        model: &Model,
        state: &State,
        target: &[f64],
        loads: &[PointForce],
        load_changes: &[Vec<PointForceChange>],
    ) -> Result<Sensitivity, SolveError> {
        self.differentiate(model, state, target, loads, load_changes, RodSystem::links_parameter_columns)
    }

    fn differentiate(
        &mut self,
        model: &Model,
        state: &State,
        target: &[f64],
        loads: &[PointForce],
        load_changes: &[Vec<PointForceChange>],
        columns_of: ColumnsOf,
    ) -> Result<Sensitivity, SolveError> {
        if model.layout.changes.is_none() {
            return Err(SolveError::NoDerivatives);
        }
        let solver = &mut self.solver;
        solver.return_to(model, state, target, loads)?;
        let (n, m) = (model.layout.dofs(), model.rows());
        let parameters = model.p.len();
        let mut rhs = DMatrix::zeros(n + m, parameters);
        for (rod, system) in model.rods.iter().zip(&mut solver.systems) {
            let [a, b] = rod.bodies.map(|b| &state.poses[b]);
            let columns = columns_of(system, &rod.rod, a, b);
            let columns = columns.map_err(|_| SolveError::NoDerivatives)? * &rod.dq_dp;
            for (half, body) in rod.bodies.into_iter().enumerate() {
                if let Some(first) = model.layout.bodies[body].first_dof {
                    let mut rows = rhs.rows_mut(first, 6);
                    rows -= columns.rows(6 * half, 6);
                }
            }
        }
        for (i, change) in model.layout.changes.iter().flatten().enumerate() {
            let mut by = DVector::zeros(n + m);
            geometry_column(model, state, &solver.sizes, change, &mut by);
            let changes = load_changes.get(i).map_or(&[][..], |c| c);
            for (load, change) in loads.iter().zip(changes) {
                if let Some(first) = model.layout.bodies[load.body].first_dof {
                    let mut rows = by.fixed_rows_mut::<6>(first);
                    rows += load.gradient_change(&state.poses[load.body], change);
                }
            }
            let mut column = rhs.column_mut(change.parameter);
            column -= by;
        }
        solver.solve_scaled_block(&mut rhs);
        Ok(Sensitivity { links: rhs.rows(0, n).into_owned(), lambda: rhs.rows(n, m).into_owned() })
    }

    /// Derivatives of an edge of a rod by the n, at the equilibrium last asked for, of which `at` is the sensitivity; none where
    /// there is no such edge.
    pub fn edge(&self, model: &Model, at: &Sensitivity, rod: usize, edge: usize) -> Option<EdgeJacobian> {
        let (system, rod) = (self.solver.systems.get(rod)?, model.rods.get(rod)?);
        let mut links = DMatrix::zeros(12, at.links.ncols());
        for (half, body) in rod.bodies.into_iter().enumerate() {
            if let Some(first) = model.layout.bodies[body].first_dof {
                links.rows_mut(6 * half, 6).copy_from(&at.links.rows(first, 6));
            }
        }
        system.edge_jacobian(&rod.rod, edge, &links, &rod.dq_dp).ok()
    }

    /// Strain measures of one rod at the equilibrium last asked for, with their derivatives by the rod's own 31
    /// directions (12 link increments, 19 parameters); none before there was one.
    pub fn strains(&self, model: &Model, rod: usize) -> Option<StrainJacobian> {
        self.solver.systems.get(rod)?.strain_jacobian(&model.rods.get(rod)?.rod).ok()
    }
}

/// Derivative of what the constraints, drives and loads of the design add to the gradient, and of their residuals, at fixed poses when the
/// layout moves. Bodies keep their increments' centres: where forces balance it does not matter what they are.
fn geometry_column(
    model: &Model,
    state: &State,
    sizes: &[f64],
    change: &LayoutChange,
    out: &mut DVector<f64>,
) {
    let n = model.layout.dofs();
    for ((load, moved), size) in model.layout.loads.iter().zip(&change.loads).zip(sizes) {
        load.add_gradient_change(model, state, moved, *size, out);
    }
    let mut row = 0;
    for (constraint, moved) in model.layout.constraints.iter().zip(&change.constraints) {
        let lambda = &state.lambda[row..row + constraint.rows()];
        let (residual, gradient) = constraint.reference_derivative(&state.poses, lambda, moved);
        for r in 0..constraint.rows() {
            out[n + row + r] += residual[r];
        }
        scatter(model, constraint.bodies(), &gradient, out);
        row += constraint.rows();
    }
    for (drive, moved) in model.layout.drives.iter().zip(&change.drives) {
        let (value, gradient) = drive.joint.reference_derivative(&state.poses, &moved.reference);
        // The value counts from the rest pose: value − (α − rest) = 0.
        out[n + row] += value + moved.rest;
        scatter(model, drive.joint.bodies(), &(gradient * state.lambda[row]), out);
        row += 1;
    }
}
