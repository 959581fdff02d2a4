//! Flexures that would hit the link they are attached to: the link gives way (paper, section 4.4 and Fig. 5). What a
//! flexure sweeps over the cycle, seen from its link, grown by the clearance, is taken out of the link; the stub that
//! holds the flexure stays. A link that would be cut apart, or become thinner than the process prints, is left as it is.

use super::check::Tree;
use super::cycle::MovedState;
use super::distance::{point_triangle, separation};
use super::field::Field;
use super::fitted::Pocket;
use super::gap::{NEAR_MM, ROOT_MM};
use super::link::{BodyPlan, Role};
use super::mesh::Mesh;
use super::parts::{FlexureSolid, GeometryError, PartsInput};
use super::slot::Slot;
use super::solid::surfaces;
use super::union::{BooleanError, subtract_all, union_all};
use super::wall::{Left, Wall};
use crate::math::Pose;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Step of the grid that holds what a flexure sweeps, mm.
const STEP_MM: f64 = 0.5;
/// Taken out beyond the clearance, mm: covers the facets of the grid, and the scallops between two shapes that are
/// [`MOVE_MM`] apart.
const MARGIN_MM: f64 = 0.15;
/// A flexure moves by this at most between two shapes that are taken out, mm.
const MOVE_MM: f64 = 0.5;
/// Shapes between two states at most.
const MOST_SHAPES: usize = 12;
/// The tool ends this far outside of the link, mm.
const BEYOND_MM: f64 = 1.0;
/// Points on a flexure, from which distances to a carved link are taken, are this far apart at most, mm.
const SAMPLE_MM: f64 = 0.5;

/// Added to that root for the bend beside it, mm.
const BACK_MM: f64 = 0.2;

/// What became of a link that a flexure attached to it would hit.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The link.
    pub body: usize,
    /// The flexure.
    pub flexure: usize,
    /// Overlap without carving, mm; negative: a gap that is less than the clearance.
    pub depth_mm: f64,
    /// Where that is, in the rest pose of the link.
    pub at: Vector3<f64>,
    /// State of the cycle in which it is; none: the rest pose.
    pub state: Option<usize>,
    /// The least wall of the link on the way between its ends, with everything taken out that was to be taken out;
    /// none: it would be cut apart. Walls beside a cut are told apart up to about 2 mm.
    pub wall_mm: Option<f64>,
    /// Whether the link was carved.
    pub made: bool,
}

/// Carved links.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carving {
    /// Every pair that meets.
    pub cuts: Vec<Cut>,
    /// The carved links in the rest pose, bores included.
    pub links: BTreeMap<usize, Mesh>,
}

impl Carving {
    /// Whether a link was carved to make way for a flexure.
    pub fn made(&self, body: usize, flexure: usize) -> bool {
        self.cuts.iter().any(|c| c.made && (c.body, c.flexure) == (body, flexure))
    }
}

/// Finds the links that their own flexures would hit in the rest pose or the cycle, and carves them.
///
/// # Errors
/// A failure of the boolean kernel.
pub fn carve(
    input: &PartsInput,
    plans: &[BodyPlan],
    states: &[MovedState],
) -> Result<Carving, GeometryError> {
    carve_bodies(input, plans, states, &(0..plans.len()).collect::<Vec<_>>())
}

/// The same for some of the links.
pub(super) fn carve_bodies(
    input: &PartsInput,
    plans: &[BodyPlan],
    states: &[MovedState],
    bodies: &[usize],
) -> Result<Carving, GeometryError> {
    let done: Vec<(Vec<Cut>, Option<Mesh>)> = bodies
        .par_iter()
        .map(|body| carve_body(input, *body, &plans[*body], states))
        .collect::<Result<_, _>>()?;
    let mut carving = Carving::default();
    for (body, (cuts, link)) in bodies.iter().zip(done) {
        carving.cuts.extend(cuts);
        carving.links.extend(link.map(|mesh| (*body, mesh)));
    }
    Ok(carving)
}

/// Shapes of a flexure seen from a link, the rest shape first, then those of the states.
fn shapes(input: &PartsInput, flexure: usize, body: usize, states: &[MovedState]) -> Vec<FlexureSolid> {
    let bent = states.iter().filter_map(|s| Some((s.flexures.get(flexure)?, s.poses.get(body)?)));
    std::iter::once(input.flexures[flexure].clone()).chain(bent.map(|(f, pose)| seen_from(f, pose))).collect()
}

