//! Rods against three-dimensional finite elements of a straight elliptic hinge and of a cross pivot with
//! rectangular leaves (`reference/fea/`, CalculiX, C3D20R, E = 1500 MPa, ν = 0.4; the finest mesh of each
//! angle), and against the Simo–Reissner rod that was solved beside them (`rod_*` columns).
//!
//! `cargo test --test fea -- --nocapture` prints the tables of `docs/rod-model.md`.

#![allow(clippy::unwrap_used, clippy::panic)]

use flexura::math::{Pose, log_so3};
use flexura::rod::{
    Corrections, Rod, RodMaterial, RodModel, RodOptions, RodParameters, RodState, RodSystem, SectionShape,
};
use nalgebra::{SMatrix, SVector, Vector3};
use std::collections::BTreeMap;

const MATERIAL: RodMaterial = RodMaterial { e_mpa: 1500.0, nu: 0.4 };
const SHEAR: Corrections = Corrections { shear: true, width: false, warping: false, wagner: false };
/// Edges of each rod; even, so that a vertex lies at half length.
const EDGES: usize = 80;
/// Agreement with the reference rod.
const ROD_TOLERANCE: f64 = 5e-3;

/// Rows of the finest mesh by angle in degrees.
fn finest(text: &str) -> BTreeMap<u32, BTreeMap<String, f64>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    // Coarse to fine: later rows replace earlier ones.
    lines
        .map(|line| {
            let row: BTreeMap<String, f64> = names
                .iter()
                .zip(line.split(','))
                .filter_map(|(n, v)| v.parse().ok().map(|v| ((*n).to_string(), v)))
                .collect();
            (row["angle_deg"] as u32, row)
        })
        .collect()
}

/// A body held by rods from a fixed one.
struct Body {
    rods: Vec<(Rod, RodState, RodSystem)>,
    pose: Pose,
    force: SVector<f64, 6>,
}

fn straight(from: Vector3<f64>, to: Vector3<f64>, half: [f64; 2], options: RodOptions) -> Rod {
    let q = RodParameters::straight(from, to, Vector3::z(), half[0], half[1]);
    Rod::with_options(&q, MATERIAL, EDGES, options, false).unwrap()
}

impl Body {
    fn new(rods: Vec<Rod>, reference: Vector3<f64>) -> Self {
        let rods = rods.into_iter().map(|r| {
            let (state, system) = (r.rest_state(), RodSystem::new(&r));
            (r, state, system)
        });
        Self { rods: rods.collect(), pose: Pose::rest(reference), force: SVector::zeros() }
    }

    fn hinge(corrections: Corrections, reference: f64) -> Self {
        let options = RodOptions { corrections, ..RodOptions::default() };
        let rod = straight(Vector3::zeros(), Vector3::x() * 12.0, [0.4, 2.5], options);
        Self::new(vec![rod], Vector3::x() * reference)
    }

    fn pivot(corrections: Corrections) -> Self {
        let options = RodOptions { section: SectionShape::Rectangle, corrections, ..RodOptions::default() };
        let half = 10.0 / 2f64.sqrt();
        let leaf = |x: f64, z: f64| {
            let (from, to) = (Vector3::new(x, -half, z), Vector3::new(-x, half, z));
            straight(from, to, [0.4, 2.5], options)
        };
        Self::new(vec![leaf(-half, 3.0), leaf(half, -3.0)], Vector3::zeros())
    }

    /// Force and stiffness of the body in its six freedoms.
    fn condensed(&mut self) -> (SVector<f64, 6>, SMatrix<f64, 6, 6>) {
        let (mut g, mut h) = (SVector::zeros(), SMatrix::zeros());
        for (rod, state, system) in &mut self.rods {
            let ground = Pose::rest(Vector3::zeros());
            system.assemble(rod, state, &ground, &self.pose);
            let report = system.factor();
            assert!(report.positive_definite);
            let (rg, rh) = system.condense();
            g += rg.fixed_rows::<6>(6);
            h += rh.fixed_view::<6, 6>(6, 6);
        }
        (g, h)
    }

