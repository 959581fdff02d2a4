//! Actuation (Megaro et al. 2017, section 4.3): soft maximum of (τ/τ₀)² over the cycle, τ₀ the motor's stall
//! torque. The paper takes τ from central differences of the energy (eq. 5), which mixes drives; here it is the
//! drive row's own multiplier, τ = dΠ/dα = −λ, exact.

use super::{Level, STEPS_OF_WEIGHTS, Sampled, StateView, StatesSensitivity};
use crate::optimize::Normal;

/// See the module.
pub struct Torque {
    name: String,
    drive: usize,
    reference_n_mm: f64,
    weight: f64,
}

impl Torque {
    /// Torque of drive number `drive`; `reference_n_mm` counts as one.
    pub fn new(drive_name: &str, drive: usize, reference_n_mm: f64, weight: f64) -> Self {
        Self { name: format!("torque({drive_name})"), drive, reference_n_mm, weight }
    }

    /// τ/τ₀.
    fn relative(&self, view: &StateView) -> f64 {
        view.equilibrium.drive_load(view.model, self.drive) / self.reference_n_mm
    }
}

impl Sampled for Torque {
    fn name(&self) -> &str {
        &self.name
    }

    fn weight(&self) -> f64 {
        self.weight
    }

    fn samples(&self, view: &StateView, f: &mut dyn FnMut(f64, f64)) {
        f(self.relative(view).powi(2), view.share / STEPS_OF_WEIGHTS);
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, level: &Level, out: &mut Normal) {
        let torque = self.relative(view);
        let slope = level.slope(torque * torque, view.share / STEPS_OF_WEIGHTS);
        if slope == 0.0 {
            return;
        }
        let by_parameters = relative_row(view, at, self.drive, self.reference_n_mm);
        // x = τ²: ∇x = 2τ∇τ, and 2∇τ∇τᵀ of its own curvature.
        let curvature = 2.0 * slope + level.curvature(slope) * 4.0 * torque * torque;
        out.add_model(self.weight * slope * 2.0 * torque, self.weight * curvature, &by_parameters);
    }
}

/// Derivatives of τ/τ₀ by the design parameters.
pub(super) fn relative_row(
    view: &StateView,
    at: &StatesSensitivity,
    drive: usize,
    reference_n_mm: f64,
) -> Vec<f64> {
    let row = view.model.rows() - view.model.layout.drives.len() + drive;
    at.free.lambda.row(row).iter().map(|l| -l / reference_n_mm).collect()
}
