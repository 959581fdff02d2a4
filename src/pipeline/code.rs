//! Motor code of an assembly: its motors as one motion, with the signs and orders that `assembly.rs` gives them, what can
//! be aimed at, and the artefacts that the exports ask for.

use super::reach::Reach;
use super::report::{Artefact, BuildOutcome};
use super::stages::Stages;
use crate::diagnostic::{Diagnostic, Origin};
use crate::emit::arduino::Sketch;
use crate::emit::code;
use crate::emit::motion::{Axis, Motion, Raw, Source};
use crate::ir::assembly::AssemblyExport;
use crate::ir::{Assembly, CodeKind, DriveUnit, ExportKind, MotorInterface};

/// Writes every export of motor code.
pub fn emit(assembly: &Assembly, values: &[Vec<f64>], stages: &dyn Stages, out: &mut BuildOutcome) {
    let mut reach = Reach::new(assembly, values, stages);
    for export in &assembly.exports {
        let Some((kind, motors)) = asked(assembly, export) else { continue };
        let at = export.export.origin;
        let raw: Option<Vec<Raw>> = motors.iter().map(|m| raw_axis(assembly, values, *m)).collect();
        let (Some(raw), Some((_, design))) = (raw, assembly.placed().next()) else { continue };
        let name = named(assembly, export);
        let sampled = Motion::sample(&name, &raw, design.cycle.steps, design.cycle.duration_s);
        let refused = match &sampled {
            Ok(motion) => motion.refusals(),
            Err(refusal) => vec![refusal.clone()],
        };
        for r in &refused {
            let (code, place) = r.code();
            let mut d = Diagnostic::error(code, r.to_string(), place.unwrap_or(at));
            if place.is_some() {
                d = d.also(at, "code is asked for here");
            }
            tell(out, d.help(r.help()));
        }
        let (Ok(mut motion), true) = (sampled, refused.is_empty()) else { continue };
        let (aims, found) = reach.tables(&motors, &motion);
        let failed = found.iter().any(Diagnostic::is_error);
        found.into_iter().for_each(|d| tell(out, d));
        if failed {
            continue;
        }
        motion.aims = aims;
        write(assembly, export, kind, &motors, &motion, out);
    }
}

fn tell(out: &mut BuildOutcome, d: Diagnostic) {
    if !out.diagnostics.contains(&d) {
        out.diagnostics.push(d);
    }
}

/// What kind of code an export asks for, and of which motors.
fn asked(assembly: &Assembly, export: &AssemblyExport) -> Option<(CodeKind, Vec<usize>)> {
    let (kind, drives) = match &export.export.kind {
        ExportKind::Arduino(drive) => (CodeKind::Arduino, vec![*drive]),
        ExportKind::Code(kind, drives) => (*kind, drives.clone()),
        _ => return None,
    };
    if !export.motors.is_empty() {
        return Some((kind, export.motors.clone()));
    }
    let Some(instance) = export.instance.and_then(|i| assembly.instances.get(i)) else {
        return Some((kind, (0..assembly.motors.len()).collect()));
    };
    let chosen = instance.drives.iter().enumerate().filter(|(k, _)| drives.is_empty() || drives.contains(k));
    let mut motors: Vec<usize> = chosen.map(|(_, d)| d.motor).collect();
    if !drives.is_empty() {
        // In the order written.
        motors = drives.iter().filter_map(|k| instance.drives.get(*k).map(|d| d.motor)).collect();
    }
    motors.dedup();
    Some((kind, motors))
}

