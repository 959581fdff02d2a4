//! Gaps over a cycle: bodies and bent flexures in every state, bodies against bodies, flexures against bodies
//! (their own links too, beyond the roots) and against flexures of other joints.

use super::carve::{CarvedLink, Carving};
use super::distance::separation;
use super::gap::{Member, NEAR_MM, ROOT_MM};
use super::link::{BodyPlan, Role};
use super::parts::FlexureSolid;
use super::slot::Slot;
use super::solid::{Beside, Surface, surfaces};
use crate::math::Pose;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A carved link is looked at within this distance of a flexure, mm: beyond, it is nothing's nearest neighbour.
const CARVED_MM: f64 = 5.0;

/// One state of the cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct MovedState {
    /// Pose of every body relative to rest.
    pub poses: Vec<Pose>,
    /// The flexures as bent in this state; empty: only bodies are compared.
    pub flexures: Vec<FlexureSolid>,
}

/// The least gap of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastGap {
    /// Index of the state.
    pub state: usize,
    /// First.
    pub a: Member,
    /// Second.
    pub b: Member,
    /// Gap, mm; negative when they overlap.
    pub gap_mm: f64,
    /// Where, in the pose of that state.
    pub at: Vector3<f64>,
}

/// Gaps over a cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CycleGaps {
    /// The nearest pair of each state; none where there is nothing to compare.
    pub least: Vec<Option<LeastGap>>,
    /// Every pair that overlaps somewhere, at its worst state.
    pub overlaps: Vec<LeastGap>,
}

/// Measures the gaps of all pairs but the `skipped` ones (asked with the smaller member first). Left out are the
/// eyes of one conventional joint (they turn in each other's slots by construction), flexures of one joint (their
/// sub-layers keep the design's own gap), and a flexure's roots: within 4 mm of an attachment a small gap to that
/// link is no finding, only an overlap is, and none within 0.6 mm or with the stub that holds it.
pub fn cycle_gaps(
    plans: &[BodyPlan],
    states: &[MovedState],
    skipped: impl Fn(Member, Member) -> bool + Sync,
) -> CycleGaps {
    carved_cycle_gaps(plans, states, &Carving::default(), 0.0, skipped)
}

/// The same where links were carved: between such a link and the flexure it made way for the gap is measured on the
/// carved solid, from where on its own stub is farther than the clearance.
pub fn carved_cycle_gaps(
    plans: &[BodyPlan],
    states: &[MovedState],
    carving: &Carving,
    clearance_mm: f64,
    skipped: impl Fn(Member, Member) -> bool + Sync,
) -> CycleGaps {
    let links: BTreeMap<usize, CarvedLink<'_>> =
        carving.links.iter().map(|(body, mesh)| (*body, CarvedLink::new(mesh))).collect();
    let solids = plans.iter().map(surfaces).collect();
    let carved = Carved { carving, links, clearance_mm, solids };
    let measured: Vec<(Option<LeastGap>, Vec<LeastGap>)> = states
        .par_iter()
        .enumerate()
        .map(|(s, moved)| state_gaps(plans, s, moved, &carved, &skipped))
        .collect();
    let mut gaps = CycleGaps::default();
    for (least, overlaps) in measured {
        gaps.least.push(least);
        for found in overlaps {
            match gaps.overlaps.iter_mut().find(|o| (o.a, o.b) == (found.a, found.b)) {
                Some(known) if found.gap_mm < known.gap_mm => *known = found,
                Some(_) => {}
                None => gaps.overlaps.push(found),
            }
        }
    }
    gaps.overlaps.sort_by_key(|o| (o.a, o.b));
    gaps
}

/// What was carved.
struct Carved<'a> {
    carving: &'a Carving,
    links: BTreeMap<usize, CarvedLink<'a>>,
    clearance_mm: f64,
    /// Of each body.
    solids: Vec<Vec<Surface>>,
}

impl Carved<'_> {
    fn solids(&self, body: usize) -> &[Surface] {
        self.solids.get(body).map_or(&[], Vec::as_slice)
    }
}

