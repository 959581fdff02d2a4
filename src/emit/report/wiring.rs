//! How motors are wired, in words: what the sketches say in their heads, for those who look at the report.

use super::text::number;
use crate::ir::{self, DriveUnit, MotorInterface};

/// A motor as it is placed.
#[derive(Clone, Debug)]
pub struct Motor<'a> {
    /// Names of the drives that it moves, the first by which code calls it.
    pub drives: Vec<String>,
    /// Unit of its values.
    pub unit: DriveUnit,
    /// Drive value in the printed pose, rad or mm.
    pub rest: f64,
    /// Radius of its drum, mm.
    pub drum_radius_mm: Option<f64>,
    /// What it is.
    pub motor: &'a ir::Motor,
}

/// Notes on one motor.
#[derive(Clone, Debug, PartialEq)]
pub struct Wiring {
    /// What it drives.
    pub drives: String,
    /// The motor's name.
    pub motor: String,
    /// How it is commanded.
    pub interface: &'static str,
    /// What goes where.
    pub lines: Vec<String>,
}

impl Wiring {
    /// Of a motor.
    pub fn of(placed: &Motor<'_>) -> Self {
        let rest = match placed.unit {
            DriveUnit::Rad => format!("{} deg", number(placed.rest.to_degrees())),
            DriveUnit::Mm => format!("{} mm", number(placed.rest)),
        };
        let carrier = match placed.drum_radius_mm {
            Some(r) => format!("the drum of {} mm diameter", number(2.0 * r)),
            None => "the horn, or the driven part".into(),
        };
        let fasten = format!(
            "Take it to the printed pose, {rest}, hold the part so that nothing is bent, and fasten {carrier}."
        );
        let own = "Supply of its own that bears the stall current of all motors together; grounds joined. Never from the board's 5 V pin.";
        let (interface, lines) = match placed.motor.interface {
            MotorInterface::Stepper { steps_per_turn, microsteps } => (
                "stepper, step and direction",
                vec![
                    "Driver: STEP, DIR and EN to board pins 2, 3 and 4, its ground to the board's.".into(),
                    "Motor supply with at least 47 µF beside the driver; its current limit at the motor's rating.".into(),
                    format!("Microstep jumpers at 1/{microsteps} of {steps_per_turn} full steps a turn."),
                    fasten,
                ],
            ),
            MotorInterface::Pwm { range_rad } => (
                "servo, pulse width",
                vec![
                    "Signal (orange, yellow or white) to a board pin: 9 and 10 on an Uno or Nano for the first two.".into(),
                    "Red and brown to 5 V of their own with 470 µF beside the servos.".into(),
                    own.into(),
                    format!("Range {}°.", number(range_rad.to_degrees())),
                    fasten,
                ],
            ),
            MotorInterface::Dynamixel { range_rad } => (
                "servo on a Dynamixel bus",
                vec![
                    "Bus through a Dynamixel Shield or another half-duplex driver; direction on pin 2.".into(),
                    "An identity of its own for each, and one baud rate for all (DYNAMIXEL Wizard).".into(),
                    own.into(),
                    format!("Range {}°.", number(range_rad.to_degrees())),
                    fasten,
                ],
            ),
        };
        Self { drives: placed.drives.join(", "), motor: placed.motor.name.clone(), interface, lines }
    }
}