    /// Newton steps with the prescribed increment, then until balanced in the `free` freedoms.
    fn solve(&mut self, prescribed: &SVector<f64, 6>, free: [bool; 6]) {
        for iteration in 0..60 {
            let (mut g, mut h) = self.condensed();
            self.force = g;
            let mut residual = self.rods.iter().map(|r| r.2.internal_residual_norm()).fold(0.0, f64::max);
            let d = if iteration == 0 { *prescribed } else { SVector::zeros() };
            for (i, free) in free.into_iter().enumerate() {
                if free {
                    residual = residual.max(g[i].abs());
                    continue;
                }
                g += h.column(i) * d[i];
                h.row_mut(i).fill(0.0);
                h.column_mut(i).fill(0.0);
                (h[(i, i)], g[i]) = (1.0, -d[i]);
            }
            if iteration > 0 && residual < 1e-8 {
                return;
            }
            let step = h.lu().solve(&-g).unwrap();
            let pose = self.pose.retract(&step.fixed_rows::<3>(0).into(), &step.fixed_rows::<3>(3).into());
            for (rod, state, system) in &mut self.rods {
                let mut d = SVector::<f64, 12>::zeros();
                d.fixed_rows_mut::<6>(6).copy_from(&step);
                let increment = system.back_substitute(&d).to_vec();
                rod.retract(state, &increment, &Pose::rest(Vector3::zeros()), &pose).unwrap();
            }
            self.pose = pose;
        }
        panic!("no equilibrium");
    }

    /// Turns the body until the z component of its rotation vector is `angle`.
    fn turn_to(&mut self, angle: f64, free: [bool; 6]) {
        for _ in 0..20 {
            let missing = angle - log_so3(&self.pose.rotation).z;
            if missing.abs() < 1e-12 {
                return;
            }
            self.solve(&SVector::from([0.0, 0.0, 0.0, 0.0, 0.0, missing]), free);
        }
        panic!("the body does not turn");
    }

    /// Results under the names of the reference's columns.
    fn results(&self, pivot: bool) -> BTreeMap<String, f64> {
        let mut out = BTreeMap::new();
        for (i, name) in ["Fx", "Fy", "Fz", "Mx", "My", "Mz"].into_iter().enumerate() {
            out.insert(name.to_string(), self.force[i]);
        }
        let face = Vector3::x() * 12.0;
        let moved = self.pose.point(&face) - face;
        let rotation = log_so3(&self.pose.rotation);
        for (i, c) in ["x", "y", "z"].into_iter().enumerate() {
            out.insert(format!("uref_{c}"), self.pose.translation[i]);
            out.insert(format!("uface_{c}"), moved[i]);
            out.insert(format!("rot_{c}"), rotation[i]);
        }
        for ((rod, _, system), leaf) in self.rods.iter().zip(["_A", "_B"]) {
            let leaf = if pivot { leaf } else { "" };
            let strains = system.strains(rod);
            let stresses = rod.stresses(&strains);
            // Half length; points 0 and 16 lie at y = ±a. The largest is sought a thickness off the ends.
            out.insert(format!("vm_mid_yp{leaf}"), stresses[EDGES / 2][0]);
            out.insert(format!("vm_mid_yn{leaf}"), stresses[EDGES / 2][16]);
            let inside = |k: &usize| {
                let s = rod.station_position_mm(*k);
                s > 0.8 && s < rod.length_mm() - 0.8
            };
            let largest = (0..=EDGES).filter(inside).flat_map(|k| stresses[k]).fold(0.0, f64::max);
            out.insert(format!("vm_max{leaf}"), largest);
        }
        out
    }
}

/// One motion of the reference.
struct Case {
    name: &'static str,
    text: &'static str,
    pivot: bool,
    free: [bool; 6],
    /// Column, and what finite elements over this rod may be: (least, most) up to an angle in degrees.
    columns: &'static [(&'static str, f64, f64, u32)],
}