/// The nearest pair so far, and all that overlap.
struct Search<'s, F> {
    state: usize,
    skipped: &'s F,
    least: Option<LeastGap>,
    overlaps: Vec<LeastGap>,
}

impl<F: Fn(Member, Member) -> bool> Search<'_, F> {
    /// Compares all slots of two members. Only gaps below `bound` count, and what is farther than the nearest
    /// pair so far is not looked at.
    fn compare(
        &mut self,
        (a, first): (Member, &[Piece]),
        (b, second): (Member, &[Piece]),
        bound: f64,
        leave_out: impl Fn(&Piece, &Piece) -> bool,
    ) {
        if (self.skipped)(a, b) {
            return;
        }
        let mut bound = self.least.map_or(bound, |l| l.gap_mm.max(0.0).min(bound));
        let mut best: Option<LeastGap> = None;
        for p in first {
            for q in second {
                if (p.center - q.center).norm() - p.radius - q.radius >= bound || leave_out(p, q) {
                    continue;
                }
                let s = separation(&p.slot, &q.slot);
                if s.gap_mm < bound {
                    bound = s.gap_mm;
                    best = Some(LeastGap { state: self.state, a, b, gap_mm: s.gap_mm, at: s.at });
                }
            }
        }
        if let Some(best) = best {
            self.note(best);
        }
    }

    /// The same for the solids of two members.
    fn compare_solids(
        &mut self,
        (a, first): (Member, &Beside<'_>),
        (b, second): (Member, &Beside<'_>),
        bound: f64,
    ) {
        if (first.solids.is_empty() && second.solids.is_empty()) || (self.skipped)(a, b) {
            return;
        }
        let bound = self.least.map_or(bound, |l| l.gap_mm.max(0.0).min(bound));
        if let Some((gap_mm, at)) = first.gap(second, bound) {
            self.note(LeastGap { state: self.state, a, b, gap_mm, at });
        }
    }

    fn note(&mut self, best: LeastGap) {
        if best.gap_mm < 0.0 {
            match self.overlaps.iter_mut().find(|o| (o.a, o.b) == (best.a, best.b)) {
                Some(known) if best.gap_mm < known.gap_mm => *known = best,
                Some(_) => {}
                None => self.overlaps.push(best),
            }
        }
        if self.least.is_none_or(|l| best.gap_mm < l.gap_mm) {
            self.least = Some(best);
        }
    }
}

/// A slot where it is in a state.
struct Piece {
    role: Option<Role>,
    slot: Slot,
    center: Vector3<f64>,
    radius: f64,
}

impl Piece {
    fn new(role: Option<Role>, slot: Slot) -> Self {
        let (center, radius) = slot.bounding_sphere();
        Self { role, slot, center, radius }
    }
}

/// Eyes, or sleeve and bar, of one conventional joint: they move in each other by construction.
pub(super) fn one_joint(a: Option<Role>, b: Option<Role>) -> bool {
    matches!((a, b), (Some(Role::Eye(a)), Some(Role::Eye(b))) | (Some(Role::Guide(a)), Some(Role::Guide(b))) if a == b)
}

fn slots_of(pieces: &[Piece]) -> Vec<Slot> {
    pieces.iter().map(|p| p.slot).collect()
}

fn state_gaps(
    plans: &[BodyPlan],
    state: usize,
    moved: &MovedState,
    carved: &Carved<'_>,
    skipped: &impl Fn(Member, Member) -> bool,
) -> (Option<LeastGap>, Vec<LeastGap>) {
    if moved.poses.len() != plans.len() {
        return (None, Vec::new());
    }
    let mut search = Search { state, skipped, least: None, overlaps: Vec::new() };
    let bodies: Vec<Vec<Piece>> = plans
        .iter()
        .zip(&moved.poses)
        .map(|(plan, pose)| {
            let printed = plan.slots.iter().map(|(r, s)| Piece::new(Some(*r), s.moved(pose)));
            printed.chain(plan.carried.iter().map(|s| Piece::new(None, s.moved(pose)))).collect()
        })
        .collect();
    for (i, first) in bodies.iter().enumerate() {
        for (j, second) in bodies.iter().enumerate().skip(i + 1) {
            search.compare((Member::Body(i), first), (Member::Body(j), second), f64::INFINITY, |p, q| {
                one_joint(p.role, q.role)
            });
            if !carved.solids(i).is_empty() || !carved.solids(j).is_empty() {
                let (slots, others) = (slots_of(first), slots_of(second));
                let one = Beside { solids: carved.solids(i), pose: &moved.poses[i], slots: &slots };
                let other = Beside { solids: carved.solids(j), pose: &moved.poses[j], slots: &others };
                search.compare_solids((Member::Body(i), &one), (Member::Body(j), &other), f64::INFINITY);
            }
        }
    }
    let flexures: Vec<Vec<Piece>> =
        moved.flexures.iter().map(|f| f.slots().into_iter().map(|s| Piece::new(None, s)).collect()).collect();
    for (f, (flexure, pieces)) in moved.flexures.iter().zip(&flexures).enumerate() {
        for (i, body) in bodies.iter().enumerate() {
            let own: Vec<Vector3<f64>> = [(flexure.bodies.0, false), (flexure.bodies.1, true)]
                .into_iter()
                .filter(|(b, _)| *b == i)
                .map(|(_, at_end)| flexure.end_point(at_end))
                .collect();
            let within = |q: &Piece, depth: f64| {
                own.iter().any(|p| (q.slot.start - p).norm() <= depth || (q.slot.end - p).norm() <= depth)
            };
            let member = (Member::Body(i), body.as_slice());
            if let Some(link) = carved.links.get(&i).filter(|_| carved.carving.made(i, f)) {
                // What it carries is not carved.
                let motors = body.get(plans[i].slots.len()..).unwrap_or_default();
                search.compare(
                    (Member::Body(i), motors),
                    (Member::Flexure(f), pieces),
                    f64::INFINITY,
                    |_, _| false,
                );
                if !skipped(Member::Body(i), Member::Flexure(f)) {
                    let bound = search.least.map_or(f64::INFINITY, |l| l.gap_mm).min(CARVED_MM);
                    let pose = &moved.poses[i];
                    if let Some((gap_mm, at)) = link.gap(flexure, i, pose, carved.clearance_mm, bound) {
                        let (a, b, at) = (Member::Body(i), Member::Flexure(f), pose.point(&at));
                        search.note(LeastGap { state, a, b, gap_mm, at });
                    }
                }
                continue;
            }
            let solids = carved.solids(i);
            if !solids.is_empty() {
                let body = Beside { solids, pose: &moved.poses[i], slots: &[] };
                let mut beyond = |depth: f64, bound: f64| {
                    let away: Vec<Slot> =
                        pieces.iter().filter(|q| !within(q, depth)).map(|q| q.slot).collect();
                    let flexure = Beside { solids: &[], pose: &moved.poses[i], slots: &away };
                    search.compare_solids((Member::Body(i), &body), (Member::Flexure(f), &flexure), bound);
                };
                beyond(NEAR_MM, f64::INFINITY);
                if !own.is_empty() {
                    beyond(ROOT_MM, 0.0);
                }
            }
            search.compare(member, (Member::Flexure(f), pieces), f64::INFINITY, |_, q| within(q, NEAR_MM));
            if !own.is_empty() {
                // Nearer to the root only being swallowed counts, and not by its own stub.
                search.compare(member, (Member::Flexure(f), pieces), 0.0, |p, q| {
                    within(q, ROOT_MM) || p.role == Some(Role::Stub(f))
                });
            }
        }
        for (g, other) in moved.flexures.iter().enumerate().skip(f + 1) {
            if other.joint != flexure.joint {
                search.compare(
                    (Member::Flexure(f), pieces),
                    (Member::Flexure(g), &flexures[g]),
                    f64::INFINITY,
                    |_, _| false,
                );
            }
        }
    }
    (search.least, search.overlaps)
}
