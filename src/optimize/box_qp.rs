//! Minimum of a convex, piecewise quadratic model in a box, by projected Newton steps
//! (Bertsekas, SIAM J. Control Optim. 20 (1982) 221).

use nalgebra::{Cholesky, DMatrix, DVector};

/// Projected Newton steps at most; the active set of 34 variables settles in 2 to 10.
const STEPS: usize = 60;

/// A one-sided residual, linearised: ½ w max(0, value + row · d)².
#[derive(Clone, Debug, PartialEq)]
pub struct Hinge {
    /// w.
    pub weight: f64,
    /// Residual at d = 0; negative where the limit is kept.
    pub value: f64,
    /// Its gradient.
    pub row: DVector<f64>,
}

impl Hinge {
    fn excess(&self, d: &DVector<f64>) -> f64 {
        (self.value + self.row.dot(d)).max(0.0)
    }
}

/// The model gᵀd + ½ dᵀA d + Σ ½ wᵢ max(0, vᵢ + rowᵢ · d)².
pub struct Quadratic<'a> {
    /// Positive definite, n × n.
    pub a: &'a DMatrix<f64>,
    /// n.
    pub g: &'a DVector<f64>,
    /// One-sided terms.
    pub hinges: &'a [Hinge],
}

impl Quadratic<'_> {
    /// Value at d.
    pub fn value(&self, d: &DVector<f64>) -> f64 {
        let smooth = self.g.dot(d) + 0.5 * d.dot(&(self.a * d));
        self.hinges.iter().fold(smooth, |sum, h| sum + 0.5 * h.weight * h.excess(d).powi(2))
    }

    /// Gradient and (generalised) second derivatives at d.
    fn derivatives(&self, d: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let mut gradient = self.a * d + self.g;
        let mut hessian = self.a.clone();
        for h in self.hinges {
            let excess = h.excess(d);
            if excess > 0.0 {
                gradient.axpy(h.weight * excess, &h.row, 1.0);
                hessian.ger(h.weight, &h.row, &h.row, 1.0);
            }
        }
        (gradient, hessian)
    }

    /// Minimiser with lower ≤ d ≤ upper, where 0 lies in the box. None if A cannot be factored.
    pub fn minimize(&self, lower: &DVector<f64>, upper: &DVector<f64>) -> Option<DVector<f64>> {
        let n = self.g.len();
        let mut d = DVector::zeros(n);
        for _ in 0..STEPS {
            let (r, h) = self.derivatives(&d);
            let free: Vec<usize> = (0..n)
                .filter(|&i| !((d[i] <= lower[i] && r[i] > 0.0) || (d[i] >= upper[i] && r[i] < 0.0)))
                .collect();
            if free.is_empty() {
                break;
            }
            let sub = DMatrix::from_fn(free.len(), free.len(), |i, j| h[(free[i], free[j])]);
            let rhs = DVector::from_fn(free.len(), |i, _| -r[free[i]]);
            let step = Cholesky::new(sub)?.solve(&rhs);
            let before = self.value(&d);
            let mut length = 1.0;
            let mut moved = 0.0f64;
            for _ in 0..40 {
                let mut next = d.clone();
                for (k, &i) in free.iter().enumerate() {
                    next[i] = (d[i] + length * step[k]).clamp(lower[i], upper[i]);
                }
                if self.value(&next) <= before {
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
        // One limit that is broken at the start, one that the step would break, one far away.
        let hinge = |value: f64, k: usize| Hinge {
            weight: 0.5,
            value,
            row: DVector::from_fn(n, |i, _| ((i * k) as f64).sin()),
        };
        let hinges = [hinge(2.0, 3), hinge(-0.1, 5), hinge(-9.0, 7)];
        let model = Quadratic { a: &a, g: &g, hinges: &hinges };
        let d = model.minimize(&lower, &upper).unwrap();
        assert!(hinges[2].excess(&d) == 0.0 && hinges.iter().any(|h| h.excess(&d) > 0.0));
        let (r, _) = model.derivatives(&d);
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
