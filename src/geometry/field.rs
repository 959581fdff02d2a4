//! A region of space as a distance field on a grid, and its surface: what a flexure sweeps over a cycle has no simpler
//! form. The surface is taken tetrahedron by tetrahedron (six a cell, after Kuhn 1960), so it is closed and a manifold
//! whatever the field.

use super::mesh::Mesh;
use super::slot::Slot;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Nodes of a grid at most: a larger region gets a wider step.
const MOST_NODES: usize = 3_000_000;
/// A node nearer to the surface than this part of a step counts as this far outside: no sliver is left there.
const SNAP: f64 = 0.05;

/// Distances on a regular grid, mm; negative inside.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) origin: Vector3<f64>,
    pub(super) step: f64,
    pub(super) count: [usize; 3],
    pub(super) values: Vec<f64>,
}

impl Field {
    /// A grid over a box with nothing inside; `far` is the distance stated where nothing is near.
    pub(super) fn new(least: &Vector3<f64>, largest: &Vector3<f64>, step_mm: f64, far: f64) -> Self {
        let size = (largest - least).sup(&Vector3::zeros());
        let nodes = |h: f64| size.iter().map(|s| (s / h).ceil() as usize + 1).product::<usize>();
        let mut step = step_mm;
        while nodes(step) > MOST_NODES {
            step *= 1.1;
        }
        let count = [size.x, size.y, size.z].map(|s| (s / step).ceil() as usize + 1);
        Self { origin: *least, step, count, values: vec![far; count.iter().product()] }
    }

    pub(super) fn point(&self, i: usize) -> Vector3<f64> {
        let [nx, ny, _] = self.count;
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        self.origin + Vector3::new(at[0] as f64, at[1] as f64, at[2] as f64) * self.step
    }

    /// Calls `f` for every node within `reach` of a slot's bounding box.
    pub(super) fn near(&mut self, slot: &Slot, reach: f64, mut f: impl FnMut(&Vector3<f64>, &mut f64)) {
        let corner = slot.extent() + Vector3::repeat(reach);
        let (least, largest) = (slot.start.inf(&slot.end) - corner, slot.start.sup(&slot.end) + corner);
        let range = |k: usize| {
            let low = ((least[k] - self.origin[k]) / self.step).ceil().max(0.0) as usize;
            let high = ((largest[k] - self.origin[k]) / self.step).floor();
            (low, if high < 0.0 { 0 } else { (high as usize + 1).min(self.count[k]) })
        };
        let (x, y, z) = (range(0), range(1), range(2));
        for k in z.0..z.1 {
            for j in y.0..y.1 {
                for i in x.0..x.1 {
                    let id = (k * self.count[1] + j) * self.count[0] + i;
                    let p = self.origin + Vector3::new(i as f64, j as f64, k as f64) * self.step;
                    f(&p, &mut self.values[id]);
                }
            }
        }
    }

    /// Adds a slot grown by `grown` to the region, exact within `reach` of its surface.
    pub(super) fn add(&mut self, slot: &Slot, grown: f64, reach: f64) {
        self.near(slot, grown + reach, |p, value| *value = value.min(slot.signed_distance(p) - grown));
    }

    /// Trilinear value; `outside` beyond the grid.
    pub(super) fn at(&self, p: &Vector3<f64>, outside: f64) -> f64 {
        let q = (p - self.origin) / self.step;
        let mut base = [0; 3];
        let mut part = [0.0; 3];
        for k in 0..3 {
            if !(q[k] >= 0.0 && q[k] <= (self.count[k] - 1) as f64) || self.count[k] < 2 {
                return outside;
            }
            base[k] = (q[k] as usize).min(self.count[k] - 2);
            part[k] = q[k] - base[k] as f64;
        }
        (0..8)
            .map(|c| {
                let bit = |k: usize| c >> k & 1;
                let id = ((base[2] + bit(2)) * self.count[1] + base[1] + bit(1)) * self.count[0]
                    + base[0]
                    + bit(0);
                let weight = |k: usize| if bit(k) == 1 { part[k] } else { 1.0 - part[k] };
                self.values[id] * weight(0) * weight(1) * weight(2)
            })
            .sum()
    }

