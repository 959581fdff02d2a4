//! What grows together or comes too near in the rest pose, where it would be printed as one.

use super::carve::Carving;
use super::distance::separation;
use super::link::{BodyPlan, Role};
use super::parts::PartsInput;
use super::slot::Slot;
use super::solid::{Beside, Surface, surfaces};
use crate::math::Pose;
use nalgebra::Vector3;

/// Next to its ends a flexure cannot keep the clearance from its own link, mm…
pub(super) const NEAR_MM: f64 = 4.0;
/// … but farther than this from its attachment planes it must not be swallowed by it, mm.
pub(super) const ROOT_MM: f64 = 0.6;

/// One side of an overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Member {
    /// Index of a body.
    Body(usize),
    /// Index of a flexure.
    Flexure(usize),
}

/// Two things that overlap in the rest pose or keep less than the clearance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fusion {
    /// First.
    pub a: Member,
    /// Second.
    pub b: Member,
    /// They are printed in one piece: what touches is fused.
    pub same_part: bool,
    /// Depth of the overlap, mm; negative: the gap that is less than the process's clearance.
    pub depth_mm: f64,
    /// Where.
    pub at: Vector3<f64>,
}

/// The worst overlap of each pair in the rest pose. Flexures of one joint are not compared with each
/// other: their sub-layers keep them apart by the design's own gap.
/// A link that was carved for a flexure keeps clear of it by construction.
pub fn fusions(
    input: &PartsInput,
    plans: &[BodyPlan],
    groups: &[Vec<usize>],
    carving: &Carving,
) -> Vec<Fusion> {
    let group_of = |body: usize| groups.iter().position(|g| g.contains(&body));
    let mut found = Vec::new();
    let solids: Vec<Vec<Surface>> = plans.iter().map(surfaces).collect();
    let rest = Pose::rest(Vector3::zeros());
    let of_solids = |i: usize| solids.get(i).map_or(&[][..], Vec::as_slice);
    // The worse one of what primitives and what solids find.
    let worst_of = |i: usize, j: Option<usize>, a: &[Slot], b: &[Slot], bound_mm: f64| {
        let found = worst(a, b, bound_mm);
        let others = j.map_or(&[][..], of_solids);
        if of_solids(i).is_empty() && others.is_empty() {
            return found;
        }
        let one = Beside { solids: of_solids(i), pose: &rest, slots: a };
        let other = Beside { solids: others, pose: &rest, slots: b };
        one.gap(&other, found.map_or(bound(bound_mm), |f| f.0)).or(found)
    };
    for (i, plan_i) in plans.iter().enumerate() {
        for (j, plan_j) in plans.iter().enumerate().skip(i + 1) {
            let slots = |p: &BodyPlan| p.slots.iter().map(|(_, s)| *s).collect::<Vec<_>>();
            if let Some(s) = worst_of(i, Some(j), &slots(plan_i), &slots(plan_j), input.clearance_mm) {
                let same_part = group_of(i) == group_of(j);
                found.push(Fusion {
                    a: Member::Body(i),
                    b: Member::Body(j),
                    same_part,
                    depth_mm: -s.0,
                    at: s.1,
                });
            }
        }
    }
    for (f, flexure) in input.flexures.iter().enumerate() {
        let whole = flexure.slots();
        let (first, last) = (flexure.end_point(false), flexure.end_point(true));
        let beyond = |depth: f64| -> Vec<Slot> {
            let away = |p: &Vector3<f64>| (p - first).norm().min((p - last).norm()) > depth;
            whole.iter().filter(|s| away(&s.start) && away(&s.end)).copied().collect()
        };
        let (free, inner) = (beyond(ROOT_MM), beyond(NEAR_MM));
        for (i, plan) in plans.iter().enumerate().filter(|(i, _)| !carving.made(*i, f)) {
            let attached = i == flexure.bodies.0 || i == flexure.bodies.1;
            let own_stub = |role: &Role| attached && *role == Role::Stub(f);
            let slots: Vec<Slot> = plan.slots.iter().filter(|(r, _)| !own_stub(r)).map(|(_, s)| *s).collect();
            let found_here = if attached {
                worst_of(i, None, &slots, &free, 0.0)
                    .or_else(|| worst_of(i, None, &slots, &inner, input.clearance_mm))
            } else {
                worst_of(i, None, &slots, &whole, input.clearance_mm)
            };
            if let Some(s) = found_here {
                let same_part = group_of(i) == group_of(flexure.bodies.0);
                found.push(Fusion {
                    a: Member::Body(i),
                    b: Member::Flexure(f),
                    same_part,
                    depth_mm: -s.0,
                    at: s.1,
                });
            }
        }
        for (g, other) in
            input.flexures.iter().enumerate().skip(f + 1).filter(|(_, o)| o.joint != flexure.joint)
        {
            if let Some(s) = worst(&whole, &other.slots(), input.clearance_mm) {
                let same_part = group_of(flexure.bodies.0) == group_of(other.bodies.0);
                found.push(Fusion {
                    a: Member::Flexure(f),
                    b: Member::Flexure(g),
                    same_part,
                    depth_mm: -s.0,
                    at: s.1,
                });
            }
        }
    }
    found
}

/// Rounding of two faces that are exactly the clearance apart is no finding.
fn bound(bound_mm: f64) -> f64 {
    bound_mm * (1.0 - 1e-6) - 1e-6
}

/// Least gap below a bound, and its place; `None` if all stay farther apart.
pub(super) fn worst(a: &[Slot], b: &[Slot], bound_mm: f64) -> Option<(f64, Vector3<f64>)> {
    let mut best = (bound(bound_mm), None);
    for p in a {
        let (cp, rp) = p.bounding_sphere();
        for q in b {
            let (cq, rq) = q.bounding_sphere();
            if (cp - cq).norm() - rp - rq < best.0 {
                let s = separation(p, q);
                if s.gap_mm < best.0 {
                    best = (s.gap_mm, Some(s.at));
                }
            }
        }
    }
    best.1.map(|at| (best.0, at))
}
