//! The scaled saddle-point system of links and multipliers: rods condensed one by one, constraints,
//! drives and loads added, factored with its inertia.

use super::model::{Model, State};
use super::newton::Solver;
use crate::kinematics::Constraint;
use crate::math::elimination::{Elimination, NODE, Pair};
use crate::math::fronts::{Blocks, Factors};
use nalgebra::{DMatrix, DVector, SVector};
use std::sync::Arc;

/// Lower-right regularisation δ = this · ‖J‖²/‖H‖ for redundant rows. 1e-12, 1e-10 and 1e-8 pass the same tests of
/// states, work and sensitivities, mechanisms with redundant rows and idle freedoms among them.
const REDUNDANCY: f64 = 1e-10;

impl Solver {
    /// Calls `f(row, bodies, λ, residual, scale, gradient)` for every constraint and drive row.
    pub(super) fn for_each_row(
        &mut self,
        model: &Model,
        state: &State,
        target: &[f64],
        mut f: impl FnMut(usize, [usize; 2], f64, f64, f64, &SVector<f64, 12>),
    ) {
        let n = model.layout.dofs();
        let mut row = 0;
        let mut residual = [0.0; Constraint::MAX_ROWS];
        for c in &model.layout.constraints {
            c.residual(&state.poses, &mut residual);
            c.jacobian(&state.poses, &mut self.jacobian);
            for (r, value) in residual.iter().enumerate().take(c.rows()) {
                let mut gradient = SVector::<f64, 12>::zeros();
                for k in 0..6 {
                    gradient[k] = self.jacobian.a[(r, k)];
                    gradient[6 + k] = self.jacobian.b[(r, k)];
                }
                f(row, c.bodies(), state.lambda[row], *value, self.scale[n + row], &gradient);
                row += 1;
            }
        }
        for (i, drive) in model.layout.drives.iter().enumerate() {
            let value = drive.joint.value(&state.poses, state.drives[i]);
            let gradient = drive.joint.gradient(&state.poses);
            f(
                row,
                drive.joint.bodies(),
                state.lambda[row],
                value - target[i],
                self.scale[n + row],
                &gradient,
            );
            row += 1;
        }
    }

    /// Factors and condenses the rods as assembled.
    pub(super) fn factor_rods(&mut self, exact: bool) {
        self.rods_positive = true;
        self.rods_factored += 1;
        for system in &mut self.systems {
            let report = if exact { system.factor_unshifted() } else { system.factor() };
            self.rods_positive &= report.negative_pivots == 0;
            system.condense();
        }
    }

    /// Factors the scaled saddle-point matrix of condensed rods. With `exact` nothing is
    /// shifted, and the answer says whether the state is a strict minimum; otherwise rods and links
    /// are shifted until the step is one of descent.
    pub(super) fn factor_links(&mut self, model: &Model, state: &State, exact: bool) -> bool {
        let n = model.layout.dofs();
        let m = model.rows();
        let order = Arc::clone(&self.order);
        let mut k = Blocks::new(&order);
        for (rod, system) in model.rods.iter().zip(&self.systems) {
            scatter_matrix(model, &order, rod.bodies, system.condensed_hessian(), &mut k);
        }
        let mut row = 0;
        for c in &model.layout.constraints {
            let lambda = &state.lambda[row..row + c.rows()];
            scatter_matrix(model, &order, c.bodies(), &c.hessian(&state.poses, lambda), &mut k);
            row += c.rows();
        }
        for (i, drive) in model.layout.drives.iter().enumerate() {
            let h = drive.joint.hessian(&state.poses) * state.lambda[row + i];
            scatter_matrix(model, &order, drive.joint.bodies(), &h, &mut k);
        }
        for load in &self.loads {
            if let Some(first) = model.layout.bodies[load.body].first_dof {
                let h = load.hessian(&state.poses[load.body]);
                k.add(&order, first, first, |r, c| h[(r, c)]);
            }
        }
        self.add_load_hessian(model, state, &order, &mut k);
        let target: Vec<f64> = state.drives.clone();
        self.for_each_row(model, state, &target, |row, bodies, _, _, _, gradient| {
            for (half, body) in bodies.into_iter().enumerate() {
                if let Some(first) = model.layout.bodies[body].first_dof {
                    k.add_row(&order, n + row, first, |c| gradient[6 * half + c]);
                }
            }
        });
        let (mut h_norm, mut j_norm) = (f64::MIN_POSITIVE, 0.0f64);
        k.for_each(&order, |i, j, entry| {
            *entry *= self.scale[i] * self.scale[j];
            if i == j && i < n {
                h_norm = h_norm.max(entry.abs());
            } else if (i < n) != (j < n) {
                j_norm = j_norm.max(entry.abs());
            }
        });
        for i in n..n + m {
            k.set_diagonal(&order, i, -REDUNDANCY * j_norm * j_norm / h_norm);
        }
        let mut factors = k.factor(&order);
        let minimum = |f: &Factors| f.inertia().negative == m && f.inertia().zero == 0;
        let stable = minimum(&factors) && self.rods_positive;
        if !exact {
            let mut shift = 1e-4 * h_norm;
            while !minimum(&factors) && shift < 1e6 * h_norm {
                let mut shifted = k.clone();
                for i in 0..n {
                    shifted.set_diagonal(&order, i, k.diagonal(&order, i) + shift);
                }
                factors = shifted.factor(&order);
                shift *= 10.0;
            }
        }
        self.factors = Some(factors);
        stable
    }

