//! The collision term: where rods and links are, what it costs them to be near, and what it does to a design.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Cycle, Layout, Model, SensitivityWorkspace, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::rod::RodModel;

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
        for (i, free) in design.free.iter().enumerate() {
            let h = 2e-4 * (free.upper - free.lower);
            let shifted = |by: f64| {
                let mut q = p.clone();
                q[i] += by * h;
                cycle(&design, &layout, &q).1.states[state].state.rods.clone()
            };
            let (a, b, c, d) = (shifted(-2.0), shifted(-1.0), shifted(1.0), shifted(2.0));
            for (r, jacobian) in exact.iter().enumerate() {
                let m2 = |s: &flexura::rod::RodState, j: usize| {
                    (s.vertices[j + 1] - s.vertices[j]).normalize().cross(&s.m1[j])
                };
                let difference = |f: &dyn Fn(&flexura::rod::RodState) -> nalgebra::Vector3<f64>| {
                    (f(&a[r]) - f(&b[r]) * 8.0 + f(&c[r]) * 8.0 - f(&d[r])) / (12.0 * h)
                };
                let largest = jacobian.vertices.iter().map(|v| v.column(i).norm()).fold(0.1, f64::max);
                for (k, by) in jacobian.vertices.iter().enumerate() {
                    let difference = difference(&|s| s.vertices[k]);
                    let error = (difference - by.column(i)).norm() / largest;
                    assert!(error < 1e-6, "{rod_model:?} {} rod {r} vertex {k}: {error:e}", free.path);
                }
                for (j, by) in jacobian.m2.iter().enumerate() {
                    let difference = difference(&|s| m2(s, j));
                    let error = (difference - by.column(i)).norm() / largest;
                    assert!(error < 1e-6, "{rod_model:?} {} rod {r} frame {j}: {error:e}", free.path);
                }
            }
        }
    }
}
