//! Conventional joints as constraints on rigid poses, and the angle of a hinge, with exact first and second
//! derivatives. Everything is a point or a product of two directions carried by the bodies; derivatives are taken
//! in the increment chart centred at the present pose: x = c + u + du + exp(dφ) r.
//!
//! With r the present arm: ∂x/∂φ·δ = δ × r and ∇²(λ·x) = sym(λ rᵀ) − (λ·r) I, from the second order of exp.

use crate::math::{Pose, skew};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Rows × the six increments (du, dφ) of one body; rows beyond `Constraint::rows` are zero.
pub type Block = SMatrix<f64, 3, 6>;
/// Second derivatives by the increments (du_a, dφ_a, du_b, dφ_b).
pub type Hessian = SMatrix<f64, 12, 12>;
/// First derivatives by the increments (du_a, dφ_a, du_b, dφ_b).
pub type Gradient = SVector<f64, 12>;

/// A relation between two bodies, by index into the poses. Its geometry is given in reference coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constraint {
    /// Three rows, mm: a point of `a` minus a point of `b`.
    Coincident {
        /// First body.
        a: usize,
        /// Second body.
        b: usize,
        /// Point carried by the first body, mm.
        point_a: Vector3<f64>,
        /// Point carried by the second body, mm.
        point_b: Vector3<f64>,
    },
    /// Two rows, dimensionless: products of an axis of `b` with two normals of the axis of `a`.
    Parallel {
        /// First body.
        a: usize,
        /// Second body.
        b: usize,
        /// Two unit normals of the axis, carried by the first body.
        normals_a: [Vector3<f64>; 2],
        /// Unit axis carried by the second body.
        axis_b: Vector3<f64>,
    },
}

/// First derivatives of a constraint by the increments of its two bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jacobian {
    /// By (du, dφ) of the first body.
    pub a: Block,
    /// By (du, dφ) of the second body.
    pub b: Block,
}

impl Constraint {
    /// Largest number of rows of any constraint.
    pub const MAX_ROWS: usize = 3;

    /// The two constraints of a hinge at `point` (mm) about `axis`, both in reference coordinates.
    pub fn hinge(a: usize, b: usize, point: Vector3<f64>, axis: &Vector3<f64>) -> [Self; 2] {
        let axis_b = unit_or_z(axis);
        let (n, m) = normals(&axis_b);
        [
            Self::Coincident { a, b, point_a: point, point_b: point },
            Self::Parallel { a, b, normals_a: [n, m], axis_b },
        ]
    }

    /// Number of scalar equations.
    pub fn rows(&self) -> usize {
        match self {
            Self::Coincident { .. } => 3,
            Self::Parallel { .. } => 2,
        }
    }

    /// The two bodies.
    pub fn bodies(&self) -> [usize; 2] {
        match *self {
            Self::Coincident { a, b, .. } | Self::Parallel { a, b, .. } => [a, b],
        }
    }

    /// Whether the rows are lengths (mm) and not products of directions.
    pub fn is_length(&self) -> bool {
        matches!(self, Self::Coincident { .. })
    }

    /// Residual into `out[..rows]`.
    pub fn residual(&self, poses: &[Pose], out: &mut [f64]) {
        match self {
            Self::Coincident { a, b, point_a, point_b } => {
                let gap = poses[*a].point(point_a) - poses[*b].point(point_b);
                out[..3].copy_from_slice(gap.as_slice());
            }
            Self::Parallel { a, b, normals_a, axis_b } => {
                let v = poses[*b].direction(axis_b);
                for (row, n) in out.iter_mut().zip(normals_a) {
                    *row = poses[*a].direction(n).dot(&v);
                }
            }
        }
    }

