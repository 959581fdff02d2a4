//! End frames of the rods in the rest pose, one convention a kind of joint (see [`RodEnd`](crate::ir::RodEnd)), written
//! once for numbers and for dual numbers, so that their derivatives are those of the very same operations.

use crate::ir::expr::Evaluated;
use crate::ir::{BodyId, Design, ExprPoint, Joint, JointId, JointKind, Rod};
use crate::kinematics::Motion;
use crate::math::dual::Real;
use nalgebra::{Matrix3, Vector3};

/// A ball's body whose way makes a smaller angle (its sine) with world z is framed by x.
const ALONG_Z: f64 = 1e-3;
/// Two ways from a joint whose difference is shorter than this have one direction.
const SAME_WAY: f64 = 1e-6;

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

/// What the way of a body seen from a joint ends at.
pub(super) enum Aim {
    /// A point as drawn.
    Point(ExprPoint),
    /// The centroid of these joints' points.
    Joints(Vec<JointId>),
}

impl Aim {
    /// Of a body at a compliant joint.
    pub(super) fn of(design: &Design, joint: JointId, body: BodyId) -> Self {
        match design.joints[joint].toward.iter().find(|(b, _)| *b == body) {
            Some((_, q)) => Self::Point(*q),
            None => {
                let other = |(k, j): (usize, &Joint)| (k != joint && j.bodies.contains(&body)).then_some(k);
                Self::Joints(design.joints.iter().enumerate().filter_map(other).collect())
            }
        }
    }

    /// The point, as drawn.
    pub(super) fn drawn(&self, values: &Evaluated, joint_points: &[Vector3<f64>]) -> Vector3<f64> {
        match self {
            Self::Point(q) => values.point(*q),
            Self::Joints(all) => {
                all.iter().map(|k| joint_points[*k]).sum::<Vector3<f64>>() / all.len().max(1) as f64
            }
        }
    }
}

/// The bodies of the joint that decide the frame of one end of a rod.
pub(super) struct Framed {
    /// Whose way the frame follows: the end's own body, of a flexure's own body the other end's.
    pub body: BodyId,
    /// The body it is turned away from; none where the text aims one of the two, or there is no such body.
    pub other: Option<BodyId>,
    /// Whether the joint names `body` before `other`: which way round the two turn where their ways are one.
    pub leads: bool,
}

impl Framed {
    /// Of end 0 or 1 of a rod.
    pub(super) fn of(design: &Design, rod: &Rod, end: usize) -> Self {
        let joint = &design.joints[rod.joint];
        let ends = [rod.from.body, rod.to.body];
        let first = joint.bodies.first().copied().unwrap_or(0);
        let body = match joint.kind {
            JointKind::Slider => first,
            _ => [ends[end], ends[1 - end]].into_iter().find(|b| joint.bodies.contains(b)).unwrap_or(first),
        };
        let across = ends.into_iter().find(|b| *b != body && joint.bodies.contains(b));
        let only =
            (joint.bodies.len() == 2).then(|| joint.bodies.iter().copied().find(|b| *b != body)).flatten();
        let aimed = |b: BodyId| joint.toward.iter().any(|(t, _)| *t == b);
        let other = across.or(only).filter(|b| !aimed(*b) && !aimed(body));
        let place = |b: BodyId| joint.bodies.iter().position(|x| *x == b);
        let leads = other.is_none_or(|o| place(body) < place(o));
        Self { body, other, leads }
    }
}

/// What a frame is made from, in rest world coordinates.
pub(super) struct Seen<T> {
    /// The joint's axis, carried by the framed body.
    pub axis: [T; 3],
    /// A universal joint's second axis, carried by the second body.
    pub second: [T; 3],
    /// From the joint to the framed body's aim.
    pub way: [T; 3],
    /// The same of the body it is turned away from.
    pub other: Option<[T; 3]>,
    /// See [`Framed::leads`].
    pub leads: bool,
}

