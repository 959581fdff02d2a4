//! Whether motors can do what a cycle asks of them.

use super::{Axis, Motion};
use crate::ir::{DriveUnit, MotorInterface, Origin};
use std::fmt;

/// What is beyond a limit by no more than this part of it is rounding.
const WITHIN: f64 = 1e-6;

/// Largest speed and acceleration of a motor over the cycle, and at which state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// rad/s of the shaft.
    pub speed_rad_s: f64,
    /// The state after which it is that fast.
    pub speed_state: usize,
    /// rad/s² of the shaft.
    pub acceleration_rad_s2: f64,
    /// The state at which.
    pub acceleration_state: usize,
}

/// A limit of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// deg/s.
    Speed,
    /// deg/s².
    Acceleration,
    /// deg.
    Range,
}

/// Why there is no code.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// More states than a table takes.
    Samples {
        /// How many.
        steps: usize,
    },
    /// An angle that is not a number, or too large.
    Position {
        /// The drive.
        axis: String,
        /// Its statement.
        origin: Origin,
    },
    /// More than the motor does.
    Beyond {
        /// Of what.
        limit: Limit,
        /// The drive.
        axis: String,
        /// Its motor.
        motor: String,
        /// Largest value that is asked for, deg, deg/s or deg/s².
        asked: f64,
        /// What the motor does.
        can: f64,
        /// At which state.
        state: usize,
        /// Duration of the cycle at which it could, s.
        least_duration_s: Option<f64>,
        /// The drive's statement.
        origin: Origin,
    },
    /// A servo with a range of its own cannot turn without end.
    Endless {
        /// The drive.
        axis: String,
        /// Its motor.
        motor: String,
        /// The drive's statement.
        origin: Origin,
    },
}

impl Refusal {
    /// Its code, and the statement it is about.
    pub fn code(&self) -> (&'static str, Option<Origin>) {
        match self {
            Self::Samples { .. } => ("E0724", None),
            Self::Position { origin, .. } | Self::Endless { origin, .. } => ("E0724", Some(*origin)),
            Self::Beyond { limit, origin, .. } => {
                let code = match limit {
                    Limit::Speed => "E0721",
                    Limit::Acceleration => "E0722",
                    Limit::Range => "E0723",
                };
                (code, Some(*origin))
            }
        }
    }

    /// What to do.
    pub fn help(&self) -> String {
        match self {
            Self::Samples { .. } => "write fewer steps".into(),
            Self::Position { .. } => "let the drive move less".into(),
            Self::Beyond { least_duration_s: Some(s), .. } => {
                let up = (s * 100.0).ceil() / 100.0;
                format!("let the cycle last at least {up} s, or take a faster motor")
            }
            Self::Beyond { .. } => {
                "a servo goes from its rest pose to every other: let the drive move less, rest within the motion, \
                 or take a motor of more range"
                    .into()
            }
            Self::Endless { .. } => "take a stepper, or a bus servo that turns fully".into(),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples { steps } => {
                write!(
                    f,
                    "a cycle of {steps} steps does not fit a table, which takes {}",
                    super::MOST_SAMPLES
                )
            }
            Self::Position { axis, .. } => write!(f, "`{axis}` goes where no table follows"),
            Self::Beyond { limit, axis, motor, asked, can, state, .. } => match limit {
                Limit::Speed => write!(
                    f,
                    "`{axis}` would have to turn at {asked:.0} deg/s after state {state}; `{motor}` does {can:.0} deg/s"
                ),
                Limit::Acceleration => write!(
                    f,
                    "`{axis}` would have to gain {asked:.0} deg/s^2 at state {state}; `{motor}` does {can:.0} deg/s^2"
                ),
                Limit::Range => {
                    write!(f, "`{axis}` turns {asked:.1} deg with its rest pose; `{motor}` does {can:.1} deg")
                }
            },
            Self::Endless { axis, motor, .. } => {
                write!(f, "`{motor}` has no position beyond its range, and `{axis}` turns on without end")
            }
        }
    }
}

