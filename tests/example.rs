//! The shipped example, the whole way: what each stage makes of it, the same bytes again and again, and the
//! figures it has to reach. It is solved twice for all tests together: on one thread, and afresh on two.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{ExampleFiles, example, table};
use flexura::diagnostic::Severity;
use flexura::elaborate::{FileError, Files};
use flexura::equilibrium::{Layout, Model};
use flexura::geometry::{Mesh, Probe, check_mesh};
use flexura::kinematics::solve_motion;
use flexura::pipeline::{
    self, Artefact, BuildOutcome, Compiler, Iteration, Origin, Progress, Request, Show, Stages, build,
};
use std::cell::Cell;
use std::fmt::Write;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

const SOURCE: &str = "chebyshev.mech";

/// Counts the optimiser's iterations.
#[derive(Default)]
struct Counter(Cell<usize>);

impl Progress for Counter {
    fn seconds(&self) -> f64 {
        0.0
    }
    fn iteration(&self, iteration: &Iteration) {
        self.0.set(self.0.get().max(iteration.number + 1));
    }
}

/// Builds on a number of threads; also how often the optimiser reported.
fn build_on(
    threads: usize,
    compiler: Compiler,
    request: &Request,
    files: &(dyn Files + Sync),
) -> (BuildOutcome, usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let counter = Counter::default();
        let out = build(request, &compiler, files, &counter, &AtomicBool::new(false));
        (out, counter.0.get())
    })
}

fn request() -> Request {
    Request { source: SOURCE.into(), ..Request::default() }
}

/// The example solved from its own start on one thread.
fn solved() -> &'static BuildOutcome {
    static SOLVED: OnceLock<BuildOutcome> = OnceLock::new();
    SOLVED.get_or_init(|| build_on(1, Compiler::default(), &request(), &ExampleFiles).0)
}

fn locked() -> Request {
    Request { lock: Some(("chebyshev.lock".into(), solved().lock.clone().unwrap())), ..request() }
}

fn snapshot(name: &str, text: &str) {
    insta::with_settings!({ snapshot_path => "example/snapshots", prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!(name, text);
    });
}

fn same_bytes(a: &[Artefact], b: &[Artefact]) {
    let names = |list: &[Artefact]| list.iter().map(|x| x.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(a), names(b));
    for (a, b) in a.iter().zip(b) {
        assert!(a.bytes == b.bytes, "{} differs", a.name);
    }
}

/// A number as three significant digits.
fn three(x: f64) -> String {
    format!("{x:.2e}")
}

#[test]
fn its_tree_loses_nothing() {
    let text = example(SOURCE);
    let parse = flexura::syntax::parse(0, &text);
    assert_eq!(parse.tree.print(&text), text);
    snapshot("tree", &parse.tree.outline(&text));
}

#[test]
fn it_has_no_errors() {
    let out = pipeline::check(&request(), &Compiler::default(), &ExampleFiles);
    assert_eq!(out.diagnostics, [], "the check");
    // That values rest on their bounds is worth knowing, no more.
    let grave = solved().diagnostics.iter().filter(|d| d.severity > Severity::Advice);
    let findings: Vec<_> = grave.map(|d| (&d.code, &d.message)).collect();
    assert!(findings.is_empty(), "the build: {findings:?}");
}

/// Iterations and last digits may differ between machines: the lock is compared with three digits.
#[test]
fn the_lock_it_gives() {
    let lock = solved().lock.as_ref().unwrap();
    let mut text = String::new();
    for line in lock.lines() {
        let shown = match line.split_once(" = ").map(|(path, value)| (path, value.split_once(' '))) {
            Some((path, Some((number, unit)))) => {
                format!("{path} = {} {unit}", three(number.parse().unwrap()))
            }
            _ => match line.split_once(' ') {
                Some((word @ ("design" | "values" | "iterations" | "history"), _)) => format!("{word} …"),
                Some(("term", rest)) => format!("term {} …", rest.split(' ').next().unwrap()),
                _ => line.into(),
            },
        };
        writeln!(text, "{shown}").unwrap();
    }
    snapshot("lock", &text);
}

#[test]
fn the_sketch_it_gives() {
    let sketch = solved().artefacts.iter().find(|a| a.name.ends_with(".ino")).unwrap();
    snapshot("sketch", std::str::from_utf8(&sketch.bytes).unwrap());
}

