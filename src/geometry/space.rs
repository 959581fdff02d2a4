//! A body whose joints point different ways: stubs and necks joined by round bars and balls in space, by the same
//! chain or hub as in a layer (paper, section 3.3: a link is a union of capsules).

use super::anchor::{Anchor, FlexureEnd, Follow, SizeBy};
use super::distance::{nearer_than, separation};
use super::link::{
    BAR_BELOW_MM, BOSS_BELOW_MM, BOSS_EXTRA_MM, Builder, CLEAR_MM, LEAST_HALF_MM, Node, ROUND_MM, Role,
    SAME_NODE_MM, SPREAD_MM, STUB_BELOW_MM, STUB_FREE_MM, STUB_RADIUS_MM, STUB_ROUND_MM, plan_body, spread,
    stub_radius,
};
use super::parts::{BodySolid, Eye, FlexureSolid, GeometryError};
use super::skeleton::connect;
use super::slot::{Slot, any_normal};
use nalgebra::{Rotation3, Unit, Vector3};
use std::f64::consts::TAU;

/// Radius of a round bar as a part of the links' height: half as thick as a link is high.
const ROUND_PER_HEIGHT: f64 = 0.25;
/// Directions tried for a neck, round the joint's axis.
const NECK_DIRECTIONS: usize = 24;
/// What a neck that runs into something costs beyond its way, mm.
const BLOCKED_MM: f64 = 1e4;
/// Length of a stub in front of its ball in a flexure's own body, mm: the ball just stays behind the
/// attachment plane.
const OWN_FREE_MM: f64 = 0.3;
/// Leaves whose wide directions differ by less (sine) share sub-layers.
const STACKED: f64 = 0.1;

