//! One flexure: the benchmark leaf of the reference numbers, 30 mm long, half axes 0.4 and 2.5 mm, E 1500 MPa, ν 0.4.

use super::{MICRO, MILLI, Report};
use flexura::rod::single::{EndLoad, SingleRod};
use flexura::rod::{Rod, RodMaterial, RodParameters, ellipse_stiffness};
use nalgebra::{SVector, Vector3};

const MATERIAL: RodMaterial = RodMaterial { e_mpa: 1500.0, nu: 0.4 };
const LENGTH_MM: f64 = 30.0;
const SIZES: [usize; 3] = [20, 100, 1000];

fn rod(edges: usize) -> Rod {
    let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * LENGTH_MM, Vector3::z(), 0.4, 2.5);
    Rod::new(&q, MATERIAL, edges).expect("a straight rod")
}

/// Clamped at A, free at B.
fn cantilever(edges: usize) -> SingleRod {
    SingleRod::new(rod(edges), Vector3::zeros(), Vector3::x() * LENGTH_MM)
}

/// A force across the free end with α = F L²/EI.
fn tip_force(alpha: f64) -> EndLoad {
    let ei = ellipse_stiffness(0.4, 2.5, &MATERIAL).ei1;
    let force = Vector3::y() * alpha * ei / (LENGTH_MM * LENGTH_MM);
    EndLoad { force, point: Vector3::x() * LENGTH_MM, ..EndLoad::NONE }
}

/// A bent state, so that nothing is zero by accident.
fn bent(edges: usize) -> SingleRod {
    let mut s = cantilever(edges);
    for alpha in [0.5, 1.0, 1.5, 2.0] {
        s.solve(&tip_force(alpha), [true; 6]).expect("a cantilever bends");
    }
    s
}

/// The pieces of a Newton step, per edge.
pub fn kernels(report: &mut Report) {
    for edges in SIZES {
        let SingleRod { rod, state, pose_a, pose_b, mut system, .. } = bent(edges);
        let per_edge = 1.0 / edges as f64;
        let size = format!("{edges} edges");
        // Pieces of microseconds are timed a hundred at a time.
        let many = (20_000 / edges).max(1);
        let unit = (MICRO.0 * per_edge / many as f64, "µs/edge");
        let repeat = |piece: &mut dyn FnMut()| (0..many).for_each(|_| piece());
        let energy = report.time(|| {
            repeat(&mut || {
                std::hint::black_box(rod.energy(&state));
            })
        });
        report.row("rods", "energy", &size, energy, unit);
        let assemble = report.time(|| repeat(&mut || system.assemble(&rod, &state, &pose_a, &pose_b)));
        report.row("rods", "energy, gradient and Hessian", &size, assemble, unit);
        let d = SVector::<f64, 12>::from_fn(|i, _| if i < 6 { 0.0 } else { 1e-3 });
        let newton = report.time(|| {
            repeat(&mut || {
                system.assemble(&rod, &state, &pose_a, &pose_b);
                system.factor();
                system.condense();
                std::hint::black_box(system.back_substitute(&d));
            })
        });
        let solve =
            super::Time { least: newton.least - assemble.least, median: newton.median - assemble.median };
        report.row("rods", "factor, condense and solve", &size, solve, unit);
        report.row("rods", "whole Newton step", &size, newton, unit);
        report.set("newton_us_per_edge", &edges.to_string(), Some(newton.least * unit.0));
    }
}

/// From straight to the load, in one solve where that converges, else in as few equal steps of load as do.
pub fn cantilevers(report: &mut Report) {
    const STEPS: [u32; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
    for edges in SIZES {
        let straight = cantilever(edges);
        let size = format!("{edges} edges");
        let mut by_alpha = serde_json::Map::new();
        for alpha in [1.0, 3.0, 5.0, 10.0] {
            let solve = |steps: u32| {
                let mut s = straight.clone();
                (1..=steps).try_fold(0, |newton, k| {
                    let part = alpha * f64::from(k) / f64::from(steps);
                    s.solve(&tip_force(part), [true; 6]).map(|iterations| newton + iterations)
                })
            };
            let found = STEPS.into_iter().find_map(|steps| Some((steps, solve(steps).ok()?)));
            let (what, least) = match found {
                Some((steps, newton)) => {
                    let time = report.time(|| solve(steps).is_ok());
                    let loads = if steps == 1 { "at once".into() } else { format!("in {steps} steps") };
                    let what = format!("tip force α = {alpha} {loads}, {newton} Newton steps");
                    report.row("cantilever", &what, &size, time, MILLI);
                    (alpha.to_string(), Some(time.least * MILLI.0))
                }
                None => {
                    let what = format!("tip force α = {alpha}: no equilibrium was found");
                    report.note("cantilever", &what, &size, "–".into(), "ms");
                    (alpha.to_string(), None)
                }
            };
            by_alpha.insert(what, least.map_or(serde_json::Value::Null, Into::into));
        }
        report.json["cantilever_ms"][edges.to_string()] = by_alpha.into();
    }
}

/// Both ends clamped, turned about the middle by 60° in 60 steps.
pub fn hinges(report: &mut Report) {
    let middle = Vector3::x() * (LENGTH_MM / 2.0);
    for edges in [20, 100] {
        let straight = SingleRod::new(rod(edges), middle, middle);
        let time = report.time(|| {
            let mut s = straight.clone();
            for _ in 0..60 {
                s.move_b(&Vector3::zeros(), &(Vector3::z() * 1f64.to_radians()))
                    .expect("a hinge turns by 60°");
            }
            s.system.energy()
        });
        report.row("hinge", "60° about its middle in 60 steps", &format!("{edges} edges"), time, MILLI);
        report.set("hinge_sweep_ms", &edges.to_string(), Some(time.least * MILLI.0));
    }
}

/// Gradient of a functional of the shape by the rest lengths of all edges, with the factors of the last solve at hand.
pub fn adjoint(report: &mut Report) {
    const EDGES: usize = 20;
    const MANY: usize = 1000;
    let mut s = bent(EDGES);
    let w = vec![1.0; s.rod.internal_freedoms()];
    let mut gradient = vec![0.0; s.rod.edges()];
    let time = report.time(|| {
        for _ in 0..MANY {
            s.system
                .rest_length_gradient(&s.rod, std::hint::black_box(&w), &mut gradient)
                .expect("plain rods");
            std::hint::black_box(&gradient);
        }
    });
    let unit = (MICRO.0 / MANY as f64, "µs");
    report.row("adjoint", "a functional by all rest lengths", &format!("{EDGES} edges"), time, unit);
    report.set("adjoint_us", &EDGES.to_string(), Some(time.least * unit.0));
}
