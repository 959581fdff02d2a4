//! The printed parts of an assembly: those of its designs, in the places of their instances.

use super::stages::Failed;
use crate::diagnostic::Diagnostic;
use crate::geometry::joined::{Share, Standing, frame, unite};
use crate::geometry::link::BodyPlan;
use crate::geometry::{Facets, Mesh, Parts, PartsInput};
use crate::ir::{Assembly, Instance, Origin, Placement};
use nalgebra::Vector3;

/// A design in solids.
pub struct Solid {
    /// What its parts are made of.
    pub input: PartsInput,
    /// The parts in the design's coordinates.
    pub parts: Parts,
}

/// A part of an instance: indices of both.
type PartOf = (usize, usize);

/// A printed part.
pub struct Printed {
    /// Name of its file.
    pub name: String,
    /// Closed solids, in place.
    pub mesh: Mesh,
}

/// All printed parts, and findings that do not stop the work.
///
/// # Errors
/// Where parts cannot be united.
pub fn parts(assembly: &Assembly, solids: &[Solid]) -> Result<(Vec<Printed>, Vec<Diagnostic>), Failed> {
    let (mut out, mut found) = (Vec::new(), Vec::new());
    let frames = frames(assembly, solids)?;
    for group in groups(assembly, solids) {
        let share = |&(i, p): &PartOf| {
            let instance = assembly.instances.get(i)?;
            let solid = solids.get(instance.design)?;
            let part = solid.parts.parts.get(p)?;
            let common = part.bodies.iter().filter(|b| joint_body(assembly, i, **b).is_some());
            Some(Share {
                mesh: &part.mesh,
                placement: instance.placement,
                common: common.filter_map(|b| solid.parts.plans.get(*b)).collect(),
            })
        };
        let own = frames.iter().filter(|f| group.iter().any(|part| holds(assembly, solids, part, f.joined)));
        let own = own.map(|f| Share { mesh: &f.mesh, placement: Placement::IDENTITY, common: vec![&f.plan] });
        let shares: Vec<Share<'_>> = group.iter().filter_map(share).chain(own).collect();
        let (name, at) = name(assembly, solids, &group);
        let pieces = unite(&shares, &Facets::default()).map_err(|e| {
            vec![Diagnostic::error(
                "E0630",
                format!("no solid comes out: `{name}` cannot be united: {e}"),
                at,
            )]
        })?;
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
            out.push(Printed { name, mesh });
        }
    }
    found.extend(in_the_way(assembly, solids, &frames));
    Ok((out, found))
}

/// What a body of the assembly adds to the grounds merged into it.
struct Frame {
    /// Index into [`Assembly::joined`].
    joined: usize,
    mesh: Mesh,
    plan: BodyPlan,
}

/// The bodies of the assembly that have points of their own, as thick as the links of the first ground merged into each.
fn frames(assembly: &Assembly, solids: &[Solid]) -> Result<Vec<Frame>, Failed> {
    let mut out = Vec::new();
    for (index, joined) in assembly.joined.iter().enumerate().filter(|(_, j)| !j.skeleton.is_empty()) {
        let first = joined.members.first().and_then(|(i, _)| assembly.instances.get(*i));
        let Some(like) = first.and_then(|i| solids.get(i.design)) else { continue };
        let points: Vec<Vector3<f64>> = joined.skeleton.iter().map(|p| Vector3::from(*p)).collect();
        let (mesh, plan) = frame(&joined.name, &points, &like.input).map_err(|e| {
            vec![Diagnostic::error("E0630", format!("no solid comes out: {e}"), joined.origin)]
        })?;
        out.push(Frame { joined: index, mesh, plan });
    }
    Ok(out)
}

/// Whether a part of an instance has a body that belongs to a common one.
fn holds(assembly: &Assembly, solids: &[Solid], (i, p): &PartOf, joined: usize) -> bool {
    let design = assembly.instances.get(*i).map(|n| n.design);
    let part = design.and_then(|d| solids.get(d)?.parts.parts.get(*p));
    part.is_some_and(|part| part.bodies.iter().any(|b| joint_body(assembly, *i, *b) == Some(joined)))
}

/// The group of common bodies that a body belongs to.
fn joint_body(assembly: &Assembly, instance: usize, body: usize) -> Option<usize> {
    assembly.joined.iter().position(|j| j.members.contains(&(instance, body)))
}

/// Parts that have bodies in common, in the order of their first members.
fn groups(assembly: &Assembly, solids: &[Solid]) -> Vec<Vec<PartOf>> {
    /// Common bodies, and the parts they are in.
    #[derive(Default)]
    struct Group {
        bodies: Vec<usize>,
        members: Vec<PartOf>,
    }
    let mut groups: Vec<Group> = Vec::new();
    for (i, instance) in assembly.instances.iter().enumerate() {
        let parts = solids.get(instance.design).map(|s| s.parts.parts.as_slice()).unwrap_or_default();
        for (p, part) in parts.iter().enumerate() {
            let bodies = part.bodies.iter().filter_map(|b| joint_body(assembly, i, *b)).collect();
            let mut group = Group { bodies, members: vec![(i, p)] };
            let meets = |g: &Group| g.bodies.iter().any(|j| group.bodies.contains(j));
            let (touched, rest): (Vec<Group>, Vec<Group>) = groups.into_iter().partition(meets);
            for other in touched {
                group.bodies.extend(other.bodies);
                group.members.extend(other.members);
            }
            group.members.sort_unstable();
            groups = rest;
            groups.push(group);
        }
    }
    let mut out: Vec<Vec<PartOf>> = groups.into_iter().map(|g| g.members).collect();
    out.sort();
    out
}

