//! Edges of the rod's centreline and its wide direction at an equilibrium, with derivatives by the design parameters: what
//! a distance to something else needs. One edge at a time: few are near to anything.

use super::assemble::{FIRST_INTERNAL, RodSystem, end_coordinates};
use super::sensitivity::{FIRST_PARAMETER, ParameterColumns, SensitivityError};
use super::{PARAMETERS, Rod};
use nalgebra::{DMatrix, Matrix3xX, Vector3};

/// Coordinates of an edge in their banded order: its two slots with its twist between them.
const OWN: usize = 7;
/// What they depend on: link increments and parameters.
const CAUSES: usize = FIRST_PARAMETER + PARAMETERS;

/// Derivatives of one edge by n variables.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeJacobian {
    /// Of both its vertices, 3 × n each, mm per unit.
    pub vertices: [Matrix3xX<f64>; 2],
    /// Of m₂, 3 × n.
    pub m2: Matrix3xX<f64>,
}

impl RodSystem {
    /// Derivatives of an edge's vertices and m₂ along n directions: `d_link` (12 × n) increments of the links and `dq` (19 × n) of
    /// the parameters, the inside following. m₂ = t × m₁ turns with the twist θ about the edge and with the edge:
    /// δm₂ = −θ m₁ − t (m₂·δe)/l.
    ///
    /// # Errors
    /// Without [`Self::parameter_columns`] for this state, with matrices of the wrong shape, or where there is no such edge.
    pub fn edge_jacobian(
        &self,
        rod: &Rod,
        edge: usize,
        d_link: &DMatrix<f64>,
        dq: &DMatrix<f64>,
    ) -> Result<EdgeJacobian, SensitivityError> {
        let columns = self.columns.as_deref().ok_or(SensitivityError::NoColumns)?;
        let (n, width) = (self.n, d_link.ncols());
        if d_link.nrows() != FIRST_PARAMETER || dq.nrows() != PARAMETERS || dq.ncols() != width || edge >= n {
            return Err(SensitivityError::Shape);
        }
        let by = self.own_columns(rod, columns, edge);
        let mut own = DMatrix::zeros(OWN, width);
        for (p, mut to) in own.column_iter_mut().enumerate() {
            let mut sum = [0.0; OWN];
            let causes = d_link.column(p);
            let parameters = dq.column(p);
            // Most parameters of a rod do not depend on a given design parameter.
            let acting = causes.iter().chain(parameters.iter()).zip(&by).filter(|(v, _)| **v != 0.0);
            for (v, by) in acting {
                sum.iter_mut().zip(by).for_each(|(s, by)| *s += by * v);
            }
            to.copy_from_slice(&sum);
        }
        let slot = |first: usize| -> Matrix3xX<f64> { own.fixed_rows::<3>(first).into_owned() };
        // Slot 0 and slot n hold the clamped edges themselves.
        let mut vertices = [slot(0), slot(4)];
        if edge == 0 {
            vertices[0] = &vertices[1] - &vertices[0];
        } else if edge == n - 1 {
            vertices[1] = &vertices[0] + &vertices[1];
        }
        let (f, de) = (&self.frames[edge], &vertices[1] - &vertices[0]);
        let across: Vector3<f64> = f.m2 / -f.l;
        let m2 = f.t * (across.transpose() * de) - f.m1 * own.row(3);
        Ok(EdgeJacobian { vertices, m2 })
    }

    /// Derivatives of an edge's own coordinates by each of the causes.
    fn own_columns(&self, rod: &Rod, columns: &ParameterColumns, edge: usize) -> [[f64; OWN]; CAUSES] {
        let (n, band) = (self.n, rod.band_freedoms());
        let mut out = [[0.0; OWN]; CAUSES];
        for k in 0..OWN {
            let at = 4 * edge + k;
            if let Some(row) = at.checked_sub(FIRST_INTERNAL).filter(|i| *i < band) {
                let solved = &columns.solved[row];
                out.iter_mut().zip(solved).for_each(|(to, s)| to[k] = -s);
                continue;
            }
            let end = usize::from(at >= FIRST_INTERNAL);
            let Some(row) = end_coordinates(end, n).iter().position(|i| *i == at) else { continue };
            (0..6).for_each(|c| out[6 * end + c][k] = self.jacobians[end][(row, c)]);
            (0..PARAMETERS).for_each(|c| out[FIRST_PARAMETER + c][k] = columns.ends[end][(row, c)]);
            if end == 1 && row < 3 && columns.slip.is_some() {
                // With shear, the chain ends short of link B by the slip.
                out.iter_mut().zip(&columns.solved[band + row]).for_each(|(to, s)| to[k] += s);
            }
        }
        out
    }
}
