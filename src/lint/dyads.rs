//! Planar mechanisms taken apart: pairs of links whose outer joints are carried by what moves already (Assur groups of
//! the second class). What a pair does, its two lengths and one distance decide: it opens where these make no triangle.

use super::views::OfMotion;
use crate::ir::JointId;
use crate::kinematics::motion::State;
use nalgebra::Vector3;

/// Two links joined by a hinge, each hinged to something whose motion does not depend on them.
pub struct Dyad {
    /// The two links.
    pub bodies: [usize; 2],
    /// The hinge between them.
    pub inner: JointId,
    /// The hinge of each to the rest.
    pub outer: [JointId; 2],
}

impl Dyad {
    /// Where its joints are, mm: the outer one of the first link, the inner one, the outer one of the second.
    pub fn at(&self, view: &OfMotion, state: &State) -> Option<[Vector3<f64>; 3]> {
        let joint = |body: usize, joint: JointId| {
            Some(state.poses.get(body)?.point(view.motion.joint_points.get(joint)?))
        };
        let [u, v] = self.bodies;
        let flat = |p: Vector3<f64>| {
            let axis = Vector3::from(view.of.design.layers.axis);
            p - axis * p.dot(&axis)
        };
        let [a, c] = self.outer;
        Some([flat(joint(u, a)?), flat(joint(u, self.inner)?), flat(joint(v, c)?)])
    }
}

/// The pairs of a mechanism that is planar, driven by hinges, and falls apart into such pairs; else those found.
pub fn dyads(view: &OfMotion) -> Vec<Dyad> {
    let design = view.of.design;
    if !view.of.is_planar() {
        return Vec::new();
    }
    let mut known: Vec<bool> = design.bodies.iter().map(|b| b.ground).collect();
    let is_known = |known: &[bool], b: usize| known.get(b).copied().unwrap_or(true);
    let driven: Vec<JointId> = design.drives.iter().filter_map(|d| d.joint()).collect();
    let moved = |b: usize| design.bodies.get(b).is_some_and(|b| b.owner.is_none());
    let mut found = Vec::new();
    loop {
        // What a drive moves from what is known.
        let mut grown = false;
        for joint in driven.iter().filter_map(|j| design.joints.get(*j)) {
            let (Some(a), Some(b)) = (joint.bodies.first(), joint.bodies.get(1)) else { continue };
            if is_known(&known, *a) != is_known(&known, *b) {
                for body in [*a, *b] {
                    if let Some(k) = known.get_mut(body) {
                        *k = true;
                    }
                }
                grown = true;
            }
        }
        if !grown {
            let Some(dyad) = next(view, &known, &driven, &moved) else { return found };
            for body in dyad.bodies {
                if let Some(k) = known.get_mut(body) {
                    *k = true;
                }
            }
            found.push(dyad);
        }
    }
}

fn next(view: &OfMotion, known: &[bool], driven: &[JointId], moved: &impl Fn(usize) -> bool) -> Option<Dyad> {
    let design = view.of.design;
    let free = |b: usize| !known.get(b).copied().unwrap_or(true) && moved(b);
    // A hinge of a body, other than one, to something known.
    let outer = |body: usize, not: JointId| {
        design.joints.iter().enumerate().position(|(j, joint)| {
            let carried = joint.bodies.iter().any(|b| known.get(*b).copied().unwrap_or(false));
            j != not && !driven.contains(&j) && joint.bodies.contains(&body) && carried
        })
    };
    for (j, joint) in design.joints.iter().enumerate().filter(|(j, _)| !driven.contains(j)) {
        for (i, u) in joint.bodies.iter().enumerate() {
            for v in joint.bodies.iter().skip(i + 1) {
                if !(free(*u) && free(*v)) {
                    continue;
                }
                if let (Some(a), Some(c)) = (outer(*u, j), outer(*v, j))
                    && a != c
                {
                    return Some(Dyad { bodies: [*u, *v], inner: j, outer: [a, c] });
                }
            }
        }
    }
    None
}
