//! What the motion is compared with or asked for beside traced points: directions, targets, angles of bodies.

use super::expr::{ExprGraph, ExprId};
use super::{BodyId, Design, ObjectiveKind, Origin, Quantity};
use serde::{Deserialize, Serialize};

/// Directions, targets and angles of a design.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Aims {
    /// Traced directions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub directions: Vec<Direction>,
    /// Targets that replace the conventional mechanism's own path, at most one a trace.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<Target>,
    /// Angles that are asked for, by an `output` or in a requirement.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub angles: Vec<BodyAngle>,
    /// Where outputs are to be aimed at by motors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub workspaces: Vec<super::Workspace>,
}

impl Aims {
    /// Whether there is nothing of all this.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The target of a trace or direction, if it has one of its own.
    pub fn target_of(&self, of: TargetOf) -> Option<&Target> {
        self.targets.iter().find(|t| t.of == of)
    }
}

impl Design {
    /// Whether a trace has something to be compared with: without a drive the conventional mechanism stands still.
    pub fn has_target(&self, trace: usize) -> bool {
        self.is_driven() || self.aims.target_of(TargetOf::Trace(trace)).is_some()
    }

    /// Whether a trace is only tracked by form: then its error is the distance from the nearest place of its target.
    pub fn has_no_phase(&self, trace: usize) -> bool {
        let by_form = |kind: &ObjectiveKind| match kind {
            ObjectiveKind::Track { trace: t, .. } if *t == trace => Some(false),
            ObjectiveKind::TrackAs { trace: t, closest, .. } if *t == trace => Some(*closest),
            _ => None,
        };
        let mut found = self.objectives.iter().filter_map(|o| by_form(&o.kind)).peekable();
        found.peek().is_some() && found.all(|closest| closest)
    }

    /// Whether anything asks for a trace's distance from the nearest place of its target.
    pub fn asks_for_nearest(&self, trace: usize) -> bool {
        let asked = Quantity::ErrorClosest(trace);
        self.has_no_phase(trace) || self.requirements.iter().any(|r| r.quantity == asked)
    }
}

/// A traced direction: `trace NAME = direction D on BODY`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Name.
    pub name: String,
    /// Body that carries it.
    pub body: BodyId,
    /// Unit direction in the drawing pose.
    pub direction: [f64; 3],
    /// Declaration.
    pub origin: Origin,
}

/// Whose target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetOf {
    /// Index into [`Design::traces`](super::Design::traces).
    Trace(usize),
    /// Index into [`Aims::directions`].
    Direction(usize),
}

/// `target TRACE = …`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Whose.
    pub of: TargetOf,
    /// Where it is at which time.
    pub path: TargetPath,
    /// Declaration.
    pub origin: Origin,
}

/// A path over the cycle: of a point, mm, or of a unit direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetPath {
    /// Straight from place to place.
    Places {
        /// t of each place, increasing from 0 to 1.
        times: Vec<f64>,
        /// The places.
        places: Vec<[f64; 3]>,
    },
    /// A function of t.
    Expression {
        /// Graph whose only variable, `Free(0)`, is t.
        graph: ExprGraph,
        /// The components.
        value: [ExprId; 3],
    },
}

impl TargetPath {
    /// Place at t in 0..1; NaN where an expression or the data have none.
    pub fn at(&self, t: f64) -> [f64; 3] {
        match self {
            Self::Expression { graph, value } => {
                let values = graph.values(&[t]);
                value.map(|id| values.get(id.0 as usize).copied().unwrap_or(f64::NAN))
            }
            Self::Places { times, places } => {
                let after = times.partition_point(|x| *x < t).min(times.len().saturating_sub(1));
                let before = after.saturating_sub(1);
                let (Some(a), Some(b), Some(t0), Some(t1)) =
                    (places.get(before), places.get(after), times.get(before), times.get(after))
                else {
                    return [f64::NAN; 3];
                };
                let share = if t1 > t0 { ((t - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { 1.0 };
                [0, 1, 2].map(|i| if share < 1.0 { a[i] + share * (b[i] - a[i]) } else { b[i] })
            }
        }
    }
}

/// How far a body has turned about an axis fixed in space: `angle(BODY about D)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BodyAngle {
    /// Name of its `output`; none where only a requirement asks for it.
    pub name: Option<String>,
    /// The body.
    pub body: BodyId,
    /// Unit axis.
    pub axis: [f64; 3],
    /// Where it is asked for.
    pub origin: Origin,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_met_at_their_times_and_straight_between() {
        let path = TargetPath::Places {
            times: vec![0.0, 0.25, 1.0],
            places: vec![[0.0; 3], [1.0, 2.0, 0.0], [4.0, 2.0, 3.0]],
        };
        assert_eq!(path.at(0.0), [0.0; 3]);
        assert_eq!(path.at(0.125), [0.5, 1.0, 0.0]);
        assert_eq!(path.at(0.25), [1.0, 2.0, 0.0]);
        assert_eq!(path.at(0.5), [2.0, 2.0, 1.0]);
        assert_eq!(path.at(1.0), [4.0, 2.0, 3.0]);
    }
}
