//! Transverse shear spread over the rod (Simo–Reissner), without a freedom per edge.
//!
//! Where the rod's internal force is F, edge j slips across its direction t_j by c_j (I − t_j t_jᵀ) F, with
//! c_j = |ē_j|/(k_s G A). The vertices keep the chain of edges *without* slip, which therefore ends short of
//! link B by the sum D of all slips. F is the same in every edge, so three numbers D and three multipliers F
//! do for the whole rod:
//!   Π = E(chain, A, B − D) + F·D + Σ ½ c_j (F·t_j)² − ½ Σ c_j |F|².
//! ∂Π/∂F = 0 makes D the sum of slips, ∂Π/∂D = 0 makes F the force at B, and the derivatives of (F·t_j)² by
//! the edges are the moments of F on the slips. Exact for rods loaded at their ends. The Hessian by F is
//! negative: a strict minimum has exactly three negative pivots more.

use super::assemble::{END_COUPLING, FIRST_INTERNAL, RodSystem, end_coordinates, slot_signs};
use super::condense::FactorReport;
use super::rest::RestShape;
use super::{PARAMETERS, Rod, RodState};
use crate::math::Pose;
use crate::math::banded::HALF_BANDWIDTH;
use crate::math::dual::Dual;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Slip and force.
pub(crate) const FREEDOMS: usize = 6;
/// First shift of the slip's block relative to its diagonal, its growth, and the most tries.
const SHIFTS: (f64, f64, usize) = (1e-3, 8.0, 24);

/// Pivots of slip and force below this part of the largest entry are not trusted with their sign.
const NEAR_ZERO: f64 = 1e-10;

type Vector6 = SVector<f64, FREEDOMS>;
type Matrix6 = SMatrix<f64, FREEDOMS, FREEDOMS>;
/// Derivatives of slip and force by the 12 link freedoms and the parameters.
pub(crate) type SlipDirections = SMatrix<f64, FREEDOMS, { 12 + PARAMETERS }>;

/// Workspace for slip and force.
#[derive(Clone, Debug)]
pub(crate) struct ShearSystem {
    slip: Vector3<f64>,
    pub(crate) force: Vector3<f64>,
    /// Sum of the c_j, mm/N.
    compliance: f64,
    /// ∂Π/∂F, mm, and ∂Π/∂D, N.
    force_gradient: Vector3<f64>,
    slip_gradient: Vector3<f64>,
    force_hessian: Matrix3<f64>,
    /// Derivative of the whole banded gradient by F.
    pub(crate) columns: Vec<[f64; 3]>,
    /// L⁻¹ of its internal part.
    pub(crate) reduced: Vec<[f64; 4]>,
    /// Gradient by (D, F), its coupling to the links, and the inverse Hessian, the inside condensed.
    gradient: Vector6,
    coupling: SMatrix<f64, FREEDOMS, 12>,
    inverse: Matrix6,
}

/// Number of negative eigenvalues, by the signs of the pivots (Sylvester) where none is near zero.
fn negative(m: &Matrix6) -> usize {
    let mut a = *m;
    let least = NEAR_ZERO * m.amax();
    let mut count = 0;
    for k in 0..FREEDOMS {
        let pivot = a[(k, k)];
        if pivot.is_nan() || pivot.abs() <= least {
            return m.symmetric_eigenvalues().iter().filter(|e| **e < 0.0).count();
        }
        count += usize::from(pivot < 0.0);
        for j in k + 1..FREEDOMS {
            let l = a[(j, k)] / pivot;
            for i in j..FREEDOMS {
                a[(i, j)] -= a[(i, k)] * l;
            }
        }
    }
    count
}

impl ShearSystem {
    pub(crate) fn new(n: usize) -> Self {
        Self {
            slip: Vector3::zeros(),
            force: Vector3::zeros(),
            compliance: 0.0,
            force_gradient: Vector3::zeros(),
            slip_gradient: Vector3::zeros(),
            force_hessian: Matrix3::zeros(),
            columns: vec![[0.0; 3]; 4 * n + 3],
            reduced: vec![[0.0; 4]; 4 * n - 11 + HALF_BANDWIDTH],
            gradient: Vector6::zeros(),
            coupling: SMatrix::zeros(),
            inverse: Matrix6::zeros(),
        }
    }

    /// Square of the residual, N².
    pub(crate) fn residual_square(&self) -> f64 {
        (self.force_gradient / self.compliance).norm_squared() + self.slip_gradient.norm_squared()
    }
}

