//! The geometry stage as the pipeline uses it: what can be printed, and its findings as diagnostics.

use super::joined::{Planned, Solid};
use super::report::Place;
use super::stages::Failed;
use crate::diagnostic::Diagnostic;
use crate::equilibrium::{Cycle, Layout, Model};
use crate::geometry::link::plan_body;
use crate::geometry::{
    Carving, Cut, CycleGaps, FitFault, FitFaultKind, Fusion, GeometryError, LeastGap, Member, MovedState,
    Parts, PartsInput, build_planned, carve, carved_cycle_gaps, flexure_solid, parts_input, plan_bodies,
};
use crate::ir::{AddedSolid, Assembly, Design, Joint, JointKind, SurfaceFault, SurfaceFaultKind};

/// Builds the printed parts of a design in its rest pose from its finer flexures and what they are `planned` as. Meshed is
/// only what is `wanted`, by the bodies of a part.
///
/// # Errors
/// Where no solid comes out.
pub fn build(
    design: &Design,
    input: &PartsInput,
    planned: &Planned,
    wanted: &(dyn Fn(&[usize]) -> bool + Sync),
) -> Result<(Parts, Vec<Diagnostic>), Failed> {
    let (plans, carving) = (planned.plans.clone(), planned.carving.clone());
    let parts = build_planned(input, plans, carving, wanted).map_err(|e| no_solid(design, &e))?;
    let mut found: Vec<Diagnostic> = parts.fusions.iter().map(|f| fusion(design, f)).collect();
    let faults = parts.plans.iter().flat_map(|p| &p.faults).chain(&parts.out_of_reach);
    found.extend(faults.map(|f| fit_fault(design, f)));
    Ok((parts, found))
}

pub(super) fn fit_fault(design: &Design, fault: &FitFault) -> Diagnostic {
    let (p, motor, process) = (fault.at, &fault.motor, &design.process);
    let near = format!("near ({:.1}, {:.1}, {:.1}) mm of the rest pose", p.x, p.y, p.z);
    match fault.kind {
        FitFaultKind::Wall(wall) => {
            let message = format!("a wall in the seat of `{motor}` is {wall:.2} mm thick");
            Diagnostic::warning("W0649", message, fault.origin)
                .label(format!("{near}; `{}` needs {:.2} mm", process.name, process.least_wall_mm))
                .help("give the seat less `clearance`, or take a motor whose screws are farther apart")
        }
        FitFaultKind::NoReach(count) => {
            let message = format!("no driver reaches {count} of the screws of `{motor}`");
            Diagnostic::warning("W0649", message, fault.origin)
                .label("what is printed in one piece with its link stands over them")
                .help(
                    "turn the motor with `toward`, take one with flanges, or lead the links round its screws",
                )
        }
        FitFaultKind::NoLayer => {
            let message = "a body that does not lie in a layer cannot be a plate";
            Diagnostic::warning("W0649", message, fault.origin)
                .label("it is made of round bars in space")
                .help("a plate needs a body whose hinges have one direction, with its points at one height")
        }
        FitFaultKind::Loose(gap) => {
            let message = format!("`{motor}` does not touch its link, and would be a part of its own");
            Diagnostic::error("E0655", message, fault.origin)
                .label(format!("the rest of the link is {gap:.2} mm away, {near}"))
                .help("move it with `at`, turn it with `turned`, or give the link a point inside of it")
        }
        FitFaultKind::InTheWay => {
            let message = format!("`{motor}` stands where its own link holds something else");
            Diagnostic::warning("W0649", message, fault.origin)
                .label(format!("they meet {near}"))
                .help("turn the motor with `toward`, or move the link's points away from it")
        }
    }
}

/// Whether every solid's file bounds one.
///
/// # Errors
/// What is wrong with which, where and how often.
pub fn closed(design: &Design) -> Result<(), Failed> {
    bounding(design.bodies.iter().flat_map(|b| &b.fittings.solids))
}

/// The same of what is fitted to joined bodies.
///
/// # Errors
/// As [`closed`].
pub fn all_closed(assembly: &Assembly) -> Result<(), Failed> {
    bounding(assembly.joined.iter().flat_map(|j| &j.fittings.solids))
}

fn bounding<'s>(solids: impl Iterator<Item = &'s AddedSolid>) -> Result<(), Failed> {
    let told = |solid: &AddedSolid| {
        let faults = crate::geometry::solid::faults(&solid.mesh);
        let first = faults.first()?;
        let what = |f: &SurfaceFault| {
            let (n, [x, y, z]) = (f.count, f.at);
            let what = match f.kind {
                SurfaceFaultKind::Open => "edges have one triangle only: there is a hole",
                SurfaceFaultKind::NoSides => "edges have triangles that do not agree about what is outside",
                SurfaceFaultKind::Crossing => "pairs of triangles cross",
            };
            format!("{n} {what}; the first near ({x:.2}, {y:.2}, {z:.2}) mm of the file")
        };
        let message = format!("the surface of `{}` bounds no solid", solid.file);
        let mut found = Diagnostic::error("E0465", message, solid.origin).label(what(first));
        for more in faults.iter().skip(1) {
            found = found.also(solid.origin, what(more));
        }
        Some(found.help("let a mesh program repair it (close holes, unite shells), or export it anew"))
    };
    let found: Vec<Diagnostic> = solids.filter_map(told).collect();
    if found.is_empty() { Ok(()) } else { Err(found) }
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
    let missing =
        |joint: &&Joint| !joint.is_compliant() && !matches!(joint.kind, JointKind::Hinge | JointKind::Slider);
    let told = |joint: &Joint| {
        let what = joint.kind.name();
        let message = format!("the printed form of a conventional {what} joint is not available yet");
        let found = Diagnostic::error("E0901", message, joint.origin);
        match design.exports.iter().find(|e| e.kind.of_solids()) {
            Some(export) => found.also(export.origin, "asked for here"),
            None => found,
        }
        .help("without exports of parts (`stl`, `glb`) the mechanism can be checked, simulated and solved")
    };
    let found: Vec<Diagnostic> = design.joints.iter().filter(missing).map(told).collect();
    if found.is_empty() { Ok(()) } else { Err(found) }
}