/// A flexure in the rest coordinates of a body that has moved.
fn seen_from(flexure: &FlexureSolid, pose: &Pose) -> FlexureSolid {
    let back = pose.rotation.transpose();
    let point = |p: &Vector3<f64>| pose.center + back * (p - pose.center - pose.translation);
    FlexureSolid {
        centreline: flexure.centreline.iter().map(point).collect(),
        m1: flexure.m1.iter().map(|m| back * m).collect(),
        m2: flexure.m2.iter().map(|m| back * m).collect(),
        ..flexure.clone()
    }
}

/// Slots of a flexure with their way from its end in a link, mm: that of each slot's nearer end.
fn from_root(flexure: &FlexureSolid, body: usize) -> Vec<(f64, Slot)> {
    let slots = flexure.slots();
    let mut way: Vec<f64> = Vec::with_capacity(slots.len());
    let mut sum = 0.0;
    for s in &slots {
        way.push(sum);
        sum += (s.end - s.start).norm();
    }
    let at_end = |i: usize| sum - way.get(i + 1).copied().unwrap_or(sum);
    let from = |i: usize| {
        let (first, last) = (flexure.bodies.0 == body, flexure.bodies.1 == body);
        match (first, last) {
            (true, false) => way[i],
            (false, true) => at_end(i),
            _ => way[i].min(at_end(i)),
        }
    };
    slots.into_iter().enumerate().map(|(i, s)| (from(i), s)).collect()
}

/// The nearest approach of a flexure to its own link beyond its root.
fn meets(
    input: &PartsInput,
    plan: &BodyPlan,
    body: usize,
    flexure: usize,
    shapes: &[FlexureSolid],
) -> Option<Cut> {
    let mut worst: Option<Cut> = None;
    let others: Vec<(Slot, Vector3<f64>, f64)> = plan
        .slots
        .iter()
        .filter(|(role, _)| *role != Role::Stub(flexure))
        .map(|(_, s)| {
            let (center, radius) = s.bounding_sphere();
            (*s, center, radius)
        })
        .collect();
    let solids = surfaces(plan);
    for (k, shape) in shapes.iter().enumerate() {
        for (way, piece) in from_root(shape, body).iter().filter(|(way, _)| *way >= ROOT_MM) {
            // Beside its root a flexure cannot keep the clearance, but must not be swallowed.
            let limit = if *way >= NEAR_MM { input.clearance_mm - 1e-6 } else { 0.0 };
            let (center, radius) = piece.bounding_sphere();
            for solid in &solids {
                let bound = worst.as_ref().map_or(limit, |w| (-w.depth_mm).min(limit));
                if let Some((gap, at)) = solid.gap_to_slot(piece, bound) {
                    let (depth_mm, state) = (-gap, k.checked_sub(1));
                    worst = Some(Cut { body, flexure, depth_mm, at, state, wall_mm: None, made: false });
                }
            }
            for (slot, c, r) in &others {
                let bound = worst.as_ref().map_or(limit, |w| (-w.depth_mm).min(limit));
                if (c - center).norm() - r - radius >= bound {
                    continue;
                }
                let s = separation(piece, slot);
                if s.gap_mm < bound {
                    let (depth_mm, at, state) = (-s.gap_mm, s.at, k.checked_sub(1));
                    worst = Some(Cut { body, flexure, depth_mm, at, state, wall_mm: None, made: false });
                }
            }
        }
    }
    worst
}

