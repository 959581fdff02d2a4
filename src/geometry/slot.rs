//! The one convex primitive of printed links: a disc swept along a segment, edges rounded.
//!
//! A [`Slot`] is the Minkowski sum of a segment, a flat disc (cylinder) about an axis and a ball.
//! With a disc of no size it is a capsule, with a segment of no length a sphere or a round-edged
//! cylinder: stubs, bars, bosses, eyes and risers are all slots (physics.md "Geometry": a link is a
//! union of capsules; the disc gives it flat faces inside its layer).

use super::mesh::Mesh;
use crate::math::Pose;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// How finely round shapes are cut into facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facets {
    /// Facets of a full circle; a multiple of 4.
    pub around: usize,
    /// Rows of a rounded edge (a quarter circle) of up to 0.8 mm.
    pub edge: usize,
    /// Longest piece lengthwise, mm: long slender triangles make the boolean kernel slow.
    pub piece_mm: f64,
}

impl Default for Facets {
    /// 64 facets: a circle's area is 0.16 % small, its sagitta at 4.2 mm is 5 µm.
    fn default() -> Self {
        Self { around: 64, edge: 6, piece_mm: 6.0 }
    }
}

/// Radius of a rounded edge that has [`Facets::edge`] rows, mm; a larger one has more. With as many a bar that is round all over lost
/// 1.1 % of its section.
const EDGE_MM: f64 = 0.8;
/// Sine of the angle up to which axes are the same.
const SAME_AXIS: f64 = 1e-9;
/// A round end lies this far inside of what hides it: facets of that reach less far than the true shape.
const HIDDEN_MM: f64 = 0.02;
/// Facets of a round end that nobody sees.
const HIDDEN_FACETS: usize = 4;

/// Minkowski sum of the segment from `start` to `end`, a disc of `disc_radius_mm` and
/// ± `half_height_mm` about `axis`, and a ball of `round_mm`. All in mm, in the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// First centre.
    pub start: Vector3<f64>,
    /// Second centre; with a disc of some size, `end - start` must be normal to `axis`.
    pub end: Vector3<f64>,
    /// Unit axis of the disc.
    pub axis: Vector3<f64>,
    /// Radius of the disc without the ball.
    pub disc_radius_mm: f64,
    /// Half the height of the disc without the ball.
    pub half_height_mm: f64,
    /// Radius of the ball: of the rounded edges.
    pub round_mm: f64,
}

impl Slot {
    /// A capsule.
    pub fn capsule(start: Vector3<f64>, end: Vector3<f64>, radius_mm: f64) -> Self {
        let d = end - start;
        let axis = any_normal(&d);
        Self { start, end, axis, disc_radius_mm: 0.0, half_height_mm: 0.0, round_mm: radius_mm }
    }

    /// A flat bar of outer radius and outer half height, its edges rounded by at most `round_mm`.
    pub fn bar(
        start: Vector3<f64>,
        end: Vector3<f64>,
        axis: Vector3<f64>,
        radius_mm: f64,
        half_height_mm: f64,
        round_mm: f64,
    ) -> Self {
        let round = round_mm.min(radius_mm).min(half_height_mm).max(0.0);
        Self {
            start,
            end,
            axis,
            disc_radius_mm: (radius_mm - round).max(0.0),
            half_height_mm: (half_height_mm - round).max(0.0),
            round_mm: round,
        }
    }

    /// Outer radius normal to the axis, mm.
    pub fn radius_mm(&self) -> f64 {
        self.disc_radius_mm + self.round_mm
    }

