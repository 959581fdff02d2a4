//! Loads written in a design: closed forms of cantilevers through whole `.mech` texts, energy, derivatives.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Cycle, Layout, Model, sweep};
use flexura::ir::{Design, Objective, ObjectiveKind};
use flexura::kinematics::solve_motion;
use flexura::optimize::Problem;
use flexura::pipeline::{Compiler, Request, Show, simulate};
use flexura::rod::RodModel;
use nalgebra::Vector3;
use std::collections::BTreeMap;

mod common;

const CANTILEVER: &str = include_str!("loads/cantilever.mech");
const RODS: &str = include_str!("reference/rods.csv");
const LENGTH: f64 = 30.0;
/// Bending stiffness of the benchmark flexure, N·mm² (reference/rods.csv).
const EI: f64 = 188.4955592;
/// Edges where a closed form is met: off by C/N², with the C of the rod by itself and its factor on them.
const FINE: usize = 80;
const CONVERGENCE: &str = include_str!("rods_convergence.csv");
const CONVERGENCE_FACTOR: f64 = 1.5;

fn design(text: &str) -> Design {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let out = elaborate("main.mech", &files, &Options::default());
    assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:#?}", out.diagnostics);
    out.design.unwrap()
}

fn cantilever(load: &str) -> Design {
    design(&CANTILEVER.replace("//LOAD", load))
}

fn layout(design: &Design) -> Layout {
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    Layout::new(design, &solve_motion(design, &p).unwrap(), &p)
}

fn solved(layout: &Layout, design: &Design, edges: usize) -> Cycle {
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let model = Model::new(design, layout, &p, edges, false).unwrap();
    sweep(&model).unwrap()
}

/// Path of the only trace from its place at rest, mm.
fn moved(layout: &Layout, cycle: &Cycle) -> Vec<Vector3<f64>> {
    let trace = &layout.traces[0];
    cycle.states.iter().map(|s| s.state.poses[trace.body].point(&trace.rest) - trace.rest).collect()
}

/// A number of a table by the first three columns.
fn lookup(table: &str, row: [&str; 3]) -> f64 {
    let start = format!("{},", row.join(","));
    let line = table.lines().find(|l| l.starts_with(&start)).unwrap_or_else(|| panic!("no row {start}"));
    line[start.len()..].split(',').next().unwrap().parse().unwrap()
}

/// Holds a number against its reference.
fn check(row: [&str; 3], value: f64) {
    let wanted = lookup(RODS, row);
    let bound = CONVERGENCE_FACTOR * lookup(CONVERGENCE, row) / (FINE * FINE) as f64;
    println!("{row:?}: off by {:e} of {bound:e}", value - wanted);
    assert!((value - wanted).abs() < bound, "{row:?}: {value}, wanted {wanted}");
}

#[test]
fn a_tip_force_bends_the_elastica() {
    let design = cantilever("load 10 * EI / L^2 * t along y on tip at T");
    let layout = layout(&design);
    let path = moved(&layout, &solved(&layout, &design, FINE));
    for (step, alpha) in [(1, 1), (3, 3), (5, 5), (10, 10)] {
        let parameter = format!("alpha={alpha} benchmark flexure");
        check(["cantilever_tip_force_extensible", &parameter, "w/L"], path[step].y / LENGTH);
        check(["cantilever_tip_force_extensible", &parameter, "u/L"], -path[step].x / LENGTH);
        assert!(path[step].z.abs() < 1e-9);
    }
}

