//! `simulate`: one row a state, one column a quantity, the unit in the column's name.

use crate::ir::DriveUnit;
use std::fmt::Write;

/// A simulated cycle. Optional parts are absent as a whole: a rigid motion has no forces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionTable {
    /// Names of the drives with the unit of their values, in the order of [`MotionState::drives`].
    pub drives: Vec<(String, DriveUnit)>,
    /// Names of the traces, in the order of [`MotionState::traces_mm`].
    pub traces: Vec<String>,
    /// Names of the moving bodies, in the order of [`MotionState::poses`]; empty without `--poses`.
    pub bodies: Vec<String>,
    /// Whether the rows carry torque, energy and stress.
    pub has_forces: bool,
    /// Whether loads act, which have a potential.
    pub has_loads: bool,
    /// Further columns with their values: name with unit, one value a state.
    pub more: Vec<(String, Vec<f64>)>,
    /// The states in order.
    pub states: Vec<MotionState>,
}

/// One state of a simulated cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionState {
    /// Drive values relative to the drawing pose, rad or mm.
    pub drives: Vec<f64>,
    /// Traced points, mm.
    pub traces_mm: Vec<[f64; 3]>,
    /// Torque of each drive on its second body, N·mm; of a sliding one the force, N.
    pub drive_loads: Vec<f64>,
    /// Elastic energy, N·mm.
    pub energy_n_mm: f64,
    /// Potential of the loads relative to the rest pose, N·mm.
    pub load_potential_n_mm: f64,
    /// Largest von Mises stress over all rods, MPa.
    pub stress_max_mpa: f64,
    /// Translation t (mm) and rotation vector (rad), a body: x = t + R X with X in the rest pose.
    pub poses: Vec<([f64; 3], [f64; 3])>,
}

/// Writes the table as CSV with a header line. Numbers are shortest round-trip.
pub fn write_csv(table: &MotionTable) -> String {
    let mut out = String::new();
    for (i, name) in columns(table).iter().enumerate() {
        separate(&mut out, i);
        text(&mut out, name);
    }
    out.push('\n');
    for step in 0..table.states.len() {
        let _ = write!(out, "{step}");
        for value in values(table, step).into_iter().skip(1) {
            out.push(',');
            // Absent values stay empty: CSV has no not-a-number.
            if let Some(value) = value {
                let _ = write!(out, "{value:?}");
            }
        }
        out.push('\n');
    }
    out
}

/// Names of the columns, with their units. The first is `step`.
pub fn columns(table: &MotionTable) -> Vec<String> {
    let mut out = vec!["step".to_string()];
    out.extend(table.drives.iter().map(|(drive, unit)| match unit {
        DriveUnit::Rad => format!("drive.{drive}_deg"),
        DriveUnit::Mm => format!("drive.{drive}_mm"),
    }));
    for trace in &table.traces {
        out.extend(["x", "y", "z"].map(|axis| format!("trace.{trace}.{axis}_mm")));
    }
    if table.has_forces {
        out.extend(table.drives.iter().map(|(drive, unit)| match unit {
            DriveUnit::Rad => format!("torque.{drive}_n_mm"),
            DriveUnit::Mm => format!("force.{drive}_n"),
        }));
        out.extend(["energy_n_mm", "stress_max_mpa"].map(String::from));
        if table.has_loads {
            out.push("load_potential_n_mm".into());
        }
    }
    out.extend(table.more.iter().map(|(name, _)| name.clone()));
    for body in &table.bodies {
        let parts = ["tx_mm", "ty_mm", "tz_mm", "rx_rad", "ry_rad", "rz_rad"];
        out.extend(parts.map(|part| format!("pose.{body}.{part}")));
    }
    out
}

