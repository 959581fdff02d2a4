//! Several instances as one mechanism: everything in its place, bodies that are common planned, carved and bored once.
//! A common body is the union of what each instance has drawn of it, primitive by primitive: one that two instances have in
//! the same place is there once, so no two faces coincide, and what is cut out for one instance is not filled by another.

use super::carve::{Carving, Cut, carve_bodies};
use super::cycle::{CycleGaps, MovedState, carved_cycle_gaps};
use super::distance::separation;
use super::gap::{Fusion, Member, fusions};
use super::link::{BodyPlan, BoreCut, Role};
use super::mesh::Mesh;
use super::parts::{BodySolid, FlexureSolid, GeometryError, PartsInput, build_part, groups, plan_bodies};
use super::slot::Slot;
use crate::ir::Placement;
use crate::math::Pose;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Primitives and bores whose places and sizes differ by less than this are one, mm.
const SAME_MM: f64 = 1e-6;
/// A primitive that overlaps one of an earlier instance is this much smaller for each instance before its own, mm: bars that
/// leave a common boss would have faces in one plane. More than round facets stand back from their circle, less than a
/// printer resolves.
const SMALLER_MM: f64 = 0.02;

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

impl FlexureSolid {
    /// The flexure in another place; its indices stay those of its design.
    pub fn placed(&self, placement: &Placement) -> FlexureSolid {
        FlexureSolid {
            joint_point: placement.point(&self.joint_point),
            centreline: self.centreline.iter().map(|x| placement.point(x)).collect(),
            // In a mirror image m1 × m2 would point against the tangent; sections are symmetric.
            m1: self.m1.iter().map(|m| placement.direction(m) * placement.handedness()).collect(),
            m2: self.m2.iter().map(|m| placement.direction(m)).collect(),
            ..self.clone()
        }
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

    /// Whether it is the same solid.
    fn is(&self, other: &Slot) -> bool {
        let sizes = |s: &Slot| Vector3::new(s.disc_radius_mm, s.half_height_mm, s.round_mm);
        let across = self.axis.cross(&other.axis).norm() * (self.half_height_mm + self.radius_mm());
        let ball = self.half_height_mm == 0.0 && self.disc_radius_mm == 0.0;
        same_ends((&self.start, &self.end), (&other.start, &other.end))
            && (sizes(self) - sizes(other)).amax() < SAME_MM
            && (ball || across < SAME_MM)
    }

    /// The slot with its faces moved inwards.
    fn smaller(&self, by_mm: f64) -> Slot {
        // What has no flat faces has its ball only.
        if self.disc_radius_mm > 2.0 * by_mm && self.half_height_mm > 2.0 * by_mm {
            let (disc_radius_mm, half_height_mm) = (self.disc_radius_mm - by_mm, self.half_height_mm - by_mm);
            Slot { disc_radius_mm, half_height_mm, ..*self }
        } else {
            Slot { round_mm: (self.round_mm - by_mm).max(self.round_mm / 2.0), ..*self }
        }
    }
}

fn same_ends((a, b): (&Vector3<f64>, &Vector3<f64>), (start, end): (&Vector3<f64>, &Vector3<f64>)) -> bool {
    let apart = |p: &Vector3<f64>, q: &Vector3<f64>| (a - p).norm().max((b - q).norm());
    apart(start, end) < SAME_MM || apart(end, start) < SAME_MM
}

/// What an instance brings along.
#[derive(Clone, Debug)]
pub struct Share<'p> {
    /// Its design in the rest pose.
    pub input: &'p PartsInput,
    /// The plans of its bodies.
    pub plans: &'p [BodyPlan],
    /// What its flexures have taken out of them.
    pub carving: &'p Carving,
    /// The states of the cycle, in the order of the whole.
    pub states: Vec<&'p MovedState>,
    /// Where it stands.
    pub placement: Placement,
    /// Which body of the whole each of its bodies is; all numbers up to the largest occur.
    pub bodies: Vec<usize>,
}

/// Instances as one mechanism, in the coordinates of the assembly.
#[derive(Clone, Debug)]
pub struct Whole {
    /// Flexures, clearances and names; nothing more is planned from it.
    input: PartsInput,
    /// Plans of the bodies.
    plans: Vec<BodyPlan>,
    states: Vec<MovedState>,
    /// Links that made way.
    pub carving: Carving,
    /// The instances that have each body, with its index in each.
    pub bodies: Vec<Vec<(usize, usize)>>,
    /// The instance of each flexure, with its index in it.
    pub flexures: Vec<(usize, usize)>,
}

