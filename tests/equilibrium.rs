//! The compliant mechanism in equilibrium: torque computed two ways, energy over a closed cycle,
//! independence of the way, derivatives by the design parameters against differences.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{
    Cycle, Layout, Model, SAME_MM, SensitivityWorkspace, apart_mm, sweep, sweep_both_ways,
};
use flexura::ir::{Design, Profile};
use flexura::kinematics::solve_motion;
use flexura::optimize::Problem;

mod common;

const EDGES: usize = 12;
/// Step of differences in the unit box, of sixth order. Rounding falls as 1/step: 5.5e-6 at 1e-4, 1.2e-6 at 4e-4.
const STEP: f64 = 2e-3;
/// Weights of f(h) − f(−h), f(2h) − f(−2h), f(3h) − f(−3h) in 60 h f'.
const WEIGHTS: [f64; 3] = [45.0, -9.0, 1.0];

fn chebyshev(steps: usize) -> Design {
    let options = Options { steps: Some(steps), ..Options::default() };
    let files = common::ExampleFiles;
    let out = elaborate("chebyshev.mech", &files, &options);
    assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:?}", out.diagnostics);
    out.design.unwrap()
}

fn start(design: &Design) -> Vec<f64> {
    design.free.iter().map(|f| f.start).collect()
}

fn layout(design: &Design) -> Layout {
    let p = start(design);
    Layout::new(design, &solve_motion(design, &p).unwrap(), &p)
}

fn cycle(design: &Design, layout: &Layout, p: &[f64]) -> Cycle {
    sweep(&Model::new(design, layout, p, EDGES, false).unwrap()).unwrap()
}

/// The multiplier against differences of the energy, of second order and extrapolated to fourth.
#[test]
fn torque_is_the_derivative_of_the_energy() {
    let steps = 120;
    let design = chebyshev(steps);
    let layout = layout(&design);
    let p = start(&design);
    let model = Model::new(&design, &layout, &p, EDGES, false).unwrap();
    let states = sweep(&model).unwrap().states;
    let alpha = &layout.drives[0].values;
    let difference = |s: usize, d: usize| {
        (states[s + d].energy_n_mm - states[s - d].energy_n_mm) / (alpha[s + d] - alpha[s - d])
    };
    let (mut largest, mut coarse, mut fine, mut extrapolated) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (s, state) in states.iter().enumerate().take(steps - 1).skip(2) {
        let torque = state.drive_load(&model, 0);
        let (one, two) = (difference(s, 1), difference(s, 2));
        largest = largest.max(torque.abs());
        coarse = coarse.max((torque - two).abs());
        fine = fine.max((torque - one).abs());
        extrapolated = extrapolated.max((torque - (4.0 * one - two) / 3.0).abs());
    }
    let shown = format!("{} {} {}", coarse / largest, fine / largest, extrapolated / largest);
    assert!(extrapolated < 1e-3 * largest, "{shown}");
    assert!((3.3..4.7).contains(&(coarse / fine)), "second order: {shown}");
}

/// ∮ τ dα = 0 on a closed cycle: the trapezoidal rule on a periodic function converges at once.
#[test]
fn a_closed_cycle_takes_no_work() {
    let design = chebyshev(60);
    let layout = layout(&design);
    let p = start(&design);
    let model = Model::new(&design, &layout, &p, EDGES, false).unwrap();
    let states = sweep(&model).unwrap().states;
    let torques: Vec<f64> = states.iter().map(|s| s.drive_load(&model, 0)).collect();
    let size: f64 = torques[..60].iter().map(|t| t.abs()).sum();
    let sum: f64 = torques[..60].iter().sum();
    assert!(sum.abs() < 1e-6 * size, "{sum} of {size}");
    assert!((torques[0] - torques[60]).abs() < 1e-7 * size);
    assert!(states.iter().all(|s| s.stable));
}

