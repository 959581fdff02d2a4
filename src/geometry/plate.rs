//! Bodies that are plates: everything they carry in their layer in one rounded convex outline, on the layer's lower face.
//! The solid is one prism; what measures distances sees it as bars side by side that cover it.

use super::fitted::{FitFault, FitFaultKind, PlateSolid};
use super::link::{BOSS_EXTRA_MM, BodyPlan, Builder, Role};
use super::mesh::Mesh;
use super::slot::{Facets, Slot, any_normal};
use crate::ir::Placement;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Distance of the bars that cover a plate as a part of their half width: what lies between two is covered by both.
const BESIDE: f64 = 1.5;
/// Points of an outline nearer than this are one, mm.
const SAME_MM: f64 = 1e-6;

/// A plate: the convex hull of discs of one radius.
#[derive(Clone, Debug, PartialEq)]
pub struct Prism {
    /// Centres of the discs at the corners of the hull, counter-clockwise about the axis, in the middle of its height.
    pub corners: Vec<Vector3<f64>>,
    /// Unit axis.
    pub axis: Vector3<f64>,
    /// Radius of the discs, mm.
    pub radius_mm: f64,
    /// Half the thickness, mm.
    pub half_mm: f64,
}

impl Prism {
    /// Closed mesh, vertices on the true outline.
    pub fn mesh(&self, facets: &Facets) -> Mesh {
        let n = (facets.around / 4).max(2) * 4;
        let first = any_normal(&self.axis);
        let second = self.axis.cross(&first);
        // Half a facet off what stands on the plate.
        let out = |k: usize| {
            let (sin, cos) = (TAU * (k as f64 + 0.37) / n as f64).sin_cos();
            (first * cos + second * sin) * self.radius_mm
        };
        let discs = self.corners.iter().flat_map(|c| (0..n).map(move |k| c + out(k)));
        let outline = hull(&discs.collect::<Vec<_>>(), &self.axis);
        let count = outline.len();
        let middle = outline.iter().sum::<Vector3<f64>>() / count.max(1) as f64;
        let up = self.axis * self.half_mm;
        let mut mesh = Mesh::default();
        mesh.vertices.extend(outline.iter().map(|p| p + up));
        mesh.vertices.extend(outline.iter().map(|p| p - up));
        mesh.vertices.extend([middle + up, middle - up]);
        for i in 0..count {
            let j = (i + 1) % count;
            mesh.triangles.extend([[i, j, 2 * count], [count + j, count + i, 2 * count + 1]]);
            mesh.triangles.extend([[i, count + i, count + j], [i, count + j, j]]);
        }
        mesh
    }

    /// Bars that cover it.
    fn bars(&self) -> Vec<Slot> {
        let bar =
            |a: Vector3<f64>, b: Vector3<f64>| Slot::bar(a, b, self.axis, self.radius_mm, self.half_mm, 0.0);
        let n = self.corners.len();
        if n < 3 {
            let (a, b) = (self.corners.first(), self.corners.last());
            return a.zip(b).map(|(a, b)| bar(*a, *b)).into_iter().collect();
        }
        let edge = |i: usize| (self.corners[i], self.corners[(i + 1) % n]);
        let mut bars: Vec<Slot> = (0..n).map(|i| bar(edge(i).0, edge(i).1)).collect();
        let longest = (0..n).map(edge).max_by(|p, q| (p.1 - p.0).norm().total_cmp(&(q.1 - q.0).norm()));
        let Some(along) = longest.and_then(|(a, b)| (b - a).try_normalize(SAME_MM)) else { return bars };
        let across = self.axis.cross(&along);
        let offs: Vec<f64> = self.corners.iter().map(|c| c.dot(&across)).collect();
        let low = offs.iter().fold(f64::INFINITY, |a, b| a.min(*b));
        let high = offs.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let count = ((high - low) / (BESIDE * self.radius_mm)).ceil().max(1.0) as usize;
        for k in 1..count {
            let level = low + (high - low) * k as f64 / count as f64;
            let cut = |i: usize| {
                let (a, b) = edge(i);
                let (p, q) = (a.dot(&across) - level, b.dot(&across) - level);
                (p * q < 0.0).then(|| a.lerp(&b, p / (p - q)))
            };
            let ends: Vec<Vector3<f64>> = (0..n).filter_map(cut).collect();
            if let [a, b] = ends[..] {
                bars.push(bar(a, b));
            }
        }
        bars
    }

