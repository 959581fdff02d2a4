//! One-sided bound on von Mises stress (Megaro et al. 2017, section 4.5, eqs. 8–15, without the soft
//! maximum of eq. 16): ½ Σ_t Σ_rods ∫ max(0, σ_v − bound)² over length and section boundary, each rod's
//! weights of sum one. Smooth where the paper's maximum is not, and zero for every sound design.

use super::{Objective, StateView};
use crate::equilibrium::Sensitivity;
use crate::optimize::Normal;
use crate::rod::{PARAMETERS, SECTION_POINTS};

/// See the module.
pub struct StressBelow {
    name: String,
    bound_mpa: f64,
    /// Weight over scale², per MPa².
    factor: f64,
}

/// One pascal: without a scale, stress counts in SI.
const PASCAL_MPA: f64 = 1e-6;

impl StressBelow {
    /// `scale_mpa` is the excess that counts as one.
    pub fn new(bound_mpa: f64, scale_mpa: Option<f64>, weight: f64) -> Self {
        let scale = scale_mpa.unwrap_or(PASCAL_MPA);
        Self { name: "stress".to_string(), bound_mpa, factor: weight / (scale * scale) }
    }

    /// Calls `f(rod, station, point, weight, excess)` for every sample above the bound.
    fn for_each_excess(&self, view: &StateView, mut f: impl FnMut(usize, usize, usize, f64, f64)) {
        for (index, (rod, strains)) in view.model.rods.iter().zip(&view.equilibrium.strains).enumerate() {
            let weights = rod.rod.station_weights();
            for (station, stresses) in rod.rod.stresses(strains).iter().enumerate() {
                for (point, stress) in stresses.iter().enumerate() {
                    let excess = stress - self.bound_mpa;
                    if excess > 0.0 {
                        let weight = self.factor * view.share * weights[station] / SECTION_POINTS as f64;
                        f(index, station, point, weight, excess);
                    }
                }
            }
        }
    }
}

impl Objective for StressBelow {
    fn name(&self) -> &str {
        &self.name
    }

    fn cost(&self, view: &StateView) -> f64 {
        let mut cost = 0.0;
        self.for_each_excess(view, |_, _, _, weight, excess| cost += 0.5 * weight * excess * excess);
        cost
    }

    fn accumulate(&self, view: &StateView, sensitivity: &Sensitivity, out: &mut Normal) {
        // Summed in each rod's own directions first, then chained to the design parameters once.
        let mut own: Vec<Option<Normal>> = vec![None; view.model.rods.len()];
        self.for_each_excess(view, |rod, station, point, weight, excess| {
            let jacobian = &sensitivity.strains[rod];
            if let Some((_, d)) = jacobian.stress(&view.model.rods[rod].rod, station, point) {
                let mut row = [0.0; 12 + PARAMETERS];
                row[..12].copy_from_slice(d.link.as_slice());
                row[12..].copy_from_slice(d.parameters.as_slice());
                own[rod].get_or_insert_with(|| Normal::new(row.len())).add(weight, excess, &row);
            }
        });
        for (normal, chain) in own.iter_mut().zip(&sensitivity.directions) {
            if let Some(normal) = normal {
                normal.complete();
                out.add_chained(normal, chain);
            }
        }
    }
}
