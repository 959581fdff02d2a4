//! `export arduino(DRIVE)`: a sketch that runs a stepper motor through the cycle, pulse by pulse.
//! All rounding happens here, once, on absolute positions: the sketch only counts.

use super::motion::comment;
use super::template;
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// Least time between two step pulses, µs. On a simulated 16 MHz Uno ten turns at this rate lose no pulse
/// and gather no delay (`tests/firmware.rs`).
pub const LEAST_PULSE_GAP_US: u32 = 50;
/// Longest cycle, µs: differences of the 32-bit microsecond clock must stay below half its range.
pub const LONGEST_CYCLE_US: u32 = 1_800_000_000;
/// Most intervals: the table takes 4 bytes a state and must fit the 32 KiB flash of an Uno beside the code.
pub const MOST_STATES: usize = 7000;
/// Farthest position from rest, microsteps: keeps every product in the sketch below 32 bits.
pub const FARTHEST_PULSES: i32 = 1 << 24;
/// Speed of a move to a pose, turns a second.
const MOVE_TURNS_PER_S: f64 = 0.25;
/// Acceleration where the motor states none, turns/s²: a common stepper with a small crank follows that.
const USUAL_TURNS_PER_S2: f64 = 4.0;
/// How far from whole turns a closed profile may be, turns (rounding of degrees to radians is 1e-16).
const CLOSED_TOLERANCE_TURNS: f64 = 1e-6;

/// What a sketch needs to know.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// Name of the mechanism.
    pub mechanism: String,
    /// Name of the drive.
    pub drive: String,
    /// Full steps a turn of the motor.
    pub steps_per_turn: u32,
    /// Microsteps a full step, as set on the driver.
    pub microsteps: u32,
    /// Drive value at states 0..=N relative to the rest pose, rad.
    pub angles_rad: Vec<f64>,
    /// Duration of the cycle (of one way, if it does not close), s.
    pub duration_s: f64,
    /// State N is state 0 whole turns later: the motor runs on. Otherwise it runs back and forth.
    pub closed: bool,
    /// Drive value in the rest pose, relative to the drawing pose, rad.
    pub rest_rad: f64,
    /// What the motor states of its acceleration, rad/s².
    pub acceleration_rad_s2: Option<f64>,
}

/// Why no sketch can be written.
#[derive(Clone, Debug, PartialEq)]
pub enum SketchError {
    /// Steps per turn or microsteps are zero or too many for 16 bits.
    Resolution,
    /// Fewer than one interval or more than [`MOST_STATES`].
    States {
        /// Number of intervals.
        states: usize,
    },
    /// A position does not fit, or an angle is not a number.
    Position {
        /// The state.
        state: usize,
    },
    /// Said to be closed, but first and last state are not whole turns apart.
    NotClosed,
    /// The cycle is empty or longer than [`LONGEST_CYCLE_US`].
    Duration {
        /// Its duration, s.
        duration_s: f64,
    },
    /// Pulses would follow faster than [`LEAST_PULSE_GAP_US`].
    TooFast {
        /// State at which the fastest interval begins.
        state: usize,
        /// Shortest duration the cycle could have, s.
        least_duration_s: f64,
    },
    /// The template could not be rendered: a fault of the template, never of the design.
    Template(String),
}

impl fmt::Display for SketchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Resolution => {
                write!(f, "steps per turn and microsteps must both lie between 1 and 65535")
            }
            Self::States { states } => {
                write!(f, "a cycle of {states} steps does not fit a sketch, which takes 1 to {MOST_STATES}")
            }
            Self::Position { state } => write!(
                f,
                "the motor's position at state {state} is more than {FARTHEST_PULSES} microsteps away"
            ),
            Self::NotClosed => write!(f, "first and last state are not whole turns apart"),
            Self::Duration { duration_s } => {
                write!(
                    f,
                    "a cycle of {duration_s} s is not between 1 ms and {} s",
                    LONGEST_CYCLE_US / 1_000_000
                )
            }
            Self::TooFast { state, least_duration_s } => write!(
                f,
                "after state {state} pulses would follow faster than every {LEAST_PULSE_GAP_US} us; \
                 the cycle needs at least {least_duration_s:.3} s"
            ),
            Self::Template(reason) => write!(f, "the sketch's template is faulty: {reason}"),
        }
    }
}

