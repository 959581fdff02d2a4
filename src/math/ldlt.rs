//! Dense symmetric indefinite factors P A Pᵀ = L D Lᵀ with 1×1 and 2×2 pivots
//! (Bunch & Kaufman, Math. Comp. 31 (1977) 163; the pivot rule is their algorithm A), with inertia.

use nalgebra::DMatrix;

/// (1 + √17) / 8: bounds the growth of both kinds of pivot alike.
const ALPHA: f64 = 0.640_388_203_202_208;

/// Right-hand sides that are solved for together.
pub(super) const BLOCK: usize = 8;

/// Solves for every column of `b` in place, [`BLOCK`] at a time.
pub(super) fn in_blocks(b: &mut DMatrix<f64>, solve: impl Fn(&mut [[f64; BLOCK]])) {
    let mut rows = vec![[0.0; BLOCK]; b.nrows()];
    for first in (0..b.ncols()).step_by(BLOCK) {
        let width = BLOCK.min(b.ncols() - first);
        for (i, row) in rows.iter_mut().enumerate() {
            *row = std::array::from_fn(|c| if c < width { b[(i, first + c)] } else { 0.0 });
        }
        solve(&mut rows);
        for (i, row) in rows.iter().enumerate() {
            for (c, value) in row.iter().enumerate().take(width) {
                b[(i, first + c)] = *value;
            }
        }
    }
}

/// Number of positive, negative and zero pivots: by Sylvester's law those of the eigenvalues.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Inertia {
    /// Positive eigenvalues.
    pub positive: usize,
    /// Negative eigenvalues.
    pub negative: usize,
    /// Exactly zero pivots.
    pub zero: usize,
}

/// Factors of a symmetric matrix.
#[derive(Clone, Debug)]
pub struct Ldlt {
    factors: DMatrix<f64>,
    /// Row swapped with (k, or k + 1 of a 2×2 pivot); the flag marks the first row of a 2×2 pivot.
    pivots: Vec<(usize, bool)>,
    inertia: Inertia,
}

impl Ldlt {
    /// Factors `a`, of which only the lower triangle is read.
    pub fn new(a: DMatrix<f64>) -> Self {
        let mut this = Self { factors: a, pivots: Vec::new(), inertia: Inertia::default() };
        this.factor();
        this
    }

    /// Pivot signs.
    pub fn inertia(&self) -> Inertia {
        self.inertia
    }

    /// Least size of a pivot; of a 2×2 one about that of its lesser eigenvalue.
    pub fn least_pivot(&self) -> f64 {
        let a = &self.factors;
        let size = |k: usize| match (self.pivots[k].1, k.checked_sub(1).is_some_and(|b| self.pivots[b].1)) {
            (true, _) => {
                let (d, e, f) = (a[(k, k)], a[(k + 1, k)], a[(k + 1, k + 1)]);
                ((d / e) * (f / e) - 1.0).abs() * e.abs()
            }
            // Counted with the row before.
            (false, true) => f64::INFINITY,
            (false, false) => a[(k, k)].abs(),
        };
        (0..a.nrows()).map(size).fold(f64::INFINITY, f64::min)
    }

    fn factor(&mut self) {
        let n = self.factors.nrows();
        let a = &mut self.factors;
        let mut k = 0;
        while k < n {
            let diagonal = a[(k, k)].abs();
            let (mut row, mut largest) = (k, 0.0);
            for i in k + 1..n {
                if a[(i, k)].abs() > largest {
                    (row, largest) = (i, a[(i, k)].abs());
                }
            }
            if diagonal.max(largest) == 0.0 {
                self.inertia.zero += 1;
                self.pivots.push((k, false));
                k += 1;
                continue;
            }
            let (pivot, two) = choose(a, k, row, diagonal, largest);
            let target = if two { k + 1 } else { k };
            if pivot != target {
                swap(a, k, target, pivot, two);
            }
            if two {
                eliminate_two(a, k, &mut self.inertia);
                self.pivots.push((pivot, true));
                self.pivots.push((pivot, false));
                k += 2;
            } else {
                eliminate_one(a, k, &mut self.inertia);
                self.pivots.push((pivot, false));
                k += 1;
            }
        }
    }

