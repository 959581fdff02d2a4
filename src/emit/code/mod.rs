//! Motor code and keyframes of one motion model: sketches for servos and bus servos, a MicroPython module, a C header,
//! tables, a ROS 2 trajectory. Steppers have a sketch of their own (`emit::arduino`).

mod context;
mod keyframes;

use super::motion::{Motion, identifier};
use super::template;
use context::Context;
pub use keyframes::{csv, json, ros2};

const TABLES: (&str, &str) = ("tables.h", include_str!("tables.h.jinja"));
const COMMANDS: (&str, &str) = ("commands.h", include_str!("commands.h.jinja"));

/// Bytes of an Uno's flash that are left for tables.
pub const UNO_TABLE_BYTES: usize = 20_000;

/// A sketch for PWM servos.
///
/// # Errors
/// A faulty template.
pub fn servo_sketch(motion: &Motion) -> Result<String, String> {
    let main = ("servo.ino", include_str!("servo.ino.jinja"));
    template::render(&[main, TABLES, COMMANDS], &Context::of(motion))
}

/// A sketch for Dynamixel servos.
///
/// # Errors
/// A faulty template.
pub fn dynamixel_sketch(motion: &Motion) -> Result<String, String> {
    let main = ("dynamixel.ino", include_str!("dynamixel.ino.jinja"));
    template::render(&[main, TABLES, COMMANDS], &Context::of(motion))
}

/// A C header, C99 and C++.
///
/// # Errors
/// A faulty template.
pub fn c_header(motion: &Motion) -> Result<String, String> {
    template::render(&[("motion.h", include_str!("motion.h.jinja")), TABLES], &Context::of(motion))
}

/// A MicroPython module.
///
/// # Errors
/// A faulty template.
pub fn micropython(motion: &Motion) -> Result<String, String> {
    template::render(&[("motion.py", include_str!("motion.py.jinja"))], &Context::of(motion))
}

/// Bytes of the tables that a sketch carries.
pub fn table_bytes(motion: &Motion) -> usize {
    let aims = motion.aims.iter().map(|t| {
        t.outputs.iter().map(Vec::len).sum::<usize>() + t.shaft_mdeg.iter().map(Vec::len).sum::<usize>()
    });
    4 * ((motion.samples + 1) * motion.axes.len() + aims.sum::<usize>())
}

/// Name of files: an identifier.
pub fn file_name(motion: &Motion) -> String {
    identifier(&motion.name)
}
