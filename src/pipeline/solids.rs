//! The geometry stage as the pipeline uses it: what can be printed, and its findings as diagnostics.

use super::stages::Failed;
use crate::diagnostic::Diagnostic;
use crate::equilibrium::{Cycle, Layout, Model};
use crate::geometry::{
    CycleGaps, Fusion, GeometryError, LeastGap, Member, MovedState, Parts, build_parts, cycle_gaps,
    flexure_solid, parts_input, plan_bodies,
};
use crate::ir::{Design, ExportKind, Joint, JointKind};
use nalgebra::Vector3;

/// Sine of the angle between axes that count as parallel.
const PARALLEL: f64 = 1e-9;

/// Builds the printed parts of a design in its rest pose.
///
/// # Errors
/// Where no solid comes out.
pub fn build(design: &Design, layout: &Layout, model: &Model) -> Result<(Parts, Vec<Diagnostic>), Failed> {
    let input = parts_input(design, layout, model);
    let parts = build_parts(&input).map_err(|e| no_solid(design, &e))?;
    let found = parts.fusions.iter().map(|f| fusion(design, f)).collect();
    Ok((parts, found))
}

/// Whether every body has something to be made of. A design without equilibrium is not judged here.
///
/// # Errors
/// What is missing.
pub fn plannable(design: &Design, layout: &Layout, values: &[f64], edges: usize) -> Result<(), Failed> {
    let Ok(model) = Model::new(design, layout, values, edges, false) else { return Ok(()) };
    let planned = plan_bodies(&parts_input(design, layout, &model));
    planned.map(|_| ()).map_err(|e| no_solid(design, &e))
}

fn no_solid(design: &Design, error: &GeometryError) -> Failed {
    vec![Diagnostic::error("E0630", format!("no solid comes out: {error}"), design.origin)]
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

/// Gaps of the planned solids over the cycle, flexures as polygons of the solver's edges (for 20 edges of 1.6 mm
/// bent to a radius of 15 mm, 0.02 mm inside the arc); empty where there are no solids to measure (the mesh stage
/// says why): a gap of parts that cannot be made yet would be a guess.
pub fn gaps(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> CycleGaps {
    let plans = available(design).ok().and_then(|()| plan_bodies(&parts_input(design, layout, model)).ok());
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
                flexure_solid(design, layout, model, r, state, ends)
            });
            MovedState { flexures: flexures.collect(), poses }
        })
        .collect();
    cycle_gaps(&plans, &states, |_, _| false)
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
