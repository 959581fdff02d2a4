//! The printed parts of an assembly: those of its designs, in the places of their instances.

use super::refit::{Refitted, refitted};
use super::report::{Place, Worst};
use super::stages::{Between, Failed};
use crate::diagnostic::{Diagnostic, Origin};
use crate::geometry::joined::{Frame, Share, Whole, join};
use crate::geometry::link::BodyPlan;
use crate::geometry::{
    BodySolid, Carving, Fusion, GeometryError, LeastGap, Member, Mesh, MountSolid, MovedState, Part, Parts,
    PartsInput, PlacedSolid, carved_cycle_gaps,
    parts::{HoleSolid, groups},
};
use crate::ir::assembly::Joined;
use crate::ir::{Assembly, Instance};
use nalgebra::Vector3;
use std::sync::Arc;

/// A design in solids.
pub struct Solid {
    /// What its parts are made of.
    pub input: PartsInput,
    /// The parts in the design's coordinates.
    pub parts: Parts,
    /// Its states over the cycle.
    pub states: Vec<MovedState>,
    /// Its free variables.
    pub values: Vec<f64>,
}

/// A design as it is planned.
#[derive(Clone, Debug)]
pub struct Planned {
    /// What its parts are made of.
    pub input: PartsInput,
    /// Its bodies.
    pub plans: Vec<BodyPlan>,
    /// What made way.
    pub carving: Carving,
    /// Its states over the cycle.
    pub states: Vec<MovedState>,
    /// Its free variables.
    pub values: Vec<f64>,
}

/// What is known of a design.
pub(super) struct Known<'s> {
    pub input: &'s PartsInput,
    pub plans: &'s [BodyPlan],
    pub carving: &'s Carving,
    pub states: &'s [MovedState],
    pub values: &'s [f64],
}

impl Solid {
    fn known(&self) -> Known<'_> {
        let Parts { plans, carving, .. } = &self.parts;
        Known { input: &self.input, plans, carving, states: &self.states, values: &self.values }
    }
}

impl Planned {
    fn known(&self) -> Known<'_> {
        let Self { input, plans, carving, states, values } = self;
        Known { input, plans, carving, states, values }
    }
}

/// A printed part.
pub struct Printed {
    /// Name of its file.
    pub name: String,
    /// What declares it.
    pub at: Origin,
    /// Closed solids, in place.
    pub mesh: Mesh,
    /// Its links by themselves, each with the first instance that has the body, and the body's index there.
    pub links: Vec<((usize, usize), Mesh)>,
    /// Its flexures: the instance and the index there.
    pub flexures: Vec<(usize, usize)>,
}

/// Every part as the primitives that it is planned of, not united: what can be looked at, not printed.
pub fn outlines(assembly: &Assembly, solids: &[Solid]) -> Vec<Printed> {
    let mut out = Vec::new();
    for (i, instance) in assembly.instances.iter().enumerate() {
        let Some(solid) = solids.get(instance.design) else { continue };
        for bodies in groups(&solid.input) {
            let link = |b: &usize| {
                let mut mesh = Mesh::default();
                for slot in solid.parts.plans.get(*b)?.meshes(&solid.input.facets) {
                    mesh.append(&slot);
                }
                Some(((i, *b), mesh.placed(&instance.placement)))
            };
            out.push(Printed {
                name: String::new(),
                at: instance.origin,
                mesh: Mesh::default(),
                links: bodies.iter().filter_map(link).collect(),
                flexures: flexures_of(&solid.input, &bodies).map(|f| (i, f)).collect(),
            });
        }
    }
    out
}