/// A body of an assembly by itself, beside what is merged into it.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The body alone.
    pub input: PartsInput,
    /// Its plan.
    pub plans: Vec<BodyPlan>,
    /// Nothing is carved.
    pub carving: Carving,
    /// It stands still.
    pub state: MovedState,
}

impl Frame {
    /// Round bars through the body's points, holes and motors (mm), of the sizes that links of `like` have.
    ///
    /// # Errors
    /// Points that are no places.
    pub fn new(body: BodySolid, like: &PartsInput) -> Result<Self, GeometryError> {
        let only_solids = body.skeleton.is_empty() && body.holes.is_empty() && body.mounts.is_empty();
        let input = PartsInput {
            bodies: vec![body],
            flexures: Vec::new(),
            motion: Vec::new(),
            height_mm: like.height_mm,
            clearance_mm: like.clearance_mm,
            least_wall_mm: like.least_wall_mm,
            facets: like.facets,
        };
        let plans = if only_solids {
            let solids = input.bodies.iter().flat_map(|b| b.solids.iter().cloned()).collect();
            vec![BodyPlan { solids, ..BodyPlan::default() }]
        } else {
            plan_bodies(&input)?
        };
        let state = MovedState { poses: vec![Pose::rest(Vector3::zeros())], flexures: Vec::new() };
        Ok(Self { input, plans, carving: Carving::default(), state })
    }

    /// As body number `body` of a whole with so many states.
    pub fn share(&self, body: usize, states: usize) -> Share<'_> {
        let Self { input, plans, carving, state } = self;
        let states = vec![state; states];
        Share { input, plans, carving, states, placement: Placement::IDENTITY, bodies: vec![body] }
    }
}

/// Puts instances together. Where it is known how their links are `carved`, that is not done again.
///
/// # Errors
/// A failure of the boolean kernel where a common link is carved.
pub fn join(shares: &[Share<'_>], carved: Option<&Carving>) -> Result<Whole, GeometryError> {
    let count = shares.iter().flat_map(|s| &s.bodies).max().map_or(0, |last| last + 1);
    let mut bodies: Vec<Vec<(usize, usize)>> = vec![Vec::new(); count];
    let mut named: Vec<BodySolid> = vec![BodySolid::default(); count];
    let mut plans: Vec<Vec<(BodyPlan, usize)>> = vec![Vec::new(); count];
    let mut own = Carving::default();
    let (mut solids, mut flexures): (Vec<FlexureSolid>, Vec<(usize, usize)>) = (Vec::new(), Vec::new());
    let mut placed: Vec<Placed<'_>> = Vec::new();
    let mut joint = 0;
    for (i, share) in shares.iter().enumerate() {
        let place = Placed { share, joint, flexure: flexures.len() };
        for (b, (whole, plan)) in share.bodies.iter().zip(share.plans).enumerate() {
            plans[*whole].push((place.plan(plan), bodies[*whole].len()));
            if let (true, Some(body)) = (bodies[*whole].is_empty(), share.input.bodies.get(b)) {
                named[*whole].name.clone_from(&body.name);
            }
            bodies[*whole].push((i, b));
        }
        solids.extend(share.input.flexures.iter().map(|f| place.flexure(f)));
        flexures.extend((0..share.input.flexures.len()).map(|f| (i, f)));
        joint += place.joints();
        placed.push(place);
    }
    // A link of one instance is what it is there.
    for place in &placed {
        let alone = |b: usize| place.share.bodies.get(b).is_some_and(|w| bodies[*w].len() == 1);
        own.cuts.extend(place.share.carving.cuts.iter().filter(|c| alone(c.body)).map(|c| place.cut(c)));
        let links = place.share.carving.links.iter().filter(|(b, _)| alone(**b));
        own.links.extend(links.map(|(b, m)| (place.share.bodies[*b], m.placed(&place.share.placement))));
    }
    let least = |of: fn(&PartsInput) -> f64| shares.iter().map(|s| of(s.input)).fold(0.0, f64::max);
    let input = PartsInput {
        height_mm: least(|i| i.height_mm),
        clearance_mm: least(|i| i.clearance_mm),
        least_wall_mm: least(|i| i.least_wall_mm),
        bodies: named,
        flexures: solids,
        motion: Vec::new(),
        facets: shares.first().map(|s| s.input.facets).unwrap_or_default(),
    };
    let states = states(&placed, count);
    let plans: Vec<BodyPlan> = plans.into_iter().map(united).collect();
    let carving = match carved {
        Some(known) => known.clone(),
        None => {
            let common: Vec<usize> = (0..count).filter(|b| bodies[*b].len() > 1).collect();
            let mut carving = carve_bodies(&input, &plans, &states, &common)?;
            carving.cuts.extend(own.cuts);
            carving.links.extend(own.links);
            carving
        }
    };
    Ok(Whole { input, plans, states, carving, bodies, flexures })
}

/// A share with the numbers of the whole.
struct Placed<'s> {
    share: &'s Share<'s>,
    /// Added to the indices of its joints.
    joint: usize,
    /// Added to the indices of its flexures.
    flexure: usize,
}

