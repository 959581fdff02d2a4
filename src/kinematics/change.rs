//! How the conventional motion changes with the free variables that move its geometry: the implicit function theorem on
//! the closed mechanism, one back-substitution a variable and pose. The drawing itself closes at all their values.

use super::carried::Twist;
use super::constraint::{Constraint, GeometryChange};
use super::idle;
use super::linear::{Factor, Rows};
use super::mechanism::Mechanism;
use super::motion::Motion;
use super::path::DEAD_POINT;
use super::value::JointValue;
use crate::ir::expr::Evaluated;
use crate::ir::{Design, Drive, DriveOn};
use crate::math::Pose;
use nalgebra::{DMatrix, DVector, Vector3};

/// Derivatives of a [`Motion`] by one free variable, per unit of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionChange {
    /// Index of the free variable.
    pub parameter: usize,
    /// Of the drives' rest values, rad or mm.
    pub rest_drives: Vec<f64>,
    /// Of the joints' points as drawn, mm.
    pub joint_points: Vec<Vector3<f64>>,
    /// Of the two ends of each drive's string as drawn, mm; zero for other drives.
    pub string_points: Vec<[Vector3<f64>; 2]>,
    /// Of the traced points as drawn, mm.
    pub trace_points: Vec<Vector3<f64>>,
    /// Of every body's rest pose: where what it carries moves, in rest world coordinates.
    pub rest: Vec<Twist>,
    /// Per trace and state of its place, mm.
    pub paths: Vec<Vec<Vector3<f64>>>,
    /// Per traced direction and state of it.
    pub directions: Vec<Vec<Vector3<f64>>>,
}

/// Derivatives by every variable of [`Design::geometry_variables`] at `p`, where `motion` was solved. None at a dead
/// point, where the motion has none.
pub fn motion_changes(design: &Design, motion: &Motion, p: &[f64]) -> Option<Vec<MotionChange>> {
    let parameters = design.geometry_variables();
    if parameters.is_empty() {
        return Some(Vec::new());
    }
    let mechanism = Mechanism::new(design, p).ok()?;
    let values = design.exprs.evaluate(p);
    let mut changes: Vec<MotionChange> =
        parameters.iter().map(|i| drawn(design, &values, *i, motion.states.len())).collect();
    let held = vec![0.0; design.drives.len()];
    let at_rest = Follower::new(&mechanism, &motion.rest.poses, &motion.rest.drives)?;
    let spins = Spins::new(&mechanism, &at_rest, &values)?;
    for change in &mut changes {
        let mut step = at_rest.follow(change, &change.rest_drives);
        spins.hold(&mut step, change.parameter);
        change.rest = at_rest.twists(&step);
    }
    for (s, state) in motion.states.iter().enumerate() {
        if design.traces.is_empty() && design.aims.directions.is_empty() {
            break;
        }
        let here = Follower::new(&mechanism, &state.poses, &state.drives)?;
        for change in &mut changes {
            let twists = here.twists(&here.follow(change, &held));
            for (t, (body, _)) in mechanism.traces.iter().enumerate() {
                let carried = state.poses[*body].direction(&change.trace_points[t]);
                change.paths[t][s] = twists[*body].at(&state.traces_mm[t]) + carried;
            }
            for (d, of) in design.aims.directions.iter().enumerate() {
                let here = state.poses[of.body].direction(&Vector3::from(of.direction));
                change.directions[d][s] = twists[of.body].turn.cross(&here);
            }
        }
    }
    Some(changes)
}

/// What is known from the drawing alone.
fn drawn(design: &Design, values: &Evaluated, parameter: usize, states: usize) -> MotionChange {
    let of = |id: crate::ir::expr::ExprId| values.gradient(id).get(parameter).copied().unwrap_or(0.0);
    let point = |p: &crate::ir::ExprPoint| Vector3::from(p.map(of));
    let string = |drive: &Drive| match drive.on {
        DriveOn::String(id) => {
            let cable = &design.strings[id];
            [point(&cable.point), cable.via.first().map(point).unwrap_or_default()]
        }
        DriveOn::Joint(_) => [Vector3::zeros(); 2],
    };
    MotionChange {
        parameter,
        rest_drives: design.drives.iter().map(|d| d.free_rest.map_or(0.0, of)).collect(),
        joint_points: design.joints.iter().map(|j| point(&j.point)).collect(),
        string_points: design.drives.iter().map(string).collect(),
        trace_points: design.traces.iter().map(|t| point(&t.point)).collect(),
        rest: vec![Twist::default(); design.bodies.len()],
        paths: vec![vec![Vector3::zeros(); states]; design.traces.len()],
        directions: vec![vec![Vector3::zeros(); states]; design.aims.directions.len()],
    }
}

/// A closed pose that is followed when the drawing or the drives' values move.
struct Follower<'m, 'd> {
    mechanism: &'m Mechanism<'d>,
    poses: &'m [Pose],
    rows: Rows,
    factor: Factor,
}

