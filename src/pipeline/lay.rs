//! Printed parts on the bed, and what to say of them.

use super::bill::bought;
use super::joined::Printed;
use super::scene::Moving;
use crate::diagnostic::Diagnostic;
use crate::emit::outlines::layer_name;
use crate::emit::plate::{Laid, Leaf, Plate};
use crate::geometry::{Band, FlexureSolid, Mesh, MeshFacts, Posture, lie};
use crate::ir::{Assembly, Origin};
use rayon::prelude::*;

/// A plate's section half-way and those nearer to its faces differ by no more than this part of it: those of prisms differ by
/// 1e-6 at most, rounded steps in Klann's frame by 7e-5, its leaves of elliptic section by 8e-4 to 4e-2.
const EVEN: f64 = 3e-4;

/// Every part as it lies on its machine. `moving` is that of each design.
pub fn plate(assembly: &Assembly, moving: &[Moving], printed: &[Printed]) -> Plate {
    let lay = |part: &Printed| {
        let design = |i: usize| assembly.designs.get(assembly.instances.get(i)?.design);
        let first = part.links.first().map_or(0, |((i, _), _)| *i);
        let (process, material) = design(first).map(|d| (d.process.clone(), d.material.clone()))?;
        let placed = |(i, f): &(usize, usize)| {
            let instance = assembly.instances.get(*i)?;
            let flexure = moving.get(instance.design)?.rest.get(*f)?;
            Some(FlexureSolid { path: instance.of(&flexure.path), ..flexure.placed(&instance.placement) })
        };
        let flexures: Vec<FlexureSolid> = part.flexures.iter().filter_map(placed).collect();
        let lying = lie(&part.mesh, &flexures.iter().collect::<Vec<_>>(), process.machine.bed_mm)?;
        let (mesh, facts) = lying.mesh(&part.mesh);
        Some(Laid {
            name: part.name.clone(),
            mesh,
            facts,
            lying,
            material,
            process,
            flexures: flexures.iter().map(leaf).collect(),
        })
    };
    Plate {
        name: assembly.name.clone(),
        parts: printed.par_iter().filter_map(lay).collect(),
        bought: bought(assembly),
    }
}

fn leaf(flexure: &FlexureSolid) -> Leaf {
    let range = |v: &[f64]| {
        let ends = v.iter().fold([f64::INFINITY, 0.0_f64], |[l, h], x| [l.min(*x), h.max(*x)]);
        ends.map(|x| 2.0 * x)
    };
    Leaf { path: flexure.path.clone(), thickness_mm: range(&flexure.a_mm), width_mm: range(&flexure.b_mm) }
}

/// Parts that no cutter makes of plates: there are heights between which their section changes.
pub fn uneven(plate: &Plate, cut: &[Vec<Band>], at: Origin) -> Vec<Diagnostic> {
    let worst = |(part, bands): (&Laid, &Vec<Band>)| {
        let worst = bands.iter().max_by(|a, b| a.uneven.total_cmp(&b.uneven))?;
        (worst.uneven > EVEN).then(|| (part.name.clone(), worst.clone()))
    };
    let told = |(name, band): (String, Band)| {
        Diagnostic::warning(
            "W0650",
            format!("`{name}` is not made of plates: what its DXF shows are sections"),
            at,
        )
        .label(format!("in `{}` its section changes by {:.0} %", layer_name(&band), 100.0 * band.uneven))
        .help("give its flexures a `section rect`, and lay out its joints so that all axes are upright")
    };
    plate.parts.iter().zip(cut).filter_map(worst).map(told).collect()
}

