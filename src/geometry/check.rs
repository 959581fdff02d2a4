//! An independent look at a finished mesh: closed, oriented, in how many pieces, crossing itself or
//! not. Nothing here knows how the mesh was made.
//!
//! Readers of STL take vertices for one that are nearly equal, and programs with exact arithmetic take a crossing for a
//! crossing however small. So vertices are looked at on a lattice of 1e-6 mm, those on one lattice point are one, and
//! from there on there is no tolerance.

use super::exact::{Point, is_flat, on_lattice, triangles_meet};
use super::mesh::Mesh;
use nalgebra::Vector3;
use rayon::prelude::*;

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

/// One triangle's use of an edge.
struct Edge {
    /// Vertices at its ends, the lesser one first.
    ends: (usize, usize),
    triangle: usize,
    /// It runs from the lesser to the larger one.
    upwards: bool,
    /// Corners of the triangle at these ends, 3 t + k.
    corners: [usize; 2],
}

impl Edge {
    /// Uses of edges, those of one edge side by side, edges ascending by their vertices.
    fn sorted(triangles: &[[usize; 3]]) -> Vec<Edge> {
        let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
        for (t, ids) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (i, j) = (ids[k], ids[(k + 1) % 3]);
                let (here, there) = (3 * t + k, 3 * t + (k + 1) % 3);
                let upwards = i < j;
                let corners = if upwards { [here, there] } else { [there, here] };
                edges.push(Edge { ends: (i.min(j), i.max(j)), triangle: t, upwards, corners });
            }
        }
        edges.par_sort_unstable_by_key(|e| (e.ends, e.triangle, e.corners));
        edges
    }

    /// The triangles at one edge that run through it upwards, and those that run downwards.
    fn ways(uses: &[Edge]) -> (usize, usize) {
        let up = uses.iter().filter(|e| e.upwards).count();
        (up, uses.len() - up)
    }
}

/// Edges of one kind: the vertices of the first one, and how many there are.
pub(super) struct Edges {
    pub first: (usize, usize),
    pub count: usize,
}

/// Edges of a closed and oriented surface have one triangle each way.
#[derive(Default)]
pub(super) struct WrongEdges {
    /// Those with one triangle.
    pub open: Option<Edges>,
    /// Those with more that do not have one each way.
    pub mixed: Option<Edges>,
}

/// What is wrong with edges, by the vertices' indices: unlike [`check_mesh`] it merges none, so that an edge is what a file says.
pub(super) fn wrong_edges(triangles: &[[usize; 3]]) -> WrongEdges {
    let mut found = WrongEdges::default();
    for uses in Edge::sorted(triangles).chunk_by(|a, b| a.ends == b.ends) {
        let kind = match Edge::ways(uses) {
            (1, 1) => continue,
            (1, 0) | (0, 1) => &mut found.open,
            _ => &mut found.mixed,
        };
        if let Some(first) = uses.first() {
            kind.get_or_insert(Edges { first: first.ends, count: 0 }).count += 1;
        }
    }
    found
}

/// A mesh with its vertices on the lattice, those on one point merged.
struct OnLattice {
    points: Vec<Point>,
    triangles: Vec<[usize; 3]>,
}

impl OnLattice {
    fn new(mesh: &Mesh) -> Self {
        let on: Vec<Point> = mesh.vertices.iter().map(on_lattice).collect();
        let mut order: Vec<usize> = (0..on.len()).collect();
        order.par_sort_unstable_by_key(|i| (on[*i], *i));
        let mut points: Vec<Point> = Vec::with_capacity(on.len());
        let mut place = vec![0; on.len()];
        for i in order {
            if points.last() != Some(&on[i]) {
                points.push(on[i]);
            }
            place[i] = points.len() - 1;
        }
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

    /// Broad phase: boxes in a median-split tree.
    fn crossing_pairs(&self) -> Vec<(usize, usize)> {
        let corners: Vec<[Point; 3]> =
            (0..self.triangles.len()).into_par_iter().map(|t| self.corners(t)).collect();
        let boxes: Vec<(Vector3<f64>, Vector3<f64>)> = corners.par_iter().map(bounds).collect();
        let solid: Vec<usize> = (0..corners.len()).into_par_iter().filter(|t| !self.is_flat(*t)).collect();
        let tree = Tree::build(&mut solid.clone(), &boxes);
        let meets = |near: &mut Vec<usize>, &t: &usize| {
            near.clear();
            tree.query(&boxes[t], near, &boxes);
            let crosses = |u: &usize| {
                triangles_meet(&self.triangles[t], &corners[t], &self.triangles[*u], &corners[*u])
            };
            near.iter().filter(|u| **u > t && crosses(u)).map(|u| (t, *u)).collect::<Vec<_>>()
        };
        let mut found: Vec<(usize, usize)> =
            solid.par_iter().map_init(Vec::new, meets).flatten_iter().collect();
        found.par_sort_unstable();
        found
    }
}

/// Checks a mesh.
pub fn check_mesh(mesh: &Mesh) -> MeshFacts {
    let on = OnLattice::new(mesh);
    let mut piece = Pieces::new(on.triangles.len());
    // Corners 3 t + k: neighbours over an edge are joined at both its ends.
    let mut fans = Pieces::new(3 * on.triangles.len());
    let mut used = vec![false; on.points.len()];
    let mut sound = !on.triangles.is_empty() && mesh.vertices.iter().all(|p| p.iter().all(|x| x.is_finite()));
    for ids in &on.triangles {
        for k in 0..3 {
            let (i, j) = (ids[k], ids[(k + 1) % 3]);
            sound &= i != j && i < on.points.len() && j < on.points.len();
            if let Some(u) = used.get_mut(i) {
                *u = true;
            }
        }
    }
    let edges = Edge::sorted(&on.triangles);
    let (mut closed, mut oriented) = (sound, sound);
    for uses in edges.chunk_by(|a, b| a.ends == b.ends) {
        let (up, down) = Edge::ways(uses);
        closed &= uses.len() == 2;
        oriented &= up <= 1 && down <= 1;
        for pair in uses.windows(2) {
            piece.join(pair[0].triangle, pair[1].triangle);
            fans.join(pair[0].corners[0], pair[1].corners[0]);
            fans.join(pair[0].corners[1], pair[1].corners[1]);
        }
    }
    let crossing = on.crossing_pairs();
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
pub fn crossing_pairs(mesh: &Mesh) -> Vec<(usize, usize)> {
    OnLattice::new(mesh).crossing_pairs()
}

/// Least and largest corner of a triangle: whole numbers below 2^53, exact in floats.
pub(super) fn bounds(t: &[Point; 3]) -> (Vector3<f64>, Vector3<f64>) {
    let [a, b, c] = t.map(|p| Vector3::from(p.map(|x| x as f64)));
    (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
}

/// Halves of a tree with fewer triangles are not worth a second thread.
const SHARED: usize = 4096;

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
        let half = ids.len() / 2;
        ids.select_nth_unstable_by(half, |i, j| middle(*i).total_cmp(&middle(*j)).then(i.cmp(j)));
        let (left, right) = ids.split_at_mut(half);
        let halves = if half < SHARED {
            [Self::build(left, boxes), Self::build(right, boxes)]
        } else {
            let (left, right) = rayon::join(|| Self::build(left, boxes), || Self::build(right, boxes));
            [left, right]
        };
        let halves = Box::new(halves);
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
