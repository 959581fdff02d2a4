//! What the templates see: every number already as it is to be written.

use crate::emit::motion::{AimTable, Axis, MDEG, Motion, comment, identifier};
use crate::ir::{DriveUnit, MotorInterface};
use serde::Serialize;

/// A move to a pose takes a servo at this part of its largest speed.
const MOVE_PART: f64 = 0.5;
/// Speed of such a move where the motor states none, degrees a second.
const USUAL_SPEED_DEG_S: f64 = 60.0;
/// Pulses of a servo that states none, us: what most take without running against their stops.
const USUAL_PULSES_US: [f64; 2] = [1000.0, 2000.0];
/// Numbers a line.
const A_LINE: usize = 10;

#[derive(Serialize)]
pub struct Context {
    name: String,
    upper: String,
    title: String,
    closed: bool,
    cycle_us: u64,
    samples: usize,
    steps: usize,
    axes: Vec<AxisContext>,
    rows: Vec<String>,
    aims: Vec<AimContext>,
}

#[derive(Serialize)]
struct AxisContext {
    index: usize,
    name: String,
    motor: String,
    unit: &'static str,
    least: String,
    most: String,
    rest: String,
    per: String,
    shafts: Vec<String>,
    cycle_mdeg: i64,
    move_mdeg_s: u64,
    top_deg_s: String,
    top_state: usize,
    limit_deg_s: String,
    between_deg: String,
    resolution_deg: String,
    continuous: bool,
    pulses_stated: bool,
    least_us: u32,
    most_us: u32,
    range_mdeg: i64,
    rest_mdeg: i64,
    range_ticks: u32,
    baud: u32,
    drum: String,
    stepper: bool,
    servo: bool,
    bus: bool,
}

#[derive(Serialize)]
struct AimContext {
    index: usize,
    name: String,
    upper: String,
    what: String,
    region: String,
    error: String,
    resolution: String,
    least: String,
    most: String,
    axes: Vec<usize>,
    one: bool,
    points: usize,
    rows: usize,
    columns: usize,
    outputs: Vec<Vec<String>>,
    shafts: Vec<Vec<String>>,
}

impl Context {
    pub fn of(motion: &Motion) -> Self {
        let name = identifier(&motion.name);
        let row = |k: usize| {
            let cells = motion.axes.iter().map(|a| a.shaft_mdeg.get(k).copied().unwrap_or(0).to_string());
            cells.collect::<Vec<_>>().join(", ")
        };
        let cells: Vec<String> = (0..=motion.samples).map(|k| format!("{{{}}},", row(k))).collect();
        let a_line = (A_LINE / motion.axes.len().max(1)).max(1);
        Self {
            upper: name.to_ascii_uppercase(),
            title: comment(&motion.name),
            closed: motion.closed,
            cycle_us: (motion.duration_s * 1e6).round() as u64,
            samples: motion.samples,
            steps: motion.steps,
            axes: motion.axes.iter().enumerate().map(|(i, a)| AxisContext::of(motion, i, a)).collect(),
            rows: cells.chunks(a_line).map(|c| c.join(" ")).collect(),
            aims: motion.aims.iter().enumerate().map(|(i, t)| AimContext::of(i, t)).collect(),
            name,
        }
    }
}

