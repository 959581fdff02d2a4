//! Keyframes as CSV, JSON and a ROS 2 trajectory.

use crate::emit::motion::{Motion, identifier};
use crate::ir::{DriveUnit, MotorInterface};
use serde_json::{Value, json};
use std::fmt::Write;

fn unit(unit: DriveUnit) -> &'static str {
    match unit {
        DriveUnit::Rad => "deg",
        DriveUnit::Mm => "mm",
    }
}

/// Zero without a sign, and no more digits than are meant.
fn number(v: f64) -> f64 {
    let r = (v * 1e9).round() / 1e9;
    if r == 0.0 { 0.0 } else { r }
}

/// A row each sample: time, and each drive's value and shaft angle.
pub fn csv(motion: &Motion) -> String {
    let mut out = String::from("t_s");
    for a in &motion.axes {
        let _ = write!(out, ",{}_{}", a.name, unit(a.unit));
        if !a.shaft_mdeg.is_empty() {
            let _ = write!(out, ",{}.shaft_deg", a.name);
        }
    }
    out.push('\n');
    for k in 0..=motion.samples {
        let _ = write!(out, "{:?}", number(motion.dt_s() * k as f64));
        for a in &motion.axes {
            let _ = write!(out, ",{:?}", number(a.shown(a.values.get(k).copied().unwrap_or(f64::NAN))));
            if let Some(m) = a.shaft_mdeg.get(k) {
                let _ = write!(out, ",{:?}", f64::from(*m) / 1e3);
            }
        }
        out.push('\n');
    }
    out
}

/// Motors, keyframes and tables.
pub fn json(motion: &Motion) -> String {
    let drives: Vec<Value> = motion
        .axes
        .iter()
        .map(|a| {
            let peaks = motion.peaks(a);
            let interface = a.motor.as_ref().map(|m| match m.interface {
                MotorInterface::Stepper { .. } => "stepper",
                MotorInterface::Pwm { .. } => "pwm",
                MotorInterface::Dynamixel { .. } => "dynamixel",
            });
            let shaft = a.shaft_deg_a_unit();
            json!({
                "name": a.name,
                "unit": unit(a.unit),
                "motor": a.motor.as_ref().map(|m| &m.name),
                "interface": interface,
                "continuous": a.continuous,
                "drum_diameter_mm": a.drum_radius_mm.map(|r| 2.0 * r),
                "rest": number(a.shown(a.rest)),
                "shaft_deg_a_unit": shaft,
                "servo_deg_at_rest": a.servo_rest_rad().map(|r| number(r.to_degrees())),
                "largest_speed_deg_s": shaft.map(|_| number(peaks.speed_rad_s.to_degrees())),
                "values": a.values.iter().map(|v| number(a.shown(*v))).collect::<Vec<_>>(),
                "shaft_deg": a.shaft_mdeg.iter().map(|m| f64::from(*m) / 1e3).collect::<Vec<_>>(),
            })
        })
        .collect();
    let aims: Vec<Value> = motion
        .aims
        .iter()
        .map(|t| {
            let name = |axis: &usize| motion.axes.get(*axis).map(|a| a.name.clone());
            let outputs = t.wanted.iter().zip(&t.outputs).map(|((n, u), v)| json!({"name": n, "unit": u.shown(), "values": v}));
            let drives = t.axes.iter().zip(&t.shaft_mdeg).map(|(a, s)| {
                json!({"name": name(a), "shaft_deg": s.iter().map(|m| f64::from(*m) / 1e3).collect::<Vec<_>>()})
            });
            json!({
                "name": t.name,
                "region": t.region,
                "error": t.error,
                "resolution": t.resolution,
                "outputs": outputs.collect::<Vec<_>>(),
                "drives": drives.collect::<Vec<_>>(),
            })
        })
        .collect();
    let all = json!({
        "mechanism": motion.name,
        "duration_s": motion.duration_s,
        "closed": motion.closed,
        "times_s": (0..=motion.samples).map(|k| number(motion.dt_s() * k as f64)).collect::<Vec<_>>(),
        "drives": drives,
        "aims": aims,
    });
    let mut text = serde_json::to_string_pretty(&all).unwrap_or_default();
    text.push('\n');
    text
}

/// A `trajectory_msgs/JointTrajectory`: joint values in rad and m from the drawing pose, which is the joints' zero.
pub fn ros2(motion: &Motion) -> String {
    let mut out = format!(
        "# {}: trajectory_msgs/msg/JointTrajectory, one {}. Written by flexura.\n\
         # Positions are joint values from the pose that is drawn: rad, and m of what slides or is pulled in.\n\
         # WIRING AND CALIBRATION are your controllers': zero of a joint is the drawn pose. The part is printed, and its\n\
         # motors are fastened free of strain, at:\n",
        super::super::motion::comment(&motion.name),
        if motion.closed { "cycle" } else { "way; the cycle does not close and runs back and forth" },
    );
    for a in &motion.axes {
        let _ = writeln!(out, "#   {}: {:?}", identifier(&a.name), number(si(a.unit, a.rest)));
    }
    let names: Vec<String> = motion.axes.iter().map(|a| identifier(&a.name)).collect();
    let _ = writeln!(out, "joint_names: [{}]\npoints:", names.join(", "));
    let speed = |values: &[f64], k: usize, closed: bool| {
        let n = values.len().saturating_sub(1);
        let at = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
        let two = 2.0 * motion.dt_s();
        match k {
            _ if (1..n).contains(&k) => (at(k + 1) - at(k - 1)) / two,
            _ if closed && n > 0 => (at(1) - at(0) + at(n) - at(n - 1)) / two,
            // One that does not close begins and ends at rest.
            _ => 0.0,
        }
    };
    for k in 0..=motion.samples {
        let list = |of: &dyn Fn(&super::super::motion::Axis) -> f64| {
            let v = motion.axes.iter().map(|a| format!("{:?}", number(si(a.unit, of(a)))));
            v.collect::<Vec<_>>().join(", ")
        };
        let nanoseconds = (motion.dt_s() * k as f64 * 1e9).round() as u64;
        let _ = writeln!(
            out,
            "  - positions: [{}]\n    velocities: [{}]\n    time_from_start: {{sec: {}, nanosec: {}}}",
            list(&|a| a.values.get(k).copied().unwrap_or(f64::NAN)),
            list(&|a| speed(&a.values, k, motion.closed)),
            nanoseconds / 1_000_000_000,
            nanoseconds % 1_000_000_000,
        );
    }
    out
}

fn si(unit: DriveUnit, value: f64) -> f64 {
    match unit {
        DriveUnit::Rad => value,
        DriveUnit::Mm => value * 1e-3,
    }
}