/// To a full circle: the turn that the moment works on goes beyond half a turn. In space the flexure would leave the
/// plane at about 200°; two slides keep it there.
#[test]
fn an_end_moment_bends_a_circle() {
    let turn = std::f64::consts::TAU;
    let guided = "load moment 2 * 3.141592653589793 * EI / L * t about z on tip
    link across { O }
    link along { O }
    slider x: wall to across at O axis x
    slider y: across to along at O axis y
    hinge pin: along to tip at O";
    let design = cantilever(guided).with_steps(20);
    let layout = layout(&design);
    let cycle = solved(&layout, &design, FINE);
    let path = moved(&layout, &cycle);
    for (step, part) in [(5, "0.25"), (10, "0.5"), (20, "1.0")] {
        let parameter = format!("M={part}*2*pi*EI/L");
        check(["pure_bending_end_moment", &parameter, "tip_x/L"], path[step].x / LENGTH + 1.0);
        check(["pure_bending_end_moment", &parameter, "tip_y/L"], path[step].y / LENGTH);
        let state = &cycle.states[step].state;
        let wanted = turn * step as f64 / 20.0;
        let off = (state.turns[0] / wanted - 1.0).abs();
        assert!(off < 1.1 * softer(wanted), "{} of {wanted}", state.turns[0]);
    }
    // Energy ½ M φ, potential −M φ.
    let last = &cycle.states[20];
    let moment = turn * EI / LENGTH;
    let (stored, given) =
        (last.energy_n_mm / (0.5 * moment * turn), last.load_potential_n_mm / (-moment * turn));
    assert!((given - 1.0).abs() < 1.1 * softer(turn), "{given}");
    // By ½ EI/h (2 tan(θ/2))² a vertex: one part in θ²/2 less.
    assert!((stored - 1.0).abs() < 1.1 * 1.5 * softer(turn), "{stored}");
}

/// How much less a discrete rod turns: by M = EI/h · 2 tan(θ/2)/cos²(θ/2) a vertex, one part in θ²/3.
fn softer(turn: f64) -> f64 {
    (turn / (FINE - 1) as f64).powi(2) / 3.0
}

trait WithSteps {
    fn with_steps(self, steps: usize) -> Self;
}

impl WithSteps for Design {
    fn with_steps(mut self, steps: usize) -> Self {
        self.cycle.steps = steps;
        self
    }
}

/// Small deflection of a cantilever under its own weight and that of its tip: q L⁴/8EI + W L³/3EI + W d L²/2EI.
#[test]
fn weight_sags_as_the_beam_formulas_say() {
    let text = CANTILEVER.replace("1.2 g/cm^3", "0.002 g/cm^3").replace("//LOAD", "load gravity (0, -1, 0)");
    let design = design(&text);
    let specific = 0.002e-3 * 9.80665e-3;
    for model in [RodModel::default(), RodModel::Corrected] {
        let mut layout = layout(&design);
        layout.rod_model = model;
        let sag = -moved(&layout, &solved(&layout, &design, FINE))[0].y;
        // Links are 12 mm high: bars 8.4 mm wide with round ends, from O to B.
        let (radius, height) = (4.2, 12.0);
        let volume = 2.0 * radius * height * 40.0 + std::f64::consts::PI * radius * radius * height;
        let (w, d) = (volume * specific, 20.0 - LENGTH / 2.0);
        let q = std::f64::consts::PI * 0.4 * 2.5 * specific;
        let tip = w * LENGTH.powi(3) / (3.0 * EI) + w * d * LENGTH.powi(2) / (2.0 * EI);
        let own = q * LENGTH.powi(4) / (8.0 * EI);
        println!("{model:?}: {sag} of {} and {own}", tip);
        assert!(own > 1e-3 * tip, "the weight of the flexure must be seen");
        let ratio = sag / (own + tip);
        let stiffer = match model {
            RodModel::Corrected => 1.0 / (1.0 + 0.115 * 5.0 / LENGTH),
            RodModel::Plain => 1.0,
        };
        // Second order in the edge length: 1.1 N⁻².
        assert!((ratio / stiffer - 1.0).abs() < 4e-4, "{model:?}: {}", ratio / stiffer);
    }
}