/// Frames of both ends of every rod. `values`: the design's expressions.
pub(super) fn end_frames(design: &Design, motion: &Motion, values: &Evaluated) -> Vec<[RodEndFrame; 2]> {
    let frame = |rod: &Rod, end: usize| {
        let (joint, framed) = (&design.joints[rod.joint], Framed::of(design, rod, end));
        let drawn = &motion.joint_points[rod.joint];
        let way = |body: BodyId| {
            let aim = Aim::of(design, rod.joint, body).drawn(values, &motion.joint_points);
            (motion.rest_point(body, &aim) - motion.rest_point(body, drawn)).into()
        };
        let carried = |body: BodyId, axis: [f64; 3]| motion.rest_direction(body, &Vector3::from(axis)).into();
        let second = joint.bodies.get(1).copied().unwrap_or(framed.body);
        let seen = Seen {
            axis: carried(axis_carrier(joint, framed.body), joint.axis),
            second: carried(second, joint.second_axis.unwrap_or(joint.axis)),
            way: way(framed.body),
            other: framed.other.map(way),
            leads: framed.leads,
        };
        RodEndFrame {
            body: [rod.from.body, rod.to.body][end],
            origin: motion.rest_point(framed.body, drawn),
            axes: Matrix3::from_columns(&axes(joint, rod, &seen).map(Vector3::from)),
        }
    };
    design.rods.iter().map(|rod| [0, 1].map(|end| frame(rod, end))).collect()
}

/// The body that carries a joint's (first) axis for the frame of `framed`.
pub(super) fn axis_carrier(joint: &Joint, framed: BodyId) -> BodyId {
    match joint.kind {
        JointKind::Universal => joint.bodies.first().copied().unwrap_or(framed),
        _ => framed,
    }
}

/// Columns e1, e2, e3.
pub(super) fn axes<T: Real>(joint: &Joint, rod: &Rod, seen: &Seen<T>) -> [[T; 3]; 3] {
    let (e1, e3) = match joint.kind {
        JointKind::Ball => {
            let up = |along: [T; 3]| {
                let z = [0.0, 0.0, 1.0].map(T::constant);
                let steep = norm(cross(along, z)).value() < ALONG_Z;
                if steep { [1.0, 0.0, 0.0].map(T::constant) } else { z }
            };
            let way = unit(seen.way);
            let sideways = if seen.leads { up(way) } else { up(way).map(|x| -x) };
            let e1 = opposed(way, seen.other.map(unit), sideways);
            (e1, unit(flat(up(e1), e1)))
        }
        JointKind::Universal => {
            let (first, second) = (unit(seen.axis), unit(seen.second));
            let square = unit(cross(first, second));
            let away = dot(opposed(unit(seen.way), seen.other.map(unit), first), square).value();
            // Two bodies as far from the plane of the axes as each other: the sides are told by the order of the bodies.
            let even = seen.other.is_some() && away.abs() < SAME_WAY;
            let e1 = if (even && !seen.leads) || (!even && away < 0.0) { square.map(|x| -x) } else { square };
            // Square to e1 as `first` is, whatever rounding made of the two axes.
            (e1, if rod.second_axis { unit(flat(second, first)) } else { first })
        }
        JointKind::Slider => {
            let e2 = unit(seen.axis);
            let e1 = unit(flat(seen.way, e2));
            (e1, cross(e1, e2))
        }
        JointKind::Hinge | JointKind::Cylindrical | JointKind::Fixed => {
            let e3 = unit(seen.axis);
            let plane = |way| unit(flat(way, e3));
            // Both ends turn the same way round where the two ways are one.
            let sideways = if seen.leads { e3 } else { e3.map(|x| -x) };
            (opposed(plane(seen.way), seen.other.map(plane), sideways), e3)
        }
    };
    [e1, cross(e3, e1), e3]
}

/// The unit vector u turned away from v until the two are opposed, as v is turned away from u: both flexure ends then lie
/// on one line through the joint. Where u and v are one, a vector square to u and `sideways`.
fn opposed<T: Real>(u: [T; 3], v: Option<[T; 3]>, sideways: [T; 3]) -> [T; 3] {
    let Some(v) = v else { return u };
    let apart = [u[0] - v[0], u[1] - v[1], u[2] - v[2]];
    if norm(apart).value() >= SAME_WAY {
        return unit(apart);
    }
    let across = cross(sideways, u);
    if norm(across).value() >= SAME_WAY { unit(across) } else { u }
}

fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm<T: Real>(a: [T; 3]) -> T {
    dot(a, a).sqrt()
}

fn unit<T: Real>(a: [T; 3]) -> [T; 3] {
    let length = norm(a);
    a.map(|x| x / length)
}

/// The part of `a` square to the unit vector `n`.
fn flat<T: Real>(a: [T; 3], n: [T; 3]) -> [T; 3] {
    let along = dot(a, n);
    std::array::from_fn(|i| a[i] - n[i] * along)
}
