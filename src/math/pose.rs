//! Rotations and rigid poses.

use nalgebra::{Matrix3, Vector3};

/// Cross-product matrix: `skew(v) * w == v.cross(&w)`.
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Rotation matrix of a rotation vector (Rodrigues), rad.
pub fn exp_so3(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle2 = phi.norm_squared();
    let k = skew(phi);
    // Below 1e-8 rad² the series to third order is exact to rounding.
    let (s, c) = if angle2 < 1e-8 {
        (1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0)
    } else {
        let angle = angle2.sqrt();
        (angle.sin() / angle, (1.0 - angle.cos()) / angle2)
    };
    Matrix3::identity() + k * s + k * k * c
}

/// Rotation vector of a rotation matrix, rad, of length at most π.
pub fn log_so3(r: &Matrix3<f64>) -> Vector3<f64> {
    let q = nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(*r));
    q.scaled_axis()
}

/// A rigid motion away from the rest pose: x = centre + translation + rotation (X − centre), where the
/// centre is a fixed point of the body in rest coordinates. Increments (du, dφ) act as
/// translation += du, rotation ← exp(dφ) rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation matrix.
    pub rotation: Matrix3<f64>,
    /// Displacement of the centre, mm.
    pub translation: Vector3<f64>,
    /// Centre in rest coordinates, mm.
    pub center: Vector3<f64>,
}

impl Pose {
    /// The rest pose of a body with this centre.
    pub fn rest(center: Vector3<f64>) -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros(), center }
    }

    /// Present position of a point given in rest coordinates, mm.
    pub fn point(&self, rest: &Vector3<f64>) -> Vector3<f64> {
        self.center + self.translation + self.rotation * (rest - self.center)
    }

    /// Present vector from the (moved) centre to a point given in rest coordinates, mm.
    pub fn arm(&self, rest: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * (rest - self.center)
    }

    /// Present direction of a direction given in rest coordinates.
    pub fn direction(&self, rest: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * rest
    }

    /// Rest position of a point given where it is now, mm.
    pub fn back(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.center + self.rotation.transpose() * (point - self.center - self.translation)
    }

    /// Applies an increment: translation (mm), rotation vector (rad).
    pub fn retract(&self, du: &Vector3<f64>, dphi: &Vector3<f64>) -> Self {
        Self {
            rotation: exp_so3(dphi) * self.rotation,
            translation: self.translation + du,
            center: self.center,
        }
    }
}
