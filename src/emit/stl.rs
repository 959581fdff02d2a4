//! Binary STL: one file a printed part, coordinates in mm.

use crate::geometry::Mesh;
use std::io::Cursor;
use stl_io::{Normal, Triangle, Vertex};

/// The bytes of a binary STL file: same mesh, same bytes. Triangles that have no area at `f32` get a zero normal, which
/// readers replace by the one the corners give.
///
/// # Errors
/// Only if the mesh holds more triangles than the format can count.
pub fn stl_bytes(mesh: &Mesh) -> std::io::Result<Vec<u8>> {
    let triangles: Vec<Triangle> = (0..mesh.triangles.len())
        .map(|t| {
            let corners = mesh.corners(t);
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let normal = normal.try_normalize(0.0).unwrap_or_default();
            let round = |v: &nalgebra::Vector3<f64>| [v.x as f32 + 0.0, v.y as f32 + 0.0, v.z as f32 + 0.0];
            Triangle {
                normal: Normal::new(round(&normal)),
                vertices: corners.map(|p| Vertex::new(round(&p))),
            }
        })
        .collect();
    let mut out = Cursor::new(Vec::with_capacity(84 + 50 * triangles.len()));
    stl_io::write_stl(&mut out, triangles.iter())?;
    Ok(out.into_inner())
}
