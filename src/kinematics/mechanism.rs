//! The conventional mechanism of a design at given values of its free variables: bodies, joints, drives and traces
//! in drawing coordinates. Compliant joints count as the conventional joint they replace.

use super::constraint::Constraint;
use super::idle::{self, Idle};
use super::linear::elimination;
use super::pull::Pull;
use super::value::JointValue;
use crate::diagnostic::Diagnostic;
use crate::ir::{Design, Drive, DriveOn, DriveUnit, JointId, JointKind, LoadKind};
use crate::math::elimination::Elimination;
use crate::math::{Pose, nearest_turn, twist_about};
use nalgebra::Vector3;
use std::sync::Arc;

/// Sizes beyond which a file is taken for a mistake.
const MAX_MOVING_BODIES: usize = 2_000;
const MAX_DRIVE_RAD: f64 = 100.0 * std::f64::consts::TAU;
/// More steps of a cycle than elaboration allows.
const MAX_STEPS: usize = 1_000_000;
const MAX_DRIVE_MM: f64 = 10_000.0;
/// Bound of (states + steps of 0.2 rad) · (work of one elimination, the cube of the number of moving bodies where all hang
/// together). Jansen's leg has 3e4 and takes 6 ms, a hundred links that all hang together 6e7 and 30 s.
const MAX_WORK: f64 = 1e8;

/// A mechanism in its drawing pose. Scaled unknowns are (du / L, dφ) of every moving body.
#[derive(Clone, Debug)]
pub struct Mechanism<'d> {
    /// The design it was made from.
    pub design: &'d Design,
    /// Poses of all bodies as drawn; the centre of a body is the mean of its joint points.
    pub drawing: Vec<Pose>,
    /// Constraints with the joint each comes from.
    pub constraints: Vec<(Constraint, JointId)>,
    /// Value of every joint that has one, by [`JointId`].
    pub values: Vec<Option<JointValue>>,
    /// Value of what every drive moves.
    pub drives: Vec<JointValue>,
    /// Idle freedoms.
    pub idle: Vec<Idle>,
    /// Physical point of every joint as drawn: with its layer's offset along the stacking axis, mm.
    pub joint_points: Vec<Vector3<f64>>,
    /// Body and point as drawn of every trace, mm.
    pub traces: Vec<(usize, Vector3<f64>)>,
    /// Characteristic length L, mm: root mean square distance of the joint points from the centres of their bodies.
    pub length: f64,
    /// First scaled unknown of every body; none for ground and for bodies of flexures.
    pub(super) column: Vec<Option<usize>>,
    /// In which order bodies are eliminated.
    pub(super) order: Arc<Elimination>,
}

