//! How the layout moves with the free variables of the geometry: joint points, rest drive values, traces. Everything a
//! body carries moves with its rest pose; drawn points move besides.

use super::layout::{Aim, Layout};
use crate::ir::expr::Evaluated;
use crate::ir::{BodyId, Design, ExprPoint};
use crate::kinematics::{Constraint, Motion, MotionChange, ReferenceChange, Twist, motion_changes};
use nalgebra::{Matrix3, Matrix3xX, Vector3};

/// Derivatives of a [`Layout`] by one free variable, per unit of it.
#[derive(Clone, Debug)]
pub struct LayoutChange {
    /// Index of the free variable.
    pub parameter: usize,
    /// Motion of what each body carries, in rest world coordinates.
    pub bodies: Vec<Twist>,
    /// Of both end frames of each rod.
    pub rod_ends: Vec<[EndFrameChange; 2]>,
    /// Per constraint.
    pub constraints: Vec<ReferenceChange>,
    /// Per drive.
    pub drives: Vec<DriveChange>,
    /// Per trace.
    pub traces: Vec<TraceChange>,
}

/// Derivatives of a [`super::RodEndFrame`].
#[derive(Clone, Copy, Debug)]
pub struct EndFrameChange {
    /// Of the joint's point, mm.
    pub origin: Vector3<f64>,
    /// Of the columns e1, e2, e3.
    pub axes: Matrix3<f64>,
}

/// Derivatives of a [`super::layout::LayoutDrive`].
#[derive(Clone, Copy, Debug)]
pub struct DriveChange {
    /// Of the drive value of the rest pose, rad or mm.
    pub rest: f64,
    /// Of what its value refers to.
    pub reference: ReferenceChange,
}

/// Derivatives of a [`super::layout::LayoutTrace`].
#[derive(Clone, Debug)]
pub struct TraceChange {
    /// Of the position in the rest pose, mm.
    pub rest: Vector3<f64>,
    /// Of the target at every state, mm.
    pub target: Vec<Vector3<f64>>,
}

impl Layout {
    /// A point of a body, given as drawn: its place in the rest pose, mm, and the derivatives of that by the n free
    /// variables, 3 × n. None at a dead point of the conventional motion.
    pub fn rest_point(
        &self,
        values: &Evaluated,
        n: usize,
        body: BodyId,
        drawn: ExprPoint,
    ) -> Option<(Vector3<f64>, Matrix3xX<f64>)> {
        let pose = &self.rest_poses[body];
        let at = pose.point(&values.point(drawn));
        let gradients = drawn.map(|id| values.gradient(id));
        let drawn = Matrix3xX::from_fn(n, |c, i| gradients[c].get(i).copied().unwrap_or(0.0));
        let mut out = pose.rotation * drawn;
        for change in self.changes.as_ref()? {
            let mut column = out.column_mut(change.parameter);
            column += change.bodies[body].at(&at);
        }
        Some((at, out))
    }
}

/// Derivatives by every variable of [`Design::geometry_variables`]; none at a dead point of the conventional motion.
pub(super) fn layout_changes(
    layout: &Layout,
    design: &Design,
    motion: &Motion,
    p: &[f64],
) -> Option<Vec<LayoutChange>> {
    let changes = motion_changes(design, motion, p)?;
    let values = design.exprs.evaluate(p);
    Some(
        changes
            .into_iter()
            .map(|change| Making { layout, design, motion, values: &values, change }.make())
            .collect(),
    )
}

struct Making<'a> {
    layout: &'a Layout,
    design: &'a Design,
    motion: &'a Motion,
    values: &'a Evaluated,
    change: MotionChange,
}

