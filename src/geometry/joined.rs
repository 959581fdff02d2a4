//! Parts of several instances: moved to their places, united where a body is common, compared where not.

use super::distance::separation;
use super::link::{BodyPlan, BoreCut};
use super::mesh::Mesh;
use super::parts::{BodySolid, FlexureSolid, GeometryError, PartsInput, build_parts};
use super::slot::{Facets, Slot};
use super::tidy::{SHORT_EDGE_MM, without_short_edges};
use super::union::{BooleanError, subtract_all, union_all};
use crate::ir::Placement;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A bore is cut once more, this much wider and longer, where another instance has grown into it: no two faces
/// then coincide, mm.
const RECUT_MM: f64 = 0.01;
/// Bores whose ends are nearer than this are one, mm.
const SAME_BORE_MM: f64 = 1e-6;

impl Mesh {
    /// The mesh in another place; a mirror image keeps its outside outside.
    pub fn placed(&self, placement: &Placement) -> Mesh {
        let vertices = self.vertices.iter().map(|p| placement.point(p)).collect();
        let turned = placement.is_mirrored();
        let triangles =
            self.triangles.iter().map(|[a, b, c]| if turned { [*a, *c, *b] } else { [*a, *b, *c] });
        Mesh { vertices, triangles: triangles.collect() }
    }
}

impl Slot {
    /// The slot in another place.
    pub fn placed(&self, placement: &Placement) -> Slot {
        Slot {
            start: placement.point(&self.start),
            end: placement.point(&self.end),
            axis: placement.direction(&self.axis),
            ..*self
        }
    }
}

impl BoreCut {
    fn placed(&self, placement: &Placement) -> BoreCut {
        BoreCut { start: placement.point(&self.start), end: placement.point(&self.end), ..*self }
    }

    /// The cylinder, grown by a margin.
    fn slot(&self, margin_mm: f64) -> Slot {
        let (middle, half) = ((self.start + self.end) / 2.0, (self.end - self.start).norm() / 2.0);
        Slot {
            start: middle,
            end: middle,
            axis: (self.end - self.start).try_normalize(0.0).unwrap_or_else(Vector3::z),
            disc_radius_mm: self.diameter_mm / 2.0 + margin_mm,
            half_height_mm: half + margin_mm,
            round_mm: 0.0,
        }
    }

    fn is(&self, other: &BoreCut) -> bool {
        let ends = |a: &Vector3<f64>, b: &Vector3<f64>| {
            (self.start - a).norm().max((self.end - b).norm()) < SAME_BORE_MM
        };
        ends(&other.start, &other.end) || ends(&other.end, &other.start)
    }
}

/// A printed part of an instance, with those of its bodies that other instances have too.
#[derive(Clone, Debug)]
pub struct Share<'p> {
    /// The part's solid in its design.
    pub mesh: &'p Mesh,
    /// Where the instance stands.
    pub placement: Placement,
    /// Plans of the common bodies.
    pub common: Vec<&'p BodyPlan>,
}

/// A body of an assembly by itself: round bars through its points (mm), of the sizes that links of `like` have.
///
/// # Errors
/// Points that are no places, or a failure of the boolean kernel.
pub fn frame(
    name: &str,
    points: &[Vector3<f64>],
    like: &PartsInput,
) -> Result<(Mesh, BodyPlan), GeometryError> {
    let body = BodySolid { name: name.into(), skeleton: points.to_vec(), ..BodySolid::default() };
    let input = PartsInput {
        bodies: vec![body],
        flexures: Vec::new(),
        motion: Vec::new(),
        height_mm: like.height_mm,
        clearance_mm: like.clearance_mm,
        least_wall_mm: like.least_wall_mm,
        facets: like.facets,
    };
    let made = build_parts(&input)?;
    match (made.parts.into_iter().next(), made.plans.into_iter().next()) {
        (Some(part), Some(plan)) => Ok((part.mesh, plan)),
        _ => Err(GeometryError::NoSkeleton(name.into())),
    }
}