impl Rod {
    /// The pose of link B as the chain of edges without slip sees it.
    pub(crate) fn chain_pose(&self, state: &RodState, pose_b: &Pose) -> Pose {
        if self.shear.is_empty() {
            return *pose_b;
        }
        Pose { translation: pose_b.translation - state.slip, ..*pose_b }
    }

    /// The terms of Π that do not belong to an edge.
    pub(crate) fn slip_energy(&self, state: &RodState) -> f64 {
        if self.shear.is_empty() {
            return 0.0;
        }
        let compliance: f64 = self.shear.iter().sum();
        state.force.dot(&state.slip) - 0.5 * compliance * state.force.norm_squared()
    }
}

impl RodSystem {
    /// Adds the shear energy of the edges, ½ c (F·t)²; called before the edges are scattered.
    pub(crate) fn shear_terms(&mut self, rod: &Rod, state: &RodState) {
        let Some(shear) = self.shear.as_deref_mut() else { return };
        (shear.slip, shear.force) = (state.slip, state.force);
        shear.compliance = rod.shear.iter().sum();
        shear.force_gradient = shear.slip - shear.force * shear.compliance;
        shear.force_hessian = Matrix3::identity() * -shear.compliance;
        for (j, c) in rod.shear.iter().enumerate() {
            let f = &self.frames[j];
            let (f1, f2, f3) = (f.m1.dot(&shear.force), f.m2.dot(&shear.force), f.t.dot(&shear.force));
            self.energy += 0.5 * c * f3 * f3;
            let (g, h) = (&mut self.edge_gradient[j], &mut self.edge_hessian[j]);
            g[0] += c * f3 * f1;
            g[1] += c * f3 * f2;
            // F·t to second order: F₃ + (αF₁ + βF₂)(1 − σ) − ½(α² + β²)F₃.
            h[0][0] += c * (f1 * f1 - f3 * f3);
            h[1][0] += c * f1 * f2;
            h[1][1] += c * (f2 * f2 - f3 * f3);
            h[2][0] -= c * f3 * f1;
            h[2][1] -= c * f3 * f2;
            shear.force_gradient += f.t * (c * f3);
            shear.force_hessian += f.t * f.t.transpose() * *c;
        }
        self.energy += rod.slip_energy(state);
    }

    /// Derivatives of the gradient by F; called when the links' terms are there.
    pub(crate) fn shear_columns(&mut self, rod: &Rod) {
        let Some(mut shear) = self.shear.take() else { return };
        shear.columns.fill([0.0; 3]);
        for (j, c) in rod.shear.iter().enumerate() {
            let f = &self.frames[j];
            let basis = self.edge_basis(j);
            let (f1, f2, f3) = (f.m1.dot(&shear.force), f.m2.dot(&shear.force), f.t.dot(&shear.force));
            // Rows: the local coordinates α, β, σ.
            let local = Matrix3::from_rows(&[
                ((f.t * f1 + f.m1 * f3) * *c).transpose(),
                ((f.t * f2 + f.m2 * f3) * *c).transpose(),
                Vector3::zeros().transpose(),
            ]);
            let spatial = basis * local;
            for (s, sign) in slot_signs(j, self.n).into_iter().enumerate() {
                for r in 0..3 {
                    for (k, to) in shear.columns[4 * (j + s) + r].iter_mut().enumerate() {
                        *to += sign * spatial[(r, k)];
                    }
                }
            }
        }
        shear.slip_gradient = shear.force - self.link_gradient.fixed_rows::<3>(6);
        self.shear = Some(shear);
    }

    /// Columns of the seven coordinates an end carries.
    fn end_force_columns(&self, shear: &ShearSystem, end: usize) -> SMatrix<f64, 7, 3> {
        let index = end_coordinates(end, self.n);
        SMatrix::from_fn(|i, k| shear.columns[index[i]][k])
    }