    /// The closed surface where the field is zero; nothing touches the border of the grid.
    pub(super) fn surface(&self) -> Mesh {
        let [nx, ny, nz] = self.count;
        let value = |i: usize| {
            let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
            let border = x == 0 || y == 0 || z == 0 || x + 1 == nx || y + 1 == ny || z + 1 == nz;
            let v = self.values[i];
            let least = SNAP * self.step;
            if border {
                v.max(least)
            } else if v.abs() < least {
                least
            } else {
                v
            }
        };
        let mut surface = Surface { field: self, mesh: Mesh::default(), known: HashMap::new() };
        let steps = [1, nx, nx * ny];
        // The six orders of the axes: each a way from a cell's first corner to its last one.
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        for z in 0..nz.saturating_sub(1) {
            for y in 0..ny.saturating_sub(1) {
                for x in 0..nx.saturating_sub(1) {
                    let first = (z * ny + y) * nx + x;
                    let corner = |c: usize| first + (0..3).map(|k| (c >> k & 1) * steps[k]).sum::<usize>();
                    let inside = (0..8).filter(|c| value(corner(*c)) < 0.0).count();
                    if inside == 0 || inside == 8 {
                        continue;
                    }
                    for [i, j, k] in ORDERS {
                        let (a, b) = (first, first + steps[i]);
                        let ids = [a, b, b + steps[j], b + steps[j] + steps[k]];
                        surface.tetrahedron(ids, ids.map(value));
                    }
                }
            }
        }
        surface.mesh
    }
}

/// A surface while it is built.
struct Surface<'a> {
    field: &'a Field,
    mesh: Mesh,
    /// Vertex on each grid edge; only looked up, so its order does not matter.
    known: HashMap<(usize, usize), usize>,
}

impl Surface<'_> {
    fn tetrahedron(&mut self, ids: [usize; 4], values: [f64; 4]) {
        let (inside, outside): (Vec<usize>, Vec<usize>) = (0..4).partition(|k| values[*k] < 0.0);
        let mut on = |p: usize, q: usize| self.vertex((ids[p], values[p]), (ids[q], values[q]));
        match (inside.as_slice(), outside.as_slice()) {
            ([a], [p, q, r]) => {
                let t = [on(*a, *p), on(*a, *q), on(*a, *r)];
                self.triangle(t, ids[*a], ids[*p]);
            }
            ([p, q, r], [a]) => {
                let t = [on(*p, *a), on(*q, *a), on(*r, *a)];
                self.triangle(t, ids[*p], ids[*a]);
            }
            ([a, b], [p, q]) => {
                let t = [on(*a, *p), on(*a, *q), on(*b, *q), on(*b, *p)];
                self.triangle([t[0], t[1], t[2]], ids[*a], ids[*q]);
                self.triangle([t[0], t[2], t[3]], ids[*b], ids[*p]);
            }
            _ => {}
        }
    }

    /// The vertex on an edge of the grid.
    fn vertex(&mut self, p: (usize, f64), q: (usize, f64)) -> usize {
        let (p, q) = if p.0 < q.0 { (p, q) } else { (q, p) };
        if let Some(known) = self.known.get(&(p.0, q.0)) {
            return *known;
        }
        let part = p.1 / (p.1 - q.1);
        let at = self.field.point(p.0).lerp(&self.field.point(q.0), part);
        self.mesh.vertices.push(at);
        let id = self.mesh.vertices.len() - 1;
        self.known.insert((p.0, q.0), id);
        id
    }

    /// A triangle, turned to look from a node inside to one outside.
    fn triangle(&mut self, t: [usize; 3], inside: usize, outside: usize) {
        let [a, b, c] = t.map(|i| self.mesh.vertices[i]);
        let out = self.field.point(outside) - self.field.point(inside);
        let turned = (b - a).cross(&(c - a)).dot(&out) < 0.0;
        self.mesh.triangles.push(if turned { [t[0], t[2], t[1]] } else { t });
    }
}
