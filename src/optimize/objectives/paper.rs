//! The paper's own soft maximum, P = Σ x e^{βx}/Σ e^{βx} (Megaro et al. 2017, eqs. 6 and 16), kept for comparison with it:
//! of τ², N²m², and of von Mises stress, over all states and sampled points with equal weights, β = 50/x_ref, x_ref the
//! largest x at the first point of a run. It falls when a low value rises, and reads low; see `soft_maximum.rs` for ours.
//!
//! τ is the exact torque, not eq. 5's central difference of energies: that tends to it with finer steps, and where
//! there are several drives it adds up their work.

use super::soft_maximum::SoftForm;
use super::stress::{self, PASCAL_MPA};
use super::{Level, Sampled, StateView, StatesSensitivity, torque};
use crate::optimize::Normal;

/// Soft maximum of the squared torque.
pub struct PaperTorque {
    name: String,
    drive: usize,
    reference_n_mm: f64,
    weight: f64,
}

impl PaperTorque {
    /// Torque of drive number `drive`; `reference_n_mm` counts as one.
    pub fn new(drive_name: &str, drive: usize, reference_n_mm: f64, weight: f64) -> Self {
        Self { name: format!("torque({drive_name})"), drive, reference_n_mm, weight }
    }
}

impl Sampled for PaperTorque {
    fn name(&self) -> &str {
        &self.name
    }

    fn weight(&self) -> f64 {
        self.weight
    }

    fn form(&self) -> SoftForm {
        SoftForm::Paper
    }

    fn samples(&self, view: &StateView, f: &mut dyn FnMut(f64, f64)) {
        f((view.equilibrium.drive_load(view.model, self.drive) / self.reference_n_mm).powi(2), 1.0);
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, level: &Level, out: &mut Normal) {
        let torque = view.equilibrium.drive_load(view.model, self.drive) / self.reference_n_mm;
        let slope = level.slope(torque * torque, 1.0);
        let curvature = level.curvature_at(torque * torque, 1.0);
        if slope == 0.0 && curvature == 0.0 {
            return;
        }
        let row = torque::relative_row(view, at, self.drive, self.reference_n_mm);
        // x = τ²: ∇x = 2τ∇τ, and 2∇τ∇τᵀ of its own curvature where the slope is positive.
        let bend = 2.0 * slope.max(0.0) + curvature * 4.0 * torque * torque;
        out.add_model(self.weight * slope * 2.0 * torque, self.weight * bend, &row);
    }
}

/// Soft maximum of von Mises stress.
pub struct PaperStress {
    /// Weight over scale, per MPa.
    factor: f64,
}

impl PaperStress {
    /// `scale_mpa` is the stress that counts as one.
    pub fn new(scale_mpa: Option<f64>, weight: f64) -> Self {
        Self { factor: weight / scale_mpa.unwrap_or(PASCAL_MPA) }
    }
}

impl Sampled for PaperStress {
    fn name(&self) -> &str {
        "stress"
    }

    fn weight(&self) -> f64 {
        self.factor
    }

    fn form(&self) -> SoftForm {
        SoftForm::Paper
    }

    fn samples(&self, view: &StateView, f: &mut dyn FnMut(f64, f64)) {
        stress::for_each_sample(view, |_, _, _, x, _| f(x, 1.0));
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, level: &Level, out: &mut Normal) {
        let mut own = stress::OwnDirections::new(view, at);
        stress::for_each_sample(view, |rod, station, point, x, _| {
            let slope = level.slope(x, 1.0);
            let curvature = level.curvature_at(x, 1.0);
            if slope != 0.0 || curvature != 0.0 {
                own.with_row(rod, station, point, |normal, row| {
                    normal.add_model(self.factor * slope, self.factor * curvature, row);
                });
            }
        });
        own.chain(out);
    }
}