/// What a group of parts is called, and what declares it.
fn name(assembly: &Assembly, solids: &[Solid], group: &[PartOf]) -> (String, Origin) {
    let Some((i, p)) = group.first() else { return (assembly.name.clone(), assembly.origin) };
    let Some(instance) = assembly.instances.get(*i) else { return (assembly.name.clone(), assembly.origin) };
    let part_of = |i: usize, p: usize| {
        let design = assembly.instances.get(i)?.design;
        solids.get(design)?.parts.parts.get(p)
    };
    let common = group.iter().filter_map(|(i, p)| Some((*i, part_of(*i, *p)?)));
    let first = common
        .flat_map(|(i, part)| part.bodies.iter().filter_map(move |b| joint_body(assembly, i, *b)))
        .min();
    if let Some(joined) = first.and_then(|j| assembly.joined.get(j)) {
        return (format!("{}_{}", assembly.name, joined.name), joined.origin);
    }
    let part = part_of(*i, *p).map_or("", |part| part.name.as_str());
    let own = if instance.name.is_empty() { part.to_string() } else { format!("{}_{part}", instance.name) };
    (format!("{}_{own}", assembly.name), instance.origin)
}

/// Something that stands in the assembly: where it is declared, the clearance of its process (mm), and its members.
struct Whole {
    origin: Origin,
    clearance_mm: f64,
    members: Vec<Member>,
}

/// What something is called, the common body it is, and where it stands.
type Member = (String, Option<usize>, Standing);

/// Instances, and bodies of the assembly's own, that stand in each other's way in the rest pose, each pair once, at
/// the worst place.
fn in_the_way(assembly: &Assembly, solids: &[Solid], frames: &[Frame]) -> Vec<Diagnostic> {
    let clearance = |design: usize| assembly.designs.get(design).map_or(0.0, |d| d.process.clearance_mm);
    let instances = assembly.instances.iter().enumerate().map(|(i, instance)| Whole {
        origin: instance.origin,
        clearance_mm: clearance(instance.design),
        members: solids.get(instance.design).map_or(Vec::new(), |s| members(assembly, i, instance, s)),
    });
    let own = frames.iter().filter_map(|f| {
        let joined = assembly.joined.get(f.joined)?;
        let first = joined.members.first().and_then(|(i, _)| assembly.instances.get(*i));
        let standing = Standing::body(&f.plan, &Placement::IDENTITY);
        Some(Whole {
            origin: joined.origin,
            clearance_mm: first.map_or(0.0, |i| clearance(i.design)),
            members: vec![(joined.name.clone(), Some(f.joined), standing)],
        })
    });
    let standing: Vec<Whole> = instances.chain(own).collect();
    let mut found = Vec::new();
    for (i, first) in standing.iter().enumerate() {
        for second in standing.iter().skip(i + 1) {
            let mut worst: Option<(f64, Vector3<f64>, &str, &str)> = None;
            for (name, joined, a) in &first.members {
                for (also, joined_too, b) in &second.members {
                    // What is one body is not in its own way.
                    if joined.is_some() && joined == joined_too {
                        continue;
                    }
                    let bound = worst.map_or(first.clearance_mm, |w| w.0);
                    if let Some((gap, at)) = a.gap(b, bound) {
                        worst = Some((gap, at, name, also));
                    }
                }
            }
            if let Some((gap, at, a, b)) = worst {
                found.push(told(gap, at, (a, first.origin), (b, second.origin), first.clearance_mm));
            }
        }
    }
    found
}

/// Bodies and flexures of an instance.
fn members(assembly: &Assembly, index: usize, instance: &Instance, solid: &Solid) -> Vec<Member> {
    let p = &instance.placement;
    let bodies = solid.input.bodies.iter().zip(&solid.parts.plans).enumerate();
    let bodies = bodies.map(|(b, (body, plan))| {
        (instance.of(&body.name), joint_body(assembly, index, b), Standing::body(plan, p))
    });
    let flexures = solid.input.flexures.iter().map(|f| (instance.of(&f.path), None, Standing::flexure(f, p)));
    bodies.chain(flexures).collect()
}

fn told(
    gap: f64,
    at: Vector3<f64>,
    (a, one): (&str, Origin),
    (b, other): (&str, Origin),
    clearance: f64,
) -> Diagnostic {
    let place = format!("near ({:.1}, {:.1}, {:.1}) mm", at.x, at.y, at.z);
    let d = if gap < 0.0 {
        Diagnostic::error(
            "E0641",
            format!("`{a}` and `{b}` stand in each other's way in the rest pose"),
            other,
        )
        .label(format!("they overlap by {:.2} mm {place}", -gap))
    } else {
        Diagnostic::warning("W0642", format!("`{a}` and `{b}` are printed {gap:.2} mm apart"), other)
            .label(format!("{place}; the process needs {clearance:.2} mm"))
    };
    d.also(one, "the other one").help("move the instances apart, or give them the body in common")
}