    /// First derivatives, overwriting `out`.
    pub fn jacobian(&self, poses: &[Pose], out: &mut Jacobian) {
        *out = Jacobian::default();
        match self {
            Self::Coincident { a, b, point_a, point_b } => {
                out.a.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
                out.a.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&poses[*a].arm(point_a)));
                out.b.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
                out.b.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&poses[*b].arm(point_b)));
            }
            Self::Parallel { a, b, normals_a, axis_b } => {
                let v = poses[*b].direction(axis_b);
                for (row, n) in normals_a.iter().enumerate() {
                    let uv = poses[*a].direction(n).cross(&v);
                    out.a.fixed_view_mut::<1, 3>(row, 3).tr_copy_from(&uv);
                    out.b.fixed_view_mut::<1, 3>(row, 3).tr_copy_from(&-uv);
                }
            }
        }
    }

    /// Σ λ_r ∇²C_r over the rows.
    pub fn hessian(&self, poses: &[Pose], lambda: &[f64]) -> Hessian {
        let mut h = Hessian::zeros();
        match self {
            Self::Coincident { a, b, point_a, point_b } => {
                let l = Vector3::from_row_slice(&lambda[..3]);
                let ra = poses[*a].arm(point_a);
                let rb = poses[*b].arm(point_b);
                h.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotated_arm(&l, &ra));
                h.fixed_view_mut::<3, 3>(9, 9).copy_from(&-rotated_arm(&l, &rb));
            }
            Self::Parallel { a, b, normals_a, axis_b } => {
                let v = poses[*b].direction(axis_b);
                for (n, l) in normals_a.iter().zip(lambda) {
                    h += Product { u: poses[*a].direction(n), v }.hessian() * *l;
                }
            }
        }
        h
    }

    /// Derivative of the residual and of Jᵀλ when the reference geometry moves along `change`: what a design
    /// parameter that moves a joint or a body's centre adds (C_p and J_pᵀλ of the sensitivity equations).
    pub fn design_derivative(
        &self,
        poses: &[Pose],
        lambda: &[f64],
        change: &GeometryChange,
    ) -> (Vector3<f64>, Gradient) {
        let mut by_increments = Gradient::zeros();
        match self {
            Self::Coincident { a, b, .. } => {
                let l = Vector3::from_row_slice(&lambda[..3]);
                // Only the arm is carried round: x = centre + u + R (X − centre).
                let da = poses[*a].rotation * (change.point_a - change.center_a);
                let db = poses[*b].rotation * (change.point_b - change.center_b);
                by_increments.fixed_rows_mut::<3>(3).copy_from(&da.cross(&l));
                by_increments.fixed_rows_mut::<3>(9).copy_from(&-db.cross(&l));
                (change.center_a + da - change.center_b - db, by_increments)
            }
            // Axes are numbers in the design: nothing to move.
            Self::Parallel { .. } => (Vector3::zeros(), by_increments),
        }
    }
}

/// How the reference geometry of a constraint moves with one design parameter, mm per unit of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GeometryChange {
    /// Of the first body's point.
    pub point_a: Vector3<f64>,
    /// Of the second body's point.
    pub point_b: Vector3<f64>,
    /// Of the first body's centre.
    pub center_a: Vector3<f64>,
    /// Of the second body's centre.
    pub center_b: Vector3<f64>,
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

/// f = u·v of present directions u carried by a, v by b.
struct Product {
    u: Vector3<f64>,
    v: Vector3<f64>,
}

impl Product {
    fn value(&self) -> f64 {
        self.u.dot(&self.v)
    }

    fn gradient(&self) -> Gradient {
        let mut g = Gradient::zeros();
        let uv = self.u.cross(&self.v);
        g.fixed_rows_mut::<3>(3).copy_from(&uv);
        g.fixed_rows_mut::<3>(9).copy_from(&-uv);
        g
    }

