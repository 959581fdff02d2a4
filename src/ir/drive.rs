//! Drives and their values over the cycle. Values are rad for a turning joint and mm for a sliding one, as
//! [`Drive::unit`] says, relative to the drawing pose.

use super::expr::{ExprGraph, ExprId};
use super::{JointId, Motor, Origin};
use serde::{Deserialize, Serialize};

/// A driven joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// Name: the joint's.
    pub name: String,
    /// The driven joint.
    pub joint: JointId,
    /// Unit of all its values.
    pub unit: DriveUnit,
    /// Value over the cycle, relative to the drawing pose, rad or mm.
    pub profile: Profile,
    /// Value in the rest pose at the start of the free variables, rad or mm.
    pub rest: f64,
    /// The same as an expression, where it depends on a free variable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_rest: Option<ExprId>,
    /// Motor, if stated.
    pub motor: Option<Motor>,
    /// The motor turns continuously.
    pub continuous: bool,
    /// Declaration.
    pub origin: Origin,
}

impl Drive {
    /// Value at t in 0..1, rad or mm.
    pub fn value(&self, t: f64) -> f64 {
        self.profile.value(t)
    }

    /// Value in the rest pose, rad or mm; `values` are those of all nodes of the design's graph.
    pub fn rest_value(&self, values: &[f64]) -> f64 {
        self.free_rest.map_or(self.rest, |id| values.get(id.0 as usize).copied().unwrap_or(f64::NAN))
    }

    /// Whether the drive is in the same pose at t = 0 and t = 1: for a turning one also whole turns later.
    pub fn is_closed(&self) -> bool {
        self.unit.closes(self.value(1.0) - self.value(0.0))
    }
}

/// A profile closes when its ends agree to this, turns or mm. Rounding of degrees to radians is 1e-16.
const CLOSED: f64 = 1e-9;

/// Unit of a drive's values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DriveUnit {
    /// An angle, rad.
    #[default]
    Rad,
    /// A length, mm.
    Mm,
}

impl DriveUnit {
    /// Whether a drive that has moved by `way` is in the same pose again.
    pub fn closes(self, way: f64) -> bool {
        let off = match self {
            DriveUnit::Rad => way / std::f64::consts::TAU - (way / std::f64::consts::TAU).round(),
            DriveUnit::Mm => way,
        };
        off.abs() < CLOSED
    }

    /// A value as people read it: `30.00 deg`, `5.00 mm`.
    pub fn show(self, value: f64) -> String {
        match self {
            DriveUnit::Rad => format!("{:.2} deg", value.to_degrees()),
            DriveUnit::Mm => format!("{value:.2} mm"),
        }
    }
}

/// A drive's value over the cycle, rad or mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// Linear from the first to the second.
    Range {
        /// At t = 0.
        from: f64,
        /// At t = 1.
        to: f64,
    },
    /// A function of t.
    Expression {
        /// Graph whose only variable, `Free(0)`, is t.
        graph: ExprGraph,
        /// The value.
        value: ExprId,
    },
    /// Through given values, straight or smooth between them.
    Keys {
        /// With continuous speed, and without going beyond neighbouring keys.
        smooth: bool,
        /// (t, value), t increasing from 0 to 1.
        keys: Vec<(f64, f64)>,
        /// The last key is the first again (whole turns later): smooth across it, else at rest there.
        closed: bool,
    },
}

impl Profile {
    /// Value at t in 0..1; NaN if an expression or the data have none.
    pub fn value(&self, t: f64) -> f64 {
        match self {
            Profile::Range { from, to } => from + (to - from) * t,
            Profile::Expression { graph, value } => {
                graph.values(&[t]).get(value.0 as usize).copied().unwrap_or(f64::NAN)
            }
            Profile::Keys { smooth, keys, closed } => between(keys, t, *smooth, *closed),
        }
    }
}