/// The row of a state, in the order of [`columns`]; `None` for what is absent or no finite number.
pub fn values(table: &MotionTable, step: usize) -> Vec<Option<f64>> {
    let nothing = MotionState::default();
    let state = table.states.get(step).unwrap_or(&nothing);
    let mut row = vec![step as f64];
    let at = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(f64::NAN);
    row.extend(table.drives.iter().enumerate().map(|(i, (_, unit))| match unit {
        DriveUnit::Rad => degrees(at(&state.drives, i)),
        DriveUnit::Mm => at(&state.drives, i),
    }));
    for i in 0..table.traces.len() {
        row.extend(state.traces_mm.get(i).copied().unwrap_or([f64::NAN; 3]));
    }
    if table.has_forces {
        row.extend((0..table.drives.len()).map(|i| at(&state.drive_loads, i)));
        row.extend([state.energy_n_mm, state.stress_max_mpa]);
        if table.has_loads {
            row.push(state.load_potential_n_mm);
        }
    }
    row.extend(table.more.iter().map(|(_, values)| at(values, step)));
    for i in 0..table.bodies.len() {
        let (translation, rotation) = state.poses.get(i).copied().unwrap_or(([f64::NAN; 3], [f64::NAN; 3]));
        row.extend(translation.into_iter().chain(rotation));
    }
    // −0 reads badly and means nothing here.
    row.into_iter().map(|v| v.is_finite().then_some(if v == 0.0 { 0.0 } else { v })).collect()
}

/// Degrees, without the last-digit noise of the conversion (1e-12° is far below any step).
fn degrees(rad: f64) -> f64 {
    (rad.to_degrees() * 1e12).round() / 1e12
}

fn separate(out: &mut String, column: usize) {
    if column > 0 {
        out.push(',');
    }
}

fn text(out: &mut String, name: &str) {
    // Names come from identifiers; anything else is quoted as CSV wants it.
    if name.contains([',', '"', '\n', '\r']) {
        let _ = write!(out, "\"{}\"", name.replace('"', "\"\""));
    } else {
        out.push_str(name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> MotionTable {
        MotionTable {
            drives: vec![("motor".into(), DriveUnit::Rad)],
            traces: vec!["tip".into()],
            bodies: vec!["coupler".into()],
            has_forces: true,
            has_loads: false,
            more: Vec::new(),
            states: vec![MotionState {
                drives: vec![30_f64.to_radians()],
                traces_mm: vec![[1.5, -0.0, 0.1]],
                drive_loads: vec![-2.25],
                energy_n_mm: 3.0,
                load_potential_n_mm: -5.0,
                stress_max_mpa: 1e-9,
                poses: vec![([1.0, 2.0, 3.0], [0.1, 0.2, f64::NAN])],
            }],
        }
    }

    #[test]
    fn columns_name_quantity_and_unit() {
        let text = write_csv(&table());
        let mut lines = text.lines();
        assert_eq!(
            lines.next(),
            Some(
                "step,drive.motor_deg,trace.tip.x_mm,trace.tip.y_mm,trace.tip.z_mm,torque.motor_n_mm,\
                 energy_n_mm,stress_max_mpa,pose.coupler.tx_mm,pose.coupler.ty_mm,pose.coupler.tz_mm,\
                 pose.coupler.rx_rad,pose.coupler.ry_rad,pose.coupler.rz_rad"
            )
        );
        assert_eq!(lines.next(), Some("0,30.0,1.5,0.0,0.1,-2.25,3.0,1e-9,1.0,2.0,3.0,0.1,0.2,"));
        assert_eq!(lines.next(), None);
    }

    #[test]
    fn a_sliding_drive_has_millimetres_and_newtons() {
        let sliding =
            MotionTable { drives: vec![("pull".into(), DriveUnit::Mm)], bodies: Vec::new(), ..table() };
        let names = columns(&sliding);
        assert_eq!((names[1].as_str(), names[5].as_str()), ("drive.pull_mm", "force.pull_n"));
        assert_eq!(values(&sliding, 0)[1], Some(30_f64.to_radians()));
        assert_eq!(values(&sliding, 0)[5], Some(-2.25));
    }

    #[test]
    fn further_columns_stand_before_the_poses() {
        let more = vec![("output.curl_deg".to_string(), vec![12.5])];
        let table = MotionTable { more, ..table() };
        let names = columns(&table);
        assert_eq!((names[8].as_str(), names[9].as_str()), ("output.curl_deg", "pose.coupler.tx_mm"));
        assert_eq!((values(&table, 0)[8], values(&table, 0)[9]), (Some(12.5), Some(1.0)));
    }

    #[test]
    fn a_rigid_motion_has_no_forces() {
        let rigid = MotionTable { has_forces: false, bodies: Vec::new(), ..table() };
        assert_eq!(
            write_csv(&rigid),
            "step,drive.motor_deg,trace.tip.x_mm,trace.tip.y_mm,trace.tip.z_mm\n0,30.0,1.5,0.0,0.1\n"
        );
    }
}
