//! Meshes from files as parts of bodies: where they are, what is wrong with them, and how near others come. The primitives of links
//! are convex, a mesh is not: its triangles stand in a tree of boxes, and what is inside is told by a ray.

use super::check::{Edges, WrongEdges, check_mesh, wrong_edges};
use super::distance::{point_triangle, until_apart};
use super::link::BodyPlan;
use super::mesh::Mesh;
use super::ray::Met;
use super::slot::Slot;
use crate::diagnostic::Origin;
use crate::ir::{AddedSolid, ExprPoint, Placement, SurfaceFault, SurfaceFaultKind, TriangleMesh};
use crate::math::Pose;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Triangles of a leaf at most.
const LEAF: usize = 4;
/// Surfaces that cross overlap by this at least, mm: how deep is only known of sampled points.
const CROSS_MM: f64 = 0.01;
/// Triangles nearer than this meet, mm: the iteration does not tell it from zero.
const TOUCH_MM: f64 = 1e-6;
/// Corners of a mesh that are looked at for how deep it reaches into another one.
const SAMPLES: usize = 400;
/// Direction of the rays: along no edge that anybody draws.
const RAY: [f64; 3] = [0.537_712_9, 0.313_244_7, 0.782_793_1];

/// A mesh from a file at a body in the rest pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedSolid {
    /// The file's mesh.
    pub source: Arc<TriangleMesh>,
    /// Its path.
    pub file: String,
    /// x = turn · X + shift (mm): the turn holds the scale, and is improper for a mirror image.
    pub turn: Matrix3<f64>,
    /// See `turn`.
    pub shift: Vector3<f64>,
    /// Statement.
    pub origin: Origin,
}