impl<'d> Mechanism<'d> {
    /// Builds the mechanism at the free variables `p`.
    ///
    /// # Errors
    /// Geometry that is not finite at `p`, drives of joints that have no value, or a design whose indices do not fit
    /// together.
    pub fn new(design: &'d Design, p: &[f64]) -> Result<Self, Vec<Diagnostic>> {
        consistent(design, p)?;
        let values = design.exprs.values(p);
        let point = |e: &crate::ir::ExprPoint| {
            let at =
                |i: usize| e.get(i).and_then(|id| values.get(id.0 as usize)).copied().unwrap_or(f64::NAN);
            Vector3::new(at(0), at(1), at(2))
        };
        let mut errors = Vec::new();
        let mut constraints = Vec::new();
        let mut joint_values = Vec::new();
        let mut joint_points = Vec::new();
        for (id, joint) in design.joints.iter().enumerate() {
            let axis = Vector3::from(joint.axis);
            let stacking = match joint.kind {
                JointKind::Hinge => axis,
                _ => Vector3::from(design.layers.axis),
            };
            let at = point(&joint.point) + stacking * (f64::from(joint.layer) * design.layers.pitch_mm);
            let finite = at.iter().chain(&axis).all(|x| x.is_finite()) && axis.norm() > 0.5;
            if !finite {
                errors.push(not_finite("joint", &joint.name, joint.origin));
            }
            let second = joint.second_axis.map(Vector3::from);
            for pair in joint.pairs() {
                let made = Constraint::of_joint(joint.kind, pair, at, &axis, second.as_ref());
                constraints.extend(made.into_iter().map(|c| (c, id)));
            }
            let first_pair = joint.pairs().next();
            joint_values.push(first_pair.and_then(|pair| JointValue::new(joint.kind, pair, at, &axis)));
            joint_points.push(at);
        }
        let mut drives = Vec::new();
        for drive in &design.drives {
            let driven = match drive.on {
                DriveOn::Joint(joint) => joint_values.get(joint).copied().flatten(),
                DriveOn::String(string) => design.strings.get(string).and_then(|c| {
                    let (point_a, point_b) = (point(&c.point), point(c.via.first()?));
                    let finite = point_a.iter().chain(&point_b).all(|x| x.is_finite());
                    finite.then_some(JointValue::Pull(Pull { a: c.from, b: c.to, point_a, point_b }))
                }),
            };
            match driven {
                Some(value) if value.unit() == drive.unit => drives.push(value),
                _ => errors.push(
                    Diagnostic::error("E0500", format!("`{}` cannot be driven so", drive.name), drive.origin)
                        .help("a drive turns a hinge (deg), moves a slider or pulls a string (mm)"),
                ),
            }
        }
        let mut traces = Vec::new();
        for trace in &design.traces {
            let at = point(&trace.point);
            if !at.iter().all(|x| x.is_finite()) {
                errors.push(not_finite("trace", &trace.name, trace.origin));
            }
            traces.push((trace.body, at));
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let mut column = Vec::new();
        let mut next = 0;
        for body in &design.bodies {
            let moves = !body.ground && body.owner.is_none();
            column.push(moves.then_some(next));
            next += if moves { 6 } else { 0 };
        }
        let (drawing, length) = centers(design, &joint_points, &traces);
        let values = joint_values;
        let idle = Vec::new();
        let order = Arc::new(Elimination::new(0, &[], &[]));
        let mut made = Self {
            design,
            drawing,
            constraints,
            values,
            drives,
            idle,
            joint_points,
            traces,
            length,
            column,
            order,
        };
        made.arrange();
        let work = made.order.work() * (design.cycle.steps as f64 + way(design));
        if work > MAX_WORK {
            let message = "the cycle has too many steps, or the drives go too far, for so many links";
            return Err(vec![Diagnostic::error("E0500", message, design.origin)]);
        }
        made.idle = idle::find(&made);
        Ok(made)
    }

    /// Says anew in which order bodies are eliminated, after constraints were added.
    pub(super) fn arrange(&mut self) {
        self.order = Arc::new(elimination(self));
    }

    /// What counts as one of a drive in scaled equations: 1 rad, or L for a sliding one, mm.
    pub(super) fn drive_scale(&self, drive: &JointValue) -> f64 {
        match drive.unit() {
            DriveUnit::Rad => 1.0,
            DriveUnit::Mm => self.length,
        }
    }

    /// Number of bodies that can move.
    pub fn moving_bodies(&self) -> usize {
        self.column.iter().flatten().count()
    }

    /// Number of scaled unknowns: six a moving body.
    pub fn unknowns(&self) -> usize {
        6 * self.moving_bodies()
    }

    /// Positions of all traces, mm.
    pub fn trace_points(&self, poses: &[Pose]) -> Vec<Vector3<f64>> {
        self.traces.iter().map(|(body, point)| poses[*body].point(point)).collect()
    }

    /// Puts the bodies that flexures bring along where the first body of their joint carries them.
    pub(super) fn carry(&self, poses: &mut [Pose]) {
        carry(self.design, poses);
    }

    /// Value of every joint, rad (on the branch nearest `near`) or mm; zero for joints without one. Then the angle of
    /// every body that is asked for, rad, nearest to `near` too.
    pub fn joint_values(&self, poses: &[Pose], near: &[f64]) -> Vec<f64> {
        let value = |(value, near): (&Option<JointValue>, &f64)| value.map_or(0.0, |v| v.value(poses, *near));
        let mut out: Vec<f64> = self.values.iter().zip(near).map(value).collect();
        let asked = self.design.aims.angles.iter().zip(near.iter().skip(self.values.len()));
        out.extend(asked.map(|(a, near)| {
            nearest_turn(twist_about(&poses[a.body].rotation, &Vector3::from(a.axis)), *near)
        }));
        out
    }

    /// Length of [`Self::joint_values`].
    pub(super) fn value_count(&self) -> usize {
        self.values.len() + self.design.aims.angles.len()
    }
}

/// Centres of all bodies (mean of their joint points; of a body without joints, of its traces) and the
/// characteristic length.
fn centers(
    design: &Design,
    joint_points: &[Vector3<f64>],
    traces: &[(usize, Vector3<f64>)],
) -> (Vec<Pose>, f64) {
    let mut square = 0.0;
    let mut count = 0;
    let mut poses = Vec::new();
    for (id, body) in design.bodies.iter().enumerate() {
        let own = |(joint, at): (&crate::ir::Joint, &Vector3<f64>)| joint.bodies.contains(&id).then_some(*at);
        let mut points: Vec<_> = design.joints.iter().zip(joint_points).filter_map(own).collect();
        if points.is_empty() {
            points.extend(traces.iter().filter(|t| t.0 == id).map(|t| t.1));
        }
        let center = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        if !body.ground && body.owner.is_none() {
            square += points.iter().map(|p| (p - center).norm_squared()).sum::<f64>();
            count += points.len();
        }
        poses.push(Pose::rest(center));
    }
    carry(design, &mut poses);
    let length = (square / count.max(1) as f64).sqrt();
    (poses, if length > 0.0 { length } else { 1.0 })
}

fn carry(design: &Design, poses: &mut [Pose]) {
    for (id, body) in design.bodies.iter().enumerate() {
        let carrier = body.owner.and_then(|j| design.joints.get(j)?.bodies.first());
        if let Some(pose) = carrier.and_then(|b| poses.get(*b)).copied()
            && let Some(own) = poses.get_mut(id)
        {
            *own = pose;
        }
    }
}

/// Indices of a design may come from a file: nothing below may trip over them.
fn consistent(design: &Design, p: &[f64]) -> Result<(), Vec<Diagnostic>> {
    let body = |id: &usize| *id < design.bodies.len();
    let joints = design.joints.iter().all(|j| j.bodies.len() > 1 && j.bodies.iter().all(body));
    let drives = design.drives.iter().all(|d| match d.on {
        DriveOn::Joint(joint) => joint < design.joints.len(),
        DriveOn::String(string) => {
            design.strings.get(string).is_some_and(|c| body(&c.from) && body(&c.to) && !c.via.is_empty())
        }
    });
    let aims = &design.aims;
    let traces = design.traces.iter().all(|t| body(&t.body))
        && aims.directions.iter().all(|d| body(&d.body))
        && aims.angles.iter().all(|a| body(&a.body));
    let loads = design.all_loads().all(|l| match &l.kind {
        LoadKind::Force { body: b, .. } | LoadKind::Moment { body: b, .. } => body(b),
        LoadKind::Gravity { .. } => true,
    });
    let moving = design.bodies.iter().filter(|b| !b.ground && b.owner.is_none()).count();
    let steps = design.cycle.steps;
    let values = if p.len() == design.free.len() { design.exprs.values(p) } else { Vec::new() };
    let bounded = |d: &Drive| {
        let most = match d.unit {
            DriveUnit::Rad => MAX_DRIVE_RAD,
            DriveUnit::Mm => MAX_DRIVE_MM,
        };
        d.rest_value(&values).abs() <= most
            && (0..=steps).all(|i| d.value(i as f64 / steps as f64).abs() <= most)
    };
    let problem = if p.len() != design.free.len() {
        "the number of free values is not the design's"
    } else if !(joints && drives && traces && loads) {
        "the design refers to bodies or joints it does not have"
    } else if moving == 0 {
        "the mechanism has no link that could move"
    } else if moving > MAX_MOVING_BODIES {
        "more than 2000 links are taken for a mistake"
    } else if steps == 0 {
        "a cycle has at least one step"
    } else if steps > MAX_STEPS {
        "the cycle has too many steps"
    } else if let Some(drive) = design.drives.iter().find(|d| !bounded(d)) {
        return Err(vec![
            Diagnostic::error(
                "E0500",
                format!("the drive `{}` has no value, or a huge one, somewhere in its cycle", drive.name),
                drive.origin,
            )
            .help("a drive turns at most 100 times, or slides at most 10 m, in a cycle"),
        ]);
    } else if let Some(load) =
        design.all_loads().find(|l| (0..=steps).any(|i| !l.size(i as f64 / steps as f64).is_finite()))
    {
        return Err(vec![
            Diagnostic::error("E0500", "a load has no size somewhere in the cycle", load.origin)
                .help("t runs from 0 to 1: divide by nothing that is zero in between"),
        ]);
    } else {
        return Ok(());
    };
    Err(vec![Diagnostic::error("E0500", problem, design.origin)])
}

/// Steps of the longest drive's way. A sliding drive's way counts as if L were 1 mm.
fn way(design: &Design) -> f64 {
    let steps = design.cycle.steps;
    let at = |d: &Drive, i: usize| d.value(i as f64 / steps as f64);
    let way = |d: &Drive| (0..steps).map(|i| (at(d, i + 1) - at(d, i)).abs()).sum::<f64>() / 0.2;
    design.drives.iter().map(way).fold(0.0, f64::max)
}

fn not_finite(what: &str, name: &str, origin: crate::ir::Origin) -> Diagnostic {
    let message = format!("the place of {what} `{name}` is not a finite number");
    Diagnostic::error("E0501", message, origin)
        .label("no such point at these values of the free variables")
        .help("check the lengths of the circles it is found from")
}