    /// Solves the factored system for one unscaled right-hand side in place.
    pub(super) fn solve_scaled(&self, rhs: &mut DVector<f64>) {
        rhs.component_mul_assign(&self.scale);
        if let Some(f) = &self.factors {
            f.solve_column(rhs.as_mut_slice());
        }
        rhs.component_mul_assign(&self.scale);
    }

    /// The same for every column.
    pub(super) fn solve_scaled_block(&self, rhs: &mut DMatrix<f64>) {
        let scale = |rhs: &mut DMatrix<f64>| {
            rhs.column_iter_mut().for_each(|mut c| c.component_mul_assign(&self.scale));
        };
        scale(rhs);
        if let Some(f) = &self.factors {
            f.solve_in_place(rhs);
        }
        scale(rhs);
    }
}

/// Adds a 12-vector of two bodies into the link vector.
pub(super) fn scatter(model: &Model, bodies: [usize; 2], v: &SVector<f64, 12>, out: &mut DVector<f64>) {
    for (half, body) in bodies.into_iter().enumerate() {
        if let Some(first) = model.layout.bodies[body].first_dof {
            for c in 0..6 {
                out[first + c] += v[6 * half + c];
            }
        }
    }
}

/// The increments of two bodies out of the link vector; zero for ground.
pub(super) fn gather(model: &Model, bodies: [usize; 2], v: &DVector<f64>) -> SVector<f64, 12> {
    let mut out = SVector::zeros();
    for (half, body) in bodies.into_iter().enumerate() {
        if let Some(first) = model.layout.bodies[body].first_dof {
            for c in 0..6 {
                out[6 * half + c] = v[first + c];
            }
        }
    }
    out
}

/// Adds a 12 × 12 matrix of two bodies into the links' blocks.
pub(super) fn scatter_matrix(
    model: &Model,
    order: &Elimination,
    bodies: [usize; 2],
    h: &nalgebra::SMatrix<f64, 12, 12>,
    out: &mut Blocks,
) {
    let first = bodies.map(|b| model.layout.bodies[b].first_dof);
    for (i, row) in first.iter().enumerate() {
        for (j, column) in first.iter().enumerate() {
            if let (Some(row), Some(column)) = (row, column) {
                out.add(order, *row, *column, |r, c| h[(6 * i + r, 6 * j + c)]);
            }
        }
    }
}

/// In which order links and multipliers are eliminated.
pub(super) fn elimination(model: &Model) -> Elimination {
    let layout = &model.layout;
    let moving = |bodies: [usize; 2]| bodies.map(|b| layout.bodies[b].first_dof.map(|first| first / NODE));
    let mut pairs: Vec<Pair> = model.rods.iter().map(|r| moving(r.bodies)).collect();
    pairs.extend(layout.loads.iter().filter_map(|l| l.pair()).map(moving));
    let constraints = layout.constraints.iter();
    let mut rows: Vec<Pair> =
        constraints.flat_map(|c| std::iter::repeat_n(moving(c.bodies()), c.rows())).collect();
    rows.extend(layout.drives.iter().map(|d| moving(d.joint.bodies())));
    Elimination::new(layout.dofs() / NODE, &pairs, &rows)
}
