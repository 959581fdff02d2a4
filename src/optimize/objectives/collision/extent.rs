//! Where strips are, to tell at once which of them, which of their samples and which copies of their capsules are too
//! far apart to count: nearly all. Only such pieces are left out whose penalty is zero, so the sum keeps its bits.

use super::strip::Strip;
use nalgebra::Vector3;
use std::ops::Range;

/// What rounding may do to squares of distances, relative to that of the reach: much more than it does.
const MARGIN: f64 = 1e-9;
/// The same for distances, mm, and for their squares, mm².
const ROOM: f64 = 1e-6;
/// Lengths below this have no direction, mm.
const NO_LENGTH_MM: f64 = 1e-9;

/// An upright box in the world.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    middle: Vector3<f64>,
    half: Vector3<f64>,
}

impl Bounds {
    /// Whether no two points of the boxes are nearer than `reach`.
    pub fn far(&self, other: &Self, reach: f64) -> bool {
        let apart = (self.middle - other.middle).abs();
        let room = self.half + other.half;
        (0..3).any(|c| apart[c] >= room[c] + reach)
    }

    /// Around all of some strips; none without any.
    pub fn around(extents: &[Extent]) -> Option<Self> {
        extents.iter().map(|e| e.bounds).reduce(|a, b| a.and(&b))
    }

    fn and(&self, other: &Self) -> Self {
        let low = (self.middle - self.half).inf(&(other.middle - other.half));
        let high = (self.middle + self.half).sup(&(other.middle + other.half));
        // A little wider, as what is inside must not get out by rounding.
        let half = (high - low) * (0.5 * (1.0 + MARGIN));
        Self { middle: (low + high) * 0.5, half: half.add_scalar(ROOM) }
    }
}

/// The box of a strip's axes, upright and along the strip.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Upright in the world.
    pub bounds: Bounds,
    /// Along the axis, across in the fan, and normal to both.
    frame: [Vector3<f64>; 3],
    /// Length of the axis, mm.
    length: f64,
    /// The outermost copy's place across and along, mm.
    fan: [f64; 2],
}

impl Extent {
    /// Of a strip's axes.
    pub fn new(strip: &Strip) -> Self {
        let axis = strip.ends[1] - strip.ends[0];
        let bounds = Bounds {
            middle: (strip.ends[0] + strip.ends[1]) * 0.5,
            half: axis.abs() * 0.5 + strip.fan.abs() * strip.spread,
        };
        let length = axis.norm();
        let e = if length > NO_LENGTH_MM { axis / length } else { other_than(&strip.fan) };
        let across = (strip.fan - e * strip.fan.dot(&e)).try_normalize(NO_LENGTH_MM);
        let across = across.unwrap_or_else(|| other_than(&e));
        let reach = if strip.copies < 2 { 0.0 } else { strip.spread };
        let fan = [reach * strip.fan.dot(&across), reach * strip.fan.dot(&e)];
        Self { bounds, frame: [e, across, e.cross(&across)], length, fan }
    }

    /// Half the size along each axis of the frame.
    fn half(&self) -> [f64; 3] {
        [0.5 * self.length + self.fan[1].abs(), self.fan[0].abs(), 0.0]
    }

    /// Whether a plane along a face of either box has them on both sides, `reach` apart.
    pub fn apart(&self, other: &Self, reach: f64) -> bool {
        let way = other.bounds.middle - self.bounds.middle;
        let room = reach * (1.0 + MARGIN) + ROOM;
        let turned = self.frame.map(|u| other.frame.map(|v| u.dot(&v).abs()));
        let (a, b) = (self.half(), other.half());
        (0..3).any(|i| {
            let own = way.dot(&self.frame[i]).abs() - a[i];
            own - (0..3).map(|j| turned[i][j] * b[j]).sum::<f64>() >= room
        }) || (0..3).any(|j| {
            let own = way.dot(&other.frame[j]).abs() - b[j];
            own - (0..3).map(|i| turned[i][j] * a[i]).sum::<f64>() >= room
        })
    }
}

/// A unit vector normal to a direction.
fn other_than(d: &Vector3<f64>) -> Vector3<f64> {
    let thin = if d.x.abs() < 0.6 * d.norm() { Vector3::x() } else { Vector3::y() };
    thin.cross(d).try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::x)
}

/// What of a strip's copies a sample of another strip can see.
pub struct Window<'a> {
    strip: &'a Strip,
    extent: &'a Extent,
    /// Fan of the sampled strip in this frame, mm.
    moved: [f64; 3],
    /// Square of the reach, with a margin.
    square: f64,
}

impl<'a> Window<'a> {
    /// Of the strip `b` for samples of `a`.
    pub fn new(a: &Extent, b: &'a Strip, extent: &'a Extent, reach: f64) -> Self {
        let fan = a.frame[1] * a.fan[0] + a.frame[0] * a.fan[1];
        let moved = extent.frame.map(|u| u.dot(&fan));
        Self { strip: b, extent, moved, square: reach * reach * (1.0 + MARGIN) + ROOM }
    }

    /// A point in the strip's frame, from its first end.
    pub fn see(&self, point: &Vector3<f64>) -> [f64; 3] {
        let way = point - self.strip.ends[0];
        self.extent.frame.map(|u| u.dot(&way))
    }

    /// How far a place along the axis is beyond its ends, those of no copy nearer, mm.
    fn beyond(&self, along: f64) -> f64 {
        (-along).max(along - self.extent.length) - self.extent.fan[1].abs()
    }

    /// Whether no copy of the sample is in reach of any copy of the strip.
    pub fn misses(&self, at: &[f64; 3]) -> bool {
        let moved = self.moved.map(f64::abs);
        let along = (self.beyond(at[0]) - moved[0]).max(0.0);
        let across = (at[1].abs() - self.extent.fan[0].abs() - moved[1]).max(0.0);
        let off = (at[2].abs() - moved[2]).max(0.0);
        along * along + across * across + off * off >= self.square
    }

    /// The strip's copies that may be in reach of the sample's copy at the place `xi` of its fan.
    pub fn copies(&self, at: &[f64; 3], xi: f64) -> Range<usize> {
        let [along, across, off]: [f64; 3] = std::array::from_fn(|c| at[c] + xi * self.moved[c]);
        let along = self.beyond(along).max(0.0);
        let left = self.square - along * along - off * off;
        if left <= 0.0 {
            return 0..0;
        }
        let (half, wide, count) = (left.sqrt(), self.extent.fan[0], self.strip.copies);
        if count < 2 || wide <= ROOM {
            return if across.abs() - wide.abs() < half { 0..count } else { 0..0 };
        }
        // Copy k lies at wide (2k/(count − 1) − 1).
        let place = |across: f64| 0.5 * (across / wide + 1.0) * (count - 1) as f64;
        let (low, high) = (place(across - half).floor(), place(across + half).ceil());
        // Saturating: below zero is zero.
        (low as usize)..((high + 1.0).max(0.0) as usize).min(count)
    }
}
