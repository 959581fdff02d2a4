//! Scalar forms of two rigid poses that constraints and joint values are made of, with exact first and second
//! derivatives in the increment chart centred at the present pose: x = c + u + du + exp(dφ) r.
//!
//! With r the present arm: ∂x/∂φ·δ = δ × r and ∇²(λ·x) = sym(λ rᵀ) − (λ·r) I, from the second order of exp.

use super::constraint::{Gradient, Hessian};
use crate::math::{Pose, skew};
use nalgebra::{Matrix3, Vector3};

/// f = u·v of present directions u carried by a, v by b.
pub(super) struct Product {
    pub u: Vector3<f64>,
    pub v: Vector3<f64>,
}

impl Product {
    pub fn value(&self) -> f64 {
        self.u.dot(&self.v)
    }

    pub fn gradient(&self) -> Gradient {
        let mut g = Gradient::zeros();
        let uv = self.u.cross(&self.v);
        g.fixed_rows_mut::<3>(3).copy_from(&uv);
        g.fixed_rows_mut::<3>(9).copy_from(&-uv);
        g
    }

    pub fn hessian(&self) -> Hessian {
        let mut h = Hessian::zeros();
        let own = rotated_arm(&self.v, &self.u);
        let cross = Matrix3::identity() * self.value() - self.v * self.u.transpose();
        h.fixed_view_mut::<3, 3>(3, 3).copy_from(&own);
        h.fixed_view_mut::<3, 3>(9, 9).copy_from(&own);
        h.fixed_view_mut::<3, 3>(3, 9).copy_from(&cross);
        h.fixed_view_mut::<3, 3>(9, 3).copy_from(&cross.transpose());
        h
    }
}

/// f = w·(x_b − x_a) of a present direction w carried by a and points carried by a and b. As w and the arm of x_a turn
/// together, f = w·p − const with p = x_b − (moved centre of a).
pub(super) struct Along {
    w: Vector3<f64>,
    p: Vector3<f64>,
    arm_a: Vector3<f64>,
    arm_b: Vector3<f64>,
}

impl Along {
    /// The form at present poses of a and b, for points and a direction in reference coordinates.
    pub fn at(poses: [&Pose; 2], [point_a, point_b]: [&Vector3<f64>; 2], direction_a: &Vector3<f64>) -> Self {
        let [a, b] = poses;
        Self {
            w: a.direction(direction_a),
            p: b.point(point_b) - (a.center + a.translation),
            arm_a: a.arm(point_a),
            arm_b: b.arm(point_b),
        }
    }

    pub fn value(&self) -> f64 {
        self.w.dot(&(self.p - self.arm_a))
    }

    pub fn gradient(&self) -> Gradient {
        let mut g = Gradient::zeros();
        g.fixed_rows_mut::<3>(0).copy_from(&-self.w);
        g.fixed_rows_mut::<3>(3).copy_from(&self.w.cross(&self.p));
        g.fixed_rows_mut::<3>(6).copy_from(&self.w);
        g.fixed_rows_mut::<3>(9).copy_from(&self.arm_b.cross(&self.w));
        g
    }

    pub fn hessian(&self) -> Hessian {
        let mut h = Hessian::zeros();
        let turn = skew(&self.w);
        let own_b = rotated_arm(&self.w, &self.arm_b);
        h.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotated_arm(&self.p, &self.w));
        h.fixed_view_mut::<3, 3>(9, 9).copy_from(&own_b);
        let mut cross = |i: usize, j: usize, block: Matrix3<f64>| {
            h.fixed_view_mut::<3, 3>(i, j).copy_from(&block);
            h.fixed_view_mut::<3, 3>(j, i).copy_from(&block.transpose());
        };
        cross(3, 0, -turn);
        cross(3, 6, turn);
        cross(3, 9, -turn * skew(&self.arm_b));
        h
    }
}

/// ∇²(λ · exp(φ) r) at φ = 0: sym(λ rᵀ) − (λ·r) I.
pub(super) fn rotated_arm(lambda: &Vector3<f64>, r: &Vector3<f64>) -> Matrix3<f64> {
    let m = lambda * r.transpose();
    (m + m.transpose()) * 0.5 - Matrix3::identity() * lambda.dot(r)
}

pub(super) fn unit_or_z(axis: &Vector3<f64>) -> Vector3<f64> {
    axis.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z)
}

/// Two unit normals (n, axis × n) of a unit axis; n lies next to the coordinate axis farthest from it, the
/// same for axis and −axis.
pub(super) fn normals(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let seed = if axis.x.abs() <= axis.y.abs().min(axis.z.abs()) {
        Vector3::x()
    } else if axis.y.abs() <= axis.z.abs() {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let n = (seed - axis * seed.dot(axis)).normalize();
    (n, axis.cross(&n))
}