impl std::error::Error for SketchError {}

/// Whole microsteps at every state, and what follows from them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StepTable {
    /// Microsteps a turn.
    pub pulses_per_turn: u32,
    /// Position at states 0..=N from the rest pose, microsteps.
    pub targets: Vec<i32>,
    /// Duration of the cycle, µs.
    pub cycle_us: u32,
    /// The state nearest to the rest pose.
    pub start_state: usize,
    /// Most pulses between two neighbouring states.
    pub most_pulses: u32,
}

impl Sketch {
    /// Name of the sketch: of its folder and, with `.ino`, of its file, as the Arduino IDE wants it.
    pub fn name(&self) -> String {
        let name: String = format!("{}_{}", self.mechanism, self.drive)
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .take(63)
            .collect();
        name
    }

    /// Rounds the cycle to whole microsteps.
    ///
    /// # Errors
    /// When the cycle does not fit a sketch.
    pub fn table(&self) -> Result<StepTable, SketchError> {
        let fits = |n: u32| (1..=u32::from(u16::MAX)).contains(&n);
        if !fits(self.steps_per_turn) || !fits(self.microsteps) {
            return Err(SketchError::Resolution);
        }
        let pulses_per_turn =
            self.steps_per_turn.checked_mul(self.microsteps).ok_or(SketchError::Resolution)?;
        let states = self.angles_rad.len().saturating_sub(1);
        if states == 0 || states > MOST_STATES {
            return Err(SketchError::States { states });
        }
        let mut targets = Vec::with_capacity(states + 1);
        for (state, angle) in self.angles_rad.iter().enumerate() {
            targets.push(whole(angle / TAU * f64::from(pulses_per_turn), state)?);
        }
        if self.closed {
            self.close(&mut targets, pulses_per_turn)?;
        }
        let cycle_us = (self.duration_s * 1e6).round();
        if !(1e3..=f64::from(LONGEST_CYCLE_US)).contains(&cycle_us) {
            return Err(SketchError::Duration { duration_s: self.duration_s });
        }
        let cycle_us = cycle_us as u32;
        let (fastest, most_pulses) = targets
            .iter()
            .zip(targets.iter().skip(1))
            .map(|(a, b)| a.abs_diff(*b))
            .enumerate()
            .max_by_key(|(state, pulses)| (*pulses, usize::MAX - state))
            .unwrap_or((0, 0));
        let interval_us = u64::from(cycle_us) / states as u64;
        let least_interval_us = u64::from(LEAST_PULSE_GAP_US) * u64::from(most_pulses);
        if interval_us < least_interval_us {
            let least_duration_s = least_interval_us as f64 * states as f64 * 1e-6;
            return Err(SketchError::TooFast { state: fastest, least_duration_s });
        }
        let start_state =
            targets.iter().enumerate().min_by_key(|(_, t)| t.unsigned_abs()).map_or(0, |(state, _)| state);
        // On a closed cycle state N is state 0 whole turns on: start there instead.
        let start_state = if self.closed && start_state == states { 0 } else { start_state };
        Ok(StepTable { pulses_per_turn, targets, cycle_us, start_state, most_pulses })
    }