impl Builder<'_> {
    /// Plans a body in space.
    pub(super) fn plan_in_space(&mut self, body: &BodySolid) -> Result<(), GeometryError> {
        let ends: Vec<(usize, bool)> = self
            .input
            .flexures
            .iter()
            .enumerate()
            .flat_map(|(f, flexure)| [(f, false, flexure.bodies.0), (f, true, flexure.bodies.1)])
            .filter(|(_, _, body)| *body == self.index)
            .map(|(f, at_end, _)| (f, at_end))
            .collect();
        for (f, at_end) in ends {
            self.stub_in_space(f, at_end);
        }
        for guide in &body.guides {
            self.add_guide(guide, true)?;
        }
        for hole in &body.holes {
            self.hole_in_space(hole);
            self.node_in_space(hole.point, Anchor::Fixed);
        }
        for mount in &body.mounts {
            let node = self.add_mount(mount, false);
            self.node_in_space(node, Anchor::Fixed);
        }
        let apart = |p: &Vector3<f64>| body.eyes.iter().all(|e| (e.point - p).norm() >= SAME_NODE_MM);
        for p in body.skeleton.iter().filter(|p| apart(p)) {
            self.node_in_space(*p, Anchor::Fixed);
        }
        for (i, eye) in body.eyes.iter().enumerate() {
            let others = body.eyes.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, e)| e.point);
            let places: Vec<Vector3<f64>> = self.nodes.iter().map(|n| n.at).chain(others).collect();
            self.eye_in_space(eye, &places, &body.name);
        }
        for seat in &body.seats {
            self.add_seat(seat, body);
        }
        if self.nodes.is_empty() {
            return Err(GeometryError::NoSkeleton(body.name.clone()));
        }
        let points: Vec<Vector3<f64>> = self.nodes.iter().map(|n| n.at).collect();
        let radius = self.round_radius();
        let net = connect(&points, |p, q| self.runs_into(&Slot::capsule(*p, *q, radius)));
        if let Some(hub) = net.hub {
            let nodes = self.nodes.iter().map(|n| (n.at, n.anchor.clone())).collect();
            self.nodes.push(Node { at: hub, own_eye: None, anchor: Anchor::Hub { nodes, at: hub } });
        }
        for (node, anchor) in self.nodes.iter().map(|n| (n.at, n.anchor.clone())).collect::<Vec<_>>() {
            let radius = self.ball_radius() + 0.5 * SPREAD_MM * spread(self.plan.slots.len());
            self.push_following(Role::Boss, Slot::capsule(node, node, radius), Follow::point(&anchor));
        }
        for (i, j) in net.edges {
            let (p, q) = (&self.nodes[i], &self.nodes[j]);
            let radius = radius - SPREAD_MM * spread(self.plan.slots.len());
            let follow = Follow::bar([p.anchor.clone(), q.anchor.clone()]);
            self.push_following(Role::Bar, Slot::capsule(p.at, q.at, radius), follow);
        }
        if let Some(plate) = &body.plate {
            self.add_plate(plate, false);
        }
        self.check_mounts(body);
        Ok(())
    }

    /// Length of a stub in front of its ball. A flexure's own body has nothing to keep away from its flexures, and moves between
    /// its neighbours: the smaller the better.
    fn stub_free(&self) -> f64 {
        if self.input.bodies.get(self.index).is_some_and(|b| b.of_flexure) {
            OWN_FREE_MM
        } else {
            STUB_FREE_MM
        }
    }

    /// What flexures' own bodies are made of: they stand first, and the other bodies' bars go round them.
    fn slots_of_flexures(&self) -> &[Slot] {
        self.of_flexures.get_or_init(|| {
            let bodies = &self.input.bodies;
            if bodies.get(self.index).is_none_or(|b| b.of_flexure) {
                return Vec::new();
            }
            let plans = (0..bodies.len()).filter(|b| bodies[*b].of_flexure).map(|b| plan_body(self.input, b));
            plans.flatten().flat_map(|plan| plan.slots).map(|(_, slot)| slot).collect()
        })
    }

    /// Radius of a round bar.
    fn round_radius(&self) -> f64 {
        (self.input.height_mm * ROUND_PER_HEIGHT)
            .max(STUB_RADIUS_MM + BOSS_EXTRA_MM)
            .max(self.input.least_wall_mm)
    }

    /// Radius of a ball where bars meet.
    pub(super) fn ball_radius(&self) -> f64 {
        self.round_radius() + BOSS_EXTRA_MM
    }

    /// The node at a place, made if there is none.
    pub(super) fn node_in_space(&mut self, at: Vector3<f64>, anchor: Anchor) {
        if !self.nodes.iter().any(|n| (n.at - at).norm() < SAME_NODE_MM) {
            self.nodes.push(Node { at, own_eye: None, anchor });
        }
    }

    /// The stub of a flexure's end along the end's own tangent: a capsule for a wire, upright along the wide direction
    /// for a leaf.
    fn stub_in_space(&mut self, index: usize, at_end: bool) {
        let Some(flexure) = self.input.flexures.get(index) else { return };
        let (p, outward) = (flexure.end_point(at_end), flexure.outward(at_end));
        let (a, b) = flexure.end_axes(at_end);
        let wall = self.input.least_wall_mm;
        let radius = stub_radius(a, wall);
        let reach = self.stub_free() + self.ball_radius();
        let nose_mm = flexure.nose_center_mm(at_end, radius);
        let (nose, root) = (p + outward * nose_mm, p + outward * reach);
        // No axis: the end is taken as it points.
        let end = FlexureEnd { flexure: index, at_end, axis: Vector3::zeros() };
        let by_a = SizeBy { a: f64::from(u8::from(a + wall > STUB_RADIUS_MM)), ..SizeBy::default() };
        let along =
            |along_mm: f64, along: SizeBy| Anchor::Stub { end, along_mm, along, level: SizeBy::default() };
        let mut follow = Follow {
            ends: [along(nose_mm, by_a), along(reach, SizeBy::default())],
            sized_by: Some(end),
            radius: by_a,
            half_height: by_a,
            upright: None,
        };
        let wide = if at_end { flexure.m2.last() } else { flexure.m2.first() }.copied().unwrap_or_default();
        if b + wall <= radius {
            self.push_following(Role::Stub(index), Slot::capsule(nose, root, radius), follow);
        } else {
            // Beside another leaf of the joint only as wide as the leaf itself.
            let beside = |other: &FlexureSolid| {
                let (Some(q), Some(m)) = (other.centreline.first(), other.m2.first()) else { return false };
                m.cross(&wide).norm() < STACKED && (q - p).dot(&wide).abs() > 1e-6
            };
            let same =
                self.input.flexures.iter().filter(|f| f.joint == flexure.joint && f.path != flexure.path);
            let more = if same.into_iter().any(beside) { 0.0 } else { wall };
            let nudge = 0.5 * SPREAD_MM * spread(2 * index + usize::from(at_end));
            let half_height = b + more - STUB_BELOW_MM - nudge;
            follow.upright = Some(end);
            follow.half_height = SizeBy { b: 1.0, ..SizeBy::default() };
            if half_height <= LEAST_HALF_MM {
                follow.half_height = SizeBy::default();
            }
            let half_height = half_height.max(LEAST_HALF_MM);
            let slot = Slot::bar(nose, root, wide, radius, half_height, STUB_ROUND_MM);
            self.push_following(Role::Stub(index), slot, follow);
        }
        self.node_in_space(root, along(reach, SizeBy::default()));
    }

    /// An eye in its share of the joint's stack, and a neck out of the other bodies' room, towards the body's `places`.
    fn eye_in_space(&mut self, eye: &Eye, places: &[Vector3<f64>], name: &str) {
        let shape = self.eye_shape(eye);
        let half = shape.half_height - BOSS_BELOW_MM;
        self.push(
            Role::Eye(eye.joint),
            Slot::bar(shape.center, shape.center, eye.axis, shape.radius, half, ROUND_MM),
        );
        self.bore(eye, &shape, name);
        if places.is_empty() {
            // Nothing but the eye: it is the body.
            self.nodes.push(Node { at: shape.center, own_eye: None, anchor: Anchor::Fixed });
            return;
        }
        let middle = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
        // Directions fixed in the joint: the neck does not turn when flexures change.
        let first = any_normal(&eye.axis);
        let reach = shape.keep_out + self.ball_radius() + SPREAD_MM;
        let radius = shape.radius.min(self.round_radius()) - 0.3;
        let neck_half = (half - BAR_BELOW_MM).max(0.1);
        let neck = |k: usize| {
            let turn = Rotation3::from_axis_angle(
                &Unit::new_unchecked(eye.axis),
                TAU * k as f64 / NECK_DIRECTIONS as f64,
            );
            let end = shape.center + turn * first * reach;
            Slot::bar(shape.center, end, eye.axis, radius, neck_half, ROUND_MM)
        };
        let cost = |s: &Slot| {
            let ball = Slot::capsule(s.end, s.end, self.ball_radius());
            let way: f64 = places.iter().map(|p| (p - s.end).norm()).fold(f64::INFINITY, f64::min);
            way + (middle - s.end).norm()
                + if self.hits(s) || self.runs_into(&ball) { BLOCKED_MM } else { 0.0 }
        };
        let best = (0..NECK_DIRECTIONS).map(neck).min_by(|s, t| cost(s).total_cmp(&cost(t)));
        let Some(best) = best else { return };
        let beside = Anchor::Beside(eye.point);
        self.push_following(Role::Bar, best, Follow::bar([Anchor::Fixed, beside.clone()]));
        self.nodes.push(Node { at: best.end, own_eye: None, anchor: beside });
    }

    /// Whether a bar or ball would run into a flexure, another body's stub, a flexure's own body, or the room of a hinge.
    fn runs_into(&self, bar: &Slot) -> bool {
        let mut eyes = self.input.bodies.iter().flat_map(|b| &b.eyes);
        self.hits(bar)
            || self.in_guide(bar, true)
            || self.slots_of_flexures().iter().any(|s| nearer_than(bar, s, self.input.clearance_mm))
            || eyes.any(|e| {
                let room = self.eye_shape(e).keep_out - CLEAR_MM;
                let stack = Slot::bar(e.point, e.point, e.axis, room, self.half(), 0.0);
                separation(bar, &stack).gap_mm < 0.0
            })
    }
}