/// All printed parts, and findings that do not stop the work. `carved` are the links of the whole, if they are known.
///
/// # Errors
/// Where parts cannot be united.
pub fn parts(
    assembly: &Assembly,
    solids: &[Solid],
    carved: Option<&Carving>,
) -> Result<(Vec<Printed>, Vec<Diagnostic>), Failed> {
    if let (Some(_), [alone]) = (assembly.single(), solids) {
        let print = |part: &Part| Printed {
            name: format!("{}_{}", assembly.name, part.name),
            at: assembly.origin,
            mesh: part.mesh.clone(),
            links: part.bodies.iter().map(|b| (0, *b)).zip(part.links.iter().cloned()).collect(),
            flexures: flexures_of(&alone.input, &part.bodies).map(|f| (0, f)).collect(),
        };
        return Ok((alone.parts.parts.iter().map(print).collect(), Vec::new()));
    }
    let failed = |name: &str, at: Origin| {
        let name = name.to_string();
        move |e: GeometryError| -> Failed {
            vec![Diagnostic::error("E0630", format!("no solid comes out: `{name}`: {e}"), at)]
        }
    };
    let known: Vec<Known<'_>> = solids.iter().map(Solid::known).collect();
    let of_all = || failed(&assembly.name, assembly.origin);
    let refits = refits(assembly, &known, carved.is_none()).map_err(of_all())?;
    let frames = frames(assembly, &known, &refits).map_err(of_all())?;
    let whole = joined(assembly, &known, &refits, &frames, carved).map_err(of_all())?;
    let (mut out, mut found) = (Vec::new(), seats(assembly, &refits, &frames));
    for group in whole.groups() {
        let Some((name, at)) = name(assembly, solids, &whole, &group) else { continue };
        // Repeated instances are named with brackets, which shells and some slicers take for patterns.
        let name = name.replace('[', "-").replace(']', "");
        let (pieces, links) = match alone(assembly, solids, &whole, &group) {
            Some((mesh, links)) => (vec![mesh], links),
            None => whole.build(&group).map_err(failed(&name, at))?,
        };
        let owner = |b: &usize| whole.bodies.get(*b).and_then(|m| m.first()).copied();
        let mut links: Vec<_> =
            group.iter().zip(links).filter_map(|(b, mesh)| Some((owner(b)?, mesh))).collect();
        let flexures = whole.flexures_of(&group);
        let mut flexures: Vec<_> = flexures.iter().filter_map(|f| whole.flexures.get(*f).copied()).collect();
        if pieces.len() > 1 {
            let message = format!(
                "`{name}` is printed in {} pieces: what is to be one body does not touch",
                pieces.len()
            );
            found.push(
                Diagnostic::warning("W0640", message, at)
                    .help("move the instances until the common bodies meet, or join the pieces otherwise"),
            );
        }
        for (k, mesh) in pieces.into_iter().enumerate() {
            let name = if k == 0 { name.clone() } else { format!("{name}_{}", k + 1) };
            // What is told of the whole part stands with its largest piece.
            let (links, flexures) = (std::mem::take(&mut links), std::mem::take(&mut flexures));
            out.push(Printed { name, at, mesh, links, flexures });
        }
    }
    found.extend(in_the_way(assembly, solids, &whole));
    found.extend(not_carved(assembly, solids, &whole));
    Ok((out, found))
}

