//! Constraints and joint values in another reference pose, and their derivatives when that reference geometry moves
//! with a design parameter: rigidly with its bodies, and points besides.

use super::constraint::{Constraint, GeometryChange, Gradient, Hessian, Jacobian};
use super::value::JointValue;
use crate::math::Pose;
use nalgebra::{SVector, Vector3};

/// Rate of a rigid motion by a parameter: x' = shift + turn × x.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Of the point that lies in the origin, mm per unit.
    pub shift: Vector3<f64>,
    /// rad per unit.
    pub turn: Vector3<f64>,
}

impl Twist {
    /// The twist that moves the point `at` by `shift` and turns about it.
    pub fn about(at: &Vector3<f64>, shift: Vector3<f64>, turn: Vector3<f64>) -> Self {
        Self { shift: shift - turn.cross(at), turn }
    }

    /// Rate of a point, mm per unit.
    pub fn at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.shift + self.turn.cross(x)
    }

    /// A motion of a body's reference coordinates as increments (du, dφ) of its pose.
    pub fn increments(&self, pose: &Pose) -> SVector<f64, 6> {
        let mut out = SVector::<f64, 6>::zeros();
        out.fixed_rows_mut::<3>(0).copy_from(&(pose.rotation * self.at(&pose.center)));
        out.fixed_rows_mut::<3>(3).copy_from(&(pose.rotation * self.turn));
        out
    }
}

/// How the reference geometry of two bodies moves with one parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceChange {
    /// Of everything the first and the second body carry.
    pub twists: [Twist; 2],
    /// Of the first and the second body's point besides, mm per unit.
    pub points: [Vector3<f64>; 2],
}

impl ReferenceChange {
    fn points_only(&self) -> GeometryChange {
        let [point_a, point_b] = self.points;
        GeometryChange { point_a, point_b, ..GeometryChange::default() }
    }

    fn increments(&self, poses: [&Pose; 2]) -> Gradient {
        let mut out = Gradient::zeros();
        out.fixed_rows_mut::<6>(0).copy_from(&self.twists[0].increments(poses[0]));
        out.fixed_rows_mut::<6>(6).copy_from(&self.twists[1].increments(poses[1]));
        out
    }
}

/// Change of a gradient at fixed poses when the reference geometry moves as `increments` would move the poses: the
/// Hessian belongs to the exponential chart at the old pose, and moments are still taken about the old centres.
fn gradient_change(gradient: &Gradient, hessian: &Hessian, increments: &Gradient) -> Gradient {
    let mut out = hessian * increments;
    for half in [0, 6] {
        let at = |v: &Gradient, i: usize| -> Vector3<f64> { v.fixed_rows::<3>(half + i).into_owned() };
        let (du, dphi) = (at(increments, 0), at(increments, 3));
        let mut moment = out.fixed_rows_mut::<3>(half + 3);
        moment += dphi.cross(&at(gradient, 3)) * 0.5 + du.cross(&at(gradient, 0));
    }
    out
}

impl Constraint {
    /// The same relation with another reference pose: `rest` leads there from the present one and meets it.
    pub fn carried(&self, rest: &[Pose]) -> Self {
        match *self {
            Self::Coincident { a, b, point_a, .. } => {
                let point = rest[a].point(&point_a);
                Self::Coincident { a, b, point_a: point, point_b: point }
            }
            Self::Parallel { a, b, normals_a, axis_b } => Self::Parallel {
                a,
                b,
                normals_a: normals_a.map(|n| rest[a].direction(&n)),
                axis_b: rest[b].direction(&axis_b),
            },
            Self::Perpendicular { a, b, u_a, v_b } => {
                Self::Perpendicular { a, b, u_a: rest[a].direction(&u_a), v_b: rest[b].direction(&v_b) }
            }
            Self::OnLine { a, b, point_a, normals_a, point_b } => Self::OnLine {
                a,
                b,
                point_a: rest[a].point(&point_a),
                normals_a: normals_a.map(|n| rest[a].direction(&n)),
                point_b: rest[b].point(&point_b),
            },
            Self::Gauge { body, axis } => Self::Gauge { body, axis: rest[body].direction(&axis) },
        }
    }

