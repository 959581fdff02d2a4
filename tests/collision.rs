//! The collision term: where rods and links are, what it costs them to be near, and what it does to a design.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Cycle, Layout, Model, SensitivityWorkspace, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::rod::RodModel;
use nalgebra::DVector;

mod common;

const EDGES: usize = 12;

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
        let mut workspace = SensitivityWorkspace::new(&model).with_centrelines(true);
        let state = 2;
        let target: Vec<f64> = layout.drives.iter().map(|d| d.values[state] - d.rest).collect();
        let exact = workspace.at(&model, &at.states[state], &target).unwrap().centrelines;
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
            for (r, jacobian) in exact.iter().enumerate() {
                let m2 = |s: &flexura::rod::RodState, j: usize| {
                    (s.vertices[j + 1] - s.vertices[j]).normalize().cross(&s.m1[j])
                };
                let difference = |f: &dyn Fn(&flexura::rod::RodState) -> nalgebra::Vector3<f64>| {
                    (f(&a[r]) - f(&b[r]) * 8.0 + f(&c[r]) * 8.0 - f(&e[r])) / (12.0 * h)
                };
                let largest = jacobian.vertices.iter().map(|v| (v * &d).norm()).fold(0.1, f64::max);
                for (k, by) in jacobian.vertices.iter().enumerate() {
                    let difference = difference(&|s| s.vertices[k]);
                    let error = (difference - by * &d).norm() / largest;
                    assert!(error < 1e-6, "{rod_model:?} rod {r} vertex {k}: {error:e}");
                }
                for (j, by) in jacobian.m2.iter().enumerate() {
                    let difference = difference(&|s| m2(s, j));
                    let error = (difference - by * &d).norm() / largest;
                    assert!(error < 1e-6, "{rod_model:?} rod {r} frame {j}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn explore() {
    use flexura::geometry::*;
    use flexura::ir::{Objective, ObjectiveKind};
    use flexura::optimize::Problem;
    let (mut design, layout) = example(60);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    for gap_mm in [0.5, 4.0] {
        design.objectives =
            vec![Objective { kind: ObjectiveKind::Collision { gap_mm }, weight: 1e7, origin: design.origin }];
        for edges in [20] {
            let t = std::time::Instant::now();
            let model = Model::new(&design, &layout, &p, edges, true).unwrap();
            let c = sweep(&model).unwrap();
            println!("{gap_mm} sweep {:?} {}", t.elapsed(), c.states.len());
            let t = std::time::Instant::now();
            let plans = plan_bodies(&parts_input(&design, &layout, &model)).unwrap();
            println!("{gap_mm} plans {:?}", t.elapsed());
            let t = std::time::Instant::now();
            let k = skeleton_capsules(&plans, &model, p.len());
            println!("{gap_mm} capsules {:?} {}", t.elapsed(), k.len());
            let problem = Problem::new(&design, &layout, edges);
            let t = std::time::Instant::now();
            let trial = problem.simulate(&problem.start()).unwrap();
            let a = t.elapsed();
            let d = problem.differentiate(&trial).unwrap();
            println!(
                "{gap_mm} {edges} {:?} {:?} {:?} {:.3e}",
                trial.terms,
                a,
                t.elapsed() - a,
                d.normal.gradient.norm()
            );
        }
    }
}
