//! Sensitivities of a rod to its 19 parameters at an equilibrium (Megaro et al. 2017, eqs. 17–19).
//!
//! With y the internal freedoms, z the links' and q the parameters: K y' = −(g_q q' + C z'), and the links
//! see the condensed column b = g_link,q − Cᵀ K⁻¹ g_int,q. A parameter acts through rest lengths, rest
//! curvatures and stiffnesses, and through the clamped geometry its links carry: the latter in the chart
//! centred at the present clamps, in which the mixed second derivative of θ by (φ, q) is ½ of the change of
//! direction (the other half is the curvature of parallel transport).

use super::assemble::{END_COUPLING, FIRST_INTERNAL, RodSystem, end_coordinates, slot_signs};
use super::rest::RestShape;
use super::shear::{FREEDOMS, SlipDirections};
use super::{PARAMETERS, Rod, stretch_factor};
use crate::math::dual::Dual;
use crate::math::{Pose, banded::HALF_BANDWIDTH};
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use std::ops::Range;

/// Width of the joint solve: 12 link columns, 19 parameters, 3 for the force of rods with shear.
pub(crate) const WIDTH: usize = 34;
/// First parameter column.
pub(crate) const FIRST_PARAMETER: usize = 12;
/// First column of the force.
const FIRST_FORCE: usize = FIRST_PARAMETER + PARAMETERS;

/// 12 by 19: condensed columns.
pub type ParameterMatrix = SMatrix<f64, 12, PARAMETERS>;

/// Solutions kept for the chain rule.
#[derive(Clone, Debug)]
pub(crate) struct ParameterColumns {
    condensed: ParameterMatrix,
    /// K⁻¹ [C, g_int,q], one row per internal freedom, slip and force included.
    pub(crate) solved: Vec<[f64; WIDTH]>,
    /// Derivatives of slip and force.
    pub(crate) slip: Option<Box<SlipDirections>>,
    /// Derivatives by q of the coordinates (x, θ, e) each end carries.
    pub(crate) ends: [SMatrix<f64, 7, PARAMETERS>; 2],
}

/// Derivatives by q at a fixed inside.
struct DirectColumns {
    /// See [`ParameterColumns::ends`].
    ends: [SMatrix<f64, 7, PARAMETERS>; 2],
    /// Of the whole banded gradient, through rest quantities and stiffnesses.
    explicit: Vec<Row>,
}

/// Why sensitivities are not to be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensitivityError {
    /// The rod was not made by [`Rod::with_derivatives`].
    NoDerivatives,
    /// [`RodSystem::parameter_columns`] was not called since the last assembly.
    NoColumns,
    /// A matrix has the wrong number of rows or columns.
    Shape,
    /// Only rods without shear and Wagner's strain have them.
    Corrected,
}

impl std::fmt::Display for SensitivityError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NoDerivatives => "the rod was built without derivatives",
            Self::NoColumns => "parameter columns were not computed for this state",
            Self::Corrected => "only rods without shear and Wagner's strain have this derivative",
            Self::Shape => "a sensitivity matrix has the wrong shape",
        })
    }
}

impl std::error::Error for SensitivityError {}

pub(crate) type Row = [f64; PARAMETERS];

pub(crate) fn add_scaled(to: &mut Row, s: f64, from: &Row) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += s * f;
    }
}

impl RodSystem {
    /// Derivatives of the gradient by the 19 parameters at fixed state and poses, condensed onto the links
    /// (12 by 19; the links' moved centres do not depend on the parameters). At an equilibrium the links'
    /// sensitivities solve H dz = −b dq − …. Factors the unshifted Hessian if a shifted one was in use;
    /// then [`Self::condensed_hessian`] is renewed too.
    ///
    /// # Errors
    /// When the rod has no derivatives.
    pub fn parameter_columns(
        &mut self,
        rod: &Rod,
        pose_a: &Pose,
        pose_b: &Pose,
    ) -> Result<ParameterMatrix, SensitivityError> {
        let rest = rod.derivatives.as_deref().ok_or(SensitivityError::NoDerivatives)?;
        let direct = self.direct_columns(rod, rest, [pose_a, pose_b]);
        let mut solved = self.right_hand_sides::<WIDTH>(&direct, FIRST_PARAMETER);
        for (row, g) in solved.iter_mut().zip(self.force_columns()) {
            row[FIRST_FORCE..].copy_from_slice(g);
        }
        for end in 0..2 {
            let coupling = self.coupling(end);
            for (i, row) in solved[self.coupled_rows(end)].iter_mut().enumerate() {
                for c in 0..6 {
                    row[6 * end + c] += coupling[(i, c)];
                }
            }
        }
        let (condensed, slip) = self.solve_columns(rest, &direct, &mut solved, FIRST_PARAMETER);
        if let Some(slip) = &slip {
            through_slip(&mut solved, slip);
        }
        let columns = ParameterColumns { condensed, solved, slip: slip.map(Box::new), ends: direct.ends };
        self.columns = Some(Box::new(columns));
        Ok(condensed)
    }

