//! Motion tracking (Megaro et al. 2017, eq. 3): ½ Σ ‖z_t − z̄_t‖², without alignment or phase shift. Beyond the paper: a
//! weight a state, and the closest-point form ½ Σ ‖z_t − c(z_t)‖² with c the place of the target's curve nearest to z_t.
//!
//! By the envelope theorem c may be held for the first derivatives of the closest form: its motion is normal to z − c.
//! For the Gauss–Newton matrix it may not: a step along the curve costs nothing, so the residual's derivatives are
//! taken without their part along it.

use super::{Objective, StateView, StatesSensitivity, trace_rows};
use crate::equilibrium::TraceChange;
use crate::ir::Profile;
use crate::optimize::Normal;
use nalgebra::Vector3;

/// See the module.
pub struct Track {
    name: String,
    trace: usize,
    closest: bool,
    /// Weight over scale², per mm².
    factor: f64,
    emphasis: Emphasis,
}

/// One metre: without a scale, errors count in SI.
const METRE_MM: f64 = 1000.0;

impl Track {
    /// Tracks trace number `trace`; `scale_mm` is the length that counts as one.
    pub fn new(trace_name: &str, trace: usize, scale_mm: Option<f64>, weight: f64) -> Self {
        Self::with(trace_name, trace, scale_mm, weight, false, Emphasis::even())
    }

    /// The same with a form and emphasis of its own.
    pub fn with(
        trace_name: &str,
        trace: usize,
        scale_mm: Option<f64>,
        weight: f64,
        closest: bool,
        emphasis: Emphasis,
    ) -> Self {
        let scale = scale_mm.unwrap_or(METRE_MM);
        let factor = weight / (scale * scale);
        Self { name: format!("track({trace_name})"), trace, closest, factor, emphasis }
    }

    /// Distance from the target, mm, and the direction in which the target follows.
    fn error_mm(&self, view: &StateView) -> (Vector3<f64>, Option<Vector3<f64>>) {
        let trace = &view.model.layout.traces[self.trace];
        let z = view.equilibrium.state.poses[trace.body].point(&trace.rest);
        if self.closest {
            let nearest = trace.nearest(&z);
            (z - nearest.place, nearest.along)
        } else {
            (z - trace.target[view.state], None)
        }
    }

    /// How the place of the target that counts moves with the geometry, mm per unit.
    fn target_rate(&self, view: &StateView, change: &TraceChange) -> Vector3<f64> {
        if !self.closest {
            return change.target[view.state];
        }
        let trace = &view.model.layout.traces[self.trace];
        let nearest = trace.nearest(&view.equilibrium.state.poses[trace.body].point(&trace.rest));
        let [from, to] = [0, 1].map(|k| change.curve.get(nearest.corner + k).copied().unwrap_or_default());
        from + (to - from) * nearest.share
    }

    fn weight(&self, view: &StateView) -> f64 {
        self.factor * view.share * self.emphasis.at(view.state)
    }
}

impl Objective for Track {
    fn name(&self) -> &str {
        &self.name
    }

    fn cost(&self, view: &StateView) -> f64 {
        0.5 * self.weight(view) * self.error_mm(view).0.norm_squared()
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal) {
        let (error, along) = self.error_mm(view);
        let weight = self.weight(view);
        let mut rows = trace_rows(view.model, &view.equilibrium.state, &at.free, self.trace);
        for change in view.model.layout.changes.iter().flatten() {
            let mut column = rows.column_mut(change.parameter);
            column -= self.target_rate(view, &change.traces[self.trace]);
        }
        if let Some(along) = along {
            let slide = along.transpose() * &rows;
            rows -= along * slide;
        }
        for c in 0..3 {
            let row: Vec<f64> = rows.row(c).iter().copied().collect();
            out.add(weight, error[c], &row);
        }
    }
}

/// What each state counts in a term, beside its share of the cycle.
pub struct Emphasis(Option<Vec<f64>>);

impl Emphasis {
    /// Every state counts once.
    pub fn even() -> Self {
        Self(None)
    }

    /// By a function of t, for a cycle of this many steps.
    pub fn new(profile: Option<&Profile>, steps: usize) -> Self {
        let n = steps.max(1);
        Self(profile.map(|p| (0..=n).map(|s| p.value(s as f64 / n as f64)).collect()))
    }

    /// Of a state.
    pub fn at(&self, state: usize) -> f64 {
        self.0.as_ref().map_or(1.0, |e| e.get(state).copied().unwrap_or(1.0))
    }
}
