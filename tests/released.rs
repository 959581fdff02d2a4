//! The released mechanism: rest states that are known from the drawing alone, barriers as work, and snaps.
//!
//! With one compliant joint, between rocker and base, Chebyshev's linkage is bistable: wherever its crank brings the
//! rocker back to the pose in which the leaves were printed, they are unstressed again. There crank and coupler are
//! mirrored at the line from the crank's centre O to the knee B. The barriers' tops are where crank and coupler lie
//! in one line: the coupler's force is then square to what the crank can give way to.

#![allow(clippy::unwrap_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Cycle, Landscape, Layout, Model, landscape, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use nalgebra::Vector3;
use std::collections::BTreeMap;

const EDGES: usize = 12;
/// Of angles, rad.
const ANGLE: f64 = 1e-8;

fn design(drive: &str, steps: usize) -> Design {
    let text = include_str!("../examples/chebyshev/chebyshev.mech");
    let text = text
        .replace("into coupler toward U  as crossed_leaves", "")
        .replace("drive motor from 0 deg to 360 deg with nema17", drive);
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    let out = elaborate("main.mech", &files, &Options { steps: Some(steps), ..Options::default() });
    out.design.unwrap_or_else(|| panic!("{:?}", out.diagnostics))
}

fn with<T>(
    drive: &str,
    steps: usize,
    f: impl FnOnce(&Design, &Layout, &Model, &Cycle, &Landscape) -> T,
) -> T {
    let design = design(drive, steps);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(&design, &solve_motion(&design, &p).unwrap(), &p);
    let model = Model::new(&design, &layout, &p, EDGES, false).unwrap();
    let cycle = sweep(&model).unwrap();
    let found = landscape(&model, &cycle).unwrap();
    f(&design, &layout, &model, &cycle, &found)
}

const TURN: &str = "drive motor from 0 deg to 360 deg with nema17";

/// Crank angle of the second rest state, as the joint's value, from the drawing: O, the crank's length 20, the knee at
/// half = 50 from both A and D, drawn with the crank at 90°.
fn mirrored() -> f64 {
    let (r, half, rest) = (20.0, 50.0, 30f64.to_radians());
    let crank = rest + 90f64.to_radians();
    let (a, d) = (Vector3::new(r * crank.cos(), r * crank.sin(), 0.0), Vector3::new(2.0 * r, 0.0, 0.0));
    // The knee: left of the way from A to D.
    let middle = (a + d) * 0.5;
    let way = d - a;
    let height = (half * half - way.norm_squared() / 4.0).sqrt();
    let knee = middle + Vector3::new(-way.y, way.x, 0.0).normalize() * height;
    2.0 * knee.y.atan2(knee.x) - crank - 90f64.to_radians()
}

fn turns(a: f64, b: f64) -> f64 {
    let d = (a - b) / std::f64::consts::TAU;
    (d - d.round()).abs() * std::f64::consts::TAU
}

#[test]
fn two_rest_states_known_from_the_drawing() {
    with(TURN, 24, |_, _, model, _, found| {
        let at: Vec<f64> = found.rests.iter().map(|r| r.balance.drives[0]).collect();
        assert_eq!(at.len(), 2, "{at:?}");
        for want in [30f64.to_radians(), mirrored()] {
            let nearest = at.iter().map(|a| turns(*a, want)).fold(f64::INFINITY, f64::min);
            assert!(nearest < ANGLE, "{at:?} {want}");
        }
        for r in &found.rests {
            let e = &r.balance.equilibrium;
            assert!(e.stable && e.energy_n_mm < 1e-9, "{}", e.energy_n_mm);
            assert!(e.drive_load(model, 0).abs() < 1e-6);
        }
        assert!(found.snaps.is_empty(), "{:?}", found.snaps.len());
        // Each barrier is one of the two tops; what is up from one is down from the other.
        let [a, b] = found.rests.as_slice() else { panic!() };
        assert_eq!(
            a.barrier_up_n_mm.map(|x| (x * 1e6).round()),
            b.barrier_down_n_mm.map(|x| (x * 1e6).round())
        );
        assert_eq!(
            a.barrier_down_n_mm.map(|x| (x * 1e6).round()),
            b.barrier_up_n_mm.map(|x| (x * 1e6).round())
        );
        assert_ne!(a.barrier_up_n_mm, a.barrier_down_n_mm);
    });
}