/// Called after the assembly, an instance where the export is of one, and the drive where it is of one; of some instances
/// after each of them.
fn named(assembly: &Assembly, export: &AssemblyExport) -> String {
    let instance = export.instance.and_then(|i| assembly.instances.get(i));
    let mut parts = vec![assembly.name.clone()];
    parts.extend(instance.map(|i| plain(&i.name)).filter(|n| !n.is_empty()));
    if export.motors.len() < assembly.motors.len() {
        let motors = export.motors.iter().filter_map(|m| assembly.motors.get(*m));
        for name in motors.filter_map(|m| assembly.instances.get(m.instance)).map(|i| plain(&i.name)) {
            if !parts.contains(&name) {
                parts.push(name);
            }
        }
    }
    let only = match &export.export.kind {
        ExportKind::Arduino(drive) => Some(*drive),
        ExportKind::Code(_, drives) => drives.first().copied().filter(|_| drives.len() == 1),
        _ => None,
    };
    let design = instance.and_then(|i| assembly.designs.get(i.design));
    parts.extend(only.and_then(|d| Some(design?.drives.get(d)?.name.clone())));
    parts.join("_")
}

/// A motor by its first drive, in the motor's own sense.
fn raw_axis(assembly: &Assembly, values: &[Vec<f64>], motor: usize) -> Option<Raw> {
    let first = assembly.motors.get(motor)?;
    let instance = assembly.instances.get(first.instance)?;
    let design = assembly.designs.get(instance.design)?;
    let drive = design.drives.get(first.drive)?;
    let sign = instance.drives.get(first.drive)?.sign;
    let nodes = design.exprs.values(values.get(instance.design).map_or(&[], Vec::as_slice));
    let axis = Axis {
        name: instance.of(&drive.name),
        motor: drive.motor.clone(),
        continuous: drive.continuous,
        unit: drive.unit,
        drum_radius_mm: drive.drum_radius_mm,
        rest: sign * drive.rest_value(&nodes),
        values: Vec::new(),
        shaft_mdeg: Vec::new(),
        between_rad: 0.0,
        closed: false,
        origin: drive.origin,
    };
    let source = Source { profile: drive.profile.clone(), sign, states: instance.states.clone() };
    Some(Raw { axis, source })
}

fn write(
    assembly: &Assembly,
    export: &AssemblyExport,
    kind: CodeKind,
    motors: &[usize],
    motion: &Motion,
    out: &mut BuildOutcome,
) {
    let at = export.export.origin;
    if kind.needs_motors()
        && let Some(axis) = motion.axes.iter().find(|a| a.motor.is_none() || a.shaft_mdeg.is_empty())
    {
        let message = format!("`{}` has no motor to write code for", axis.name);
        let d = Diagnostic::error("E0724", message, axis.origin).also(at, "code is asked for here");
        return tell(out, d.help("write `drive … with sg90`, or name the drives that have one"));
    }
    let of = |wanted: fn(&MotorInterface) -> bool| -> Vec<usize> {
        let is = |a: &Axis| a.motor.as_ref().is_some_and(|m| wanted(&m.interface));
        motion.axes.iter().enumerate().filter(|(_, a)| is(a)).map(|(i, _)| i).collect()
    };
    let servos = of(|i| matches!(i, MotorInterface::Pwm { .. }));
    let bus = of(|i| matches!(i, MotorInterface::Dynamixel { .. }));
    let steppers = of(|i| matches!(i, MotorInterface::Stepper { .. }));
    let name = code::file_name(motion);
    match kind {
        CodeKind::Arduino => {
            let alone = |group: &[usize]| group.len() == motion.axes.len();
            if !servos.is_empty() {
                let name = if alone(&servos) { name.clone() } else { format!("{name}_servos") };
                sketch(&name, &motion.only(&servos), code::servo_sketch, at, out);
            }
            if !bus.is_empty() {
                let name = if alone(&bus) { name.clone() } else { format!("{name}_bus") };
                sketch(&name, &motion.only(&bus), code::dynamixel_sketch, at, out);
            }
            for axis in steppers {
                stepper(assembly, motors.get(axis).copied(), motion, axis, at, out);
            }
        }
        CodeKind::Dynamixel => {
            if let Some(other) =
                motion.axes.iter().enumerate().find(|(i, _)| !bus.contains(i)).map(|(_, a)| a)
            {
                let message = format!("the motor of `{}` is not on a Dynamixel bus", other.name);
                let d = Diagnostic::error("E0724", message, at).also(other.origin, "driven here");
                return tell(out, d.help("name the drives that are, or write `export arduino`"));
            }
            sketch(&name, motion, code::dynamixel_sketch, at, out);
        }
        CodeKind::Micropython => text(format!("{name}.py"), code::micropython(motion), at, out),
        CodeKind::C => text(format!("{name}_motion.h"), code::c_header(motion), at, out),
        CodeKind::Csv => text(format!("{name}_motion.csv"), Ok(code::csv(motion)), at, out),
        CodeKind::Json => text(format!("{name}_motion.json"), Ok(code::json(motion)), at, out),
        CodeKind::Ros2 => text(format!("{name}_trajectory.yaml"), Ok(code::ros2(motion)), at, out),
    }
}

