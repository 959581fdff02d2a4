//! Collapse of the tiny edges that boolean operations leave where curves pass near vertices: rounded
//! to `f32`, their slivers could turn over. An edge is collapsed only if the surface stays a manifold
//! (link condition, Dey et al. 1999) and no neighbouring triangle turns.

use super::check::crossing_pairs;
use super::mesh::Mesh;
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Edges shorter than this are collapsed, mm: a hundredth of what a printer resolves.
pub const SHORT_EDGE_MM: f64 = 0.01;

/// A triangle lower than this is a sliver, mm: its longest edge is flipped.
const FLAT_MM: f64 = 5e-4;

/// Cosine of the largest turn of a neighbouring triangle.
const LEAST_COSINE: f64 = 0.97;

/// Passes over all edges and slivers; the next finds what the last made possible. All examples are done after five.
const PASSES: usize = 8;

/// Where rounding lets triangles cross, edges up to twice, four, … times as long are collapsed, this many times at most. The
/// longest, 0.08 mm, is still below what a printer resolves.
const MENDS: i32 = 3;

/// A united solid as it is written: without short edges and slivers as far as they can go, exact in `f32`, sorted; and free of crossings where
/// these come from rounding.
pub fn finished(united: &Mesh) -> Mesh {
    let mut work = Work::new(united);
    work.tidy(&|_, _| SHORT_EDGE_MM);
    let mut mesh = work.mesh().rounded_to_f32().sorted();
    for k in 1..=MENDS {
        let near: BTreeSet<usize> = crossing_pairs(&mesh)
            .iter()
            .flat_map(|(s, t)| [mesh.triangles[*s], mesh.triangles[*t]])
            .flatten()
            .flat_map(|i| work.within(&mesh.vertices[i], SHORT_EDGE_MM))
            .collect();
        if near.is_empty() {
            break;
        }
        let longer = SHORT_EDGE_MM * 2f64.powi(k);
        work.tidy(&|i, j| if near.contains(&i) || near.contains(&j) { longer } else { SHORT_EDGE_MM });
        mesh = work.mesh().rounded_to_f32().sorted();
    }
    mesh
}

/// The mesh without its short edges, as far as they can go, and without slivers.
pub fn without_short_edges(mesh: &Mesh, limit_mm: f64) -> Mesh {
    let mut work = Work::new(mesh);
    work.tidy(&|_, _| limit_mm);
    work.mesh()
}

struct Work {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<Option<[usize; 3]>>,
    /// Triangles at each vertex; may list dead ones.
    fans: Vec<Vec<usize>>,
}

impl Work {
    fn new(mesh: &Mesh) -> Self {
        let mut fans = vec![Vec::new(); mesh.vertices.len()];
        for (t, ids) in mesh.triangles.iter().enumerate() {
            ids.iter().for_each(|i| fans[*i].push(t));
        }
        let triangles = mesh.triangles.iter().copied().map(Some).collect();
        Self { vertices: mesh.vertices.clone(), triangles, fans }
    }

    /// Passes over all edges and slivers until nothing changes; `limit_mm` says of two ends how short an edge has to go.
    fn tidy(&mut self, limit_mm: &dyn Fn(usize, usize) -> f64) {
        for _ in 0..PASSES {
            let collapsed = self.pass(limit_mm);
            if !self.flip_flat_triangles() && !collapsed {
                break;
            }
        }
    }

    fn mesh(&self) -> Mesh {
        let triangles = self.triangles.iter().flatten().copied().collect();
        let mut out = Mesh { vertices: self.vertices.clone(), triangles };
        out.drop_unused_vertices();
        out
    }

    /// Vertices around a point.
    fn within(&self, p: &Vector3<f64>, radius_mm: f64) -> Vec<usize> {
        let near = |(i, q): (usize, &Vector3<f64>)| ((q - p).norm() < radius_mm).then_some(i);
        self.vertices.iter().enumerate().filter_map(near).collect()
    }

    /// Tries every short edge once, shortest first; true if any went.
    fn pass(&mut self, limit_mm: &dyn Fn(usize, usize) -> f64) -> bool {
        let mut short: Vec<(f64, usize, usize)> = Vec::new();
        for ids in self.triangles.iter().flatten() {
            for k in 0..3 {
                let (i, j) = (ids[k], ids[(k + 1) % 3]);
                let length = (self.vertices[i] - self.vertices[j]).norm();
                if i < j && length < limit_mm(i, j) {
                    short.push((length, i, j));
                }
            }
        }
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut any = false;
        for (_, i, j) in short {
            any |= self.collapse(i, j);
        }
        any
    }