    /// The same numbers without what [`Self::internal_sensitivity`] and the derivatives of strains follow from.
    ///
    /// # Errors
    /// When the rod has no derivatives.
    pub fn links_parameter_columns(
        &mut self,
        rod: &Rod,
        pose_a: &Pose,
        pose_b: &Pose,
    ) -> Result<ParameterMatrix, SensitivityError> {
        let rest = rod.derivatives.as_deref().ok_or(SensitivityError::NoDerivatives)?;
        let direct = self.direct_columns(rod, rest, [pose_a, pose_b]);
        let mut solved = self.right_hand_sides::<PARAMETERS>(&direct, 0);
        Ok(self.solve_columns(rest, &direct, &mut solved, 0).0)
    }

    /// What does not need the inside solved, for the unshifted Hessian.
    fn direct_columns(
        &mut self,
        rod: &Rod,
        rest: &RestShape<Dual<PARAMETERS>>,
        poses: [&Pose; 2],
    ) -> DirectColumns {
        if !self.is_factored() {
            self.factor_unshifted();
            self.condense();
        }
        let ends = [
            end_derivatives(rest, 0, &poses[0].rotation, rod),
            end_derivatives(rest, self.n - 1, &poses[1].rotation, rod),
        ];
        DirectColumns { ends, explicit: self.explicit_columns(rod, rest) }
    }

    /// Internal rows that one end couples to.
    fn coupled_rows(&self, end: usize) -> Range<usize> {
        let first = if end == 0 { 0 } else { self.factors.order() - END_COUPLING };
        first..first + END_COUPLING
    }

    /// Coupling of the internal rows to the force of rods with shear; empty without.
    fn force_columns(&self) -> &[[f64; 3]] {
        self.shear.as_deref().map_or(&[], |shear| &shear.columns[FIRST_INTERNAL..4 * self.n - 4])
    }

    /// g_int,q from column `first` on, all else zero; scratch rows behind.
    fn right_hand_sides<const W: usize>(&self, direct: &DirectColumns, first: usize) -> Vec<[f64; W]> {
        let parameters = first..first + PARAMETERS;
        let mut out = vec![[0.0; W]; self.factors.order() + HALF_BANDWIDTH];
        for (row, g) in out.iter_mut().zip(&direct.explicit[FIRST_INTERNAL..4 * self.n - 4]) {
            row[parameters.clone()].copy_from_slice(g);
        }
        for end in 0..2 {
            let through_clamp = self.end_coupling(end) * direct.ends[end];
            for (i, row) in out[self.coupled_rows(end)].iter_mut().enumerate() {
                for (c, to) in row[parameters.clone()].iter_mut().enumerate() {
                    *to += through_clamp[(i, c)];
                }
            }
        }
        out
    }

    /// Solves for the inside, and with that condenses the parameters, which begin at column `first`; with derivatives of slip
    /// and force.
    fn solve_columns<const W: usize>(
        &self,
        rest: &RestShape<Dual<PARAMETERS>>,
        direct: &DirectColumns,
        solved: &mut Vec<[f64; W]>,
        first: usize,
    ) -> (ParameterMatrix, Option<SlipDirections>) {
        self.factors.forward(solved, 0);
        self.factors.backward(solved);
        solved.truncate(self.factors.order());
        let mut condensed = ParameterMatrix::zeros();
        for end in 0..2 {
            let coupling = self.coupling(end);
            let mut rows = self.end_columns(end, &direct.explicit, &direct.ends[end]);
            for (i, row) in solved[self.coupled_rows(end)].iter().enumerate() {
                for r in 0..6 {
                    for c in 0..PARAMETERS {
                        rows[(r, c)] -= coupling[(i, r)] * row[first + c];
                    }
                }
            }
            condensed.fixed_rows_mut::<6>(6 * end).copy_from(&rows);
        }
        let slip = self.shear.is_some().then(|| {
            let mut by_force = self.force_parameter_columns(rest, &direct.ends);
            for (row, g) in solved.iter().zip(self.force_columns()) {
                for (k, g) in g.iter().enumerate() {
                    for c in 0..PARAMETERS {
                        by_force[(k, c)] -= g * row[first + c];
                    }
                }
            }
            self.condense_parameters(&mut condensed, &by_force)
        });
        (condensed, slip.flatten())
    }

