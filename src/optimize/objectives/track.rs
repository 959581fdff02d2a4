//! Motion tracking (Megaro et al. 2017, eq. 3): ½ Σ ‖z_t − z̄_t‖², without alignment or phase shift.

use super::{Objective, StateView, StatesSensitivity, trace_rows};
use crate::optimize::Normal;
use nalgebra::Vector3;

/// See the module.
pub struct Track {
    name: String,
    trace: usize,
    /// Weight over scale², per mm².
    factor: f64,
}

/// One metre: without a scale, errors count in SI.
const METRE_MM: f64 = 1000.0;

impl Track {
    /// Tracks trace number `trace`; `scale_mm` is the length that counts as one.
    pub fn new(trace_name: &str, trace: usize, scale_mm: Option<f64>, weight: f64) -> Self {
        let scale = scale_mm.unwrap_or(METRE_MM);
        Self { name: format!("track({trace_name})"), trace, factor: weight / (scale * scale) }
    }

    fn error_mm(&self, view: &StateView) -> Vector3<f64> {
        let trace = &view.model.layout.traces[self.trace];
        view.equilibrium.state.poses[trace.body].point(&trace.rest) - trace.target[view.state]
    }
}

impl Objective for Track {
    fn name(&self) -> &str {
        &self.name
    }

    fn cost(&self, view: &StateView) -> f64 {
        0.5 * self.factor * view.share * self.error_mm(view).norm_squared()
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal) {
        let error = self.error_mm(view);
        let weight = self.factor * view.share;
        let mut rows = trace_rows(view.model, view.equilibrium, &at.free, self.trace);
        for change in view.model.layout.changes.iter().flatten() {
            let mut column = rows.column_mut(change.parameter);
            column -= change.traces[self.trace].target[view.state];
        }
        for c in 0..3 {
            let row: Vec<f64> = rows.row(c).iter().copied().collect();
            out.add(weight, error[c], &row);
        }
    }
}