    /// Makes the last target exactly whole turns after the first.
    fn close(&self, targets: &mut [i32], pulses_per_turn: u32) -> Result<(), SketchError> {
        let (Some(first), Some(last)) = (self.angles_rad.first(), self.angles_rad.last()) else {
            return Err(SketchError::NotClosed);
        };
        let turns = (last - first) / TAU;
        if (turns - turns.round()).abs() > CLOSED_TOLERANCE_TURNS {
            return Err(SketchError::NotClosed);
        }
        let state = targets.len() - 1;
        let way = whole(turns.round() * f64::from(pulses_per_turn), state)?;
        let start = targets.first().copied().unwrap_or(0);
        if let Some(end) = targets.last_mut() {
            *end = start.checked_add(way).ok_or(SketchError::Position { state })?;
        }
        Ok(())
    }

    /// The sketch's text.
    ///
    /// # Errors
    /// When the cycle does not fit a sketch (see [`Sketch::table`]).
    pub fn render(&self) -> Result<String, SketchError> {
        let table = self.table()?;
        let main = ("sketch.ino", include_str!("sketch.ino.jinja"));
        template::render(&[main], &self.context(&table)).map_err(SketchError::Template)
    }

    fn context(&self, table: &StepTable) -> Context {
        let first = i64::from(table.targets.first().copied().unwrap_or(0));
        let last = i64::from(table.targets.last().copied().unwrap_or(0));
        let a_turn = f64::from(table.pulses_per_turn);
        let acceleration = self.acceleration_rad_s2.map_or(USUAL_TURNS_PER_S2, |a| a / TAU) * a_turn;
        let move_speed = (MOVE_TURNS_PER_S * a_turn).clamp(1.0, 1e6 / f64::from(LEAST_PULSE_GAP_US));
        // Until the clock of the cycle runs at full speed: so long that its fastest part is reached by this acceleration.
        let states = (table.targets.len() - 1) as f64;
        let top_speed = f64::from(table.most_pulses) * states / f64::from(table.cycle_us) * 1e6;
        let ramp_us = (top_speed / acceleration * 1e6).ceil().clamp(1.0, 60e6);
        // The last comma of an initialiser is allowed in C++, so every row may end with one.
        let rows = table
            .targets
            .chunks(8)
            .map(|row| row.iter().map(|t| format!("{t},")).collect::<Vec<_>>().join(" "))
            .collect();
        Context {
            title: comment(&self.mechanism),
            drive: comment(&self.drive),
            rest_deg: format!("{:.1}", self.rest_rad.to_degrees()),
            steps_per_turn: self.steps_per_turn,
            microsteps: self.microsteps,
            pulses_per_turn: table.pulses_per_turn,
            cycle_us: table.cycle_us,
            states: table.targets.len() - 1,
            start_state: table.start_state,
            acceleration: (acceleration.round().max(1.0)) as u32,
            move_speed: move_speed as u32,
            ramp_us: ramp_us as u32,
            top_speed: top_speed.ceil() as u32,
            most_pulses: table.most_pulses,
            least_gap_us: LEAST_PULSE_GAP_US,
            longest_us: LONGEST_CYCLE_US,
            rows,
            closed: self.closed,
            cycle_pulses: last - first,
            turns: (last - first) / i64::from(table.pulses_per_turn),
        }
    }
}

/// What the template sees.
#[derive(Serialize)]
struct Context {
    title: String,
    drive: String,
    rest_deg: String,
    steps_per_turn: u32,
    microsteps: u32,
    pulses_per_turn: u32,
    cycle_us: u32,
    states: usize,
    start_state: usize,
    acceleration: u32,
    move_speed: u32,
    ramp_us: u32,
    top_speed: u32,
    most_pulses: u32,
    least_gap_us: u32,
    longest_us: u32,
    rows: Vec<String>,
    closed: bool,
    cycle_pulses: i64,
    turns: i64,
}

/// Rounds to a whole number of microsteps.
fn whole(pulses: f64, state: usize) -> Result<i32, SketchError> {
    let rounded = pulses.round();
    if rounded.abs() <= f64::from(FARTHEST_PULSES) {
        Ok(rounded as i32)
    } else {
        Err(SketchError::Position { state })
    }
}

#[cfg(test)]
mod tests;
