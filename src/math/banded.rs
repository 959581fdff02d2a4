//! L D Lᵀ factors of a symmetric banded matrix without pivoting, with a half bandwidth fixed at compile
//! time so that the inner loops unroll. By Sylvester's law the signs of D are the inertia of the matrix.

/// Half bandwidth of a rod's Hessian with vertices and twists interleaved.
pub const HALF_BANDWIDTH: usize = 10;
/// Entries kept per column: the diagonal, [`HALF_BANDWIDTH`] below it, and one of padding.
pub const COLUMN: usize = 12;
/// One column of a symmetric banded matrix: entry `d` is (j + d, j).
pub type BandColumn = [f64; COLUMN];

/// Factors of a symmetric banded matrix.
#[derive(Clone, Debug)]
pub struct BandedLdl {
    n: usize,
    columns: Vec<BandColumn>,
    inverse_pivots: Vec<f64>,
    negative: usize,
    smallest_ratio: f64,
}

impl BandedLdl {
    /// Room for an `n` by `n` matrix.
    pub fn new(n: usize) -> Self {
        Self {
            n,
            columns: vec![[0.0; COLUMN]; n + HALF_BANDWIDTH + 1],
            inverse_pivots: vec![0.0; n],
            negative: 0,
            smallest_ratio: 1.0,
        }
    }

    /// Order of the matrix.
    pub fn order(&self) -> usize {
        self.n
    }

    /// Number of pivots that are not positive.
    pub fn negative_pivots(&self) -> usize {
        self.negative
    }

    /// Least ratio of a pivot's size to the matrix's own diagonal entry: near rounding, the matrix is singular.
    pub fn smallest_pivot_ratio(&self) -> f64 {
        self.smallest_ratio
    }

    /// 1/D.
    pub fn inverse_pivots(&self) -> &[f64] {
        &self.inverse_pivots
    }

    /// Factors the matrix whose columns are `matrix` (entries beyond the last row are ignored) with
    /// `shift(j)` added to the diagonal. Returns the number of pivots that are not positive.
    pub fn factor(&mut self, matrix: &[BandColumn], shift: impl Fn(usize) -> f64) -> usize {
        let n = self.n;
        let Some(matrix) = matrix.get(..n) else {
            self.negative = n;
            return n;
        };
        for (j, (to, from)) in self.columns.iter_mut().zip(matrix).enumerate() {
            *to = *from;
            to[0] += shift(j);
            to[HALF_BANDWIDTH + 1] = 0.0;
            if j + HALF_BANDWIDTH >= n {
                to[n - j..].fill(0.0);
            }
        }
        for pad in &mut self.columns[n..] {
            *pad = [0.0; COLUMN];
        }
        self.negative = 0;
        self.smallest_ratio = f64::INFINITY;
        // Two columns at a time: the ones after them are loaded and stored half as often.
        let mut j = 0;
        while j + 1 < n {
            let first = self.columns[j];
            let scaled = self.pivot(j, &first, matrix[j][0] + shift(j));
            let mut second = self.columns[j + 1];
            for m in 1..=HALF_BANDWIDTH {
                second[m - 1] -= scaled[1] * first[m];
            }
            let after = self.pivot(j + 1, &second, matrix[j + 1][0] + shift(j + 1));
            if let Some(window) = self.columns[j + 2..].first_chunk_mut::<HALF_BANDWIDTH>() {
                for (k, target) in window.iter_mut().enumerate() {
                    let (l0, l1) = (scaled[k + 2], after[k + 1]);
                    for d in 0..HALF_BANDWIDTH - k {
                        target[d] -= l0 * first[k + 2 + d] + l1 * second[k + 1 + d];
                    }
                }
            }
            j += 2;
        }
        if j < n {
            let last = self.columns[j];
            self.pivot(j, &last, matrix[j][0] + shift(j));
        }
        self.negative
    }