    /// Farthest core point (without the ball) in a direction: the support function's argument.
    pub fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let along = direction.dot(&(self.end - self.start));
        let end = if along > 0.0 { self.end } else { self.start };
        let up = direction.dot(&self.axis);
        let flat = direction - self.axis * up;
        let norm = flat.norm();
        let radial = if norm > 1e-12 * direction.norm() {
            flat * (self.disc_radius_mm / norm)
        } else {
            Vector3::zeros()
        };
        end + radial + self.axis * self.half_height_mm.copysign(up)
    }

    /// Centre and radius of a sphere around the whole, mm.
    pub fn bounding_sphere(&self) -> (Vector3<f64>, f64) {
        let half = (self.end - self.start).norm() / 2.0;
        let core = (half + self.disc_radius_mm).hypot(self.half_height_mm);
        ((self.start + self.end) / 2.0, core + self.round_mm)
    }

    /// Signed distance of a point, mm, negative inside; exact outside, and inside where no edge is near.
    pub fn signed_distance(&self, p: &Vector3<f64>) -> f64 {
        let d = self.end - self.start;
        let n = d.norm_squared();
        let u = if n > 0.0 { ((p - self.start).dot(&d) / n).clamp(0.0, 1.0) } else { 0.0 };
        let off = p - self.start - d * u;
        let up = off.dot(&self.axis);
        let x = (off - self.axis * up).norm() - self.disc_radius_mm;
        let y = up.abs() - self.half_height_mm;
        (x.max(0.0).powi(2) + y.max(0.0).powi(2)).sqrt() + x.max(y).min(0.0) - self.round_mm
    }

    /// Half the size of the bounding box of a slot without length, mm.
    pub(super) fn extent(&self) -> Vector3<f64> {
        self.axis.map(|n| {
            self.disc_radius_mm * (1.0 - n * n).max(0.0).sqrt()
                + self.half_height_mm * n.abs()
                + self.round_mm
        })
    }

    /// The slot moved with its body.
    pub fn moved(&self, pose: &Pose) -> Self {
        Self {
            start: pose.point(&self.start),
            end: pose.point(&self.end),
            axis: pose.direction(&self.axis),
            ..*self
        }
    }

    /// Volume in closed form (Steiner's formula over the stadium), mm³.
    pub fn volume_mm3(&self) -> f64 {
        let (l, r, h, t) =
            ((self.end - self.start).norm(), self.disc_radius_mm, self.half_height_mm, self.round_mm);
        // Area and perimeter of the flat stadium, then rounded by the ball: faces, walls, edges, ends.
        let (area, perimeter) = (PI * r * r + 2.0 * r * l, TAU * r + 2.0 * l);
        let walls = 2.0 * h * (area + perimeter * t + PI * t * t);
        let edges = 2.0 * area * t + perimeter * PI * t * t / 2.0 + 4.0 / 3.0 * PI * t.powi(3);
        walls + edges
    }

    /// Whether an upright slot without length, `self`, holds the round end of another one that is upright too.
    pub(super) fn holds_end(&self, other: &Slot, end: &Vector3<f64>) -> bool {
        let off = end - self.start;
        let up = off.dot(&self.axis);
        let aside = (off - self.axis * up).norm();
        let (height, heights) = (other.half_height_mm + other.round_mm, self.half_height_mm + self.round_mm);
        self.start == self.end
            && self.axis.cross(&other.axis).norm() < SAME_AXIS
            // What is rounded less reaches farther into its corners.
            && self.round_mm <= other.round_mm
            && aside + other.radius_mm() + HIDDEN_MM < self.radius_mm()
            && up.abs() + height + HIDDEN_MM < heights
    }

    /// Closed mesh, vertices on the true surface. `phase` turns the facets of a slot without length
    /// (as a fraction of one facet), so that discs on one axis share no vertex.
    pub fn mesh(&self, facets: &Facets, phase: f64) -> Mesh {
        self.mesh_with_hidden_ends(facets, phase, [false; 2])
    }

    /// The same with few facets round those ends that something else holds in itself.
    pub(super) fn mesh_with_hidden_ends(&self, facets: &Facets, phase: f64, hidden: [bool; 2]) -> Mesh {
        let length = (self.end - self.start).norm();
        let forward = if length > 1e-9 { (self.end - self.start) / length } else { any_normal(&self.axis) };
        // A capsule may lie along any direction; its facets need an axis normal to it.
        let axis = if forward.dot(&self.axis).abs() < 1e-9 { self.axis } else { any_normal(&forward) };
        let side = axis.cross(&forward);
        let half = (facets.around / 4).max(2) * 2;
        let pieces = if length > 1e-9 { ((length / facets.piece_mm).ceil() as usize).max(1) } else { 0 };

        // Outline: (index of the anchor on the segment, angle of the outward direction).
        let turn = if pieces == 0 { phase * TAU / (2 * half) as f64 } else { 0.0 };
        let arc = |anchor: usize, from: f64, end: usize| {
            let half = if hidden[end] { HIDDEN_FACETS.min(half) } else { half };
            (0..=half).map(move |k| (anchor, from + PI * k as f64 / half as f64))
        };
        let mut outline: Vec<(usize, f64)> = arc(pieces, -FRAC_PI_2, 1).collect();
        outline.extend((1..pieces).rev().map(|i| (i, FRAC_PI_2)));
        outline.extend(arc(0, FRAC_PI_2, 0));
        outline.extend((1..pieces).map(|i| (i, -FRAC_PI_2)));
        if pieces == 0 {
            outline = (0..2 * half).map(|k| (0, turn + PI * k as f64 / half as f64)).collect();
        }
        let anchors: Vec<Vector3<f64>> = (0..=pieces)
            .map(|i| {
                self.start + forward * (if pieces > 0 { length * i as f64 / pieces as f64 } else { 0.0 })
            })
            .collect();

        let rows = self.profile(facets);
        let mut mesh = Mesh::default();
        let n = outline.len();
        for &(radial, z) in &rows {
            for &(anchor, angle) in &outline {
                let out = forward * angle.cos() + side * angle.sin();
                mesh.vertices.push(anchors[anchor] + out * radial + axis * z);
            }
        }
        for row in 1..rows.len() {
            for j in 0..n {
                let k = (j + 1) % n;
                let (a, b) = ((row - 1) * n + j, (row - 1) * n + k);
                let (c, d) = (row * n + j, row * n + k);
                mesh.triangles.push([a, d, b]);
                mesh.triangles.push([a, c, d]);
            }
        }
        // Flat faces: every outline point joins the anchor it belongs to.
        let top = mesh.vertices.len();
        let height = self.half_height_mm + self.round_mm;
        mesh.vertices.extend(anchors.iter().map(|p| p + axis * height));
        let bottom = mesh.vertices.len();
        mesh.vertices.extend(anchors.iter().map(|p| p - axis * height));
        let last = (rows.len() - 1) * n;
        for j in 0..n {
            let k = (j + 1) % n;
            let (p, q) = (outline[j].0, outline[k].0);
            mesh.triangles.push([j, k, top + p]);
            mesh.triangles.push([last + k, last + j, bottom + p]);
            if p != q {
                mesh.triangles.push([k, top + q, top + p]);
                mesh.triangles.push([last + k, bottom + p, bottom + q]);
            }
        }
        mesh
    }

    /// Rows (radius, height) from the top to the bottom, without the two poles.
    fn profile(&self, facets: &Facets) -> Vec<(f64, f64)> {
        let (r, h, t) = (self.disc_radius_mm, self.half_height_mm, self.round_mm);
        // As many as keep the same distance from a larger round.
        let edge = (facets.edge.max(1) as f64 * (t / EDGE_MM).sqrt().max(1.0)).ceil() as usize;
        let mut upper: Vec<(f64, f64)> = Vec::new();
        if t > 0.0 {
            // Without a flat face the first row is the pole itself: leave it to the anchors.
            let first = if r > 0.0 { 0 } else { 1 };
            for k in first..=edge {
                let (s, c) = (FRAC_PI_2 * k as f64 / edge as f64).sin_cos();
                upper.push((r + t * s, h + t * c));
            }
        } else {
            upper.push((r, h));
        }
        let mut rows = upper.clone();
        let steps = ((2.0 * h / facets.piece_mm).ceil() as usize).max(1);
        rows.extend((1..steps).map(|k| (r + t, h - 2.0 * h * k as f64 / steps as f64)));
        let skip = usize::from(h <= 0.0);
        rows.extend(upper.iter().rev().skip(skip).map(|(radial, z)| (*radial, -z)));
        rows
    }
}

/// A unit vector normal to `v`: the same one for the same input, any for the zero vector.
pub(crate) fn any_normal(v: &Vector3<f64>) -> Vector3<f64> {
    let least = if v.z.abs() <= v.x.abs() && v.z.abs() <= v.y.abs() {
        Vector3::z()
    } else if v.x.abs() <= v.y.abs() {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let n = least - v * (least.dot(v) / v.norm_squared().max(f64::MIN_POSITIVE));
    n.try_normalize(0.0).unwrap_or_else(Vector3::x)
}
