//! Times of the numerical core, as Markdown: one rod (Newton iterations, the reference cantilever and hinge), a design's
//! cycle with its count of iterations, and one iteration of the optimiser. Least times of many repetitions.
//!
//! `cargo bench --bench kernel [-- --only rod|cycle|optimizer|path] [--design FILE.mech]`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

#[path = "../tests/common/folder.rs"]
mod folder;

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, SensitivityWorkspace, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::optimize::{Iteration, Method, Problem, optimize};
use flexura::pipeline::EDGES;
use flexura::rod::single::{EndLoad, SingleRod};
use flexura::rod::{Rod, RodMaterial, RodParameters, RodSystem, ellipse_stiffness};
use folder::Folder;
use nalgebra::{SVector, Vector3};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// The benchmark flexure of the references, mm and MPa.
const MATERIAL: RodMaterial = RodMaterial { e_mpa: 1500.0, nu: 0.4 };
const LENGTH_MM: f64 = 30.0;

fn benchmark(edges: usize) -> Rod {
    let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * LENGTH_MM, Vector3::z(), 0.4, 2.5);
    Rod::new(&q, MATERIAL, edges).unwrap()
}

/// Least time of a piece over about `budget` seconds, s.
fn least(budget: f64, mut piece: impl FnMut()) -> f64 {
    let began = Instant::now();
    let mut best = f64::INFINITY;
    loop {
        let start = Instant::now();
        piece();
        best = best.min(start.elapsed().as_secs_f64());
        if began.elapsed().as_secs_f64() > budget {
            return best;
        }
    }
}

/// A rod bent by its free end, and one Newton iteration's parts there, µs per edge.
fn iteration(edges: usize) -> [f64; 6] {
    let mut s = SingleRod::new(benchmark(edges), Vector3::zeros(), Vector3::x() * LENGTH_MM);
    let ei = ellipse_stiffness(0.4, 2.5, &MATERIAL).ei1;
    let point = Vector3::x() * LENGTH_MM;
    for step in 1..=8 {
        let force = Vector3::y() * (0.375 * f64::from(step) * ei / LENGTH_MM.powi(2));
        s.solve(&EndLoad { force, point, ..EndLoad::NONE }, [true; 6]).unwrap();
    }
    let (rod, state, a, b) = (s.rod.clone(), s.state.clone(), s.pose_a, s.pose_b);
    let system = &mut s.system;
    let repeat = (4000 / edges).max(1);
    let mut many = |piece: &mut dyn FnMut(&mut RodSystem)| {
        let time = least(0.25, || (0..repeat).for_each(|_| piece(system)));
        time / (repeat * edges) as f64 * 1e6
    };
    let zero = SVector::<f64, 12>::zeros();
    let assembly = many(&mut |s| s.assemble(black_box(&rod), &state, &a, &b));
    let factor = many(&mut |s| {
        black_box(s.factor_unshifted());
    });
    let condensation = many(&mut |s| {
        black_box(s.condense());
    });
    let back = many(&mut |s| {
        black_box(s.back_substitute(black_box(&zero)));
    });
    let retraction = {
        let internal = vec![0.0; rod.internal_freedoms()];
        let mut moved = state.clone();
        many(&mut |_| rod.retract(&mut moved, black_box(&internal), &a, &b).unwrap())
    };
    let whole = many(&mut |s| {
        s.assemble(black_box(&rod), &state, &a, &b);
        s.factor();
        let (g, h) = s.condense();
        let free = h.fixed_view::<6, 6>(6, 6).into_owned();
        let d = free.lu().solve(&g.fixed_rows::<6>(6)).unwrap();
        let mut link = zero;
        link.fixed_rows_mut::<6>(6).copy_from(&d);
        black_box(s.back_substitute(&link));
    });
    [assembly, factor, condensation, back, retraction, whole]
}

fn rod() {
    println!(
        "\n## One rod\n\nParts of a Newton iteration, µs per edge; the whole has the free end's 6 × 6 system besides.\n"
    );
    println!("| edges | assembly | factors | condensation | back-substitution | whole | retraction |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for edges in [20, 50, 100, 200, 500, 1000] {
        let [assembly, factor, condensation, back, retraction, whole] = iteration(edges);
        println!(
            "| {edges} | {assembly:.3} | {factor:.3} | {condensation:.3} | {back:.3} | {whole:.3} | {retraction:.3} |"
        );
    }
    println!("\n| cantilever, 20 edges, from straight | ms | iterations |\n| --- | --- | --- |");
    let ei = ellipse_stiffness(0.4, 2.5, &MATERIAL).ei1;
    let straight = SingleRod::new(benchmark(20), Vector3::zeros(), Vector3::x() * LENGTH_MM);
    for alpha in [1.0, 3.0, 5.0, 10.0] {
        let force = Vector3::y() * (alpha * ei / LENGTH_MM.powi(2));
        let load = EndLoad { force, point: Vector3::x() * LENGTH_MM, ..EndLoad::NONE };
        let mut iterations = Ok(0);
        let time = least(0.4, || {
            let mut s = straight.clone();
            iterations = s.solve(&load, [true; 6]);
        });
        println!("| α = {alpha} | {:.3} | {iterations:?} |", time * 1e3);
    }
    let middle = Vector3::x() * (LENGTH_MM / 2.0);
    let rest = SingleRod::new(benchmark(20), middle, middle);
    let mut iterations = 0;
    let time = least(1.0, || {
        let mut s = rest.clone();
        iterations = 0;
        for _ in 0..60 {
            iterations += s.move_b(&Vector3::zeros(), &(Vector3::z() * 1f64.to_radians())).unwrap();
        }
    });
    println!(
        "\nHinge about the middle, 60 steps of 1°, 20 edges: {:.3} ms, {iterations} iterations.",
        time * 1e3
    );
}