/// Bands that come with the reference (its README, section 5: stress at half length to 2 % strain). Where it
/// gives none, those of its own deviations of finite elements from the reference rod, widened by 1 %: the
/// pivot's stresses, and the largest stress of the hinge with fixed axis, which runs from +3.3 to −13.4 %.
const CASES: [Case; 4] = [
    Case {
        name: "hinge, free",
        text: include_str!("reference/fea/case1_ellipse_hinge_free.csv"),
        pivot: false,
        free: [true, true, true, false, false, false],
        columns: &[
            ("Mz", 1.01, 1.07, 60),
            ("uref_x", 0.96, 1.04, 60),
            ("uref_y", 0.96, 1.04, 60),
            ("uface_x", 0.95, 1.05, 60),
            ("uface_y", 0.99, 1.01, 60),
            ("vm_mid_yp", 0.95, 1.05, 35),
            ("vm_mid_yn", 0.95, 1.05, 35),
            ("vm_max", 0.95, 1.05, 35),
        ],
    },
    Case {
        name: "hinge, axis fixed",
        text: include_str!("reference/fea/case1_ellipse_hinge_axisfixed.csv"),
        pivot: false,
        free: [false; 6],
        columns: &[
            ("Mz", 0.94, 1.06, 30),
            ("Fx", 0.94, 1.06, 30),
            ("Fy", 0.94, 1.06, 30),
            ("vm_mid_yp", 0.95, 1.05, 15),
            ("vm_mid_yn", 0.95, 1.05, 15),
            ("vm_max", 0.85, 1.05, 60),
        ],
    },
    Case {
        name: "cross pivot, planar",
        text: include_str!("reference/fea/case3_cross_pivot_planar.csv"),
        pivot: true,
        free: [true, true, false, false, false, false],
        columns: &[
            ("Mz", 1.01, 1.07, 30),
            ("uref_x", 0.96, 1.04, 30),
            ("uref_y", 0.96, 1.04, 30),
            ("vm_mid_yp_A", 0.99, 1.05, 30),
            ("vm_mid_yn_A", 0.99, 1.05, 30),
            ("vm_max_A", 1.0, 1.2, 30),
            ("vm_max_B", 1.0, 1.2, 30),
        ],
    },
    Case {
        name: "cross pivot, free",
        text: include_str!("reference/fea/case3_cross_pivot_free.csv"),
        pivot: true,
        free: [true, true, true, true, true, false],
        columns: &[
            ("Mz", 1.01, 1.07, 30),
            ("uref_x", 0.96, 1.04, 30),
            ("uref_y", 0.96, 1.04, 30),
            ("vm_mid_yp_A", 0.99, 1.05, 30),
            ("vm_mid_yn_A", 0.99, 1.05, 30),
            ("vm_max_A", 1.0, 1.2, 30),
            ("vm_max_B", 1.0, 1.2, 30),
        ],
    },
];

impl Case {
    /// Results at every angle of the reference.
    fn run(&self, corrections: Corrections) -> BTreeMap<u32, BTreeMap<String, f64>> {
        let mut body = if self.pivot { Body::pivot(corrections) } else { Body::hinge(corrections, 6.0) };
        let mut out = BTreeMap::new();
        let mut degrees = 0;
        for angle in finest(self.text).into_keys() {
            while degrees < angle {
                degrees += 1;
                body.turn_to(f64::from(degrees).to_radians(), self.free);
            }
            out.insert(angle, body.results(self.pivot));
        }
        out
    }
}

/// Our sheared rod is the reference's.
#[test]
fn agrees_with_the_reference_rod() {
    for case in &CASES {
        let (ours, reference) = (case.run(SHEAR), finest(case.text));
        for (column, ..) in case.columns {
            let mut worst = (0.0, 0);
            for (angle, row) in &reference {
                let Some(want) = row.get(&format!("rod_{column}")) else { continue };
                let deviation = ours[angle][*column] / want - 1.0;
                if deviation.abs() > f64::abs(worst.0) {
                    worst = (deviation, *angle);
                }
            }
            println!("{}: {column} off by {:.3} % at {}°", case.name, 100.0 * worst.0, worst.1);
            assert!(worst.0.abs() < ROD_TOLERANCE, "{}: {column} {worst:?}", case.name);
        }
    }
}

/// Finite elements over the sheared rod stay in the band where rod theory is known to be.
#[test]
fn finite_elements_are_within_the_bands() {
    for case in &CASES {
        let (ours, reference) = (case.run(SHEAR), finest(case.text));
        for &(column, least, most, until) in case.columns {
            for (angle, row) in reference.iter().filter(|(a, _)| **a <= until) {
                let ratio = row[column] / ours[angle][column];
                let inside = (least..=most).contains(&ratio);
                assert!(inside, "{}: {column} at {angle}°: FEA/rod {ratio}", case.name);
            }
        }
    }
}