/// The weight of the flexure alone, by what adding it changes.
#[test]
fn a_flexure_weighs_what_its_volume_weighs() {
    let design = cantilever("load gravity (0, -1, 0)");
    let layout = layout(&design);
    let p: Vec<f64> = Vec::new();
    for edges in [12, 40] {
        let model = Model::new(&design, &layout, &p, edges, false).unwrap();
        let state = model.rest_state();
        let mut lifted = state.clone();
        for pose in &mut lifted.poses {
            pose.translation.y += 2.0;
        }
        for rod in &mut lifted.rods {
            rod.vertices.iter_mut().for_each(|v| v.y += 2.0);
        }
        let work = model.load_potential_n_mm(&lifted, &[1.0]);
        let link = flexura::equilibrium::volume_and_center(
            &[Vector3::new(0.0, 0.0, 0.0), Vector3::new(40.0, 0.0, 0.0)],
            12.0,
        );
        let volume = std::f64::consts::PI * 0.4 * 2.5 * LENGTH + link.0;
        let wanted = 2.0 * volume * 1.2e-3 * 9.80665e-3;
        assert!((work / wanted - 1.0).abs() < 1e-12, "{work} {wanted}");
        assert!((link.1 - Vector3::new(20.0, 0.0, 0.0)).norm() < 1e-12);
    }
}

/// dΠ/dt = ∂V/∂t where nothing is driven: the load's size changes, and what it does is stored.
#[test]
fn work_of_loads_is_stored() {
    let design = cantilever("load 0.4 N * t along (1, 2, 2) on tip at B").with_steps(64);
    let layout = layout(&design);
    let cycle = solved(&layout, &design, 16);
    let states = &cycle.states;
    let direction = Vector3::new(1.0, 2.0, 2.0) / 3.0;
    let b = Vector3::new(40.0, 0.0, 0.0);
    let along = |s: usize| {
        let pose = &states[s].state.poses[1];
        direction.dot(&(pose.point(&b) - b))
    };
    let n = 64;
    // ∫ F dz = F z − ∫ z dF by Simpson's rule.
    let simpson: f64 = (0..n).step_by(2).map(|s| along(s) + 4.0 * along(s + 1) + along(s + 2)).sum();
    let work = 0.4 * (along(n) - simpson / (3 * n) as f64);
    let stored = states[n].energy_n_mm;
    assert!(work > 0.1 && (work - stored).abs() < 1e-5 * work, "work {work}, stored {stored}");
    let potential = states[n].load_potential_n_mm;
    assert!((potential + 0.4 * along(n)).abs() < 1e-9 * potential.abs());
}

/// The example with all kinds of loads, some of them changing.
fn loaded_chebyshev() -> Design {
    let loads = "    load gravity (0.3, -1, 0.5)
    load 0.3 N * (1 + sin(360 deg * t)) along (1, 0.5, -0.2) on coupler at P
    load moment 5 N*mm * cos(360 deg * t) about z on rocker
    rest ";
    let mut text = common::example("chebyshev.mech").replace("    rest ", loads);
    text = text.replace("cycle 60 steps", "cycle 4 steps");
    let mut design = design(&text);
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let printed = flexura::geometry::weigh(&design, &start).unwrap();
    design.bodies.iter_mut().zip(printed).for_each(|(body, extra)| body.printed = Some(extra));
    design
}

/// The torque is still the derivative of the whole potential, loads held.
#[test]
fn torque_is_the_derivative_of_energy_and_loads() {
    let text = common::example("chebyshev.mech").replace(
        "    rest ",
        "    load gravity (0, -1, 0)\n    load 0.2 N along y on coupler at P\n    rest ",
    );
    let design = design(&text).with_steps(120);
    let layout = layout(&design);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let model = Model::new(&design, &layout, &p, 12, false).unwrap();
    let states = sweep(&model).unwrap().states;
    let alpha = &layout.drives[0].values;
    let whole = |s: usize| states[s].energy_n_mm + states[s].load_potential_n_mm;
    let difference = |s: usize, d: usize| (whole(s + d) - whole(s - d)) / (alpha[s + d] - alpha[s - d]);
    let (mut largest, mut off, mut without) = (0.0f64, 0.0f64, 0.0f64);
    for s in 2..119 {
        let torque = states[s].drive_load(&model, 0);
        largest = largest.max(torque.abs());
        off = off.max((torque - (4.0 * difference(s, 1) - difference(s, 2)) / 3.0).abs());
        let elastic = (states[s + 1].energy_n_mm - states[s - 1].energy_n_mm) / (alpha[s + 1] - alpha[s - 1]);
        without = without.max((torque - elastic).abs());
    }
    assert!(off < 1e-3 * largest, "{off} of {largest}");
    assert!(without > 0.02 * largest, "the loads must matter: {without} of {largest}");
    assert!(states.iter().all(|s| s.stable));
}

