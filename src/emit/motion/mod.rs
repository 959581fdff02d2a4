//! What motors do over a cycle, as every kind of motor code needs it: sampled shaft angles, checked against what the
//! motors can do, and tables by which outputs are aimed at. All rounding to whole units happens here, once.

mod aim;
mod limits;

pub use aim::{AimError, AimTable, Grid, GridAxis, OutputUnit};
pub use limits::{Limit, Peaks, Refusal};

use crate::ir::{DriveUnit, Motor, MotorInterface, Origin, Profile};
use std::f64::consts::TAU;

/// Units of the tables a degree: thousandths, finer than any motor here.
pub const MDEG: f64 = 1000.0;
/// Units a turn.
pub const MDEG_A_TURN: i64 = 360_000;
/// A motor that does not state its resolution is taken to tell this apart, rad (a servo's dead band of 5 us).
const USUAL_RESOLUTION_RAD: f64 = 0.5 / 180.0 * std::f64::consts::PI;
/// Samples a state of the cycle, at most.
const FINEST: usize = 8;
/// Most samples of a cycle.
pub const MOST_SAMPLES: usize = 4000;
/// Farthest angle from rest, thousandths of a degree: differences stay within 32 bits.
const FARTHEST_MDEG: f64 = 1e9;
/// How far from whole turns a closed profile may be, turns.
const CLOSED_TURNS: f64 = 1e-6;

/// Where a motor's values come from: a drive of one instance.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The design's profile, rad or mm.
    pub profile: Profile,
    /// The motor's value is this (1 or −1) times the design's.
    pub sign: f64,
    /// In which of the design's states the instance is at each of the assembly's; empty: the same.
    pub states: Vec<usize>,
}

impl Source {
    /// Value at t in 0..1 of a cycle of `steps` states. Where states are taken in another order, straight between them.
    fn value(&self, t: f64, steps: usize) -> f64 {
        if self.states.is_empty() {
            return self.sign * self.profile.value(t);
        }
        let at = |state: usize| {
            let own = self.states.get(state).copied().unwrap_or(state);
            self.sign * self.profile.value(own as f64 / steps as f64)
        };
        let scaled = t * steps as f64;
        let state = (scaled.floor() as usize).min(steps.saturating_sub(1));
        let share = scaled - state as f64;
        let a = at(state);
        if share == 0.0 { a } else { a + share * (at(state + 1) - a) }
    }
}

/// One motor over the cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// As the text has it: `servo`, `right.servo`.
    pub name: String,
    /// The motor; none for keyframes of what is moved by hand.
    pub motor: Option<Motor>,
    /// It turns without end.
    pub continuous: bool,
    /// Unit of the values.
    pub unit: DriveUnit,
    /// Radius of the drum that moves what slides, mm.
    pub drum_radius_mm: Option<f64>,
    /// Drive value in the rest pose, rad or mm.
    pub rest: f64,
    /// Drive value at every sample, rad or mm.
    pub values: Vec<f64>,
    /// Shaft angle from the rest pose at every sample, thousandths of a degree; empty without a motor on what slides.
    pub shaft_mdeg: Vec<i32>,
    /// Largest angle between straight lines from sample to sample and the profile, rad of the shaft.
    pub between_rad: f64,
    /// The first value is the last again, whole turns later.
    pub closed: bool,
    /// Its statement.
    pub origin: Origin,
}

impl Axis {
    /// Shaft angle for a drive value, from the rest pose, rad; none for what slides without a drum.
    pub fn shaft_rad(&self, value: f64) -> Option<f64> {
        let way = value - self.rest;
        match self.unit {
            DriveUnit::Rad => Some(way),
            DriveUnit::Mm => Some(way / self.drum_radius_mm?),
        }
    }

    /// Degrees of the shaft for one unit (degree or mm) of the drive.
    pub fn shaft_deg_a_unit(&self) -> Option<f64> {
        match self.unit {
            DriveUnit::Rad => Some(1.0),
            DriveUnit::Mm => Some((1.0 / self.drum_radius_mm?).to_degrees()),
        }
    }

    /// A value in the unit people write: degrees or mm.
    pub fn shown(&self, value: f64) -> f64 {
        match self.unit {
            DriveUnit::Rad => value.to_degrees(),
            DriveUnit::Mm => value,
        }
    }

    /// Smallest angle its motor tells apart, rad.
    pub fn resolution_rad(&self) -> f64 {
        let stated = self.motor.as_ref().and_then(|m| m.motion.resolution_rad);
        let stepper = self.motor.as_ref().and_then(|m| match m.interface {
            MotorInterface::Stepper { steps_per_turn, microsteps } => {
                Some(TAU / (f64::from(steps_per_turn) * f64::from(microsteps)))
            }
            _ => None,
        });
        stated.or(stepper).unwrap_or(USUAL_RESOLUTION_RAD)
    }

    /// The range of a servo, rad.
    pub fn range_rad(&self) -> Option<f64> {
        match self.motor.as_ref()?.interface {
            MotorInterface::Stepper { .. } => None,
            MotorInterface::Pwm { range_rad } | MotorInterface::Dynamixel { range_rad } => Some(range_rad),
        }
    }

    /// What a closed cycle adds to the shaft angle, thousandths of a degree: whole turns.
    pub fn cycle_mdeg(&self) -> i64 {
        match (self.closed, self.shaft_mdeg.first(), self.shaft_mdeg.last()) {
            (true, Some(a), Some(b)) => i64::from(*b) - i64::from(*a),
            _ => 0,
        }
    }

