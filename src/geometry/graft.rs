//! One solid of links and the flexures between them. A flexure's middle, which nothing is near, never sees the boolean
//! kernel: it is cut off before, and put back onto the same vertices afterwards.

use super::mesh::Mesh;
use super::touch::{Solid, clusters, neighbours};
use super::union::{BooleanError, shaken, union_layers};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Stretches between sections in a middle that is worth being cut off.
const LEAST_STRETCHES: usize = 4;

/// Links and swept flexures as one closed mesh.
///
/// # Errors
/// A failure of the kernel.
pub(super) fn united(links: &[Mesh], flexures: &[Mesh]) -> Result<Mesh, BooleanError> {
    let shaken: Vec<Mesh> =
        links.iter().chain(flexures).enumerate().map(|(i, m)| shaken(m, i as u64)).collect();
    let solids: Vec<Solid<'_>> = shaken.par_iter().map(Solid::new).collect();
    let cut: Vec<Option<Cut>> = (links.len()..shaken.len())
        .into_par_iter()
        .map(|i| {
            let others: Vec<&Solid<'_>> =
                solids.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, s)| s).collect();
            Cut::new(&solids[i], &others)
        })
        .collect();
    drop(solids);
    let mut pieces: Vec<Mesh> = shaken.iter().take(links.len()).cloned().collect();
    for (flexure, cut) in shaken.iter().skip(links.len()).zip(&cut) {
        match cut {
            Some(cut) => pieces.extend(cut.ends.iter().cloned()),
            None => pieces.push(flexure.clone()),
        }
    }
    let cut: Vec<Cut> = cut.into_iter().flatten().collect();
    let near = neighbours(&pieces);
    let united = clusters(&near)
        .par_iter()
        .map(|members| union_layers(&pieces, members, &near))
        .collect::<Result<Vec<Mesh>, _>>()?;
    let mut whole = Mesh::default();
    united.iter().for_each(|m| whole.append(m));
    if grafted(&mut whole, &cut) {
        return Ok(whole);
    }
    // The kernel changed a section that it had no reason to touch.
    let all: Vec<usize> = (0..shaken.len()).collect();
    union_layers(&shaken, &all, &neighbours(&shaken))
}

/// A flexure in three: both ends as closed solids, and what is between them.
struct Cut {
    ends: [Mesh; 2],
    /// Centres of the faces that close the ends.
    centers: [Vector3<f64>; 2],
    /// Open at both ends, where it has the vertices of those faces' rims, and no other vertices of theirs.
    middle: Mesh,
    /// Vertices of a rim.
    around: usize,
}