fn sketch(
    name: &str,
    motion: &Motion,
    render: fn(&Motion) -> Result<String, String>,
    at: Origin,
    out: &mut BuildOutcome,
) {
    let bytes = code::table_bytes(motion);
    if bytes > code::UNO_TABLE_BYTES {
        let message = format!("the sketch's tables take {bytes} bytes, more than an Uno has room for");
        tell(
            out,
            Diagnostic::warning("W0727", message, at)
                .help("take a larger board, fewer steps in `cycle`, or fewer in `workspace`"),
        );
    }
    text(format!("{name}/{name}.ino"), render(motion), at, out);
}

/// The sketch of one stepper, which counts in its own steps.
fn stepper(
    assembly: &Assembly,
    motor: Option<usize>,
    motion: &Motion,
    axis: usize,
    at: Origin,
    out: &mut BuildOutcome,
) {
    let first = motor.and_then(|m| assembly.motors.get(m));
    let instance = first.and_then(|f| assembly.instances.get(f.instance));
    let (Some(axis), Some(first), Some(instance)) = (motion.axes.get(axis), first, instance) else { return };
    let Some(drive) = assembly.designs.get(instance.design).and_then(|d| d.drives.get(first.drive)) else {
        return;
    };
    let (Some(motor), fine) = (&axis.motor, motion.samples / motion.steps.max(1)) else { return };
    let MotorInterface::Stepper { steps_per_turn, microsteps } = motor.interface else { return };
    let alone = instance.name.is_empty();
    let sketch = Sketch {
        mechanism: if alone {
            assembly.name.clone()
        } else {
            format!("{}_{}", assembly.name, plain(&instance.name))
        },
        drive: drive.name.clone(),
        steps_per_turn,
        microsteps,
        angles_rad: axis.values.iter().step_by(fine.max(1)).filter_map(|v| axis.shaft_rad(*v)).collect(),
        duration_s: motion.duration_s,
        closed: axis.closed,
        // Of a drum the motor's own angle counts, which is zero at rest.
        rest_rad: if axis.unit == DriveUnit::Rad { axis.rest } else { 0.0 },
        acceleration_rad_s2: motor.motion.acceleration_rad_s2,
    };
    let name = sketch.name();
    text(format!("{name}/{name}.ino"), sketch.render().map_err(|e| e.to_string()), at, out);
}

/// `finger[2]` is no name for a file.
fn plain(name: &str) -> String {
    name.replace('[', "-").replace(']', "")
}

fn text(name: String, made: Result<String, String>, at: Origin, out: &mut BuildOutcome) {
    match made {
        Ok(_) if out.artefacts.iter().any(|a| a.name == name) => {}
        Ok(text) => out.artefacts.push(Artefact { name, bytes: text.into_bytes() }),
        Err(e) => tell(out, Diagnostic::error("E0720", format!("no sketch can be written: {e}"), at)),
    }
}