impl std::error::Error for Refusal {}

impl Motion {
    /// Largest speed and acceleration of a motor, from the samples. A cycle that does not close stands still where it
    /// turns back, which the first and last differences show.
    pub fn peaks(&self, axis: &Axis) -> Peaks {
        let per = match axis.unit {
            DriveUnit::Rad => 1.0,
            DriveUnit::Mm => axis.drum_radius_mm.map_or(0.0, |r| 1.0 / r),
        };
        let dt = self.dt_s();
        let speeds: Vec<f64> = axis.values.windows(2).map(|w| (w[1] - w[0]) * per / dt).collect();
        let state = |k: usize| k * self.steps / self.samples.max(1);
        let mut out = Peaks::default();
        for (k, v) in speeds.iter().enumerate() {
            if v.abs() > out.speed_rad_s {
                (out.speed_rad_s, out.speed_state) = (v.abs(), state(k));
            }
        }
        let n = speeds.len();
        for (k, v) in speeds.iter().enumerate() {
            let before = match k {
                0 if self.closed => speeds.get(n.saturating_sub(1)).copied().unwrap_or(0.0),
                // It turns back: the same way in and out.
                0 => -v,
                _ => speeds.get(k - 1).copied().unwrap_or(0.0),
            };
            let a = (v - before).abs() / dt;
            if a > out.acceleration_rad_s2 {
                (out.acceleration_rad_s2, out.acceleration_state) = (a, state(k));
            }
        }
        out
    }

    /// Checks every motor against its data.
    pub fn refusals(&self) -> Vec<Refusal> {
        self.axes.iter().flat_map(|axis| self.refused(axis)).collect()
    }

    fn refused(&self, axis: &Axis) -> Vec<Refusal> {
        let Some(motor) = &axis.motor else { return Vec::new() };
        let peaks = self.peaks(axis);
        let mut out = Vec::new();
        let mut beyond = |limit, asked: f64, can: f64, state, least_duration_s| {
            if asked > can * (1.0 + WITHIN) {
                out.push(Refusal::Beyond {
                    limit,
                    axis: axis.name.clone(),
                    motor: motor.name.clone(),
                    asked: asked.to_degrees(),
                    can: can.to_degrees(),
                    state,
                    least_duration_s,
                    origin: axis.origin,
                });
            }
        };
        if let Some(can) = motor.motion.speed_rad_s {
            let least = self.duration_s * peaks.speed_rad_s / can;
            beyond(Limit::Speed, peaks.speed_rad_s, can, peaks.speed_state, Some(least));
        }
        if let Some(can) = motor.motion.acceleration_rad_s2 {
            let least = self.duration_s * (peaks.acceleration_rad_s2 / can).sqrt();
            beyond(
                Limit::Acceleration,
                peaks.acceleration_rad_s2,
                can,
                peaks.acceleration_state,
                Some(least),
            );
        }
        if let (Some(range), false) = (axis.range_rad(), axis.continuous) {
            let (low, high) = axis.span_rad();
            beyond(Limit::Range, high - low, range, 0, None);
        }
        let full = |range: f64| range >= std::f64::consts::TAU * (1.0 - WITHIN);
        let turns = match motor.interface {
            MotorInterface::Stepper { .. } => true,
            MotorInterface::Pwm { .. } => false,
            MotorInterface::Dynamixel { range_rad } => full(range_rad),
        };
        if axis.continuous && !turns {
            out.push(Refusal::Endless {
                axis: axis.name.clone(),
                motor: motor.name.clone(),
                origin: axis.origin,
            });
        }
        out
    }
}

impl Axis {
    /// The servo's own angle in the rest pose, from the end of its range at which its value is least, rad: the middle,
    /// or as near to it as the motion allows.
    pub fn servo_rest_rad(&self) -> Option<f64> {
        let range = self.range_rad()?;
        let (low, high) = self.span_rad();
        Some((range / 2.0).min(range - high).max(-low))
    }
}