/// Of a bent rod, the gradient of a functional by all rest lengths with the factors at hand, µs.
fn adjoint() {
    let middle = Vector3::x() * (LENGTH_MM / 2.0);
    let mut s = SingleRod::new(benchmark(20), middle, middle);
    for _ in 0..30 {
        s.move_b(&Vector3::zeros(), &(Vector3::z() * 1f64.to_radians())).unwrap();
    }
    let w = vec![1.0; s.rod.internal_freedoms()];
    let mut gradient = vec![0.0; s.rod.edges()];
    let time = least(0.5, || {
        for _ in 0..200 {
            s.system.rest_length_gradient(&s.rod, black_box(&w), &mut gradient).unwrap();
            black_box(&gradient);
        }
    });
    println!("\nGradient by all rest lengths, 20 edges: {:.2} µs.", time / 200.0 * 1e6);
}

fn design(path: &Path) -> Design {
    let name = path.file_name().unwrap().to_str().unwrap();
    let out = elaborate(name, &Folder(path.parent().unwrap().to_path_buf()), &Options::default());
    let first = || out.assembly?.designs.into_iter().next();
    out.design.or_else(first).expect("a sound design")
}

fn cycle(design: &Design) {
    println!("\n## The cycle of a design\n");
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(design, &solve_motion(design, &p).unwrap(), &p);
    let model = Model::new(design, &layout, &p, EDGES, true).unwrap();
    println!("| threads | rods | states | iterations | model ms | sweep ms | derivatives ms |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let building = least(0.5, || drop(black_box(Model::new(design, &layout, &p, EDGES, true))));
            let following = least(2.0, || drop(black_box(sweep(&model).unwrap())));
            let cycle = sweep(&model).unwrap();
            let derivatives = least(1.0, || {
                let mut workspace = SensitivityWorkspace::new(&model);
                for (s, e) in cycle.states.iter().take(layout.counted_states()).enumerate() {
                    black_box(workspace.at(&model, e, &layout.controls(s)).unwrap());
                }
            });
            let iterations: usize = cycle.states.iter().map(|e| e.iterations).sum();
            println!(
                "| {threads} | {} | {} | {iterations} | {:.2} | {:.2} | {:.2} (one thread) |",
                model.rods.len(),
                cycle.states.len(),
                building * 1e3,
                following * 1e3,
                derivatives * 1e3
            );
        });
    }
}

fn optimizer(design: &Design) {
    println!("\n## One iteration of the optimiser\n");
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(design, &solve_motion(design, &p).unwrap(), &p);
    println!("| threads | parameters | simulation ms | derivatives ms |\n| --- | --- | --- | --- |");
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let problem = Problem::new(design, &layout, EDGES);
            let x = problem.start();
            let simulation = least(2.0, || drop(black_box(problem.simulate(&x))));
            let trial = problem.simulate(&x).unwrap();
            let derivatives = least(2.0, || drop(black_box(problem.differentiate(&trial))));
            println!("| {threads} | {} | {:.2} | {:.2} |", x.len(), simulation * 1e3, derivatives * 1e3);
        });
    }
}

/// A whole optimisation, iteration by iteration.
fn path(design: &Design) {
    println!("\n## The way of the optimiser\n");
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(design, &solve_motion(design, &p).unwrap(), &p);
    let problem = Problem::new(design, &layout, EDGES);
    let names = problem.term_names().join(" | ");
    println!("| iteration | s | cost | {names} | largest error | largest stress |");
    println!("|{}", " --- |".repeat(problem.term_names().len() + 5));
    let began = Instant::now();
    let told = |at: &Iteration| {
        let terms: Vec<String> = at.terms.iter().map(|t| format!("{t:.3e}")).collect();
        println!(
            "| {} | {:.2} | {:.6e} | {} | {:.4} | {:.3} |",
            at.number,
            began.elapsed().as_secs_f64(),
            at.cost,
            terms.join(" | "),
            at.max_error_mm.unwrap_or(0.0),
            at.max_stress_mpa
        );
    };
    let found = optimize(problem, Method::LevenbergMarquardt, &p, 300, &AtomicBool::new(false), &told);
    println!("\n{:?} after {} iterations, {} cycles.", found.ending, found.iterations, found.simulations);
}

fn main() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut path = root.join("examples/chebyshev/chebyshev.mech");
    let mut only: Option<String> = None;
    // cargo itself adds `--bench`.
    let mut rest = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = rest.next() {
        let value = rest.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--design" => path = value.into(),
            "--only" => only = Some(value),
            _ => panic!("there is no {name}: --design, --only"),
        }
    }
    let wants = |part: &str| only.as_deref().is_none_or(|o| o == part);
    println!("# The numerical core");
    if wants("rod") {
        rod();
        adjoint();
    }
    if wants("cycle") {
        cycle(&design(&path));
    }
    if wants("optimizer") {
        optimizer(&design(&path));
    }
    if only.as_deref() == Some("path") {
        self::path(&design(&path));
    }
}
