//! Derivatives of an equilibrium by the design parameters (Megaro et al. 2017, eqs. 18–19), in the
//! forward form: one back-substitution per parameter with the factors of the accepted state.

use super::load::PointForce;
use super::model::Model;
use super::newton::{Equilibrium, SolveError, Solver};
use crate::rod::{PARAMETERS, StrainJacobian};
use nalgebra::{DMatrix, DVector};

/// First derivatives of one equilibrium by the n design parameters.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    /// Link increments (du, dφ per free body), dofs × n.
    pub links: DMatrix<f64>,
    /// Multipliers, rows × n.
    pub lambda: DMatrix<f64>,
    /// Per rod its own 31 directions (12 link increments, 19 parameters) by the n, 31 × n.
    pub directions: Vec<DMatrix<f64>>,
    /// Per rod its strain measures with their derivatives by those 31 directions.
    pub strains: Vec<StrainJacobian>,
}

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
        self.at_loaded(model, equilibrium, target, &[])
    }

    /// The same at an equilibrium under dead forces that do not depend on the parameters.
    ///
    /// # Errors
    /// [`SolveError`] if the equilibrium given is none.
    pub fn at_loaded(
        &mut self,
        model: &Model,
        equilibrium: &Equilibrium,
        target: &[f64],
        loads: &[PointForce],
    ) -> Result<Sensitivity, SolveError> {
        let solver = &mut self.solver;
        // Assembles and factors at the state itself; an accepted one takes no further iteration.
        solver.solve_loaded(model, equilibrium.state.clone(), target, loads)?;
        let (n, m) = (model.layout.dofs(), model.rows());
        let parameters = model.rods.first().map_or(0, |r| r.dq_dp.ncols());
        let mut rhs = DMatrix::zeros(n + m, parameters);
        for (rod, system) in model.rods.iter().zip(&mut solver.systems) {
            let [a, b] = rod.bodies.map(|b| &equilibrium.state.poses[b]);
            let columns = system.parameter_columns(&rod.rod, a, b);
            let columns = columns.map_err(|_| SolveError::NoDerivatives)? * &rod.dq_dp;
            for (half, body) in rod.bodies.into_iter().enumerate() {
                if let Some(first) = model.layout.bodies[body].first_dof {
                    let mut rows = rhs.rows_mut(first, 6);
                    rows -= columns.rows(6 * half, 6);
                }
            }
        }
        for mut column in rhs.column_iter_mut() {
            let mut v: DVector<f64> = column.clone_owned();
            solver.solve_scaled(&mut v);
            column.copy_from(&v);
        }
        let mut directions = Vec::with_capacity(model.rods.len());
        let mut strains = Vec::with_capacity(model.rods.len());
        for (rod, system) in model.rods.iter().zip(&solver.systems) {
            let mut own = DMatrix::zeros(12 + PARAMETERS, parameters);
            for (half, body) in rod.bodies.into_iter().enumerate() {
                if let Some(first) = model.layout.bodies[body].first_dof {
                    own.rows_mut(6 * half, 6).copy_from(&rhs.rows(first, 6));
                }
            }
            own.rows_mut(12, PARAMETERS).copy_from(&rod.dq_dp);
            directions.push(own);
            strains.push(system.strain_jacobian(&rod.rod).map_err(|_| SolveError::NoDerivatives)?);
        }
        Ok(Sensitivity {
            links: rhs.rows(0, n).into_owned(),
            lambda: rhs.rows(n, m).into_owned(),
            directions,
            strains,
        })
    }
}
