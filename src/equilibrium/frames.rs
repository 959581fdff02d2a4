//! End frames of the rods in the rest pose, one convention a kind of joint (see [`RodEnd`](crate::ir::RodEnd)).

use crate::ir::expr::Evaluated;
use crate::ir::{BodyId, Design, Joint, JointId, JointKind, Rod};
use crate::kinematics::Motion;
use nalgebra::{Matrix3, Vector3};

/// A ball's body whose way makes a smaller angle (its sine) with world z is framed by x.
const ALONG_Z: f64 = 1e-3;

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

/// Frames of both ends of every rod. `values`: the design's expressions.
pub(super) fn end_frames(design: &Design, motion: &Motion, values: &Evaluated) -> Vec<[RodEndFrame; 2]> {
    let frame = |rod: &Rod, body: BodyId, other: BodyId| {
        let joint = &design.joints[rod.joint];
        let first = joint.bodies[0];
        let framed = match joint.kind {
            JointKind::Slider => first,
            _ => [body, other].into_iter().find(|b| joint.bodies.contains(b)).unwrap_or(first),
        };
        let origin = motion.rest_point(framed, &motion.joint_points[rod.joint]);
        let way = aim(design, motion, values, rod.joint, framed) - origin;
        RodEndFrame { body, origin, axes: axes(joint, rod, motion, framed, &way) }
    };
    let both = |rod: &Rod| {
        let (a, b) = (rod.from.body, rod.to.body);
        [frame(rod, a, b), frame(rod, b, a)]
    };
    design.rods.iter().map(both).collect()
}

/// Where a body lies seen from a joint: its `toward` point, or the centroid of its other joint points.
fn aim(design: &Design, motion: &Motion, values: &Evaluated, joint: JointId, body: BodyId) -> Vector3<f64> {
    if let Some((_, q)) = design.joints[joint].toward.iter().find(|(b, _)| *b == body) {
        return motion.rest_point(body, &values.point(*q));
    }
    let others: Vec<Vector3<f64>> = design
        .joints
        .iter()
        .enumerate()
        .filter(|(k, j)| *k != joint && j.bodies.contains(&body))
        .map(|(k, _)| motion.rest_point(body, &motion.joint_points[k]))
        .collect();
    others.iter().sum::<Vector3<f64>>() / others.len().max(1) as f64
}

fn axes(joint: &Joint, rod: &Rod, motion: &Motion, body: BodyId, way: &Vector3<f64>) -> Matrix3<f64> {
    let along = |carrier: BodyId, axis: [f64; 3]| motion.rest_direction(carrier, &axis.into()).normalize();
    let (e1, e3) = match joint.kind {
        JointKind::Ball => {
            let e1 = way.normalize();
            let seed = if e1.cross(&Vector3::z()).norm() < ALONG_Z { Vector3::x() } else { Vector3::z() };
            (e1, (seed - e1 * seed.dot(&e1)).normalize())
        }
        JointKind::Universal => {
            let first = along(joint.bodies[0], joint.axis);
            let second = along(joint.bodies[1], joint.second_axis.unwrap_or(joint.axis));
            let square = first.cross(&second).normalize();
            let e1 = if way.dot(&square) < 0.0 { -square } else { square };
            // Square to e1 as `first` is, whatever rounding made of the two axes.
            (e1, if rod.second_axis { (second - first * second.dot(&first)).normalize() } else { first })
        }
        JointKind::Slider => {
            let e2 = along(body, joint.axis);
            let e1 = (way - e2 * way.dot(&e2)).normalize();
            (e1, e1.cross(&e2))
        }
        JointKind::Hinge | JointKind::Cylindrical | JointKind::Fixed => {
            let e3 = along(body, joint.axis);
            ((way - e3 * way.dot(&e3)).normalize(), e3)
        }
    };
    Matrix3::from_columns(&[e1, e3.cross(&e1), e3])
}
