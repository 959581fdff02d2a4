//! The largest of many values as a smooth, monotone function of them: S = M + ln(Σ wᵢ e^{β(xᵢ − M)})/β with
//! M = max xᵢ and quadrature weights Σ wᵢ = 1. The paper's Σ x e^{βx}/Σ e^{βx} (Megaro et al. 2017, eqs. 6, 16)
//! falls when a small value rises; this one never does, does not depend on the number of samples, and cannot
//! overflow. It lies below the true maximum by at most −ln(w)/β.

use super::{StateView, StatesSensitivity};
use crate::optimize::Normal;

/// β times the reference value: the paper's "large positive value". A maximum taken on over a sixtieth of the
/// cycle then reads 8 % low, over a third 2 %.
const SHARPNESS: f64 = 50.0;
/// Samples with less than e^−40 of the weight of the largest take no part in derivatives: below rounding.
const NEGLIGIBLE: f64 = -40.0;

/// A term that is the soft maximum of samples over the whole cycle, times a weight.
pub trait Sampled: Send + Sync {
    /// As shown to the user, e.g. `torque(motor)`.
    fn name(&self) -> &str;
    /// What the soft maximum counts in the sum, per unit of x.
    fn weight(&self) -> f64;
    /// Which soft maximum.
    fn form(&self) -> SoftForm {
        SoftForm::Monotone
    }
    /// Calls `f(x, w)` for every sample of one state; the weights of all states have sum one.
    fn samples(&self, view: &StateView, f: &mut dyn FnMut(f64, f64));
    /// Adds the first derivatives of one state's samples, and their share of the curvature, to `out`:
    /// see [`Level::slope`] and [`Level::curvature`].
    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, level: &Level, out: &mut Normal);
}

/// Which soft maximum of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SoftForm {
    /// S of the module.
    #[default]
    Monotone,
    /// The paper's weighted mean; see `paper.rs`.
    Paper,
}

/// Hands out samples (x, w).
type Samples<'a> = dyn Fn(&mut dyn FnMut(f64, f64)) + 'a;

fn largest(samples: &Samples) -> f64 {
    let mut largest = 0.0f64;
    samples(&mut |x, _| largest = largest.max(x));
    largest
}

/// A soft maximum over the cycle, as its derivatives need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// S, or the paper's.
    pub value: f64,
    /// β.
    pub beta: f64,
    /// S in either form: w e^{β(x − base)} have sum one.
    base: f64,
    form: SoftForm,
}

impl Level {
    /// Largest x of the cycle: fixes β for a run.
    pub fn reference(term: &dyn Sampled, cycle: &[StateView]) -> f64 {
        largest(&|f| cycle.iter().for_each(|view| term.samples(view, f)))
    }

    /// The soft maximum with β = 50/`reference`.
    pub fn new(term: &dyn Sampled, cycle: &[StateView], reference: f64) -> Self {
        Self::of(&|f| cycle.iter().for_each(|view| term.samples(view, f)), reference, term.form())
    }

    /// Of the samples (x ≥ 0, w) that `samples` hands out; 0 where there are none.
    fn of(samples: &Samples, reference: f64, form: SoftForm) -> Self {
        let beta = SHARPNESS / reference.max(f64::MIN_POSITIVE.sqrt());
        let largest = largest(samples);
        let (mut sum, mut moment) = (0.0, 0.0);
        samples(&mut |x, w| {
            let e = w * (beta * (x - largest)).exp();
            sum += e;
            moment += e * x;
        });
        if sum <= 0.0 {
            return Self { value: 0.0, beta, base: 0.0, form };
        }
        let base = largest + sum.ln() / beta;
        let value = match form {
            SoftForm::Monotone => base,
            SoftForm::Paper => moment / sum,
        };
        Self { value, beta, base, form }
    }

    /// ∂S/∂x of a sample; 0 where it does not matter.
    pub fn slope(&self, x: f64, w: f64) -> f64 {
        match self.form {
            SoftForm::Monotone => self.share(x, w),
            SoftForm::Paper => self.share(x, w) * (1.0 + self.beta * (x - self.value)),
        }
    }

    /// Part of a sample in the whole, Σ = 1; 0 where it does not matter.
    fn share(&self, x: f64, w: f64) -> f64 {
        let exponent = self.beta * (x - self.base);
        if exponent < NEGLIGIBLE { 0.0 } else { w * exponent.exp() }
    }