    /// The plate in another place.
    pub fn placed(&self, placement: &Placement) -> Prism {
        let mut corners: Vec<Vector3<f64>> = self.corners.iter().map(|c| placement.point(c)).collect();
        if placement.is_mirrored() {
            corners.reverse();
        }
        Prism { corners, axis: placement.direction(&self.axis), ..*self }
    }
}

/// Convex hull of points in a plane normal to `axis`, counter-clockwise (Andrew's monotone chain).
fn hull(points: &[Vector3<f64>], axis: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let first = any_normal(axis);
    let second = axis.cross(&first);
    let plane = |p: &Vector3<f64>| (p.dot(&first), p.dot(&second));
    let mut sorted: Vec<Vector3<f64>> = points.to_vec();
    sorted.sort_by(|p, q| {
        let ((a, b), (c, d)) = (plane(p), plane(q));
        a.total_cmp(&c).then(b.total_cmp(&d))
    });
    sorted.dedup_by(|p, q| (*p - *q).norm() < SAME_MM);
    if sorted.len() < 3 {
        return sorted;
    }
    let chain = |points: &mut dyn Iterator<Item = Vector3<f64>>| {
        let mut out: Vec<Vector3<f64>> = Vec::new();
        for p in points {
            while let [.., a, b] = out[..] {
                // A corner that turns by less than this is none: its triangle would be a sliver.
                let turn = (b - a).cross(&(p - b)).dot(axis);
                if turn > SAME_MM * (p - a).norm() {
                    break;
                }
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    let mut outline = chain(&mut sorted.iter().copied());
    outline.extend(chain(&mut sorted.iter().rev().copied()));
    outline
}

impl BodyPlan {
    /// The plate to which a slot belongs, at the first of its slots.
    pub(super) fn prism(&self, slot: usize) -> Option<&Prism> {
        let (role @ Role::Plate(k), _) = self.slots.get(slot)? else { return None };
        let first = self.slots.iter().position(|(r, _)| r == role);
        (first == Some(slot)).then(|| self.plates.get(*k)).flatten()
    }
}

impl Builder<'_> {
    /// Adds a plate round all nodes, with the bosses that stand on it; false where it cannot carry all of them by itself.
    pub(super) fn add_plate(&mut self, plate: &PlateSolid, layered: bool) -> bool {
        if !layered {
            let (motor, at) = (String::new(), self.nodes.first().map_or_else(Vector3::zeros, |n| n.at));
            self.plan.faults.push(FitFault { motor, kind: FitFaultKind::NoLayer, at, origin: plate.origin });
            return false;
        }
        let axis = self.axis();
        let room = 2.0 * self.half();
        let thick = plate.thick_mm.min(room);
        let middle = axis * (thick / 2.0 - self.half());
        let nodes: Vec<Vector3<f64>> = self.nodes.iter().map(|n| n.at + middle).collect();
        let prism = Prism {
            corners: hull(&nodes, &axis),
            axis,
            radius_mm: plate.margin_mm.unwrap_or(self.boss_radius() + BOSS_EXTRA_MM),
            half_mm: thick / 2.0,
        };
        let role = Role::Plate(self.plan.plates.len());
        for slot in prism.bars() {
            self.push(role, slot);
        }
        self.plan.plates.push(prism);
        // An eye that shares its layer stands on other eyes, not on the plate.
        self.nodes.iter().all(|n| n.own_eye.is_none())
    }
}
