//! Idle freedoms: a body whose joint points lie on one line (a rod between two balls) may turn about it, and nothing
//! else moves. They are found by rank: which combinations of such turns violate no constraint and no drive.

use super::constraint::Constraint;
use super::linear::{RANK_TOLERANCE, Rows, moved};
use super::mechanism::Mechanism;
use super::path::correct;
use crate::ir::expr::Evaluated;
use crate::ir::{BodyId, Design};
use crate::math::{Pose, skew};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Points this near to a line, in lengths L, lie on it. Drawn points are exact to 1e-14 of that.
const ON_LINE: f64 = 1e-9;
/// Bodies with a smaller share in an idle freedom (of unit length) take no part in it.
const TAKES_PART: f64 = 1e-6;
/// Sine of the turn left to an idle body in the rest pose.
const UNTURNED: f64 = 1e-13;
/// Newton iterations for that; three to five are usual.
const UNTURNING: usize = 20;

/// One idle freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Idle {
    /// The body whose turn is held as its gauge.
    pub body: BodyId,
    /// The line of the turn: unit direction as drawn.
    pub axis: Vector3<f64>,
    /// All bodies that take part.
    pub bodies: Vec<BodyId>,
}

impl Idle {
    /// Whether no flexure holds any of its bodies.
    pub fn is_conventional(&self, design: &Design) -> bool {
        let part = |b: &BodyId| self.bodies.contains(b);
        !design.joints.iter().any(|j| j.is_compliant() && j.bodies.iter().any(part))
    }

    /// Its gauge for poses in whose reference pose the body's axis is `axis`.
    pub fn gauge(&self, axis: Vector3<f64>) -> Constraint {
        Constraint::Gauge { body: self.body, axis }
    }
}

/// Idle freedoms of a mechanism as drawn (which must have none set yet).
pub(super) fn find(mechanism: &Mechanism) -> Vec<Idle> {
    let lines: Vec<(BodyId, Vector3<f64>)> = (0..mechanism.design.bodies.len())
        .filter(|b| mechanism.column[*b].is_some())
        .filter_map(|b| Some((b, line(mechanism, b)?)))
        .collect();
    let turns: Vec<DVector<f64>> = lines.iter().map(|(b, d)| turn(mechanism, *b, d)).collect();
    if turns.is_empty() {
        return Vec::new();
    }
    let drive: Vec<f64> = mechanism.drives.iter().map(|d| d.value(&mechanism.drawing, 0.0)).collect();
    let mut violation = Rows::at(mechanism, &mechanism.drawing, &drive).times(&turns);
    if violation.nrows() < violation.ncols() {
        violation = violation.insert_rows(0, turns.len(), 0.0);
    }
    let svd = violation.svd(false, true);
    let Some(v_t) = svd.v_t else { return Vec::new() };
    let zero = (0..turns.len()).filter(|i| svd.singular_values[*i] <= RANK_TOLERANCE);
    let basis: Vec<DVector<f64>> = zero.map(|i| v_t.row(i).transpose()).collect();
    pivots(DMatrix::from_fn(basis.len(), turns.len(), |i, j| basis[i][j]))
        .into_iter()
        .map(|(pivot, members)| Idle {
            body: lines[pivot].0,
            axis: lines[pivot].1,
            bodies: members.into_iter().map(|m| lines[m].0).collect(),
        })
        .collect()
}

/// Direction of the line through all joint points and traces of a body, if there is one and nothing else that is asked
/// for turns with the body about it.
fn line(mechanism: &Mechanism, body: BodyId) -> Option<Vector3<f64>> {
    let design = mechanism.design;
    let own = design.joints.iter().zip(&mechanism.joint_points).filter(|(j, _)| j.bodies.contains(&body));
    let joints: Vec<&Vector3<f64>> = own.map(|(_, p)| p).collect();
    let start = *joints.first()?;
    let far = joints.iter().map(|p| *p - start).max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    let direction = far.try_normalize(ON_LINE * mechanism.length)?;
    let traced = mechanism.traces.iter().filter(|t| t.0 == body).map(|t| &t.1);
    let off = joints.into_iter().chain(traced).map(|p| direction.cross(&(p - start)).norm());
    let aims = &design.aims;
    let turns = |d: &crate::ir::Direction| direction.cross(&Vector3::from(d.direction)).norm() > ON_LINE;
    if aims.angles.iter().any(|a| a.body == body)
        || aims.directions.iter().any(|d| d.body == body && turns(d))
    {
        return None;
    }
    (off.fold(0.0, f64::max) <= ON_LINE * mechanism.length).then_some(direction)
}