/// What a flexure sweeps near a link, grown by the clearance: one closed surface, and the field it was taken from.
fn swept(input: &PartsInput, plan: &BodyPlan, cut: &Cut, shapes: &[FlexureSolid]) -> (Field, Mesh) {
    let grown = input.clearance_mm + MARGIN_MM;
    let mut pieces: Vec<Slot> = Vec::new();
    let mut take = |shape: &FlexureSolid| {
        pieces.extend(
            from_root(shape, cut.body).into_iter().filter(|(way, _)| *way >= ROOT_MM).map(|(_, s)| s),
        );
    };
    for (k, shape) in shapes.iter().enumerate() {
        take(shape);
        // From the rest pose no motion leads anywhere; from state to state it is followed.
        let Some(next) = shapes.get(k + 1).filter(|_| k > 0) else { continue };
        let moved = shape.centreline.iter().zip(&next.centreline).map(|(p, q)| (p - q).norm());
        let steps = ((moved.fold(0.0, f64::max) / MOVE_MM).ceil() as usize).clamp(1, MOST_SHAPES);
        (1..steps).for_each(|i| take(&half_way(shape, next, i as f64 / steps as f64)));
    }
    let link: Vec<&Slot> =
        plan.slots.iter().filter(|(role, _)| *role != Role::Stub(cut.flexure)).map(|(_, s)| s).collect();
    let room = |slots: &mut dyn Iterator<Item = &Slot>, more: f64| {
        let far = Vector3::repeat(f64::INFINITY);
        slots.fold((far, -far), |(low, high), s| {
            let size = s.extent() + Vector3::repeat(more);
            (low.inf(&(s.start.inf(&s.end) - size)), high.sup(&(s.start.sup(&s.end) + size)))
        })
    };
    let edge = BEYOND_MM + 2.0 * STEP_MM;
    let boxes: Vec<Pocket> = plan.solids.iter().filter_map(|s| Pocket::round(&s.mesh())).collect();
    let (a, mut b) = (room(&mut pieces.iter(), grown + edge), room(&mut link.iter().copied(), edge));
    for p in &boxes {
        let size = Vector3::from(p.half_mm).add_scalar(edge);
        b = (b.0.inf(&(p.center - size)), b.1.sup(&(p.center + size)));
    }
    let (least, largest) = (a.0.sup(&b.0), a.1.inf(&b.1));
    let far = 2.0 * STEP_MM;
    let mut field = Field::new(&least, &largest, STEP_MM, far);
    pieces.iter().for_each(|s| field.add(s, grown, far));
    // Only what is near the link has to be meshed.
    let mut near = Field::new(&least, &largest, STEP_MM, edge);
    link.iter().for_each(|s| near.add(s, 0.0, edge));
    for p in &boxes {
        near.near(&p.around(), edge, |at, value| *value = value.min(p.signed_distance(at)));
    }
    let mut tool = field.clone();
    for (t, l) in tool.values.iter_mut().zip(&near.values) {
        *t = t.max(l - BEYOND_MM);
    }
    (field, tool.surface())
}

/// A shape between two states.
fn half_way(a: &FlexureSolid, b: &FlexureSolid, u: f64) -> FlexureSolid {
    let between =
        |p: &[Vector3<f64>], q: &[Vector3<f64>]| p.iter().zip(q).map(|(p, q)| p.lerp(q, u)).collect();
    let unit = |v: Vec<Vector3<f64>>| {
        v.into_iter().map(|m| m.try_normalize(1e-9).unwrap_or_else(Vector3::z)).collect::<Vec<_>>()
    };
    FlexureSolid {
        centreline: between(&a.centreline, &b.centreline),
        m1: unit(between(&a.m1, &b.m1)),
        m2: unit(between(&a.m2, &b.m2)),
        ..a.clone()
    }
}

fn carve_body(
    input: &PartsInput,
    body: usize,
    plan: &BodyPlan,
    states: &[MovedState],
) -> Result<(Vec<Cut>, Option<Mesh>), GeometryError> {
    let attached = |f: &FlexureSolid| f.bodies.0 == body || f.bodies.1 == body;
    let own: Vec<usize> = (0..input.flexures.len()).filter(|f| attached(&input.flexures[*f])).collect();
    let met: Vec<(Cut, Field, Mesh)> = own
        .par_iter()
        .filter_map(|flexure| {
            let shapes = shapes(input, *flexure, body, states);
            let cut = meets(input, plan, body, *flexure, &shapes)?;
            let (field, tool) = swept(input, plan, &cut, &shapes);
            Some((cut, field, tool))
        })
        .collect();
    if met.is_empty() {
        return Ok((Vec::new(), None));
    }
    let (mut cuts, mut tools) = (Vec::new(), Vec::new());
    let mut left = Left::new(plan);
    let mut before = left.least_wall();
    for (mut cut, field, tool) in met {
        let without = left.without(cut.flexure, &field);
        let after = without.least_wall();
        cut.wall_mm = match after {
            Wall::Apart => None,
            Wall::Least(wall) => Some(wall),
        };
        // A link that was thin before is not the cut's fault.
        let thin = match (before, after) {
            (Wall::Least(before), Wall::Least(after)) => after < input.least_wall_mm.min(before),
            (_, after) => after == Wall::Apart,
        };
        cut.made = !thin;
        if !thin {
            (left, before) = (without, after);
            tools.push((cut.flexure, tool));
        }
        cuts.push(cut);
    }
    if tools.is_empty() {
        return Ok((cuts, None));
    }
    let link = carved(input, plan, &tools)
        .map_err(|error| GeometryError::Boolean { name: input.bodies[body].name.clone(), error })?;
    Ok((cuts, Some(link)))
}

