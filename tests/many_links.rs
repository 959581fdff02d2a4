//! Many mechanisms on one crank, which are eliminated front by front, against one of them, which is one dense system: states, torque,
//! mobility, and the derivatives of all terms.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, sweep};
use flexura::ir::Design;
use flexura::kinematics::{Mechanism, Mobility, solve_motion};
use flexura::optimize::Problem;
use std::collections::BTreeMap;
use std::fmt::Write;

const EDGES: usize = 12;
const STEPS: usize = 12;
/// Chains on the crank: two moving bodies each, more than fit one front.
const MANY: usize = 12;
/// Places of the same body in both, mm. Measured 8e-13.
const PLACE_MM: f64 = 1e-8;
/// Torque, cost and derivatives, relative. Measured 4e-14, 3e-14, 2e-9.
const RELATIVE: f64 = 1e-7;

/// Chebyshev's linkage so many times; of a single one all numbers, of many only what they have in common is free.
fn design(chains: usize) -> Design {
    let mut text = String::from(
        "use std.materials.rigur\nuse std.processes.polyjet\nuse std.motors.nema17\nuse std.flexures.crossed_leaves\n\
         mechanism row {\n    param r: length = 20 mm\n    param thick: length = free 0.8 mm in 0.6 mm .. 1.4 mm\n    \
         let half = 2.5 * r\n    point O = (0 mm, 0 mm)\n    point D = O + (2 * r, 0 mm)\n    \
         point A = O + polar(r, 90 deg)\n    point B = meet(circle(A, half), circle(D, half), left)\n    \
         point P = A + 2 * (B - A)\n    point S = D - (0 mm, 25 mm)\n    ground base { O, D }\n    link crank { O, A }\n    \
         hinge motor: base to crank at O\n    material rigur\n    print on polyjet\n    \
         drive motor from 0 deg to 360 deg with nema17\n    rest motor at 30 deg\n",
    );
    let _ = writeln!(text, "    cycle {STEPS} steps over 2 s");
    let mut terms = String::new();
    for k in 0..chains {
        let _ = write!(
            text,
            "    link coupler{k} {{ A, B, P }}\n    link rocker{k} {{ B, D }}\n    \
             hinge pin{k}: crank to coupler{k} at A\n    \
             hinge knee{k}: coupler{k} to rocker{k} at B into coupler{k} toward P as crossed_leaves {{ thickness = thick }}\n    \
             hinge heel{k}: rocker{k} to base at D into base toward S as crossed_leaves {{ thickness = thick }}\n    \
             trace tip{k} = P on coupler{k}\n"
        );
        let _ = writeln!(terms, "        track(tip{k}, scale = 1 mm)");
    }
    let _ = write!(text, "    minimize {{\n{terms}    }}\n}}\n");
    let files = BTreeMap::from([("row.mech".to_string(), text)]);
    let found = elaborate("row.mech", &files, &Options::default());
    assert!(found.diagnostics.iter().all(|d| !d.is_error()), "{:?}", found.diagnostics);
    found.design.unwrap()
}

fn start(design: &Design) -> Vec<f64> {
    design.free.iter().map(|f| f.start).collect()
}

#[test]
fn many_chains_on_a_crank_move_as_one_does() {
    let (one, many) = (design(1), design(MANY));
    let mobility = |d: &Design| Mobility::of(&Mechanism::new(d, &start(d)).unwrap());
    let (alone, together) = (mobility(&one), mobility(&many));
    assert!(together.moving_bodies > 16);
    assert_eq!((together.freedoms, together.undetermined), (alone.freedoms, alone.undetermined));
    // What is not of the crank and its drive is there so many times.
    assert_eq!(together.redundant, MANY * alone.redundant);

    let motions = [&one, &many].map(|d| solve_motion(d, &start(d)).unwrap());
    for (a, b) in motions[0].states.iter().zip(&motions[1].states) {
        for trace in &b.traces_mm {
            assert!((trace - a.traces_mm[0]).norm() < PLACE_MM);
        }
    }
    let layouts =
        [Layout::new(&one, &motions[0], &start(&one)), Layout::new(&many, &motions[1], &start(&many))];
    let models = [
        Model::new(&one, &layouts[0], &start(&one), EDGES, true).unwrap(),
        Model::new(&many, &layouts[1], &start(&many), EDGES, true).unwrap(),
    ];
    let cycles = [sweep(&models[0]).unwrap(), sweep(&models[1]).unwrap()];
    let torques: Vec<f64> = cycles[0].states.iter().map(|s| s.drive_load(&models[0], 0)).collect();
    let largest = torques.iter().fold(0.0f64, |m, t| m.max(t.abs()));
    let (mut far, mut off) = (0.0f64, 0.0f64);
    for ((a, b), torque) in cycles[0].states.iter().zip(&cycles[1].states).zip(&torques) {
        assert_eq!(a.stable, b.stable);
        off = off.max((b.drive_load(&models[1], 0) / MANY as f64 - torque).abs() / largest);
        let place = |layout: &Layout, s: &flexura::equilibrium::Equilibrium, t: usize| {
            let trace = &layout.traces[t];
            s.state.poses[trace.body].point(&trace.rest)
        };
        for t in 0..MANY {
            far = far.max((place(&layouts[1], b, t) - place(&layouts[0], a, 0)).norm());
        }
    }
    println!("places {far:.1e} mm, torques {off:.1e}");
    assert!(far < PLACE_MM && off < RELATIVE);

    let problems = [Problem::new(&one, &layouts[0], EDGES), Problem::new(&many, &layouts[1], EDGES)];
    let trials = problems.iter().map(|p| p.simulate(&p.start()).unwrap()).collect::<Vec<_>>();
    let by = [0, 1].map(|i| problems[i].differentiate(&trials[i]).unwrap().gradient()[0]);
    println!(
        "costs {} {}, derivatives {} {}",
        trials[0].cost,
        trials[1].cost / MANY as f64,
        by[0],
        by[1] / MANY as f64
    );
    assert!((trials[1].cost / MANY as f64 - trials[0].cost).abs() < RELATIVE * trials[0].cost);
    assert!((by[1] / MANY as f64 - by[0]).abs() < RELATIVE * by[0].abs());
}