impl PlacedSolid {
    /// A solid as it is declared; `point` and `direction` place a point (mm) and a direction of the drawing pose.
    pub fn of(
        solid: &AddedSolid,
        point: impl Fn(ExprPoint) -> Vector3<f64>,
        direction: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Self {
        let column = |j: usize| direction(&Vector3::from_fn(|i, _| solid.rotation[i][j]));
        Self {
            source: solid.mesh.clone(),
            file: solid.file.clone(),
            turn: Matrix3::from_columns(&[column(0), column(1), column(2)]) * solid.scale,
            shift: point(solid.position),
            origin: solid.origin,
        }
    }

    /// The mesh where it is.
    pub fn mesh(&self) -> Mesh {
        let at = |p: &[f64; 3]| self.turn * Vector3::from(*p) + self.shift;
        let turned = self.turn.determinant() < 0.0;
        let face = |[a, b, c]: &[usize; 3]| if turned { [*a, *c, *b] } else { [*a, *b, *c] };
        Mesh {
            vertices: self.source.vertices.iter().map(at).collect(),
            triangles: self.source.triangles.iter().map(face).collect(),
        }
    }

    /// The same in another place.
    pub fn placed(&self, placement: &Placement) -> Self {
        if *placement == Placement::IDENTITY {
            return self.clone();
        }
        Self { turn: placement.matrix() * self.turn, shift: placement.point(&self.shift), ..self.clone() }
    }

    /// Whether it is the same mesh in the same place.
    pub(super) fn is(&self, other: &Self, within_mm: f64) -> bool {
        let size = self.source.vertices.iter().flatten().fold(1.0, |a: f64, x| a.max(x.abs()));
        self.source == other.source
            && (self.shift - other.shift).amax() < within_mm
            && (self.turn - other.turn).amax() * size < within_mm
    }
}

/// What keeps a file's surface from bounding a solid; looked for once.
pub fn faults(mesh: &TriangleMesh) -> &[SurfaceFault] {
    mesh.faults.get_or_init(|| look_for_faults(mesh))
}

fn look_for_faults(mesh: &TriangleMesh) -> Vec<SurfaceFault> {
    let vertex = |i: usize| Vector3::from(mesh.vertices.get(i).copied().unwrap_or_default());
    let fault = |kind, edges: Edges| {
        let (i, j) = edges.first;
        SurfaceFault { kind, count: edges.count, at: ((vertex(i) + vertex(j)) / 2.0).into() }
    };
    let WrongEdges { open, mixed } = wrong_edges(&mesh.triangles);
    let open = open.map(|e| fault(SurfaceFaultKind::Open, e));
    let mixed = mixed.map(|e| fault(SurfaceFaultKind::NoSides, e));
    let mut found: Vec<SurfaceFault> = open.into_iter().chain(mixed).collect();
    let whole =
        Mesh { vertices: (0..mesh.vertices.len()).map(vertex).collect(), triangles: mesh.triangles.clone() };
    let facts = check_mesh(&whole);
    if let Some((a, _)) = facts.examples.first() {
        let at = whole.corners(*a).iter().sum::<Vector3<f64>>() / 3.0;
        found.push(SurfaceFault {
            kind: SurfaceFaultKind::Crossing,
            count: facts.self_intersections,
            at: at.into(),
        });
    }
    found
}

/// A closed mesh, prepared for distances. Its tree is not [`super::check::Tree`], which tells what overlaps a box: here the nearest boxes
/// come first and the bound shrinks on the way, and two trees are gone through together.
pub(super) struct Surface {
    mesh: Mesh,
    /// Triangles, those of a leaf side by side.
    order: Vec<usize>,
    /// The root stands last.
    nodes: Vec<Node>,
}

struct Node {
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// Its two nodes, or a stretch of `order`.
    content: Result<[usize; 2], [usize; 2]>,
}

/// A box: least and largest corner.
type Box3 = (Vector3<f64>, Vector3<f64>);

/// Distance of two boxes.
fn apart(a: &Box3, b: &Box3) -> f64 {
    (a.0 - b.1).sup(&(b.0 - a.1)).sup(&Vector3::zeros()).norm()
}

fn box_of(points: &[Vector3<f64>]) -> Box3 {
    let far = Vector3::repeat(f64::INFINITY);
    points.iter().fold((far, -far), |(low, high), p| (low.inf(p), high.sup(p)))
}

fn box_of_slot(s: &Slot) -> Box3 {
    (s.start.inf(&s.end) - s.extent(), s.start.sup(&s.end) + s.extent())
}

/// The surfaces of a body's solids.
pub(super) fn surfaces(plan: &BodyPlan) -> Vec<Surface> {
    plan.solids.iter().map(|s| Surface::new(s.mesh())).collect()
}

impl Surface {
    pub(super) fn new(mesh: Mesh) -> Self {
        let boxes: Vec<Box3> = (0..mesh.triangles.len()).map(|t| box_of(&mesh.corners(t))).collect();
        let mut out = Self { order: (0..boxes.len()).collect(), nodes: Vec::new(), mesh };
        let mut order = std::mem::take(&mut out.order);
        out.grow(&mut order, 0, &boxes);
        out.order = order;
        out
    }

    fn grow(&mut self, ids: &mut [usize], first: usize, boxes: &[Box3]) -> usize {
        let far = Vector3::repeat(f64::INFINITY);
        let (low, high) = ids
            .iter()
            .filter_map(|i| boxes.get(*i))
            .fold((far, -far), |(low, high), b| (low.inf(&b.0), high.sup(&b.1)));
        let content = if ids.len() <= LEAF {
            Err([first, first + ids.len()])
        } else {
            let side = (high - low).imax();
            let middle = |i: usize| boxes.get(i).map_or(0.0, |b| b.0[side] + b.1[side]);
            ids.sort_by(|i, j| middle(*i).total_cmp(&middle(*j)).then(i.cmp(j)));
            let half = ids.len() / 2;
            let (left, right) = ids.split_at_mut(half);
            let left = self.grow(left, first, boxes);
            Ok([left, self.grow(right, first + half, boxes)])
        };
        self.nodes.push(Node { low, high, content });
        self.nodes.len() - 1
    }

    pub(super) fn bounds(&self) -> Box3 {
        self.nodes.last().map_or((Vector3::zeros(), Vector3::zeros()), |n| (n.low, n.high))
    }

    /// Calls `f` with the triangles whose boxes are nearer to a box than what `f` last returned, the nearest boxes first.
    fn near(&self, to: &Box3, bound: f64, f: &mut impl FnMut([Vector3<f64>; 3], f64) -> f64) -> f64 {
        let Some(root) = self.nodes.len().checked_sub(1) else { return bound };
        self.near_below(root, to, bound, f)
    }

