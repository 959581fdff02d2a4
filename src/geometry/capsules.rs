//! A body as capsules with exact derivatives by the design parameters: the link geometry that the optimiser sees
//! (paper, section 3.3). A slot becomes *fans*: copies of one capsule side by side, inscribed in the slot. A thick one
//! touches its faces in the middle, thin ones along its sides and round its ends reach into its corners.

use super::anchor::{DrawnPoint, Follow, Followed};
use super::link::{BodyPlan, Role};
use super::slot::{Slot, any_normal};
use crate::equilibrium::Model;
use crate::ir::expr::Evaluated;
use crate::ir::{Design, ExprPoint, Joint, JointKind};
use crate::math::skew;
use nalgebra::{Matrix3, Matrix3xX, RowDVector, Vector3};
use std::f64::consts::PI;

/// Sine of the angle between directions that count as parallel.
const PARALLEL: f64 = 1e-9;
/// Sizes below this are none, mm.
const NOTHING_MM: f64 = 1e-9;
/// Diameters that cover a round end: with six its outline is missed by at most 1 − cos 15°, 3.4 % of the radius.
const DIAMETERS: usize = 6;
/// Radius of the thin capsules as a part of the slot's least half width, if its edges are not rounded more: what they
/// miss of a corner is √2 − 1 of the difference.
const THIN: f64 = 0.2;

/// A fan of capsules of one body in rest coordinates, with first derivatives by the n design parameters.
///
/// The capsules have axes `ends + fan · s`, −`spread` ≤ s ≤ `spread`, and all the same radius.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonCapsule {
    /// Index of the body.
    pub body: usize,
    /// What the slot it comes from is for.
    pub role: Role,
    /// Ends of the axis in the middle of the fan, mm.
    pub ends: [Vector3<f64>; 2],
    /// Their derivatives, 3 × n each.
    pub d_ends_dp: [Matrix3xX<f64>; 2],
    /// Unit direction of the fan.
    pub fan: Vector3<f64>,
    /// Its derivative, 3 × n.
    pub d_fan_dp: Matrix3xX<f64>,
    /// Half the width of the fan of axes, mm.
    pub spread_mm: f64,
    /// Its derivative, 1 × n.
    pub d_spread_dp: RowDVector<f64>,
    /// Radius, mm.
    pub radius_mm: f64,
    /// Its derivative, 1 × n.
    pub d_radius_dp: RowDVector<f64>,
}

/// The bodies' `plans` as capsules, with derivatives by the design parameters of `model`. Nets of nodes and detours
/// are those of the plans; only what a plan says it follows moves. Where free variables move the mechanism itself, this
/// holds as long as [`follows_geometry`] says so.
pub fn skeleton_capsules(design: &Design, plans: &[BodyPlan], model: &Model) -> Vec<SkeletonCapsule> {
    let moving = model.layout.changes.as_ref().is_some_and(|c| !c.is_empty()) || drawn_freely(design);
    // What joints and points move by is needed only where something of it does.
    let values = moving.then(|| design.exprs.evaluate(&model.p));
    let fixed = Follow::default();
    let mut out = Vec::new();
    for (body, plan) in plans.iter().enumerate() {
        let followed = followed(design, model, values.as_ref(), body);
        for (i, (role, slot)) in plan.slots.iter().enumerate() {
            let follow = plan.follows.get(i).unwrap_or(&fixed);
            add_slot(&mut out, &followed, body, *role, slot, follow);
        }
    }
    out
}

