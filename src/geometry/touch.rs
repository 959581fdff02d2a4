//! Which solids touch: those that do not need no boolean kernel to be one mesh.

use super::check::{self, Tree};
use super::exact::{Point, on_lattice, triangles_meet};
use super::mesh::Mesh;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Corners of two triangles that have none in common.
const APART: [[usize; 3]; 2] = [[0, 1, 2], [3, 4, 5]];

/// Least and largest corner, in lattice steps.
type Bounds = (Vector3<f64>, Vector3<f64>);

/// A closed mesh prepared to be asked what it touches.
pub(super) struct Solid<'m> {
    pub(super) mesh: &'m Mesh,
    corners: Vec<[Point; 3]>,
    boxes: Vec<Bounds>,
    tree: Tree,
    bounds: Bounds,
}

impl<'m> Solid<'m> {
    pub(super) fn new(mesh: &'m Mesh) -> Self {
        let corners: Vec<[Point; 3]> =
            (0..mesh.triangles.len()).map(|t| mesh.corners(t).map(|p| on_lattice(&p))).collect();
        let boxes: Vec<Bounds> = corners.iter().map(check::bounds).collect();
        let far = Vector3::repeat(f64::INFINITY);
        let bounds = boxes.iter().fold((far, -far), |(lo, hi), b| (lo.inf(&b.0), hi.sup(&b.1)));
        let mut ids: Vec<usize> = (0..boxes.len()).collect();
        let tree = Tree::build(&mut ids, &boxes);
        Self { mesh, corners, boxes, tree, bounds }
    }

    /// Whether one of the given triangles of another mesh meets the surface.
    pub(super) fn crosses(&self, other: &Solid<'_>, triangles: impl Iterator<Item = usize>) -> bool {
        let mut near = Vec::new();
        for t in triangles.filter(|t| overlap(&other.boxes[*t], &self.bounds)) {
            near.clear();
            self.tree.query(&other.boxes[t], &mut near, &self.boxes);
            if near.iter().any(|u| triangles_meet(&APART[0], &self.corners[*u], &APART[1], &other.corners[t]))
            {
                return true;
            }
        }
        false
    }

    /// Whether two solids have a point in common: their surfaces cross, or one lies in the other.
    pub(super) fn touches(&self, other: &Solid<'_>) -> bool {
        if !overlap(&self.bounds, &other.bounds) {
            return false;
        }
        let (few, many) =
            if self.corners.len() <= other.corners.len() { (self, other) } else { (other, self) };
        many.crosses(few, 0..few.corners.len())
            || [(self, other), (other, self)]
                .iter()
                .any(|(outer, inner)| inner.mesh.vertices.first().is_some_and(|p| outer.holds(p)))
    }

    /// Whether a point that is not on the surface lies inside: by the solid angle under which the surface is seen (van
    /// Oosterom and Strackee 1983). No ray: primitives are symmetric, and one through an edge would decide it by rounding.
    pub(super) fn holds(&self, p: &Vector3<f64>) -> bool {
        let at = Vector3::from(on_lattice(p).map(|x| x as f64));
        if !overlap(&(at, at), &self.bounds) {
            return false;
        }
        let angle: f64 = (0..self.mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = self.mesh.corners(t).map(|q| q - p);
                let [x, y, z] = [a.norm(), b.norm(), c.norm()];
                let over = x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y;
                2.0 * a.dot(&b.cross(&c)).atan2(over)
            })
            .sum();
        angle > TAU
    }
}

fn overlap(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|k| a.0[k] <= b.1[k] && b.0[k] <= a.1[k])
}

/// Of each mesh the others that it touches, ascending.
pub(super) fn neighbours(meshes: &[Mesh]) -> Vec<Vec<usize>> {
    let solids: Vec<Solid<'_>> = meshes.par_iter().map(Solid::new).collect();
    let later: Vec<Vec<usize>> = (0..solids.len())
        .into_par_iter()
        .map(|i| (i + 1..solids.len()).filter(|j| solids[i].touches(&solids[*j])).collect())
        .collect();
    let mut all = vec![Vec::new(); meshes.len()];
    for (i, touched) in later.iter().enumerate() {
        for j in touched {
            all[i].push(*j);
            all[*j].push(i);
        }
    }
    all.iter_mut().for_each(|n| n.sort_unstable());
    all
}

/// Meshes that touch each other directly or through others, by their indices; ordered by their first ones.
pub(super) fn clusters(neighbours: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; neighbours.len()];
    let mut out = Vec::new();
    for first in 0..neighbours.len() {
        let (mut cluster, mut open) = (Vec::new(), vec![first]);
        while let Some(i) = open.pop() {
            if !std::mem::replace(&mut seen[i], true) {
                cluster.push(i);
                open.extend(&neighbours[i]);
            }
        }
        if !cluster.is_empty() {
            cluster.sort_unstable();
            out.push(cluster);
        }
    }
    out
}

/// Layers of some meshes, by their indices: within a layer none touches another, so that it is one mesh as it stands.
pub(super) fn layers(members: &[usize], neighbours: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut layers: Vec<Vec<usize>> = Vec::new();
    for i in members {
        let free = |layer: &&mut Vec<usize>| !layer.iter().any(|j| neighbours[*i].contains(j));
        match layers.iter_mut().find(free) {
            Some(layer) => layer.push(*i),
            None => layers.push(vec![*i]),
        }
    }
    layers
}
