//! An independent look at a finished mesh: closed, oriented, in how many pieces, crossing itself or
//! not. Nothing here knows how the mesh was made.
//!
//! Readers of STL take vertices for one that are nearly equal, and programs with exact arithmetic take a crossing for a
//! crossing however small. So vertices are looked at on a lattice of 1e-6 mm, those on one lattice point are one, and
//! from there on there is no tolerance.

use super::exact::{Point, is_flat, on_lattice, triangles_meet};
use super::mesh::Mesh;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// What a mesh is like.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFacts {
    /// Every edge has exactly two triangles.
    pub closed: bool,
    /// The two triangles of every edge run through it in opposite directions.
    pub oriented: bool,
    /// Pieces not connected through edges.
    pub components: usize,
    /// Pairs of triangles that have more in common than their corners and edges.
    pub self_intersections: usize,
    /// Triangles without an area: corners on one line, or nearer to each other than the lattice is wide.
    pub flat: usize,
    /// Vertices in which surfaces touch that are not neighbours there.
    pub pinched: usize,
    /// The first few of those pairs.
    pub examples: Vec<(usize, usize)>,
    /// Enclosed volume, mm³.
    pub volume_mm3: f64,
    /// Surface, mm².
    pub area_mm2: f64,
    /// Least corner of the bounding box, mm.
    pub least: Vector3<f64>,
    /// Largest corner of the bounding box, mm.
    pub largest: Vector3<f64>,
    /// Number of triangles.
    pub triangles: usize,
}

impl MeshFacts {
    /// Closed, oriented, in one piece, a manifold that does not cross itself, and not inside out.
    pub fn is_printable(&self) -> bool {
        self.is_sound() && self.components == 1
    }

    /// The same in any number of pieces.
    pub fn is_sound(&self) -> bool {
        self.closed
            && self.oriented
            && self.self_intersections == 0
            && self.flat == 0
            && self.pinched == 0
            && self.volume_mm3 > 0.0
    }
}

/// A mesh with its vertices on the lattice, those on one point merged.
struct OnLattice {
    points: Vec<Point>,
    triangles: Vec<[usize; 3]>,
}

impl OnLattice {
    fn new(mesh: &Mesh) -> Self {
        let mut ids: BTreeMap<Point, usize> = BTreeMap::new();
        let mut points = Vec::new();
        let place: Vec<usize> = mesh
            .vertices
            .iter()
            .map(|p| {
                let q = on_lattice(p);
                *ids.entry(q).or_insert_with(|| {
                    points.push(q);
                    points.len() - 1
                })
            })
            .collect();
        // A vertex that does not exist stays one that does not.
        let there = |i: usize| place.get(i).copied().unwrap_or(usize::MAX);
        let triangles = mesh.triangles.iter().map(|t| t.map(there)).collect();
        Self { points, triangles }
    }

    fn corners(&self, t: usize) -> [Point; 3] {
        self.triangles[t].map(|i| self.points.get(i).copied().unwrap_or_default())
    }

    /// A triangle without an area.
    fn is_flat(&self, t: usize) -> bool {
        let [a, b, c] = self.triangles[t];
        a == b || b == c || c == a || is_flat(&self.corners(t))
    }
}

/// Checks a mesh.
pub fn check_mesh(mesh: &Mesh) -> MeshFacts {
    let on = OnLattice::new(mesh);
    // Edge → triangles that run through it upwards, downwards (by vertex index).
    let mut edges: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
    let mut piece = Pieces::new(on.triangles.len());
    // Corners 3 t + k: neighbours over an edge are joined at both its ends.
    let mut fans = Pieces::new(3 * on.triangles.len());
    let mut first_at: BTreeMap<(usize, usize), (usize, [usize; 2])> = BTreeMap::new();
    let mut used = vec![false; on.points.len()];
    let mut sound = !on.triangles.is_empty() && mesh.vertices.iter().all(|p| p.iter().all(|x| x.is_finite()));
    for (t, ids) in on.triangles.iter().enumerate() {
        for k in 0..3 {
            let (i, j) = (ids[k], ids[(k + 1) % 3]);
            sound &= i != j && i < on.points.len() && j < on.points.len();
            if let Some(u) = used.get_mut(i) {
                *u = true;
            }
            let key = (i.min(j), i.max(j));
            let mut ends = [3 * t + k, 3 * t + (k + 1) % 3];
            let count = edges.entry(key).or_default();
            if i < j {
                count.0 += 1;
            } else {
                count.1 += 1;
                ends.swap(0, 1);
            }
            let (first, at) = *first_at.entry(key).or_insert((t, ends));
            piece.join(first, t);
            fans.join(at[0], ends[0]);
            fans.join(at[1], ends[1]);
        }
    }
    let closed = sound && edges.values().all(|(up, down)| up + down == 2);
    let oriented = sound && edges.values().all(|(up, down)| *up <= 1 && *down <= 1);
    let crossing = crossing_pairs(mesh);
    let (least, largest) = mesh.bounding_box().unwrap_or_default();
    MeshFacts {
        closed,
        oriented,
        components: piece.count(),
        self_intersections: crossing.len(),
        flat: (0..on.triangles.len()).filter(|t| on.is_flat(*t)).count(),
        pinched: fans.count().saturating_sub(used.iter().filter(|u| **u).count()),
        examples: crossing.into_iter().take(10).collect(),
        volume_mm3: mesh.volume_mm3(),
        area_mm2: mesh.area_mm2(),
        least,
        largest,
        triangles: mesh.triangles.len(),
    }
}

