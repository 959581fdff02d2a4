//! Derivatives of an equilibrium by the design parameters (Megaro et al. 2017, eqs. 18–19), in the
//! forward form: one back-substitution per parameter with the factors of the accepted state.

use super::model::Model;
use super::newton::{Equilibrium, SolveError, Solver, gather};
use crate::rod::StrainDerivatives;
use nalgebra::{DMatrix, DVector, SMatrix};

/// First derivatives of one equilibrium by the n design parameters.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    /// Link increments (du, dφ per free body), dofs × n.
    pub links: DMatrix<f64>,
    /// Multipliers, rows × n.
    pub lambda: DMatrix<f64>,
    /// Internal increments of each rod (twists and vertices interleaved), internal × n.
    pub internal: Vec<DMatrix<f64>>,
    /// Strain measures of each rod with their total derivatives.
    pub strains: Vec<StrainDerivatives>,
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
        let solver = &mut self.solver;
        // Assembles and factors at the state itself; an accepted one takes no further iteration.
        solver.solve(model, equilibrium.state.clone(), target)?;
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
        let mut internal = Vec::with_capacity(model.rods.len());
        let mut strains = Vec::with_capacity(model.rods.len());
        for (rod, system) in model.rods.iter().zip(&mut solver.systems) {
            let mut d_link = DMatrix::zeros(12, parameters);
            for c in 0..parameters {
                let v: SMatrix<f64, 12, 1> = gather(model, rod.bodies, &rhs.column(c).clone_owned());
                d_link.set_column(c, &v);
            }
            let d_internal = system
                .internal_sensitivity(&d_link, &rod.dq_dp)
                .map_err(|_| SolveError::NoDerivatives)?;
            let d_strains = system
                .strain_derivatives(&rod.rod, &d_internal, &d_link, &rod.dq_dp)
                .map_err(|_| SolveError::NoDerivatives)?;
            internal.push(d_internal);
            strains.push(d_strains);
        }
        Ok(Sensitivity {
            links: rhs.rows(0, n).into_owned(),
            lambda: rhs.rows(n, m).into_owned(),
            internal,
            strains,
        })
    }
}