/// The link without what is swept; every stub keeps clear of the other flexures only.
fn carved(input: &PartsInput, plan: &BodyPlan, tools: &[(usize, Mesh)]) -> Result<Mesh, BooleanError> {
    let meshes = plan.meshes(&input.facets);
    let kept = |role: &Role| tools.iter().find(|(f, _)| *role == Role::Stub(*f)).map(|t| t.0);
    let rest: Vec<Mesh> = plan
        .slots
        .iter()
        .zip(&meshes)
        .filter(|((r, _), _)| kept(r).is_none())
        .map(|(_, m)| m.clone())
        .chain(plan.solids.iter().map(|s| s.mesh()))
        .collect();
    let all: Vec<Mesh> = tools.iter().map(|t| t.1.clone()).collect();
    let mut pieces = Vec::new();
    if !rest.is_empty() {
        pieces.push(subtract_all(&union_all(&rest)?, &all)?);
    }
    for ((role, slot), mesh) in plan.slots.iter().zip(&meshes) {
        let Some(own) = kept(role) else { continue };
        let (center, radius) = slot.bounding_sphere();
        // A tool far from the stub is no business of the kernel's.
        let near = |tool: &Mesh| {
            tool.bounding_box()
                .is_some_and(|(low, high)| (center.sup(&low).inf(&high) - center).norm() < radius)
        };
        let others: Vec<Mesh> =
            tools.iter().filter(|t| t.0 != own && near(&t.1)).map(|t| t.1.clone()).collect();
        pieces.push(subtract_all(mesh, &others)?);
    }
    subtract_all(&union_all(&pieces)?, &plan.bore_meshes(&input.facets))
}

/// A carved link, prepared for distances.
pub(super) struct CarvedLink<'a> {
    mesh: &'a Mesh,
    boxes: Vec<(Vector3<f64>, Vector3<f64>)>,
    tree: Tree,
}

impl<'a> CarvedLink<'a> {
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        let boxes: Vec<_> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
            })
            .collect();
        let mut ids: Vec<usize> = (0..boxes.len()).collect();
        let tree = Tree::build(&mut ids, &boxes);
        Self { mesh, boxes, tree }
    }

    /// Least distance of a bent flexure from the link, mm, with its place in the link's rest pose, if it is below
    /// `bound`. Left out is the root, where the stub itself is nearer.
    pub(super) fn gap(
        &self,
        flexure: &FlexureSolid,
        body: usize,
        pose: &Pose,
        clearance_mm: f64,
        bound: f64,
    ) -> Option<(f64, Vector3<f64>)> {
        let mut best = None;
        let mut bound = bound;
        let mut near = Vec::new();
        let shape = seen_from(flexure, pose);
        // A slot's round end reaches back towards the stub's nose by half its thickness.
        let root = |s: &Slot| ROOT_MM.max(clearance_mm + s.round_mm + BACK_MM);
        for (_, s) in from_root(&shape, body).iter().filter(|(way, s)| *way >= root(s)) {
            let along = ((s.end - s.start).norm() / SAMPLE_MM).ceil().max(1.0);
            let across = (2.0 * s.half_height_mm / SAMPLE_MM).ceil();
            for i in 0..=along as usize {
                for j in 0..=across as usize {
                    let up =
                        if across > 0.0 { s.half_height_mm * (2.0 * j as f64 / across - 1.0) } else { 0.0 };
                    let p = s.start.lerp(&s.end, i as f64 / along) + s.axis * up;
                    let reach = Vector3::repeat(bound + s.round_mm);
                    near.clear();
                    self.tree.query(&(p - reach, p + reach), &mut near, &self.boxes);
                    for t in &near {
                        let q = point_triangle(&p, &self.mesh.corners(*t));
                        let gap = (p - q).norm() - s.round_mm;
                        if gap < bound {
                            bound = gap;
                            best = Some((gap, (p + q) / 2.0));
                        }
                    }
                }
            }
        }
        best
    }
}