    /// Goes on from the factored band: condenses it, then slip and force. Where their block has not three
    /// negative eigenvalues, it is shifted if wanted, else they are counted.
    pub(crate) fn factor_shear(&mut self, mut report: FactorReport, shifted: bool) -> FactorReport {
        if self.shear.is_none() {
            return report;
        }
        self.condense_band();
        let Some(mut shear) = self.shear.take() else { return report };
        let n = self.factors.order();
        shear.reduced.fill([0.0; 4]);
        for (to, from) in shear.reduced.iter_mut().zip(&shear.columns[FIRST_INTERNAL..FIRST_INTERNAL + n]) {
            to[..3].copy_from_slice(from);
        }
        self.factors.forward(&mut shear.reduced, 0);
        let mut by_force = SMatrix::<f64, 12, 3>::zeros();
        for end in 0..2 {
            let direct = self.jacobians[end].transpose() * self.end_force_columns(&shear, end);
            by_force.fixed_rows_mut::<6>(6 * end).copy_from(&direct);
        }
        let mut hessian = shear.force_hessian;
        let mut gradient = shear.force_gradient;
        let inverse = self.factors.inverse_pivots();
        for ((y, z), d) in shear.reduced.iter().zip(&self.reduced).zip(inverse) {
            for k in 0..3 {
                let s = y[k] * d;
                gradient[k] -= s * z[6];
                for r in 0..3 {
                    hessian[(r, k)] -= s * y[r];
                }
                for r in 0..6 {
                    by_force[(r, k)] -= s * z[r];
                }
            }
        }
        let last = n - END_COUPLING..n;
        for ((y, z), d) in shear.reduced[last.clone()].iter().zip(&self.reduced_b).zip(&inverse[last]) {
            for k in 0..3 {
                let s = y[k] * d;
                for r in 0..6 {
                    by_force[(6 + r, k)] -= s * z[r];
                }
            }
        }
        // B's chain moves by du_B − dD.
        let chain = &self.condensed_hessian;
        let mut block = Matrix6::zeros();
        let slip_force = Matrix3::identity() - by_force.fixed_rows::<3>(6);
        block.fixed_view_mut::<3, 3>(0, 0).copy_from(&chain.fixed_view::<3, 3>(6, 6));
        block.fixed_view_mut::<3, 3>(0, 3).copy_from(&slip_force);
        block.fixed_view_mut::<3, 3>(3, 0).copy_from(&slip_force.transpose());
        block.fixed_view_mut::<3, 3>(3, 3).copy_from(&((hessian + hessian.transpose()) * 0.5));
        shear.coupling.fixed_rows_mut::<3>(0).copy_from(&(-chain.fixed_rows::<3>(6)));
        shear.coupling.fixed_rows_mut::<3>(3).copy_from(&by_force.transpose());
        let condensed: Vector3<f64> = self.condensed_gradient.fixed_rows::<3>(6).into_owned();
        shear.gradient.fixed_rows_mut::<3>(0).copy_from(&(shear.force - condensed));
        shear.gradient.fixed_rows_mut::<3>(3).copy_from(&gradient);

        // To one unit: F in units of the rod's shear stiffness times a length.
        let scale = Vector6::from_fn(|i, _| if i < 3 { 1.0 } else { 1.0 / shear.compliance });
        let scaled = Matrix6::from_fn(|i, j| block[(i, j)] * scale[i] * scale[j]);
        let count = negative(&scaled);
        report.negative_pivots = (report.negative_pivots + count).saturating_sub(3);
        let mut used = scaled;
        if shifted && count != 3 {
            let (first, growth, tries) = SHIFTS;
            let mut shift = first * scaled.diagonal().amax();
            for _ in 0..tries {
                for i in 0..FREEDOMS {
                    used[(i, i)] = scaled[(i, i)] + if i < 3 { shift } else { -shift };
                }
                if negative(&used) == 3 {
                    break;
                }
                shift *= growth;
            }
            report.shift = report.shift.max(shift);
            // What is factored is not the Hessian: sensitivities must factor anew.
            self.factored = Some(report.shift);
        }
        report.positive_definite =
            if shifted { report.positive_definite } else { report.negative_pivots == 0 };
        // A singular block leaves slip and force where they are.
        let inverse = used.try_inverse().unwrap_or_else(Matrix6::zeros);
        shear.inverse =
            Matrix6::from_fn(|i, j| 0.5 * (inverse[(i, j)] + inverse[(j, i)]) * scale[i] * scale[j]);

        let back = shear.coupling.transpose() * shear.inverse;
        self.condensed_gradient -= back * shear.gradient;
        self.condensed_hessian -= back * shear.coupling;
        let symmetric = (self.condensed_hessian + self.condensed_hessian.transpose()) * 0.5;
        self.condensed_hessian = symmetric;
        self.shear = Some(shear);
        report
    }

    /// The share of slip and force in [`Self::condense_gradient`].
    pub(crate) fn condense_shear_gradient(&mut self) {
        let Some(shear) = self.shear.as_deref_mut() else { return };
        let mut gradient = shear.force_gradient;
        for ((y, z), d) in shear.reduced.iter().zip(&self.reduced).zip(self.factors.inverse_pivots()) {
            let s = z[6] * d;
            for (to, y) in gradient.iter_mut().zip(y) {
                *to -= s * y;
            }
        }
        let condensed: Vector3<f64> = self.condensed_gradient.fixed_rows::<3>(6).into_owned();
        shear.gradient.fixed_rows_mut::<3>(0).copy_from(&(shear.force - condensed));
        shear.gradient.fixed_rows_mut::<3>(3).copy_from(&gradient);
        self.condensed_gradient -= shear.coupling.transpose() * (shear.inverse * shear.gradient);
    }

