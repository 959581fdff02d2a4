//! The mechanisms of the paper with every joint that can be compliant made so: they simulate over their whole cycle at
//! their start values, from sound rods, and come back to where they began.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, sweep};
use flexura::kinematics::solve_motion;
use flexura::rod::LEAST_SLENDERNESS;
use std::collections::BTreeMap;
use std::time::Instant;

const EDGES: usize = 20;
/// States 0 and N of a closed cycle, mm and rad.
const RETURNED: f64 = 1e-6;

/// What a mechanism must have and reach at its start values.
struct Expected {
    name: &'static str,
    rods: usize,
    free: usize,
    /// Largest distance of the trace from its target over the size of that path, at most: a different branch, or a
    /// flexure that gives way instead of turning, is off by all of it.
    strays: f64,
}

fn check(expected: &Expected) {
    let name = expected.name;
    let path = format!("{}/tests/mechanisms/{name}.mech", env!("CARGO_MANIFEST_DIR"));
    let files = BTreeMap::from([("main.mech".to_string(), std::fs::read_to_string(path).unwrap())]);
    let found = elaborate("main.mech", &files, &Options::default());
    assert_eq!(found.diagnostics, [], "{name}");
    let design = found.design.unwrap();
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let motion = solve_motion(&design, &p).unwrap();
    assert_eq!(motion.warnings, [], "{name}");
    let layout = Layout::new(&design, &motion, &p);
    let model = Model::new(&design, &layout, &p, EDGES, true).unwrap();
    let begin = Instant::now();
    let states = sweep(&model).unwrap().states;
    let seconds = begin.elapsed().as_secs_f64();

    let trace = &layout.traces[0];
    let at = |s: usize| states[s].state.poses[trace.body].point(&trace.rest);
    let errors: Vec<f64> = (0..states.len()).map(|s| (at(s) - trace.target[s]).norm()).collect();
    let largest = errors.iter().fold(0.0f64, |m, e| m.max(*e));
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let size = trace.target.iter().flat_map(|a| trace.target.iter().map(move |b| (a - b).norm()));
    let size = size.fold(0.0, f64::max);
    let stress = states.iter().map(|s| s.max_stress_mpa(&model)).fold(0.0, f64::max);
    println!(
        "{name}: {} rods, {} free, {seconds:.2} s, error {mean:.2} mean {largest:.2} max of {size:.1} mm, {stress:.0} MPa",
        design.rods.len(),
        design.free.len(),
    );
    for (id, joint) in design.joints.iter().enumerate().filter(|(_, j)| j.is_compliant()) {
        let own = design.rods.iter().enumerate().filter(|(_, r)| r.joint == id);
        let told = own.map(|(i, rod)| {
            let built = &model.rods[i].rod;
            let peak =
                states.iter().map(|s| built.largest_stress(&s.strains[i]).map_or(0.0, |x| x.von_mises_mpa));
            format!("{} {:.1} mm {:.0} MPa", rod.path, built.length_mm(), peak.fold(0.0, f64::max))
        });
        let told: Vec<String> = told.collect();
        println!(
            "  {} {:.0} deg: {}",
            joint.name,
            motion.span(id).from_rest_rad.to_degrees(),
            told.join(", ")
        );
    }

    assert_eq!((design.rods.len(), design.free.len()), (expected.rods, expected.free), "{name}");
    assert!(states.iter().all(|s| s.stable), "{name} buckles");
    for (rod, told) in model.rods.iter().zip(&design.rods) {
        let thickness = 2.0 * rod.rod.parameters().a;
        assert!(rod.rod.length_mm() >= LEAST_SLENDERNESS * thickness, "{}", told.path);
        let worst = rod.rod.shape_excesses().iter().map(|e| e.0).fold(f64::MIN, f64::max);
        assert!(worst <= 0.0, "{name}: {} {worst}", told.path);
    }
    if layout.closed {
        let (first, last) = (&states[0].state.poses, &states[states.len() - 1].state.poses);
        for (a, b) in first.iter().zip(last) {
            let apart = (a.translation - b.translation).norm().max((a.rotation - b.rotation).norm());
            assert!(apart < RETURNED, "{name}: {apart}");
        }
    }
    assert!(largest > 0.0 && largest < expected.strays * size, "{name}: {largest} mm of {size} mm");
}

#[test]
fn jansen() {
    check(&Expected { name: "jansen", rods: 14, free: 118, strays: 0.15 });
}

#[test]
fn eye() {
    check(&Expected { name: "eye", rods: 8, free: 55, strays: 0.5 });
}

#[test]
fn car() {
    check(&Expected { name: "car", rods: 4, free: 43, strays: 0.1 });
}

#[test]
fn dragon() {
    check(&Expected { name: "dragon", rods: 5, free: 47, strays: 0.3 });
}

#[test]
fn hand() {
    check(&Expected { name: "hand", rods: 18, free: 153, strays: 0.45 });
}
