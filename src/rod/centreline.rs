//! The rod's centreline and its wide direction at an equilibrium, with derivatives by the design parameters: what
//! a distance to something else needs.

use super::assemble::{RodSystem, end_coordinates};
use super::sensitivity::SensitivityError;
use super::{PARAMETERS, Rod};
use nalgebra::{DMatrix, Matrix3xX, Vector3};

/// Derivatives of a rod's vertices and material frames by n variables.
#[derive(Clone, Debug, PartialEq)]
pub struct CentrelineJacobian {
    /// Of the N + 1 vertices, 3 × n each, mm per unit.
    pub vertices: Vec<Matrix3xX<f64>>,
    /// Of m₂ of the N edges, 3 × n each.
    pub m2: Vec<Matrix3xX<f64>>,
}

impl RodSystem {
    /// Derivatives of vertices and m₂ along n directions: `d_link` (12 × n) increments of the links and `dq` (17 × n) of
    /// the parameters, the inside following. m₂ = t × m₁ turns with the twist θ about the edge and with the edge:
    /// δm₂ = −θ m₁ − t (m₂·δe)/l.
    ///
    /// # Errors
    /// Without [`Self::parameter_columns`] for this state, or with matrices of the wrong shape.
    pub fn centreline_jacobian(
        &self,
        rod: &Rod,
        d_link: &DMatrix<f64>,
        dq: &DMatrix<f64>,
    ) -> Result<CentrelineJacobian, SensitivityError> {
        let internal = self.internal_sensitivity(d_link, dq)?;
        let columns = self.columns.as_deref().ok_or(SensitivityError::NoColumns)?;
        let (n, width, band) = (self.n, d_link.ncols(), rod.band_freedoms());
        // All 4N + 3 coordinates of the rod in their banded order: e₀, θ₀, x₁, …, x_{N−1}, θ_{N−1}, e_{N−1}.
        let mut all = DMatrix::zeros(4 * n + 3, width);
        all.rows_mut(super::assemble::FIRST_INTERNAL, band).copy_from(&internal.rows(0, band));
        for end in 0..2 {
            let mut carried =
                self.jacobians[end] * d_link.rows(6 * end, 6) + columns.ends[end] * dq.rows(0, PARAMETERS);
            if end == 1 && columns.slip.is_some() {
                // With shear, the chain ends short of link B by the slip.
                let mut x = carried.rows_mut(0, 3);
                x -= internal.rows(band, 3);
            }
            for (row, to) in end_coordinates(end, n).into_iter().enumerate() {
                all.row_mut(to).copy_from(&carried.row(row));
            }
        }
        let slot = |k: usize| Matrix3xX::from_fn(width, |r, c| all[(4 * k + r, c)]);
        let mut vertices: Vec<Matrix3xX<f64>> = Vec::with_capacity(n + 1);
        vertices.push(slot(1) - slot(0));
        vertices.extend((1..n).map(slot));
        vertices.push(slot(n - 1) + slot(n));
        let m2 = (0..n)
            .map(|j| {
                let (f, de) = (&self.frames[j], &vertices[j + 1] - &vertices[j]);
                let across: Vector3<f64> = f.m2 / -f.l;
                f.t * (across.transpose() * de) - f.m1 * all.row(4 * j + 3)
            })
            .collect();
        Ok(CentrelineJacobian { vertices, m2 })
    }
}
