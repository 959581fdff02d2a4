//! An independent look at a finished mesh: closed, oriented, in how many pieces, crossing itself or
//! not. Nothing here knows how the mesh was made.

use super::mesh::Mesh;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Two triangles cross only if corners lie farther than this on both sides of the other's plane, mm.
/// Rounding to `f32` moves a vertex by up to 4e-6 mm at 60 mm, 8e-6 mm beyond 64 mm.
pub const TOUCH_MM: f64 = 2e-5;

/// What a mesh is like.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFacts {
    /// Every edge has exactly two triangles.
    pub closed: bool,
    /// The two triangles of every edge run through it in opposite directions.
    pub oriented: bool,
    /// Pieces not connected through edges.
    pub components: usize,
    /// Pairs of triangles that cross each other by more than [`TOUCH_MM`].
    pub self_intersections: usize,
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
    /// Closed, oriented, in one piece, not crossing itself, and not inside out.
    pub fn is_printable(&self) -> bool {
        self.closed
            && self.oriented
            && self.components == 1
            && self.self_intersections == 0
            && self.volume_mm3 > 0.0
    }
}

/// Checks a mesh.
pub fn check_mesh(mesh: &Mesh) -> MeshFacts {
    // Edge → triangles that run through it upwards, downwards (by vertex index).
    let mut edges: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
    let mut piece = Pieces::new(mesh.triangles.len());
    let mut first_at: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut sound = !mesh.triangles.is_empty();
    for (t, ids) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let (i, j) = (ids[k], ids[(k + 1) % 3]);
            sound &= i != j && i < mesh.vertices.len() && j < mesh.vertices.len();
            let key = (i.min(j), i.max(j));
            let count = edges.entry(key).or_default();
            if i < j {
                count.0 += 1;
            } else {
                count.1 += 1;
            }
            let first = *first_at.entry(key).or_insert(t);
            piece.join(first, t);
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
        examples: crossing.into_iter().take(10).collect(),
        volume_mm3: mesh.volume_mm3(),
        area_mm2: mesh.area_mm2(),
        least,
        largest,
        triangles: mesh.triangles.len(),
    }
}

/// Union–find over triangles.
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

/// Pairs of triangles that cross, sorted. Broad phase: boxes in a sweep over a median-split tree.
pub fn crossing_pairs(mesh: &Mesh) -> Vec<(usize, usize)> {
    let corners: Vec<[Vector3<f64>; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
    let boxes: Vec<(Vector3<f64>, Vector3<f64>)> =
        corners.iter().map(|[a, b, c]| (a.inf(b).inf(c), a.sup(b).sup(c))).collect();
    let mut ids: Vec<usize> = (0..corners.len()).collect();
    let tree = Tree::build(&mut ids, &boxes);
    let mut found = Vec::new();
    let mut near = Vec::new();
    for t in 0..corners.len() {
        near.clear();
        tree.query(&boxes[t], &mut near, &boxes);
        for &u in near.iter().filter(|u| **u > t) {
            if triangles_cross(&mesh.triangles[t], &corners[t], &mesh.triangles[u], &corners[u]) {
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

/// Whether two triangles cross each other, touching at shared corners and edges apart.
fn triangles_cross(
    s_ids: &[usize; 3],
    s: &[Vector3<f64>; 3],
    t_ids: &[usize; 3],
    t: &[Vector3<f64>; 3],
) -> bool {
    let shared = s_ids.iter().filter(|i| t_ids.contains(i)).count();
    if shared == 3 {
        return true;
    }
    let (ds, dt) = (plane_distances(s, t), plane_distances(t, s));
    let (Some(ds), Some(dt)) = (ds, dt) else {
        // A needle has no plane; its neighbours show what is wrong with it.
        return false;
    };
    if ds.iter().all(|d| d.abs() <= TOUCH_MM) && dt.iter().all(|d| d.abs() <= TOUCH_MM) {
        return coplanar_overlap(s, t);
    }
    shared < 2 && (edge_pierces(s, &ds, t) || edge_pierces(t, &dt, s))
}

/// Signed distances of `s`'s corners from the plane of `t`.
fn plane_distances(s: &[Vector3<f64>; 3], t: &[Vector3<f64>; 3]) -> Option<[f64; 3]> {
    let n = (t[1] - t[0]).cross(&(t[2] - t[0])).try_normalize(1e-12)?;
    Some(s.map(|p| n.dot(&(p - t[0]))))
}

/// Whether an edge of `s`, whose corners are `d` away from `t`'s plane, runs through `t`'s inside.
fn edge_pierces(s: &[Vector3<f64>; 3], d: &[f64; 3], t: &[Vector3<f64>; 3]) -> bool {
    let n = (t[1] - t[0]).cross(&(t[2] - t[0]));
    (0..3).any(|k| {
        let (i, j) = (k, (k + 1) % 3);
        let crosses = (d[i] > TOUCH_MM && d[j] < -TOUCH_MM) || (d[i] < -TOUCH_MM && d[j] > TOUCH_MM);
        crosses && {
            let p = s[i] + (s[j] - s[i]) * (d[i] / (d[i] - d[j]));
            (0..3).all(|e| {
                let (a, b) = (t[e], t[(e + 1) % 3]);
                // Distance from the edge, inwards.
                n.cross(&(b - a)).try_normalize(0.0).is_some_and(|inward| inward.dot(&(p - a)) > TOUCH_MM)
            })
        }
    })
}

/// Whether two triangles in one plane overlap by more than the tolerance: no edge of either
/// separates them.
fn coplanar_overlap(s: &[Vector3<f64>; 3], t: &[Vector3<f64>; 3]) -> bool {
    let separates = |a: &[Vector3<f64>; 3], b: &[Vector3<f64>; 3]| {
        let n = (a[1] - a[0]).cross(&(a[2] - a[0]));
        (0..3).any(|e| {
            let (p, q) = (a[e], a[(e + 1) % 3]);
            n.cross(&(q - p))
                .try_normalize(0.0)
                .is_none_or(|inward| b.iter().all(|x| inward.dot(&(x - p)) <= TOUCH_MM))
        })
    };
    !separates(s, t) && !separates(t, s)
}