/// Numbers in −1..1, the same for the same seed.
fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut s = seed;
    let mut next = || {
        s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        2.0 * ((s >> 11) as f64 / (1u64 << 53) as f64) - 1.0
    };
    (0..n).map(|_| next()).collect()
}

/// Gradient of every term against five-point differences, with the weight of flexures that change.
#[test]
fn gradients_with_loads_agree_with_differences() {
    let mut design = loaded_chebyshev();
    // Heavy, so that the weight of the flexures matters to the sixth digit.
    design.material.density_g_mm3 = Some(0.01);
    let origin = design.origin;
    let kinds = [
        ObjectiveKind::Track { trace: 0, scale_mm: Some(0.1) },
        ObjectiveKind::Sway { trace: 0, force_n: 0.5, scale_mm: Some(0.5) },
        ObjectiveKind::Torque { drive: 0, reference_n_mm: 20.0 },
        ObjectiveKind::StressBelow { bound_mpa: 5.0, scale_mpa: Some(1.0) },
    ];
    for (model, kinds) in [(RodModel::Plain, &kinds[..]), (RodModel::Corrected, &kinds[2..3])] {
        for kind in kinds {
            design.objectives = vec![Objective { kind: kind.clone(), weight: 1.0, origin }];
            let mut layout = layout(&design);
            layout.rod_model = model;
            let problem = Problem::new(&design, &layout, 12);
            let trial = problem.simulate(&problem.to_unit(&common::shaken(&design, 3))).unwrap();
            let normal = problem.differentiate(&trial).unwrap().normal;
            assert!(trial.terms[0] > 0.0, "the term must act");
            let scale = normal.gradient.norm();
            let h = 1e-4;
            for k in 0..1 {
                let direction = noise(300 + k, trial.x.len());
                let value = |factor: f64| {
                    let x: Vec<f64> =
                        trial.x.iter().zip(&direction).map(|(x, d)| x + factor * h * d).collect();
                    problem.simulate(&x).unwrap().terms[0]
                };
                let difference =
                    (value(-2.0) - 8.0 * value(-1.0) + 8.0 * value(1.0) - value(2.0)) / (12.0 * h);
                let exact: f64 = normal.gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
                let off = (difference - exact).abs() / scale;
                assert!(off < 1e-6, "{model:?} {kind:?}: exact {exact}, difference {difference}: {off:e}");
            }
        }
    }
}

/// Through the public way: the potential has a column, a trace without a target has no error.
#[test]
fn a_design_without_a_drive_is_simulated() {
    let text = CANTILEVER.replace("//LOAD", "load 0.1 N * t along y on tip at T");
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    let request = Request { source: "main.mech".into(), ..Request::default() };
    let (out, simulation) = simulate(&request, Show::default(), &Compiler::default(), &files);
    // Lints have tests of their own.
    assert!(out.diagnostics.iter().all(|d| d.code.starts_with("W1")), "{:?}", out.diagnostics);
    let simulation = simulation.unwrap();
    assert_eq!(
        flexura::emit::csv::columns(&simulation.motion).join(" "),
        "step trace.end.x_mm trace.end.y_mm trace.end.z_mm energy_n_mm stress_max_mpa load_potential_n_mm"
    );
    assert_eq!(simulation.motion.states.len(), 11);
    assert!(simulation.errors_mm[0].is_empty());
    let (first, last) = (&simulation.motion.states[0], &simulation.motion.states[10]);
    assert!(first.load_potential_n_mm == 0.0 && last.load_potential_n_mm < -0.1);
}
