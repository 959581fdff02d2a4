//! Strings: the conventional finger against its reference, tension against energy, derivatives, slack.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, sweep};
use flexura::ir::{Design, Objective, ObjectiveKind};
use flexura::kinematics::solve_motion;
use flexura::optimize::Problem;
use flexura::pipeline::{Compiler, Request, Show, simulate};
use std::collections::BTreeMap;

mod common;

const REFERENCE: &str = include_str!("reference/motion/hand.csv");
const EDGES: usize = 12;
/// Agreement with the reference, which is written to 1e-9 mm.
const PATH_MM: f64 = 1e-6;

const FINGER: &str = include_str!("strings/finger.mech");

/// The finger, its knuckles as flexures, pulled by 3 mm: at their start values they snap at 4.3 mm.
fn finger() -> String {
    assert_eq!(FINGER.matches("//AS").count(), 3);
    FINGER.replace("//AS", "as crossed_leaves").replace("to 5 mm", "to 3 mm")
}

fn files(text: &str) -> BTreeMap<String, String> {
    BTreeMap::from([("main.mech".to_string(), text.to_string())])
}

fn design(text: &str, steps: usize) -> Design {
    let options = Options { steps: Some(steps), ..Options::default() };
    let found = elaborate("main.mech", &files(text), &options);
    assert_eq!(found.diagnostics, [], "{text}");
    found.design.unwrap()
}

fn layout(design: &Design) -> Layout {
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    Layout::new(design, &solve_motion(design, &p).unwrap(), &p)
}

#[test]
fn the_pulled_finger_moves_as_the_reference() {
    let text = FINGER.replace("use std.flexures.crossed_leaves\n", "");
    let design = design(&text, 50);
    let motion = solve_motion(&design, &[]).unwrap();
    let (_, rows) = common::table(REFERENCE);
    assert_eq!(rows.len(), motion.states.len());
    let mut worst = 0.0f64;
    for (row, state) in rows.iter().zip(&motion.states) {
        assert!((state.drives[0] - row[0]).abs() < 1e-12);
        for c in 0..3 {
            worst = worst.max((state.traces_mm[0][c] - row[1 + c]).abs());
        }
    }
    println!("off by {worst:e} mm");
    assert!(worst < PATH_MM, "{worst}");
}

/// What the string does is stored, and the load that a slider's drive would have is its tension.
#[test]
fn tension_is_the_force_of_the_slider_and_the_derivative_of_the_energy() {
    let steps = 48;
    let design = design(&finger(), steps);
    let sliding = {
        let text = finger().replace("drive cable", "drive guide").replace("rest  cable", "rest  guide");
        let text: String = text
            .lines()
            .filter(|l| !l.trim_start().starts_with("string "))
            .map(|l| format!("{l}\n"))
            .collect();
        let text = text.replace(" with nema17 drum 8 mm", "").replace("use std.motors.nema17\n", "");
        self::design(&text, steps)
    };
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let (by_string, by_slider) = (layout(&design), layout(&sliding));
    let model = Model::new(&design, &by_string, &p, EDGES, false).unwrap();
    let other = Model::new(&sliding, &by_slider, &p, EDGES, false).unwrap();
    let (pulled, slid) = (sweep(&model).unwrap().states, sweep(&other).unwrap().states);
    let pull = |s: usize| pulled[s].drive_load(&model, 0);
    let largest = (0..=steps).map(pull).fold(0.0, f64::max);
    assert!(largest > 0.1, "{largest}");
    for (s, slid) in slid.iter().enumerate() {
        let force = slid.drive_load(&other, 0);
        assert!((pull(s) - force).abs() < 1e-7 * largest, "state {s}: {} {force}", pull(s));
        assert!(pull(s) > -1e-7 * largest, "state {s}: {}", pull(s));
    }
    let h = 3.0 / steps as f64;
    for s in 2..steps - 1 {
        let by = |d: usize| (pulled[s + d].energy_n_mm - pulled[s - d].energy_n_mm) / (2.0 * h * d as f64);
        let slope = (4.0 * by(1) - by(2)) / 3.0;
        assert!((slope - pull(s)).abs() < 1e-4 * largest, "state {s}: {slope} {}", pull(s));
    }
}

