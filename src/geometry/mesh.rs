//! Indexed triangle meshes: volume, area, box, and the rounding to `f32` that STL demands.

use super::exact::LATTICE_PER_MM;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A triangle mesh; triangles are counter-clockwise seen from outside. Lengths in mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, mm.
    pub vertices: Vec<Vector3<f64>>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// The three corners of triangle `t`; the origin three times if there is none.
    pub fn corners(&self, t: usize) -> [Vector3<f64>; 3] {
        let corner = |i: usize| self.vertices.get(i).copied().unwrap_or_default();
        self.triangles.get(t).map_or([Vector3::zeros(); 3], |ids| ids.map(corner))
    }

    /// Enclosed volume by the divergence theorem, mm³; negative for a mesh turned inside out.
    pub fn volume_mm3(&self) -> f64 {
        // Relative to a vertex, so that a part far from the origin loses no digits.
        let origin = self.vertices.first().copied().unwrap_or_default();
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Surface area, mm².
    pub fn area_mm2(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                (b - a).cross(&(c - a)).norm() / 2.0
            })
            .sum()
    }

    /// Least and largest corner of the bounding box, mm; `None` for an empty mesh.
    pub fn bounding_box(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p))))
    }

    /// Appends another mesh without joining anything.
    pub fn append(&mut self, other: &Mesh) {
        let offset = self.vertices.len();
        self.vertices.extend_from_slice(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + offset)));
    }

    /// The mesh as an STL file can hold it and every reader takes it: coordinates rounded to one lattice for all of it
    /// ([`Mesh::step_mm`]), which is exact in `f32` and stays so where the mesh is moved by multiples of the step within the
    /// size of its box, vertices that coincide then merged, triangles that collapse then dropped together with pairs of
    /// triangles that fold onto each other. A closed mesh stays closed. Unused vertices are dropped.
    pub fn rounded_to_f32(&self) -> Mesh {
        let step = self.step_mm();
        // Adding zero turns -0.0 into 0.0, so that both have one key.
        let round = |x: f64| ((x / step).round() * step) as f32 + 0.0;
        let mut merged: BTreeMap<[u32; 3], usize> = BTreeMap::new();
        let mut out = Mesh::default();
        let mut target = Vec::with_capacity(self.vertices.len());
        for p in &self.vertices {
            let q = [round(p.x), round(p.y), round(p.z)];
            let id = *merged.entry(q.map(f32::to_bits)).or_insert_with(|| {
                out.vertices.push(Vector3::new(f64::from(q[0]), f64::from(q[1]), f64::from(q[2])));
                out.vertices.len() - 1
            });
            target.push(id);
        }
        out.triangles = self
            .triangles
            .iter()
            .map(|t| t.map(|i| target.get(i).copied().unwrap_or(usize::MAX)))
            .filter(|[a, b, c]| a != b && b != c && c != a && *a.max(b).max(c) < out.vertices.len())
            .collect();
        out.drop_folded_pairs();
        out.drop_unused_vertices();
        out
    }

    /// The finest lattice, a power of two in mm, on which `f32` holds each coordinate of the mesh, here and where the box
    /// around it begins at the origin; not finer than that of the exact predicates, where readers merge vertices.
    pub fn step_mm(&self) -> f64 {
        let Some((low, high)) = self.bounding_box() else { return 1.0 / LATTICE_PER_MM };
        let largest = low.amax().max(high.amax()).max((high - low).amax());
        let exponent = largest.log2().ceil().max(0.0) as i32;
        2f64.powi(exponent - f32::MANTISSA_DIGITS as i32).max(1.0 / LATTICE_PER_MM)
    }

    /// The same mesh in the one order its coordinates give: vertices sorted, every triangle from its
    /// least corner on, triangles sorted.
    pub(crate) fn sorted(&self) -> Mesh {
        let mut order: Vec<usize> = (0..self.vertices.len()).collect();
        let key = |i: usize| &self.vertices[i];
        order.sort_by(|i, j| {
            let (p, q) = (key(*i), key(*j));
            p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z)).then(i.cmp(j))
        });
        let mut place = vec![0; order.len()];
        for (new, old) in order.iter().enumerate() {
            place[*old] = new;
        }
        let mut triangles: Vec<[usize; 3]> = self
            .triangles
            .iter()
            .map(|t| {
                let mut t = t.map(|i| place[i]);
                let least = (0..3).min_by_key(|k| t[*k]).unwrap_or(0);
                t.rotate_left(least);
                t
            })
            .collect();
        triangles.sort_unstable();
        Mesh { vertices: order.iter().map(|i| self.vertices[*i]).collect(), triangles }
    }

    /// Moves every vertex by up to `size_mm` a coordinate, by a fixed function of `seed` and its
    /// index, so that no two operands of a boolean operation are in special position.
    pub(crate) fn shaken(mut self, size_mm: f64, seed: u64) -> Mesh {
        // SplitMix64 (Steele, Lea and Flood 2014).
        let mut state = seed.wrapping_mul(0xD1B5_4A32_D192_ED03);
        let mut next = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for p in &mut self.vertices {
            *p += Vector3::new(next(), next(), next()) * size_mm;
        }
        self
    }

    /// Removes pairs of triangles on the same three vertices with opposite orientation.
    pub(crate) fn drop_folded_pairs(&mut self) {
        let mut seen: BTreeMap<[usize; 3], Vec<(usize, bool)>> = BTreeMap::new();
        for (t, ids) in self.triangles.iter().enumerate() {
            let mut key = *ids;
            key.sort_unstable();
            let least = ids.iter().position(|i| *i == key[0]).unwrap_or(0);
            let even = ids[(least + 1) % 3] == key[1];
            seen.entry(key).or_default().push((t, even));
        }
        let mut dead = vec![false; self.triangles.len()];
        for copies in seen.values().filter(|c| c.len() > 1) {
            let (even, odd): (Vec<_>, Vec<_>) = copies.iter().partition(|(_, even)| *even);
            for ((a, _), (b, _)) in even.iter().zip(&odd) {
                dead[*a] = true;
                dead[*b] = true;
            }
        }
        let mut t = 0;
        self.triangles.retain(|_| {
            t += 1;
            !dead[t - 1]
        });
    }

    /// Removes vertices no triangle uses; the order of the others stays.
    pub(crate) fn drop_unused_vertices(&mut self) {
        let mut used = vec![false; self.vertices.len()];
        for i in self.triangles.iter().flatten() {
            used[*i] = true;
        }
        let mut new_id = vec![0; self.vertices.len()];
        let mut kept = 0;
        for (i, is_used) in used.iter().enumerate() {
            new_id[i] = kept;
            kept += usize::from(*is_used);
        }
        let mut i = 0;
        self.vertices.retain(|_| {
            i += 1;
            used[i - 1]
        });
        for t in &mut self.triangles {
            *t = t.map(|i| new_id[i]);
        }
    }
}
