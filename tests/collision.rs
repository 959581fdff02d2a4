//! The collision term: where rods and links are, what it costs them to be near, and what it does to a design.
#![allow(clippy::unwrap_used, clippy::panic)]

use flexura::elaborate::{FileError, Files, Options, elaborate};
use flexura::equilibrium::{Cycle, Layout, Model, SensitivityWorkspace, sweep};
use flexura::geometry::{Member, MovedState, cycle_gaps, flexure_solid, parts_input, plan_bodies};
use flexura::ir::{Design, Objective, ObjectiveKind};
use flexura::kinematics::solve_motion;
use flexura::optimize::{Method, Problem, optimize};
use flexura::rod::RodModel;
use nalgebra::DVector;
use std::sync::atomic::AtomicBool;

mod common;

const EDGES: usize = 12;
/// Agreement of derivatives.
const TOLERANCE: f64 = 1e-6;

fn example(steps: usize) -> (Design, Layout) {
    let options = Options { steps: Some(steps), ..Options::default() };
    let design = elaborate("chebyshev.mech", &common::ExampleFiles, &options).design.unwrap();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(&design, &solve_motion(&design, &start).unwrap(), &start);
    (design, layout)
}

fn cycle<'l>(design: &Design, layout: &'l Layout, p: &[f64]) -> (Model<'l>, Cycle) {
    let model = Model::new(design, layout, p, EDGES, true).unwrap();
    let cycle = sweep(&model).unwrap();
    (model, cycle)
}

/// Vertices and wide directions of bent rods against four-point differences, with and without shear.
#[test]
fn centrelines_follow_every_parameter() {
    for rod_model in [RodModel::Plain, RodModel::Corrected] {
        let (design, mut layout) = example(3);
        layout.rod_model = rod_model;
        let p = common::shaken(&design, 4);
        let (model, at) = cycle(&design, &layout, &p);
        let mut workspace = SensitivityWorkspace::new(&model);
        let state = 2;
        let target: Vec<f64> = layout.drives.iter().map(|d| d.values[state] - d.rest).collect();
        let exact = workspace.at(&model, &at.states[state], &target).unwrap();
        for seed in [1, 2] {
            // A direction in the free variables that moves them all.
            let d: Vec<f64> = common::noise(seed, p.len());
            let d: Vec<f64> = d.iter().zip(&design.free).map(|(d, f)| d * (f.upper - f.lower)).collect();
            let h = 1e-4;
            let shifted = |by: f64| {
                let q: Vec<f64> = p.iter().zip(&d).map(|(p, d)| p + by * h * d).collect();
                cycle(&design, &layout, &q).1.states[state].state.rods.clone()
            };
            let (a, b, c, e) = (shifted(-2.0), shifted(-1.0), shifted(1.0), shifted(2.0));
            let d = DVector::from_vec(d);
            for r in 0..model.rods.len() {
                let edges: Vec<_> =
                    (0..EDGES).map(|j| workspace.edge(&model, &exact, r, j).unwrap()).collect();
                let vertices = || {
                    edges.iter().enumerate().flat_map(|(j, e)| [(j, &e.vertices[0]), (j + 1, &e.vertices[1])])
                };
                let m2 = |s: &flexura::rod::RodState, j: usize| {
                    (s.vertices[j + 1] - s.vertices[j]).normalize().cross(&s.m1[j])
                };
                let difference = |f: &dyn Fn(&flexura::rod::RodState) -> nalgebra::Vector3<f64>| {
                    (f(&a[r]) - f(&b[r]) * 8.0 + f(&c[r]) * 8.0 - f(&e[r])) / (12.0 * h)
                };
                let largest = vertices().map(|(_, v)| (v * &d).norm()).fold(0.1, f64::max);
                for (k, by) in vertices() {
                    let difference = difference(&|s| s.vertices[k]);
                    let error = (difference - by * &d).norm() / largest;
                    assert!(error < TOLERANCE, "{rod_model:?} rod {r} vertex {k}: {error:e}");
                }
                for (j, by) in edges.iter().map(|e| &e.m2).enumerate() {
                    let difference = difference(&|s| m2(s, j));
                    let error = (difference - by * &d).norm() / largest;
                    assert!(error < TOLERANCE, "{rod_model:?} rod {r} frame {j}: {error:e}");
                }
            }
        }
    }
}

/// The example with the bodies and flexures where its brackets do not help: links and flexures cross.
fn crossing(steps: usize, gap_mm: f64) -> (Design, Layout) {
    let text = include_str!("elaborate/samples/chebyshev.mech");
    let (head, tail) = text.split_once("export stl").unwrap();
    assert!(tail.contains("export arduino(motor)"));
    let options = Options { steps: Some(steps), ..Options::default() };
    let mut design = elaborate_text(&format!("{head}}}\n"), &options);
    let origin = design.origin;
    design.objectives = vec![Objective { kind: ObjectiveKind::Collision { gap_mm }, weight: 1e7, origin }];
    let start = starts(&design);
    let layout = Layout::new(&design, &solve_motion(&design, &start).unwrap(), &start);
    (design, layout)
}

fn elaborate_text(text: &str, options: &Options) -> Design {
    struct One<'t>(&'t str);
    impl Files for One<'_> {
        fn read(&self, _: &str) -> Result<String, FileError> {
            Ok(self.0.to_string())
        }
    }
    let out = elaborate("crossing.mech", &One(text), options);
    out.design.unwrap_or_else(|| panic!("{:?}", out.diagnostics))
}

fn starts(design: &Design) -> Vec<f64> {
    design.free.iter().map(|f| f.start).collect()
}

