//! Normal equations of a weighted sum of squares: what Gauss–Newton and gradient methods both need.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Columns of a matrix that are summed by one thread at a time, at least.
const COLUMNS: usize = 8;

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

    /// Sum of several of n parameters, each number in their order, on any number of threads: the same bits as one after another.
    pub fn sum(n: usize, parts: &[&Self]) -> Self {
        let mut out = Self::new(n);
        for part in parts {
            out.cost += part.cost;
            out.gradient += &part.gradient;
            out.tilt += &part.tilt;
        }
        let columns = out.gauss_newton.as_mut_slice().par_chunks_mut(n.max(1)).enumerate();
        // A column is a short piece of work.
        columns.with_min_len(COLUMNS).for_each(|(j, column)| {
            let below = j * n + j..(j + 1) * n;
            for part in parts {
                let more = part.gauss_newton.as_slice().get(below.clone()).unwrap_or_default();
                column.iter_mut().skip(j).zip(more).for_each(|(to, from)| *to += from);
            }
        });
        out
    }

    /// Mirrors the lower triangle.
    pub fn complete(&mut self) {
        self.gauss_newton.fill_upper_triangle_with_lower_triangle();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_has_the_bits_of_one_after_another() {
        let n = 37;
        let value = |k: usize| ((k * 2_654_435_761) % 1_000_003) as f64 / 7919.0 - 50.0;
        let part = |k: usize| {
            let mut part = Normal::new(n);
            for r in 0..3 {
                let row: Vec<f64> = (0..n).map(|j| value(1000 * k + 100 * r + j)).collect();
                part.add(value(k + r).abs(), value(k * r + 7), &row);
                part.add_tilt(value(k), &row);
            }
            part
        };
        let parts: Vec<Normal> = (0..20).map(part).collect();
        let mut one_by_one = Normal::new(n);
        parts.iter().for_each(|p| one_by_one.merge(p));
        assert!(one_by_one.gauss_newton[(n - 1, 0)] != 0.0);
        assert_eq!(Normal::sum(n, &parts.iter().collect::<Vec<_>>()), one_by_one);
        assert_eq!(Normal::sum(n, &[]), Normal::new(n));
    }
}