    fn fan(&self, i: usize) -> impl Iterator<Item = (usize, [usize; 3])> + '_ {
        self.fans[i].iter().filter_map(|t| self.triangles[*t].map(|ids| (*t, ids)))
    }

    fn neighbours(&self, i: usize) -> Vec<usize> {
        let mut out: Vec<usize> = self.fan(i).flat_map(|(_, ids)| ids).filter(|k| *k != i).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Collapses an edge into whichever end disturbs less, if either may go.
    fn collapse(&mut self, i: usize, j: usize) -> bool {
        let near_j = self.neighbours(j);
        if near_j.binary_search(&i).is_err() {
            return false;
        }
        let common = self.neighbours(i).into_iter().filter(|k| near_j.binary_search(k).is_ok()).count();
        // Two vertices of three triangles each are the whole of a tetrahedron.
        if common != 2 || self.fan(i).count() < 4 && self.fan(j).count() < 4 {
            return false;
        }
        let (ij, ji) = (self.least_cosine(i, j), self.least_cosine(j, i));
        let (gone, kept, cosine) = if ij >= ji { (i, j, ij) } else { (j, i, ji) };
        if cosine < LEAST_COSINE {
            return false;
        }
        let moved = std::mem::take(&mut self.fans[gone]);
        for t in moved {
            let Some(ids) = self.triangles[t] else { continue };
            if ids.contains(&kept) {
                self.triangles[t] = None;
            } else {
                self.triangles[t] = Some(ids.map(|k| if k == gone { kept } else { k }));
                self.fans[kept].push(t);
            }
        }
        true
    }

    /// Replaces each sliver and the triangle at its longest edge by the two over the other diagonal; true if any went.
    fn flip_flat_triangles(&mut self) -> bool {
        let mut any = false;
        for t in 0..self.triangles.len() {
            let Some(ids) = self.triangles[t] else { continue };
            let length = |k: usize| (self.vertices[ids[k]] - self.vertices[ids[(k + 1) % 3]]).norm();
            let longest = (0..3).max_by(|k, l| length(*k).total_cmp(&length(*l))).unwrap_or(0);
            let (a, b, p) = (ids[longest], ids[(longest + 1) % 3], ids[(longest + 2) % 3]);
            if self.normal(ids).norm() >= FLAT_MM * length(longest) {
                continue;
            }
            // The neighbour runs through the edge the other way.
            let runs = |ids: &[usize; 3]| (0..3).find(|k| ids[*k] == b && ids[(*k + 1) % 3] == a);
            let neighbour = self.fan(a).find_map(|(u, ids)| runs(&ids).map(|k| (u, ids[(k + 2) % 3])));
            let Some((u, q)) = neighbour else { continue };
            let old = self.normal([b, a, q]);
            let (first, second) = ([a, q, p], [q, b, p]);
            let keeps = |new: [usize; 3]| {
                let n = self.normal(new);
                let low = FLAT_MM * (self.vertices[p] - self.vertices[q]).norm();
                n.norm() > low && n.dot(&old) > LEAST_COSINE * n.norm() * old.norm()
            };
            if p == q || self.neighbours(p).binary_search(&q).is_ok() || !keeps(first) || !keeps(second) {
                continue;
            }
            self.triangles[t] = Some(first);
            self.triangles[u] = Some(second);
            self.fans[q].push(t);
            self.fans[p].push(u);
            self.fans[b].retain(|k| *k != t);
            self.fans[a].retain(|k| *k != u);
            any = true;
        }
        any
    }

    /// Normal of a triangle, as long as twice its area.
    fn normal(&self, ids: [usize; 3]) -> Vector3<f64> {
        let [a, b, c] = ids.map(|k| self.vertices[k]);
        (b - a).cross(&(c - a))
    }

    /// How high a triangle stands over its longest edge, mm.
    fn height(&self, ids: [usize; 3]) -> f64 {
        let longest = (0..3).map(|k| (self.vertices[ids[k]] - self.vertices[ids[(k + 1) % 3]]).norm());
        self.normal(ids).norm() / longest.fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Cosine of the largest turn of a triangle when `gone` moves onto `kept`. The normal of a sliver says nothing: what
    /// becomes of it is compared with all that is around.
    fn least_cosine(&self, gone: usize, kept: usize) -> f64 {
        let around: Vector3<f64> = self.fan(gone).map(|(_, ids)| self.normal(ids)).sum();
        self.fan(gone)
            .filter(|(_, ids)| !ids.contains(&kept))
            .map(|(_, ids)| {
                let moved = ids.map(|k| if k == gone { kept } else { k });
                let cosine = |old: Vector3<f64>| {
                    let new = self.normal(moved);
                    old.dot(&new) / (old.norm() * new.norm()).max(f64::MIN_POSITIVE)
                };
                match (self.height(ids) < FLAT_MM, self.height(moved) < FLAT_MM) {
                    (true, true) => 1.0,
                    (true, false) if cosine(around) > 0.0 => 1.0,
                    _ => cosine(self.normal(ids)),
                }
            })
            .fold(1.0, f64::min)
    }
}