    /// Takes column `j`, updated by those before it, as the next one of L and returns it; `own` is the matrix's own
    /// diagonal entry.
    #[inline(always)]
    fn pivot(&mut self, j: usize, column: &BandColumn, own: f64) -> BandColumn {
        let own = own.abs().max(f64::MIN_POSITIVE);
        let mut pivot = column[0];
        self.smallest_ratio = self.smallest_ratio.min(pivot.abs() / own);
        if pivot.is_nan() || pivot <= 0.0 {
            self.negative += 1;
            // An exact zero cannot be divided by; a perturbation at rounding level can.
            if pivot == 0.0 {
                pivot = -f64::EPSILON * own;
            }
        }
        let inverse = 1.0 / pivot;
        self.inverse_pivots[j] = inverse;
        let scaled = column.map(|v| v * inverse);
        self.columns[j] = scaled;
        self.columns[j][0] = pivot;
        scaled
    }

    /// Overwrites `rhs`, rows of `C` right-hand sides (at least `n` + [`HALF_BANDWIDTH`] rows, those
    /// beyond `n` are scratch), by L⁻¹ rhs. Rows before `first` must be zero.
    pub fn forward<const C: usize>(&self, rhs: &mut [[f64; C]], first: usize) {
        for j in first..self.n {
            let y = rhs[j];
            let l = &self.columns[j];
            if let Some(window) = rhs[j + 1..].first_chunk_mut::<HALF_BANDWIDTH>() {
                for (k, row) in window.iter_mut().enumerate() {
                    let l = l[k + 1];
                    for (r, y) in row.iter_mut().zip(&y) {
                        *r -= l * y;
                    }
                }
            }
        }
    }

    /// As [`Self::forward`] for the rows from `first` to the end only, the rows before being zero.
    pub fn forward_tail<const C: usize>(&self, tail: &mut [[f64; C]], first: usize) {
        for j in 0..tail.len() {
            let y = tail[j];
            let Some(l) = self.columns.get(first + j) else { return };
            for (row, l) in tail[j + 1..].iter_mut().zip(&l[1..=HALF_BANDWIDTH]) {
                for (r, y) in row.iter_mut().zip(&y) {
                    *r -= l * y;
                }
            }
        }
    }

    /// Overwrites `rhs` = L⁻¹ b, as left by [`Self::forward`], by the solution L⁻ᵀ D⁻¹ rhs.
    pub fn backward<const C: usize>(&self, rhs: &mut [[f64; C]]) {
        for row in rhs.iter_mut().skip(self.n) {
            *row = [0.0; C];
        }
        for j in (0..self.n).rev() {
            let inverse = self.inverse_pivots[j];
            let l = &self.columns[j];
            let mut y = rhs[j].map(|v| v * inverse);
            if let Some(window) = rhs[j + 1..].first_chunk::<HALF_BANDWIDTH>() {
                // The row found last comes last: what is before it need not wait.
                for (k, row) in window.iter().enumerate().rev() {
                    let l = l[k + 1];
                    for (y, r) in y.iter_mut().zip(row) {
                        *y -= l * r;
                    }
                }
            }
            rhs[j] = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    fn matrix(n: usize, diagonal: f64) -> (Vec<BandColumn>, DMatrix<f64>) {
        let mut band = vec![[0.0; COLUMN]; n];
        let mut dense = DMatrix::zeros(n, n);
        for j in 0..n {
            for d in 0..=HALF_BANDWIDTH.min(n - 1 - j) {
                let v = if d == 0 { diagonal } else { ((7 * j + 3 * d) as f64).sin() };
                band[j][d] = v;
                dense[(j + d, j)] = v;
                dense[(j, j + d)] = v;
            }
        }
        (band, dense)
    }

    #[test]
    fn solves_and_counts_like_dense() {
        for (diagonal, n) in [(12.0, 29), (1.5, 30), (-0.3, 29)] {
            let (band, dense) = matrix(n, diagonal);
            let mut ldl = BandedLdl::new(n);
            let negative = ldl.factor(&band, |_| 0.0);
            let eigen = dense.clone().symmetric_eigenvalues();
            assert_eq!(negative, eigen.iter().filter(|&&e| e < 0.0).count());
            let b = DVector::from_fn(n, |i, _| (i as f64).cos());
            let mut rhs = vec![[0.0; 1]; n + HALF_BANDWIDTH];
            for i in 0..n {
                rhs[i][0] = b[i];
            }
            ldl.forward(&mut rhs, 0);
            ldl.backward(&mut rhs);
            let x = DVector::from_fn(n, |i, _| rhs[i][0]);
            assert!((dense * x - &b).norm() < 1e-9 * b.norm());
        }
    }
}