    /// Condensed columns of the last [`Self::parameter_columns`] for this state.
    pub fn condensed_columns(&self) -> Option<&ParameterMatrix> {
        self.columns.as_deref().map(|c| &c.condensed)
    }

    /// Sensitivity of the internal freedoms, −K⁻¹(C dz + g_q dq): `d_link` is 12 by n, `dq` 19 by n, the
    /// result has one row per internal freedom, in the chart of [`Rod::retract`].
    ///
    /// # Errors
    /// Without parameter columns for this state, or with matrices of the wrong shape.
    pub fn internal_sensitivity(
        &self,
        d_link: &DMatrix<f64>,
        dq: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, SensitivityError> {
        let columns = self.columns.as_deref().ok_or(SensitivityError::NoColumns)?;
        let n = d_link.ncols();
        if d_link.nrows() != 12 || dq.nrows() != PARAMETERS || dq.ncols() != n {
            return Err(SensitivityError::Shape);
        }
        let mut out = DMatrix::zeros(columns.solved.len(), n);
        for (p, mut to) in out.column_iter_mut().enumerate() {
            // Most parameters of a rod do not depend on a given design parameter.
            let (z, q) = (d_link.column(p), dq.column(p));
            let all = z.iter().chain(q.iter()).copied().enumerate();
            let by: Vec<(usize, f64)> = all.filter(|(_, v)| *v != 0.0).collect();
            for (value, row) in to.iter_mut().zip(&columns.solved) {
                *value = -by.iter().map(|(c, v)| row[*c] * v).sum::<f64>();
            }
        }
        Ok(out)
    }

    /// The transposed map, for adjoints: a covector on the internal freedoms becomes one on the links (12)
    /// and one on the parameters (19).
    ///
    /// # Errors
    /// Without parameter columns for this state, or with a covector of the wrong length.
    pub fn internal_pull_back(
        &self,
        w: &[f64],
    ) -> Result<(SVector<f64, 12>, SVector<f64, PARAMETERS>), SensitivityError> {
        let columns = self.columns.as_deref().ok_or(SensitivityError::NoColumns)?;
        if w.len() != columns.solved.len() {
            return Err(SensitivityError::Shape);
        }
        let mut z = SVector::zeros();
        let mut q = SVector::zeros();
        for (w, row) in w.iter().zip(&columns.solved) {
            for c in 0..12 {
                z[c] -= w * row[c];
            }
            for c in 0..PARAMETERS {
                q[c] -= w * row[FIRST_PARAMETER + c];
            }
        }
        Ok((z, q))
    }

    /// Derivative of the whole banded gradient by q through rest quantities and stiffnesses.
    fn explicit_columns(&self, rod: &Rod, rest: &RestShape<Dual<PARAMETERS>>) -> Vec<Row> {
        let n = self.n;
        let mut out = vec![[0.0; PARAMETERS]; 4 * n + 3];
        let mut local = vec![[[0.0; PARAMETERS]; 4]; n];
        for (j, local) in local.iter_mut().enumerate().take(n - 1).skip(1) {
            let (l, l0) = (self.frames[j].l, rest.edge_lengths[j]);
            // F = EA (l/l̄ − 1)/w; its work on σ is F l.
            let scale = l / stretch_factor(j, n);
            add_scaled(&mut local[2], scale * (l / l0.re - 1.0), &rest.stiffness[j].ea.eps);
            add_scaled(&mut local[2], -scale * rod.ea[j] * l / (l0.re * l0.re), &l0.eps);
        }
        if let Some(shear) = &self.shear {
            for ((local, f), c) in local.iter_mut().zip(&self.frames).zip(&rest.shear) {
                let along = f.t.dot(&shear.force);
                add_scaled(&mut local[0], along * f.m1.dot(&shear.force), &c.eps);
                add_scaled(&mut local[1], along * f.m2.dot(&shear.force), &c.eps);
            }
        }
        self.weight_columns(rod, rest, &mut out);
        for i in 1..n {
            let measures = &self.measures[i];
            let (s0, s1, v) = (&rest.stiffness[i - 1], &rest.stiffness[i], rest.voronoi[i]);
            let (head, tail) = local.split_at_mut(i);
            let wagner = match (head.last_mut(), tail.first_mut()) {
                (Some(before), Some(after)) => {
                    self.wagner_columns(rod, rest, i, [&mut before[2], &mut after[2]])
                }
                _ => [0.0; PARAMETERS],
            };
            for (f, sum) in [s0.ei1 + s1.ei1, s0.ei2 + s1.ei2, s0.gj + s1.gj].into_iter().enumerate() {
                let b = sum / (v + v);
                let mut dm = [0.0; PARAMETERS];
                add_scaled(&mut dm, measures.value[f] - rod.rest_measures[i][f], &b.eps);
                add_scaled(&mut dm, -b.re, &rest.measures[i][f].eps);
                if f == 2 {
                    add_scaled(&mut dm, 1.0, &wagner);
                }
                for (edge, gradient) in [(i - 1, &measures.before[f]), (i, &measures.after[f])] {
                    for (row, g) in local[edge].iter_mut().zip(gradient) {
                        add_scaled(row, *g, &dm);
                    }
                }
            }
        }
        for (j, local) in local.iter().enumerate() {
            let basis = self.edge_basis(j);
            add_scaled(&mut out[4 * j + 3], 1.0, &local[3]);
            for (s, sign) in slot_signs(j, n).into_iter().enumerate() {
                for r in 0..3 {
                    for (c, row) in local.iter().enumerate().take(3) {
                        add_scaled(&mut out[4 * (j + s) + r], sign * basis[(r, c)], row);
                    }
                }
            }
        }
        out
    }

    /// Derivative of one link's six gradient entries by q, not condensed.
    fn end_columns(
        &self,
        end: usize,
        explicit: &[Row],
        carried: &SMatrix<f64, 7, PARAMETERS>,
    ) -> SMatrix<f64, 6, PARAMETERS> {
        let index = end_coordinates(end, self.n);
        let h = SMatrix::<f64, 7, 7>::from_fn(|i, j| {
            let (row, column) = (index[i].max(index[j]), index[i].min(index[j]));
            self.band[column][row - column]
        });
        let explicit = SMatrix::<f64, 7, PARAMETERS>::from_fn(|i, c| explicit[index[i]][c]);
        let mut out = self.jacobians[end].transpose() * (explicit + h * carried);
        let g = SVector::<f64, 7>::from_fn(|i, _| self.gradient[index[i]]);
        let (gx, ge): (Vector3<f64>, Vector3<f64>) =
            (g.fixed_rows::<3>(0).into_owned(), g.fixed_rows::<3>(4).into_owned());
        let frame = &self.frames[if end == 0 { 0 } else { self.n - 1 }];
        for c in 0..PARAMETERS {
            let dx: Vector3<f64> = carried.fixed_view::<3, 1>(0, c).into_owned();
            let de: Vector3<f64> = carried.fixed_view::<3, 1>(4, c).into_owned();
            let turn = (de - frame.t * frame.t.dot(&de)) / frame.l;
            let moment = dx.cross(&gx) + de.cross(&ge) + turn * (0.5 * g[3]);
            let mut column = out.fixed_view_mut::<3, 1>(3, c);
            column += moment;
        }
        out
    }
}

/// From K⁻¹ of all columns at fixed slip and force to derivatives with these following: link B's chain moves
/// by du_B − dD, and the force acts by its own columns. Slip and force become rows of their own.
fn through_slip(solved: &mut Vec<[f64; WIDTH]>, slip: &SlipDirections) {
    for row in solved.iter_mut() {
        let old = *row;
        for (c, to) in row.iter_mut().enumerate().take(FIRST_FORCE) {
            for k in 0..3 {
                *to += old[FIRST_FORCE + k] * slip[(3 + k, c)] - old[6 + k] * slip[(k, c)];
            }
        }
        row[FIRST_FORCE..].fill(0.0);
    }
    for k in 0..FREEDOMS {
        solved.push(std::array::from_fn(|c| if c < FIRST_FORCE { -slip[(k, c)] } else { 0.0 }));
    }
}

/// Derivatives by q of (x, θ, e) carried by the end with clamped edge `edge`, in the present orientation.
fn end_derivatives(
    rest: &RestShape<Dual<PARAMETERS>>,
    edge: usize,
    rotation: &nalgebra::Matrix3<f64>,
    rod: &Rod,
) -> SMatrix<f64, 7, PARAMETERS> {
    let (x0, x1) = (&rest.vertices[edge], &rest.vertices[edge + 1]);
    // The vertex shared with the free part.
    let inner = if edge == 0 { x1 } else { x0 };
    let m1 = &rod.rest.m1[edge];
    let t = (rod.rest.vertices[edge + 1] - rod.rest.vertices[edge]).normalize();
    let m2 = t.cross(m1);
    let mut out = SMatrix::<f64, 7, PARAMETERS>::zeros();
    for c in 0..PARAMETERS {
        let at = |v: &[Dual<PARAMETERS>; 3]| Vector3::new(v[0].eps[c], v[1].eps[c], v[2].eps[c]);
        out.fixed_view_mut::<3, 1>(0, c).copy_from(&(rotation * at(inner)));
        out[(3, c)] = m2.dot(&at(&rest.m1[edge]));
        out.fixed_view_mut::<3, 1>(4, c).copy_from(&(rotation * (at(x1) - at(x0))));
    }
    out
}
