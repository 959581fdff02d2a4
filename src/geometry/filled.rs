//! A closed mesh on a grid of distances.

use super::distance::point_triangle;
use super::field::Field;
use super::mesh::Mesh;
use nalgebra::Vector3;

/// Rows of nodes are looked along this part of a step beside them: through no edge that lies on the grid.
const ASIDE: [f64; 2] = [1.37e-5, 2.11e-5];

impl Field {
    /// Adds a closed mesh to the region: exact within `reach` of its surface, minus `reach` farther inside.
    pub(super) fn add_mesh(&mut self, mesh: &Mesh, reach: f64) {
        let [nx, ny, nz] = self.count;
        let (origin, step) = (self.origin, self.step);
        let range = |low: f64, high: f64, k: usize, n: usize| {
            let first = ((low - origin[k]) / step).ceil().max(0.0) as usize;
            let last = ((high - origin[k]) / step).floor();
            first..if last < 0.0 { 0 } else { (last as usize + 1).min(n) }
        };
        // Where each row along x meets the surface.
        let mut rows: Vec<Vec<f64>> = vec![Vec::new(); ny * nz];
        let mut near = vec![f64::INFINITY; self.values.len()];
        for t in 0..mesh.triangles.len() {
            let corners = mesh.corners(t);
            let [a, b, c] = corners;
            let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
            for k in range(low.z - step, high.z + step, 2, nz) {
                for j in range(low.y - step, high.y + step, 1, ny) {
                    let y = origin.y + (j as f64 + ASIDE[0]) * step;
                    let z = origin.z + (k as f64 + ASIDE[1]) * step;
                    if let (Some(x), Some(row)) = (along_x(&corners, y, z), rows.get_mut(k * ny + j)) {
                        row.push(x);
                    }
                }
            }
            for k in range(low.z - reach, high.z + reach, 2, nz) {
                for j in range(low.y - reach, high.y + reach, 1, ny) {
                    for i in range(low.x - reach, high.x + reach, 0, nx) {
                        let p = origin + Vector3::new(i as f64, j as f64, k as f64) * step;
                        if let Some(known) = near.get_mut((k * ny + j) * nx + i) {
                            *known = known.min((point_triangle(&p, &corners) - p).norm());
                        }
                    }
                }
            }
        }
        for (r, row) in rows.iter_mut().enumerate() {
            row.sort_by(f64::total_cmp);
            for i in 0..nx {
                let x = origin.x + i as f64 * step;
                let inside = row.partition_point(|hit| *hit < x) % 2 == 1;
                let id = r * nx + i;
                let (Some(value), Some(distance)) = (self.values.get_mut(id), near.get(id)) else { continue };
                if inside {
                    *value = value.min(-distance.min(reach));
                } else if *distance <= reach {
                    *value = value.min(*distance);
                }
            }
        }
    }
}

/// Where a line along x meets a triangle. By areas seen along x, not as other rays are met: the test of an edge is the same
/// from both of its triangles but for the sign, and a whole row of nodes is told by one line.
fn along_x([a, b, c]: &[Vector3<f64>; 3], y: f64, z: f64) -> Option<f64> {
    let turn = |p: &Vector3<f64>, q: &Vector3<f64>| (p.y - y) * (q.z - z) - (p.z - z) * (q.y - y);
    let (u, v, w) = (turn(b, c), turn(c, a), turn(a, b));
    let sum = u + v + w;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    (inside && sum != 0.0).then(|| (a.x * u + b.x * v + c.x * w) / sum)
}