impl<'m, 'd> Follower<'m, 'd> {
    fn new(mechanism: &'m Mechanism<'d>, poses: &'m [Pose], drives: &[f64]) -> Option<Self> {
        let rows = Rows::at(mechanism, poses, drives);
        let factor = rows.factor()?;
        (factor.least_pivot >= DEAD_POINT).then_some(Self { mechanism, poses, rows, factor })
    }

    /// Scaled increments when the joints' points as drawn and the drives' values move.
    fn follow(&self, of: &MotionChange, drives: &[f64]) -> DVector<f64> {
        let joint_points = &of.joint_points;
        let m = self.mechanism;
        let mut by = Vec::with_capacity(self.rows.residual.len());
        let both = |point: Vector3<f64>| GeometryChange {
            point_a: point,
            point_b: point,
            ..GeometryChange::default()
        };
        for (constraint, joint) in &m.constraints {
            let unit = if constraint.is_length() { m.length } else { 1.0 };
            let lambda = [0.0; Constraint::MAX_ROWS];
            let (rows, _) = constraint.design_derivative(self.poses, &lambda, &both(joint_points[*joint]));
            by.extend(rows.iter().take(constraint.rows()).map(|r| r / unit));
        }
        for (i, ((value, drive), change)) in m.drives.iter().zip(&m.design.drives).zip(drives).enumerate() {
            let moved = match value {
                JointValue::Angle(_) => 0.0,
                JointValue::Pull(pull) => pull.point_derivative(self.poses, of.string_points[i]).0,
                JointValue::Shift(shift) => {
                    let dp = drive.joint().map(|j| joint_points[j]).unwrap_or_default();
                    let (dp, axis) = (dp, self.poses[shift.a].direction(&shift.axis));
                    let [a, b] = [shift.a, shift.b].map(|i| self.poses[i].direction(&dp));
                    axis.dot(&(b - a))
                }
            };
            by.push((moved - change) / m.drive_scale(value));
        }
        self.rows.follow(&self.factor, &by)
    }

    /// Motions of all bodies in world coordinates.
    fn twists(&self, step: &DVector<f64>) -> Vec<Twist> {
        let at = |j: usize| Vector3::new(step[j], step[j + 1], step[j + 2]);
        let bodies = self.poses.iter().zip(&self.mechanism.column);
        let twist = |(pose, column): (&Pose, &Option<usize>)| match column {
            Some(j) => {
                let center = pose.center + pose.translation;
                Twist::about(&center, at(*j) * self.mechanism.length, at(j + 3))
            }
            None => Twist::default(),
        };
        let mut twists: Vec<Twist> = bodies.map(twist).collect();
        for (id, body) in self.mechanism.design.bodies.iter().enumerate() {
            // A flexure's own body goes with the first of its joint.
            let joint = body.owner.and_then(|j| self.mechanism.design.joints.get(j));
            if let Some(carrier) = joint.and_then(|j| j.bodies.first()) {
                twists[id] = twists[*carrier];
            }
        }
        twists
    }
}

/// Keeps idle bodies unturned (see [`idle::unturn`]) when the rest pose moves.
struct Spins {
    /// Per idle freedom its motion, scaled.
    motions: Vec<DVector<f64>>,
    /// Per idle freedom: first unknown of its body, slope of its turn by that body's dφ, and the turn by each
    /// free variable at fixed poses.
    turns: Vec<(usize, Vector3<f64>, Vec<f64>)>,
    /// Inverse of the turns by the motions.
    inverse: DMatrix<f64>,
}

impl Spins {
    fn new(mechanism: &Mechanism, at: &Follower, values: &Evaluated) -> Option<Self> {
        let count = mechanism.idle.len();
        let motions: Vec<DVector<f64>> = (0..count).map(|k| at.rows.idle_motion(&at.factor, k)).collect();
        let mut turns = Vec::with_capacity(count);
        for idle in &mechanism.idle {
            let first = mechanism.column.get(idle.body).copied().flatten()?;
            let rotation = &at.poses[idle.body].rotation;
            let by_axis = idle::turn_direction(rotation);
            let axis = idle::line_derivative(mechanism, idle.body, values)?;
            let by_parameters = axis.iter().map(|d| by_axis.dot(d)).collect();
            turns.push((first + 3, idle::turn_slope(rotation, &idle.axis), by_parameters));
        }
        let part = |step: &DVector<f64>, first: usize, slope: &Vector3<f64>| -> f64 {
            (0..3).map(|c| step[first + c] * slope[c]).sum()
        };
        let by_motions = DMatrix::from_fn(count, count, |i, j| part(&motions[j], turns[i].0, &turns[i].1));
        let inverse = if count == 0 { by_motions } else { by_motions.try_inverse()? };
        Some(Self { motions, turns, inverse })
    }

    fn hold(&self, step: &mut DVector<f64>, parameter: usize) {
        let turned = self.turns.iter().map(|(first, slope, by)| {
            (0..3).map(|c| step[first + c] * slope[c]).sum::<f64>()
                + by.get(parameter).copied().unwrap_or(0.0)
        });
        let back = &self.inverse * DVector::from_iterator(self.turns.len(), turned);
        for (motion, amount) in self.motions.iter().zip(back.iter()) {
            step.axpy(-amount, motion, 1.0);
        }
    }
}