/// What a body's slots follow.
fn followed<'m>(design: &Design, model: &'m Model, values: Option<&Evaluated>, body: usize) -> Followed<'m> {
    let (layout, parameters) = (&model.layout, model.p.len());
    let rods = &model.rods;
    let Some(values) = values else {
        return Followed { rods, carried: Vec::new(), drawn: Vec::new(), axis: None, parameters };
    };
    let joints = design.joints.iter().filter(|j| j.bodies.contains(&body)).map(|j| j.point);
    let points = design.bodies[body].skeleton.iter().map(|p| p.position);
    let drawn = joints
        .chain(points)
        .filter_map(|p| layout.rest_point(values, parameters, body, p).map(|(at, by)| DrawnPoint { at, by }));
    let carried = layout.changes.iter().flatten().map(|c| (c.parameter, c.bodies[body]));
    Followed {
        rods,
        carried: carried.collect(),
        drawn: drawn.collect(),
        axis: Some(Vector3::from(design.layers.axis)),
        parameters,
    }
}

/// Whether links can follow the free variables that move the mechanism: in plane mechanisms without conventional
/// sliders, where no layer tilts and no guide changes its length.
pub fn follows_geometry(design: &Design) -> bool {
    let axis = Vector3::from(design.layers.axis);
    let plane = |j: &Joint| {
        let hinge = j.kind == JointKind::Hinge && Vector3::from(j.axis).cross(&axis).norm() < PARALLEL;
        let slides = j.kind == JointKind::Slider && Vector3::from(j.axis).dot(&axis).abs() < PARALLEL;
        hinge || (slides && j.is_compliant())
    };
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let values = design.exprs.evaluate(&start);
    let level = |p: &ExprPoint| {
        (0..start.len()).all(|i| {
            let by = p.map(|id| values.gradient(id).get(i).copied().unwrap_or(0.0));
            Vector3::from(by).dot(&axis).abs() < PARALLEL
        })
    };
    let mut points = design.joints.iter().map(|j| j.point);
    let mut skeletons = design.bodies.iter().flat_map(|b| &b.skeleton).map(|p| p.position);
    let still = design.geometry_variables().is_empty() && !drawn_freely(design);
    still || (design.joints.iter().all(plane) && points.all(|p| level(&p)) && skeletons.all(|p| level(&p)))
}

/// Whether free variables move points of links that move nothing else.
fn drawn_freely(design: &Design) -> bool {
    let points: Vec<_> = design.bodies.iter().flat_map(|b| &b.skeleton).flat_map(|p| p.position).collect();
    !design.exprs.free_variables(&points).is_empty()
}

