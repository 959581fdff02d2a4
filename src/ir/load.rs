//! Loads on the mechanism from outside: dead forces, moments about an axis, the weight of its parts; and load cases.

use super::{BodyId, Design, ExprPoint, Objective, Origin, Profile, Quantity, Requirement};
use serde::{Deserialize, Serialize};

/// Sizes at t = 0 and t = 1 that agree to this part of the larger make the same pose.
const SAME_SIZE: f64 = 1e-9;

/// A load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Load {
    /// What acts, and on what.
    pub kind: LoadKind,
    /// Declaration.
    pub origin: Origin,
}

/// What acts, and on what. Directions are unit vectors of the world and do not turn with the bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoadKind {
    /// A force that keeps its direction.
    Force {
        /// The body.
        body: BodyId,
        /// Where it acts, in the drawing pose.
        point: ExprPoint,
        /// Its direction.
        direction: [f64; 3],
        /// Its size over the cycle, N.
        size: Profile,
    },
    /// A moment that does the work size × (turn of the body about the axis).
    Moment {
        /// The body.
        body: BodyId,
        /// Its axis.
        axis: [f64; 3],
        /// Its size over the cycle, N·mm.
        size: Profile,
    },
    /// The weight of links and flexures.
    Gravity {
        /// Where down is.
        direction: [f64; 3],
    },
}

impl Load {
    /// Size at t in 0..1: N, N·mm, or 1 for gravity.
    pub fn size(&self, t: f64) -> f64 {
        match &self.kind {
            LoadKind::Force { size, .. } | LoadKind::Moment { size, .. } => size.value(t),
            LoadKind::Gravity { .. } => 1.0,
        }
    }

    fn is_closed(&self) -> bool {
        let (first, last) = (self.size(0.0), self.size(1.0));
        (first - last).abs() <= SAME_SIZE * first.abs().max(last.abs())
    }
}

/// A load case: the same mechanism goes through the same cycle once more, with further loads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoadCase {
    /// Name.
    pub name: String,
    /// Loads besides the design's own.
    pub loads: Vec<Load>,
    /// Terms of the objective that are about this case.
    pub objectives: Vec<Objective>,
    /// Acceptance tests of this case.
    pub requirements: Vec<Requirement>,
    /// Declaration.
    pub origin: Origin,
}

impl Design {
    /// The design under a load case: the same mechanism with the case's loads besides its own, asked only what the case
    /// asks. All that can be done with a design can be done with it.
    pub fn under(&self, case: &LoadCase) -> Self {
        let loads = self.loads.iter().chain(&case.loads).cloned().collect();
        let (objectives, requirements) = (case.objectives.clone(), case.requirements.clone());
        Self { loads, objectives, requirements, cases: Vec::new(), ..self.clone() }
    }

    /// Whether anything asks how far the loads are from buckling it.
    pub fn asks_for_buckling(&self) -> bool {
        self.requirements.iter().any(|r| r.quantity == Quantity::Buckling)
    }

    /// Its own loads and those of its cases.
    pub fn all_loads(&self) -> impl Iterator<Item = &Load> {
        self.loads.iter().chain(self.cases.iter().flat_map(|c| &c.loads))
    }

    /// Its own terms of the objective and those of its cases.
    pub fn all_objectives(&self) -> impl Iterator<Item = &Objective> {
        self.objectives.iter().chain(self.cases.iter().flat_map(|c| &c.objectives))
    }

    /// Its own acceptance tests and those of its cases.
    pub fn all_requirements(&self) -> impl Iterator<Item = &Requirement> {
        self.requirements.iter().chain(self.cases.iter().flat_map(|c| &c.requirements))
    }

    /// Whether drives and loads are at t = 1 where they were at t = 0: the last state is then the first once more.
    pub fn is_closed(&self) -> bool {
        self.drives.iter().all(|d| d.is_closed()) && self.loads.iter().all(Load::is_closed)
    }

    /// Whether the conventional mechanism has a path of its own: without a drive it stands as drawn, and what moves the
    /// compliant one are its loads.
    pub fn is_driven(&self) -> bool {
        !self.drives.is_empty()
    }
}