/// Value at t between keys: a line, or a cubic with the slopes of [`slope`].
fn between(keys: &[(f64, f64)], t: f64, smooth: bool, closed: bool) -> f64 {
    let last = keys.len().saturating_sub(2);
    let i = keys.iter().skip(1).position(|k| t <= k.0).unwrap_or(last);
    let (Some((t0, v0)), Some((t1, v1))) = (keys.get(i), keys.get(i + 1)) else {
        return keys.first().map_or(f64::NAN, |k| k.1);
    };
    let h = t1 - t0;
    let s = (t - t0) / h;
    if !smooth {
        return v0 + (v1 - v0) * s;
    }
    let (m0, m1) = (slope(keys, i, closed) * h, slope(keys, i + 1, closed) * h);
    let (s2, s3) = (s * s, s * s * s);
    v0 * (2.0 * s3 - 3.0 * s2 + 1.0) + m0 * (s3 - 2.0 * s2 + s) + v1 * (3.0 * s2 - 2.0 * s3) + m1 * (s3 - s2)
}

/// Slope at a key that keeps the cubic between neighbouring values: zero at an extreme, else the weighted harmonic
/// mean of the slopes on both sides (Fritsch and Butland 1984). At the ends of an open profile zero.
fn slope(keys: &[(f64, f64)], i: usize, closed: bool) -> f64 {
    let secant = |i: usize| match (keys.get(i), keys.get(i + 1)) {
        (Some(a), Some(b)) => (b.0 - a.0, (b.1 - a.1) / (b.0 - a.0)),
        _ => (1.0, 0.0),
    };
    let last = keys.len().saturating_sub(1);
    let ((h0, d0), (h1, d1)) = if i > 0 && i < last {
        (secant(i - 1), secant(i))
    } else if closed {
        (secant(last.saturating_sub(1)), secant(0))
    } else {
        return 0.0;
    };
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    3.0 * (h0 + h1) / ((2.0 * h1 + h0) / d0 + (h1 + 2.0 * h0) / d1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn keys(smooth: bool, closed: bool, keys: &[(f64, f64)]) -> Profile {
        Profile::Keys { smooth, keys: keys.to_vec(), closed }
    }

    #[test]
    fn keys_are_met_and_lines_are_straight() {
        let at = [(0.0, 0.0), (0.25, 35.0), (0.75, -35.0), (1.0, 0.0)];
        for profile in [keys(false, true, &at), keys(true, true, &at), keys(true, false, &at)] {
            for (t, v) in at {
                assert!((profile.value(t) - v).abs() < 1e-12);
            }
        }
        assert!((keys(false, true, &at).value(0.125) - 17.5).abs() < 1e-12);
        assert!((keys(false, true, &at).value(0.6) + 14.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn smooth_keys_have_one_slope_on_both_sides_and_stay_between_neighbours(
            values in prop::collection::vec(-50.0..50.0_f64, 3..8), closed in any::<bool>(),
        ) {
            let n = values.len() - 1;
            let mut at: Vec<(f64, f64)> =
                values.iter().enumerate().map(|(i, v)| ((i as f64 / n as f64).powf(1.3), *v)).collect();
            if closed {
                at[n].1 = at[0].1;
            }
            let profile = keys(true, closed, &at);
            let e = 1e-7;
            for (t, v) in at[1..n].iter().copied() {
                let left = (v - profile.value(t - e)) / e;
                let right = (profile.value(t + e) - v) / e;
                prop_assert!((left - right).abs() < 5e-2 * (1.0 + left.abs()), "{left} {right}");
            }
            let start = (profile.value(e) - at[0].1) / e;
            let end = (at[n].1 - profile.value(1.0 - e)) / e;
            let off = if closed { (start - end).abs() } else { start.abs() + end.abs() };
            prop_assert!(off < 1e-1 * (1.0 + if closed { start.abs() } else { 0.0 }), "{start} {end}");
            for pair in at.windows(2) {
                for k in 0..=20 {
                    let v = profile.value(pair[0].0 + (pair[1].0 - pair[0].0) * f64::from(k) / 20.0);
                    let (low, high) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
                    prop_assert!(v >= low - 1e-9 && v <= high + 1e-9, "{v} {low} {high}");
                }
            }
        }
    }
}
