//! From a design and its rods at given parameters to the input of the solids.

use super::fitted::{PlateSolid, is_borne_by_motor, mounts, seats};
use super::layers::{guides, joint_axis, layers};
use super::parts::{BodySolid, Bore, Eye, FlexureSolid, HoleSolid, PartsInput};
use super::slot::Facets;
use super::solid::PlacedSolid;
use crate::equilibrium::{Layout, Model};
use crate::ir::{BodyId, Design, ExprPoint, Joint, JointId, JointKind, Realization};
use crate::rod::RodState;
use nalgebra::Vector3;

/// Points nearer than this are the same, mm.
const SAME_POINT_MM: f64 = 1e-6;
/// Part of the clearance left round a motor's shaft in the body it turns: to be fixed with a screw or glue.
const SHAFT_FIT: f64 = 0.5;

/// Bodies and flexures of a design in its rest pose, the flexures as `model` has them.
pub fn parts_input(design: &Design, layout: &Layout, model: &Model) -> PartsInput {
    let values = design.exprs.values(&model.p);
    let drawn = |p: [crate::ir::expr::ExprId; 3]| Vector3::from(p.map(|id| values[id.0 as usize]));
    let bodies = design
        .bodies
        .iter()
        .enumerate()
        .map(|(b, body)| {
            let layers = layers(design, layout, b, &drawn);
            // Flexures, sliders and, in space, eyes have nodes of their own. They are told by where they are drawn:
            // later a joint stands in its layer, and a slider's bar where it is at rest.
            let has_node = |j: &Joint| j.is_compliant() || j.kind == JointKind::Slider || layers.is_none();
            let held = |p: &Vector3<f64>| {
                design.joints.iter().any(|j| {
                    has_node(j) && j.bodies.contains(&b) && (drawn(j.point) - p).norm() < SAME_POINT_MM
                })
            };
            // Where a motor sits, no bar ends.
            let mounted = |p: &Vector3<f64>| {
                body.fittings.mounts.iter().any(|m| (drawn(m.position) - p).norm() < SAME_POINT_MM)
            };
            let skeleton =
                body.skeleton.iter().map(|p| drawn(p.position)).filter(|p| !held(p) && !mounted(p));
            let eyes =
                design.joints.iter().enumerate().filter(|(_, j)| {
                    !j.is_compliant() && j.kind == JointKind::Hinge && j.bodies.contains(&b)
                });
            let eyes = eyes.filter(|(j, _)| !is_borne_by_motor(design, *j, b));
            let pose = &layout.rest_poses[b];
            let placed = |p: ExprPoint| pose.point(&drawn(p));
            let turned = |d: &Vector3<f64>| pose.direction(d);
            BodySolid {
                name: body.name.clone(),
                of_flexure: body.owner.is_some(),
                axis: layers.map(|(axis, _)| axis),
                level_mm: layers.map_or(0.0, |(_, level)| level),
                skeleton: skeleton.map(|p| layout.rest_poses[b].point(&p)).collect(),
                eyes: eyes
                    .map(|(j, joint)| Eye {
                        joint: j,
                        point: layout.rest_poses[b].point(&layout.joint_points[j]),
                        axis: joint_axis(design, layout, joint),
                        bore: bore(design, j, joint, b),
                        slot: slot(design, j, joint, b),
                    })
                    .collect(),
                guides: guides(design, layout, b),
                mounts: mounts(design, layout, b, &drawn),
                seats: seats(design, layout, b),
                plate: body.fittings.plate.as_ref().map(|p| PlateSolid {
                    thick_mm: p.thick_mm,
                    margin_mm: p.margin_mm,
                    origin: p.origin,
                }),
                solids: body.fittings.solids.iter().map(|s| PlacedSolid::of(s, placed, turned)).collect(),
                holes: body.holes.iter().map(|h| HoleSolid::of(h, placed, turned)).collect(),
            }
        })
        .collect();
    let flexures = model
        .rods
        .iter()
        .enumerate()
        .map(|(r, built)| {
            let q = built.rod.parameters();
            flexure_solid(design, layout, model, r, &built.rod.rest_state(), [q.position_a, q.position_b])
        })
        .collect();
    PartsInput {
        height_mm: design.layers.height_mm,
        clearance_mm: design.process.clearance_mm,
        least_wall_mm: design.process.least_wall_mm,
        bodies,
        flexures,
        motion: layout.conventional.clone(),
        facets: Facets::default(),
    }
}

/// A flexure in a state (its index in the design), `ends` its attachment points there.
pub fn flexure_solid(
    design: &Design,
    layout: &Layout,
    model: &Model,
    index: usize,
    state: &RodState,
    ends: [Vector3<f64>; 2],
) -> FlexureSolid {
    let (rod, built) = (&design.rods[index], &model.rods[index].rod);
    let last = state.vertices.len() - 1;
    let widths: Vec<[f64; 2]> = (0..=last).map(|k| built.station_half_widths_mm(k)).collect();
    // The attachment planes, and the vertices between them.
    let mut centreline = vec![ends[0]];
    centreline.extend_from_slice(&state.vertices[1..last]);
    centreline.push(ends[1]);
    let frames: Vec<[Vector3<f64>; 2]> = (0..=last)
        .map(|k| {
            let (i, j) = (k.saturating_sub(1), k.min(last - 1));
            let t = (state.vertices[j + 1] - state.vertices[i]).normalize();
            let m = state.m1[i] + state.m1[j];
            let m1 = (m - t * m.dot(&t)).normalize();
            [m1, t.cross(&m1)]
        })
        .collect();
    let mut solid = FlexureSolid {
        path: rod.path.clone(),
        joint: rod.joint,
        joint_point: layout.rod_ends[index][0].origin,
        bodies: (rod.from.body, rod.to.body),
        section: model.rods[index].rod.options().section,
        a_mm: widths.iter().map(|w| w[0]).collect(),
        b_mm: widths.iter().map(|w| w[1]).collect(),
        m1: frames.iter().map(|f| f[0]).collect(),
        m2: frames.iter().map(|f| f[1]).collect(),
        centreline,
        fillets: [None; 2],
    };
    solid.fillet(rod.fillet_mm, design.process.least_wall_mm);
    solid
}

/// A body's place among the bodies of a conventional joint: by their own layers, upwards.
fn slot(design: &Design, index: JointId, joint: &Joint, body: BodyId) -> (usize, usize) {
    let mut order = joint.bodies.clone();
    order.retain(|b| !is_borne_by_motor(design, index, *b));
    order.sort_by_key(|b| design.bodies[*b].layer);
    (order.iter().position(|b| *b == body).unwrap_or(0), order.len())
}

fn bore(design: &Design, index: JointId, joint: &Joint, body: BodyId) -> Bore {
    let clearance = design.process.clearance_mm;
    let motor = design.drives.iter().find(|d| d.joint() == Some(index)).and_then(|d| d.motor.as_ref());
    if let Some(shaft) = motor.and_then(|m| m.shaft_diameter_mm) {
        let turned = joint.bodies.get(1) == Some(&body);
        let room = if turned { SHAFT_FIT * clearance } else { 2.0 * clearance };
        return Bore::Through { diameter_mm: shaft + room };
    }
    match joint.realization {
        Realization::Conventional { pin_diameter_mm: Some(d) } => Bore::Blind { diameter_mm: d + clearance },
        _ => Bore::Solid,
    }
}
