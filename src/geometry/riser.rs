//! Ways of a link into another layer. Straight up where nothing is; beside what is in the way (a flexure at the very
//! point of a pin) by a bar within the other layer and a riser that keeps clear of flexures and bodies as they move.
//!
//! While links are planned only the conventional motion is known: a bent flexure is taken half-way between where its
//! two ends would carry it, and of other bodies their eyes, the bars between them and their stubs count. The gaps of the
//! finished solids over the cycle are measured later.

use super::anchor::{Anchor, Follow};
use super::distance::nearer_than;
use super::gap::ROOT_MM;
use super::link::{
    BAR_BELOW_MM, BOSS_BELOW_MM, Builder, ROUND_MM, Role, SAME_NODE_MM, SPREAD_MM, STUB_FREE_MM,
    STUB_RADIUS_MM, spread,
};
use super::parts::{BodySolid, Eye, FlexureSolid};
use super::slot::Slot;
use crate::math::Pose;
use nalgebra::{Rotation3, Unit, Vector3};
use std::cell::OnceCell;
use std::f64::consts::TAU;

/// Radius of a riser beside something, as a part of a bar's half width.
const SLIMMER: f64 = 0.75;
/// Directions and distances at which a place for a riser is looked for, and the step of the latter, mm.
const DIRECTIONS: usize = 48;
const DISTANCES: usize = 24;
const DISTANCE_STEP_MM: f64 = 1.5;
/// A straight way is given up only if something would really be hit, by this, mm: what it is compared with is not exact.
const OVERLAP_MM: f64 = 0.2;

/// What is farther than this beyond a bound needs no exact distance, mm: more than rounding and the stopping rule of
/// the latter.
const SURELY_MM: f64 = 1e-3;

/// Something that moves beside a body, where it is in one state.
pub(super) struct Near {
    slot: Slot,
    center: Vector3<f64>,
    radius: f64,
}

impl Near {
    fn new(slot: Slot) -> Self {
        let (center, radius) = slot.bounding_sphere();
        Self { slot, center, radius }
    }
}

/// Everything that moves beside a body, in every state.
pub(super) struct Moving {
    /// Per state the poses of all bodies, seen from this one.
    seen: Vec<Vec<Pose>>,
    /// Flexures and the other bodies at rest.
    flexures: Vec<Vec<Slot>>,
    bodies: Vec<Vec<Slot>>,
    bundles: Vec<Bundle>,
}

/// A flexure or a body in one state: a ball that holds it, and what it is made of, found when first asked for.
struct Bundle {
    state: usize,
    what: What,
    center: Vector3<f64>,
    radius: f64,
    near: OnceCell<Vec<Near>>,
}

#[derive(Clone, Copy)]
enum What {
    Flexure(usize),
    Body(usize),
}

/// A ball round slots; none round nothing.
fn sphere(slots: &[Slot]) -> Option<(Vector3<f64>, f64)> {
    let center = slots.iter().map(|s| (s.start + s.end) * 0.5).sum::<Vector3<f64>>() / slots.len() as f64;
    let reach = |s: &Slot| {
        let thick = s.disc_radius_mm.hypot(s.half_height_mm) + s.round_mm;
        (s.start - center).norm().max((s.end - center).norm()) + thick
    };
    slots.iter().map(reach).reduce(f64::max).map(|radius| (center, radius))
}

/// Which of the others a slot is nearer to than a bound.
fn nearer<'n>(slot: &Slot, gap_mm: f64, near: impl IntoIterator<Item = &'n Near>) -> Option<usize> {
    let (center, radius) = slot.bounding_sphere();
    near.into_iter().position(|n| {
        (n.center - center).norm() - n.radius - radius < gap_mm
            && slot.signed_distance(&n.center) - n.radius < gap_mm + SURELY_MM
            && nearer_than(&n.slot, slot, gap_mm)
    })
}