    fn near_below(
        &self,
        node: usize,
        to: &Box3,
        mut bound: f64,
        f: &mut impl FnMut([Vector3<f64>; 3], f64) -> f64,
    ) -> f64 {
        let Some(n) = self.nodes.get(node) else { return bound };
        if apart(&(n.low, n.high), to) > bound {
            return bound;
        }
        match n.content {
            Err([first, last]) => {
                for t in self.order.get(first..last).unwrap_or_default() {
                    let corners = self.mesh.corners(*t);
                    if apart(&box_of(&corners), to) <= bound {
                        bound = f(corners, bound);
                    }
                }
            }
            Ok(halves) => {
                let way = |i: usize| self.nodes.get(i).map_or(f64::INFINITY, |n| apart(&(n.low, n.high), to));
                let [a, b] = halves;
                let halves = if way(b) < way(a) { [b, a] } else { [a, b] };
                for half in halves {
                    bound = self.near_below(half, to, bound, f);
                }
            }
        }
        bound
    }

    /// Distance of a point from the surface, mm.
    fn distance(&self, p: &Vector3<f64>) -> f64 {
        self.near(&(*p, *p), f64::INFINITY, &mut |corners, bound| {
            bound.min((point_triangle(p, &corners) - p).norm())
        })
    }

    /// Whether a point is inside.
    pub(super) fn holds(&self, p: &Vector3<f64>) -> bool {
        let (low, high) = self.bounds();
        if (0..3).any(|k| p[k] < low[k] || p[k] > high[k]) {
            return false;
        }
        let d = Vector3::from(RAY);
        let mut count = 0;
        let mut open: Vec<usize> = self.nodes.len().checked_sub(1).into_iter().collect();
        while let Some(n) = open.pop().and_then(|i| self.nodes.get(i)) {
            // All components of the direction are positive.
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for k in 0..3 {
                enter = enter.max((n.low[k] - p[k]) / d[k]);
                leave = leave.min((n.high[k] - p[k]) / d[k]);
            }
            if enter > leave {
                continue;
            }
            match n.content {
                Ok(halves) => open.extend(halves),
                Err([first, last]) => {
                    let own = self.order.get(first..last).unwrap_or_default();
                    count += own.iter().filter(|t| meets(p, &d, &self.mesh.corners(**t))).count();
                }
            }
        }
        count % 2 == 1
    }

    /// How deep a point is inside, mm; zero outside.
    fn depth(&self, p: &Vector3<f64>) -> f64 {
        if self.holds(p) { self.distance(p) } else { 0.0 }
    }

    /// Gap to a slot and its place, if it is below a bound; negative inside: at least so deep.
    pub(super) fn gap_to_slot(&self, slot: &Slot, bound: f64) -> Option<(f64, Vector3<f64>)> {
        let mut best: Option<(f64, Vector3<f64>)> = None;
        let core = -slot.round_mm + 1e-9;
        self.near(&box_of_slot(slot), bound.max(0.0), &mut |corners, reach| {
            let s = until_apart(slot, &corners, reach);
            if s.gap_mm < best.map_or(bound.max(0.0), |b| b.0) {
                best = Some((s.gap_mm, s.at));
            }
            match best {
                // Deeper than with its core in the surface is not told here.
                Some((gap, _)) if gap <= core => f64::NEG_INFINITY,
                Some((gap, _)) => gap.max(0.0),
                None => reach,
            }
        });
        let crosses = best.is_some_and(|b| b.0 <= core);
        if crosses || best.is_none_or(|b| b.0 > 0.0) {
            let up = slot.axis * slot.half_height_mm;
            let middle = (slot.start + slot.end) / 2.0;
            let ends = [slot.start, slot.end, middle].into_iter().flat_map(|p| [p - up, p, p + up]);
            let inside = ends.map(|p| (self.depth(&p), p)).max_by(|a, b| a.0.total_cmp(&b.0));
            match inside {
                Some((depth, at)) if depth > 0.0 => best = Some((-(depth + slot.round_mm), at)),
                _ if crosses => best = best.map(|(_, at)| (-slot.round_mm.max(CROSS_MM), at)),
                _ => {}
            }
        }
        best.filter(|b| b.0 < bound)
    }