impl Cut {
    /// Cuts a flexure, as [`super::FlexureSolid::mesh`] lays its vertices: section by section, then the centres of the first
    /// and the last one. None where no stretch is free of all other solids.
    fn new(flexure: &Solid<'_>, others: &[&Solid<'_>]) -> Option<Self> {
        let mesh = flexure.mesh;
        let sections = mesh.vertices.len().checked_sub(2)?;
        let around = mesh.triangles.iter().filter(|t| t.contains(&sections)).count();
        if around == 0 || sections % around != 0 {
            return None;
        }
        // The stretch after a section that a triangle belongs to; none: it is part of an end face.
        let stretch = |t: &[usize; 3]| {
            let (low, high) = (t.iter().min()? / around, t.iter().max()? / around);
            (t.iter().all(|i| *i < sections) && high == low + 1).then_some(low)
        };
        let mut of_stretch: Vec<Vec<usize>> = vec![Vec::new(); sections / around - 1];
        let mut faces = 0;
        for (t, ids) in mesh.triangles.iter().enumerate() {
            match stretch(ids) {
                Some(k) => of_stretch[k].push(t),
                None => faces += 1,
            }
        }
        if faces != 2 * around {
            return None;
        }
        let free: Vec<bool> = of_stretch
            .iter()
            .map(|own| !others.iter().any(|other| other.crosses(flexure, own.iter().copied())))
            .collect();
        // The longest free run between two places where it is held, without the stretches beside those.
        let (mut best, mut from) = (0..0, None);
        for (k, is_free) in free.iter().enumerate() {
            if *is_free {
                continue;
            }
            if let Some(from) = from.filter(|f| k - f > best.len()) {
                best = from..k;
            }
            from = Some(k + 1);
        }
        let (low, high) = (best.start + 1, best.end.saturating_sub(1));
        if best.len() < LEAST_STRETCHES + 2 {
            return None;
        }
        let center = |section: usize| {
            let rim = &mesh.vertices[section * around..(section + 1) * around];
            rim.iter().sum::<Vector3<f64>>() / around as f64
        };
        // Inside of something nothing is crossed either.
        let inside = center((low + high) / 2);
        if others.iter().any(|other| other.holds(&inside)) {
            return None;
        }
        let part = |keep: &dyn Fn(usize) -> bool| {
            let kept = mesh.triangles.iter().filter(|t| stretch(t).is_some_and(keep));
            Mesh { vertices: mesh.vertices.clone(), triangles: kept.copied().collect() }
        };
        let centers = [center(low), center(high)];
        let mut ends = [part(&|k| k < low), part(&|k| k >= high)];
        let last = sections + 1;
        ends[0].triangles.extend(mesh.triangles.iter().filter(|t| t.contains(&sections)));
        ends[1].triangles.extend(mesh.triangles.iter().filter(|t| t.contains(&last)));
        for (end, (section, center)) in ends.iter_mut().zip([low, high].into_iter().zip(centers)) {
            let middle = end.vertices.len();
            end.vertices.push(center);
            for j in 0..around {
                let (a, b) = (section * around + j, section * around + (j + 1) % around);
                end.triangles.push(if section == low { [a, b, middle] } else { [b, a, middle] });
            }
            end.drop_unused_vertices();
        }
        let mut middle = part(&|k| (low..high).contains(&k));
        middle.drop_unused_vertices();
        Some(Self { ends, centers, middle, around })
    }
}

fn key(p: &Vector3<f64>) -> [u64; 3] {
    [p.x, p.y, p.z].map(f64::to_bits)
}

