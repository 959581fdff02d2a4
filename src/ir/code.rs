//! What code for motors is written of: kinds, data of motors, where outputs are aimed at.

use super::Origin;
use serde::{Deserialize, Serialize};

/// Kinds of motor code and keyframes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CodeKind {
    /// Arduino sketches, one for the servos, one for the bus, one for each stepper.
    Arduino,
    /// The sketch for the bus alone.
    Dynamixel,
    /// A MicroPython module.
    Micropython,
    /// A C header.
    C,
    /// Keyframes as a table.
    Csv,
    /// Keyframes, motors and tables as JSON.
    Json,
    /// A ROS 2 `JointTrajectory`.
    Ros2,
}

impl CodeKind {
    const ALL: [(&str, Self); 7] = [
        ("arduino", Self::Arduino),
        ("dynamixel", Self::Dynamixel),
        ("micropython", Self::Micropython),
        ("c", Self::C),
        ("csv", Self::Csv),
        ("json", Self::Json),
        ("ros2", Self::Ros2),
    ];

    /// The kind of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, kind)| *kind)
    }

    /// Whether it commands motors: what slides then needs a drum, and every drive a motor.
    pub fn needs_motors(self) -> bool {
        !matches!(self, Self::Csv | Self::Json | Self::Ros2)
    }
}

/// How a motor moves and is commanded, where it is stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotorMotion {
    /// Largest speed without load, rad/s.
    pub speed_rad_s: Option<f64>,
    /// Largest acceleration, rad/s².
    pub acceleration_rad_s2: Option<f64>,
    /// Smallest angle it tells apart, rad.
    pub resolution_rad: Option<f64>,
    /// Pulse widths of a servo at both ends of its range, s.
    pub pulses_s: Option<[f64; 2]>,
}

impl MotorMotion {
    /// Whether nothing is stated.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// `workspace NAME, … by DRIVE from A to B in N steps, …`: as many outputs as drives, one or two.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Workspace {
    /// What is aimed at.
    pub wanted: Vec<Wanted>,
    /// By which drives.
    pub stretches: Vec<Stretch>,
    /// The statement.
    pub origin: Origin,
}

/// A number of the moving mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wanted {
    /// An angle, by its index.
    Angle(usize),
    /// A coordinate of a traced point, in the mechanism's own axes.
    Place {
        /// Index into the traces.
        trace: usize,
        /// x, y or z.
        axis: usize,
    },
    /// A component of a traced direction, in the mechanism's own axes.
    Direction {
        /// Index into the directions.
        direction: usize,
        /// x, y or z.
        axis: usize,
    },
}

/// How far a drive goes in a workspace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Index into the drives.
    pub drive: usize,
    /// Drive value at one end, rad or mm.
    pub from: f64,
    /// At the other, rad or mm; larger.
    pub to: f64,
    /// Steps of the table.
    pub steps: usize,
}