impl Builder<'_> {
    /// Whether a slot of this body overlaps something in some state.
    pub(super) fn meets_moving(&self, slot: &Slot) -> bool {
        let moving = self.moving();
        let (center, radius) = slot.bounding_sphere();
        let within = |b: &&Bundle| (b.center - center).norm() - b.radius - radius < SURELY_MM - OVERLAP_MM;
        moving
            .bundles
            .iter()
            .filter(within)
            .any(|b| nearer(slot, -OVERLAP_MM, self.near(moving, b)).is_some())
    }

    /// Everything that moves, in every state, seen from this body.
    fn moving(&self) -> &Moving {
        self.moving.get_or_init(|| {
            let still = vec![vec![Pose::rest(Vector3::zeros()); self.input.bodies.len()]];
            let states = if self.input.motion.is_empty() { &still } else { &self.input.motion };
            let seen = states.iter().filter_map(|poses| {
                let own = poses.get(self.index)?;
                Some(poses.iter().map(|p| from(own, p)).collect())
            });
            let flexures: Vec<Vec<Slot>> = self.input.flexures.iter().map(FlexureSolid::slots).collect();
            let bodies = self
                .input
                .bodies
                .iter()
                .enumerate()
                .map(|(b, body)| if b == self.index { Vec::new() } else { self.rough(b, body) });
            let mut moving =
                Moving { seen: seen.collect(), flexures, bodies: bodies.collect(), bundles: Vec::new() };
            let spheres = |slots: &[Vec<Slot>]| slots.iter().map(|s| sphere(s)).collect::<Vec<_>>();
            let [flexures, bodies] = [&moving.flexures, &moving.bodies].map(|slots| spheres(slots));
            for (state, seen) in moving.seen.iter().enumerate() {
                let at = |what, center, radius| Bundle { state, what, center, radius, near: OnceCell::new() };
                for (f, ball) in flexures.iter().enumerate() {
                    let bodies = self.input.flexures[f].bodies;
                    let (Some(a), Some(b), Some((c, r))) = (seen.get(bodies.0), seen.get(bodies.1), ball)
                    else {
                        continue;
                    };
                    // Each of its points lies between where either end would carry it.
                    let (a, b) = (a.point(c), b.point(c));
                    let radius = r + 0.5 * (a - b).norm();
                    moving.bundles.push(at(What::Flexure(f), (a + b) * 0.5, radius));
                }
                for (b, ball) in bodies.iter().enumerate() {
                    if let Some((c, r)) = ball {
                        moving.bundles.push(at(What::Body(b), seen[b].point(c), *r));
                    }
                }
            }
            moving
        })
    }

    /// What a bundle is made of.
    fn near<'n>(&self, moving: &'n Moving, bundle: &'n Bundle) -> &'n [Near] {
        bundle.near.get_or_init(|| {
            let seen = &moving.seen[bundle.state];
            match bundle.what {
                What::Flexure(f) => self.bent(&self.input.flexures[f], &moving.flexures[f], seen),
                What::Body(b) => moving.bodies[b].iter().map(|s| Near::new(s.moved(&seen[b]))).collect(),
            }
        })
    }

    /// A flexure, as `slots` at rest, as the motion of its two bodies bends it, about: near each end it follows the
    /// body there.
    fn bent(&self, flexure: &FlexureSolid, slots: &[Slot], seen: &[Pose]) -> Vec<Near> {
        let (Some(a), Some(b)) = (seen.get(flexure.bodies.0), seen.get(flexure.bodies.1)) else {
            return Vec::new();
        };
        let count = slots.len().max(1) as f64;
        let ends = [(flexure.bodies.0, false), (flexure.bodies.1, true)];
        let root = |p: &Vector3<f64>| {
            let own = ends.iter().filter(|(body, _)| *body == self.index);
            own.clone().any(|(_, at_end)| (flexure.end_point(*at_end) - p).norm() < ROOT_MM)
        };
        let place = |p: &Vector3<f64>, u: f64| {
            let w = u * u * (3.0 - 2.0 * u);
            a.point(p).lerp(&b.point(p), w)
        };
        slots
            .iter()
            .enumerate()
            .filter(|(_, s)| !root(&s.start) && !root(&s.end))
            .map(|(i, s)| {
                let (u, v) = (i as f64 / count, (i + 1) as f64 / count);
                let axis = a.direction(&s.axis).lerp(&b.direction(&s.axis), u);
                let axis = axis.try_normalize(1e-9).unwrap_or(s.axis);
                Near::new(Slot { start: place(&s.start, u), end: place(&s.end, v), axis, ..*s })
            })
            .collect()
    }

    /// Another body before it is planned: its eyes, the bars between those in its own layer, its sleeves and stubs.
    fn rough(&self, index: usize, body: &BodySolid) -> Vec<Slot> {
        let mut slots = Vec::new();
        for (i, eye) in body.eyes.iter().enumerate() {
            let shape = self.eye_shape(eye);
            let half = shape.half_height - BOSS_BELOW_MM;
            slots.push(Slot::bar(shape.center, shape.center, eye.axis, shape.radius, half, ROUND_MM));
            let Some(axis) = body.axis else { continue };
            let on_level = |e: &Eye| (e.point.dot(&axis) - body.level_mm).abs() < self.half();
            let raised = |p: &Vector3<f64>| p + axis * (body.level_mm - p.dot(&axis));
            if !on_level(eye) {
                // From its own layer straight to its eye.
                let (low, high) =
                    (eye.point.dot(&axis).min(body.level_mm), eye.point.dot(&axis).max(body.level_mm));
                let middle = raised(&eye.point) + axis * ((low + high) / 2.0 - body.level_mm);
                let reach = (high - low) / 2.0;
                slots.push(Slot::bar(middle, middle, axis, shape.radius, reach, ROUND_MM));
            }
            for other in body.eyes.iter().skip(i + 1) {
                let (p, q) = (raised(&eye.point), raised(&other.point));
                let Some(along) = (q - p).try_normalize(1e-9) else { continue };
                let trim =
                    |e: &Eye| if on_level(e) { self.eye_shape(e).keep_out + self.bar_radius() } else { 0.0 };
                let (from, to) = (trim(eye), (q - p).norm() - trim(other));
                if from < to {
                    let half = self.half() - BAR_BELOW_MM;
                    let ends = (p + along * from, p + along * to);
                    slots.push(Slot::bar(ends.0, ends.1, axis, self.bar_radius(), half, ROUND_MM));
                }
            }
        }
        for guide in body.guides.iter().filter(|g| g.sleeve) {
            slots.extend(self.whole_sleeve(guide));
        }
        for flexure in &self.input.flexures {
            for (own, at_end) in [(flexure.bodies.0, false), (flexure.bodies.1, true)] {
                if own != index {
                    continue;
                }
                let (at, out) = (flexure.end_point(at_end), flexure.outward(at_end));
                let radius = STUB_RADIUS_MM.max(flexure.end_axes(at_end).0);
                let root = at + out * (STUB_FREE_MM + self.boss_radius());
                slots.push(Slot::capsule(at, root, radius));
                let Some(axis) = body.axis else { continue };
                let level = flexure.joint_point.dot(&axis);
                if (level - body.level_mm).abs() >= self.half() {
                    let (low, high) = (level.min(body.level_mm), level.max(body.level_mm));
                    let middle = root + axis * ((low + high) / 2.0 - root.dot(&axis));
                    let reach = (high - low) / 2.0 + self.half() - BOSS_BELOW_MM;
                    slots.push(Slot::bar(middle, middle, axis, self.boss_radius(), reach, ROUND_MM));
                }
            }
        }
        slots
    }

    /// The eyes that cannot be reached straight: each by an arm in its own share of its layer and a riser beside what
    /// stands between.
    pub(super) fn rise_beside(&mut self) {
        let Some(body) = self.input.bodies.get(self.index) else { return };
        let eyes: Vec<&Eye> = body.eyes.iter().filter(|e| self.risen.contains(&e.point)).collect();
        for eye in eyes {
            let shape = self.eye_shape(eye);
            let level = shape.center.dot(&self.axis());
            let half = shape.half_height - BOSS_BELOW_MM;
            let radius = (SLIMMER * self.bar_radius()).max(STUB_RADIUS_MM);
            let neck =
                (shape.half_height - BAR_BELOW_MM - SPREAD_MM * spread(self.plan.slots.len())).max(0.1);
            let axis = self.axis();
            let arm =
                |foot: &Vector3<f64>| Slot::bar(shape.center, *foot, axis, radius - 0.1, neck, ROUND_MM);
            let span = (level - half, level + half);
            match self.foot(&shape.center, span, radius, arm) {
                Some(foot) => {
                    let beside = Anchor::Beside(eye.point);
                    let follow = Follow::bar([Anchor::Fixed, beside.clone()]);
                    self.push_following(Role::Bar, arm(&foot), follow);
                    self.column(Role::Riser, &foot, span, radius, &beside);
                    self.node(foot, None, beside);
                }
                None => {
                    self.plan.notes.push(format!(
                        "`{}`: there is no free way to its pin at ({:.1}, {:.1}) mm.",
                        body.name, eye.point.x, eye.point.y
                    ));
                    self.column(Role::Riser, &eye.point, span, shape.radius, &Anchor::Fixed);
                    self.node(eye.point, None, Anchor::Fixed);
                }
            }
        }
    }

    /// The best place for a riser near `from`: free in every state, together with the arm that leads there, and with
    /// a short way to the body's nodes.
    pub(super) fn foot(
        &self,
        from: &Vector3<f64>,
        span: (f64, f64),
        radius: f64,
        arm: impl Fn(&Vector3<f64>) -> Slot,
    ) -> Option<Vector3<f64>> {
        let axis = self.axis();
        let reach = DISTANCES as f64 * DISTANCE_STEP_MM + radius + self.input.clearance_mm;
        let level = from.dot(&axis);
        let within = |center: &Vector3<f64>, radius: f64| {
            let off = center - from;
            (off - axis * off.dot(&axis)).norm() < reach + radius
        };
        let moving = self.moving();
        let bundles = moving.bundles.iter().filter(|b| within(&b.center, b.radius + SURELY_MM));
        let near = bundles.flat_map(|b| self.near(moving, b)).filter(|n| within(&n.center, n.radius));
        let mut near: Vec<&Near> = near.collect();
        let first = super::slot::any_normal(&axis);
        let mut places: Vec<(f64, Vector3<f64>)> = Vec::new();
        for k in 0..DIRECTIONS {
            let turn = TAU * k as f64 / DIRECTIONS as f64;
            let out = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), turn) * first;
            for d in 1..=DISTANCES {
                let way = d as f64 * DISTANCE_STEP_MM;
                let place = from + out * way;
                let there = self.at_level(&place, self.level);
                let rest = self.nodes.iter().map(|n| (n.at - there).norm()).fold(f64::INFINITY, f64::min);
                places.push((way + if rest.is_finite() { rest } else { 0.0 }, place));
            }
        }
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let gap = self.input.clearance_mm;
        let free = |place: &Vector3<f64>| {
            let column = self.column_slot(&self.at_level(place, level), span, radius);
            let all = || near.iter().copied();
            let in_the_way = nearer(&column, gap, all()).or_else(|| nearer(&arm(place), gap, all()));
            // What is in one place's way is in many others' too: it is looked at first there.
            in_the_way.inspect(|i| near[..=*i].rotate_right(1)).is_none()
        };
        places.into_iter().map(|(_, p)| p).find(free)
    }

    /// Whether a place is one of those reached from beside.
    pub(super) fn is_risen(&self, p: &Vector3<f64>) -> bool {
        let axis = self.axis();
        self.risen.iter().any(|q| {
            let off = p - q;
            (off - axis * off.dot(&axis)).norm() < SAME_NODE_MM
        })
    }
}

/// A pose seen from a body that has moved itself.
fn from(own: &Pose, other: &Pose) -> Pose {
    let back = own.rotation.transpose();
    let zero = Vector3::zeros();
    let moved = other.point(&zero) - own.point(&zero);
    Pose { rotation: back * other.rotation, translation: back * moved, center: zero }
}