    fn hessian(&self) -> Hessian {
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

/// ∇²(λ · exp(φ) r) at φ = 0: sym(λ rᵀ) − (λ·r) I.
fn rotated_arm(lambda: &Vector3<f64>, r: &Vector3<f64>) -> Matrix3<f64> {
    let m = lambda * r.transpose();
    (m + m.transpose()) * 0.5 - Matrix3::identity() * lambda.dot(r)
}

fn unit_or_z(axis: &Vector3<f64>) -> Vector3<f64> {
    axis.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z)
}

/// Two unit normals (n, axis × n) of a unit axis; n lies next to the coordinate axis farthest from it, the
/// same for axis and −axis.
fn normals(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-size..size, -size..size, -size..size].prop_map(|[x, y, z]| Vector3::new(x, y, z))
    }

    fn poses() -> impl Strategy<Value = Vec<Pose>> {
        prop::collection::vec((vector(20.0), vector(5.0), vector(1.2)), 2)
            .prop_map(|all| all.into_iter().map(|(c, u, phi)| Pose::rest(c).retract(&u, &phi)).collect())
    }

    fn moved(poses: &[Pose], step: &Gradient) -> Vec<Pose> {
        let at = |i: usize| step.fixed_rows::<3>(i).into_owned();
        vec![poses[0].retract(&at(0), &at(3)), poses[1].retract(&at(6), &at(9))]
    }

    /// Central differences of first and second order in the chart at the point itself.
    fn differences(f: impl Fn(&[Pose]) -> f64, at: &[Pose]) -> (Gradient, Hessian) {
        let unit = |i: usize, h: f64| Gradient::from_fn(|k, _| if k == i { h } else { 0.0 });
        let g = Gradient::from_fn(|i, _| {
            let h = 1e-5;
            let d = |h: f64| f(&moved(at, &unit(i, h))) - f(&moved(at, &unit(i, -h)));
            (8.0 * d(h) - d(2.0 * h)) / (12.0 * h)
        });
        let second = |h: f64| {
            Hessian::from_fn(|i, j| {
                let s = |a: f64, b: f64| f(&moved(at, &(unit(i, a) + unit(j, b))));
                (s(h, h) - s(h, -h) - s(-h, h) + s(-h, -h)) / (4.0 * h * h)
            })
        };
        // Richardson: fourth order, so that h may be large enough for the rounding to vanish.
        let (wide, narrow) = (second(8e-3), second(4e-3));
        (g, (narrow * 4.0 - wide) / 3.0)
    }

    fn check(f: impl Fn(&[Pose]) -> f64, at: &[Pose], g: &Gradient, h: &Hessian) {
        let (gd, hd) = differences(f, at);
        assert!((g - gd).norm() <= 1e-6 * (1e-2 + g.norm()), "gradient {g} {gd}");
        assert!((h - hd).norm() <= 1e-6 * (1e-1 + h.norm()), "hessian {} {h} {hd}", (h - hd).norm());
        assert!((h - h.transpose()).norm() <= 1e-14 * h.norm(), "symmetry");
    }

    fn check_constraint(c: &Constraint, at: &[Pose], lambda: &[f64]) {
        let mut jacobian = Jacobian::default();
        c.jacobian(at, &mut jacobian);
        let l = Vector3::from_fn(|i, _| if i < c.rows() { lambda[i] } else { 0.0 });
        let mut g = Gradient::zeros();
        g.fixed_rows_mut::<6>(0).copy_from(&(jacobian.a.transpose() * l));
        g.fixed_rows_mut::<6>(6).copy_from(&(jacobian.b.transpose() * l));
        let weighted = |poses: &[Pose]| {
            let mut r = [0.0; 3];
            c.residual(poses, &mut r);
            (0..c.rows()).map(|i| lambda[i] * r[i]).sum()
        };
        check(weighted, at, &g, &c.hessian(at, lambda));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn constraints_match_differences(at in poses(), p in vector(20.0), q in vector(20.0), l in vector(3.0),
                                         axis in vector(1.0)) {
            prop_assume!(axis.norm() > 0.1);
            let [_, parallel] = Constraint::hinge(0, 1, p, &axis);
            check_constraint(&parallel, &at, l.as_slice());
            let c = Constraint::Coincident { a: 0, b: 1, point_a: p, point_b: q };
            check_constraint(&c, &at, l.as_slice());
        }

        #[test]
        fn hinge_angle_matches_differences(at in poses(), axis in vector(1.0)) {
            prop_assume!(axis.norm() > 0.1);
            let angle = HingeAngle::new(0, 1, &axis);
            // Away from the singular half turn about a normal of the axis, as every hinge is.
            let cosine = at[0].direction(&angle.axis).dot(&at[1].direction(&angle.axis));
            prop_assume!(cosine > 0.5);
            let near = angle.value(&at, 0.0);
            check(|q| angle.value(q, near), &at, &angle.gradient(&at), &angle.hessian(&at));
        }

        #[test]
        fn design_derivative_matches_differences(at in poses(), p in vector(20.0), q in vector(20.0),
                                                 l in vector(3.0), d in prop::array::uniform4(vector(1.0))) {
            let [point_a, point_b, center_a, center_b] = d;
            let change = GeometryChange { point_a, point_b, center_a, center_b };
            let shifted = |h: f64| {
                let mut poses = at.clone();
                poses[0].center += center_a * h;
                poses[1].center += center_b * h;
                let c = Constraint::Coincident { a: 0, b: 1, point_a: p + point_a * h, point_b: q + point_b * h };
                let mut r = [0.0; 3];
                c.residual(&poses, &mut r);
                let mut j = Jacobian::default();
                c.jacobian(&poses, &mut j);
                let mut g = Gradient::zeros();
                g.fixed_rows_mut::<6>(0).copy_from(&(j.a.transpose() * l));
                g.fixed_rows_mut::<6>(6).copy_from(&(j.b.transpose() * l));
                (c, Vector3::from(r), g)
            };
            let (c, _, _) = shifted(0.0);
            let (dc, dg) = c.design_derivative(&at, l.as_slice(), &change);
            let ((_, r1, g1), (_, r0, g0)) = (shifted(1e-3), shifted(-1e-3));
            prop_assert!(((r1 - r0) / 2e-3 - dc).norm() < 1e-9);
            prop_assert!(((g1 - g0) / 2e-3 - dg).norm() < 1e-8);
        }

        #[test]
        fn hinge_angle_is_the_turn_of_the_second_body(phi in vector(1.0), axis in vector(1.0), turn in -9.0..9.0_f64,
                                                      p in vector(30.0)) {
            prop_assume!(axis.norm() > 0.1);
            let base = Pose::rest(Vector3::new(1.0, 2.0, 3.0)).retract(&p, &phi);
            let angle = HingeAngle::new(0, 1, &axis);
            let mut b = Pose::rest(p);
            b.rotation = base.rotation * crate::math::exp_so3(&(angle.axis * turn));
            b.translation = base.point(&p) - p;
            let poses = [base, b];
            prop_assert!((angle.value(&poses, turn + 0.4) - turn).abs() < 1e-12);
            let mut r = [0.0; 3];
            for c in Constraint::hinge(0, 1, p, &axis) {
                c.residual(&poses, &mut r);
                prop_assert!(r.iter().take(c.rows()).all(|x| x.abs() < 1e-12));
            }
        }
    }
}
