//! The printed parts of an assembly: those of its designs, in the places of their instances.

use super::stages::Failed;
use crate::diagnostic::Diagnostic;
use crate::geometry::joined::{Share, Standing, unite};
use crate::geometry::{Facets, Mesh, Parts, PartsInput};
use crate::ir::{Assembly, Instance};

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
        let shares: Vec<Share<'_>> = group.iter().filter_map(share).collect();
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
    found.extend(in_the_way(assembly, solids));
    Ok((out, found))
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
fn name(assembly: &Assembly, solids: &[Solid], group: &[PartOf]) -> (String, crate::ir::Origin) {
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

/// Instances that stand in each other's way in the rest pose, each pair once, at the worst place.
fn in_the_way(assembly: &Assembly, solids: &[Solid]) -> Vec<Diagnostic> {
    let standing: Vec<Vec<(String, Option<usize>, Standing)>> = assembly
        .instances
        .iter()
        .enumerate()
        .map(|(i, instance)| match solids.get(instance.design) {
            Some(solid) => members(assembly, i, instance, solid),
            None => Vec::new(),
        })
        .collect();
    let mut found = Vec::new();
    for (i, first) in standing.iter().enumerate() {
        for (j, second) in standing.iter().enumerate().skip(i + 1) {
            let (Some(one), Some(other)) = (assembly.instances.get(i), assembly.instances.get(j)) else {
                continue;
            };
            let bound = assembly.designs.get(one.design).map_or(0.0, |d| d.process.clearance_mm);
            let mut worst: Option<(f64, nalgebra::Vector3<f64>, &str, &str)> = None;
            for (name, joined, a) in first {
                for (also, joined_too, b) in second {
                    // What is one body is not in its own way.
                    if joined.is_some() && joined == joined_too {
                        continue;
                    }
                    let bound = worst.map_or(bound, |w| w.0);
                    if let Some((gap, at)) = a.gap(b, bound) {
                        worst = Some((gap, at, name, also));
                    }
                }
            }
            if let Some((gap, at, a, b)) = worst {
                found.push(told(gap, at, (a, one), (b, other), bound));
            }
        }
    }
    found
}

/// Bodies and flexures of an instance: what each is called, the common body it is, and where it stands.
fn members(
    assembly: &Assembly,
    index: usize,
    instance: &Instance,
    solid: &Solid,
) -> Vec<(String, Option<usize>, Standing)> {
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
    at: nalgebra::Vector3<f64>,
    (a, one): (&str, &Instance),
    (b, other): (&str, &Instance),
    clearance: f64,
) -> Diagnostic {
    let place = format!("near ({:.1}, {:.1}, {:.1}) mm", at.x, at.y, at.z);
    let d = if gap < 0.0 {
        Diagnostic::error(
            "E0641",
            format!("`{a}` and `{b}` stand in each other's way in the rest pose"),
            other.origin,
        )
        .label(format!("they overlap by {:.2} mm {place}", -gap))
    } else {
        Diagnostic::warning("W0642", format!("`{a}` and `{b}` are printed {gap:.2} mm apart"), other.origin)
            .label(format!("{place}; the process needs {clearance:.2} mm"))
    };
    d.also(one.origin, "the other one").help("move the instances apart, or give them the body in common")
}