/// A part as written that is no solid, or not one: what the user would otherwise learn from the slicer.
fn unsound(name: &str, mesh: &Mesh, facts: &MeshFacts, at: Origin) -> Option<Diagnostic> {
    if facts.is_printable() {
        return None;
    }
    let crossing = || {
        let corner = |(t, _): &(usize, usize)| mesh.vertices.get(*mesh.triangles.get(*t)?.first()?);
        let place = facts.examples.first().and_then(corner);
        let place = place.map(|p| format!(", first near ({:.1}, {:.1}, {:.1}) mm on the bed", p.x, p.y, p.z));
        format!(
            "crosses itself in {} pairs of triangles{}",
            facts.self_intersections,
            place.unwrap_or_default()
        )
    };
    let what = match facts {
        f if !f.closed || !f.oriented => "is not closed".to_string(),
        f if f.self_intersections > 0 => crossing(),
        f if f.flat > 0 || f.pinched > 0 => "touches itself in single points".to_string(),
        f if f.components > 1 => format!("is in {} pieces", f.components),
        _ => "is inside out".to_string(),
    };
    let found = Diagnostic::warning("W0659", format!("`{name}` is not one sound solid"), at)
        .label(format!("its surface {what}"))
        .help("look at that place in the slicer, which may repair it; what a little other layer, point or thickness moves elsewhere is gone");
    Some(found)
}

/// Parts that are not sound or do not fit, and flexures that leave the layers of a process that is weak across them.
pub fn findings(assembly: &Assembly, plate: &Plate, printed: &[Printed]) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for part in &plate.parts {
        let at = printed.iter().find(|p| p.name == part.name).map_or(assembly.origin, |p| p.at);
        found.extend(unsound(&part.name, &part.mesh, &part.facts, at));
        let (process, size) = (&part.process, part.lying.size_mm);
        if let (Some(false), Some([x, y, z])) = (part.fits(), process.machine.bed_mm) {
            let message = format!("`{}` does not fit on the bed of `{}`", part.name, process.name);
            found.push(
                Diagnostic::warning("W0645", message, at)
                    .label(format!(
                        "lying it is {:.0} × {:.0} × {:.0} mm, the bed {x} × {y} × {z} mm",
                        size.x, size.y, size.z
                    ))
                    .help("make the mechanism smaller, or print on a process that states the larger bed of your machine"),
            );
        }
        let Some(across) = process.machine.across.filter(|a| *a < 1.0) else { continue };
        let worst = part.postures().filter_map(|(leaf, p)| match p {
            Posture::Leaning(angle) => Some((leaf, angle)),
            _ => None,
        });
        let leaning: Vec<_> = worst.collect();
        let Some((leaf, angle)) = leaning.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        let message = format!(
            "`{}` cannot be laid so that all its flexures run within the layers: {} of {} leave them",
            part.name,
            leaning.len(),
            part.flexures.len()
        );
        found.push(
            Diagnostic::warning("W0644", message, at)
                .label(format!(
                    "`{}` by {:.0}°; across its layers `{}` bears {:.0} % of what it bears within",
                    leaf.path,
                    angle.to_degrees(),
                    process.name,
                    across * 100.0
                ))
                .help("require less stress (`require max(stress()) <= …`), print it on a process without weak layers, or turn these joints' axes into one direction"),
        );
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Facets, Slot, check_mesh};
    use nalgebra::Vector3;

    /// What is told of balls around these places.
    fn told(places: &[f64], spoil: impl Fn(&mut Mesh)) -> String {
        let mut mesh = Mesh::default();
        for x in places {
            let at = Vector3::new(*x, 0.0, 0.0);
            mesh.append(&Slot::capsule(at, at + Vector3::x() * 1e-3, 5.0).mesh(&Facets::default(), 0.0));
        }
        spoil(&mut mesh);
        let found = unsound("arm", &mesh, &check_mesh(&mesh), Origin::default());
        found
            .map(|d| {
                format!("{} {}", d.message, d.labels.iter().map(|l| l.text.as_str()).collect::<String>())
            })
            .unwrap_or_default()
    }

    #[test]
    fn a_part_that_is_no_sound_solid_is_told() {
        assert_eq!(told(&[0.0], |_| ()), "");
        assert!(
            told(&[0.0, 20.0], |_| ()).ends_with("`arm` is not one sound solid its surface is in 2 pieces")
        );
        let crossing = told(&[0.0, 6.0], |_| ());
        assert!(crossing.contains("crosses itself in ") && crossing.contains("first near ("), "{crossing}");
        assert!(told(&[0.0], |m| m.triangles.truncate(9)).ends_with("is not closed"));
        assert!(
            told(&[0.0], |m| m.triangles.iter_mut().for_each(|t| t.swap(0, 1))).ends_with("is inside out")
        );
    }
}
