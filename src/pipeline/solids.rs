//! From a solved design to the input of the geometry stage, and from its findings to diagnostics.

use super::stages::Failed;
use crate::diagnostic::Diagnostic;
use crate::equilibrium::{Cycle, Layout, Model};
use crate::geometry::{
    BodySolid, Bore, CycleGaps, Eye, Facets, FlexureSolid, Fusion, LeastGap, Member, MovedState, Parts,
    PartsInput, build_parts, cycle_gaps, plan_bodies,
};
use crate::ir::{BodyId, Design, ExportKind, Joint, JointId, JointKind, Realization};
use crate::kinematics::Motion;
use crate::rod::RodState;
use nalgebra::Vector3;

/// Points nearer than this are the same, mm.
const SAME_POINT_MM: f64 = 1e-6;
/// Sine of the angle between axes that count as parallel.
const PARALLEL: f64 = 1e-9;
/// Part of the clearance left round a motor's shaft in the body it turns: to be fixed with a screw or glue.
const SHAFT_FIT: f64 = 0.5;

/// Builds the printed parts of a design in its rest pose.
///
/// # Errors
/// Where no solid comes out.
pub fn build(
    design: &Design,
    layout: &Layout,
    motion: &Motion,
    model: &Model,
) -> Result<(Parts, Vec<Diagnostic>), Failed> {
    let input = parts_input(design, layout, motion, model);
    let parts = build_parts(&input)
        .map_err(|e| vec![Diagnostic::error("E0630", format!("no solid comes out: {e}"), design.origin)])?;
    let found = parts.fusions.iter().map(|f| fusion(design, f)).collect();
    Ok((parts, found))
}

/// Whether every conventional joint has a printable form.
///
/// # Errors
/// Joints whose form is not there yet, each at its place.
pub fn available(design: &Design) -> Result<(), Failed> {
    let missing = |joint: &&Joint| {
        let plain = joint.kind == JointKind::Hinge && joint.bodies.len() == 2;
        !joint.is_compliant() && !plain
    };
    let told = |joint: &Joint| {
        let what = match joint.kind {
            JointKind::Hinge => "hinge of more than two bodies".to_string(),
            kind => format!("{} joint", kind.name()),
        };
        let message = format!("the printed form of a conventional {what} is not available yet");
        let found = Diagnostic::error("E0901", message, joint.origin);
        match design.exports.iter().find(|e| e.kind == ExportKind::Stl) {
            Some(export) => found.also(export.origin, "asked for here"),
            None => found,
        }
        .help("without `export stl` the mechanism can be checked, simulated and solved")
    };
    let found: Vec<Diagnostic> = design.joints.iter().filter(missing).map(told).collect();
    if !found.is_empty() {
        return Err(found);
    }
    let axis = Vector3::from(design.layers.axis);
    let skew = |j: &&Joint| !j.is_compliant() && Vector3::from(j.axis).cross(&axis).norm() > PARALLEL;
    match design.joints.iter().find(skew) {
        None => Ok(()),
        Some(joint) => Err(vec![
            Diagnostic::error(
                "E0901",
                "the printed form of conventional hinges with different axes is not available yet",
                joint.origin,
            )
            .help("without `export stl` the mechanism can be checked, simulated and solved"),
        ]),
    }
}

pub(super) fn parts_input(design: &Design, layout: &Layout, motion: &Motion, model: &Model) -> PartsInput {
    let values = design.exprs.values(&design.free.iter().map(|f| f.start).collect::<Vec<_>>());
    let drawn = |p: [crate::ir::expr::ExprId; 3]| Vector3::from(p.map(|id| values[id.0 as usize]));
    let pitch = design.layers.pitch_mm;
    let bodies = design
        .bodies
        .iter()
        .enumerate()
        .map(|(b, body)| {
            let flexed = |p: &Vector3<f64>| {
                design.joints.iter().any(|j| {
                    j.is_compliant() && j.bodies.contains(&b) && (drawn(j.point) - p).norm() < SAME_POINT_MM
                })
            };
            let skeleton = body.skeleton.iter().map(|p| drawn(p.position)).filter(|p| !flexed(p));
            let eyes =
                design.joints.iter().enumerate().filter(|(_, j)| !j.is_compliant() && j.bodies.contains(&b));
            BodySolid {
                name: body.name.clone(),
                level_mm: f64::from(body.layer) * pitch,
                skeleton: skeleton.map(|p| motion.rest_point(b, &p)).collect(),
                eyes: eyes
                    .map(|(j, joint)| Eye {
                        joint: j,
                        point: motion.rest_point(b, &motion.joint_points[j]),
                        bore: bore(design, j, joint, b),
                        slot: slot(design, joint, b),
                    })
                    .collect(),
            }
        })
        .collect();
    let flexures = model
        .rods
        .iter()
        .enumerate()
        .map(|(r, built)| {
            let q = built.rod.parameters();
            flexure(design, layout, model, r, &built.rod.rest_state(), [q.position_a, q.position_b])
        })
        .collect();
    PartsInput {
        axis: Vector3::from(design.layers.axis),
        height_mm: design.layers.height_mm,
        clearance_mm: design.process.clearance_mm,
        least_wall_mm: design.process.least_wall_mm,
        bodies,
        flexures,
        facets: Facets::default(),
    }
}