/// States do not remember how they were reached.
#[test]
fn the_way_does_not_matter() {
    let (few, many) = (chebyshev(12), chebyshev(60));
    let p = start(&few);
    let (a, b) = (layout(&few), layout(&many));
    let coarse = cycle(&few, &a, &p);
    let fine = cycle(&many, &b, &p);
    for s in 0..=12 {
        for (x, y) in coarse.states[s].state.poses.iter().zip(&fine.states[5 * s].state.poses) {
            assert!((x.translation - y.translation).norm() < 1e-7, "state {s}");
            assert!((x.rotation - y.rotation).norm() < 1e-8, "state {s}");
        }
    }
}

/// A closed cycle followed both ways round holds the same states; its last one is its first, a turn on. An open one is followed as it is.
#[test]
fn both_ways_round_lead_to_the_same_states() {
    let design = chebyshev(24);
    let (layout, p) = (layout(&design), start(&design));
    let model = Model::new(&design, &layout, &p, EDGES, false).unwrap();
    let (one, both) = (sweep(&model).unwrap().states, sweep_both_ways(&model).unwrap().states);
    assert_eq!(one.len(), both.len());
    for (s, (a, b)) in one.iter().zip(&both).enumerate() {
        let apart = apart_mm(&layout, &a.state, &b.state);
        assert!(apart < SAME_MM / 10.0, "state {s}: {apart:e}");
        assert!((a.state.drives[0] - b.state.drives[0]).abs() < 1e-9, "state {s}");
        assert!((a.drive_load(&model, 0) - b.drive_load(&model, 0)).abs() < 1e-5, "state {s}");
    }
    let (first, last) = (&both[0].state, &both[24].state);
    assert_eq!((&first.poses, &first.lambda), (&last.poses, &last.lambda));
    assert!((last.drives[0] - first.drives[0] - std::f64::consts::TAU).abs() < 1e-12);
    let mut open = design.clone();
    let Profile::Range { to, .. } = &mut open.drives[0].profile else { panic!("a straight profile") };
    *to *= 0.5;
    let layout = self::layout(&open);
    let model = Model::new(&open, &layout, &p, EDGES, false).unwrap();
    let (one, both) = (sweep(&model).unwrap().states, sweep_both_ways(&model).unwrap().states);
    assert!(one.iter().zip(&both).all(|(a, b)| a.state.poses == b.state.poses));
}

/// Every parameter in the extended set, every fourth in the ordinary one.
fn sampled(parameters: usize) -> impl Iterator<Item = usize> {
    let stride = if std::env::var_os("FLEXURA_EXTENDED").is_some() { 1 } else { 4 };
    (0..parameters).step_by(stride)
}

