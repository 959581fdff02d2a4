//! The paper's optimiser, as the baseline: argmin's L-BFGS (Nocedal, Math. Comp. 35 (1980) 773).
//! It knows no bounds, so it works on z with x = (1 + sin z)/2, which cannot leave the box.

use super::problem::Trial;
use super::shared::Shared;
use argmin::core::{CostFunction, Error, Gradient};
use std::f64::consts::FRAC_PI_2;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Cost given to points that cannot be simulated: finite, because argmin's line searches do not
/// survive infinities, and far above any start.
const UNREACHABLE: f64 = 1e30;
/// Variables at a bound start this far inside, in widths: at the bound itself dx/dz = 0.
const INSIDE: f64 = 1e-3;
/// Simulations at most: argmin's line search has no limit of its own.
const SIMULATIONS: usize = 2000;

/// The problem as argmin's L-BFGS sees it.
pub struct Unbounded<'a, 'd> {
    shared: &'a Shared<'d>,
    last: Mutex<Option<(Vec<f64>, Trial<'d>)>>,
    gradients: AtomicUsize,
}

impl<'a, 'd> Unbounded<'a, 'd> {
    /// Wraps the shared problem.
    pub fn new(shared: &'a Shared<'d>) -> Self {
        Self { shared, last: Mutex::new(None), gradients: AtomicUsize::new(0) }
    }

    /// z of a point of the unit box.
    pub fn to_z(x: &[f64]) -> Vec<f64> {
        x.iter().map(|x| (2.0 * x.clamp(INSIDE, 1.0 - INSIDE) - 1.0).asin()).collect()
    }

    /// Point of the unit box of z.
    pub fn to_x(z: &[f64]) -> Vec<f64> {
        z.iter().map(|z| 0.5 * (1.0 + z.sin())).collect()
    }

    fn evaluate<T>(&self, z: &[f64], f: impl FnOnce(Option<&Trial<'d>>) -> T) -> Result<T, Error> {
        if self.shared.cancelled() || self.shared.problem.simulations() > SIMULATIONS {
            return Err(Error::msg("stopped"));
        }
        let mut last = self.last.lock().map_err(|_| Error::msg("a thread failed"))?;
        if last.as_ref().is_none_or(|(at, _)| at != z) {
            *last = self.shared.problem.simulate(&Self::to_x(z)).map(|t| (z.to_vec(), t));
        }
        Ok(f(last.as_ref().map(|(_, t)| t)))
    }
}

impl CostFunction for Unbounded<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, z: &Vec<f64>) -> Result<f64, Error> {
        self.evaluate(z, |t| {
            if let Some(t) = t {
                self.shared.keep(t);
            }
            t.map_or(UNREACHABLE, |t| t.cost)
        })
    }
}

impl Gradient for Unbounded<'_, '_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, z: &Vec<f64>) -> Result<Vec<f64>, Error> {
        let at = self.evaluate(z, |t| t.and_then(|t| self.shared.problem.differentiate(t)))?;
        // The line search hides its iterations; its gradients are what progress can be told by.
        self.shared.announce(self.gradients.fetch_add(1, Ordering::Relaxed));
        Ok(match at {
            Some(at) => z.iter().zip(at.gradient().iter()).map(|(z, g)| 0.5 * z.cos() * g).collect(),
            None => z.iter().map(|z| z / FRAC_PI_2).collect(),
        })
    }
}