fn add_slot(
    out: &mut Vec<SkeletonCapsule>,
    followed: &Followed,
    body: usize,
    role: Role,
    slot: &Slot,
    follow: &Follow,
) {
    let n = followed.parameters;
    let (radius, half) = (slot.radius_mm(), slot.half_height_mm + slot.round_mm);
    let still = || Matrix3xX::zeros(n);
    let sizes = [&follow.radius, &follow.half_height].map(|by| match &follow.sized_by {
        Some(end) => followed.size(end, by),
        None => RowDVector::zeros(n),
    });
    let [by_radius, by_half] = sizes;
    let ends = [slot.start, slot.end];
    let point = |k: usize| followed.point(&follow.ends[k], &ends[k]);
    let same = slot.start == slot.end && follow.ends[0] == follow.ends[1];
    let moved = [point(0), if same { point(0) } else { point(1) }];
    let by_axis = follow.upright.as_ref().map_or_else(still, |end| followed.wide(end));
    let axis = Turning { at: slot.axis, by: by_axis };
    let capsule = |ends, d_ends_dp| SkeletonCapsule {
        body,
        role,
        ends,
        d_ends_dp,
        fan: slot.axis,
        d_fan_dp: axis.by.clone(),
        spread_mm: 0.0,
        d_spread_dp: RowDVector::zeros(n),
        radius_mm: radius.min(half),
        d_radius_dp: if radius <= half { by_radius.clone() } else { by_half.clone() },
    };
    let d = slot.end - slot.start;
    let length = d.norm();
    let (wide, by_wide) = (radius - half, &by_radius - &by_half);
    // Directions across the slot: with a length normal to it, else fixed in the body.
    let mut first = Turning { at: any_normal(&slot.axis), by: still() };
    let mut across = axis.cross(&first);
    if length > NOTHING_MM {
        let u = d / length;
        let turn = (Matrix3::identity() - u * u.transpose()) / length;
        across = axis.cross(&Turning { at: u, by: turn * (&moved[1] - &moved[0]) });
        if follow.upright.is_some() {
            // Any normal of an axis that turns would jump.
            first = across.clone();
        }
    }
    // In the middle: copies above one another, or side by side.
    if half >= radius {
        out.push(SkeletonCapsule {
            spread_mm: -wide,
            d_spread_dp: -&by_wide,
            ..capsule(ends, moved.clone())
        });
    } else if length > NOTHING_MM {
        out.push(SkeletonCapsule {
            fan: across.at,
            d_fan_dp: across.by.clone(),
            spread_mm: wide,
            d_spread_dp: by_wide.clone(),
            ..capsule(ends, moved.clone())
        });
    } else {
        for u in diameters(&first, &across) {
            let by = u.at * &by_wide + u.by * wide;
            let ends = [slot.start - u.at * wide, slot.start + u.at * wide];
            out.push(capsule(ends, [&moved[0] - &by, &moved[0] + &by]));
        }
    }
    // A capsule has no corners.
    if slot.disc_radius_mm <= 0.0 && slot.half_height_mm <= 0.0 {
        return;
    }
    // Thin ones, upright fans along the outline.
    let (least, by_least) = if radius <= half { (radius, &by_radius) } else { (half, &by_half) };
    let (thin, by_thin) = if THIN * least > slot.round_mm {
        (THIN * least, by_least * THIN)
    } else {
        // Edges are rounded by as much as there is.
        let by_round = if slot.disc_radius_mm <= 0.0 {
            by_radius.clone()
        } else if slot.half_height_mm <= 0.0 {
            by_half.clone()
        } else {
            RowDVector::zeros(n)
        };
        (slot.round_mm, by_round)
    };
    let (off, by_off) = (radius - thin, &by_radius - &by_thin);
    let upright = |ends, d_ends_dp| SkeletonCapsule {
        spread_mm: half - thin,
        d_spread_dp: &by_half - &by_thin,
        radius_mm: thin,
        d_radius_dp: by_thin.clone(),
        ..capsule(ends, d_ends_dp)
    };
    if length > NOTHING_MM {
        let by = &across.by * off + across.at * &by_off;
        for sign in [-1.0, 1.0] {
            let by = &by * sign;
            out.push(upright(ends.map(|p| p + across.at * (off * sign)), [&moved[0] + &by, &moved[1] + &by]));
        }
    }
    // Bars end in bosses and eyes, stubs with a nose.
    if length <= NOTHING_MM || matches!(role, Role::Stub(_)) {
        for u in diameters(&first, &axis.cross(&first)) {
            let by = u.at * &by_off + u.by * off;
            let ends = [slot.start - u.at * off, slot.start + u.at * off];
            out.push(upright(ends, [&moved[0] - &by, &moved[0] + &by]));
        }
    }
}

/// A direction and its derivative, 3 × n.
#[derive(Clone)]
struct Turning {
    at: Vector3<f64>,
    by: Matrix3xX<f64>,
}

impl Turning {
    fn cross(&self, other: &Self) -> Self {
        let by = skew(&self.at) * &other.by - skew(&other.at) * &self.by;
        Self { at: self.at.cross(&other.at), by }
    }
}

/// Directions all round in the plane of two unit vectors.
fn diameters(first: &Turning, second: &Turning) -> [Turning; DIAMETERS] {
    std::array::from_fn(|k| {
        let (sin, cos) = (PI * k as f64 / DIAMETERS as f64).sin_cos();
        Turning { at: first.at * cos + second.at * sin, by: &first.by * cos + &second.by * sin }
    })
}