/// The parts as printed: those that have bodies in common as one solid, in as many pieces as they are. The largest
/// piece comes first.
///
/// # Errors
/// A failure of the boolean kernel.
pub fn unite(shares: &[Share<'_>], facets: &Facets) -> Result<Vec<Mesh>, BooleanError> {
    if let [only] = shares {
        let stays = only.placement == Placement::IDENTITY;
        let moved = || only.mesh.placed(&only.placement).rounded_to_f32().sorted();
        return Ok(vec![if stays { only.mesh.clone() } else { moved() }]);
    }
    let placed: Vec<Mesh> = shares.iter().map(|s| s.mesh.placed(&s.placement)).collect();
    let united = union_all(&placed)?;
    let cut = subtract_all(&united, &overgrown(shares, facets))?;
    Ok(pieces(&without_short_edges(&cut, SHORT_EDGE_MM).rounded_to_f32().sorted()))
}

/// The bores of common bodies that a body of another instance fills.
fn overgrown(shares: &[Share<'_>], facets: &Facets) -> Vec<Mesh> {
    let mut out = Vec::new();
    for (i, share) in shares.iter().enumerate() {
        for bore in share.common.iter().flat_map(|p| &p.bores) {
            let bore = bore.placed(&share.placement);
            let filled = shares.iter().enumerate().filter(|(j, _)| *j != i).any(|(_, other)| {
                other.common.iter().any(|plan| {
                    let mut own = plan.bores.iter().map(|b| b.placed(&other.placement));
                    let hole = bore.slot(0.0);
                    !own.any(|b| b.is(&bore))
                        && plan
                            .slots
                            .iter()
                            .any(|(_, s)| separation(&s.placed(&other.placement), &hole).gap_mm < 0.0)
                })
            });
            if filled {
                out.push(bore.slot(RECUT_MM).mesh(facets, 0.5));
            }
        }
    }
    out
}

/// The pieces of a mesh, the largest first, each with the cavities inside it.
fn pieces(mesh: &Mesh) -> Vec<Mesh> {
    let mut leader: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn root(leader: &mut [usize], mut i: usize) -> usize {
        while leader[i] != i {
            leader[i] = leader[leader[i]];
            i = leader[i];
        }
        i
    }
    for [a, b, c] in &mesh.triangles {
        for other in [b, c] {
            let (i, j) = (root(&mut leader, *a), root(&mut leader, *other));
            leader[i.max(j)] = i.min(j);
        }
    }
    let mut shells: BTreeMap<usize, Vec<[usize; 3]>> = BTreeMap::new();
    for t in &mesh.triangles {
        shells.entry(root(&mut leader, t[0])).or_default().push(*t);
    }
    let shell = |triangles| Mesh { vertices: mesh.vertices.clone(), triangles };
    let (mut solids, cavities): (Vec<Mesh>, Vec<Mesh>) =
        shells.into_values().map(shell).partition(|m| m.volume_mm3() > 0.0);
    for cavity in cavities {
        let inside = |solid: &Mesh| {
            let [outer, inner] = [used_box(solid), used_box(&cavity)];
            (0..3).all(|k| outer.0[k] <= inner.0[k] && inner.1[k] <= outer.1[k])
        };
        if let Some(solid) =
            solids.iter_mut().filter(|s| inside(s)).min_by(|a, b| a.volume_mm3().total_cmp(&b.volume_mm3()))
        {
            solid.triangles.extend(cavity.triangles);
        }
    }
    solids.sort_by(|a, b| b.volume_mm3().total_cmp(&a.volume_mm3()));
    for solid in &mut solids {
        solid.drop_unused_vertices();
        *solid = solid.sorted();
    }
    solids
}

/// Bounding box of the vertices in use.
fn used_box(mesh: &Mesh) -> (Vector3<f64>, Vector3<f64>) {
    let points = mesh.triangles.iter().flatten().filter_map(|i| mesh.vertices.get(*i));
    let infinite = Vector3::repeat(f64::INFINITY);
    points.fold((infinite, -infinite), |(lo, hi), p| (lo.inf(p), hi.sup(p)))
}

/// Something of an instance in the rest pose, in place.
#[derive(Clone, Debug)]
pub struct Standing {
    /// Its primitives.
    pub slots: Vec<Slot>,
}

impl Standing {
    /// A body.
    pub fn body(plan: &BodyPlan, placement: &Placement) -> Self {
        Self { slots: plan.slots.iter().map(|(_, s)| s.placed(placement)).collect() }
    }

    /// A flexure.
    pub fn flexure(flexure: &FlexureSolid, placement: &Placement) -> Self {
        Self { slots: flexure.slots().iter().map(|s| s.placed(placement)).collect() }
    }

    /// Gap to another (mm, negative: they overlap) and its place, if it is less than a bound.
    pub fn gap(&self, other: &Self, bound_mm: f64) -> Option<(f64, Vector3<f64>)> {
        super::gap::worst(&self.slots, &other.slots, bound_mm)
    }
}