    /// Derivatives of the residual and of Jᵀλ at fixed poses when the reference geometry moves. Of a gauge none: what
    /// it holds means nothing.
    pub fn reference_derivative(
        &self,
        poses: &[Pose],
        lambda: &[f64],
        change: &ReferenceChange,
    ) -> (Vector3<f64>, Gradient) {
        if let Self::Gauge { .. } = self {
            return (Vector3::zeros(), Gradient::zeros());
        }
        let increments = change.increments(self.bodies().map(|b| &poses[b]));
        let mut jacobian = Jacobian::default();
        self.jacobian(poses, &mut jacobian);
        let (mut rows, mut by_increments) = self.design_derivative(poses, lambda, &change.points_only());
        rows += jacobian.a * increments.fixed_rows::<6>(0) + jacobian.b * increments.fixed_rows::<6>(6);
        let mut gradient = Gradient::zeros();
        for (r, l) in lambda.iter().enumerate().take(self.rows()) {
            for k in 0..6 {
                gradient[k] += l * jacobian.a[(r, k)];
                gradient[6 + k] += l * jacobian.b[(r, k)];
            }
        }
        by_increments += gradient_change(&gradient, &self.hessian(poses, lambda), &increments);
        (rows, by_increments)
    }
}

impl JointValue {
    /// Derivatives of the value and of its gradient at fixed poses when the reference geometry moves.
    pub fn reference_derivative(&self, poses: &[Pose], change: &ReferenceChange) -> (f64, Gradient) {
        if let Self::Pull(pull) = self {
            let [a, b] = [pull.point_a, pull.point_b];
            let rates =
                [change.twists[0].at(&a) + change.points[0], change.twists[1].at(&b) + change.points[1]];
            return pull.point_derivative(poses, rates);
        }
        let increments = change.increments(self.bodies().map(|b| &poses[b]));
        let gradient = self.gradient(poses);
        let mut value = gradient.dot(&increments);
        let mut by_increments = gradient_change(&gradient, &self.hessian(poses), &increments);
        if let Self::Shift(shift) = self {
            // A way along an axis is what keeps a point on a line, once more.
            let along = Constraint::OnLine {
                a: shift.a,
                b: shift.b,
                point_a: shift.point,
                normals_a: [shift.axis; 2],
                point_b: shift.point,
            };
            let (rows, more) = along.design_derivative(poses, &[1.0, 0.0], &change.points_only());
            value += rows[0];
            by_increments += more;
        }
        (value, by_increments)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ir::JointKind;
    use crate::kinematics::Pull;
    use crate::math::exp_so3;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-size..size, -size..size, -size..size].prop_map(|[x, y, z]| Vector3::new(x, y, z))
    }

    /// Reference pose moved for a time `h`: a drawn point moves on its own, its body by the twist.
    fn reference(twist: &Twist, h: f64) -> Pose {
        // To second order the rigid motion of the twist through the origin.
        let mut pose = Pose::rest(Vector3::zeros());
        pose.rotation = exp_so3(&(twist.turn * h));
        pose.translation = twist.shift * h + twist.turn.cross(&twist.shift) * (0.5 * h * h);
        pose
    }

    fn difference<T>(h: f64, f: impl Fn(f64) -> T) -> T
    where
        T: std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
    {
        ((f(h) - f(-h)) * 8.0 - (f(2.0 * h) - f(-2.0 * h))) * (1.0 / (12.0 * h))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn moving_reference_geometry_matches_differences(
            poses in prop::array::uniform2((vector(20.0), vector(5.0), vector(1.2))), p in vector(20.0),
            axis in vector(1.0), second in vector(1.0), l in vector(3.0), t in prop::array::uniform4(vector(0.7)),
            dp in vector(2.0),
        ) {
            prop_assume!(axis.norm() > 0.1 && axis.cross(&second).norm() > 0.1);
            let poses = poses.map(|(c, u, phi)| Pose::rest(c).retract(&u, &phi));
            let twists = [Twist { shift: t[0], turn: t[1] }, Twist { shift: t[2], turn: t[3] }];
            let step = 1e-3;
            for kind in JointKind::ALL {
                let drawn = |h: f64| Constraint::of_joint(kind, [0, 1], p + dp * h, &axis, Some(&second));
                let at = |h: f64, i: usize| {
                    let rest = [reference(&twists[0], h), reference(&twists[1], h)];
                    let c = match drawn(h)[i] {
                        // Not closed in these poses: each body keeps its own.
                        Constraint::Coincident { a, b, point_a, point_b } => Constraint::Coincident {
                            a, b, point_a: rest[a].point(&point_a), point_b: rest[b].point(&point_b),
                        },
                        other => other.carried(&rest),
                    };
                    let (mut r, mut j) = ([0.0; 3], Jacobian::default());
                    c.residual(&poses, &mut r);
                    c.jacobian(&poses, &mut j);
                    let lambda = Vector3::from_fn(|k, _| if k < c.rows() { l[k] } else { 0.0 });
                    let mut g = Gradient::zeros();
                    g.fixed_rows_mut::<6>(0).copy_from(&(j.a.transpose() * lambda));
                    g.fixed_rows_mut::<6>(6).copy_from(&(j.b.transpose() * lambda));
                    let r = Vector3::from_fn(|k, _| if k < c.rows() { r[k] } else { 0.0 });
                    (c, r, g)
                };
                let change = ReferenceChange { twists, points: [dp; 2] };
                for i in 0..drawn(0.0).len() {
                    let c = at(0.0, i).0;
                    let (rows, gradient) = c.reference_derivative(&poses, l.as_slice(), &change);
                    let by_rows = difference(step, |h| at(h, i).1);
                    let by_gradient = difference(step, |h| at(h, i).2);
                    prop_assert!((rows - by_rows).norm() < 1e-6 * (1.0 + rows.norm()), "{c:?} {rows} {by_rows}");
                    prop_assert!((gradient - by_gradient).norm() < 1e-6 * (1.0 + gradient.norm()), "{c:?}");
                }
                // A joint's value refers to the first body alone.
                let change = ReferenceChange { twists: [twists[0]; 2], points: [dp; 2] };
                let value = |h: f64| {
                    let drawn = JointValue::new(kind, [0, 1], p + dp * h, &axis)?;
                    let rest = reference(&twists[0], h);
                    Some(drawn.carried([&rest; 2]))
                };
                let Some(here) = value(0.0) else { continue };
                let near = here.value(&poses, 0.0);
                let (slope, gradient) = here.reference_derivative(&poses, &change);
                let by_value = difference(step, |h| value(h).map_or(f64::NAN, |v| v.value(&poses, near)));
                let by_gradient = difference(step, |h| value(h).map_or(Gradient::zeros(), |v| v.gradient(&poses)));
                // Bodies tilted out of the joint's axis by a right angle have no value.
                let cosine = poses[0].direction(&axis).dot(&poses[1].direction(&axis)) / axis.norm_squared();
                prop_assume!(cosine.abs() > 0.3);
                prop_assert!((slope - by_value).abs() < 1e-6 * (1.0 + slope.abs()), "{kind:?} {slope} {by_value}");
                prop_assert!((gradient - by_gradient).norm() < 1e-6 * (1.0 + gradient.norm()), "{kind:?}");
            }
            // A string has a point in either body.
            let change = ReferenceChange { twists, points: [dp, l] };
            let pull = |h: f64| {
                let (point_a, point_b) = (p + dp * h, p + axis * 20.0 + l * h);
                let drawn = JointValue::Pull(Pull { a: 0, b: 1, point_a, point_b });
                drawn.carried([&reference(&twists[0], h), &reference(&twists[1], h)])
            };
            let (slope, gradient) = pull(0.0).reference_derivative(&poses, &change);
            let points = pull(0.0).gradient(&poses);
            prop_assume!(points.norm().is_finite());
            let by_value = difference(step, |h| pull(h).value(&poses, 0.0));
            let by_gradient = difference(step, |h| pull(h).gradient(&poses));
            prop_assert!((slope - by_value).abs() < 1e-6 * (1.0 + slope.abs()), "{slope} {by_value}");
            prop_assert!((gradient - by_gradient).norm() < 1e-6 * (1.0 + gradient.norm()), "{gradient} {by_gradient}");
        }
    }
}
