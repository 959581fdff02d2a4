//! The parts of the compliant model that do not depend on the design parameters: rest poses, end
//! frames of the rods, constraints, drives, traces and their targets, all in rest world coordinates.

use super::design_load::LayoutLoad;
use crate::ir::{BodyId, Design, DriveOn};
use crate::kinematics::{Constraint, JointValue, Motion, Pull};
use crate::math::Pose;
use crate::rod::RodModel;
use nalgebra::{Matrix3, Vector3};

/// Orthonormal frame of a rod end in rest world coordinates: columns e1, e2, e3.
#[derive(Clone, Debug)]
pub struct RodEndFrame {
    /// Body the end is clamped in.
    pub body: BodyId,
    /// The joint's physical point in the rest pose, mm.
    pub origin: Vector3<f64>,
    /// Columns e1, e2, e3.
    pub axes: Matrix3<f64>,
}

/// A rigid body of the compliant model.
#[derive(Clone, Debug)]
pub struct LayoutBody {
    /// Centre of its increments: centroid of its joint points at rest, mm.
    pub center: Vector3<f64>,
    /// First of its six unknowns, none for ground.
    pub first_dof: Option<usize>,
}

/// A drive row of the compliant model.
#[derive(Clone, Debug)]
pub struct LayoutDrive {
    /// Relative angle, way or shortening, zero in the rest pose.
    pub joint: JointValue,
    /// Drive value of the rest pose, rad or mm.
    pub rest: f64,
    /// Drive value per state 0..=N, rad or mm.
    pub values: Vec<f64>,
}

/// A traced point.
#[derive(Clone, Debug)]
pub struct LayoutTrace {
    /// Body that carries it.
    pub body: BodyId,
    /// Position in the rest pose, mm.
    pub rest: Vector3<f64>,
    /// Target per state 0..=N: the conventional mechanism's own path, mm.
    pub target: Vec<Vector3<f64>>,
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Bodies, as in the design.
    pub bodies: Vec<LayoutBody>,
    /// Frames of both ends of each rod.
    pub rod_ends: Vec<[RodEndFrame; 2]>,
    /// Constraints of the conventional joints, and gauges of what they leave idle.
    pub constraints: Vec<Constraint>,
    /// Drives.
    pub drives: Vec<LayoutDrive>,
    /// Loads of the design.
    pub loads: Vec<LayoutLoad>,
    /// Traces.
    pub traces: Vec<LayoutTrace>,
    /// Whether states 0 and N are the same pose.
    pub closed: bool,
    /// Rest pose of each body relative to the drawing pose.
    pub rest_poses: Vec<Pose>,
    /// A typical length: lever of rotations in scaled systems, mm.
    pub length_mm: f64,
    /// Rod theory; the plain one unless set otherwise.
    pub rod_model: RodModel,
}

