//! What traces and traced directions are compared with: the conventional mechanism's own path, or a target of the text.

use crate::ir::{BodyId, Design, TargetOf, TargetPath};
use crate::kinematics::Motion;
use crate::math::polyline::{Nearest, nearest, refined};
use nalgebra::Vector3;

/// Chords a step that a curve is cut into. On Chebyshev's path of 60 steps a chord lies below 2e-3 mm off.
const PIECES: usize = 8;

/// A traced point.
#[derive(Clone, Debug)]
pub struct LayoutTrace {
    /// Body that carries it.
    pub body: BodyId,
    /// Position in the rest pose, mm.
    pub rest: Vector3<f64>,
    /// Target per state 0..=N, mm.
    pub target: Vec<Vector3<f64>>,
    /// The target as a curve without times: its corners, mm.
    pub curve: Vec<Vector3<f64>>,
    /// The conventional mechanism's own path per state 0..=N, mm.
    pub path: Vec<Vector3<f64>>,
    /// It is tracked by form only.
    pub has_no_phase: bool,
    /// The target is one: not a place where the conventional mechanism stands still.
    pub has_target: bool,
}

impl LayoutTrace {
    /// A traced point with the design's target for it.
    pub fn new(design: &Design, motion: &Motion, trace: usize, rest: Vector3<f64>, closed: bool) -> Self {
        let path = motion.trace_path(trace);
        let own = design.aims.target_of(TargetOf::Trace(trace)).map(|t| &t.path);
        let (target, curve) = match own {
            None => (path.clone(), as_curve(&path, closed)),
            Some(own) => {
                let curve = match own {
                    TargetPath::Places { places, .. } => places.iter().map(|p| Vector3::from(*p)).collect(),
                    TargetPath::Expression { .. } => sampled(own, PIECES * design.cycle.steps),
                };
                (sampled(own, design.cycle.steps), curve)
            }
        };
        let has_no_phase = design.has_no_phase(trace);
        let (body, has_target) = (design.traces[trace].body, design.has_target(trace));
        Self { body, rest, target, curve, path, has_no_phase, has_target }
    }

    /// Place of the target nearest to a point, whenever it is there.
    pub fn nearest(&self, point: &Vector3<f64>) -> Nearest {
        nearest(&self.curve, point)
    }
}

/// A traced direction.
#[derive(Clone, Debug)]
pub struct LayoutDirection {
    /// Body that carries it.
    pub body: BodyId,
    /// Unit direction in the rest pose.
    pub rest: Vector3<f64>,
    /// Unit target per state 0..=N.
    pub target: Vec<Vector3<f64>>,
}

impl LayoutDirection {
    /// All of the design's.
    pub fn all(design: &Design, motion: &Motion) -> Vec<Self> {
        let one = |(i, d): (usize, &crate::ir::Direction)| {
            let drawn = Vector3::from(d.direction);
            let target = match design.aims.target_of(TargetOf::Direction(i)) {
                None => motion.states.iter().map(|s| s.poses[d.body].direction(&drawn)).collect(),
                Some(own) => sampled(&own.path, design.cycle.steps).iter().map(Vector3::normalize).collect(),
            };
            Self { body: d.body, rest: motion.rest_direction(d.body, &drawn), target }
        };
        design.aims.directions.iter().enumerate().map(one).collect()
    }
}

/// A path of the conventional mechanism as a curve (linear in its places).
pub(super) fn as_curve(path: &[Vector3<f64>], closed: bool) -> Vec<Vector3<f64>> {
    refined(path, closed, PIECES)
}

fn sampled(path: &TargetPath, pieces: usize) -> Vec<Vector3<f64>> {
    let n = pieces.max(1);
    (0..=n).map(|i| Vector3::from(path.at(i as f64 / n as f64))).collect()
}

/// Angle between two unit vectors, rad, exact also where it is small.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
