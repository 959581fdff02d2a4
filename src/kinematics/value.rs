//! The value of a joint with one freedom: the angle of a hinge, the way of a slider, with exact first and second
//! derivatives. The second body relative to the first, zero in the reference pose.

use super::constraint::{Gradient, Hessian};
use super::forms::{Along, Product, normals, unit_or_z};
use crate::ir::{DriveUnit, JointKind};
use crate::math::Pose;
use nalgebra::Vector3;

/// Value of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointValue {
    /// Of a hinge or a cylindrical joint, rad.
    Angle(HingeAngle),
    /// Of a slider, mm.
    Shift(Shift),
}

impl JointValue {
    /// The value of a joint of this kind drawn at `point` (mm) along `axis` in the reference pose; none for kinds
    /// without one. Of a cylindrical joint the angle.
    pub fn new(
        kind: JointKind,
        [a, b]: [usize; 2],
        point: Vector3<f64>,
        axis: &Vector3<f64>,
    ) -> Option<Self> {
        match kind {
            JointKind::Hinge | JointKind::Cylindrical => Some(Self::Angle(HingeAngle::new(a, b, axis))),
            JointKind::Slider => Some(Self::Shift(Shift { a, b, axis: unit_or_z(axis), point })),
            JointKind::Ball | JointKind::Universal | JointKind::Fixed => None,
        }
    }

    /// The same value with another reference pose, to which `rest` leads the first body: zero there.
    pub fn carried(&self, rest: &Pose) -> Self {
        match self {
            Self::Angle(angle) => Self::Angle(HingeAngle {
                axis: rest.direction(&angle.axis),
                normal: rest.direction(&angle.normal),
                binormal: rest.direction(&angle.binormal),
                ..*angle
            }),
            Self::Shift(shift) => Self::Shift(Shift {
                axis: rest.direction(&shift.axis),
                point: rest.point(&shift.point),
                ..*shift
            }),
        }
    }

    /// First and second body.
    pub fn bodies(&self) -> [usize; 2] {
        match self {
            Self::Angle(angle) => [angle.a, angle.b],
            Self::Shift(shift) => [shift.a, shift.b],
        }
    }

    /// Unit of the value.
    pub fn unit(&self) -> DriveUnit {
        match self {
            Self::Angle(_) => DriveUnit::Rad,
            Self::Shift(_) => DriveUnit::Mm,
        }
    }

    /// The value, rad (on the branch nearest `near`) or mm.
    pub fn value(&self, poses: &[Pose], near: f64) -> f64 {
        match self {
            Self::Angle(angle) => angle.value(poses, near),
            Self::Shift(shift) => shift.form(poses).value(),
        }
    }

    /// First derivatives by the increments of both bodies.
    pub fn gradient(&self, poses: &[Pose]) -> Gradient {
        match self {
            Self::Angle(angle) => angle.gradient(poses),
            Self::Shift(shift) => shift.form(poses).gradient(),
        }
    }

    /// Second derivatives.
    pub fn hessian(&self, poses: &[Pose]) -> Hessian {
        match self {
            Self::Angle(angle) => angle.hessian(poses),
            Self::Shift(shift) => shift.form(poses).hessian(),
        }
    }
}

/// Way along an axis carried by the first body of the point of the second that coincides with it in the reference pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shift {
    /// First body.
    pub a: usize,
    /// Second body.
    pub b: usize,
    /// Unit axis in reference coordinates.
    pub axis: Vector3<f64>,
    /// The point in reference coordinates, mm.
    pub point: Vector3<f64>,
}

impl Shift {
    fn form(&self, poses: &[Pose]) -> Along {
        Along::at([&poses[self.a], &poses[self.b]], [&self.point; 2], &self.axis)
    }
}

/// Relative angle about a hinge axis: body `b` relative to `a`, right-handed, 0 in the reference pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HingeAngle {
    /// First body.
    pub a: usize,
    /// Second body.
    pub b: usize,
    /// Unit axis in reference coordinates.
    pub axis: Vector3<f64>,
    normal: Vector3<f64>,
    binormal: Vector3<f64>,
}

impl HingeAngle {
    /// The angle of `b` relative to `a` about `axis` (reference coordinates; any length but zero).
    pub fn new(a: usize, b: usize, axis: &Vector3<f64>) -> Self {
        let axis = unit_or_z(axis);
        let (normal, binormal) = normals(&axis);
        Self { a, b, axis, normal, binormal }
    }

    /// The angle, rad, on the branch nearest `near`.
    pub fn value(&self, poses: &[Pose], near: f64) -> f64 {
        let (c, s) = self.products(poses);
        let principal = s.value().atan2(c.value());
        principal + std::f64::consts::TAU * ((near - principal) / std::f64::consts::TAU).round()
    }

    /// First derivatives.
    pub fn gradient(&self, poses: &[Pose]) -> Gradient {
        let (c, s) = self.products(poses);
        let (cv, sv) = (c.value(), s.value());
        (s.gradient() * cv - c.gradient() * sv) / (cv * cv + sv * sv)
    }

    /// Second derivatives: imaginary part of ∇² ln(c + i s).
    pub fn hessian(&self, poses: &[Pose]) -> Hessian {
        let (c, s) = self.products(poses);
        let (cv, sv, gc, gs) = (c.value(), s.value(), c.gradient(), s.gradient());
        let w = cv * cv + sv * sv;
        let mixed = gc * gs.transpose();
        let square = (mixed + mixed.transpose()) * (cv * cv - sv * sv)
            - (gc * gc.transpose() - gs * gs.transpose()) * (2.0 * cv * sv);
        (s.hessian() * cv - c.hessian() * sv) / w - square / (w * w)
    }

    /// Cosine and sine, both scaled alike when the axes are not quite parallel.
    fn products(&self, poses: &[Pose]) -> (Product, Product) {
        let v = poses[self.b].direction(&self.normal);
        let pose = &poses[self.a];
        (Product { u: pose.direction(&self.normal), v }, Product { u: pose.direction(&self.binormal), v })
    }
}