impl Placed<'_> {
    /// More than its largest index of a joint.
    fn joints(&self) -> usize {
        let input = self.share.input;
        let of = |b: &BodySolid| {
            let eyes = b.eyes.iter().map(|e| e.joint);
            eyes.chain(b.guides.iter().map(|g| g.joint)).max()
        };
        let conventional = input.bodies.iter().filter_map(of);
        conventional.chain(input.flexures.iter().map(|f| f.joint)).max().map_or(0, |last| last + 1)
    }

    fn plan(&self, plan: &BodyPlan) -> BodyPlan {
        let p = &self.share.placement;
        let role = |role: &Role| match *role {
            Role::Stub(f) => Role::Stub(f + self.flexure),
            Role::Eye(j) => Role::Eye(j + self.joint),
            Role::Guide(j) => Role::Guide(j + self.joint),
            other => other,
        };
        let bore = |b: &BoreCut| BoreCut {
            joint: b.joint.map(|j| j + self.joint),
            start: p.point(&b.start),
            end: p.point(&b.end),
            ..*b
        };
        BodyPlan {
            slots: plan.slots.iter().map(|(r, s)| (role(r), s.placed(p))).collect(),
            // The whole is not varied any more.
            follows: Vec::new(),
            bores: plan.bores.iter().map(bore).collect(),
            plates: plan.plates.iter().map(|k| k.placed(p)).collect(),
            access: Vec::new(),
            solids: plan.solids.iter().map(|s| s.placed(p)).collect(),
            pockets: plan.pockets.iter().map(|k| k.placed(p)).collect(),
            carried: plan.carried.iter().map(|s| s.placed(p)).collect(),
            // Told of the design that they belong to.
            faults: Vec::new(),
            notes: plan.notes.clone(),
        }
    }

    fn flexure(&self, f: &FlexureSolid) -> FlexureSolid {
        let body = |b: usize| self.share.bodies.get(b).copied().unwrap_or(usize::MAX);
        FlexureSolid {
            joint: f.joint + self.joint,
            bodies: (body(f.bodies.0), body(f.bodies.1)),
            ..f.placed(&self.share.placement)
        }
    }

    fn cut(&self, cut: &Cut) -> Cut {
        Cut {
            body: self.share.bodies.get(cut.body).copied().unwrap_or(usize::MAX),
            flexure: cut.flexure + self.flexure,
            at: self.share.placement.point(&cut.at),
            ..cut.clone()
        }
    }

    fn pose(&self, pose: &Pose) -> Pose {
        let p = &self.share.placement;
        if *p == Placement::IDENTITY {
            return *pose;
        }
        let turn = p.matrix();
        Pose {
            rotation: turn * pose.rotation * turn.transpose(),
            translation: turn * pose.translation,
            center: p.point(&pose.center),
        }
    }
}

