//! Motors and horns as they stand at a body in the rest pose, and the boxes that are cut out for them.

use super::distance::separation;
use super::layers::joint_axis;
use super::link::BodyPlan;
use super::mesh::Mesh;
use super::slot::{Slot, any_normal};
use crate::equilibrium::Layout;
use crate::ir::expr::ExprId;
use crate::ir::{BodyId, Design, HornForm, Joint, JointId, JointKind, MotorBody, Mount, Origin, Placement};
use nalgebra::Vector3;

/// Sine of the angle between directions that count as parallel.
const PARALLEL: f64 = 1e-6;
/// Points nearer than this are the same, mm.
const SAME_POINT_MM: f64 = 1e-6;

/// A motor at a body.
#[derive(Clone, Debug, PartialEq)]
pub struct MountSolid {
    /// The motor.
    pub motor: MotorBody,
    /// A point of the shaft's axis; of a joint its physical point.
    pub point: Vector3<f64>,
    /// Unit direction in which the shaft points.
    pub axis: Vector3<f64>,
    /// Unit direction normal to it, from the shaft to the longer part of the box.
    pub forward: Vector3<f64>,
    /// Where the rest of the body is, mm.
    pub rest: Vector3<f64>,
    /// It takes the place of the body's bearing in a joint.
    pub bears: bool,
    /// The bearing stays: a shaft passes through it.
    pub passes: bool,
    /// Thickness of the seat, mm.
    pub thick_mm: f64,
    /// Room on every side, mm.
    pub clearance_mm: f64,
    /// Statement.
    pub origin: Origin,
}

/// The seat of a horn in a body's eye.
#[derive(Clone, Debug, PartialEq)]
pub struct SeatSolid {
    /// The horn.
    pub form: HornForm,
    /// Index of the joint.
    pub joint: usize,
    /// Unit direction along the joint's axis towards the motor.
    pub side: Vector3<f64>,
    /// Depth of the recess, mm.
    pub deep_mm: f64,
    /// Room on every side, mm.
    pub clearance_mm: f64,
    /// Statement.
    pub origin: Origin,
}

/// A body that is a plate.
#[derive(Clone, Debug, PartialEq)]
pub struct PlateSolid {
    /// Thickness, mm.
    pub thick_mm: f64,
    /// How far it reaches beyond its nodes, mm; none: a little beyond their bosses.
    pub margin_mm: Option<f64>,
    /// Statement.
    pub origin: Origin,
}

/// What is wrong with a seat.
#[derive(Clone, Debug, PartialEq)]
pub struct FitFault {
    /// Name of the motor, or the file of a solid.
    pub motor: String,
    /// What.
    pub kind: FitFaultKind,
    /// Where, mm.
    pub at: Vector3<f64>,
    /// Statement.
    pub origin: Origin,
}

/// Kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FitFaultKind {
    /// Between two holes, or a hole and an opening, this wall is left, mm.
    Wall(f64),
    /// The motor stands where its own body has a joint or a flexure's end.
    InTheWay,
    /// What is printed with it keeps a driver from this many of its screws.
    NoReach(usize),
    /// A plate of a body without layers.
    NoLayer,
    /// A solid this far from the rest of its link, mm.
    Loose(f64),
}

/// A box that is cut out.
#[derive(Clone, Debug, PartialEq)]
pub struct Pocket {
    /// Its middle, mm.
    pub center: Vector3<f64>,
    /// Unit directions of its edges.
    pub edges: [Vector3<f64>; 3],
    /// Half its size along them, mm.
    pub half_mm: [f64; 3],
}

impl MountSolid {
    /// A motor on a body that stands still and has no layers, its shaft in no joint: at `point` (mm), with the rest of the body
    /// round `rest`, between links of a height, where the process keeps `clearance_mm`.
    pub fn standing(
        mount: &Mount,
        point: Vector3<f64>,
        toward: Option<Vector3<f64>>,
        rest: Vector3<f64>,
        [height_mm, clearance_mm]: [f64; 2],
    ) -> Self {
        let axis = mount.along.map_or_else(Vector3::z, Vector3::from);
        let off = toward.unwrap_or(rest) - point;
        let flat = (off - axis * off.dot(&axis)).try_normalize(SAME_POINT_MM);
        Self {
            motor: mount.motor.clone(),
            point,
            axis,
            forward: flat.unwrap_or_else(|| any_normal(&axis)),
            rest,
            bears: false,
            passes: false,
            thick_mm: mount.thickness_mm(height_mm),
            clearance_mm: mount.clearance_mm.unwrap_or(clearance_mm),
            origin: mount.origin,
        }
    }
}