/// A triangle count depends on the last digits of the boolean operations: it is bounded, not compared.
#[test]
fn the_solids_it_gives() {
    let mut text = String::new();
    for part in solved().artefacts.iter().filter(|a| a.name.ends_with(".stl")) {
        let facts = check_mesh(&read_stl(&part.bytes));
        assert!(facts.is_printable(), "{}: {facts:?}", part.name);
        assert!(facts.triangles < 200_000, "{}: {} triangles", part.name, facts.triangles);
        let (least, largest) = (facts.least, facts.largest);
        writeln!(text, "{}", part.name).unwrap();
        writeln!(text, "  closed {}, oriented {}, pieces {}", facts.closed, facts.oriented, facts.components)
            .unwrap();
        writeln!(text, "  volume {} mm3, area {} mm2", three(facts.volume_mm3), three(facts.area_mm2))
            .unwrap();
        for (axis, i) in [("x", 0), ("y", 1), ("z", 2)] {
            writeln!(text, "  {axis} {:.1} .. {:.1} mm", least[i], largest[i]).unwrap();
        }
    }
    snapshot("solids", &text);
}

/// Thickness and width of every leaf, measured on the emitted file, against the solved design's.
#[test]
fn the_leaves_of_the_part_are_as_thick_as_the_design_says() {
    /// Relative; a section's polygon is scaled to its semi-axes, so what is left is the curve between stations and
    /// single precision: 0.3 % measured.
    const TOLERANCE: f64 = 5e-3;
    let design = solved().design.as_ref().unwrap();
    let values = &solved().solution.as_ref().unwrap().values;
    let p: Vec<f64> = design.free.iter().map(|f| values[&f.path]).collect();
    let layout = Layout::new(design, &solve_motion(design, &p).unwrap(), &p);
    let model = Model::new(design, &layout, &p, 48, false).unwrap();
    // In the design's coordinates, not as it lies on the bed.
    let (parts, _) = Compiler::default().mesh(design, &p).unwrap();
    let base = parts.iter().find(|a| a.name.ends_with("_base.stl")).unwrap();
    let mesh = read_stl(&base.bytes);
    let probe = Probe::new(&mesh);
    for (rod, built) in design.rods.iter().zip(&model.rods) {
        let (rest, q) = (built.rod.rest_state(), built.rod.parameters());
        for k in [14, 20, 24, 28, 34] {
            let (from, to) = (rest.vertices[k], rest.vertices[k + 1]);
            let t = (to - from).normalize();
            let (m1, middle) = (rest.m1[k], (from + to) / 2.0);
            // Off the axis of symmetry by a hair, so that no ray runs along an edge of the mesh.
            let middle = middle + (t + t.cross(&m1)) * 1e-3;
            for (direction, wanted) in [(m1, 2.0 * q.a), (t.cross(&m1), 2.0 * q.b)] {
                let measured = probe.thickness_mm(&middle, &direction).unwrap();
                let relative = measured / wanted - 1.0;
                assert!(relative.abs() < TOLERANCE, "{} at edge {k}: {measured} mm, {wanted}", rod.path);
            }
        }
        assert!(2.0 * q.a >= design.process.least_wall_mm);
    }
}

fn read_stl(bytes: &[u8]) -> Mesh {
    let stl = stl_io::read_stl(&mut std::io::Cursor::new(bytes)).unwrap();
    Mesh {
        vertices: stl
            .vertices
            .iter()
            .map(|v| nalgebra::Vector3::from([v[0], v[1], v[2]].map(f64::from)))
            .collect(),
        triangles: stl.faces.iter().map(|f| f.vertices).collect(),
    }
}

#[test]
fn a_second_build_solves_nothing_and_gives_the_same_bytes() {
    let (again, iterations) = build_on(2, Compiler::default(), &locked(), &ExampleFiles);
    assert_eq!(iterations, 0);
    assert_eq!(again.solved_from, Origin::Lock);
    assert_eq!(again.lock, None);
    same_bytes(&solved().artefacts, &again.artefacts);
    assert_eq!(solved().after, again.after);
    assert_eq!(solved().before, again.before);
}

#[test]
fn solved_afresh_on_two_threads_it_is_the_same_bit_for_bit() {
    let fresh = Request { fresh: true, ..locked() };
    let (fresh, iterations) = build_on(2, Compiler::default(), &fresh, &ExampleFiles);
    assert!(iterations > 3, "it was solved: {iterations}");
    assert_eq!(solved().lock, fresh.lock);
    same_bytes(&solved().artefacts, &fresh.artefacts);
    assert_eq!(solved().after, fresh.after);
}