    /// Shaft angles of cycle and rest pose, least and largest, rad.
    pub fn span_rad(&self) -> (f64, f64) {
        let angles = self.shaft_mdeg.iter().map(|m| (f64::from(*m) / MDEG).to_radians());
        angles.fold((0.0, 0.0), |(l, h), a| (f64::min(l, a), f64::max(h, a)))
    }
}

/// All motors of a mechanism, or those that were asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Name of what is built.
    pub name: String,
    /// The motors.
    pub axes: Vec<Axis>,
    /// Samples a cycle: times are k / samples.
    pub samples: usize,
    /// States a cycle.
    pub steps: usize,
    /// Duration of the cycle (of one way, if it does not close), s.
    pub duration_s: f64,
    /// Every motor is at the end where it began: the cycle goes on. Otherwise it runs back and forth.
    pub closed: bool,
    /// Tables by which outputs are aimed at; their axes count in `axes`.
    pub aims: Vec<AimTable>,
}

/// A motor before it is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Raw {
    /// As it will be; values and angles are still empty.
    pub axis: Axis,
    /// Where its values come from.
    pub source: Source,
}

impl Motion {
    /// Samples the motors: as many times a state as it takes that straight lines between samples stay within half of
    /// what each motor tells apart.
    ///
    /// # Errors
    /// Where an angle is not a number, or a cycle too long for a table.
    pub fn sample(name: &str, raw: &[Raw], steps: usize, duration_s: f64) -> Result<Self, Refusal> {
        if steps == 0 || steps > MOST_SAMPLES {
            return Err(Refusal::Samples { steps });
        }
        let mut fine = 1;
        while fine < FINEST && steps * fine * 2 <= MOST_SAMPLES {
            if raw.iter().all(|r| between(r, steps, fine) <= r.axis.resolution_rad() / 2.0) {
                break;
            }
            fine *= 2;
        }
        let samples = steps * fine;
        let mut axes = Vec::new();
        for r in raw {
            axes.push(sampled(r, steps, samples)?);
        }
        let closed = axes.iter().all(|a| a.closed);
        // A motor that closes runs back and forth with the others.
        Ok(Self { name: name.into(), axes, samples, steps, duration_s, closed, aims: Vec::new() })
    }

    /// The same of some of its motors, with what can be aimed at by them.
    pub fn only(&self, which: &[usize]) -> Self {
        let axes: Vec<Axis> = which.iter().filter_map(|i| self.axes.get(*i).cloned()).collect();
        let place = |axis: &usize| which.iter().position(|w| w == axis);
        let aims = self.aims.iter().filter_map(|t| {
            let axes = t.axes.iter().map(place).collect::<Option<Vec<_>>>()?;
            Some(AimTable { axes, ..t.clone() })
        });
        let closed = axes.iter().all(|a| a.closed);
        Self { name: self.name.clone(), aims: aims.collect(), axes, closed, ..*self }
    }

    /// Seconds from sample to sample.
    pub fn dt_s(&self) -> f64 {
        self.duration_s / self.samples as f64
    }
}

/// A name that C, Python and YAML take: letters, digits and underscores, not beginning with a digit.
pub fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let name: String = name.chars().map(plain).take(63).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("m_{name}") }
}

/// Text that cannot end a comment or join it with the next line, whatever the user wrote.
pub fn comment(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || " _-.,()".contains(c);
    text.chars().take(80).map(|c| if plain(c) { c } else { '_' }).collect()
}

/// Largest shaft angle between straight lines and the profile, rad, at a quarter, half and three quarters.
fn between(raw: &Raw, steps: usize, fine: usize) -> f64 {
    let n = steps * fine;
    let value = |k: f64| raw.source.value(k / n as f64, steps);
    let per = raw.axis.shaft_deg_a_unit().unwrap_or(1.0);
    let scale = if raw.axis.unit == DriveUnit::Rad { 1.0 } else { per.to_radians() };
    let off = |k: usize| {
        let (a, b) = (value(k as f64), value((k + 1) as f64));
        let at = |s: f64| (value(k as f64 + s) - (a + s * (b - a))).abs();
        at(0.25).max(at(0.5)).max(at(0.75))
    };
    (0..n).map(off).fold(0.0, f64::max) * scale
}

fn sampled(raw: &Raw, steps: usize, samples: usize) -> Result<Axis, Refusal> {
    let mut axis = raw.axis.clone();
    axis.values = (0..=samples).map(|k| raw.source.value(k as f64 / samples as f64, steps)).collect();
    axis.between_rad = between(raw, steps, samples / steps.max(1));
    let (first, last) =
        (axis.values.first().copied().unwrap_or(f64::NAN), axis.values.last().copied().unwrap_or(f64::NAN));
    axis.closed = axis.unit.closes(last - first);
    if axis.shaft_deg_a_unit().is_none() {
        return Ok(axis);
    }
    let mut angles = Vec::with_capacity(samples + 1);
    for value in &axis.values {
        let mdeg = axis.shaft_rad(*value).map_or(f64::NAN, |a| (a.to_degrees() * MDEG).round());
        if mdeg.is_nan() || mdeg.abs() > FARTHEST_MDEG {
            return Err(Refusal::Position { axis: axis.name.clone(), origin: axis.origin });
        }
        angles.push(mdeg as i32);
    }
    if axis.closed {
        let turns = if axis.unit == DriveUnit::Rad { (last - first) / TAU } else { 0.0 };
        let start = angles.first().copied().unwrap_or(0);
        if let Some(end) = angles.last_mut()
            && (turns - turns.round()).abs() <= CLOSED_TURNS
        {
            *end = (i64::from(start) + turns.round() as i64 * MDEG_A_TURN) as i32;
        }
    }
    axis.shaft_mdeg = angles;
    Ok(axis)
}

#[cfg(test)]
mod tests;