impl Pocket {
    /// Closed mesh of twelve triangles.
    pub fn mesh(&self) -> Mesh {
        let corner = |i: usize| {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            (0..3).fold(self.center, |p, k| p + self.edges[k] * (sign(k) * self.half_mm[k]))
        };
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let turned = self.edges[0].cross(&self.edges[1]).dot(&self.edges[2]) < 0.0;
        let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        let triangles = triangles.map(|[a, b, c]| if turned { [a, c, b] } else { [a, b, c] }).collect();
        Mesh { vertices: (0..8).map(corner).collect(), triangles }
    }

    /// The upright box round a mesh; none round an empty one.
    pub(super) fn round(mesh: &Mesh) -> Option<Pocket> {
        let (low, high) = mesh.bounding_box()?;
        let edges = [Vector3::x(), Vector3::y(), Vector3::z()];
        Some(Pocket { center: (low + high) / 2.0, edges, half_mm: ((high - low) / 2.0).into() })
    }

    /// The pocket in another place.
    pub fn placed(&self, placement: &Placement) -> Pocket {
        let edges = self.edges.map(|e| placement.direction(&e));
        Pocket { center: placement.point(&self.center), edges, half_mm: self.half_mm }
    }

    /// Whether it is the same box, drawn the same way or as a mirror image of itself.
    pub(super) fn is(&self, other: &Pocket, within_mm: f64) -> bool {
        let size = self.half_mm.iter().fold(0.0_f64, |a, b| a.max(*b));
        let edges = self.edges.iter().zip(&other.edges);
        let sizes = self.half_mm.iter().zip(&other.half_mm);
        (self.center - other.center).norm() < within_mm
            && edges.fold(0.0_f64, |a, (p, q)| a.max(p.cross(q).norm())) * size < within_mm
            && sizes.fold(0.0_f64, |a, (p, q)| a.max((p - q).abs())) < within_mm
    }

    /// Signed distance of a point, mm, negative inside; exact outside.
    pub(super) fn signed_distance(&self, p: &Vector3<f64>) -> f64 {
        let d = Vector3::from_fn(|k, _| (p - self.center).dot(&self.edges[k]).abs() - self.half_mm[k]);
        d.sup(&Vector3::zeros()).norm() + d.max().min(0.0)
    }

    /// A ball around it.
    pub(super) fn around(&self) -> Slot {
        Slot::capsule(self.center, self.center, Vector3::from(self.half_mm).norm())
    }
}

/// Whether a motor's own bearing takes the place of a body's eye: all but those whose shaft passes through it.
pub(super) fn is_borne_by_motor(design: &Design, joint: JointId, body: BodyId) -> bool {
    let mounts = design.bodies.get(body).map(|b| b.fittings.mounts.as_slice()).unwrap_or_default();
    mounts.iter().any(|m| m.joint == Some(joint) && !passes(m))
}

fn passes(mount: &Mount) -> bool {
    let on_its_face = mount.motor.screws.is_some() && !mount.motor.has_flanges();
    mount.motor.shaft_mm.is_some() && on_its_face
}

/// Motors of a body.
pub(super) fn mounts(
    design: &Design,
    layout: &Layout,
    body: BodyId,
    drawn: &impl Fn([ExprId; 3]) -> Vector3<f64>,
) -> Vec<MountSolid> {
    let (Some(own), Some(pose)) = (design.bodies.get(body), layout.rest_poses.get(body)) else {
        return Vec::new();
    };
    let solid = |m: &Mount| {
        let at = drawn(m.position);
        let joint = m.joint.and_then(|j| Some((design.joints.get(j)?, layout.joint_points.get(j)?)));
        let axis = match (m.along, joint) {
            (Some(along), _) => pose.direction(&Vector3::from(along)),
            (None, Some((joint, _))) => towards_others(design, layout, joint, body),
            (None, None) => pose.direction(&Vector3::from(design.layers.axis)),
        };
        let axis = axis.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let point = pose.point(&joint.map_or(at, |(_, p)| *p));
        let others = own.skeleton.iter().map(|p| drawn(p.position));
        let others: Vec<Vector3<f64>> = others.filter(|p| (p - at).norm() > SAME_POINT_MM).collect();
        let middle = others.iter().sum::<Vector3<f64>>() / (others.len().max(1) as f64);
        let rest = if others.is_empty() { point } else { pose.point(&middle) };
        let toward = m.toward.map_or(rest, |q| pose.point(&drawn(q)));
        let off = toward - point;
        let flat = (off - axis * off.dot(&axis)).try_normalize(SAME_POINT_MM);
        MountSolid {
            motor: m.motor.clone(),
            point,
            axis,
            forward: flat.unwrap_or_else(|| any_normal(&axis)),
            rest,
            bears: joint.is_some(),
            passes: joint.is_some() && passes(m),
            thick_mm: m.thickness_mm(design.layers.height_mm),
            clearance_mm: m.clearance_mm.unwrap_or(design.process.clearance_mm),
            origin: m.origin,
        }
    };
    own.fittings.mounts.iter().map(solid).collect()
}

