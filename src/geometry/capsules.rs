//! A body as capsules with exact derivatives by the design parameters: the link geometry that the optimiser sees
//! (paper, section 3.3). A slot becomes *fans*: copies of one capsule side by side, inscribed in the slot. A thick one
//! touches its faces in the middle, thin ones along its sides and round its ends reach into its corners.

use super::anchor::{Anchor, Follow, Followed};
use super::link::{BodyPlan, Role};
use super::slot::Slot;
use crate::equilibrium::Model;
use nalgebra::{Matrix3, Matrix3xX, RowDVector, Vector3};
use std::f64::consts::PI;

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

/// The bodies' `plans` as capsules, with derivatives by the `parameters` design parameters of `model`. Nets of nodes and detours are those of the plans; only what a plan says it follows moves.
pub fn skeleton_capsules(plans: &[BodyPlan], model: &Model, parameters: usize) -> Vec<SkeletonCapsule> {
    let followed = Followed { rods: &model.rods, parameters };
    let fixed = Follow::default();
    let mut out = Vec::new();
    for (body, plan) in plans.iter().enumerate() {
        for (i, (role, slot)) in plan.slots.iter().enumerate() {
            let follow = plan.follows.get(i).unwrap_or(&fixed);
            add_slot(&mut out, &followed, body, *role, slot, follow);
        }
    }
    out
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
    let point = |k: usize| match &follow.ends[k] {
        Anchor::Fixed => still(),
        anchor => followed.point(anchor),
    };
    let moved = [point(0), if follow.ends[0] == follow.ends[1] { point(0) } else { point(1) }];
    let capsule = |ends, d_ends_dp| SkeletonCapsule {
        body,
        role,
        ends,
        d_ends_dp,
        fan: slot.axis,
        d_fan_dp: still(),
        spread_mm: 0.0,
        d_spread_dp: RowDVector::zeros(n),
        radius_mm: radius.min(half),
        d_radius_dp: if radius <= half { by_radius.clone() } else { by_half.clone() },
    };
    let d = slot.end - slot.start;
    let length = d.norm();
    let (wide, by_wide) = (radius - half, &by_radius - &by_half);
    // Directions across the slot: with a length normal to it, else fixed in the body.
    let first = super::slot::any_normal(&slot.axis);
    let mut across = Turning { at: slot.axis.cross(&first), by: still() };
    if length > NOTHING_MM {
        let u = d / length;
        let turn = (Matrix3::identity() - u * u.transpose()) / length;
        let by = crate::math::skew(&slot.axis) * turn * (&moved[1] - &moved[0]);
        across = Turning { at: slot.axis.cross(&u), by };
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
        for u in diameters(&first, &across.at) {
            let by = u * &by_wide;
            let ends = [slot.start - u * wide, slot.start + u * wide];
            out.push(capsule(ends, [&moved[0] - &by, &moved[0] + &by]));
        }
    }
    // Thin ones, upright fans along the outline.
    let (least, by_least) = if radius <= half { (radius, &by_radius) } else { (half, &by_half) };
    let (thin, by_thin) = if THIN * least > slot.round_mm {
        (THIN * least, by_least * THIN)
    } else {
        (slot.round_mm, RowDVector::zeros(n))
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
        for u in diameters(&first, &slot.axis.cross(&first)) {
            let by = u * &by_off;
            let ends = [slot.start - u * off, slot.start + u * off];
            out.push(upright(ends, [&moved[0] - &by, &moved[0] + &by]));
        }
    }
}

/// A direction and its derivative, 3 × n.
struct Turning {
    at: Vector3<f64>,
    by: Matrix3xX<f64>,
}

/// Directions all round in the plane of two unit vectors.
fn diameters(first: &Vector3<f64>, second: &Vector3<f64>) -> [Vector3<f64>; DIAMETERS] {
    std::array::from_fn(|k| {
        let (sin, cos) = (PI * k as f64 / DIAMETERS as f64).sin_cos();
        first * cos + second * sin
    })
}
