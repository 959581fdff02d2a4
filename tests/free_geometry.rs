//! Geometry that depends on free variables: rest pose, points, lengths. Derivatives against differences at random
//! designs, with redundant rows, idle freedoms, sliding and driven compliant joints present.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::gradient::{EDGES, check_layout, check_objective, check_states, design, layout};
use flexura::ir::Design;
use flexura::optimize::Problem;
use flexura::pipeline::{Compiler, Stages};
use std::sync::atomic::AtomicBool;

/// A design of `tests/free_geometry`.
fn text(name: &str) -> String {
    let path = format!("{}/tests/free_geometry/{name}.mech", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

/// The variables of the geometry, and every `nth` of the flexures'.
fn some(design: &Design, nth: usize) -> impl Iterator<Item = usize> + use<> {
    let moving = design.geometry_variables();
    (0..design.free.len()).filter(move |i| i % nth == 0 || moving.contains(i))
}

fn check(name: &str, steps: usize, moving: usize, nth: usize) {
    let design = design(&text(name), steps);
    assert_eq!(design.geometry_variables().len(), moving);
    check_layout(&design, 3);
    check_states(&design, 3, some(&design, nth));
    check_objective(&design, 11, some(&design, nth));
}

#[test]
fn chebyshev() {
    if common::skipped() {
        return;
    }
    check("chebyshev", 6, 6, 8);
}

#[test]
fn car() {
    if common::skipped() {
        return;
    }
    check("car", 4, 5, 5);
}

#[test]
fn dragon() {
    if common::skipped() {
        return;
    }
    check("dragon", 4, 5, 9);
}

#[test]
fn hand() {
    check("hand", 4, 4, 9);
}

#[test]
fn jansen() {
    if common::skipped() {
        return;
    }
    check("jansen", 4, 3, 12);
}

#[test]
fn eye() {
    check("eye", 4, 5, 8);
}

/// Lengths at which the drawing cannot be assembled are no design, and the ones beside them are.
#[test]
fn what_cannot_be_assembled_is_not_taken() {
    let wide = text("chebyshev")
        .replace("r: length = free 20 mm in 17 mm .. 23 mm", "r: length = 20 mm")
        .replace("circle(D, 2.5 * r)", "circle(D, free 50 mm in 5 mm .. 80 mm)");
    let design = design(&wide, 6);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let laid = layout(&design, &p);
    let problem = Problem::new(&design, &laid, EDGES);
    let at = |rocker: f64| {
        let mut q = p.clone();
        q[design.free.iter().position(|f| f.path.starts_with('B')).unwrap()] = rocker;
        problem.simulate(&problem.to_unit(&q)).is_some()
    };
    // A of radius 20 mm, coupler 50 mm, base 40 mm: below 30 mm the crank cannot turn fully.
    assert!(at(50.0) && at(45.0));
    assert!(!at(25.0) && !at(5.0));
}

/// A parallelogram with a state exactly where it lies flat: the motion has no derivative there.
#[test]
fn a_dead_point_cannot_be_differentiated_and_says_so() {
    let text = "use std.materials.rigur\nuse std.processes.polyjet\nuse std.flexures.crossed_leaves\n\
        mechanism flat {\n let r = free 10 mm in 8 mm .. 12 mm\n\
        point O = (0 mm, 0 mm)\n point D = (40 mm, 0 mm)\n point A = (0 mm, r)\n point B = (40 mm, r)\n\
        ground base { O, D }\n link crank { O, A }\n link coupler { A, B }\n link rocker { B, D }\n\
        hinge motor: base to crank at O\n hinge pin: crank to coupler at A\n\
        hinge knee: coupler to rocker at B\n\
        hinge heel: rocker to base at D as crossed_leaves { size = 6 mm }\n\
        material rigur\n print on polyjet\n cycle 12 steps over 1 s\n drive motor from 0 deg to 120 deg\n\
        trace tip = B on rocker\n minimize { track(tip) }\n }\n";
    let design = design(text, 12);
    let never = AtomicBool::new(false);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let why = Compiler::default().optimize(&design, &p, &|_| {}, &never).unwrap_err();
    assert_eq!(why.iter().map(|d| d.code.as_str()).collect::<Vec<_>>(), ["E0612"]);
}

/// Solved values reach everything behind the optimiser: the conventional motion and the compliant one start their
/// motor from the rest pose that was found.
#[test]
fn the_rest_pose_found_is_the_one_that_is_used() {
    let design = design(&text("chebyshev"), 12);
    let rest = design.free.iter().position(|f| f.path == "motor.rest").unwrap();
    let mut p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let compiler = Compiler::default();
    for degrees in [30.0_f64, 60.0] {
        p[rest] = degrees.to_radians();
        let table = compiler.simulate(&design, &p).unwrap().motion;
        // Of 12 states one is the rest pose: nothing is stressed there, and something everywhere else.
        let at = (degrees / 30.0) as usize;
        for (s, state) in table.states.iter().enumerate() {
            assert_eq!(state.energy_n_mm < 1e-9, s == at, "{degrees} {s} {}", state.energy_n_mm);
        }
        let rigid = compiler.rigid(&design, &p).unwrap().motion;
        assert!(
            rigid.states[at].poses.iter().all(|(t, turn)| { t.iter().chain(turn).all(|x| x.abs() < 1e-9) })
        );
    }
}
