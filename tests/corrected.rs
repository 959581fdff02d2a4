//! A whole mechanism with rectangular leaves, wires and the corrected rod: derivatives by every design
//! parameter, torque as the slope of the energy, stability.

#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, SensitivityWorkspace, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::rod::RodModel;
use std::collections::BTreeMap;

const EDGES: usize = 12;
/// Step of the differences relative to a parameter's range: their error falls with its fourth power, that of
/// convergence (1e-9 of the largest force) rises with its inverse.
const STEP: f64 = 1e-3;

/// Chebyshev's linkage; the upper leaf of each joint a tapered rectangle, the lower one a wire.
fn design(steps: usize) -> Design {
    let leaves = include_str!("../stdlib/flexures/crossed_leaves.mech");
    let upper = "rect(thick = thickness, wide = wide) to rect(thick = 0.8 * thickness, wide = wide)";
    let leaves = leaves.replacen("ellipse(thick = thickness, wide = wide)", upper, 1);
    let leaves = leaves.replacen("ellipse(thick = thickness, wide = wide)", "round(1.5 * thickness)", 1);
    let main = include_str!("../examples/chebyshev/chebyshev.mech");
    let main = main.replace("use std.flexures.crossed_leaves", "use \"leaves.mech\"");
    let files = BTreeMap::from([("main.mech".to_string(), main), ("leaves.mech".to_string(), leaves)]);
    elaborate("main.mech", &files, &Options { steps: Some(steps), ..Options::default() }).design.unwrap()
}

fn layout(design: &Design, p: &[f64]) -> Layout {
    let mut layout = Layout::new(design, &solve_motion(design, p).unwrap(), p);
    layout.rod_model = RodModel::Corrected;
    layout
}

#[test]
fn states_by_parameters_against_differences() {
    let design = design(3);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = layout(&design, &p);
    let model = Model::new(&design, &layout, &p, EDGES, true).unwrap();
    let states = sweep(&model).unwrap().states;
    assert!(states.iter().all(|s| s.stable));
    let mut workspace = SensitivityWorkspace::new(&model);
    let row = model.rows() - 1;
    let (mut worst, mut moved) = (0.0f64, 0.0f64);
    for (i, free) in design.free.iter().enumerate() {
        let width = free.upper - free.lower;
        let shifted = [-2.0, -1.0, 1.0, 2.0].map(|factor| {
            let mut q = p.clone();
            q[i] += factor * STEP * width;
            sweep(&Model::new(&design, &layout, &q, EDGES, false).unwrap()).unwrap()
        });
        let difference = |value: &dyn Fn(usize) -> f64| {
            (value(0) - 8.0 * value(1) + 8.0 * value(2) - value(3)) / (12.0 * STEP)
        };
        for (s, state) in states.iter().enumerate().skip(1) {
            let target: Vec<f64> = layout.drives.iter().map(|d| d.values[s] - d.rest).collect();
            let exact = workspace.at(&model, state, &target).unwrap();
            let torque = state.state.lambda[row].abs().max(1.0);
            let d = difference(&|k| shifted[k].states[s].state.lambda[row]);
            worst = worst.max((exact.lambda[(row, i)] * width - d).abs() / torque);
            for (b, body) in layout.bodies.iter().enumerate() {
                let Some(first) = body.first_dof else { continue };
                for c in 0..3 {
                    let d = difference(&|k| shifted[k].states[s].state.poses[b].translation[c]);
                    moved = moved.max(d.abs());
                    worst = worst.max((exact.links[(first + c, i)] * width - d).abs() / layout.length_mm);
                }
            }
        }
    }
    println!("worst {worst:.1e} of movements up to {moved:.1} mm");
    assert!(worst < 1e-6 && moved > 1.0, "{worst:e} {moved}");
}

/// The multiplier against the slope of the energy, extrapolated to fourth order; and both models side by side.
#[test]
fn torque_is_the_slope_of_the_energy() {
    let steps = 240;
    let design = design(steps);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = layout(&design, &p);
    let model = Model::new(&design, &layout, &p, EDGES, false).unwrap();
    let states = sweep(&model).unwrap().states;
    let alpha = &layout.drives[0].values;
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for s in 2..steps - 1 {
        let slope = |k: usize| {
            (states[s + k].energy_n_mm - states[s - k].energy_n_mm) / (alpha[s + k] - alpha[s - k])
        };
        let torque = states[s].drive_load(&model, 0);
        worst = worst.max((torque - (4.0 * slope(1) - slope(2)) / 3.0).abs());
        largest = largest.max(torque.abs());
    }
    println!("torque up to {largest:.1} N mm, off by {:.1e}", worst / largest);
    assert!(largest > 1.0 && worst < 1e-3 * largest, "{worst} {largest}");
    assert!((states[0].energy_n_mm - states[steps].energy_n_mm).abs() < 1e-6 * largest);
}

/// The text chooses, corrected where it says nothing; another theory is another design to the lock.
#[test]
fn the_text_chooses_the_theory() {
    let main = include_str!("../examples/chebyshev/chebyshev.mech");
    let of = |line: &str| {
        let text = main.replace("    print on polyjet\n", &format!("    print on polyjet\n{line}\n"));
        let files = BTreeMap::from([("main.mech".to_string(), text)]);
        elaborate("main.mech", &files, &Options { steps: Some(2), ..Options::default() }).design.unwrap()
    };
    let (silent, corrected, plain) = (of(""), of("model corrected"), of("model plain"));
    let digest = |d: &Design| flexura::emit::lock::design_digest(d);
    assert_eq!(digest(&silent), digest(&corrected));
    assert_ne!(digest(&silent), digest(&plain));
    let bending = |design: &Design| {
        let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
        let layout = Layout::new(design, &solve_motion(design, &p).unwrap(), &p);
        let model = Model::new(design, &layout, &p, EDGES, false).unwrap();
        assert_eq!(model.rods[0].rod.options().corrections, layout.rod_model.corrections());
        model.rods[0].rod.least_bending_stiffness()
    };
    assert!(bending(&silent) > bending(&plain) * 1.005);
    assert_eq!(bending(&silent), bending(&corrected));
}