/// Bodies and bent flexures in every state.
pub fn states(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> Vec<MovedState> {
    let moved = |e: &crate::equilibrium::Equilibrium| {
        let poses = e.state.poses.clone();
        let flexures = e.state.rods.iter().enumerate().map(|(r, state)| {
            let (rod, q) = (&design.rods[r], model.rods[r].rod.parameters());
            let ends = [poses[rod.from.body].point(&q.position_a), poses[rod.to.body].point(&q.position_b)];
            flexure_solid(design, layout, model, r, state, ends)
        });
        MovedState { flexures: flexures.collect(), poses }
    };
    cycle.states.iter().map(moved).collect()
}

/// Gaps of the planned solids over the cycle, flexures as polygons of the solver's edges (for 20 edges of 1.6 mm
/// bent to a radius of 15 mm, 0.02 mm inside the arc), links as they are after making way for their own flexures.
pub fn gaps(planned: &Planned) -> CycleGaps {
    let Planned { input, plans, carving, states, .. } = planned;
    carved_cycle_gaps(plans, states, carving, input.clearance_mm, |_, _| false)
}

/// A design as its bodies are planned, without any solid; a body that cannot be planned has no form.
pub fn outlined(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> Solid {
    let input = parts_input(design, layout, model);
    let plans = (0..input.bodies.len()).map(|b| plan_body(&input, b).unwrap_or_default()).collect();
    let parts = Parts {
        parts: Vec::new(),
        plans,
        carving: Carving::default(),
        fusions: Vec::new(),
        out_of_reach: Vec::new(),
    };
    Solid { input, parts, states: states(design, layout, model, cycle), values: model.p.clone() }
}

/// A design as it is planned; none where there are no solids to measure (the mesh stage says why): a gap of parts that
/// cannot be made yet would be a guess.
pub fn planned(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> Option<Planned> {
    available(design).ok()?;
    plan(design, layout, model, cycle).ok()
}

/// A design as it is planned: links make way for their own flexures in the states of the cycle.
///
/// # Errors
/// Where no solid comes out.
pub fn plan(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> Result<Planned, Failed> {
    let input = parts_input(design, layout, model);
    let failed = |e: GeometryError| no_solid(design, &e);
    let plans = plan_bodies(&input).map_err(failed)?;
    let states = states(design, layout, model, cycle);
    let carving = carve(&input, &plans, &states).map_err(failed)?;
    Ok(Planned { input, plans, carving, states, values: model.p.clone() })
}

/// The nearest two over the whole cycle, with their gap (mm).
pub fn nearest(design: &Design, gaps: &CycleGaps) -> Option<(f64, Place)> {
    let least = gaps.least.iter().flatten().min_by(|a, b| a.gap_mm.total_cmp(&b.gap_mm))?;
    let of = [least.a, least.b].map(|m| match m {
        Member::Body(b) => design.bodies.get(b).map_or(String::new(), |b| b.name.clone()),
        Member::Flexure(r) => design.rods.get(r).map_or(String::new(), |r| r.path.clone()),
    });
    Some((least.gap_mm, Place { of: of.to_vec(), state: least.state }))
}

/// Links that could not make way for their own flexures, each at the flexure's joint.
pub fn not_carved(design: &Design, carving: &Carving) -> Vec<Diagnostic> {
    carving.cuts.iter().filter(|c| !c.made).map(|c| uncarved(design, c)).collect()
}

pub(super) fn uncarved(design: &Design, cut: &Cut) -> Diagnostic {
    let (body, rod) = (&design.bodies[cut.body], &design.rods[cut.flexure]);
    let process = &design.process;
    let why = match cut.wall_mm {
        None => "to take out what it sweeps would cut the link apart".to_string(),
        Some(wall) => format!(
            "to take out what it sweeps would leave a wall of {wall:.2} mm, and `{}` needs {:.2} mm",
            process.name, process.least_wall_mm
        ),
    };
    let p = cut.at;
    let message = format!("`{}` cannot be carved to make way for its own flexure `{}`", body.name, rod.path);
    Diagnostic::warning("W0637", message, design.joints[rod.joint].origin)
        .label(format!("{why}; they meet near ({:.1}, {:.1}, {:.1}) mm of the rest pose", p.x, p.y, p.z))
        .also(body.origin, "the link")
        .help("aim the flexure elsewhere with `into … toward …`, move the link's points, or make the links higher")
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
        Member::Body(b) => {
            let body = &design.bodies[b];
            let motor = if body.fittings.mounts.is_empty() { "" } else { " (with its motor)" };
            (format!("`{}`{motor}", body.name), body.origin)
        }
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
