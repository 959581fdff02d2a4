//! The shortening of a string from a point of one body to a point of another: L̄ − |x_b − x_a|, zero in the reference
//! pose. What runs on through further points of the second body keeps its length.
//!
//! With d = x_b − x_a, L = |d| and u = d/L: ∇L = u·∇d and ∇²L = ∇dᵀ(I − u uᵀ)∇d/L + Σ u_k ∇²d_k.

use super::constraint::{Gradient, Hessian};
use super::forms::rotated_arm;
use crate::math::{Pose, skew};
use nalgebra::{Matrix3, SMatrix, Vector3};

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Body that the string is tied to.
    pub a: usize,
    /// Body that guides it.
    pub b: usize,
    /// Where it is tied, in reference coordinates, mm.
    pub point_a: Vector3<f64>,
    /// First point that guides it, in reference coordinates, mm.
    pub point_b: Vector3<f64>,
}

impl Pull {
    fn free(&self, poses: &[Pose]) -> Vector3<f64> {
        poses[self.b].point(&self.point_b) - poses[self.a].point(&self.point_a)
    }

    /// Length and direction; the direction of a string without length is zero, not a number out of range.
    fn line(&self, poses: &[Pose]) -> (f64, Vector3<f64>) {
        let d = self.free(poses);
        let length = d.norm().max(f64::MIN_POSITIVE);
        (length, d / length)
    }

    /// The shortening, mm.
    pub fn value(&self, poses: &[Pose]) -> f64 {
        (self.point_b - self.point_a).norm() - self.free(poses).norm()
    }

    /// First derivatives.
    pub fn gradient(&self, poses: &[Pose]) -> Gradient {
        let (_, u) = self.line(poses);
        let mut g = Gradient::zeros();
        g.fixed_rows_mut::<3>(0).copy_from(&u);
        g.fixed_rows_mut::<3>(3).copy_from(&poses[self.a].arm(&self.point_a).cross(&u));
        g.fixed_rows_mut::<3>(6).copy_from(&-u);
        g.fixed_rows_mut::<3>(9).copy_from(&-poses[self.b].arm(&self.point_b).cross(&u));
        g
    }

    /// Derivatives of the value and of its gradient at fixed poses when both points move in the reference pose by
    /// `rates` (mm per unit).
    pub fn point_derivative(&self, poses: &[Pose], rates: [Vector3<f64>; 2]) -> (f64, Gradient) {
        let (length, u) = self.line(poses);
        let [a, b] = [(self.a, rates[0]), (self.b, rates[1])].map(|(i, rate)| poses[i].direction(&rate));
        let turn = (Matrix3::identity() - u * u.transpose()) * (b - a) / length;
        let drawn = self.point_b - self.point_a;
        let value = drawn.dot(&(rates[1] - rates[0])) / drawn.norm().max(f64::MIN_POSITIVE) - u.dot(&(b - a));
        let (arm_a, arm_b) = (poses[self.a].arm(&self.point_a), poses[self.b].arm(&self.point_b));
        let mut g = Gradient::zeros();
        g.fixed_rows_mut::<3>(0).copy_from(&turn);
        g.fixed_rows_mut::<3>(3).copy_from(&(a.cross(&u) + arm_a.cross(&turn)));
        g.fixed_rows_mut::<3>(6).copy_from(&-turn);
        g.fixed_rows_mut::<3>(9).copy_from(&-(b.cross(&u) + arm_b.cross(&turn)));
        (value, g)
    }

    /// Second derivatives.
    pub fn hessian(&self, poses: &[Pose]) -> Hessian {
        let (length, u) = self.line(poses);
        let arm_a = poses[self.a].arm(&self.point_a);
        let arm_b = poses[self.b].arm(&self.point_b);
        let mut by = SMatrix::<f64, 3, 12>::zeros();
        by.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
        by.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&arm_a));
        by.fixed_view_mut::<3, 3>(0, 6).copy_from(&Matrix3::identity());
        by.fixed_view_mut::<3, 3>(0, 9).copy_from(&-skew(&arm_b));
        let across = (Matrix3::identity() - u * u.transpose()) / length;
        let mut h = -(by.transpose() * across * by);
        let mut own = h.fixed_view_mut::<3, 3>(3, 3);
        own += rotated_arm(&u, &arm_a);
        let mut own = h.fixed_view_mut::<3, 3>(9, 9);
        own -= rotated_arm(&u, &arm_b);
        h
    }
}
