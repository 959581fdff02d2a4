//! Materials and servos of the standard library against the tables they come from.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Elaborated, Options, elaborate};
use flexura::ir::MotorInterface;
use std::collections::BTreeMap;

const ACTUATORS: &str = include_str!("reference/actuators.csv");
const MATERIALS: &str = include_str!("reference/materials.csv");

/// Cells of a line of CSV with quotes.
fn cells(line: &str) -> Vec<String> {
    let mut out = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => out.push(String::new()),
            c => out.last_mut().unwrap().push(c),
        }
    }
    out
}

fn rows(csv: &str) -> Vec<BTreeMap<String, String>> {
    let mut lines = csv.lines();
    let names = cells(lines.next().unwrap());
    lines.map(|l| names.iter().cloned().zip(cells(l)).collect()).collect()
}

fn run(material: &str, motor: &str, drive: &str) -> Elaborated {
    let text = format!(
        "use std.materials.{material}\nuse std.motors.{motor}\nuse std.processes.sls\nmechanism one {{
    point O = (0 mm, 0 mm)
    point A = (40 mm, 0 mm)
    ground base {{ O }}
    link arm {{ O, A }}
    hinge turn: base to arm at O
    material {material}
    print on sls
    cycle 10 steps
    drive turn {drive} with {motor}
}}\n"
    );
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    elaborate("main.mech", &files, &Options::default())
}

#[test]
fn servos_state_what_the_table_does() {
    // Name, row, column of the torque, largest angle.
    let all = [
        ("sg90", "SG90", "stall_Nm", 180.0),
        ("mg90s", "MG90S", "stall_Nm", 180.0),
        ("mg996r", "MG996R", "stall_Nm", 120.0),
        ("xl320", "XL-320", "stall_Nm", 300.0),
        ("xl330_m288", "XL330-M288-T", "stall_Nm_hi", 360.0),
        ("xl330_m077", "XL330-M077-T", "stall_Nm_hi", 360.0),
    ];
    let table = rows(ACTUATORS);
    assert_eq!(table.len(), all.len());
    for (name, row, column, range) in all {
        let row = table.iter().find(|r| r["name"] == row).unwrap();
        // The first number of a cell, in N·m: `0.52@5.0 / 0.60` is 0.52 at 5 V.
        let stall: f64 = row[column].split('@').next().unwrap().parse().unwrap();
        assert!(row["range_deg"].starts_with(&format!("{range}")), "{name}: {}", row["range_deg"]);
        let motor =
            run("rigur", name, "from 0 deg to 90 deg").design.unwrap().drives[0].motor.clone().unwrap();
        assert!((motor.stall_n_mm - 1000.0 * stall).abs() < 1e-9, "{name}: {} {stall}", motor.stall_n_mm);
        let (MotorInterface::Pwm { range_rad } | MotorInterface::Dynamixel { range_rad }) = motor.interface
        else {
            panic!("{name} is a servo");
        };
        assert!((range_rad.to_degrees() - range).abs() < 1e-9);
        let control = row["control"].starts_with("PWM");
        assert_eq!(matches!(motor.interface, MotorInterface::Pwm { .. }), control, "{name}");
        // Beyond its range only where it is said to turn without end.
        let beyond = format!("from 0 deg to {} deg", range + 1.0);
        let codes: Vec<String> =
            run("rigur", name, &beyond).diagnostics.iter().map(|d| d.code.to_string()).collect();
        assert_eq!(codes, ["E0410"], "{name}");
        let endless = run("rigur", name, &beyond).sources;
        let text = endless.files[0].text.replace(&format!("with {name}"), &format!("with {name} continuous"));
        let files = BTreeMap::from([("main.mech".to_string(), text)]);
        assert!(elaborate("main.mech", &files, &Options::default()).design.is_some(), "{name}");
    }
}

#[test]
fn materials_state_what_the_table_does() {
    let names = [
        "rigur",
        "pla",
        "petg",
        "pp",
        "pp_filament",
        "pa12_sls",
        "pa12_mjf",
        "tpu_95a",
        "pom",
        "ti6al4v",
        "spring_steel",
        "al7075",
    ];
    let table = rows(MATERIALS);
    assert_eq!(table.len(), names.len());
    for (name, row) in names.into_iter().zip(&table) {
        let number = |column: &str| row[column].parse::<f64>().unwrap();
        let m = run(name, "nema17", "from 0 deg to 90 deg").design.unwrap().material;
        let close = |ours: Option<f64>, theirs: f64, what: &str| {
            let ours = ours.unwrap_or_else(|| panic!("{name} states no {what}"));
            assert!((ours / theirs - 1.0).abs() < 1e-12, "{name}: {what} {ours} {theirs}");
        };
        close(Some(m.e_mpa), number("E_MPa"), "E");
        close(Some(m.nu), number("poisson"), "nu");
        close(m.density_g_mm3, number("density_g_cm3") * 1e-3, "density");
        close(m.strain_once, number("design_strain_once_pct") * 1e-2, "strain_once");
        close(m.strain_repeated, number("design_strain_repeated_pct") * 1e-2, "strain_repeated");
        // What the table calls a yield or proof stress is one; what it calls a strength is one.
        let kind = &row["strength_kind"];
        let yields = ["yield", "proof"].iter().any(|w| kind.contains(w)) && !kind.contains("no yield");
        close(if yields { m.yield_mpa } else { m.strength_mpa }, number("strength_MPa"), "strength");
    }
}
