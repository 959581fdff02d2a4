//! Conventional joints as constraints on rigid poses, with exact first and second derivatives. Everything is a
//! point, a product of two directions or a distance along a direction carried by the bodies (see `forms.rs`).

use super::forms::{Along, Product, normals, rotated_arm, unit_or_z};
use crate::ir::JointKind;
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
    /// One row, dimensionless: the product of a direction of `a` with one of `b`.
    Perpendicular {
        /// First body.
        a: usize,
        /// Second body.
        b: usize,
        /// Unit direction carried by the first body.
        u_a: Vector3<f64>,
        /// Unit direction carried by the second body.
        v_b: Vector3<f64>,
    },
    /// Two rows, mm: how far a point of `b` lies off a line of `a`.
    OnLine {
        /// First body.
        a: usize,
        /// Second body.
        b: usize,
        /// Point of the line, carried by the first body, mm.
        point_a: Vector3<f64>,
        /// Two unit normals of the line, carried by the first body.
        normals_a: [Vector3<f64>; 2],
        /// Point carried by the second body, mm.
        point_b: Vector3<f64>,
    },
    /// One row that is always met and keeps an increment from turning the body about an axis of its own: the gauge
    /// of an idle freedom. No function of the poses has it as its derivative everywhere; that is not needed.
    Gauge {
        /// The body.
        body: usize,
        /// Unit axis carried by the body.
        axis: Vector3<f64>,
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

impl Jacobian {
    fn set_row(&mut self, row: usize, gradient: &Gradient) {
        self.a.row_mut(row).tr_copy_from(&gradient.fixed_rows::<6>(0));
        self.b.row_mut(row).tr_copy_from(&gradient.fixed_rows::<6>(6));
    }
}

impl Constraint {
    /// Largest number of rows of any constraint.
    pub const MAX_ROWS: usize = 3;

    /// The two constraints of a hinge at `point` (mm) about `axis`, both in reference coordinates.
    pub fn hinge(a: usize, b: usize, point: Vector3<f64>, axis: &Vector3<f64>) -> [Self; 2] {
        let axis_b = unit_or_z(axis);
        [Self::Coincident { a, b, point_a: point, point_b: point }, Self::parallel(a, b, axis_b)]
    }

    /// The constraints of a joint between two bodies, drawn in the reference pose: `point` (mm), `axis`, and for a
    /// universal joint `second`, the axis carried by `b`.
    pub fn of_joint(
        kind: JointKind,
        [a, b]: [usize; 2],
        point: Vector3<f64>,
        axis: &Vector3<f64>,
        second: Option<&Vector3<f64>>,
    ) -> Vec<Self> {
        let unit = unit_or_z(axis);
        let (n, m) = normals(&unit);
        let coincident = Self::Coincident { a, b, point_a: point, point_b: point };
        let on_line = Self::OnLine { a, b, point_a: point, normals_a: [n, m], point_b: point };
        let unturned = [Self::parallel(a, b, unit), Self::Perpendicular { a, b, u_a: n, v_b: m }];
        match kind {
            JointKind::Hinge => Self::hinge(a, b, point, axis).into(),
            JointKind::Ball => vec![coincident],
            JointKind::Universal => {
                let v_b = second.map_or(n, |s| unit_or_z(&(s - unit * s.dot(&unit))));
                vec![coincident, Self::Perpendicular { a, b, u_a: unit, v_b }]
            }
            JointKind::Slider => std::iter::once(on_line).chain(unturned).collect(),
            JointKind::Cylindrical => vec![on_line, Self::parallel(a, b, unit)],
            JointKind::Fixed => std::iter::once(coincident).chain(unturned).collect(),
        }
    }

    fn parallel(a: usize, b: usize, axis_b: Vector3<f64>) -> Self {
        let (n, m) = normals(&axis_b);
        Self::Parallel { a, b, normals_a: [n, m], axis_b }
    }

    /// Number of scalar equations.
    pub fn rows(&self) -> usize {
        match self {
            Self::Coincident { .. } => 3,
            Self::Parallel { .. } | Self::OnLine { .. } => 2,
            Self::Perpendicular { .. } | Self::Gauge { .. } => 1,
        }
    }

    /// The two bodies; of a gauge twice the one, whose second half of every derivative is zero.
    pub fn bodies(&self) -> [usize; 2] {
        match *self {
            Self::Coincident { a, b, .. }
            | Self::Parallel { a, b, .. }
            | Self::Perpendicular { a, b, .. }
            | Self::OnLine { a, b, .. } => [a, b],
            Self::Gauge { body, .. } => [body, body],
        }
    }

    /// Whether the rows are lengths (mm) and not products of directions.
    pub fn is_length(&self) -> bool {
        matches!(self, Self::Coincident { .. } | Self::OnLine { .. })
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
            Self::Perpendicular { a, b, u_a, v_b } => {
                out[0] = poses[*a].direction(u_a).dot(&poses[*b].direction(v_b));
            }
            Self::OnLine { a, b, point_a, normals_a, point_b } => {
                for (row, n) in out.iter_mut().zip(normals_a) {
                    *row = Along::at([&poses[*a], &poses[*b]], [point_a, point_b], n).value();
                }
            }
            Self::Gauge { .. } => out[0] = 0.0,
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
            Self::Perpendicular { a, b, u_a, v_b } => {
                let product = Product { u: poses[*a].direction(u_a), v: poses[*b].direction(v_b) };
                out.set_row(0, &product.gradient());
            }
            Self::OnLine { a, b, point_a, normals_a, point_b } => {
                for (row, n) in normals_a.iter().enumerate() {
                    let along = Along::at([&poses[*a], &poses[*b]], [point_a, point_b], n);
                    out.set_row(row, &along.gradient());
                }
            }
            Self::Gauge { body, axis } => {
                out.a.fixed_view_mut::<1, 3>(0, 3).tr_copy_from(&poses[*body].direction(axis));
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
            Self::Perpendicular { a, b, u_a, v_b } => {
                let product = Product { u: poses[*a].direction(u_a), v: poses[*b].direction(v_b) };
                h += product.hessian() * lambda[0];
            }
            Self::OnLine { a, b, point_a, normals_a, point_b } => {
                for (n, l) in normals_a.iter().zip(lambda) {
                    h += Along::at([&poses[*a], &poses[*b]], [point_a, point_b], n).hessian() * *l;
                }
            }
            Self::Gauge { .. } => {}
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
            Self::OnLine { a, b, normals_a, .. } => {
                let da = poses[*a].rotation * (change.point_a - change.center_a);
                let db = poses[*b].rotation * (change.point_b - change.center_b);
                let way = change.center_b + db - change.center_a;
                let mut rows = Vector3::zeros();
                for ((row, n), l) in rows.iter_mut().zip(normals_a).zip(lambda) {
                    let w = poses[*a].direction(n);
                    *row = w.dot(&(way - da));
                    // w and the own arm turn together: their product does not change.
                    let mut by_a = by_increments.fixed_rows_mut::<3>(3);
                    by_a += w.cross(&way) * *l;
                    let mut by_b = by_increments.fixed_rows_mut::<3>(9);
                    by_b += db.cross(&w) * *l;
                }
                (rows, by_increments)
            }
            // Axes are numbers in the design: nothing to move.
            Self::Parallel { .. } | Self::Perpendicular { .. } | Self::Gauge { .. } => {
                (Vector3::zeros(), by_increments)
            }
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