/// Entries of the compliance at rest: (body, response, load, finite elements, reference rod).
fn rest_rows() -> Vec<(String, usize, usize, f64, f64)> {
    let index = |name: &str, names: [&str; 6]| names.into_iter().position(|n| name == n).unwrap();
    include_str!("reference/fea/rest_compliance.csv")
        .lines()
        .skip(1)
        .map(|line| {
            let f: Vec<&str> = line.split(',').collect();
            let response = index(f[2], ["ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad"]);
            let load = index(f[3], ["Fx_N", "Fy_N", "Fz_N", "Mx_Nmm", "My_Nmm", "Mz_Nmm"]);
            (f[0].to_string(), response, load, f[6].parse().unwrap(), f[7].parse().unwrap())
        })
        .collect()
}

fn rest_compliance(body: &str, corrections: Corrections) -> SMatrix<f64, 6, 6> {
    let mut body = if body == "cross" { Body::pivot(corrections) } else { Body::hinge(corrections, 12.0) };
    body.condensed().1.try_inverse().unwrap()
}

const DIRECTIONS: [&str; 6] = ["x", "y", "z", "about x", "about y", "about z"];

/// Compliance of the body at rest: ours against the reference rod, and finite elements against ours: bending in
/// plane 5 %, out of plane and axial 3 %, torsion of the short hinge 10 to 20 % (it is warping that is hindered).
#[test]
fn compliance_at_rest() {
    println!("| compliance at rest | reference rod | FEA | plain | with shear | corrected |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (name, i, j, fea, rod) in rest_rows() {
        let [plain, shear, corrected] = [Corrections::default(), SHEAR, RodModel::Corrected.corrections()]
            .map(|c| rest_compliance(&name, c)[(i, j)]);
        let percent = |x: f64| 100.0 * (x / fea - 1.0);
        println!(
            "| {name}: {} by {} | {rod:.4e} | {fea:.4e} | {:+.2} % | {:+.2} % | {:+.2} % |",
            DIRECTIONS[i],
            DIRECTIONS[j],
            percent(plain),
            percent(shear),
            percent(corrected)
        );
        assert!((shear / rod - 1.0).abs() < ROD_TOLERANCE, "{name} {i} {j}: {shear} {rod}");
        let ratio = fea / shear;
        let in_plane = |k: usize| k == 1 || k == 5;
        let (least, most) = match (name.as_str(), i, j) {
            ("ell12", 3, 3) => (0.8, 0.9),
            (_, i, j) if in_plane(i) && in_plane(j) => (0.94, 1.0),
            _ => (0.97, 1.01),
        };
        assert!((least..=most).contains(&ratio), "{name} {i} {j}: {ratio}");
    }
}

/// Deviation from finite elements over the angles: root mean square, and the largest with its sign.
fn deviations(
    run: &BTreeMap<u32, BTreeMap<String, f64>>,
    reference: &BTreeMap<u32, BTreeMap<String, f64>>,
    column: &str,
) -> [f64; 2] {
    let percent: Vec<f64> =
        reference.iter().map(|(angle, row)| 100.0 * (run[angle][column] / row[column] - 1.0)).collect();
    let rms = (percent.iter().map(|d| d * d).sum::<f64>() / percent.len() as f64).sqrt();
    [rms, percent.iter().fold(0.0, |m: f64, d| if d.abs() > m.abs() { *d } else { m })]
}

/// The corrections must bring closer to finite elements what they were made for; the table says what else.
#[test]
fn corrected_against_plain() {
    println!("| rms (largest) deviation from FEA over the angles | plain | with shear | corrected |");
    println!("| --- | --- | --- | --- |");
    for case in &CASES {
        let reference = finest(case.text);
        let runs = [Corrections::default(), SHEAR, RodModel::Corrected.corrections()].map(|c| case.run(c));
        for &(column, ..) in case.columns {
            let all = runs.each_ref().map(|run| deviations(run, &reference, column));
            let cells = all.map(|[rms, largest]| format!("{rms:.2} ({largest:+.2}) % | "));
            println!("| {}: {column} | {}", case.name, cells.concat().trim_end());
            let [plain, _, corrected] = all;
            if column == "Mz" && case.free[0] {
                assert!(corrected[0] < 0.5 * plain[0], "{}: {all:?}", case.name);
            }
        }
    }
}
