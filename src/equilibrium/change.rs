//! How the layout moves with the free variables of the geometry: joint points, rest drive values, traces. Everything a
//! body carries moves with its rest pose; drawn points move besides.

use super::design_load::{LayoutLoad, LayoutLoadKind};
use super::frames::{Aim, Framed, Seen, axes, axis_carrier};
use super::layout::Layout;
use super::load::{PointForce, PointForceChange};
use super::target::as_curve;
use super::weight;
use crate::ir::expr::Evaluated;
use crate::ir::{BodyId, Design, ExprPoint, JointId, Load, LoadKind, TargetOf};
use crate::kinematics::{Constraint, Motion, MotionChange, ReferenceChange, Twist, motion_changes};
use crate::math::dual::Dual;
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
    /// Per load, of its forces of size one: of gravity one a link, of a moment none.
    pub loads: Vec<Vec<PointForceChange>>,
    /// Per trace.
    pub traces: Vec<TraceChange>,
    /// Per traced direction.
    pub directions: Vec<DirectionChange>,
}

/// Derivatives of a [`super::RodEndFrame`].
#[derive(Clone, Copy, Debug)]
pub struct EndFrameChange {
    /// Of the joint's point, mm.
    pub origin: Vector3<f64>,
    /// Of the columns e1, e2, e3.
    pub axes: Matrix3<f64>,
}

/// Derivatives of a `LayoutDrive`.
#[derive(Clone, Copy, Debug)]
pub struct DriveChange {
    /// Of the drive value of the rest pose, rad or mm.
    pub rest: f64,
    /// Of what its value refers to.
    pub reference: ReferenceChange,
}

/// Derivatives of a [`super::LayoutTrace`].
#[derive(Clone, Debug)]
pub struct TraceChange {
    /// Of the position in the rest pose, mm.
    pub rest: Vector3<f64>,
    /// Of the target at every state, mm; zero where the text gives it.
    pub target: Vec<Vector3<f64>>,
    /// Of the corners of the target as a curve, mm.
    pub curve: Vec<Vector3<f64>>,
    /// Of the conventional mechanism's own path at every state, mm.
    pub path: Vec<Vector3<f64>>,
}

