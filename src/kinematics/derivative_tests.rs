//! Derivatives of constraints and joint values against differences, and what each kind of joint allows.

use super::constraint::{Constraint, GeometryChange, Gradient, Hessian, Jacobian};
use super::pull::Pull;
use super::value::{HingeAngle, JointValue};
use crate::ir::JointKind;
use crate::math::Pose;
use nalgebra::Vector3;
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
        for kind in JointKind::ALL {
            for c in Constraint::of_joint(kind, [0, 1], p, &axis, Some(&q)) {
                check_constraint(&c, &at, l.as_slice());
            }
        }
        let c = Constraint::Coincident { a: 0, b: 1, point_a: p, point_b: q };
        check_constraint(&c, &at, l.as_slice());
        let n = axis.cross(&q);
        prop_assume!(n.norm() > 0.1);
        let normals_a = [n.normalize(), axis.cross(&n).normalize()];
        let c = Constraint::OnLine { a: 0, b: 1, point_a: p, normals_a, point_b: q };
        check_constraint(&c, &at, l.as_slice());
    }

    #[test]
    fn shift_matches_differences(at in poses(), p in vector(20.0), axis in vector(1.0)) {
        prop_assume!(axis.norm() > 0.1);
        let Some(value) = JointValue::new(JointKind::Slider, [0, 1], p, &axis) else {
            return Err(TestCaseError::fail("a slider has a value"));
        };
        check(|q| value.value(q, 0.0), &at, &value.gradient(&at), &value.hessian(&at));
    }

    /// Every joint of a pair that moved as it allows is met, and the value says how far.
    #[test]
    fn joints_allow_what_they_should(phi in vector(1.0), axis in vector(1.0), second in vector(1.0), p in vector(30.0),
                                     turn in -1.5..1.5_f64, tilt in -1.5..1.5_f64, way in -9.0..9.0_f64) {
        prop_assume!(axis.norm() > 0.1 && axis.normalize().cross(&second).norm() > 0.1);
        let axis = axis.normalize();
        let second = (second - axis * axis.dot(&second)).normalize();
        let base = Pose::rest(Vector3::new(1.0, 2.0, 3.0)).retract(&p, &phi);
        for kind in JointKind::ALL {
            let about = |v: &Vector3<f64>, a: f64| crate::math::exp_so3(&(v * a));
            let (rotation, along) = match kind {
                JointKind::Hinge => (about(&axis, turn), 0.0),
                JointKind::Ball => (about(&axis, turn) * about(&Vector3::x(), tilt), 0.0),
                JointKind::Universal => (about(&axis, turn) * about(&second, tilt), 0.0),
                JointKind::Slider => (about(&axis, 0.0), way),
                JointKind::Cylindrical => (about(&axis, turn), way),
                JointKind::Fixed => (about(&axis, 0.0), 0.0),
            };
            let mut b = Pose::rest(p);
            b.rotation = base.rotation * rotation;
            b.translation = base.point(&p) + base.direction(&axis) * along - p;
            let poses = [base, b];
            let mut rows = 0;
            for c in Constraint::of_joint(kind, [0, 1], p, &axis, Some(&second)) {
                let mut r = [0.0; 3];
                c.residual(&poses, &mut r);
                prop_assert!(r.iter().take(c.rows()).all(|x| x.abs() < 1e-12), "{kind:?} {c:?} {r:?}");
                rows += c.rows();
            }
            let freedoms = match kind {
                JointKind::Hinge | JointKind::Slider => 1,
                JointKind::Universal | JointKind::Cylindrical => 2,
                JointKind::Ball => 3,
                JointKind::Fixed => 0,
            };
            prop_assert_eq!(rows, 6 - freedoms);
            if let Some(value) = JointValue::new(kind, [0, 1], p, &axis) {
                let want = if kind == JointKind::Slider { way } else { turn };
                prop_assert!((value.value(&poses, want) - want).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn pull_matches_differences(at in poses(), p in vector(40.0), q in vector(40.0)) {
        let pull = Pull { a: 0, b: 1, point_a: p, point_b: q };
        // Differences of a length are off by the sixth power of arm over length.
        prop_assume!((at[0].point(&p) - at[1].point(&q)).norm() > 40.0);
        check(|poses| pull.value(poses), &at, &pull.gradient(&at), &pull.hessian(&at));
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
    fn design_derivative_matches_differences(at in poses(), p in vector(20.0), q in vector(20.0), line in any::<bool>(),
                                             l in vector(3.0), d in prop::array::uniform4(vector(1.0))) {
        let [point_a, point_b, center_a, center_b] = d;
        let change = GeometryChange { point_a, point_b, center_a, center_b };
        let shifted = |h: f64| {
            let mut poses = at.clone();
            poses[0].center += center_a * h;
            poses[1].center += center_b * h;
            let (point_a, point_b) = (p + point_a * h, q + point_b * h);
            let c = if line {
                let normals_a = [Vector3::x(), Vector3::y()];
                Constraint::OnLine { a: 0, b: 1, point_a, normals_a, point_b }
            } else {
                Constraint::Coincident { a: 0, b: 1, point_a, point_b }
            };
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
