//! What the rods of the compliant model are put into: rest poses, end frames of the rods, constraints, drives, traces
//! and their targets, all in rest world coordinates; and how it moves with the free variables of the geometry.

use super::change::{LayoutChange, layout_changes};
use super::design_load::LayoutLoad;
use super::frames::{RodEndFrame, end_frames};
use super::target::{LayoutDirection, LayoutTrace};
use crate::ir::{BodyId, Design, DriveOn, RodModel};
use crate::kinematics::{Constraint, JointValue, Motion, Pull};
use crate::math::Pose;
use nalgebra::Vector3;
use std::borrow::Cow;

/// A rigid body of the compliant model.
#[derive(Clone, Debug)]
pub struct LayoutBody {
    /// Centre of its increments: centroid of its joint points at rest, of a flexure's own body the joint's, mm.
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
    /// Traced directions.
    pub directions: Vec<LayoutDirection>,
    /// N, the steps of the cycle.
    pub steps: usize,
    /// Whether states 0 and N are the same pose.
    pub closed: bool,
    /// Rest pose of each body relative to the drawing pose.
    pub rest_poses: Vec<Pose>,
    /// Physical points of the joints in the drawing pose, mm.
    pub joint_points: Vec<Vector3<f64>>,
    /// How the conventional mechanism moves: the pose of every body in each state, relative to rest.
    pub conventional: Vec<Vec<Pose>>,
    /// A typical length: lever of rotations in scaled systems, mm.
    pub length_mm: f64,
    /// Rod theory, as the design names it.
    pub rod_model: RodModel,
    /// Its derivatives by every free variable that moves it (see [`Design::geometry_variables`]); none where the
    /// conventional motion has none, at a dead point.
    pub changes: Option<Vec<LayoutChange>>,
}

impl Layout {
    /// Moves the design's drawn geometry to the rest pose. `motion` is the conventional motion of
    /// the same design at the free variables `p`.
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
            let center = match body.owner {
                // Its rods lie round the joint.
                Some(joint) => at_rest(i, &joint_points[joint]),
                None => points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64,
            };
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
                let (axis, second) = (Vector3::from(joint.axis), joint.second_axis.map(Vector3::from));
                let made = Constraint::of_joint(joint.kind, [a, b], *drawn, &axis, second.as_ref());
                constraints.extend(made.iter().map(|c| c.carried(rest)));
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
                        let axis = Vector3::from(joint.axis);
                        JointValue::new(joint.kind, joint.pairs().next()?, joint_points[id], &axis)?
                    }
                    DriveOn::String(id) => {
                        let c = &design.strings[id];
                        let (point_a, point_b) = (values.point(c.point), values.point(*c.via.first()?));
                        JointValue::Pull(Pull { a: c.from, b: c.to, point_a, point_b })
                    }
                };
                let steps = design.cycle.steps;
                let carriers = value.bodies().map(|b| &rest[b]);
                Some(LayoutDrive {
                    joint: value.carried(carriers),
                    rest: d.free_rest.map_or(d.rest, |id| values.value(id)),
                    values: (0..=steps).map(|s| d.value(s as f64 / steps as f64)).collect(),
                })
            })
            .collect();

        let closed = design.is_closed();
        let traces = design
            .traces
            .iter()
            .enumerate()
            .map(|(i, t)| {
                LayoutTrace::new(design, motion, i, at_rest(t.body, &values.point(t.point)), closed)
            })
            .collect();
        let directions = LayoutDirection::all(design, motion);

        let rod_ends = end_frames(design, motion, &values);

        // A typical arm: the mean distance of the joints from the centres of their bodies.
        let mut arms = (0.0, 0);
        for (joint, drawn) in design.joints.iter().zip(joint_points) {
            for &b in &joint.bodies {
                arms = (arms.0 + (at_rest(b, drawn) - bodies[b].center).norm(), arms.1 + 1);
            }
        }
        let length_mm = (arms.0 / f64::from(arms.1.max(1))).max(1.0);

        let loads = LayoutLoad::of(design, motion, |p| values.point(p));
        let rest_poses = rest.clone();
        let mut layout = Self {
            bodies,
            rod_ends,
            constraints,
            drives,
            loads,
            traces,
            directions,
            steps: design.cycle.steps,
            closed,
            rest_poses,
            joint_points: joint_points.clone(),
            conventional: motion.states.iter().map(|s| relative(&s.poses, rest)).collect(),
            length_mm,
            rod_model: design.model,
            changes: None,
        };
        layout.changes = layout_changes(&layout, design, motion, p);
        layout
    }

    /// Number of link unknowns.
    pub fn dofs(&self) -> usize {
        6 * self.bodies.iter().filter(|b| b.first_dof.is_some()).count()
    }

    /// Number of states 0..=N.
    pub fn states(&self) -> usize {
        let of_loads = self.loads.iter().map(|l| l.values.len());
        self.drives.iter().map(|d| d.values.len()).chain(of_loads).max().unwrap_or(self.steps + 1)
    }

    /// Number of states that count in sums: a closed cycle's last state is its first.
    pub fn counted_states(&self) -> usize {
        if self.closed && self.states() > 1 { self.states() - 1 } else { self.states() }
    }
}

impl<'l> From<&'l Layout> for Cow<'l, Layout> {
    fn from(layout: &'l Layout) -> Self {
        Cow::Borrowed(layout)
    }
}

impl From<Layout> for Cow<'_, Layout> {
    fn from(layout: Layout) -> Self {
        Cow::Owned(layout)
    }
}

/// Poses relative to rest of poses that are relative to the drawing, as those of the rest pose are.
fn relative(poses: &[Pose], rest: &[Pose]) -> Vec<Pose> {
    let zero = Vector3::zeros();
    let pair = |(pose, rest): (&Pose, &Pose)| {
        let rotation = pose.rotation * rest.rotation.transpose();
        // The drawing's origin lies at rest.point(0) in the rest pose.
        let translation = pose.point(&zero) - rotation * rest.point(&zero);
        Pose { rotation, translation, center: zero }
    };
    poses.iter().zip(rest).map(pair).collect()
}