    /// Solves A x = b for each column of `b` in place. Zero pivots give zero components.
    pub fn solve_in_place(&self, b: &mut DMatrix<f64>) {
        in_blocks(b, |rows| self.solve_rows(rows));
    }

    /// Solves for `N` right-hand sides in place, of which `b` has the rows.
    pub(super) fn solve_rows<const N: usize>(&self, b: &mut [[f64; N]]) {
        let a = &self.factors;
        let n = a.nrows();
        let mut k = 0;
        while k < n {
            let (pivot, two) = self.pivots[k];
            if two {
                b.swap(k + 1, pivot);
                let (x, y) = (b[k], b[k + 1]);
                for (i, row) in b.iter_mut().enumerate().skip(k + 2) {
                    let (p, q) = (a[(i, k)], a[(i, k + 1)]);
                    for c in 0..N {
                        row[c] -= p * x[c] + q * y[c];
                    }
                }
                let (d, e, f) = (a[(k, k)], a[(k + 1, k)], a[(k + 1, k + 1)]);
                let determinant = (d / e) * (f / e) - 1.0;
                for c in 0..N {
                    b[k][c] = ((f / e) * (x[c] / e) - y[c] / e) / determinant;
                    b[k + 1][c] = ((d / e) * (y[c] / e) - x[c] / e) / determinant;
                }
                k += 2;
            } else {
                b.swap(k, pivot);
                let x = b[k];
                for (i, row) in b.iter_mut().enumerate().skip(k + 1) {
                    let p = a[(i, k)];
                    for c in 0..N {
                        row[c] -= p * x[c];
                    }
                }
                let d = a[(k, k)];
                b[k] = if d == 0.0 { [0.0; N] } else { x.map(|x| x / d) };
                k += 1;
            }
        }
        let mut k = n;
        while k > 0 {
            k -= 1;
            let second = k > 0 && self.pivots[k - 1].1;
            let mut own = b[k];
            let mut before = if second { b[k - 1] } else { [0.0; N] };
            for (i, row) in b.iter().enumerate().skip(k + 1) {
                let p = a[(i, k)];
                for c in 0..N {
                    own[c] -= p * row[c];
                }
                if second {
                    let q = a[(i, k - 1)];
                    for c in 0..N {
                        before[c] -= q * row[c];
                    }
                }
            }
            b[k] = own;
            if second {
                b[k - 1] = before;
            }
            b.swap(k, self.pivots[k].0);
            if second {
                k -= 1;
            }
        }
    }

    /// Solves A x = b in place for one right-hand side of matching length.
    pub fn solve_column(&self, b: &mut [f64]) {
        self.solve_rows(b.as_chunks_mut::<1>().0);
    }
}

/// Which row becomes the pivot, and whether it is a 2×2 one.
fn choose(a: &DMatrix<f64>, k: usize, row: usize, diagonal: f64, largest: f64) -> (usize, bool) {
    if diagonal >= ALPHA * largest {
        return (k, false);
    }
    let mut row_largest: f64 = 0.0;
    for j in k..row {
        row_largest = row_largest.max(a[(row, j)].abs());
    }
    for i in row + 1..a.nrows() {
        row_largest = row_largest.max(a[(i, row)].abs());
    }
    if diagonal >= ALPHA * largest * (largest / row_largest) {
        (k, false)
    } else if a[(row, row)].abs() >= ALPHA * row_largest {
        (row, false)
    } else {
        (row, true)
    }
}

/// Symmetric interchange of rows and columns `target` and `pivot` of the trailing lower triangle.
fn swap(a: &mut DMatrix<f64>, k: usize, target: usize, pivot: usize, two: bool) {
    for i in pivot + 1..a.nrows() {
        a.swap((i, target), (i, pivot));
    }
    for j in target + 1..pivot {
        a.swap((j, target), (pivot, j));
    }
    a.swap((target, target), (pivot, pivot));
    if two {
        a.swap((k + 1, k), (pivot, k));
    }
}