    /// Increments of slip and force for the links' `d`, which becomes the chain's, and for `share` of the gradient.
    pub(crate) fn shear_increment(&self, d: &mut SVector<f64, 12>, share: f64) -> Option<Vector6> {
        let shear = self.shear.as_deref()?;
        let extra = -(shear.inverse * (shear.gradient * share + shear.coupling * *d));
        let mut b = d.fixed_rows_mut::<3>(6);
        b -= extra.fixed_rows::<3>(0);
        Some(extra)
    }

    /// Derivative of ∂Π/∂F by the parameters at a fixed state, not condensed.
    pub(crate) fn force_parameter_columns(
        &self,
        rest: &RestShape<Dual<PARAMETERS>>,
        ends: &[SMatrix<f64, 7, PARAMETERS>; 2],
    ) -> SMatrix<f64, 3, PARAMETERS> {
        let mut out = SMatrix::zeros();
        let Some(shear) = self.shear.as_deref() else { return out };
        for (frame, c) in self.frames.iter().zip(&rest.shear) {
            let v = frame.t * frame.t.dot(&shear.force) - shear.force;
            for (k, dc) in c.eps.iter().enumerate() {
                let mut column = out.column_mut(k);
                column += v * *dc;
            }
        }
        for (end, carried) in ends.iter().enumerate() {
            out += self.end_force_columns(shear, end).transpose() * carried;
        }
        out
    }

    /// Completes condensed parameter columns: `links` of the chain, and ∂²Π/∂F∂q condensed. Returns the
    /// derivatives of slip and force by links and parameters.
    pub(crate) fn condense_parameters(
        &self,
        links: &mut SMatrix<f64, 12, PARAMETERS>,
        by_force: &SMatrix<f64, 3, PARAMETERS>,
    ) -> Option<SlipDirections> {
        let shear = self.shear.as_deref()?;
        let mut right = SMatrix::<f64, FREEDOMS, { 12 + PARAMETERS }>::zeros();
        right.fixed_view_mut::<6, 12>(0, 0).copy_from(&shear.coupling);
        right.fixed_view_mut::<3, PARAMETERS>(0, 12).copy_from(&(-links.fixed_rows::<3>(6)));
        right.fixed_view_mut::<3, PARAMETERS>(3, 12).copy_from(by_force);
        let directions = -(shear.inverse * right);
        *links += shear.coupling.transpose() * directions.fixed_columns::<PARAMETERS>(12);
        Some(directions)
    }

    /// Fills the rows and columns of slip and force into a dense system whose first `band` unknowns are those
    /// of the band and whose last twelve the links'.
    #[cfg(test)]
    pub(crate) fn dense_shear(
        &self,
        band: usize,
        g: &mut nalgebra::DVector<f64>,
        h: &mut nalgebra::DMatrix<f64>,
    ) {
        let Some(shear) = self.shear.as_deref() else { return };
        let (d, f, n) = (band, band + 3, band + FREEDOMS);
        g.rows_mut(d, 3).copy_from(&shear.slip_gradient);
        g.rows_mut(f, 3).copy_from(&shear.force_gradient);
        let mut set = |i: usize, j: usize, v: f64| (h[(i, j)], h[(j, i)]) = (v, v);
        for k in 0..3 {
            for i in 0..band {
                set(f + k, i, shear.columns[FIRST_INTERNAL + i][k]);
            }
            for end in 0..2 {
                let column = self.jacobians[end].transpose() * self.end_force_columns(shear, end);
                (0..6).for_each(|i| set(f + k, n + 6 * end + i, column[(i, k)]));
            }
            let coupling = self.coupling(1);
            (0..END_COUPLING).for_each(|i| set(d + k, band - END_COUPLING + i, -coupling[(i, k)]));
            (0..6).for_each(|i| set(d + k, n + 6 + i, -self.link_hessian[(6 + k, 6 + i)]));
            for r in 0..3 {
                set(f + r, f + k, shear.force_hessian[(r, k)]);
                set(d + r, d + k, self.link_hessian[(6 + r, 6 + k)]);
                let by_b = (self.jacobians[1].transpose() * self.end_force_columns(shear, 1))[(r, k)];
                set(d + r, f + k, if r == k { 1.0 } else { 0.0 } - by_b);
            }
        }
    }
}