/// Seats of horns in a body.
pub(super) fn seats(design: &Design, layout: &Layout, body: BodyId) -> Vec<SeatSolid> {
    let Some(own) = design.bodies.get(body) else { return Vec::new() };
    let seat = |h: &crate::ir::Horn| {
        let joint = design.joints.get(h.joint)?;
        // A motor that is mounted says which way its shaft points.
        let carrier = joint.bodies.iter().filter_map(|b| Some((*b, design.bodies.get(*b)?)));
        let shaft = carrier.flat_map(|(b, of)| of.fittings.mounts.iter().map(move |m| (b, m)));
        let shaft = shaft.filter(|(_, m)| m.joint == Some(h.joint)).find_map(|(b, m)| {
            let pose = layout.rest_poses.get(b)?;
            let along = m.along.map(|a| pose.direction(&Vector3::from(a)));
            Some(-along.unwrap_or_else(|| towards_others(design, layout, joint, b)))
        });
        Some(SeatSolid {
            form: h.form.clone(),
            joint: h.joint,
            side: shaft.unwrap_or_else(|| towards_others(design, layout, joint, body)),
            deep_mm: h.deep_mm,
            clearance_mm: h.clearance_mm.unwrap_or(design.process.clearance_mm),
            origin: h.origin,
        })
    };
    own.fittings.horns.iter().filter_map(seat).collect()
}

/// The joint's axis towards the layer of its other bodies; where they share one, from the joint's first body to the others.
fn towards_others(design: &Design, layout: &Layout, joint: &Joint, body: BodyId) -> Vector3<f64> {
    let axis = joint_axis(design, layout, joint);
    let stack = Vector3::from(design.layers.axis);
    let layer = |b: BodyId| design.bodies.get(b).map_or(0, |b| b.layer);
    let other = joint.bodies.iter().copied().filter(|b| *b != body).map(layer).max_by_key(|l| l.abs());
    let above = other.map_or(0, |l| l.cmp(&layer(body)) as i32);
    let stacked = joint.kind == JointKind::Hinge && Vector3::from(joint.axis).cross(&stack).norm() < PARALLEL;
    match above {
        1 if stacked => axis,
        -1 if stacked => -axis,
        _ if joint.bodies.first() == Some(&body) => axis,
        _ => -axis,
    }
}

/// Screws of motors to which no driver reaches, because something that is printed in one piece with the motor's body stands over them
/// in the rest pose.
pub fn out_of_reach(plans: &[BodyPlan], groups: &[Vec<usize>]) -> Vec<FitFault> {
    let mut found: Vec<FitFault> = Vec::new();
    for group in groups {
        for body in group {
            let Some(plan) = plans.get(*body) else { continue };
            for (way, motor, origin) in &plan.access {
                let others = group.iter().filter(|b| *b != body).filter_map(|b| plans.get(*b));
                let mut slots = others.flat_map(|p| &p.slots);
                if slots.all(|(_, s)| separation(way, s).gap_mm >= 0.0) {
                    continue;
                }
                match found.iter_mut().find(|f| f.origin == *origin) {
                    Some(FitFault { kind: FitFaultKind::NoReach(n), .. }) => *n += 1,
                    _ => found.push(FitFault {
                        motor: motor.clone(),
                        kind: FitFaultKind::NoReach(1),
                        at: way.start,
                        origin: *origin,
                    }),
                }
            }
        }
    }
    found
}