fn eliminate_one(a: &mut DMatrix<f64>, k: usize, inertia: &mut Inertia) {
    let n = a.nrows();
    let d = a[(k, k)];
    if d > 0.0 {
        inertia.positive += 1;
    } else {
        inertia.negative += 1;
    }
    let (left, right) = a.as_mut_slice().split_at_mut((k + 1) * n);
    let pivot = &mut left[k * n..];
    for (j, column) in (k + 1..n).zip(right.chunks_exact_mut(n)) {
        let w = pivot[j] / d;
        if w != 0.0 {
            for (to, from) in column[j..].iter_mut().zip(&pivot[j..]) {
                *to -= from * w;
            }
        }
    }
    for v in &mut pivot[k + 1..] {
        *v /= d;
    }
}

fn eliminate_two(a: &mut DMatrix<f64>, k: usize, inertia: &mut Inertia) {
    let n = a.nrows();
    let (d, e, f) = (a[(k, k)], a[(k + 1, k)], a[(k + 1, k + 1)]);
    // Divided by e first, so that nothing overflows; the pivot rule makes e the largest.
    let determinant = (d / e) * (f / e) - 1.0;
    if determinant < 0.0 {
        inertia.positive += 1;
        inertia.negative += 1;
    } else if d + f > 0.0 {
        inertia.positive += 2;
    } else {
        inertia.negative += 2;
    }
    let (left, right) = a.as_mut_slice().split_at_mut((k + 2) * n);
    let (first, second) = left[k * n..].split_at_mut(n);
    for (j, column) in (k + 2..n).zip(right.chunks_exact_mut(n)) {
        let (x, y) = (first[j], second[j]);
        let w = ((f / e) * (x / e) - y / e) / determinant;
        let v = ((d / e) * (y / e) - x / e) / determinant;
        for ((to, p), q) in column[j..].iter_mut().zip(&first[j..]).zip(&second[j..]) {
            *to -= p * w + q * v;
        }
        // Row j of these columns is not read again by later j.
        (first[j], second[j]) = (w, v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DVector, SymmetricEigen};

    fn random(n: usize, seed: u64) -> DMatrix<f64> {
        let mut s = seed;
        let mut next = || {
            s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((s >> 11) as f64) / (1u64 << 53) as f64 - 0.5
        };
        let m = DMatrix::from_fn(n, n, |_, _| next());
        &m + m.transpose()
    }

    #[test]
    fn solves_and_counts_like_the_eigenvalues() {
        for n in 1..25 {
            for seed in 0..8 {
                let mut a = random(n, seed * 31 + n as u64);
                if seed % 2 == 0 {
                    // A saddle-point matrix: zero block, forcing 2×2 pivots.
                    for i in n / 2..n {
                        for j in n / 2..n {
                            a[(i, j)] = 0.0;
                        }
                    }
                    if 2 * (n / 2) != n {
                        continue;
                    }
                }
                let x = DVector::from_fn(n, |i, _| (i as f64 + 1.0).sin());
                let mut b = &a * &x;
                let f = Ldlt::new(a.clone());
                f.solve_column(b.as_mut_slice());
                let eigen = SymmetricEigen::new(a.clone()).eigenvalues;
                let condition = eigen.amax() / eigen.iter().map(|v| v.abs()).fold(f64::MAX, f64::min);
                let mut many = DMatrix::from_fn(n, BLOCK + 3, |i, c| (i as f64 + c as f64).sin());
                let mut one = many.clone();
                f.solve_in_place(&mut many);
                one.column_iter_mut().for_each(|mut c| f.solve_column(c.as_mut_slice()));
                assert_eq!(many, one);
                assert!((b - x).amax() < 1e-13 * condition * n as f64, "n {n} seed {seed}");
                let negative = eigen.iter().filter(|v| **v < 0.0).count();
                assert_eq!(f.inertia().negative, negative);
                assert_eq!(f.inertia().positive, n - negative);
            }
        }
    }
}
