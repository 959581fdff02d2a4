//! The paper's first optimiser, as a baseline: (μ/μ_w, λ)-CMA-ES with cumulative step-size adaptation, default
//! parameters and positive weights of N. Hansen, The CMA Evolution Strategy: A Tutorial (arXiv:1604.00772, 2016), equations
//! cited below. It needs values only.
//!
//! Box: a candidate outside is judged by its projection, plus its squared distance from it (ibid., appendix B.5).
//! The random numbers are our own and seeded, so a run repeats bit by bit.

use super::problem::Trial;
use super::run::Ending;
use super::shared::Shared;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Step size at the start, in widths of the bounds (ibid., section 4: the optimum within about 3 σ).
const SIGMA: f64 = 0.3;
/// Seed of every run.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;
/// The run ends when the best value of a generation has fallen by less than this part of itself over [`WINDOW`].
const FALL: f64 = 1e-9;
/// Generations.
const WINDOW: usize = 50;

/// xorshift64* (Vigna 2016) and the Box–Muller transform.
struct Random {
    state: u64,
    spare: Option<f64>,
}

impl Random {
    fn new(seed: u64) -> Self {
        Self { state: seed.max(1), spare: None }
    }

    /// In (0, 1].
    fn uniform(&mut self) -> f64 {
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        let bits = self.state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        (bits as f64 + 1.0) / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }
}

/// The distribution and its paths.
struct Strategy {
    weights: Vec<f64>,
    mu_eff: f64,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    /// Mean length of a standard normal vector.
    chi: f64,
    lambda: usize,
    generation: i32,
    mean: DVector<f64>,
    sigma: f64,
    covariance: DMatrix<f64>,
    /// Eigenvectors and square roots of the eigenvalues of the covariance.
    axes: DMatrix<f64>,
    lengths: DVector<f64>,
    p_c: DVector<f64>,
    p_sigma: DVector<f64>,
    random: Random,
}

impl Strategy {
    fn new(mean: DVector<f64>, sigma: f64, seed: u64) -> Self {
        let n = mean.len() as f64;
        let lambda = 4 + (3.0 * n.ln()).floor().max(0.0) as usize; // (48)
        let mu = lambda / 2;
        let raw: Vec<f64> = (1..=mu).map(|i| ((lambda as f64 + 1.0) / 2.0).ln() - (i as f64).ln()).collect(); // (49)
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        let mu_eff = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0); // (55)
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n); // (56)
        let c_1 = 2.0 / ((n + 1.3).powi(2) + mu_eff); // (57)
        let rank_mu = 2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((n + 2.0).powi(2) + mu_eff); // (58)
        let size = mean.len();
        Self {
            weights,
            mu_eff,
            c_sigma,
            d_sigma,
            c_c,
            c_1,
            c_mu: rank_mu.min(1.0 - c_1),
            chi: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            lambda,
            generation: 0,
            mean,
            sigma,
            covariance: DMatrix::identity(size, size),
            axes: DMatrix::identity(size, size),
            lengths: DVector::from_element(size, 1.0),
            p_c: DVector::zeros(size),
            p_sigma: DVector::zeros(size),
            random: Random::new(seed),
        }
    }

    /// The λ candidates of a generation (38–40).
    fn ask(&mut self) -> Vec<DVector<f64>> {
        let n = self.mean.len();
        let one = |me: &mut Self| {
            let z = DVector::from_fn(n, |_, _| me.random.normal());
            &me.mean + &me.axes * z.component_mul(&me.lengths) * me.sigma
        };
        (0..self.lambda).map(|_| one(self)).collect()
    }

    /// Moves the distribution by the candidates in the order of their values, the best first (41–47).
    fn tell(&mut self, ranked: &[&DVector<f64>]) {
        let n = self.mean.len() as f64;
        let steps: Vec<DVector<f64>> = ranked.iter().map(|x| (*x - &self.mean) / self.sigma).collect();
        let mut mean_step = DVector::zeros(self.mean.len());
        for (w, y) in self.weights.iter().zip(&steps) {
            mean_step.axpy(*w, y, 1.0);
        }
        self.mean += &mean_step * self.sigma;
        // C^(-1/2) y
        let whitened = self.axes.tr_mul(&mean_step).component_div(&self.lengths);
        let whitened = &self.axes * whitened;
        let c = self.c_sigma;
        self.p_sigma = &self.p_sigma * (1.0 - c) + whitened * (c * (2.0 - c) * self.mu_eff).sqrt();
        self.generation += 1;
        let length = self.p_sigma.norm();
        let settled = (1.0 - (1.0 - c).powi(2 * self.generation)).sqrt();
        let h = f64::from(u8::from(length / settled < (1.4 + 2.0 / (n + 1.0)) * self.chi));
        let cc = self.c_c;
        self.p_c = &self.p_c * (1.0 - cc) + mean_step * (h * (cc * (2.0 - cc) * self.mu_eff).sqrt());
        let lost = (1.0 - h) * cc * (2.0 - cc);
        self.covariance *= 1.0 + self.c_1 * lost - self.c_1 - self.c_mu;
        self.covariance.ger(self.c_1, &self.p_c, &self.p_c, 1.0);
        for (w, y) in self.weights.iter().zip(&steps) {
            self.covariance.ger(self.c_mu * w, y, y, 1.0);
        }
        self.sigma *= (c / self.d_sigma * (length / self.chi - 1.0)).exp();
        self.covariance.fill_upper_triangle_with_lower_triangle();
        let eigen = SymmetricEigen::new(self.covariance.clone());
        self.lengths = eigen.eigenvalues.map(|v| v.max(f64::EPSILON).sqrt());
        self.axes = eigen.eigenvectors;
    }
}