/// The states that all instances have; a common body moves as the first one says.
fn states(placed: &[Placed<'_>], bodies: usize) -> Vec<MovedState> {
    let count = placed.iter().map(|p| p.share.states.len()).min().unwrap_or(0);
    let state = |s: usize| {
        let mut poses = vec![None; bodies];
        let mut flexures = Vec::new();
        for place in placed {
            let Some(moved) = place.share.states.get(s) else { continue };
            for (whole, pose) in place.share.bodies.iter().zip(&moved.poses) {
                if let Some(slot) = poses.get_mut(*whole) {
                    slot.get_or_insert_with(|| place.pose(pose));
                }
            }
            flexures.extend(moved.flexures.iter().map(|f| place.flexure(f)));
        }
        let poses = poses.into_iter().map(|p| p.unwrap_or_else(|| Pose::rest(Vector3::zeros()))).collect();
        MovedState { poses, flexures }
    };
    (0..count).map(state).collect()
}

/// One plan from those of all instances that have a body, each with the number of instances before.
fn united(plans: Vec<(BodyPlan, usize)>) -> BodyPlan {
    let mut out = BodyPlan::default();
    for (plan, before) in plans {
        let (known, plates) = (out.slots.len(), out.plates.len());
        out.plates.extend(plan.plates);
        for (role, slot) in plan.slots {
            let role = if let Role::Plate(k) = role { Role::Plate(k + plates) } else { role };
            let earlier = out.slots.get(..known).unwrap_or_default();
            // A stub stays where its own flexure is cut free: each has its own.
            let stub = matches!(role, Role::Stub(_));
            if !stub && earlier.iter().any(|(r, s)| !matches!(r, Role::Stub(_)) && s.is(&slot)) {
                continue;
            }
            let meets = earlier.iter().any(|(_, s)| separation(s, &slot).gap_mm < SMALLER_MM);
            let by = if meets { SMALLER_MM * before as f64 } else { 0.0 };
            out.slots.push((role, if by > 0.0 { slot.smaller(by) } else { slot }));
        }
        let known: Vec<BoreCut> = out.bores.clone();
        let is = |a: &BoreCut, b: &BoreCut| {
            same_ends((&a.start, &a.end), (&b.start, &b.end))
                && (a.diameter_mm - b.diameter_mm).abs() < SAME_MM
        };
        out.bores.extend(plan.bores.into_iter().filter(|b| !known.iter().any(|k| is(k, b))));
        let known = out.solids.clone();
        out.solids.extend(plan.solids.into_iter().filter(|s| !known.iter().any(|k| k.is(s, SAME_MM))));
        let known = out.pockets.clone();
        out.pockets.extend(plan.pockets.into_iter().filter(|p| !known.iter().any(|k| k.is(p, SAME_MM))));
        let known = out.carried.clone();
        out.carried.extend(plan.carried.into_iter().filter(|s| !known.iter().any(|k| k.is(s))));
        out.notes.extend(plan.notes);
    }
    out
}

impl Whole {
    /// Bodies that are printed as one, in the order of their first bodies.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        groups(&self.input)
    }

    /// The printed solid of a group, in as many pieces as it is, the largest first, and the links of its bodies.
    ///
    /// # Errors
    /// A failure of the boolean kernel.
    pub fn build(&self, group: &[usize]) -> Result<(Vec<Mesh>, Vec<Mesh>), GeometryError> {
        let part = build_part(&self.input, &self.plans, &self.carving, group)?;
        Ok((pieces(&part.mesh), part.links))
    }

    /// The flexures of a group, by their indices in the whole.
    pub fn flexures_of(&self, group: &[usize]) -> Vec<usize> {
        let inside = |f: &usize| self.input.flexures.get(*f).is_some_and(|f| group.contains(&f.bodies.0));
        (0..self.input.flexures.len()).filter(inside).collect()
    }

    /// What overlaps or comes too near in the rest pose.
    pub fn fusions(&self) -> Vec<Fusion> {
        fusions(&self.input, &self.plans, &self.groups(), &self.carving)
    }

    /// Gaps over the cycle of everything that two instances take part in, or one that is not `known` by its design.
    pub fn gaps(&self, known: impl Fn(usize) -> bool + Sync) -> CycleGaps {
        let within = |a: Member, b: Member| match (self.owners(a).as_slice(), self.owners(b).as_slice()) {
            ([i], [j]) => i == j && known(*i),
            _ => false,
        };
        carved_cycle_gaps(&self.plans, &self.states, &self.carving, self.input.clearance_mm, within)
    }

    /// The instances that a member belongs to, ascending.
    pub fn owners(&self, member: Member) -> Vec<usize> {
        match member {
            Member::Body(b) => self.bodies.get(b).map(|m| m.iter().map(|(i, _)| *i).collect()),
            Member::Flexure(f) => self.flexures.get(f).map(|(i, _)| vec![*i]),
        }
        .unwrap_or_default()
    }

    /// A member as one of an instance's design; none: it is not in it.
    pub fn within(&self, instance: usize, member: Member) -> Option<Member> {
        match member {
            Member::Body(b) => {
                self.bodies.get(b)?.iter().find(|(i, _)| *i == instance).map(|m| Member::Body(m.1))
            }
            Member::Flexure(f) => {
                self.flexures.get(f).filter(|m| m.0 == instance).map(|m| Member::Flexure(m.1))
            }
        }
    }
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
