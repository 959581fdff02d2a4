//! Normal equations of a weighted sum of squares: what Gauss–Newton and gradient methods both need.

use nalgebra::{DMatrix, DVector};

/// f = ½ Σ w r², its gradient Σ w r ∇r and its Gauss–Newton matrix Σ w ∇r ∇rᵀ, for n parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Normal {
    /// f.
    pub cost: f64,
    /// n.
    pub gradient: DVector<f64>,
    /// n × n, lower triangle filled until [`Normal::complete`].
    pub gauss_newton: DMatrix<f64>,
    /// n; belongs to the gradient, but not to what a soft maximum's matrix is corrected by.
    pub tilt: DVector<f64>,
}

impl Normal {
    /// Zero.
    pub fn new(n: usize) -> Self {
        Self {
            cost: 0.0,
            gradient: DVector::zeros(n),
            gauss_newton: DMatrix::zeros(n, n),
            tilt: DVector::zeros(n),
        }
    }

    /// Adds ½ w r² with gradient `row` of r.
    pub fn add(&mut self, weight: f64, residual: f64, row: &[f64]) {
        self.cost += 0.5 * weight * residual * residual;
        for (j, rj) in row.iter().enumerate() {
            if *rj == 0.0 {
                continue;
            }
            self.gradient[j] += weight * residual * rj;
            self.add_column(j, weight * rj, row);
        }
    }

    /// Adds a function of r with first derivative `slope` and second derivative `curvature` (at least 0), its
    /// value apart; `row` is the gradient of r.
    pub fn add_model(&mut self, slope: f64, curvature: f64, row: &[f64]) {
        for (j, rj) in row.iter().enumerate() {
            if *rj == 0.0 {
                continue;
            }
            self.gradient[j] += slope * rj;
            self.add_column(j, curvature * rj, row);
        }
    }

    /// Adds `factor` times the lower part of `row` to a column of the matrix.
    fn add_column(&mut self, j: usize, factor: f64, row: &[f64]) {
        let n = self.gradient.len();
        let column = self.gauss_newton.as_mut_slice().get_mut(j * n + j..(j + 1) * n).unwrap_or_default();
        for (to, r) in column.iter_mut().zip(&row[j..]) {
            *to += factor * r;
        }
    }

    /// Adds a part of the gradient alone: see [`Self::tilt`].
    pub fn add_tilt(&mut self, slope: f64, row: &[f64]) {
        for (t, r) in self.tilt.iter_mut().zip(row) {
            *t += slope * r;
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        self.cost += other.cost;
        self.gradient += &other.gradient;
        self.tilt += &other.tilt;
        self.gauss_newton += &other.gauss_newton;
    }

    /// Mirrors the lower triangle.
    pub fn complete(&mut self) {
        self.gauss_newton.fill_upper_triangle_with_lower_triangle();
    }
}