/// Costs of candidates, ∞ where there is none, made comparable outside of the box: what is outside costs as much as the
/// generation's middle half spreads, a standard deviation.
fn judged(costs: &[f64], outside2: &[f64], sigma: f64) -> Vec<f64> {
    let mut sorted: Vec<f64> = costs.iter().copied().filter(|c| c.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |q: usize| sorted.get(q * sorted.len().saturating_sub(1) / 4).copied().unwrap_or(0.0);
    let spread = (at(3) - at(1)).max(f64::MIN_POSITIVE);
    costs.iter().zip(outside2).map(|(c, d)| c + spread * d / (sigma * sigma)).collect()
}

/// Minimises in the unit box from `x`, at most `limit` generations. What is best is kept in `shared`.
pub(super) fn cma_es(shared: &Shared, x: &[f64], limit: usize) -> (usize, Ending) {
    // The start first and alone: it fixes what soft maxima refer to.
    match shared.problem.simulate(x) {
        Some(start) => shared.report(0, &start),
        None => return (0, Ending::NoStart),
    }
    let mut strategy = Strategy::new(DVector::from_column_slice(x), SIGMA, SEED);
    let mut best_of: Vec<f64> = Vec::new();
    for generation in 1..=limit {
        let candidates = strategy.ask();
        let inside: Vec<Vec<f64>> =
            candidates.iter().map(|c| c.iter().map(|v| v.clamp(0.0, 1.0)).collect()).collect();
        let (problem, stop) = (&shared.problem, shared.stop());
        let simulate = |x: &Vec<f64>| if stop.load(Ordering::Relaxed) { None } else { problem.simulate(x) };
        let trials: Vec<Option<Trial>> = inside.par_iter().map(simulate).collect();
        if shared.cancelled() {
            return (generation - 1, Ending::Interrupted);
        }
        trials.iter().flatten().for_each(|t| shared.keep(t));
        let costs: Vec<f64> = trials.iter().map(|t| t.as_ref().map_or(f64::INFINITY, |t| t.cost)).collect();
        let outside2: Vec<f64> = candidates
            .iter()
            .zip(&inside)
            .map(|(c, i)| c.iter().zip(i).map(|(c, i)| (c - i).powi(2)).sum())
            .collect();
        let judged = judged(&costs, &outside2, strategy.sigma);
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        order.sort_by(|a, b| judged[*a].total_cmp(&judged[*b]));
        strategy.tell(&order.iter().map(|i| &candidates[*i]).collect::<Vec<_>>());
        shared.announce(generation);
        best_of.push(costs.iter().copied().fold(f64::INFINITY, f64::min));
        let before = best_of.len().checked_sub(1 + WINDOW).map(|i| &best_of[i..]);
        let settled = before.is_some_and(|recent| {
            let least = recent.iter().copied().fold(f64::INFINITY, f64::min);
            let most = recent.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            most - least <= FALL * least.abs()
        });
        if settled {
            return (generation, Ending::Converged);
        }
    }
    (limit, Ending::Limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Best value after so many generations, in the unit box.
    fn run(start: &[f64], generations: usize, f: impl Fn(&[f64]) -> f64) -> (f64, Vec<f64>) {
        let mut strategy = Strategy::new(DVector::from_column_slice(start), SIGMA, SEED);
        let mut best = (f64::INFINITY, Vec::new());
        for _ in 0..generations {
            let candidates = strategy.ask();
            let inside: Vec<Vec<f64>> =
                candidates.iter().map(|c| c.iter().map(|v| v.clamp(0.0, 1.0)).collect()).collect();
            let costs: Vec<f64> = inside.iter().map(|x| f(x)).collect();
            let outside2: Vec<f64> = candidates
                .iter()
                .zip(&inside)
                .map(|(c, i)| c.iter().zip(i).map(|(c, i)| (c - i).powi(2)).sum())
                .collect();
            let judged = judged(&costs, &outside2, strategy.sigma);
            let mut order: Vec<usize> = (0..candidates.len()).collect();
            order.sort_by(|a, b| judged[*a].total_cmp(&judged[*b]));
            strategy.tell(&order.iter().map(|i| &candidates[*i]).collect::<Vec<_>>());
            for (cost, x) in costs.iter().zip(inside) {
                if *cost < best.0 {
                    best = (*cost, x);
                }
            }
        }
        best
    }

    #[test]
    fn it_finds_the_minimum_of_a_badly_scaled_bowl() {
        let bowl = |x: &[f64]| {
            x.iter().enumerate().map(|(i, x)| 10_f64.powi(i as i32) * (x - 0.3).powi(2)).sum::<f64>()
        };
        let (value, x) = run(&[0.9; 6], 300, bowl);
        assert!(value < 1e-12, "{value} {x:?}");
    }

    #[test]
    fn it_follows_a_bent_valley() {
        let rosenbrock = |x: &[f64]| {
            let z: Vec<f64> = x.iter().map(|x| 4.0 * x - 2.0).collect();
            z.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum::<f64>()
        };
        let (value, x) = run(&[0.2; 5], 500, rosenbrock);
        assert!(value < 1e-9 && x.iter().all(|x| (x - 0.75).abs() < 1e-4), "{value} {x:?}");
    }

    #[test]
    fn a_minimum_outside_is_met_at_the_bound() {
        let plane = |x: &[f64]| (x[0] + 1.0).powi(2) + (x[1] - 0.4).powi(2) + (x[2] - 3.0).powi(2);
        let (value, x) = run(&[0.5; 3], 200, plane);
        assert!(x[0] < 1e-6 && (x[1] - 0.4).abs() < 1e-4 && x[2] > 1.0 - 1e-6, "{value} {x:?}");
    }

    #[test]
    fn what_cannot_be_computed_comes_last() {
        let pit = |x: &[f64]| if x[0] > 0.6 { f64::INFINITY } else { -x[0] + (x[1] - 0.5).powi(2) };
        let (value, x) = run(&[0.2, 0.9], 200, pit);
        assert!(value < -0.5999 && x[0] <= 0.6, "{value} {x:?}");
    }

    #[test]
    fn random_numbers_are_normal() {
        let mut random = Random::new(7);
        let n = 200_000;
        let all: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let mean = all.iter().sum::<f64>() / f64::from(n);
        let variance = all.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        let within = all.iter().filter(|x| x.abs() < 1.0).count() as f64 / f64::from(n);
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.02 && (within - 0.6827).abs() < 0.005);
    }
}