/// Gradient against five-point differences where links run into each other and flexures into links, deep enough for
/// the linear part.
#[test]
fn gradient_of_crossing_links_and_flexures() {
    for (seed, gap_mm) in [(3, 0.5), (11, 3.0), (5, 8.0)] {
        let (design, layout) = crossing(6, gap_mm);
        let problem = Problem::new(&design, &layout, EDGES);
        let trial = problem.simulate(&problem.to_unit(&common::shaken(&design, seed))).unwrap();
        let exact = problem.differentiate(&trial).unwrap().normal;
        assert!(trial.terms[0] > 1.0, "links collide: {:?}", trial.terms);
        assert!((exact.cost - trial.terms[0]).abs() < 1e-9 * exact.cost);
        let scale = exact.gradient.norm();
        let h = 1e-4;
        for k in 0..3 {
            let d = common::noise(100 * seed + k, trial.x.len());
            let value = |factor: f64| {
                let x: Vec<f64> = trial.x.iter().zip(&d).map(|(x, d)| x + factor * h * d).collect();
                problem.simulate(&x).unwrap().terms[0]
            };
            let difference = (value(-2.0) - 8.0 * value(-1.0) + 8.0 * value(1.0) - value(2.0)) / (12.0 * h);
            let along: f64 = exact.gradient.iter().zip(&d).map(|(g, d)| g * d).sum();
            assert!(
                (difference - along).abs() < TOLERANCE * scale,
                "gap {gap_mm}, seed {seed}: exact {along}, difference {difference}, gradient {scale}"
            );
        }
        let values = exact.gauss_newton.clone().symmetric_eigenvalues();
        assert!(values.max() > 0.0 && values.min() > -1e-12 * values.max());
    }
}

/// More edges change the value by less and less, with second order.
#[test]
fn the_value_converges_with_the_edges() {
    let (design, layout) = crossing(6, 4.0);
    let [middle, fine, finest] = [20, 40, 80].map(|edges| {
        let problem = Problem::new(&design, &layout, edges);
        problem.simulate(&problem.start()).unwrap().terms[0]
    });
    assert!((middle / finest - 1.0).abs() < 1e-2, "{middle} {finest}");
    assert!((fine / finest - 1.0).abs() < 2e-3, "{fine} {finest}");
    assert!((fine - finest).abs() < 0.35 * (middle - fine).abs(), "{middle} {fine} {finest}");
}

/// What keeps the gap costs nothing.
#[test]
fn what_is_apart_costs_nothing() {
    let (mut design, layout) = example(12);
    let origin = design.origin;
    let kind = ObjectiveKind::Collision { gap_mm: 0.2 };
    design.objectives = vec![Objective { kind, weight: 1e7, origin }];
    let problem = Problem::new(&design, &layout, EDGES);
    let trial = problem.simulate(&problem.start()).unwrap();
    assert_eq!(trial.terms[0], 0.0);
    assert_eq!(problem.differentiate(&trial).unwrap().normal.gradient.norm(), 0.0);
}

/// Least gap of the solids over the cycle and how many pairs overlap, flexures and the links they are attached to
/// left out: these are carved.
fn measured(design: &Design, layout: &Layout, p: &[f64]) -> (f64, usize) {
    let (model, cycle) = cycle(design, layout, p);
    let plans = plan_bodies(&parts_input(design, layout, &model).unfilleted()).unwrap();
    let states: Vec<MovedState> = cycle
        .states
        .iter()
        .map(|e| MovedState {
            poses: e.state.poses.clone(),
            flexures: (e.state.rods.iter().enumerate())
                .map(|(r, state)| {
                    let (rod, q) = (&design.rods[r], model.rods[r].rod.parameters());
                    let ends = [(rod.from.body, q.position_a), (rod.to.body, q.position_b)]
                        .map(|(body, p)| e.state.poses[body].point(&p));
                    flexure_solid(design, layout, &model, r, state, ends)
                })
                .collect(),
        })
        .collect();
    let own = |a: Member, b: Member| match (a, b) {
        (Member::Body(b), Member::Flexure(r)) => design.rods[r].from.body == b || design.rods[r].to.body == b,
        _ => false,
    };
    let gaps = cycle_gaps(&plans, &states, own);
    let least = gaps.least.iter().flatten().map(|g| g.gap_mm).fold(f64::INFINITY, f64::min);
    (least, gaps.overlaps.len())
}

/// The paper's case (Fig. 8): tracking alone lets links collide; with the term they keep their clearance. It is asked
/// for more than that, because it gives way and knows corners only roughly.
#[test]
fn links_that_collide_are_taken_apart() {
    if common::skipped() {
        return;
    }
    let (mut design, layout) = crossing(12, 1.0);
    let p = starts(&design);
    let (gap, overlaps) = measured(&design, &layout, &p);
    assert!(gap < 0.0 && overlaps > 0, "{gap} {overlaps}");
    let origin = design.origin;
    let track = ObjectiveKind::Track { trace: 0, scale_mm: Some(0.3) };
    design.objectives.push(Objective { kind: track, weight: 1.0, origin });
    let cancel = AtomicBool::new(false);
    let problem = Problem::new(&design, &layout, EDGES);
    let found = optimize(problem, Method::LevenbergMarquardt, &p, 60, &cancel, &|_| ());
    let (gap, overlaps) = measured(&design, &layout, &found.p);
    assert_eq!(overlaps, 0);
    // Neighbouring layers are the clearance apart.
    assert!(gap >= design.process.clearance_mm - 1e-6, "{gap}");
}