impl Layout {
    /// Moves the design's drawn geometry to the rest pose. `motion` is the conventional motion of
    /// the same design, `p` the free variables (geometry outside templates does not depend on them).
    pub fn new(design: &Design, motion: &Motion, p: &[f64]) -> Self {
        let values = design.exprs.evaluate(p);
        let rest = &motion.rest.poses;
        let joint_points = &motion.joint_points;
        let at_rest = |body: BodyId, drawn: &Vector3<f64>| rest[body].point(drawn);

        let mut bodies = Vec::with_capacity(design.bodies.len());
        let mut next = 0;
        for (i, body) in design.bodies.iter().enumerate() {
            let points: Vec<Vector3<f64>> = design
                .joints
                .iter()
                .zip(joint_points)
                .filter(|(j, _)| j.bodies.contains(&i))
                .map(|(_, p)| at_rest(i, p))
                .collect();
            let center = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
            let first_dof = (!body.ground).then(|| {
                next += 6;
                next - 6
            });
            bodies.push(LayoutBody { center, first_dof });
        }

        let mut constraints = Vec::new();
        for (joint, drawn) in design.joints.iter().zip(joint_points) {
            if joint.is_compliant() {
                continue;
            }
            for [a, b] in joint.pairs() {
                let axis = rest[a].direction(&Vector3::from(joint.axis));
                let second = joint.second_axis.map(|s| rest[b].direction(&Vector3::from(s)));
                let point = at_rest(a, drawn);
                constraints.extend(Constraint::of_joint(joint.kind, [a, b], point, &axis, second.as_ref()));
            }
        }
        for idle in motion.mobility.idle.iter().filter(|i| i.is_conventional(design)) {
            constraints.push(idle.gauge(rest[idle.body].direction(&idle.axis)));
        }

        let drives = design
            .drives
            .iter()
            .filter_map(|d| {
                let value = match d.on {
                    DriveOn::Joint(id) => {
                        let joint = &design.joints[id];
                        let pair = joint.pairs().next()?;
                        let axis = rest[pair[0]].direction(&Vector3::from(joint.axis));
                        let point = at_rest(pair[0], &joint_points[id]);
                        JointValue::new(joint.kind, pair, point, &axis)?
                    }
                    DriveOn::String(id) => {
                        let c = &design.strings[id];
                        let point_a = at_rest(c.from, &values.point(c.point));
                        let point_b = at_rest(c.to, &values.point(*c.via.first()?));
                        JointValue::Pull(Pull { a: c.from, b: c.to, point_a, point_b })
                    }
                };
                let steps = design.cycle.steps;
                Some(LayoutDrive {
                    joint: value,
                    rest: d.rest,
                    values: (0..=steps).map(|s| d.value(s as f64 / steps as f64)).collect(),
                })
            })
            .collect();

        let traces = design
            .traces
            .iter()
            .enumerate()
            .map(|(i, t)| LayoutTrace {
                body: t.body,
                rest: at_rest(t.body, &values.point(t.point)),
                target: motion.states.iter().map(|s| s.traces_mm[i]).collect(),
            })
            .collect();

        let rod_ends = design
            .rods
            .iter()
            .map(|rod| {
                let joint = &design.joints[rod.joint];
                let drawn = joint_points[rod.joint];
                [rod.from.body, rod.to.body].map(|body| {
                    let origin = at_rest(body, &drawn);
                    let e3 = rest[body].direction(&Vector3::from(joint.axis)).normalize();
                    let aim = match joint.toward.iter().find(|(b, _)| *b == body) {
                        Some((_, q)) => at_rest(body, &values.point(*q)),
                        None => {
                            let others: Vec<Vector3<f64>> = design
                                .joints
                                .iter()
                                .enumerate()
                                .filter(|(k, j)| *k != rod.joint && j.bodies.contains(&body))
                                .map(|(k, _)| at_rest(body, &joint_points[k]))
                                .collect();
                            others.iter().sum::<Vector3<f64>>() / others.len().max(1) as f64
                        }
                    };
                    let d = aim - origin;
                    let e1 = (d - e3 * d.dot(&e3)).normalize();
                    let e2 = e3.cross(&e1);
                    RodEndFrame { body, origin, axes: Matrix3::from_columns(&[e1, e2, e3]) }
                })
            })
            .collect();

        // A typical arm: the mean distance of the joints from the centres of their bodies.
        let mut arms = (0.0, 0);
        for (joint, drawn) in design.joints.iter().zip(joint_points) {
            for &b in &joint.bodies {
                arms = (arms.0 + (at_rest(b, drawn) - bodies[b].center).norm(), arms.1 + 1);
            }
        }
        let length_mm = (arms.0 / f64::from(arms.1.max(1))).max(1.0);

        let loads = LayoutLoad::of(design, motion, |p| values.point(p));
        let closed = design.is_closed();
        let rest_poses = rest.clone();
        Self {
            bodies,
            rod_ends,
            constraints,
            drives,
            loads,
            traces,
            closed,
            rest_poses,
            length_mm,
            rod_model: RodModel::default(),
        }
    }

    /// Number of link unknowns.
    pub fn dofs(&self) -> usize {
        6 * self.bodies.iter().filter(|b| b.first_dof.is_some()).count()
    }

    /// Number of states 0..=N.
    pub fn states(&self) -> usize {
        let of_loads = self.loads.iter().map(|l| l.values.len());
        self.drives.iter().map(|d| d.values.len()).chain(of_loads).max().unwrap_or(1)
    }

    /// Number of states that count in sums: a closed cycle's last state is its first.
    pub fn counted_states(&self) -> usize {
        if self.closed && self.states() > 1 { self.states() - 1 } else { self.states() }
    }
}
