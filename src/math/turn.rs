//! How far a rotation turns about an axis.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// The part of a rotation that turns about the unit vector `axis`, rad, up to whole turns: r = swing · twist, where
/// the swing's own axis is normal to `axis`. For a rotation about `axis` itself it is the angle.
pub fn twist_about(r: &Matrix3<f64>, axis: &Vector3<f64>) -> f64 {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*r));
    2.0 * q.imag().dot(axis).atan2(q.w)
}

/// The angle that differs from `angle` by whole turns and lies within half a turn of `near`, rad.
pub fn nearest_turn(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp_so3;

    #[test]
    fn a_turn_about_the_axis_is_its_angle() {
        let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
        for degrees in [-720.0, -181.0, -180.0, -30.0, 0.0, 1e-6, 90.0, 179.9, 200.0, 560.0_f64] {
            let angle = degrees.to_radians();
            let found = nearest_turn(twist_about(&exp_so3(&(axis * angle)), &axis), angle);
            assert!((found - angle).abs() < 1e-12 * angle.abs().max(1.0), "{degrees}: {found}");
        }
    }

    #[test]
    fn a_swing_turns_nothing() {
        let axis = Vector3::z();
        let swing = exp_so3(&Vector3::new(0.4, -0.9, 0.0));
        assert!(twist_about(&swing, &axis).abs() < 1e-15);
        let both = swing * exp_so3(&(axis * 0.7));
        assert!((twist_about(&both, &axis) - 0.7).abs() < 1e-14);
    }
}