/// The instances that carry something on their hinges, in solids with it.
fn refits(
    assembly: &Assembly,
    designs: &[Known<'_>],
    with_carving: bool,
) -> Result<Vec<Option<Refitted>>, GeometryError> {
    let instances = 0..assembly.instances.len();
    instances.map(|i| refitted(assembly, i, designs, with_carving).transpose()).collect()
}

/// The instances as one mechanism, from what is known of each design. Bodies of the assembly with points of their own
/// follow the instances, each as a share that stands still ([`own`]). What is `carved` need not be carved again.
fn joined(
    assembly: &Assembly,
    designs: &[Known<'_>],
    refits: &[Option<Refitted>],
    frames: &[(&Joined, Frame)],
    carved: Option<&Carving>,
) -> Result<Whole, GeometryError> {
    let mut known: Vec<(usize, usize)> = Vec::new();
    let mut count = 0;
    let mut shares = Vec::new();
    for (i, instance) in assembly.instances.iter().enumerate() {
        let Some(&Known { mut input, mut plans, mut carving, states, .. }) = designs.get(instance.design)
        else {
            continue;
        };
        if let Some(Some(refit)) = refits.get(i) {
            (input, plans, carving) = (&refit.input, &refit.plans, &refit.carving);
        }
        let mut number = |b: usize| {
            let common = joint_body(assembly, i, b);
            let met = common.and_then(|j| known.iter().find(|k| k.0 == j));
            if let Some((_, number)) = met {
                return *number;
            }
            count += 1;
            known.extend(common.map(|j| (j, count - 1)));
            count - 1
        };
        let bodies = (0..plans.len()).map(&mut number).collect();
        let states = (0..states.len()).filter_map(|s| states.get(instance.state(s))).collect();
        shares.push(Share { input, plans, carving, states, placement: instance.placement, bodies });
    }
    let states = shares.iter().map(|s| s.states.len()).min().unwrap_or(0);
    shares.extend(frames.iter().filter_map(|(joined, frame)| {
        let (_, body) = known.iter().find(|k| assembly.joined.get(k.0) == Some(joined))?;
        Some(frame.share(*body, states))
    }));
    join(&shares, carved)
}

/// What the assembly's bodies have of their own, planned.
fn frames<'a>(
    assembly: &'a Assembly,
    designs: &[Known<'_>],
    refits: &[Option<Refitted>],
) -> Result<Vec<(&'a Joined, Frame)>, GeometryError> {
    let planned = |j: &'a Joined| Some(frame(assembly, j, designs, refits)?.map(|frame| (j, frame)));
    own(assembly).filter_map(planned).collect()
}

/// What a joined body has of its own, planned; none: nothing is known of its members.
fn frame(
    assembly: &Assembly,
    joined: &Joined,
    designs: &[Known<'_>],
    refits: &[Option<Refitted>],
) -> Option<Result<Frame, GeometryError>> {
    let places = assembly.places(|d| designs.get(d).map(|k| k.values));
    let of = |i: usize| assembly.instances.get(i).and_then(|n| Some((n, designs.get(n.design)?)));
    let (_, like) = joined.members.first().and_then(|(i, _)| of(*i))?;
    let skeleton: Vec<Vector3<f64>> = joined.skeleton.iter().map(|p| places.at(*p)).collect();
    let (placed, turned) = (|p| places.at(p), |d: &Vector3<f64>| *d);
    let holes: Vec<HoleSolid> = joined.holes.iter().map(|h| HoleSolid::of(h, placed, turned)).collect();
    // Without points of its own, what is fitted is joined to the nearest place of the members.
    let nearest = |at: &Vector3<f64>| {
        let plans = joined.members.iter().filter_map(|(i, b)| {
            let (instance, known) = of(*i)?;
            let plans = refits.get(*i).and_then(Option::as_ref).map_or(known.plans, |r| &r.plans);
            Some((instance.placement, plans.get(*b)?))
        });
        let places = plans.flat_map(|(p, plan)| {
            plan.slots.iter().flat_map(move |(_, s)| [p.point(&s.start), p.point(&s.end)])
        });
        places.min_by(|p, q| (p - at).norm().total_cmp(&(q - at).norm()))
    };
    let rest = |at: &Vector3<f64>| match skeleton.len() {
        0 => nearest(at).unwrap_or(*at),
        n => skeleton.iter().sum::<Vector3<f64>>() / n as f64,
    };
    let sizes = [like.input.height_mm, like.input.clearance_mm];
    let mount = |m: &crate::ir::Mount| {
        let at = places.at(m.position);
        MountSolid::standing(m, at, m.toward.map(|q| places.at(q)), rest(&at), sizes)
    };
    let mounts: Vec<MountSolid> = joined.fittings.mounts.iter().map(mount).collect();
    let solids = joined.fittings.solids.iter().map(|s| PlacedSolid::of(s, placed, turned));
    let fitted = holes.iter().map(|h| h.point).chain(mounts.iter().map(|m| m.point));
    let ties: Vec<Vector3<f64>> =
        if skeleton.is_empty() { fitted.filter_map(|p| nearest(&p)).collect() } else { Vec::new() };
    let body = BodySolid {
        name: joined.name.clone(),
        skeleton: skeleton.iter().copied().chain(ties).collect(),
        holes,
        mounts,
        solids: solids.collect(),
        ..BodySolid::default()
    };
    Some(Frame::new(body, like.input))
}

/// What is wrong with motors on bodies of the assembly's own, and on hinges of instances.
fn seats(assembly: &Assembly, refits: &[Option<Refitted>], frames: &[(&Joined, Frame)]) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for ((_, design), refit) in assembly.placed().zip(refits) {
        let faults = refit.iter().flat_map(|r| &r.faults);
        found.extend(faults.map(|f| super::solids::fit_fault(design, f)));
    }
    for (joined, frame) in frames {
        let first = joined.members.first().and_then(|(i, _)| assembly.instances.get(*i));
        let design = first.and_then(|i| assembly.designs.get(i.design));
        if let Some(design) = design {
            let faults = frame.plans.iter().flat_map(|p| &p.faults);
            found.extend(faults.map(|f| super::solids::fit_fault(design, f)));
        }
    }
    found
}

/// The bodies of the assembly that have something of their own, in the order of their shares after the instances'.
fn own(assembly: &Assembly) -> impl Iterator<Item = &Joined> {
    assembly.joined.iter().filter(|j| j.has_own() && !j.members.is_empty())
}

/// The group of common bodies that a body belongs to.
fn joint_body(assembly: &Assembly, instance: usize, body: usize) -> Option<usize> {
    assembly.joined.iter().position(|j| j.members.contains(&(instance, body)))
}

/// Whether a part of a design is printed by itself in an instance: none of its bodies belongs to another one too.
pub fn stands_alone(assembly: &Assembly, design: usize, bodies: &[usize]) -> bool {
    let common = |i: usize, b: usize| {
        let joined = joint_body(assembly, i, b).and_then(|j| assembly.joined.get(j));
        joined.is_some_and(|j| j.members.len() > 1 || j.has_own())
    };
    let of_design = |(_, n): &(usize, &Instance)| n.design == design;
    let mut instances = assembly.instances.iter().enumerate().filter(of_design);
    instances.any(|(i, _)| !is_refitted(assembly, i) && bodies.iter().all(|b| !common(i, *b)))
}

/// Whether an instance carries something on its hinges: its parts are not those of its design.
fn is_refitted(assembly: &Assembly, instance: usize) -> bool {
    assembly.hinged(instance).next().is_some()
}

/// The flexures between some bodies of a design.
fn flexures_of(input: &PartsInput, bodies: &[usize]) -> impl Iterator<Item = usize> {
    let inside = |f: &usize| input.flexures.get(*f).is_some_and(|f| bodies.contains(&f.bodies.0));
    (0..input.flexures.len()).filter(inside)
}

/// A part that no other instance has a body of, in its place, and its links in the order of the group.
fn alone(assembly: &Assembly, solids: &[Solid], whole: &Whole, group: &[usize]) -> Option<(Mesh, Vec<Mesh>)> {
    let members: Vec<&(usize, usize)> = group.iter().filter_map(|b| whole.bodies.get(*b)).flatten().collect();
    let [(i, b), ..] = members.as_slice() else { return None };
    if members.len() > group.len() || is_refitted(assembly, *i) {
        return None;
    }
    let instance = assembly.instances.get(*i)?;
    let part = solids.get(instance.design)?.parts.parts.iter().find(|p| p.bodies.contains(b))?;
    let link = |(_, b): &&(usize, usize)| {
        let own = part.bodies.iter().position(|p| p == b).and_then(|k| part.links.get(k));
        own.map(|m| m.placed(&instance.placement)).unwrap_or_default()
    };
    let links = members.iter().map(link).collect();
    Some((part.mesh.placed(&instance.placement).rounded_to_f32().sorted(), links))
}

/// What a group of bodies is called, and what declares it.
fn name(assembly: &Assembly, solids: &[Solid], whole: &Whole, group: &[usize]) -> Option<(String, Origin)> {
    let members = || group.iter().filter_map(|b| whole.bodies.get(*b)).flatten();
    let common = members().filter_map(|(i, b)| joint_body(assembly, *i, *b)).min();
    if let Some(joined) = common.and_then(|j| assembly.joined.get(j)) {
        return Some((format!("{}_{}", assembly.name, joined.name), joined.origin));
    }
    let (i, b) = members().next()?;
    let instance = assembly.instances.get(*i)?;
    let body = solids.get(instance.design)?.input.bodies.get(*b)?;
    Some((format!("{}_{}_{}", assembly.name, instance.name, body.name), instance.origin))
}

/// Two instances that meet.
struct Meeting {
    one: Side,
    other: Side,
    /// Indices of the two.
    pair: (usize, usize),
}

/// What declares one of them, how a member of it is called, and the clearance of its process (mm).
struct Side {
    at: Origin,
    name: String,
    clearance_mm: f64,
}

/// Between which instances something is; none: it is within one, where `told` knows of it.
fn meeting(
    assembly: &Assembly,
    whole: &Whole,
    (a, b): (Member, Member),
    told: impl Fn(usize, Member, Member) -> bool,
) -> Option<Meeting> {
    let (first, second) = (whole.owners(a), whole.owners(b));
    let within = first.iter().find(|i| second.contains(i));
    let (i, j) = match within {
        None => (*first.first()?, *second.first()?),
        Some(i) => {
            if told(*i, whole.within(*i, a)?, whole.within(*i, b)?) {
                return None;
            }
            // A common body: what another instance has of it is in the way, or the assembly itself, which stands last.
            let other = |of: &[usize]| of.iter().rev().copied().find(|k| k != i);
            let other = other(&second).map(|j| (*i, j)).or_else(|| other(&first).map(|j| (j, *i)));
            // Or what stands on the instance's own hinges.
            other.or_else(|| is_refitted(assembly, *i).then_some((*i, *i)))?
        }
    };
    Some(Meeting {
        one: side(assembly, whole, i, a)?,
        other: side(assembly, whole, j, b)?,
        pair: (i.min(j), i.max(j)),
    })
}

/// A member as it stands in an instance, or in the assembly's own bodies after them.
fn side(assembly: &Assembly, whole: &Whole, i: usize, member: Member) -> Option<Side> {
    let clearance = |n: &Instance| assembly.designs.get(n.design).map_or(0.0, |d| d.process.clearance_mm);
    let Some(instance) = assembly.instances.get(i) else {
        let joined = own(assembly).nth(i - assembly.instances.len())?;
        let first = joined.members.first().and_then(|(i, _)| assembly.instances.get(*i))?;
        return Some(Side { at: joined.origin, name: joined.name.clone(), clearance_mm: clearance(first) });
    };
    let design = assembly.designs.get(instance.design)?;
    let name = match whole.within(i, member)? {
        Member::Body(b) => &design.bodies.get(b)?.name,
        Member::Flexure(f) => &design.rods.get(f)?.path,
    };
    Some(Side { at: instance.origin, name: instance.of(name), clearance_mm: clearance(instance) })
}

/// Instances that stand in each other's way in the rest pose, each pair once, at the worst place.
fn in_the_way(assembly: &Assembly, solids: &[Solid], whole: &Whole) -> Vec<Diagnostic> {
    let known = |i: usize, a: Member, b: Member| {
        let solid = assembly.instances.get(i).and_then(|n| solids.get(n.design));
        solid.is_some_and(|s| s.parts.fusions.iter().any(|f| (f.a, f.b) == (a, b) || (f.b, f.a) == (a, b)))
    };
    let mut worst: Vec<(Fusion, Meeting)> = Vec::new();
    for fusion in whole.fusions() {
        let Some(meeting) = meeting(assembly, whole, (fusion.a, fusion.b), known) else { continue };
        match worst.iter_mut().find(|w| w.1.pair == meeting.pair) {
            Some(w) if fusion.depth_mm > w.0.depth_mm => *w = (fusion, meeting),
            Some(_) => {}
            None => worst.push((fusion, meeting)),
        }
    }
    worst.sort_by_key(|w| w.1.pair);
    worst.iter().map(|(f, m)| told(f, m)).collect()
}

fn told(fusion: &Fusion, meeting: &Meeting) -> Diagnostic {
    let Meeting {
        one: Side { at: one, name: a, clearance_mm }, other: Side { at: other, name: b, .. }, ..
    } = meeting;
    let place = near(&fusion.at);
    let d = if fusion.depth_mm > 0.0 {
        Diagnostic::error(
            "E0641",
            format!("`{a}` and `{b}` stand in each other's way in the rest pose"),
            *other,
        )
        .label(format!("they overlap by {:.2} mm {place}", fusion.depth_mm))
    } else {
        let gap = -fusion.depth_mm;
        Diagnostic::warning("W0642", format!("`{a}` and `{b}` are printed {gap:.2} mm apart"), *other)
            .label(format!("{place}; the process needs {clearance_mm:.2} mm"))
    };
    d.also(*one, "the other one").help("move the instances apart, or give them the body in common")
}

fn near(p: &Vector3<f64>) -> String {
    format!("near ({:.1}, {:.1}, {:.1}) mm", p.x, p.y, p.z)
}

/// Common links that could not make way for a flexure, where that is not told of the design alone.
fn not_carved(assembly: &Assembly, solids: &[Solid], whole: &Whole) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for cut in whole.carving.cuts.iter().filter(|c| !c.made) {
        let owner = whole.flexures.get(cut.flexure);
        let Some((i, flexure)) = owner.copied() else { continue };
        let Some(Member::Body(body)) = whole.within(i, Member::Body(cut.body)) else { continue };
        let Some(instance) = assembly.instances.get(i) else { continue };
        let (design, solid) = (assembly.designs.get(instance.design), solids.get(instance.design));
        let (Some(design), Some(solid)) = (design, solid) else { continue };
        let same = |c: &crate::geometry::Cut| (c.body, c.flexure) == (body, flexure) && !c.made;
        if !solid.parts.carving.cuts.iter().any(same) {
            let local = crate::geometry::Cut { body, flexure, ..cut.clone() };
            found.push(super::solids::uncarved(design, &local));
        }
    }
    found
}

/// Gaps between instances over the cycle: what each design says of itself is left out.
pub fn between(assembly: &Assembly, designs: &[&Planned]) -> Between {
    let all: Vec<Known<'_>> = designs.iter().map(|p| p.known()).collect();
    // Where no solid comes out the mesh stage says why.
    let Ok(refits) = refits(assembly, &all, true) else { return Between::default() };
    let Ok(frames) = frames(assembly, &all, &refits) else { return Between::default() };
    let Ok(mut whole) = joined(assembly, &all, &refits, &frames, None) else { return Between::default() };
    let gaps = whole.gaps(|i| !is_refitted(assembly, i));
    let known = |i: usize, a: Member, b: Member| {
        let Some(p) = assembly.instances.get(i).and_then(|n| designs.get(n.design)) else { return false };
        let others = |x: Member, y: Member| (x, y) != (a, b) && (y, x) != (a, b);
        let own = carved_cycle_gaps(&p.plans, &p.states, &p.carving, p.input.clearance_mm, others);
        !own.overlaps.is_empty()
    };
    let told = |o: &LeastGap| Some(collision(o, &meeting(assembly, &whole, (o.a, o.b), known)?));
    let least = gaps.least.iter().flatten().min_by(|a, b| a.gap_mm.total_cmp(&b.gap_mm));
    let nearest = least.and_then(|l| {
        let called = |m: Member| Some(side(assembly, &whole, *whole.owners(m).first()?, m)?.name);
        Some((l.gap_mm, Place { of: vec![called(l.a)?, called(l.b)?], state: l.state }))
    });
    let diagnostics = gaps.overlaps.iter().filter_map(told).collect();
    Between {
        worst: Worst { gap: nearest, ..Worst::default() },
        gaps_mm: gaps.least.iter().filter_map(|g| g.map(|g| g.gap_mm)).collect(),
        diagnostics,
        carving: Some(Arc::new(std::mem::take(&mut whole.carving))),
    }
}

fn collision(worst: &LeastGap, meeting: &Meeting) -> Diagnostic {
    let Meeting { one: Side { at: one, name: a, .. }, other: Side { at: other, name: b, .. }, .. } = meeting;
    let (code, message) = match (worst.a, worst.b) {
        (Member::Body(_), Member::Body(_)) => ("W0635", format!("`{a}` and `{b}` collide on the way")),
        _ => ("W0636", format!("`{b}` rubs against `{a}` on the way")),
    };
    Diagnostic::warning(code, message, *other)
        .label(format!(
            "at state {} they overlap by {:.2} mm {}",
            worst.state,
            -worst.gap_mm,
            near(&worst.at)
        ))
        .also(*one, "the other one")
        .help("move the instances apart, or narrow what they drive")
}
