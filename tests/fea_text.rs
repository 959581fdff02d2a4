//! The finite-element cases of `tests/fea.rs` as designs: the same flexures as whole `.mech` texts, turned by a drive of
//! the compliant joint itself or by ordinary joints beside it, against the same reference rod and the same bands.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::rod::{Corrections, Rod, RodOptions};
use std::collections::BTreeMap;

const SHEAR: Corrections = Corrections { shear: true, width: false, warping: false, wagner: false };
const HINGE: &str = include_str!("fea/hinge.mech");
const PIVOT: &str = include_str!("fea/pivot.mech");
const CANTILEVER: &str = include_str!("loads/cantilever.mech");
/// As in `tests/fea.rs`.
const EDGES: usize = 80;
const ROD_TOLERANCE: f64 = 5e-3;

fn design(text: &str) -> Design {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let out = elaborate("main.mech", &files, &Options::default());
    assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:#?}", out.diagnostics);
    out.design.unwrap()
}

/// Torque, and displacements of the traces, by state; and the stress at half length on both sides of each leaf.
/// The rods are the reference's: with shear, which the plain ones of a design do not have.
fn run(text: &str, edges: usize) -> Vec<BTreeMap<String, f64>> {
    let design = design(text);
    let layout = Layout::new(&design, &solve_motion(&design, &[]).unwrap(), &[]);
    let mut model = Model::new(&design, &layout, &[], edges, false).unwrap();
    for rod in &mut model.rods {
        let options = RodOptions { corrections: SHEAR, ..*rod.rod.options() };
        rod.rod =
            Rod::with_options(rod.rod.parameters(), *rod.rod.material(), edges, options, false).unwrap();
    }
    let states = sweep(&model).unwrap().states;
    let names = ["ref", "face"];
    states
        .iter()
        .map(|s| {
            assert!(s.stable);
            let mut out = BTreeMap::from([("Mz".to_string(), s.drive_load(&model, 0))]);
            for (trace, name) in layout.traces.iter().zip(names) {
                let moved = s.state.poses[trace.body].point(&trace.rest) - trace.rest;
                out.insert(format!("u{name}_x"), moved.x);
                out.insert(format!("u{name}_y"), moved.y);
            }
            let leaves = if model.rods.len() == 1 { [""].as_slice() } else { ["_A", "_B"].as_slice() };
            for ((rod, strains), leaf) in model.rods.iter().zip(&s.strains).zip(leaves) {
                let stresses = rod.rod.stresses(strains);
                out.insert(format!("vm_mid_yp{leaf}"), stresses[edges / 2][0]);
                out.insert(format!("vm_mid_yn{leaf}"), stresses[edges / 2][16]);
            }
            out
        })
        .collect()
}

/// Rows of the finest mesh by angle in degrees.
fn finest(text: &str) -> BTreeMap<usize, BTreeMap<String, f64>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            let cells = names.iter().zip(line.split(','));
            let row: BTreeMap<String, f64> =
                cells.filter_map(|(n, v)| v.parse().ok().map(|v| ((*n).to_string(), v))).collect();
            (row["angle_deg"] as usize, row)
        })
        .collect()
}

/// Column, what finite elements over this rod may be, up to an angle: as in `tests/fea.rs`.
type Bands = &'static [(&'static str, f64, f64, usize)];

fn check(name: &str, text: &str, reference: &str, bands: Bands) {
    let (ours, reference) = (run(text, EDGES), finest(reference));
    for &(column, least, most, until) in bands {
        let mut worst = 0.0f64;
        for (angle, row) in &reference {
            let Some(mine) = ours.get(*angle).map(|s| s[column]) else { continue };
            if let Some(rod) = row.get(&format!("rod_{column}")) {
                let off = mine / rod - 1.0;
                worst = if off.abs() > worst.abs() { off } else { worst };
            }
            if *angle <= until {
                let ratio = row[column] / mine;
                assert!((least..=most).contains(&ratio), "{name}: {column} at {angle}°: FEA/rod {ratio}");
            }
        }
        println!("{name}: {column} off the reference rod by {:.3} %", 100.0 * worst);
        assert!(worst.abs() < ROD_TOLERANCE, "{name}: {column} {worst}");
    }
}

#[test]
fn a_hinge_that_is_free_to_shift() {
    check(
        "hinge, free",
        &HINGE.replace("NAME", "flex"),
        include_str!("reference/fea/case1_ellipse_hinge_free.csv"),
        &[
            ("Mz", 1.01, 1.07, 60),
            ("uref_x", 0.96, 1.04, 60),
            ("uref_y", 0.96, 1.04, 60),
            ("uface_x", 0.95, 1.05, 60),
            ("uface_y", 0.99, 1.01, 60),
            ("vm_mid_yp", 0.95, 1.05, 35),
            ("vm_mid_yn", 0.95, 1.05, 35),
        ],
    );
}

#[test]
fn a_hinge_about_a_fixed_axis() {
    check(
        "hinge, axis fixed",
        &HINGE.replace("//MOTOR", "hinge motor: wall to body at M").replace("NAME", "motor"),
        include_str!("reference/fea/case1_ellipse_hinge_axisfixed.csv"),
        &[("Mz", 0.94, 1.06, 30), ("vm_mid_yp", 0.95, 1.05, 15), ("vm_mid_yn", 0.95, 1.05, 15)],
    );
}

const PIVOT_BANDS: Bands = &[
    ("Mz", 1.01, 1.07, 30),
    ("uref_x", 0.96, 1.04, 30),
    ("uref_y", 0.96, 1.04, 30),
    ("vm_mid_yp_A", 0.99, 1.05, 30),
    ("vm_mid_yn_A", 0.99, 1.05, 30),
];

/// Two slides and a hinge let the body move in the plane only; the drive turns the hinge.
#[test]
fn a_pivot_in_the_plane() {
    let guided = "link across { O }
    link along { O }
    slider x: wall to across at O axis x
    slider y: across to along at O axis y
    hinge turn: along to body at O";
    check(
        "cross pivot, planar",
        &PIVOT.replace("//MOTOR", guided).replace("NAME", "turn"),
        include_str!("reference/fea/case3_cross_pivot_planar.csv"),
        PIVOT_BANDS,
    );
}

#[test]
fn a_pivot_in_space() {
    check(
        "cross pivot, free",
        &PIVOT.replace("NAME", "pivot"),
        include_str!("reference/fea/case3_cross_pivot_free.csv"),
        PIVOT_BANDS,
    );
}

/// A drive of a straight leaf, its tip free to shift, is a pure moment: EI θ/L, off by what a discrete rod is stiffer.
#[test]
fn a_drive_turns_a_compliant_joint() {
    let text = CANTILEVER.replace("//LOAD", "drive flex from -40 deg to 60 deg");
    let ours = run(&text, EDGES);
    for (step, state) in ours.iter().enumerate() {
        let angle = (-40.0 + 10.0 * step as f64).to_radians();
        let wanted = 188.4955592 * angle / 30.0;
        let stiffer = (angle / (EDGES - 1) as f64).powi(2) / 3.0;
        let off = state["Mz"] - wanted;
        assert!(off.abs() < 1.1 * stiffer * wanted.abs() + 1e-9, "{step}: {} {wanted}", state["Mz"]);
    }
}
