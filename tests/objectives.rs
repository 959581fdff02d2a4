//! Every term of the objective by itself: its gradient against differences at random feasible designs, its
//! quadratic model, and what it means.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::Layout;
use flexura::ir::{Design, Objective, ObjectiveKind};
use flexura::kinematics::solve_motion;
use flexura::optimize::{Normal, Problem, Trial};

mod common;

const EDGES: usize = 12;

fn with_terms(steps: usize, kinds: &[ObjectiveKind]) -> (Design, Layout) {
    let options = Options { steps: Some(steps), ..Options::default() };
    let mut design = elaborate("chebyshev.mech", &common::ExampleFiles, &options).design.unwrap();
    let origin = design.origin;
    let objective = |kind: &ObjectiveKind| Objective { kind: kind.clone(), weight: 1.0, origin };
    design.objectives = kinds.iter().map(objective).collect();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(&design, &solve_motion(&design, &start).unwrap(), &start);
    (design, layout)
}

fn at<'d>(problem: &Problem<'d>, design: &Design, seed: u64) -> (Trial<'d>, Normal) {
    let trial = problem.simulate(&problem.to_unit(&common::shaken(design, seed))).unwrap();
    let normal = problem.differentiate(&trial).unwrap();
    (trial, normal.normal)
}

/// Gradient against five-point differences along random directions that move every parameter.
fn check_gradient(kind: ObjectiveKind) {
    let (design, layout) = with_terms(6, &[kind]);
    for seed in [3, 11] {
        let problem = Problem::new(&design, &layout, EDGES);
        let (trial, normal) = at(&problem, &design, seed);
        assert!(trial.terms[0] > 0.0, "the term must act");
        assert!((normal.cost - trial.cost).abs() < 1e-9 * trial.cost, "{} {}", normal.cost, trial.cost);
        let scale = normal.gradient.norm();
        assert!(scale > 1e-3 * trial.cost, "the gradient must act: {scale}");
        let h = 1e-4;
        for k in 0..4 {
            let direction = common::noise(100 * seed + k, trial.x.len());
            let value = |factor: f64| {
                let x: Vec<f64> = trial.x.iter().zip(&direction).map(|(x, d)| x + factor * h * d).collect();
                problem.simulate(&x).unwrap().cost
            };
            let difference = (value(-2.0) - 8.0 * value(-1.0) + 8.0 * value(1.0) - value(2.0)) / (12.0 * h);
            let exact: f64 = normal.gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
            assert!(
                (difference - exact).abs() < 1e-6 * scale,
                "seed {seed}: exact {exact}, difference {difference}, gradient {scale}"
            );
        }
        check_model(&normal);
    }
}

/// The quadratic model is positive semidefinite.
fn check_model(normal: &Normal) {
    let values = normal.gauss_newton.clone().symmetric_eigenvalues();
    assert!(values.max() > 0.0);
    assert!(values.min() > -1e-12 * values.max(), "{values}");
}

#[test]
fn torque() {
    check_gradient(ObjectiveKind::Torque { drive: 0, reference_n_mm: 100.0 });
}

#[test]
fn sway() {
    check_gradient(ObjectiveKind::Sway { trace: 0, force_n: 1.0, scale_mm: Some(0.5) });
}

#[test]
fn stress() {
    check_gradient(ObjectiveKind::Stress { scale_mpa: Some(10.0) });
}

/// Links and flexures that must keep far apart: every kind of pair acts, link with link, flexure with link, flexure
/// with flexure.
#[test]
fn collision() {
    if common::skipped() {
        return;
    }
    for gap_mm in [4.0, 12.0] {
        check_gradient(ObjectiveKind::Collision { gap_mm });
    }
}

/// A soft maximum lies below the true one by at most what its sharpness allows, whatever the step count.
#[test]
fn soft_maxima_read_the_largest_value() {
    let kinds = [
        ObjectiveKind::Torque { drive: 0, reference_n_mm: 1.0 },
        ObjectiveKind::Stress { scale_mpa: Some(1.0) },
    ];
    let mut read = Vec::new();
    for steps in [30, 60] {
        let (design, layout) = with_terms(steps, &kinds);
        let problem = Problem::new(&design, &layout, EDGES);
        let trial = problem.simulate(&problem.start()).unwrap();
        let counted = &trial.cycle.states[..steps];
        let torque = counted.iter().map(|s| s.drive_load(&trial.model, 0).powi(2)).fold(0.0, f64::max);
        let of_torque = trial.terms[0] / torque;
        let of_stress = trial.terms[1] / trial.max_stress_mpa();
        assert!((0.9..1.0).contains(&of_torque), "{of_torque}");
        assert!((0.75..1.0).contains(&of_stress), "{of_stress}");
        read.push((trial.terms[0], trial.terms[1]));
    }
    assert!((read[0].0 / read[1].0 - 1.0).abs() < 0.03, "{read:?}");
    assert!((read[0].1 / read[1].1 - 1.0).abs() < 0.01, "{read:?}");
}

/// The optimiser lowers the largest torque and the largest stress through their soft maxima.
#[test]
fn optimising_a_peak_lowers_it() {
    use flexura::optimize::{Method, optimize};
    for kind in [
        ObjectiveKind::Torque { drive: 0, reference_n_mm: 100.0 },
        ObjectiveKind::Stress { scale_mpa: Some(10.0) },
    ] {
        let (design, layout) = with_terms(12, std::slice::from_ref(&kind));
        let problem = Problem::new(&design, &layout, EDGES);
        let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
        let before = problem.simulate(&problem.start()).unwrap().terms[0];
        let cancel = std::sync::atomic::AtomicBool::new(false);
        let found = optimize(problem, Method::LevenbergMarquardt, &start, 8, &cancel, &|_| ());
        assert!(found.cost < 0.5 * before, "{kind:?}: {} of {before}", found.cost);
    }
}

/// All terms together have the same bits on any number of threads.
#[test]
fn derivatives_do_not_depend_on_threads() {
    let kinds = [
        ObjectiveKind::Track { trace: 0, scale_mm: Some(0.1) },
        ObjectiveKind::Sway { trace: 0, force_n: 0.5, scale_mm: Some(1.0) },
        ObjectiveKind::Torque { drive: 0, reference_n_mm: 100.0 },
        ObjectiveKind::StressBelow { bound_mpa: 10.0, scale_mpa: Some(1.0) },
        ObjectiveKind::Stress { scale_mpa: Some(10.0) },
    ];
    let (design, layout) = with_terms(7, &kinds);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let problem = Problem::new(&design, &layout, EDGES);
            let (trial, normal) = at(&problem, &design, 3);
            assert!(trial.terms[..5].iter().all(|t| *t > 0.0), "{:?}", trial.terms);
            (trial.terms, normal)
        })
    };
    let one = run(1);
    check_model(&one.1);
    assert!(one == run(2) && one == run(3));
}