/// Link increments, multipliers and torque by the parameters, against central differences.
#[test]
fn states_by_parameters_against_differences() {
    // Steps of 30 degrees: larger ones may be followed to another branch by the next design.
    let design = chebyshev(12);
    let layout = layout(&design);
    let seed = (7..).find(|seed| is_followed(&common::shaken(&design, *seed))).unwrap();
    let p = common::shaken(&design, seed);
    let model = Model::new(&design, &layout, &p, EDGES, true).unwrap();
    let states = sweep(&model).unwrap().states;
    let mut workspace = SensitivityWorkspace::new(&model);
    let step = |i: usize| STEP * (design.free[i].upper - design.free[i].lower);
    let perturbed = |i: usize, factor: f64| {
        let mut q = p.clone();
        q[i] += factor * step(i);
        cycle(&design, &layout, &q)
    };
    let mut worst = 0.0f64;
    const SNAP: f64 = 0.2;
    let energy = states.iter().map(|s| s.energy_n_mm).fold(0.0, f64::max);
    let mut compared: Vec<bool> = Vec::new();
    // Where the torque passes zero, differences are only good against its size elsewhere.
    let torque = states.iter().map(|s| s.drive_load(&model, 0).abs()).fold(0.0, f64::max);
    for i in sampled(p.len()) {
        let shifted = [1.0, 2.0, 3.0].map(|k| [perturbed(i, k), perturbed(i, -k)]);
        // Half a percent of a bound's width changes the energies little, unless a leaf snaps on the way.
        let snaps = shifted.iter().flatten().any(|c| {
            let pairs = c.states.iter().zip(&states);
            pairs.map(|(a, b)| (a.energy_n_mm - b.energy_n_mm).abs()).fold(0.0, f64::max) > SNAP * energy
        });
        compared.push(!snaps);
        if snaps {
            continue;
        }
        let difference = |value: &dyn Fn(&Cycle) -> f64| {
            let pairs = shifted.iter().zip(WEIGHTS);
            pairs.map(|([right, left], w)| w * (value(right) - value(left))).sum::<f64>() / (60.0 * step(i))
        };
        for (s, state) in states.iter().enumerate() {
            let target: Vec<f64> = layout.drives.iter().map(|d| d.values[s] - d.rest).collect();
            let sensitivity = workspace.at(&model, state, &target).unwrap();
            let row = model.rows() - 1;
            let difference_of_torque = difference(&|c| c.states[s].state.lambda[row]);
            let exact = sensitivity.lambda[(row, i)];
            let width = design.free[i].upper - design.free[i].lower;
            worst = worst.max((exact - difference_of_torque).abs() * width / torque);
            for (b, body) in layout.bodies.iter().enumerate() {
                let Some(first) = body.first_dof else { continue };
                for c in 0..3 {
                    let difference = difference(&|cycle| cycle.states[s].state.poses[b].translation[c]);
                    let exact = sensitivity.links[(first + c, i)];
                    worst = worst.max((exact - difference).abs() * width / layout.length_mm);
                }
            }
        }
    }
    assert!(worst < 1e-6, "{worst}");
    let count = compared.iter().filter(|c| **c).count();
    assert!(count * 4 >= compared.len() * 3, "{count} of {} compared", compared.len());
}

/// Whether a design is one: its states do not depend on how finely the cycle is walked. Where they do, a leaf snaps, and
/// the next design may be followed to another branch: what jumps there has no derivative.
fn is_followed(p: &[f64]) -> bool {
    const SAME: f64 = 1e-6;
    let energies = |steps: usize, every: usize| -> Option<Vec<f64>> {
        let design = chebyshev(steps);
        let layout = layout(&design);
        let model = Model::new(&design, &layout, p, EDGES, false).ok()?;
        Some(sweep(&model).ok()?.states.iter().step_by(every).map(|s| s.energy_n_mm).collect())
    };
    let (Some(coarse), Some(fine)) = (energies(12, 1), energies(96, 8)) else { return false };
    let largest = fine.iter().fold(0.0, |m: f64, e| m.max(*e));
    coarse.iter().zip(&fine).all(|(a, b)| (a - b).abs() <= SAME * largest)
}

/// Gradient of the whole objective in the unit box against differences, at random feasible designs.
#[test]
fn objective_gradient_against_differences() {
    let design = chebyshev(12);
    let layout = layout(&design);
    let problem = Problem::new(&design, &layout, EDGES);
    for seed in (3..).filter(|seed| is_followed(&common::shaken(&design, *seed))).take(2) {
        let x = problem.to_unit(&common::shaken(&design, seed));
        let trial = problem.simulate(&x).unwrap();
        assert!(trial.terms.iter().take(2).all(|t| *t > 0.0), "every term must act: {:?}", trial.terms);
        let gradient = problem.differentiate(&trial).unwrap().gradient();
        let scale = gradient.amax();
        for i in sampled(x.len()) {
            let h = 2e-4;
            let value = |factor: f64| {
                let mut y = x.clone();
                y[i] += factor * h;
                problem.simulate(&y).unwrap().cost
            };
            let difference = (value(-2.0) - 8.0 * value(-1.0) + 8.0 * value(1.0) - value(2.0)) / (12.0 * h);
            let exact = gradient[i];
            assert!(
                (difference - exact).abs() < 1e-6 * scale.max(exact.abs()),
                "seed {seed}, {}: exact {exact}, difference {difference}",
                design.free[i].path
            );
        }
    }
}