/// Opens the ends of all cut flexures and puts their middles between them; false where one is not there as it was.
fn grafted(whole: &mut Mesh, cuts: &[Cut]) -> bool {
    // Only looked up, so its order does not matter.
    let place: HashMap<[u64; 3], usize> =
        whole.vertices.iter().enumerate().map(|(i, p)| (key(p), i)).collect();
    let mut is_center = vec![false; whole.vertices.len()];
    for p in cuts.iter().flat_map(|c| &c.centers) {
        match place.get(&key(p)) {
            Some(i) => is_center[*i] = true,
            None => return false,
        }
    }
    let before = whole.triangles.len();
    whole.triangles.retain(|t| !t.iter().any(|i| is_center[*i]));
    if before - whole.triangles.len() != cuts.iter().map(|c| 2 * c.around).sum::<usize>() {
        return false;
    }
    for cut in cuts {
        let mut met = 0;
        let ids: Vec<usize> = cut
            .middle
            .vertices
            .iter()
            .map(|p| match place.get(&key(p)) {
                Some(i) => {
                    met += 1;
                    *i
                }
                None => {
                    whole.vertices.push(*p);
                    whole.vertices.len() - 1
                }
            })
            .collect();
        if met != 2 * cut.around {
            return false;
        }
        whole.triangles.extend(cut.middle.triangles.iter().map(|t| t.map(|i| ids[i])));
    }
    whole.drop_unused_vertices();
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::union::union_all;
    use crate::geometry::{Facets, FlexureSolid, Slot, check_mesh};
    use crate::rod::SectionShape;

    const VOLUME: f64 = 1e-6;

    fn block(x: f64) -> Mesh {
        let at = Vector3::new(x, 0.3, 0.0);
        Slot::bar(at, at + Vector3::y() * 4.0, Vector3::z(), 3.0, 4.0, 0.8).mesh(&Facets::default(), 0.0)
    }

    /// A leaf of 20 mm from x = 0 on, bent a little.
    fn leaf(y: f64) -> Mesh {
        let n = 21;
        let x = |k: i32| f64::from(k) * 20.0 / f64::from(n - 1);
        let at = |k: i32| Vector3::new(x(k), y + 0.02 * x(k) * (20.0 - x(k)), 0.0);
        let tangent = |k: i32| (at(k + 1) - at(k - 1)).normalize();
        let leaf = FlexureSolid {
            path: "leaf".into(),
            joint: 0,
            joint_point: Vector3::zeros(),
            bodies: (0, 1),
            section: SectionShape::Ellipse,
            centreline: (0..n).map(at).collect(),
            m1: (0..n).map(|k| Vector3::z().cross(&tangent(k))).collect(),
            m2: vec![Vector3::z(); n as usize],
            a_mm: vec![0.4; n as usize],
            b_mm: vec![2.5; n as usize],
            fillets: [None; 2],
        };
        leaf.mesh(64)
    }

    fn same(links: &[Mesh], leaves: &[Mesh]) {
        let all: Vec<Mesh> = links.iter().chain(leaves).cloned().collect();
        let (ours, kernels) = (united(links, leaves).unwrap(), union_all(&all).unwrap());
        let facts = check_mesh(&ours.rounded_to_f32());
        assert!(facts.is_printable(), "{facts:?}");
        assert!((ours.volume_mm3() / kernels.volume_mm3() - 1.0).abs() < VOLUME);
    }

    #[test]
    fn leaves_between_two_blocks_are_cut_off_and_put_back() {
        let links = [block(-2.0), block(22.0)];
        let leaves = [leaf(0.5), leaf(3.0)];
        let solids: Vec<Solid<'_>> = links.iter().chain(&leaves).map(Solid::new).collect();
        let others = [&solids[0], &solids[1], &solids[3]];
        let cut = Cut::new(&solids[2], &others).unwrap();
        assert!(cut.middle.triangles.len() > leaves[0].triangles.len() / 2);
        assert!(cut.ends.iter().all(|e| check_mesh(&e.clone().rounded_to_f32()).is_printable()));
        same(&links, &leaves);
    }

    /// What stands in a leaf's way is united with it, wherever it is; a leaf that ends in the open keeps its end.
    #[test]
    fn whatever_touches_is_united() {
        same(&[block(-2.0), block(22.0), block(9.0)], &[leaf(0.5)]);
        same(&[block(-2.0)], &[leaf(0.5)]);
        // All of it is inside.
        let large = Slot::capsule(Vector3::new(-5.0, 2.0, 0.0), Vector3::new(25.0, 2.0, 0.0), 12.0);
        same(&[large.mesh(&Facets::default(), 0.0)], &[leaf(0.5)]);
    }

    #[test]
    fn a_section_that_is_not_there_as_it_was_is_told() {
        let (links, leaf) = ([block(-2.0), block(22.0)], leaf(0.5));
        let solids: Vec<Solid<'_>> = links.iter().map(Solid::new).collect();
        let cut = Cut::new(&Solid::new(&leaf), &solids.iter().collect::<Vec<_>>()).unwrap();
        let mut whole = Mesh::default();
        cut.ends.iter().for_each(|e| whole.append(e));
        let mut moved = whole.clone();
        moved.vertices.iter_mut().find(|p| cut.middle.vertices.contains(p)).unwrap().x += 1e-9;
        assert!(grafted(&mut whole, std::slice::from_ref(&cut)));
        assert!(check_mesh(&whole.rounded_to_f32()).is_printable());
        assert!(!grafted(&mut moved, &[cut]));
    }
}
