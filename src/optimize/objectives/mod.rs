//! The terms of the objective, one a file. A new term is a file here and a line in [`build`].

mod stress;
mod track;

use crate::equilibrium::{Equilibrium, Model, Sensitivity};
use crate::ir::{Design, ObjectiveKind};
use crate::optimize::Normal;

/// Sums over the cycle are means times this, so that the number of steps does not change the balance
/// of the terms; the paper's weights belong to 60 steps.
pub const STEPS_OF_WEIGHTS: f64 = 60.0;

/// One state of the cycle as a term sees it.
pub struct StateView<'a> {
    /// The model at the present parameters.
    pub model: &'a Model<'a>,
    /// The equilibrium.
    pub equilibrium: &'a Equilibrium,
    /// Index of the state.
    pub state: usize,
    /// Weight of this state in sums over the cycle: 60 / number of counted states.
    pub share: f64,
}

/// A term of the objective, a sum over states.
pub trait Objective: Send + Sync {
    /// As shown to the user, e.g. `track(tip)`.
    fn name(&self) -> &str;
    /// Contribution of one state.
    fn cost(&self, view: &StateView) -> f64;
    /// Contribution of one state with its exact derivatives.
    fn accumulate(&self, view: &StateView, sensitivity: &Sensitivity, out: &mut Normal);
}

/// The design's terms.
pub fn build(design: &Design) -> Vec<Box<dyn Objective>> {
    design
        .objectives
        .iter()
        .map(|o| -> Box<dyn Objective> {
            match &o.kind {
                ObjectiveKind::Track { trace, scale_mm } => {
                    Box::new(track::Track::new(&design.traces[*trace].name, *trace, *scale_mm, o.weight))
                }
                ObjectiveKind::StressBelow { bound_mpa, scale_mpa } => {
                    Box::new(stress::StressBelow::new(*bound_mpa, *scale_mpa, o.weight))
                }
            }
        })
        .collect()
}