/// Derivatives of [`line`] by the free variables, one a variable.
pub(super) fn line_derivative(
    mechanism: &Mechanism,
    body: BodyId,
    values: &Evaluated,
) -> Option<Vec<Vector3<f64>>> {
    let design = mechanism.design;
    let own: Vec<usize> =
        (0..design.joints.len()).filter(|j| design.joints[*j].bodies.contains(&body)).collect();
    let start = *own.first()?;
    let at = |j: usize| mechanism.joint_points[j] - mechanism.joint_points[start];
    let far = own.into_iter().max_by(|a, b| at(*a).norm().total_cmp(&at(*b).norm()))?;
    let direction = at(far).try_normalize(0.0)?;
    let point = |j: usize, i: usize| {
        Vector3::from(design.joints[j].point.map(|id| values.gradient(id).get(i).copied().unwrap_or(0.0)))
    };
    let by = |i: usize| {
        let d = point(far, i) - point(start, i);
        (d - direction * direction.dot(&d)) / at(far).norm()
    };
    Some((0..design.free.len()).map(by).collect())
}

/// How far a body has turned about the line it had in the drawing, as a sine: the turn is this vector times the line's
/// direction. Zero where the rotation only takes the line from one direction to the other.
pub(super) fn turn_direction(rotation: &Matrix3<f64>) -> Vector3<f64> {
    let odd = (rotation - rotation.transpose()) * 0.5;
    Vector3::new(odd[(2, 1)], odd[(0, 2)], odd[(1, 0)])
}

/// Derivative of `turn_direction · axis` by a further turn dφ.
pub(super) fn turn_slope(rotation: &Matrix3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
    let by = |unit: Vector3<f64>| turn_direction(&(skew(&unit) * rotation)).dot(axis);
    Vector3::new(by(Vector3::x()), by(Vector3::y()), by(Vector3::z()))
}

/// Turns idle bodies back about their lines. Following the drives leaves them turned by whatever the way added up to;
/// so the pose depends on the drives' values alone, and smoothly on the drawing.
pub(super) fn unturn(mechanism: &Mechanism, poses: &[Pose], drive: &[f64]) -> Option<Vec<Pose>> {
    let mut poses = poses.to_vec();
    for _ in 0..UNTURNING {
        let rows = Rows::at(mechanism, &poses, drive);
        let factor = rows.factor()?;
        let turned = |i: &Idle| turn_direction(&poses[i.body].rotation).dot(&i.axis);
        if mechanism.idle.iter().all(|i| turned(i).abs() < UNTURNED) {
            return Some(poses);
        }
        let mut step = DVector::zeros(mechanism.unknowns());
        for (k, idle) in mechanism.idle.iter().enumerate() {
            let motion = rows.idle_motion(&factor, k);
            let first = mechanism.column.get(idle.body).copied().flatten()? + 3;
            let slope = turn_slope(&poses[idle.body].rotation, &idle.axis);
            let rate: f64 = (0..3).map(|c| slope[c] * motion[first + c]).sum();
            step.axpy(-turned(idle) / rate, &motion, 1.0);
        }
        poses = correct(mechanism, &moved(mechanism, &poses, &step), drive)?.poses;
    }
    None
}

/// Scaled motion of a body that turns about its line. Its centre lies on the line.
fn turn(mechanism: &Mechanism, body: BodyId, direction: &Vector3<f64>) -> DVector<f64> {
    let mut out = DVector::zeros(mechanism.unknowns());
    if let Some(first) = mechanism.column[body] {
        out.fixed_rows_mut::<3>(first + 3).copy_from(direction);
    }
    out
}

/// A column for each row of a basis, by elimination with full pivoting, and the columns with a share in that row.
fn pivots(mut basis: DMatrix<f64>) -> Vec<(usize, Vec<usize>)> {
    let mut found: Vec<usize> = Vec::new();
    for done in 0..basis.nrows() {
        let mut best = (done, 0, 0.0);
        for j in 0..basis.ncols() {
            for i in done..basis.nrows() {
                if basis[(i, j)].abs() > best.2 {
                    best = (i, j, basis[(i, j)].abs());
                }
            }
        }
        let (row, column, _) = best;
        basis.swap_rows(done, row);
        for i in 0..basis.nrows() {
            if i != done && basis[(done, column)] != 0.0 {
                let factor = basis[(i, column)] / basis[(done, column)];
                for j in 0..basis.ncols() {
                    basis[(i, j)] -= factor * basis[(done, j)];
                }
            }
        }
        found.push(column);
    }
    let members = |i: usize| -> Vec<usize> {
        let least = TAKES_PART * basis.row(i).norm();
        (0..basis.ncols()).filter(|j| basis[(i, *j)].abs() > least).collect()
    };
    let mut out: Vec<(usize, Vec<usize>)> =
        found.iter().enumerate().map(|(i, column)| (*column, members(i))).collect();
    out.sort();
    out
}