#[test]
fn the_tops_are_where_crank_and_coupler_lie_in_line() {
    with(TURN, 24, |design, layout, _, _, found| {
        assert_eq!(found.tops.len(), 2);
        let body = |name: &str| design.bodies.iter().position(|b| b.name == name).unwrap();
        let (crank, coupler) = (body("crank"), body("coupler"));
        // Points in the drawing pose: O, A and the coupler's B, which lies half way from A to P.
        let values = design.exprs.evaluate(&design.free.iter().map(|f| f.start).collect::<Vec<_>>());
        let point = |b: usize, name: &str| {
            let p = design.bodies[b].skeleton.iter().find(|p| p.name == name).unwrap();
            layout.rest_poses[b].point(&values.point(p.position))
        };
        for top in &found.tops {
            let poses = &top.equilibrium.state.poses;
            let arm = poses[crank].point(&point(crank, "A")) - poses[crank].point(&point(crank, "O"));
            let rod = poses[coupler].point(&point(coupler, "B")) - poses[coupler].point(&point(coupler, "A"));
            let sine = (arm.x * rod.y - arm.y * rod.x) / (arm.xy().norm() * rod.xy().norm());
            assert!(sine.abs() < 1e-7, "{sine}");
            assert!(top.equilibrium.energy_n_mm > 1.0);
        }
    });
}

/// Torque integrated over the crank's way from rest to top, eight-point Gauss between them, is the barrier.
#[test]
fn a_barrier_is_the_work_to_its_top() {
    let (from, to, barrier) = with(TURN, 24, |_, _, _, _, found| {
        let rest = &found.rests[0];
        let above = |t: f64| t > rest.balance.drives[0];
        let top = found.tops.iter().map(|t| t.drives[0]).filter(|t| above(*t)).fold(f64::INFINITY, f64::min);
        (rest.balance.drives[0], top, rest.barrier_up_n_mm.unwrap())
    });
    // Boole's rule on 400 steps of the same crank angle.
    let steps = 400;
    let drive = format!("drive motor from {} deg to {} deg with nema17", from.to_degrees(), to.to_degrees());
    let work = with(&drive, steps, |_, layout, model, cycle, found| {
        assert!(found.tops.len() + found.rests.len() <= 2);
        let h = (layout.drives[0].values[steps] - layout.drives[0].values[0]) / steps as f64;
        let t: Vec<f64> = cycle.states.iter().map(|e| e.drive_load(model, 0)).collect();
        t[..]
            .windows(5)
            .step_by(4)
            .map(|w| 2.0 * h / 45.0 * (7.0 * (w[0] + w[4]) + 32.0 * (w[1] + w[3]) + 12.0 * w[2]))
            .sum::<f64>()
    });
    assert!((work / barrier - 1.0).abs() < 1e-6, "{work} {barrier}");
}

/// Round a closed cycle no work is left: trapezia of a periodic function converge faster than any power.
#[test]
fn no_work_is_left_after_a_turn() {
    with(TURN, 96, |_, layout, model, cycle, _| {
        let h = layout.drives[0].values[1] - layout.drives[0].values[0];
        let loads: Vec<f64> = cycle.states[..96].iter().map(|e| e.drive_load(model, 0) * h).collect();
        let (sum, size): (f64, f64) = (loads.iter().sum(), loads.iter().map(|l| l.abs()).sum());
        assert!(size > 1.0 && sum.abs() < 1e-6 * size, "{sum} {size}");
    });
}

/// To and fro is one profile: the same rest states as once across; dτ/dα against differences of τ.
#[test]
fn to_and_fro_is_one_profile() {
    let across =
        with("drive motor from -20 deg to 80 deg with nema17", 20, |_, layout, model, cycle, found| {
            for s in 1..20 {
                let t = |s: usize| cycle.states[s].drive_load(model, 0);
                let h = layout.drives[0].values[s + 1] - layout.drives[0].values[s - 1];
                let slope = (t(s + 1) - t(s - 1)) / h;
                // Steps of 5°: differences are off by the square of that.
                let largest = found.stiffness.iter().fold(0.0f64, |m, k| m.max(k.abs()));
                assert!(
                    (found.stiffness[s] - slope).abs() < 0.02 * largest,
                    "{} {slope}",
                    found.stiffness[s]
                );
            }
            found.rests.iter().map(|r| r.balance.drives[0]).collect::<Vec<_>>()
        });
    let fro = "drive motor by 30 deg + 50 deg * sin(360 deg * t) with nema17";
    let both = with(fro, 20, |_, _, _, _, found| {
        found.rests.iter().map(|r| (r.balance.drives[0], r.barrier_up_n_mm)).collect::<Vec<_>>()
    });
    assert_eq!((across.len(), both.len()), (1, 1), "{across:?} {both:?}");
    assert!((across[0] - both[0].0).abs() < ANGLE && (across[0] - 30f64.to_radians()).abs() < ANGLE);
    assert_eq!(both[0].1, None, "no other rest state lies in the range");
}
