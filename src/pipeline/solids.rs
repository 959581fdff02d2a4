//! From a solved design to the input of the geometry stage, and from its findings to diagnostics.

use super::stages::Failed;
use crate::diagnostic::Diagnostic;
use crate::equilibrium::{Layout, Model};
use crate::geometry::{
    BodySolid, Bore, Eye, Facets, FlexureSolid, Fusion, LeastGap, Member, Parts, PartsInput, build_parts,
    least_gap,
};
use crate::ir::{BodyId, Design, Joint, JointId, Realization};
use crate::kinematics::Motion;
use crate::math::Pose;
use nalgebra::Vector3;

/// Points nearer than this are the same, mm.
const SAME_POINT_MM: f64 = 1e-6;
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

fn parts_input(design: &Design, layout: &Layout, motion: &Motion, model: &Model) -> PartsInput {
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
    let flexures = design
        .rods
        .iter()
        .zip(&model.rods)
        .zip(&layout.rod_ends)
        .map(|((rod, built), ends)| {
            let rest = built.rod.rest_state();
            let q = built.rod.parameters();
            let last = rest.vertices.len() - 1;
            // The attachment planes, and the vertices between them.
            let mut centreline = vec![q.position_a];
            centreline.extend_from_slice(&rest.vertices[1..last]);
            centreline.push(q.position_b);
            let frames: Vec<[Vector3<f64>; 2]> = (0..=last)
                .map(|k| {
                    let (i, j) = (k.saturating_sub(1), k.min(last - 1));
                    let t = (rest.vertices[j + 1] - rest.vertices[i]).normalize();
                    let m = rest.m1[i] + rest.m1[j];
                    let m1 = (m - t * m.dot(&t)).normalize();
                    [m1, t.cross(&m1)]
                })
                .collect();
            FlexureSolid {
                path: rod.path.clone(),
                joint: rod.joint,
                joint_point: ends[0].origin,
                bodies: (rod.from.body, rod.to.body),
                section: built.rod.options().section,
                a_mm: vec![q.a; centreline.len()],
                b_mm: vec![q.b; centreline.len()],
                m1: frames.iter().map(|f| f[0]).collect(),
                m2: frames.iter().map(|f| f[1]).collect(),
                centreline,
            }
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

/// Bodies that meet somewhere in the cycle: each pair once, at its worst state.
pub fn collisions(design: &Design, parts: &Parts, poses: &[Vec<Pose>]) -> Vec<Diagnostic> {
    let count = design.bodies.len();
    let pairs: Vec<(BodyId, BodyId)> = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j))).collect();
    let mut found = Vec::new();
    for pair in &pairs {
        let others: Vec<(BodyId, BodyId)> = pairs.iter().copied().filter(|p| p != pair).collect();
        let worst = least_gap(&parts.plans, poses, &others)
            .into_iter()
            .flatten()
            .min_by(|a, b| a.gap_mm.total_cmp(&b.gap_mm));
        if let Some(worst) = worst.filter(|w| w.gap_mm < 0.0) {
            found.push(collision(design, &worst));
        }
    }
    found
}

fn collision(design: &Design, worst: &LeastGap) -> Diagnostic {
    let (a, b) = (&design.bodies[worst.bodies.0], &design.bodies[worst.bodies.1]);
    let at = worst.at;
    let message = format!("`{}` and `{}` collide on the way", a.name, b.name);
    Diagnostic::warning("W0635", message, a.origin)
        .label(format!(
            "at state {} they overlap by {:.2} mm near ({:.1}, {:.1}, {:.1}) mm",
            worst.state, -worst.gap_mm, at.x, at.y, at.z
        ))
        .also(b.origin, "the other one")
        .help("put them in different layers, or aim the flexures elsewhere with `into … toward …`")
}

fn fusion(design: &Design, f: &Fusion) -> Diagnostic {
    let name = |m: &Member| match *m {
        Member::Body(b) => (format!("`{}`", design.bodies[b].name), design.bodies[b].origin),
        Member::Flexure(r) => {
            (format!("the flexure `{}`", design.rods[r].path), design.joints[design.rods[r].joint].origin)
        }
    };
    let ((a, at), (b, also)) = (name(&f.a), name(&f.b));
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
