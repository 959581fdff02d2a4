//! Measuring a finished mesh by rays: thickness along a flexure, width of a bore.

use super::check::Tree;
use super::mesh::Mesh;
use nalgebra::Vector3;

/// A mesh prepared for many rays.
pub struct Probe<'a> {
    mesh: &'a Mesh,
    boxes: Vec<(Vector3<f64>, Vector3<f64>)>,
    tree: Tree,
}

impl<'a> Probe<'a> {
    /// Prepares a mesh.
    pub fn new(mesh: &'a Mesh) -> Self {
        let boxes: Vec<_> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
            })
            .collect();
        let mut ids: Vec<usize> = (0..boxes.len()).collect();
        let tree = Tree::build(&mut ids, &boxes);
        Self { mesh, boxes, tree }
    }

    /// Distances at which a ray meets the surface within a reach, ascending, with whether it leaves the solid there;
    /// `direction` need not be of unit length (distances are in mm all the same).
    pub fn hits(&self, from: &Vector3<f64>, direction: &Vector3<f64>, reach_mm: f64) -> Vec<(f64, bool)> {
        let Some(d) = direction.try_normalize(0.0) else { return Vec::new() };
        let to = from + d * reach_mm;
        let mut near = Vec::new();
        self.tree.query(&(from.inf(&to), from.sup(&to)), &mut near, &self.boxes);
        let mut hits: Vec<(f64, bool)> = near
            .into_iter()
            .filter_map(|t| ray_hits(from, &d, &self.mesh.corners(t)))
            .filter(|(t, _)| *t >= 0.0 && *t <= reach_mm)
            .collect();
        hits.sort_by(|p, q| p.0.total_cmp(&q.0));
        hits
    }

    /// Thickness of the solid at a point inside it, along a direction both ways, mm: `None` if the
    /// surface is not left within 100 mm both ways.
    pub fn thickness_mm(&self, point: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        self.extent(point, direction, true)
    }

    /// Width of the hollow at a point outside the solid, along a direction both ways, mm.
    pub fn hollow_mm(&self, point: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        self.extent(point, direction, false)
    }

    fn extent(&self, point: &Vector3<f64>, direction: &Vector3<f64>, inside: bool) -> Option<f64> {
        let one =
            |d: &Vector3<f64>| self.hits(point, d, 100.0).first().filter(|h| h.1 == inside).map(|h| h.0);
        Some(one(direction)? + one(&-direction)?)
    }
}

/// Distance to a triangle along a unit ray and whether the ray leaves through it. Edges count on both sides: a ray through
/// one may be reported twice at one place.
fn ray_hits(from: &Vector3<f64>, d: &Vector3<f64>, corners: &[Vector3<f64>; 3]) -> Option<(f64, bool)> {
    const SLACK: f64 = 1e-9;
    let met = Met::new(from, d, corners)?;
    (met.det.abs() >= 1e-14 && met.is_within(SLACK)).then_some((met.way, met.det < 0.0))
}

/// Where a line meets the plane of a triangle (Möller and Trumbore 1997).
pub(super) struct Met {
    /// Coordinates along the edges from the first corner.
    u: f64,
    v: f64,
    /// Way from the line's point, in lengths of its direction.
    pub way: f64,
    /// Negative where the line leaves through the triangle.
    det: f64,
}

impl Met {
    /// None: the line is parallel to the plane.
    pub(super) fn new(from: &Vector3<f64>, d: &Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> Option<Self> {
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(&e2);
        let det = e1.dot(&p);
        if det == 0.0 {
            return None;
        }
        let s = from - a;
        let q = s.cross(&e1);
        Some(Self { u: s.dot(&p) / det, v: d.dot(&q) / det, way: e2.dot(&q) / det, det })
    }

    /// Whether that is in the triangle, or beside it by so little (in parts of its edges).
    pub(super) fn is_within(&self, slack: f64) -> bool {
        self.u >= -slack && self.v >= -slack && self.u + self.v <= 1.0 + slack
    }
}