/// A flexure in a state, `ends` its attachment points there.
fn flexure(
    design: &Design,
    layout: &Layout,
    model: &Model,
    index: usize,
    state: &RodState,
    ends: [Vector3<f64>; 2],
) -> FlexureSolid {
    let (rod, q) = (&design.rods[index], model.rods[index].rod.parameters());
    let last = state.vertices.len() - 1;
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
    FlexureSolid {
        path: rod.path.clone(),
        joint: rod.joint,
        joint_point: layout.rod_ends[index][0].origin,
        bodies: (rod.from.body, rod.to.body),
        section: model.rods[index].rod.options().section,
        a_mm: vec![q.a; centreline.len()],
        b_mm: vec![q.b; centreline.len()],
        m1: frames.iter().map(|f| f[0]).collect(),
        m2: frames.iter().map(|f| f[1]).collect(),
        centreline,
    }
}

/// Gaps of the planned solids over the cycle, flexures as polygons of the solver's edges (for 20 edges of 1.6 mm
/// bent to a radius of 15 mm, 0.02 mm inside the arc); empty where there are no solids to measure (the mesh stage
/// says why): a gap of parts that cannot be made yet would be a guess.
pub fn gaps(design: &Design, layout: &Layout, motion: &Motion, model: &Model, cycle: &Cycle) -> CycleGaps {
    let plans =
        available(design).ok().and_then(|()| plan_bodies(&parts_input(design, layout, motion, model)).ok());
    let Some(plans) = plans else {
        return CycleGaps::default();
    };
    let states: Vec<MovedState> = cycle
        .states
        .iter()
        .map(|e| {
            let poses = e.state.poses.clone();
            let flexures = e.state.rods.iter().enumerate().map(|(r, state)| {
                let (rod, q) = (&design.rods[r], model.rods[r].rod.parameters());
                let ends =
                    [poses[rod.from.body].point(&q.position_a), poses[rod.to.body].point(&q.position_b)];
                flexure(design, layout, model, r, state, ends)
            });
            MovedState { flexures: flexures.collect(), poses }
        })
        .collect();
    cycle_gaps(&plans, &states, |_, _| false)
}

/// A body's place among the bodies of a conventional joint: by their own layers, upwards.
fn slot(design: &Design, joint: &Joint, body: BodyId) -> (usize, usize) {
    let mut order = joint.bodies.clone();
    order.sort_by_key(|b| design.bodies[*b].layer);
    (order.iter().position(|b| *b == body).unwrap_or(0), order.len())
}

fn bore(design: &Design, index: JointId, joint: &Joint, body: BodyId) -> Bore {
    let clearance = design.process.clearance_mm;
    let motor = design.drives.iter().find(|d| d.joint == index).and_then(|d| d.motor.as_ref());
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

/// What meets somewhere in the cycle: each pair once, at its worst state.
pub fn collisions(design: &Design, gaps: &CycleGaps) -> Vec<Diagnostic> {
    gaps.overlaps.iter().map(|o| collision(design, o)).collect()
}

fn collision(design: &Design, worst: &LeastGap) -> Diagnostic {
    let ((a, at), (b, also)) = (named(design, &worst.a), named(design, &worst.b));
    let p = worst.at;
    let label = format!(
        "at state {} they overlap by {:.2} mm near ({:.1}, {:.1}, {:.1}) mm",
        worst.state, -worst.gap_mm, p.x, p.y, p.z
    );
    match (worst.a, worst.b) {
        (Member::Body(_), Member::Body(_)) => {
            Diagnostic::warning("W0635", format!("{a} and {b} collide on the way"), at)
                .help("put them in different layers, or aim the flexures elsewhere with `into … toward …`")
        }
        _ => Diagnostic::warning("W0636", format!("{b} rubs against {a} on the way"), at).help(
            "aim the flexures elsewhere with `into … toward …`, move the body's points, or narrow the bounds",
        ),
    }
    .label(label)
    .also(also, "the other one")
}

fn named(design: &Design, member: &Member) -> (String, crate::ir::Origin) {
    match *member {
        Member::Body(b) => (format!("`{}`", design.bodies[b].name), design.bodies[b].origin),
        Member::Flexure(r) => {
            (format!("the flexure `{}`", design.rods[r].path), design.joints[design.rods[r].joint].origin)
        }
    }
}

fn fusion(design: &Design, f: &Fusion) -> Diagnostic {
    let ((a, at), (b, also)) = (named(design, &f.a), named(design, &f.b));
    let place = format!("near ({:.1}, {:.1}, {:.1}) mm", f.at.x, f.at.y, f.at.z);
    if f.depth_mm > 0.0 && f.same_part {
        Diagnostic::error("E0632", format!("{a} and {b} would be printed as one piece"), at)
            .label(format!("they overlap by {:.2} mm {place} in the rest pose", f.depth_mm))
            .also(also, "the other one")
            .help("put them in different layers, move their points apart, or aim the flexures with `into … toward …`")
    } else if f.depth_mm > 0.0 {
        Diagnostic::error("E0633", format!("{a} and {b} stand in each other's way in the rest pose"), at)
            .label(format!("they overlap by {:.2} mm {place}", f.depth_mm))
            .also(also, "the other one")
            .help("put them in different layers or move their points apart")
    } else {
        let gap = -f.depth_mm;
        Diagnostic::warning("W0634", format!("{a} and {b} are printed {gap:.2} mm apart"), at)
            .label(format!("{place}; `{}` needs {:.2} mm", design.process.name, design.process.clearance_mm))
            .also(also, "the other one")
            .help("they may fuse while printing: move them apart or turn the rest pose")
    }
}