/// The table's own numbers, against the reference motion: nothing of `measure` is used here.
#[test]
fn simulate_on_the_lock_tells_the_errors_of_build() {
    let (out, simulation) =
        pipeline::simulate(&locked(), Show::default(), &Compiler::default(), &ExampleFiles);
    assert!(!out.failed(), "{:?}", out.diagnostics);
    let csv = flexura::emit::csv::write_csv(&simulation.unwrap().motion);
    let (header, rows) = table(&csv);
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (x, y, z) = (column("trace.tip.x_mm"), column("trace.tip.y_mm"), column("trace.tip.z_mm"));
    let (_, reference) = table(include_str!("reference/motion/chebyshev.csv"));
    assert_eq!((rows.len(), reference.len()), (61, 61));
    let errors: Vec<f64> = rows
        .iter()
        .zip(&reference)
        .map(|(a, b)| ((a[x] - b[1]).powi(2) + (a[y] - b[2]).powi(2) + (a[z] - b[3]).powi(2)).sqrt())
        .collect();
    let told = &solved().after.as_ref().unwrap().traces["tip"];
    let mean = errors[..60].iter().sum::<f64>() / 60.0;
    let most = errors.iter().copied().fold(0.0, f64::max);
    assert!((mean - told.mean_error_mm).abs() < 1e-9, "{mean} {}", told.mean_error_mm);
    assert!((most - told.max_error_mm).abs() < 1e-9, "{most} {}", told.max_error_mm);
    let stress = rows.iter().map(|r| r[column("stress_max_mpa")]).fold(0.0, f64::max);
    assert!((stress - solved().after.as_ref().unwrap().stress.max_mpa.unwrap()).abs() < 1e-9);
}

#[test]
fn it_moves_as_drawn_within_what_the_material_bears() {
    let (before, after) = (solved().before.as_ref().unwrap(), solved().after.as_ref().unwrap());
    let tip = &after.traces["tip"];
    assert!(before.traces["tip"].max_error_mm > 5.0, "the start is visibly off: {before:?}");
    assert!(tip.mean_error_mm <= 0.3, "{tip:?}");
    assert!(tip.max_error_mm <= 0.8, "{tip:?}");
    assert!(after.stress.max_mpa.unwrap() <= 26.0, "{:?}", after.stress);
    assert!(solved().requirements.iter().all(|r| r.pass), "{:?}", solved().requirements);
}

/// The example with tracking as its only goal.
struct TrackingAlone;

impl Files for TrackingAlone {
    fn read(&self, path: &str) -> Result<String, FileError> {
        let text = ExampleFiles.read(path)?;
        if path != SOURCE {
            return Ok(text);
        }
        let kept: Vec<&str> = text
            .lines()
            .filter(|l| !l.trim_start().starts_with("stress(") && !l.trim_start().starts_with("require"))
            .filter(|l| !l.trim_start().starts_with("export"))
            .collect();
        assert_eq!(kept.len() + 6, text.lines().count(), "one stress term, three requirements, two exports");
        Ok(kept.join("\n"))
    }
}

#[test]
fn tracking_alone_follows_within_twenty_iterations() {
    let compiler = Compiler { iterations: 20, ..Compiler::default() };
    let (out, _) = build_on(2, compiler, &request(), &TrackingAlone);
    assert!(!out.failed(), "{:?}", out.diagnostics);
    let (before, after) = (&out.before.unwrap().traces["tip"], &out.after.unwrap().traces["tip"]);
    assert!(before.max_error_mm > 5.0, "the start is visibly off: {before:?}");
    assert!(after.mean_error_mm < 0.02, "{after:?}");
    assert!(after.max_error_mm < 0.06, "{after:?}");
}

/// What the shipped design measures at other numbers of edges: the table at the end of `docs/optimizer.md`.
/// `cargo test --release --test example last_digit -- --ignored --nocapture`
#[test]
#[ignore = "prints a table"]
fn last_digit() {
    let out = pipeline::check(&request(), &Compiler::default(), &ExampleFiles);
    let design = out.design.unwrap();
    let lock = flexura::emit::lock::Lock::parse(&example("chebyshev.lock"), 0).unwrap();
    let p = lock.start_values(&design);
    let layout = Layout::new(&design, &solve_motion(&design, &p).unwrap(), &p);
    for edges in [10, 20, 40, 80, 160] {
        let model = Model::new(&design, &layout, &p, edges, false).unwrap();
        let cycle = flexura::equilibrium::sweep(&model).unwrap();
        let counted = &cycle.states[..layout.counted_states()];
        let trace = &layout.traces[0];
        let errors: Vec<f64> = counted
            .iter()
            .zip(&trace.target)
            .map(|(s, target)| (s.state.poses[trace.body].point(&trace.rest) - target).norm())
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let most = errors.iter().copied().fold(0.0, f64::max);
        let stress = counted.iter().map(|s| s.max_stress_mpa(&model)).fold(0.0, f64::max);
        let torque = counted.iter().map(|s| s.drive_load(&model, 0).abs()).fold(0.0, f64::max);
        println!("| {edges} | {mean:.3} | {most:.3} | {stress:.2} | {torque:.3} |");
    }
}
