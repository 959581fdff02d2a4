//! A triangle mesh from a file, as a part of a body.

use super::{ExprPoint, Origin};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};

/// A mesh that is united with the printed form of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AddedSolid {
    /// Path of its file, from the folder of the design.
    pub file: String,
    /// Digest of the file's bytes.
    pub digest: String,
    /// What the file holds; no part of the design's text form, where the digest stands for it.
    #[serde(skip)]
    pub mesh: Arc<TriangleMesh>,
    /// Where the file's origin is put, drawing pose.
    pub position: ExprPoint,
    /// How it is turned about that place: orthogonal, in rows.
    pub rotation: [[f64; 3]; 3],
    /// By what the file's lengths are multiplied.
    pub scale: f64,
    /// Statement.
    pub origin: Origin,
}

/// Triangles as a file has them, counter-clockwise seen from outside; lengths in mm. Never changed once it is read.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Digest of the file.
    pub digest: String,
    /// Corners, those that are equal to the last bit once.
    pub vertices: Vec<[f64; 3]>,
    /// Their indices, three a triangle.
    pub triangles: Vec<[usize; 3]>,
    /// The file has its triangles the other way round: what is inside was outside.
    pub inside_out: bool,
    /// What is wrong with its surface, once somebody has looked: large meshes take a second.
    pub faults: OnceLock<Vec<SurfaceFault>>,
}

/// Same file, same mesh.
impl PartialEq for TriangleMesh {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

/// A way in which a surface does not bound a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceFault {
    /// What.
    pub kind: SurfaceFaultKind,
    /// How many edges, triangles, pairs of triangles or corners.
    pub count: usize,
    /// The first of them, coordinates of the file, mm.
    pub at: [f64; 3],
}

/// Kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceFaultKind {
    /// Edges with one triangle.
    Open,
    /// Edges with more than two triangles, or two that run through them the same way.
    NoSides,
    /// Pairs of triangles that cross.
    Crossing,
}