    /// A positive curvature by ∇x ∇xᵀ of a sample of the paper's form, whose own may be negative.
    pub fn curvature_at(&self, x: f64, w: f64) -> f64 {
        self.beta * self.share(x, w)
    }

    /// Factor of ∇x ∇xᵀ that belongs to a sample's slope: β ∂S/∂x. The rest of ∇²S, −β ∇S ∇Sᵀ, couples all
    /// samples and is taken off once by [`Self::complete`].
    pub fn curvature(&self, slope: f64) -> f64 {
        self.beta * slope
    }

    /// Turns the sum of all states' parts (weight Σ s ∇x and its curvatures) into the term's model: by
    /// Jensen's inequality the matrix stays positive semidefinite.
    pub fn complete(&self, weight: f64, total: &mut Normal) {
        total.cost = weight * self.value;
        if weight <= 0.0 || self.form == SoftForm::Paper {
            return;
        }
        let factor = self.beta / weight;
        for j in 0..total.gradient.len() {
            for i in j..total.gradient.len() {
                total.gauss_newton[(i, j)] -= factor * total.gradient[i] * total.gradient[j];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn soft(samples: &[(f64, f64)]) -> Level {
        Level::of(&|f| samples.iter().for_each(|(x, w)| f(*x, *w)), 4.0, SoftForm::Monotone)
    }

    #[test]
    fn it_lies_between_what_its_weights_allow() {
        let level = soft(&[(4.0, 0.25), (1.0, 0.25), (3.9, 0.25), (0.0, 0.25)]);
        assert!(level.value < 4.0 && level.value > 4.0 - 4.0_f64.ln() / level.beta, "{level:?}");
        assert_eq!(soft(&[]).value, 0.0);
        assert!((soft(&[(2.5, 0.5), (2.5, 0.5)]).value - 2.5).abs() < 1e-15);
    }

    /// The paper's form fails this: there a rising low value lowers the sum.
    #[test]
    fn it_rises_with_every_sample_and_slopes_are_its_derivatives() {
        let samples = [(4.0, 0.2), (3.8, 0.3), (3.0, 0.4), (3.9, 0.1)];
        let level = soft(&samples);
        let slopes: Vec<f64> = samples.iter().map(|(x, w)| level.slope(*x, *w)).collect();
        assert!((slopes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (i, slope) in slopes.iter().enumerate() {
            let at = |h: f64| {
                let mut moved = samples;
                moved[i].0 += h;
                soft(&moved).value
            };
            assert!(at(1e-3) > level.value && *slope > 0.0);
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((difference - slope).abs() < 1e-8, "{i}: {difference} {slope}");
        }
    }

    #[test]
    fn the_papers_form_is_the_weighted_mean_and_slopes_are_its_derivatives() {
        let samples = [(4.0, 1.0), (3.8, 1.0), (3.0, 1.0), (3.9, 1.0)];
        let paper = |samples: &[(f64, f64)]| {
            Level::of(&|f| samples.iter().for_each(|(x, w)| f(*x, *w)), 4.0, SoftForm::Paper)
        };
        let level = paper(&samples);
        let e = |x: f64| (50.0 / 4.0 * x).exp();
        let (sum, moment) = samples.iter().fold((0.0, 0.0), |(s, m), (x, _)| (s + e(*x), m + x * e(*x)));
        assert!((level.value - moment / sum).abs() < 1e-13);
        for i in 0..4 {
            let at = |h: f64| {
                let mut moved = samples;
                moved[i].0 += h;
                paper(&moved).value
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            let slope = level.slope(samples[i].0, 1.0);
            assert!((difference - slope).abs() < 1e-8, "{i}: {difference} {slope}");
        }
        // What is wrong with it: a rising low value lowers it.
        assert!(level.slope(3.8, 1.0) < 0.0);
    }

    #[test]
    fn finer_sampling_changes_nothing_and_nothing_overflows() {
        let level = soft(&[(4.0, 0.5), (3.0, 0.5)]);
        let fine = soft(&[(4.0, 0.25), (4.0, 0.25), (3.0, 0.2), (3.0, 0.3)]);
        assert!((level.value - fine.value).abs() < 1e-14);
        let huge = soft(&[(1e150, 0.5), (0.0, 0.5)]);
        assert!(huge.value.is_finite() && (huge.value / 1e150 - 1.0).abs() < 1e-12);
    }
}