impl Making<'_> {
    fn make(self) -> LayoutChange {
        let rod_ends = (0..self.design.rods.len()).map(|r| [0, 1].map(|k| self.end_frame(r, k))).collect();
        let (constraints, drives) = (self.constraints(), self.drives());
        let traces = self.layout.traces.iter().enumerate().map(|(i, t)| TraceChange {
            rest: self.at_rest(t.body, &t.rest, &self.change.trace_points[i]),
            target: self.change.paths[i].clone(),
        });
        LayoutChange {
            parameter: self.change.parameter,
            rod_ends,
            constraints,
            drives,
            traces: traces.collect(),
            bodies: self.change.rest,
        }
    }

    /// Derivative of a point at rest whose drawn place moves by `drawn`.
    fn at_rest(&self, body: BodyId, rest: &Vector3<f64>, drawn: &Vector3<f64>) -> Vector3<f64> {
        self.change.rest[body].at(rest) + self.carried(body, drawn)
    }

    fn carried(&self, body: BodyId, drawn: &Vector3<f64>) -> Vector3<f64> {
        self.layout.rest_poses[body].direction(drawn)
    }

    fn end_frame(&self, rod: usize, end: usize) -> EndFrameChange {
        let (frame, joint) = (&self.layout.rod_ends[rod][end], self.design.rods[rod].joint);
        let body = frame.body;
        let origin = self.at_rest(body, &frame.origin, &self.change.joint_points[joint]);
        let aim = Aim::of(self.design, joint, body);
        let drawn = aim.drawn(self.values, &self.motion.joint_points);
        let at = self.layout.rest_poses[body].point(&drawn);
        let by_drawn = match aim {
            Aim::Point(q) => {
                let by = |id| self.values.gradient(id).get(self.change.parameter).copied().unwrap_or(0.0);
                Vector3::from(q.map(by))
            }
            Aim::Joints(all) => {
                let sum: Vector3<f64> = all.iter().map(|k| self.change.joint_points[*k]).sum();
                sum / all.len().max(1) as f64
            }
        };
        let (e1, e3) = (frame.axes.column(0).into_owned(), frame.axes.column(2).into_owned());
        let (d, by_d) = (at - frame.origin, self.at_rest(body, &at, &by_drawn) - origin);
        let by_e3 = self.change.rest[body].turn.cross(&e3);
        let along = d.dot(&e3);
        let flat = d - e3 * along;
        let by_flat = by_d - by_e3 * along - e3 * (by_d.dot(&e3) + d.dot(&by_e3));
        let by_e1 = (by_flat - e1 * e1.dot(&by_flat)) / flat.norm();
        let by_e2 = by_e3.cross(&e1) + e3.cross(&by_e1);
        EndFrameChange { origin, axes: Matrix3::from_columns(&[by_e1, by_e2, by_e3]) }
    }

    /// In the order in which [`Layout::new`] makes them.
    fn constraints(&self) -> Vec<ReferenceChange> {
        let mut out = Vec::with_capacity(self.layout.constraints.len());
        for (joint, drawn) in self.design.joints.iter().zip(&self.change.joint_points) {
            if joint.is_compliant() {
                continue;
            }
            for bodies in joint.pairs() {
                let axis = Vector3::from(joint.axis);
                let made = Constraint::of_joint(joint.kind, bodies, Vector3::zeros(), &axis, None);
                let change = ReferenceChange {
                    twists: bodies.map(|b| self.change.rest[b]),
                    points: bodies.map(|b| self.carried(b, drawn)),
                };
                out.extend(made.iter().map(|_| change));
            }
        }
        // Gauges move with nothing.
        out.resize(self.layout.constraints.len(), ReferenceChange::default());
        out
    }

    fn drives(&self) -> Vec<DriveChange> {
        let own = self.design.drives.iter().zip(&self.layout.drives).zip(&self.change.rest_drives);
        own.map(|((drive, laid), rest)| {
            let first = laid.joint.bodies()[0];
            let point = self.carried(first, &self.change.joint_points[drive.joint]);
            let reference = ReferenceChange { twists: [self.change.rest[first]; 2], points: [point; 2] };
            DriveChange { rest: *rest, reference }
        })
        .collect()
    }
}