/// Union–find.
struct Pieces(Vec<usize>);

impl Pieces {
    fn new(n: usize) -> Self {
        Self((0..n).collect())
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, i: usize, j: usize) {
        let (a, b) = (self.root(i), self.root(j));
        self.0[a.max(b)] = a.min(b);
    }

    fn count(&self) -> usize {
        self.0.iter().enumerate().filter(|(i, root)| i == *root).count()
    }
}

/// Pairs of triangles that have more in common than their corners and edges, sorted; those without an area apart.
/// Broad phase: boxes in a sweep over a median-split tree.
pub fn crossing_pairs(mesh: &Mesh) -> Vec<(usize, usize)> {
    let on = OnLattice::new(mesh);
    let corners: Vec<[Point; 3]> = (0..on.triangles.len()).map(|t| on.corners(t)).collect();
    // Whole numbers below 2^53: exact in floats.
    let boxes: Vec<(Vector3<f64>, Vector3<f64>)> = corners
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|p| Vector3::from(p.map(|x| x as f64)));
            (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
        })
        .collect();
    let mut ids: Vec<usize> = (0..corners.len()).filter(|t| !on.is_flat(*t)).collect();
    let solid = ids.clone();
    let tree = Tree::build(&mut ids, &boxes);
    let mut found = Vec::new();
    let mut near = Vec::new();
    for t in solid {
        near.clear();
        tree.query(&boxes[t], &mut near, &boxes);
        for &u in near.iter().filter(|u| **u > t) {
            if triangles_meet(&on.triangles[t], &corners[t], &on.triangles[u], &corners[u]) {
                found.push((t, u));
            }
        }
    }
    found.sort_unstable();
    found
}

/// Bounding-box tree over triangles.
pub(crate) struct Tree {
    least: Vector3<f64>,
    largest: Vector3<f64>,
    content: Content,
}

enum Content {
    Leaf(Vec<usize>),
    Halves(Box<[Tree; 2]>),
}

impl Tree {
    /// Builds a tree by splitting at the median of the longest side.
    pub(crate) fn build(ids: &mut [usize], boxes: &[(Vector3<f64>, Vector3<f64>)]) -> Self {
        let far = Vector3::repeat(f64::INFINITY);
        let (least, largest) =
            ids.iter().fold((far, -far), |(lo, hi), i| (lo.inf(&boxes[*i].0), hi.sup(&boxes[*i].1)));
        if ids.len() <= 8 {
            return Self { least, largest, content: Content::Leaf(ids.to_vec()) };
        }
        let side = (largest - least).imax();
        let middle = |i: usize| boxes[i].0[side] + boxes[i].1[side];
        ids.sort_by(|i, j| middle(*i).total_cmp(&middle(*j)).then(i.cmp(j)));
        let (left, right) = ids.split_at_mut(ids.len() / 2);
        let halves = Box::new([Self::build(left, boxes), Self::build(right, boxes)]);
        Self { least, largest, content: Content::Halves(halves) }
    }

    /// Appends all triangles whose boxes touch the given one.
    pub(crate) fn query(
        &self,
        region: &(Vector3<f64>, Vector3<f64>),
        found: &mut Vec<usize>,
        boxes: &[(Vector3<f64>, Vector3<f64>)],
    ) {
        let overlap = |lo: &Vector3<f64>, hi: &Vector3<f64>| {
            (0..3).all(|k| lo[k] <= region.1[k] && hi[k] >= region.0[k])
        };
        if !overlap(&self.least, &self.largest) {
            return;
        }
        match &self.content {
            Content::Leaf(ids) => found.extend(ids.iter().filter(|i| overlap(&boxes[**i].0, &boxes[**i].1))),
            Content::Halves(halves) => halves.iter().for_each(|h| h.query(region, found, boxes)),
        }
    }
}
