//! Minimum of a strictly convex quadratic in a box, by projected Newton steps
//! (Bertsekas, SIAM J. Control Optim. 20 (1982) 221).

use nalgebra::{Cholesky, DMatrix, DVector};

/// Projected Newton steps at most; the active set of 34 variables settles in 2 to 10.
const STEPS: usize = 60;

/// Minimiser d of ½ dᵀA d + gᵀd with lower ≤ d ≤ upper, where A is positive definite and 0 lies in
/// the box. None if A cannot be factored.
pub fn minimize_in_box(
    a: &DMatrix<f64>,
    g: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
) -> Option<DVector<f64>> {
    let n = g.len();
    let mut d = DVector::zeros(n);
    let value = |d: &DVector<f64>| 0.5 * d.dot(&(a * d)) + g.dot(d);
    for _ in 0..STEPS {
        let r = a * &d + g;
        let free: Vec<usize> = (0..n)
            .filter(|&i| !((d[i] <= lower[i] && r[i] > 0.0) || (d[i] >= upper[i] && r[i] < 0.0)))
            .collect();
        if free.is_empty() {
            break;
        }
        let sub = DMatrix::from_fn(free.len(), free.len(), |i, j| a[(free[i], free[j])]);
        let rhs = DVector::from_fn(free.len(), |i, _| -r[free[i]]);
        let step = Cholesky::new(sub)?.solve(&rhs);
        let before = value(&d);
        let mut length = 1.0;
        let mut moved = 0.0f64;
        for _ in 0..40 {
            let mut next = d.clone();
            for (k, &i) in free.iter().enumerate() {
                next[i] = (d[i] + length * step[k]).clamp(lower[i], upper[i]);
            }
            if value(&next) <= before {
                moved = (&next - &d).amax();
                d = next;
                break;
            }
            length *= 0.5;
        }
        if moved <= 1e-14 * d.amax().max(1e-3) {
            break;
        }
    }
    Some(d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn satisfies_the_optimality_conditions() {
        let n = 12;
        let m = DMatrix::from_fn(n, n, |i, j| ((3 * i + 7 * j) as f64 * 0.37).sin());
        let a = &m * m.transpose() + DMatrix::identity(n, n) * 0.05;
        let g = DVector::from_fn(n, |i, _| (i as f64 * 1.7).cos() * 3.0);
        let lower = DVector::from_element(n, -0.4);
        let upper = DVector::from_element(n, 0.3);
        let d = minimize_in_box(&a, &g, &lower, &upper).unwrap();
        let r = &a * &d + &g;
        let mut at_bounds = 0;
        for i in 0..n {
            if d[i] <= lower[i] {
                assert!(r[i] >= -1e-9);
                at_bounds += 1;
            } else if d[i] >= upper[i] {
                assert!(r[i] <= 1e-9);
                at_bounds += 1;
            } else {
                assert!(r[i].abs() < 1e-9, "{i}: {}", r[i]);
            }
        }
        assert!(at_bounds > 2 && at_bounds < n);
    }
}