    /// The same to another surface, each in the rest pose of its body, both bodies moved; the place is where `own` puts it.
    fn gap_to_surface(
        &self,
        own: &Pose,
        other: &Surface,
        others: &Pose,
        bound: f64,
    ) -> Option<(f64, Vector3<f64>)> {
        let brought = |p: &Vector3<f64>| own.back(&others.point(p));
        let mut best: Option<(f64, Vector3<f64>)> = None;
        let mut least = bound.max(0.0);
        if let (Some(a), Some(b)) = (self.nodes.len().checked_sub(1), other.nodes.len().checked_sub(1)) {
            let turn = own.rotation.transpose() * others.rotation;
            self.pairs(a, (other, b), &turn, &brought, &mut least, &mut best);
        }
        let crosses = best.is_some_and(|b| b.0 <= 0.0);
        if crosses || best.is_none_or(|b| b.0 > 0.0) {
            let returned = |p: &Vector3<f64>| others.back(&own.point(p));
            let step = |s: &Surface| (s.mesh.vertices.len() / SAMPLES).max(1);
            let into =
                other.mesh.vertices.iter().step_by(step(other)).map(brought).map(|p| (self.depth(&p), p));
            let of = self.mesh.vertices.iter().step_by(step(self)).map(|p| (other.depth(&returned(p)), *p));
            let deepest = into.chain(of).max_by(|a, b| a.0.total_cmp(&b.0));
            match deepest {
                Some((depth, at)) if depth > 0.0 => best = Some((-depth.max(CROSS_MM), at)),
                _ if crosses => best = best.map(|(_, at)| (-CROSS_MM, at)),
                _ => {}
            }
        }
        best.filter(|b| b.0 < bound).map(|(gap, at)| (gap, own.point(&at)))
    }

    fn pairs(
        &self,
        a: usize,
        (other, b): (&Surface, usize),
        turn: &Matrix3<f64>,
        brought: &impl Fn(&Vector3<f64>) -> Vector3<f64>,
        least: &mut f64,
        best: &mut Option<(f64, Vector3<f64>)>,
    ) {
        let (Some(n), Some(m)) = (self.nodes.get(a), other.nodes.get(b)) else { return };
        let moved = |m: &Node| {
            let (center, half) = (brought(&((m.low + m.high) / 2.0)), turn.abs() * ((m.high - m.low) / 2.0));
            (center - half, center + half)
        };
        let near = |n: &Node, m: &Node| apart(&(n.low, n.high), &moved(m));
        if near(n, m) > *least {
            return;
        }
        // The larger one is opened.
        let larger = (n.high - n.low).norm() >= (m.high - m.low).norm();
        let next = match (n.content, m.content) {
            (Ok(halves), Err(_)) => halves.map(|h| (h, b)),
            (Ok(halves), _) if larger => halves.map(|h| (h, b)),
            (_, Ok(halves)) => halves.map(|h| (a, h)),
            (Err(own), Err(others)) => {
                for t in self.order.get(own[0]..own[1]).unwrap_or_default() {
                    for u in other.order.get(others[0]..others[1]).unwrap_or_default() {
                        let (p, q) = (self.mesh.corners(*t), other.mesh.corners(*u).map(|p| brought(&p)));
                        if apart(&box_of(&p), &box_of(&q)) <= *least {
                            let s = until_apart(&p, &q, *least);
                            if s.gap_mm < TOUCH_MM {
                                // Nothing is nearer than that.
                                (*best, *least) = (Some((0.0, s.at)), f64::NEG_INFINITY);
                            } else if s.gap_mm < *least {
                                (*best, *least) = (Some((s.gap_mm, s.at)), s.gap_mm);
                            }
                        }
                    }
                }
                return;
            }
        };
        let way = |(i, j): (usize, usize)| match (self.nodes.get(i), other.nodes.get(j)) {
            (Some(n), Some(m)) => near(n, m),
            _ => f64::INFINITY,
        };
        let next = if way(next[1]) < way(next[0]) { [next[1], next[0]] } else { next };
        for (i, j) in next {
            self.pairs(i, (other, j), turn, brought, least, best);
        }
    }
}

/// Whether a ray meets a triangle. Without slack: a crossing of an edge that is counted twice would turn inside out.
fn meets(from: &Vector3<f64>, d: &Vector3<f64>, corners: &[Vector3<f64>; 3]) -> bool {
    Met::new(from, d, corners).is_some_and(|met| met.is_within(0.0) && met.way > 0.0)
}

/// A body with solids, or beside one: its solids in the rest pose, where it is, and its primitives there.
pub(super) struct Beside<'a> {
    pub solids: &'a [Surface],
    pub pose: &'a Pose,
    pub slots: &'a [Slot],
}