/// A string that leaves its line as the bodies turn: from the middle phalanx back to the palm, against a weight.
fn tendon() -> String {
    finger()
        .replace("cable: carriage at C1 to palm via C2, C3", "cable: middle at P2 to palm via Q0")
        .replace(
            "    rest  cable",
            "    load gravity (1, 0, 0)\n    load 0.05 N * t along y on distal at Z\n    rest  cable",
        )
}

/// Numbers in −1..1, the same for the same seed.
fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut s = seed;
    let mut next = || {
        s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        2.0 * ((s >> 11) as f64 / (1u64 << 53) as f64) - 1.0
    };
    (0..n).map(|_| next()).collect()
}

/// Gradients against five-point differences with a string and loads.
#[test]
fn gradients_with_a_string_agree_with_differences() {
    let mut design = design(&tendon(), 4);
    let origin = design.origin;
    for kind in [
        ObjectiveKind::Track { trace: 0, scale_mm: Some(0.1) },
        ObjectiveKind::Force { drive: 0, reference_n: 5.0 },
    ] {
        design.objectives = vec![Objective { kind: kind.clone(), weight: 1.0, origin }];
        let layout = layout(&design);
        let problem = Problem::new(&design, &layout, EDGES);
        let trial = problem.simulate(&problem.to_unit(&common::shaken(&design, 3))).unwrap();
        let normal = problem.differentiate(&trial).unwrap().normal;
        assert!(trial.terms[0] > 0.0, "the term must act");
        let scale = normal.gradient.norm();
        let h = 1e-4;
        for k in 0..2 {
            let direction = noise(300 + k, trial.x.len());
            let value = |factor: f64| {
                let x: Vec<f64> = trial.x.iter().zip(&direction).map(|(x, d)| x + factor * h * d).collect();
                problem.simulate(&x).unwrap().terms[0]
            };
            let difference = (value(-2.0) - 8.0 * value(-1.0) + 8.0 * value(1.0) - value(2.0)) / (12.0 * h);
            let exact: f64 = normal.gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
            let off = (difference - exact).abs() / scale;
            assert!(off < 1e-6, "{kind:?}: exact {exact}, difference {difference}: {off:e}");
        }
    }
}

/// Rest in the middle of the range: below it the string would have to push, and that is said at its line.
#[test]
fn a_slack_string_is_told() {
    let run = |text: &str| {
        let text = text.replace("    trace ", "    require min(tension(cable)) >= 0 N\n    trace ");
        let request = Request { source: "main.mech".into(), steps: Some(10), ..Request::default() };
        let files = files(&text);
        let (out, simulation) = simulate(&request, Show::default(), &Compiler::default(), &files);
        let design = out.design.unwrap();
        let mut told = Vec::new();
        let checked = flexura::pipeline::check_requirements(&design, &simulation.unwrap(), &mut told);
        (out.diagnostics, checked, text)
    };
    let (mut found, checked, _) = run(&finger());
    // Lints have tests of their own.
    found.retain(|d| !d.code.starts_with("W1"));
    // All links lie in one layer: as printed bodies they meet, which is told too.
    assert!(found.iter().all(|d| ["W0635", "W0636"].contains(&d.code.as_str())), "{found:?}");
    assert!(checked[0].pass && checked[0].value == Some(0.0), "{checked:?}");
    let (found, checked, text) = run(&finger().replace("cable at 0 mm", "cable at 2 mm"));
    let slack = found.iter().find(|d| d.code == "W0620").unwrap_or_else(|| panic!("{found:?}"));
    assert!(slack.message.contains("from state 0"), "{slack:?}");
    let at = slack.labels[0].at;
    assert!(text[at.start as usize..].starts_with("string cable"));
    assert!(!checked[0].pass && checked[0].value.unwrap() < -0.01, "{checked:?}");
}

/// 3 mm on a drum of 8 mm: the motor turns 3/4 rad.
#[test]
fn a_drum_turns_way_into_angle() {
    let design = design(&finger(), 50);
    let drive = &design.drives[0];
    let [first, last] = [0.0, 1.0].map(|t| drive.motor_angle_rad(t, drive.rest).unwrap());
    assert!(first.abs() < 1e-15 && (last - 0.75).abs() < 1e-12, "{first} {last}");
    // 400 N mm at a radius of 4 mm.
    assert!((design.drives[0].stall_force_n().unwrap() - 100.0).abs() < 1e-12);
}