impl AxisContext {
    fn of(motion: &Motion, index: usize, axis: &Axis) -> Self {
        let motor = axis.motor.as_ref();
        let top = motion.peaks(axis);
        let speed = motor.and_then(|m| m.motion.speed_rad_s).map(f64::to_degrees);
        let pulses = motor.and_then(|m| m.motion.pulses_s).map(|p| p.map(|s| s * 1e6));
        let [least_us, most_us] = pulses.unwrap_or(USUAL_PULSES_US).map(|us| us.round() as u32);
        let mdeg = |rad: f64| (rad.to_degrees() * MDEG).round() as i64;
        let range = axis.range_rad().unwrap_or(0.0);
        let (low, high) =
            axis.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let cells: Vec<String> = axis.shaft_mdeg.iter().map(i32::to_string).collect();
        let is = |wanted: fn(&MotorInterface) -> bool| motor.is_some_and(|m| wanted(&m.interface));
        Self {
            index,
            name: comment(&axis.name),
            motor: motor.map_or("no motor".into(), |m| comment(&m.name)),
            unit: match axis.unit {
                DriveUnit::Rad => "deg",
                DriveUnit::Mm => "mm",
            },
            least: format!("{:.2}", axis.shown(low)),
            most: format!("{:.2}", axis.shown(high)),
            rest: float(axis.shown(axis.rest)),
            per: float(axis.shaft_deg_a_unit().unwrap_or(0.0)),
            shafts: cells.chunks(A_LINE).map(|c| format!("{},", c.join(", "))).collect(),
            cycle_mdeg: if motion.closed { axis.cycle_mdeg() } else { 0 },
            move_mdeg_s: (speed.map_or(USUAL_SPEED_DEG_S, |s| s * MOVE_PART) * MDEG).round().max(1.0) as u64,
            top_deg_s: format!("{:.0}", top.speed_rad_s.to_degrees()),
            top_state: top.speed_state,
            limit_deg_s: speed.map_or("not stated".into(), |s| format!("{s:.0}")),
            between_deg: format!("{:.3}", axis.between_rad.to_degrees()),
            resolution_deg: format!("{:.3}", axis.resolution_rad().to_degrees()),
            continuous: axis.continuous,
            pulses_stated: pulses.is_some(),
            least_us,
            most_us,
            range_mdeg: mdeg(range),
            rest_mdeg: mdeg(axis.servo_rest_rad().unwrap_or(0.0)),
            range_ticks: (range / axis.resolution_rad()).round() as u32,
            // What the makers set: an XL-320, which does not turn fully, comes with 1 Mbit/s, the others with 57600.
            baud: if mdeg(range) < 360_000 { 1_000_000 } else { 57_600 },
            drum: axis.drum_radius_mm.map_or(String::new(), |r| format!("{:.2}", 2.0 * r)),
            stepper: is(|i| matches!(i, MotorInterface::Stepper { .. })),
            servo: is(|i| matches!(i, MotorInterface::Pwm { .. })),
            bus: is(|i| matches!(i, MotorInterface::Dynamixel { .. })),
        }
    }
}

impl AimContext {
    fn of(index: usize, table: &AimTable) -> Self {
        let name = identifier(&table.name);
        let what: Vec<String> =
            table.wanted.iter().map(|(n, unit)| format!("{} ({})", comment(n), unit.shown())).collect();
        let lines = |cells: Vec<String>| -> Vec<String> {
            cells.chunks(A_LINE).map(|c| format!("{},", c.join(", "))).collect()
        };
        let unit = table.wanted.first().map_or("", |w| w.1.shown());
        let ends = |o: &Vec<f32>| {
            o.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)))
        };
        let ends: Vec<(f32, f32)> = table.outputs.iter().map(ends).collect();
        let shown = |which: fn(&(f32, f32)) -> f32| {
            ends.iter().map(|e| format!("{:.2}", which(e))).collect::<Vec<_>>().join(", ")
        };
        Self {
            index,
            upper: name.to_ascii_uppercase(),
            name,
            what: what.join(", "),
            region: comment(&table.region),
            error: format!("{} {unit}", up(table.error)),
            resolution: format!("{} {unit}", up(table.resolution)),
            least: shown(|e| e.0),
            most: shown(|e| e.1),
            axes: table.axes.clone(),
            one: table.axes.len() == 1,
            points: table.outputs.first().map_or(0, Vec::len),
            rows: table.shaft_mdeg.first().map_or(0, Vec::len),
            columns: table.shaft_mdeg.get(1).map_or(1, Vec::len),
            outputs: table
                .outputs
                .iter()
                .map(|o| lines(o.iter().map(|v| format!("{v:?}")).collect()))
                .collect(),
            shafts: table.shaft_mdeg.iter().map(|s| lines(s.iter().map(i32::to_string).collect())).collect(),
        }
    }
}

/// A number that C and Python read as one with a point.
fn float(v: f64) -> String {
    let clean = if v == 0.0 { 0.0 } else { v };
    format!("{:?}", clean as f32)
}

/// Rounded up to two digits.
pub fn up(v: f64) -> String {
    if v.is_nan() || v <= 0.0 {
        return "0".into();
    }
    let digits = (1.0 - v.log10().floor()).max(0.0);
    let scale = 10_f64.powf(digits);
    format!("{:.*}", digits as usize, (v * scale).ceil() / scale)
}