/// Derivatives of a [`super::LayoutDirection`].
#[derive(Clone, Debug)]
pub struct DirectionChange {
    /// Of the direction in the rest pose.
    pub rest: Vector3<f64>,
    /// Of the target at every state; zero where the text gives it.
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
        let aims = &self.design.aims;
        let traces = self.layout.traces.iter().enumerate().map(|(i, t)| {
            let path = self.change.paths[i].clone();
            let own = aims.target_of(TargetOf::Trace(i)).is_some();
            let still = |n: usize| vec![Vector3::zeros(); n];
            TraceChange {
                rest: self.at_rest(t.body, &t.rest, &self.change.trace_points[i]),
                target: if own { still(path.len()) } else { path.clone() },
                curve: if own { still(t.curve.len()) } else { as_curve(&path, self.layout.closed) },
                path,
            }
        });
        let directions = self.layout.directions.iter().enumerate().map(|(i, d)| {
            let own = aims.target_of(TargetOf::Direction(i)).is_some();
            let path = &self.change.directions[i];
            DirectionChange {
                rest: self.change.rest[d.body].turn.cross(&d.rest),
                target: if own { vec![Vector3::zeros(); path.len()] } else { path.clone() },
            }
        });
        LayoutChange {
            parameter: self.change.parameter,
            rod_ends,
            constraints,
            drives,
            loads: self.loads(),
            traces: traces.collect(),
            directions: directions.collect(),
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

    /// Derivative of a point as drawn.
    fn drawn(&self, point: &ExprPoint) -> Vector3<f64> {
        let by = |id| self.values.gradient(id).get(self.change.parameter).copied().unwrap_or(0.0);
        Vector3::from(point.map(by))
    }

    fn loads(&self) -> Vec<Vec<PointForceChange>> {
        let height_mm = self.design.layers.height_mm;
        let of = |(text, laid): (&Load, &LayoutLoad)| match (&text.kind, &laid.kind) {
            (LoadKind::Force { point, .. }, LayoutLoadKind::Force(force)) => vec![PointForceChange {
                rest: self.at_rest(force.body, &force.rest, &self.drawn(point)),
                force_n: Vector3::zeros(),
            }],
            (_, LayoutLoadKind::Gravity { specific_n_mm3, links }) => {
                let link = |force: &PointForce| {
                    let body = &self.design.bodies[force.body];
                    let skeleton = &body.skeleton;
                    let at: Vec<_> = skeleton.iter().map(|p| self.values.point(p.position)).collect();
                    let rates: Vec<_> = skeleton.iter().map(|p| self.drawn(&p.position)).collect();
                    let pose = (&self.layout.rest_poses[force.body], &self.change.rest[force.body]);
                    weight::link_change(body, &at, &rates, height_mm, pose, specific_n_mm3)
                };
                links.iter().map(link).collect()
            }
            _ => Vec::new(),
        };
        self.design.loads.iter().zip(&self.layout.loads).map(of).collect()
    }

    fn end_frame(&self, rod: usize, end: usize) -> EndFrameChange {
        let text = &self.design.rods[rod];
        let (joint, framed) = (&self.design.joints[text.joint], Framed::of(self.design, text, end));
        let rest = &self.layout.rest_poses;
        let carried = |body: BodyId, axis: [f64; 3]| {
            let axis = rest[body].direction(&Vector3::from(axis));
            along(&axis, &self.change.rest[body].turn.cross(&axis))
        };
        let second = joint.bodies.get(1).copied().unwrap_or(framed.body);
        let seen = Seen {
            axis: carried(axis_carrier(joint, framed.body), joint.axis),
            second: carried(second, joint.second_axis.unwrap_or(joint.axis)),
            way: self.way(text.joint, framed.body),
            other: framed.other.map(|b| self.way(text.joint, b)),
            leads: framed.leads,
        };
        let columns = axes(joint, text, &seen).map(|e| Vector3::from(e.map(|x| x.eps[0])));
        let origin = &self.layout.rod_ends[rod][end].origin;
        EndFrameChange {
            origin: self.at_rest(framed.body, origin, &self.change.joint_points[text.joint]),
            axes: Matrix3::from_columns(&columns),
        }
    }

    /// From a joint to what a body aims at there, with its rate.
    fn way(&self, joint: JointId, body: BodyId) -> [Dual<1>; 3] {
        let aim = Aim::of(self.design, joint, body);
        let drawn = aim.drawn(self.values, &self.motion.joint_points);
        let by_drawn = match aim {
            Aim::Point(q) => self.drawn(&q),
            Aim::Joints(all) => {
                let sum: Vector3<f64> = all.iter().map(|k| self.change.joint_points[*k]).sum();
                sum / all.len().max(1) as f64
            }
        };
        let pose = &self.layout.rest_poses[body];
        let (here, there) = (pose.point(&self.motion.joint_points[joint]), pose.point(&drawn));
        let rate = self.at_rest(body, &there, &by_drawn)
            - self.at_rest(body, &here, &self.change.joint_points[joint]);
        along(&(there - here), &rate)
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
        let change = &self.change;
        let own = self.design.drives.iter().zip(&self.layout.drives).zip(&change.rest_drives);
        let own = own.zip(&change.string_points);
        own.map(|(((drive, laid), rest), strings)| {
            let [first, second] = laid.joint.bodies();
            let reference = match drive.joint() {
                Some(joint) => {
                    let point = self.carried(first, &self.change.joint_points[joint]);
                    ReferenceChange { twists: [self.change.rest[first]; 2], points: [point; 2] }
                }
                None => {
                    let [a, b] = strings;
                    ReferenceChange {
                        twists: [first, second].map(|b| self.change.rest[b]),
                        points: [self.carried(first, a), self.carried(second, b)],
                    }
                }
            };
            DriveChange { rest: *rest, reference }
        })
        .collect()
    }
}

/// A vector with its rate.
fn along(x: &Vector3<f64>, rate: &Vector3<f64>) -> [Dual<1>; 3] {
    std::array::from_fn(|i| Dual { re: x[i], eps: [rate[i]] })
}
