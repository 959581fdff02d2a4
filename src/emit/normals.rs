//! Vertex normals of a mesh for pictures: smooth over round faces, sharp at edges.

use crate::geometry::Mesh;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Faces that meet at a larger angle than this are shown with an edge. The coarsest round shape has 16 facets: 22.5°.
const CREASE_COS: f64 = 0.819; // 35°
/// Normals nearer than this (a coordinate) share a vertex: less than one step of an 8-bit shade.
const SAME: f64 = 1.0 / 512.0;

/// A mesh whose vertices stand once for each normal that is seen there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shaded {
    /// Positions, mm.
    pub positions: Vec<Vector3<f64>>,
    /// Unit normals.
    pub normals: Vec<Vector3<f64>>,
    /// Counter-clockwise seen from outside; triangles without area are left out.
    pub triangles: Vec<[usize; 3]>,
}

/// Each corner's normal is the mean of the faces round its vertex that make no edge with its own, by their angles there.
pub fn shaded(mesh: &Mesh) -> Shaded {
    let faces: Vec<Option<Vector3<f64>>> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            (b - a).cross(&(c - a)).try_normalize(1e-12)
        })
        .collect();
    let mut around: Vec<Vec<(usize, f64)>> = vec![Vec::new(); mesh.vertices.len()];
    for (t, ids) in mesh.triangles.iter().enumerate() {
        if faces[t].is_none() {
            continue;
        }
        let corners = mesh.corners(t);
        for k in 0..3 {
            let (p, q, r) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            around[ids[k]].push((t, (q - p).angle(&(r - p))));
        }
    }
    let mut out = Shaded::default();
    let mut known: BTreeMap<(usize, [i32; 3]), usize> = BTreeMap::new();
    for (t, ids) in mesh.triangles.iter().enumerate() {
        let Some(own) = faces[t] else { continue };
        let corners = ids.map(|i| {
            let smooth = around[i].iter().filter_map(|(other, angle)| {
                let face = faces[*other]?;
                (face.dot(&own) > CREASE_COS).then(|| face * *angle)
            });
            let normal = smooth.sum::<Vector3<f64>>().try_normalize(1e-12).unwrap_or(own);
            let key: [i32; 3] = std::array::from_fn(|k| (normal[k] / SAME).round() as i32);
            *known.entry((i, key)).or_insert_with(|| {
                out.positions.push(mesh.vertices[i]);
                out.normals.push(normal);
                out.positions.len() - 1
            })
        });
        out.triangles.push(corners);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Facets, Slot};

    #[test]
    fn a_ball_is_smooth_and_a_box_has_edges() {
        let ball = Slot::capsule(Vector3::zeros(), Vector3::x() * 1e-3, 5.0).mesh(&Facets::default(), 0.0);
        let seen = shaded(&ball);
        for (p, n) in seen.positions.iter().zip(&seen.normals) {
            assert!(p.normalize().dot(n) > 0.97, "{p} {n}");
        }
        let corner = |i: usize| Vector3::from([i & 1, i >> 1 & 1, i >> 2 & 1].map(|x| x as f64));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let cube = Mesh {
            vertices: (0..8).map(corner).collect(),
            triangles: sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        };
        let seen = shaded(&cube);
        assert_eq!(seen.positions.len(), 24, "a corner stands once for each of its three sides");
        assert!(seen.normals.iter().all(|n| n.amax() > 1.0 - 1e-12));
    }
}