impl Beside<'_> {
    /// The least gap in which a solid takes part, with its place, if it is below a bound.
    pub(super) fn gap(&self, other: &Beside<'_>, bound: f64) -> Option<(f64, Vector3<f64>)> {
        let mut best: Option<(f64, Vector3<f64>)> = None;
        let left = |best: &Option<(f64, Vector3<f64>)>| best.map_or(bound, |b| b.0.min(bound));
        for solid in self.solids {
            for against in other.solids {
                best = solid.gap_to_surface(self.pose, against, other.pose, left(&best)).or(best);
            }
        }
        for (one, two) in [(self, other), (other, self)] {
            for solid in one.solids {
                for slot in two.slots {
                    let own = slot.back(one.pose);
                    let found = solid.gap_to_slot(&own, left(&best));
                    best = found.map(|(gap, at)| (gap, one.pose.point(&at))).or(best);
                }
            }
        }
        best
    }
}

impl Slot {
    /// The slot as a body sees it in its rest pose.
    fn back(&self, pose: &Pose) -> Slot {
        let back = pose.rotation.transpose();
        Slot { start: pose.back(&self.start), end: pose.back(&self.end), axis: back * self.axis, ..*self }
    }
}

impl BodyPlan {
    /// Solids that touch nothing else of their body, with their gap to it (mm) and its place.
    pub(super) fn loose_solids(&self) -> Vec<(&PlacedSolid, f64, Vector3<f64>)> {
        let surfaces = surfaces(self);
        let rest = Pose::rest(Vector3::zeros());
        let slots: Vec<Slot> = self.slots.iter().map(|(_, s)| *s).collect();
        // Touching spreads from the primitives over solids that meet.
        let mut held: Vec<bool> = Vec::new();
        let gap = |s: &Surface, slots: &[Slot]| {
            let found = slots.iter().filter_map(|slot| s.gap_to_slot(slot, f64::INFINITY));
            found.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, Vector3::zeros()))
        };
        let gaps: Vec<(f64, Vector3<f64>)> = surfaces.iter().map(|s| gap(s, &slots)).collect();
        held.extend(gaps.iter().map(|g| g.0 < 0.0));
        loop {
            let joins = |i: usize| {
                let meets = |j: usize| {
                    let pair = surfaces.get(i).zip(surfaces.get(j));
                    held.get(j) == Some(&true)
                        && pair.is_some_and(|(a, b)| a.gap_to_surface(&rest, b, &rest, 0.0).is_some())
                };
                held.get(i) == Some(&false) && (0..surfaces.len()).any(meets)
            };
            let Some(new) = (0..surfaces.len()).find(|i| joins(*i)) else { break };
            if let Some(h) = held.get_mut(new) {
                *h = true;
            }
        }
        let all = self.solids.iter().zip(gaps).zip(held);
        all.filter(|(_, held)| !held).map(|((s, (gap, at)), _)| (s, gap, at)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pocket;

    fn block(center: [f64; 3], half_mm: [f64; 3]) -> Mesh {
        let edges = [Vector3::x(), Vector3::y(), Vector3::z()];
        Pocket { center: Vector3::from(center), edges, half_mm }.mesh()
    }

    #[test]
    fn gaps_to_a_block_are_those_of_the_closed_form() {
        let surface = Surface::new(block([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
        let v = Vector3::new;
        for (slot, gap) in [
            (Slot::capsule(v(9.0, 2.0, 3.0), v(12.0, 2.0, 3.0), 1.0), 3.0),
            (Slot::capsule(v(5.0 + 3.0, 7.0 + 4.0, 3.0), v(20.0, 20.0, 3.0), 1.0), 4.0),
            (Slot::bar(v(1.0, 2.0, 12.0), v(3.0, 2.0, 12.0), Vector3::z(), 2.0, 1.0, 0.0), 2.0),
            // Its ball dips in by half, its core stays outside.
            (Slot::capsule(v(5.5, 2.0, 3.0), v(9.0, 2.0, 3.0), 1.0), -0.5),
            // Wholly inside, 4 mm below the nearest face.
            (Slot::capsule(v(1.0, 2.0, 3.0), v(1.0, 2.0, 3.0), 0.5), -4.5),
        ] {
            let found = surface.gap_to_slot(&slot, f64::INFINITY).unwrap().0;
            assert!((found - gap).abs() < 1e-6, "{slot:?}: {found} {gap}");
            // A bound below it finds nothing, one above it the same.
            assert_eq!(surface.gap_to_slot(&slot, gap - 1e-3), None);
            assert!(surface.gap_to_slot(&slot, gap + 1e-3).is_some());
        }
        // Through it from side to side: at least as deep as its own thickness.
        let through = Slot::capsule(v(-20.0, 2.0, 3.0), v(20.0, 2.0, 3.0), 1.0);
        assert!(surface.gap_to_slot(&through, 0.0).unwrap().0 <= -1.0);
    }

    #[test]
    fn surfaces_are_measured_where_their_bodies_are() {
        let (a, b) = (block([0.0; 3], [2.0, 2.0, 2.0]), block([0.0; 3], [1.0, 1.0, 1.0]));
        let (a, b) = (Surface::new(a), Surface::new(b));
        let rest = Pose::rest(Vector3::zeros());
        let quarter = crate::math::exp_so3(&(Vector3::z() * std::f64::consts::FRAC_PI_4));
        let at = |x: f64| Pose {
            rotation: quarter,
            translation: Vector3::new(x, 0.0, 0.0),
            center: Vector3::zeros(),
        };
        // The small block's edge points at the large one.
        for x in [3.5, 5.0, 9.0] {
            let gap = a.gap_to_surface(&rest, &b, &at(x), f64::INFINITY).unwrap().0;
            assert!((gap - (x - 2.0_f64.sqrt() - 2.0)).abs() < 1e-6, "{x}: {gap}");
        }
        assert!(a.gap_to_surface(&rest, &b, &at(3.0), 0.0).unwrap().0 < -0.3);
        // One inside the other.
        assert!((a.gap_to_surface(&rest, &b, &rest, 0.0).unwrap().0 + 1.0).abs() < 1e-6);
    }

    #[test]
    fn faults_say_what_where_and_how_many() {
        let of = |mesh: &Mesh, triangles: Vec<[usize; 3]>| {
            let vertices = mesh.vertices.iter().map(|p| [p.x, p.y, p.z]).collect();
            TriangleMesh { vertices, triangles, ..TriangleMesh::default() }
        };
        let whole = block([0.0; 3], [1.0, 1.0, 1.0]);
        assert_eq!(faults(&of(&whole, whole.triangles.clone())), []);
        let open = of(&whole, whole.triangles[1..].to_vec());
        assert_eq!(
            faults(&open).iter().map(|f| (f.kind, f.count)).collect::<Vec<_>>(),
            [(SurfaceFaultKind::Open, 3)]
        );
        let mut turned = whole.triangles.clone();
        turned[3].swap(1, 2);
        let turned = of(&whole, turned);
        assert_eq!(faults(&turned)[0].kind, SurfaceFaultKind::NoSides);
        let mut two = whole.clone();
        two.append(&block([1.0, 0.7, 0.3], [0.5, 0.5, 0.5]));
        let crossing = of(&two, two.triangles.clone());
        assert_eq!(faults(&crossing)[0].kind, SurfaceFaultKind::Crossing);
        assert!(faults(&crossing)[0].count >= 4);
    }
}
