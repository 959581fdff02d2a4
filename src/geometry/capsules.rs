//! A body as capsules with exact derivatives by the design parameters: the link geometry that the optimiser sees
//! (paper, section 3.3). A slot becomes a *fan*: copies of one capsule side by side, inscribed in the slot, which
//! touch its flat faces and leave only its rounded-off corners out.

use super::anchor::{Anchor, Follow, Followed};
use super::link::{BodyPlan, Role};
use super::slot::Slot;
use crate::equilibrium::Model;
use nalgebra::{Matrix3, Matrix3xX, RowDVector, Vector3};
use std::f64::consts::PI;

/// Sizes below this are none, mm.
const NOTHING_MM: f64 = 1e-9;
/// Diameters that cover the end of a flat slot (a disc wider than high): with four the outline is missed by
/// 1 − cos 22.5°, 8 % of what the disc is wider than high.
const DIAMETERS: usize = 4;

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
    if half >= radius {
        // Higher than wide: copies above one another.
        out.push(SkeletonCapsule {
            spread_mm: half - radius,
            d_spread_dp: &by_half - &by_radius,
            ..capsule(ends, moved)
        });
        return;
    }
    let (wide, by_wide) = (radius - half, &by_radius - &by_half);
    if length > NOTHING_MM {
        // Wider than high: copies side by side.
        let u = d / length;
        let side = slot.axis.cross(&u);
        let turn = (Matrix3::identity() - u * u.transpose()) / length;
        let d_side = crate::math::skew(&slot.axis) * turn * (&moved[1] - &moved[0]);
        out.push(SkeletonCapsule {
            fan: side,
            d_fan_dp: d_side,
            spread_mm: wide,
            d_spread_dp: by_wide.clone(),
            ..capsule(ends, moved.clone())
        });
    }
    // The discs at its ends by their diameters, in directions fixed in the body.
    let first = super::slot::any_normal(&slot.axis);
    let second = slot.axis.cross(&first);
    let count = if length > NOTHING_MM { 2 } else { 1 };
    for (at, moved) in ends.iter().zip(&moved).take(count) {
        for k in 0..DIAMETERS {
            let (sin, cos) = (PI * k as f64 / DIAMETERS as f64).sin_cos();
            let u = first * cos + second * sin;
            let by = u * &by_wide;
            out.push(capsule([at - u * wide, at + u * wide], [moved - &by, moved + &by]));
        }
    }
}
