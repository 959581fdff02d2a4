//! Instances: what is solved once and what apart, where everything stands, what motors in common bear, what is printed.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use flexura::elaborate::{Elaborated, Options, elaborate};
use flexura::equilibrium::{Layout, Model};
use flexura::geometry::joined::{Share, join};
use flexura::geometry::{
    BodySolid, Bore, Eye, Facets, Mesh, PartsInput, Probe, build_parts, check_mesh, parts_input,
};
use flexura::ir::{Assembly, Design, Placement, Quantity, Realization};
use flexura::kinematics::solve_motion;
use flexura::pipeline::{self, Artefact, Between, BuildOutcome, Checked, Compiler, Failed, Files, Iteration};
use flexura::pipeline::{Parts, Plans, Request, Show, Simulation, Solved, Stages};
use nalgebra::Vector3;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

const CAR: &str = include_str!("instances/car.mech");
const TWINS: &str = include_str!("instances/twins.mech");
/// Two solutions of one equilibrium by different ways, mm and N·mm; the solver stops at 1e-9 of its scale.
const SOLVED: f64 = 1e-6;

fn file(text: &str) -> BTreeMap<String, String> {
    BTreeMap::from([("main.mech".to_string(), text.to_string())])
}

fn run(text: &str, set: &[(&str, &str)]) -> Elaborated {
    let set = set.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    elaborate("main.mech", &file(text), &Options { set, ..Options::default() })
}

fn assembly(text: &str) -> Assembly {
    let out = run(text, &[]);
    assert_eq!(out.diagnostics, []);
    out.assembly.unwrap()
}

/// The real stages, counted.
#[derive(Default)]
struct Counted {
    compiler: Compiler,
    optimized: Cell<usize>,
    simulated: Cell<usize>,
}

impl Stages for Counted {
    fn check(
        &self,
        source: &str,
        set: &[(String, String)],
        steps: Option<usize>,
        variant: Option<&str>,
        files: &dyn Files,
    ) -> Checked {
        self.compiler.check(source, set, steps, variant, files)
    }
    fn rigid(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        self.compiler.rigid(design, values)
    }
    fn simulate(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        self.simulated.set(self.simulated.get() + 1);
        self.compiler.simulate(design, values)
    }
    fn between(&self, assembly: &Assembly, simulations: &[Simulation]) -> Between {
        self.compiler.between(assembly, simulations)
    }
    fn optimize(
        &self,
        design: &Design,
        start: &[f64],
        told: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed> {
        self.optimized.set(self.optimized.get() + 1);
        self.compiler.optimize(design, start, told, cancel)
    }
    fn parts(&self, assembly: &Assembly, values: &[Vec<f64>], plans: &Plans) -> Result<Parts, Failed> {
        self.compiler.parts(assembly, values, plans)
    }
}

fn build(text: &str, stages: &Counted, lock: Option<String>) -> BuildOutcome {
    let lock = lock.map(|l| ("main.lock".to_string(), l));
    let request = Request { source: "main.mech".into(), lock, ..Request::default() };
    pipeline::build(&request, stages, &file(text), &common::NoClock, &AtomicBool::new(false))
}

fn simulated(text: &str, steps: usize, poses: bool) -> Simulation {
    let request = Request { source: "main.mech".into(), steps: Some(steps), ..Request::default() };
    let show = Show { poses, rigid: false };
    let (out, found) = pipeline::simulate(&request, show, &Compiler::default(), &file(text));
    found.unwrap_or_else(|| panic!("{:?}", out.diagnostics))
}

/// Each design over its own cycle.
fn simulated_apart(a: &Assembly, values: &[Vec<f64>]) -> Vec<Simulation> {
    let simulated = |(d, v): (&Design, &Vec<f64>)| Compiler::default().simulate(d, v).unwrap();
    a.designs.iter().zip(values).map(simulated).collect()
}

#[test]
fn a_mechanism_by_itself_is_an_assembly_of_one() {
    let out = elaborate("chebyshev.mech", &common::ExampleFiles, &Options::default());
    let (design, assembly) = (out.design.unwrap(), out.assembly.unwrap());
    assert_eq!(assembly, Assembly::of(design.clone()));
    assert_eq!(assembly.single(), Some(&design));
}

#[test]
fn what_no_other_places_is_built_whatever_the_order() {
    let (head, car) = CAR.split_once("mechanism car").unwrap();
    let (uses, half) = head.split_once("mechanism half").unwrap();
    let turned = format!("{uses}\nmechanism car{car}\nmechanism half{half}");
    assert_eq!(assembly(&turned).name, "car");
    assert_eq!(run(head, &[]).design.unwrap().name, "half");
}

/// The halves share the arm: the left one sees the servo's angle reversed.
#[test]
fn an_image_goes_through_the_states_backwards_where_its_values_occur() {
    let a = assembly(CAR);
    assert_eq!((a.designs.len(), a.instances.len(), a.motors.len()), (1, 2, 1));
    assert_eq!(a.instances[1].states, (0..=8).rev().collect::<Vec<_>>());
    assert_eq!(a.instances[1].drives[0].sign, -1.0);
    let names: Vec<&str> = a.joined.iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["right_chassis", "right_arm"]);
    // Another printed pose is another design: the image would be bent the other way.
    let rested = CAR.replace("    trace wheel", "    rest servo at 5 deg\n    trace wheel");
    assert_eq!(assembly(&rested).designs.len(), 2);
    // Without a motor in common the image moves as an image: nothing is reversed in time.
    let apart = assembly(&CAR.replace("sharing chassis, arm", ""));
    assert_eq!((apart.designs.len(), apart.motors.len()), (1, 2));
    assert_eq!(apart.instances[1].states, [0_usize; 0]);
}

/// A swing to one side only: the left half is a design of its own, driven the other way.
#[test]
fn an_image_whose_values_do_not_occur_is_solved_apart() {
    let one_sided = CAR.replace("75 %: -12 deg", "75 %: 4 deg");
    let a = assembly(&one_sided);
    let names: Vec<&str> = a.designs.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names, ["half", "left"]);
    for t in [0.0, 0.1, 0.25, 0.6, 1.0] {
        assert_eq!(a.designs[1].drives[0].value(t), -a.designs[0].drives[0].value(t));
    }
}

/// Reordered states against the same half really driven the other way.
#[test]
fn reordered_states_are_those_of_the_half_driven_backwards() {
    let both = simulated(CAR, 8, true);
    let half = CAR.split_once("mechanism car").unwrap().0;
    let reversed = half.replace("25 %: 12 deg, 75 %: -12 deg", "25 %: -12 deg, 75 %: 12 deg");
    let alone = simulated(&reversed, 8, true);
    let columns = &both.motion.traces;
    assert_eq!(columns, &["right.wheel", "left.wheel"]);
    assert_eq!(both.motion.drives.len(), 1, "one motor");
    assert_eq!(both.motion.bodies, ["right.arm", "right.rod", "right.knuckle", "left.rod", "left.knuckle"]);
    for (s, (b, a)) in both.motion.states.iter().zip(&alone.motion.states).enumerate() {
        let [x, y, z] = a.traces_mm[0];
        let image = Vector3::new(-x, y, z);
        assert!((Vector3::from(b.traces_mm[1]) - image).norm() < SOLVED, "state {s}");
        assert!((both.errors_mm[1][s] - alone.errors_mm[0][s]).abs() < SOLVED);
        // A point of the left knuckle, moved by its pose in the assembly, against the image of the same point.
        let moved = |(t, r): &([f64; 3], [f64; 3]), p: Vector3<f64>| {
            Vector3::from(*t) + nalgebra::Rotation3::new(Vector3::from(*r)) * p
        };
        let p = Vector3::new(31.0, 7.0, 2.0);
        let there = moved(&a.poses[2], p);
        let here = moved(&b.poses[4], Vector3::new(-31.0, 7.0, 2.0));
        assert!((here - Vector3::new(-there.x, there.y, there.z)).norm() < SOLVED, "state {s}");
    }
}

/// The torque of the motor in common is the derivative of the energy of both halves.
#[test]
fn a_motor_in_common_bears_both_halves() {
    let half = CAR.split_once("mechanism car").unwrap().0;
    // Halves that are not alike: else the sum could be right by symmetry alone.
    let both = simulated(CAR, 96, false);
    let alone = simulated(half, 96, false);
    let (mut checked, mut largest) = (0, 0.0_f64);
    let states = &both.motion.states;
    for s in 2..states.len() - 2 {
        let step = |k: usize| states[k].drives[0] - states[k - 1].drives[0];
        if (step(s + 1) - step(s)).abs() > 1e-9 || (step(s - 1) - step(s)).abs() > 1e-9 {
            continue;
        }
        let slope = (states[s + 1].energy_n_mm - states[s - 1].energy_n_mm) / (2.0 * step(s));
        let torque = states[s].drive_loads[0];
        largest = largest.max(torque.abs());
        assert!((slope - torque).abs() < 2e-3 * largest.max(20.0), "state {s}: {slope} {torque}");
        checked += 1;
    }
    assert!(checked > 60, "{checked}");
    let one = alone.motion.states.iter().map(|s| s.drive_loads[0].abs()).fold(0.0, f64::max);
    assert!(largest > 1.5 * one, "{largest} of two, {one} of one");
}

/// Rounding of coordinates of 100 mm, summed over a cycle, mm: 1e-15 measured.
const PLACED_MM: f64 = 1e-11;

#[test]
fn equal_instances_are_solved_once_and_simulated_once() {
    let stages =
        Counted { compiler: Compiler { iterations: 1, ..Compiler::default() }, ..Counted::default() };
    let text = TWINS.replace("export stl", "");
    let out = build(&text, &stages, None);
    assert!(!out.failed(), "{:?}", out.diagnostics);
    // Three instances, one of them scaled: two designs, each solved once, simulated before and after.
    assert_eq!((stages.optimized.get(), stages.simulated.get()), (2, 4));
    let after = out.after.unwrap();
    // They stand elsewhere: sums along the path are rounded differently.
    let [one, two] = ["one.tip", "two.tip"].map(|n| &after.traces[n]);
    for (a, b) in [
        (one.mean_error_mm, two.mean_error_mm),
        (one.max_error_mm, two.max_error_mm),
        (one.path_length_mm, two.path_length_mm),
    ] {
        assert!((a - b).abs() < PLACED_MM, "{a} {b}");
    }
    assert_ne!(after.traces["one.tip"], after.traces["big.tip"]);
    let texts: Vec<&str> = out.requirements.iter().map(|r| r.text.as_str()).collect();
    assert_eq!(
        texts,
        [
            "lever: require max(stress()) <= 100 MPa",
            "big: require max(stress()) <= 100 MPa",
            "require max(error(big.tip)) <= 2 mm",
        ]
    );
    // The lock has both, and serves both.
    let lock = out.lock.unwrap();
    assert!(lock.contains("\nlever.leaf.thickness = ") && lock.contains("\nbig.leaf.thickness = "), "{lock}");
    let again = build(&text, &stages, Some(lock.clone()));
    assert_eq!((stages.optimized.get(), again.lock.as_ref()), (2, None));
    assert_eq!(again.requirements, out.requirements);
    // One design changes: the other's part of the lock still holds.
    let changed = build(&text.replace("scale = 1.5", "scale = 1.4"), &stages, Some(lock.clone()));
    assert_eq!(stages.optimized.get(), 3);
    let part = |lock: &str, name: &str| -> Vec<String> {
        lock.lines().filter(|l| l.starts_with(name)).map(String::from).collect()
    };
    let new = changed.lock.unwrap();
    assert_eq!(part(&new, "lever."), part(&lock, "lever."));
    assert_ne!(part(&new, "big."), part(&lock, "big."));
    // Moving an instance solves nothing.
    build(&text.replace("(0 mm, 90 mm)", "(0 mm, 94 mm)"), &stages, Some(lock));
    assert_eq!(stages.optimized.get(), 3);
}

#[test]
fn a_placed_instance_stands_where_it_is_put() {
    let moved = simulated(&TWINS.replace("export stl", ""), 4, false);
    let table = &moved.motion;
    assert_eq!(table.traces, ["one.tip", "two.tip", "big.tip"]);
    let drives: Vec<&str> = table.drives.iter().map(|d| d.0.as_str()).collect();
    assert_eq!(drives, ["one.leaf", "two.leaf", "big.leaf"]);
    for state in &table.states {
        let [one, two] = [0, 1].map(|k| Vector3::from(state.traces_mm[k]));
        // Turned by a quarter about z, then moved.
        let expected = Vector3::new(-20.0 - one.y, 20.0 + one.x, one.z);
        assert!((two - expected).norm() < 1e-9, "{two} {expected}");
        assert_eq!(state.drives[0], state.drives[1]);
    }
}

#[test]
fn scale_multiplies_what_is_drawn_and_nothing_else() {
    let chebyshev = common::example("chebyshev.mech");
    let text = format!(
        "{chebyshev}\nmechanism pair {{\n place a = chebyshev_lambda at (0 mm, 0 mm)\n \
         place b = chebyshev_lambda at (0 mm, 0 mm, 90 mm) scale = 0.5\n}}\n"
    );
    let a = assembly(&text);
    let [whole, half] = a.designs.as_slice() else { panic!("two designs") };
    assert_eq!((whole.name.as_str(), half.name.as_str()), ("chebyshev_lambda", "b"));
    let at = |d: &Design| d.exprs.evaluate(&d.free.iter().map(|f| f.start).collect::<Vec<_>>());
    let (w, h) = (at(whole), at(half));
    for (one, other) in whole.joints.iter().zip(&half.joints) {
        assert!((w.point(one.point) * 0.5 - h.point(other.point)).norm() < 1e-12);
        // A pin is bought.
        let pin = |r: &Realization| match r {
            Realization::Conventional { pin_diameter_mm } => *pin_diameter_mm,
            Realization::Compliant { .. } => None,
        };
        assert_eq!(pin(&one.realization), pin(&other.realization));
    }
    assert_eq!(half.layers.height_mm, 0.5 * whole.layers.height_mm);
    assert_eq!(half.process, whole.process);
    // The clearance between layers is the process's.
    let clearance = whole.process.clearance_mm;
    assert!((half.layers.pitch_mm - half.layers.height_mm - clearance).abs() < 1e-12);
    for (one, other) in whole.free.iter().zip(&half.free) {
        assert_eq!(one.path, other.path);
        let limit = |v: f64| if one.lower == whole.process.least_wall_mm { v } else { 0.5 * v };
        if one.unit == "mm" {
            assert!((other.upper - 0.5 * one.upper).abs() < 1e-12, "{}", one.path);
            assert!(
                (other.lower - limit(one.lower)).abs() < 1e-12
                    || (other.lower - 0.5 * one.lower).abs() < 1e-12,
                "{}",
                one.path
            );
            assert!((other.start - (0.5 * one.start).max(other.lower)).abs() < 1e-12, "{}", one.path);
        } else {
            assert_eq!((one.start, one.lower, one.upper), (other.start, other.lower, other.upper));
        }
    }
    // The gap between the leaves is a limit of the process: their centres lie (height + gap) / 2 apart.
    let apart = |d: &Design, v: &flexura::ir::expr::Evaluated| {
        let rods: Vec<_> = d.rods.iter().filter(|r| r.path.starts_with("knee.")).collect();
        (v.point(rods[0].from.position).z - v.point(rods[1].from.position).z).abs()
    };
    let (far, near) = (apart(whole, &w), apart(half, &h));
    let gap = 2.0 * far - whole.layers.height_mm;
    assert!((2.0 * near - half.layers.height_mm - gap).abs() < 1e-9, "{far} {near}");
    // Goals stay: an error allowed is an error allowed.
    assert_eq!(whole.requirements, half.requirements);
}

#[test]
fn parameters_of_placed_mechanisms_are_set_by_their_names() {
    let wide = run(TWINS, &[("lever.size", "50 mm")]);
    assert_eq!(wide.diagnostics, []);
    let d = &wide.assembly.unwrap().designs[0];
    let tip = d.exprs.evaluate(&d.free.iter().map(|f| f.start).collect::<Vec<_>>()).point(d.traces[0].point);
    assert!((tip.x - 50.0).abs() < 1e-12);
    for wrong in ["lever.sice", "leaver.size", "size"] {
        let codes: Vec<String> =
            run(TWINS, &[(wrong, "50 mm")]).diagnostics.into_iter().map(|d| d.code).collect();
        assert_eq!(codes, ["E0114"], "{wrong}");
    }
}

/// An assembly whose parts are written where they are in it, and not as they lie on a bed.
fn in_place(text: &str) -> Assembly {
    Assembly { exports: Vec::new(), ..assembly(text) }
}

fn meshes(out: &[Artefact]) -> Vec<(String, Mesh)> {
    out.iter()
        .map(|a| {
            let stl = stl_io::read_stl(&mut std::io::Cursor::new(&a.bytes)).unwrap();
            let vertices = stl.vertices.iter().map(|v| Vector3::new(v[0], v[1], v[2]).cast()).collect();
            let triangles = stl.faces.iter().map(|f| f.vertices).collect();
            (a.name.clone(), Mesh { vertices, triangles })
        })
        .collect()
}

/// The halves meet at the mirror plane: one closed solid, its own mirror image.
#[test]
fn a_mirrored_half_with_a_ground_in_common_is_printed_as_one_part() {
    let text = include_str!("instances/butterfly.mech");
    let a = in_place(text);
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let compiler = Compiler::default();
    let Parts { artefacts, diagnostics: found, .. } = compiler.parts(&a, &starts, &Plans::default()).unwrap();
    assert_eq!(found, []);
    let parts = meshes(&artefacts);
    let names: Vec<&str> = parts.iter().map(|p| p.0.as_str()).collect();
    assert_eq!(names, ["butterfly_right_base.stl"]);
    let facts = check_mesh(&parts[0].1);
    assert!(facts.is_printable(), "{facts:?}");
    assert!((facts.least.x + facts.largest.x).abs() < 1e-4, "{} {}", facts.least.x, facts.largest.x);
    // Twice a half, less what both have at the plane.
    let (half, _) = compiler.mesh(&a.designs[0], &starts[0]).unwrap();
    let half = check_mesh(&meshes(&half)[0].1);
    assert!(facts.volume_mm3 < 2.0 * half.volume_mm3 && facts.volume_mm3 > 1.8 * half.volume_mm3);
    // The same bytes again, and a solid to others too.
    assert_eq!(compiler.parts(&a, &starts, &Plans::default()).unwrap().artefacts, artefacts);
    // And where the links are known from the simulation.
    let simulations = simulated_apart(&a, &starts);
    let plans = Plans::of(&simulations, &compiler.between(&a, &simulations));
    assert!(plans.whole.is_some() && plans.designs.iter().all(Option::is_some));
    assert_eq!(compiler.parts(&a, &starts, &plans).unwrap().artefacts, artefacts);
    common::accepted_by_others(&artefacts);
    // Apart they are two parts of one common body, and that is told.
    let far = assembly(&text.replace("at (0 mm, 0 mm)", "at (30 mm, 0 mm)"));
    let Parts { artefacts, diagnostics: found, .. } =
        compiler.parts(&far, &starts, &Plans::default()).unwrap();
    assert_eq!(found.iter().map(|d| d.code.as_str()).collect::<Vec<_>>(), ["W0640"]);
    let parts = meshes(&artefacts);
    assert_eq!(parts.len(), 2);
    for (name, mesh) in &parts {
        let facts = check_mesh(mesh);
        assert!(facts.is_printable(), "{name} {facts:?}");
        assert!((facts.volume_mm3 - half.volume_mm3).abs() < 1e-3 * half.volume_mm3);
    }
}

/// The gap between two images is twice that of one of them to the mirror: of the disc round its tip, which goes with the
/// traced point.
#[test]
fn the_gap_between_instances_is_measured_in_every_state() {
    /// The disc is measured on its facets, which stand back from a circle of 4.6 mm by up to 0.006 mm, on both sides.
    const FACETS_MM: f64 = 0.015;
    // The arm stands beside the plane and swings to it.
    let head = TWINS.split_once("mechanism twins").unwrap().0.replace("= 40 mm", "= 80 mm");
    let pair = |x: f64| {
        format!(
            "{head}mechanism pair {{\n place right = lever at ({x} mm, 0 mm) turned 90 deg about z\n \
             mirror left = right across yz\n require min(gap(right)) >= 0.3 mm\n \
             require min(gap()) >= 0.3 mm\n}}\n"
        )
    };
    let text = pair(18.0);
    let a = assembly(&text);
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let simulations: Vec<Simulation> = simulated_apart(&a, &starts);
    let between = Compiler::default().between(&a, &simulations);
    assert_eq!(between.diagnostics, []);
    let tips: Vec<f64> =
        simulated(&text, 4, false).motion.states.iter().map(|s| s.traces_mm[0][0].abs()).collect();
    assert_eq!((between.gaps_mm.len(), tips.len()), (5, 5));
    // The disc ends the half as it was drawn, with the arm along x.
    let (half, _) = Compiler::default().mesh(&a.designs[0], &starts[0]).unwrap();
    let radius = check_mesh(&meshes(&half)[0].1).largest.x - 80.0;
    assert!(tips[4] < tips[0] - 5.0, "{tips:?}");
    // Before, the stubs of the leaves are nearer.
    for (gap, tip) in between.gaps_mm.iter().zip(&tips).skip(2) {
        assert!((gap - 2.0 * (tip - radius)).abs() < FACETS_MM, "{gap} {tip} {radius}");
    }
    // Nearer they collide on the way, which neither of them can know, and nothing is in the way at rest.
    let stages =
        Counted { compiler: Compiler { iterations: 0, ..Compiler::default() }, ..Counted::default() };
    let out = build(&pair(14.0), &stages, None);
    let codes: Vec<&str> = out.diagnostics.iter().map(|d| d.code.as_str()).collect();
    assert!(codes.contains(&"W0635") && codes.contains(&"E0801") && !codes.contains(&"E0641"), "{codes:?}");
    let gaps: Vec<(bool, bool)> = out
        .requirements
        .iter()
        .filter(|r| r.text.contains("gap"))
        .map(|r| (r.pass, r.value.unwrap() < 0.0))
        .collect();
    assert_eq!(gaps, [(true, false), (false, true)]);
    assert_eq!(out.after.unwrap().gap.least_mm, out.requirements.last().unwrap().value);
}

/// Another instance has a block of the common body where a leaf of the first one is: it makes way as a link of the leaf's own
/// instance does.
#[test]
fn a_common_body_makes_way_for_the_flexures_of_each_instance() {
    let a = assembly(TWINS);
    let design = &a.designs[0];
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(design, &solve_motion(design, &p).unwrap(), &p);
    let model = Model::new(design, &layout, &p, 48, false).unwrap();
    let input = parts_input(design, &layout, &model);
    let alone = build_parts(&input).unwrap();
    assert!(input.flexures[0].bodies.0 == 0 && !alone.carving.made(0, 0));
    let (leaf, k) = (&input.flexures[0], 24);
    let (middle, across) = (leaf.centreline[k], leaf.m1[k]);
    // Its boss is 7.4 mm wide: the middle of the leaf lies in it.
    let block = PartsInput {
        motion: Vec::new(),
        height_mm: 20.0,
        flexures: Vec::new(),
        bodies: vec![BodySolid {
            name: "base".into(),
            skeleton: vec![middle + across * (6.4 * across.y.signum()), Vector3::new(-20.0, 0.0, 0.0)],
            axis: Some(Vector3::z()),
            ..BodySolid::default()
        }],
        ..input.clone()
    };
    let block_parts = build_parts(&block).unwrap();
    let shares =
        [(&input, &alone, vec![0, 1]), (&block, &block_parts, vec![0])].map(|(input, parts, bodies)| Share {
            input,
            plans: &parts.plans,
            carving: &parts.carving,
            states: Vec::new(),
            placement: Placement::IDENTITY,
            bodies,
        });
    let whole = join(&shares, None).unwrap();
    let cut = whole.carving.cuts.iter().find(|c| (c.body, c.flexure) == (0, 0)).unwrap();
    assert!(cut.depth_mm > 0.5 && cut.made, "{cut:?}");
    let solids = whole.build(&[0, 1]).unwrap().0;
    assert_eq!(solids.len(), 1);
    assert!(check_mesh(&solids[0]).is_printable());
    let probe = Probe::new(&solids[0]);
    for k in [20, 24, 28] {
        // Off the axis of symmetry by a hair, so that no ray runs along an edge of the mesh.
        let at = leaf.centreline[k] + leaf.m2[k] * 1e-3;
        let thickness = probe.thickness_mm(&at, &leaf.m1[k]).unwrap();
        assert!((thickness / (2.0 * leaf.a_mm[k]) - 1.0).abs() < 5e-3, "{k}: {thickness}");
        let beside = at + across * (leaf.a_mm[k] + 0.1);
        assert!(probe.hollow_mm(&beside, &across).is_none_or(|w| w >= input.clearance_mm), "{k}");
    }
}

#[test]
fn instances_in_each_others_way_are_told() {
    let text = include_str!("instances/butterfly.mech").replace("sharing base", "");
    let a = assembly(&text);
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let Parts { artefacts, diagnostics: found, .. } =
        Compiler::default().parts(&a, &starts, &Plans::default()).unwrap();
    assert_eq!(found.iter().map(|d| d.code.as_str()).collect::<Vec<_>>(), ["E0641"]);
    let names: Vec<&str> = artefacts.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["butterfly_right_base.stl", "butterfly_left_base.stl"]);
    let volumes: Vec<f64> = meshes(&artefacts).iter().map(|m| m.1.volume_mm3()).collect();
    assert!(volumes[0] > 0.0 && (volumes[0] - volumes[1]).abs() < 1e-4 * volumes[0], "{volumes:?}");
}

/// Two levers on one base: the grounds overlap where they are merged.
#[test]
fn merged_grounds_are_one_part() {
    let text = TWINS.replace("place big = lever at (0 mm, 90 mm)    scale = 1.5", "").replace("big.", "two.");
    let a = assembly(&text);
    assert_eq!(a.joined.len(), 1);
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let Parts { artefacts, diagnostics: found, .. } =
        Compiler::default().parts(&a, &starts, &Plans::default()).unwrap();
    assert_eq!(found, []);
    let parts = meshes(&artefacts);
    assert_eq!(parts.iter().map(|p| p.0.as_str()).collect::<Vec<_>>(), ["twins_board.stl"]);
    assert!(check_mesh(&parts[0].1).is_printable());
    common::accepted_by_others(&artefacts);
}

/// Four levers round one boss: it is there once, and the bars that leave it have their faces in one plane.
#[test]
fn merged_grounds_that_coincide_are_one_sound_part() {
    let head = TWINS.split_once("mechanism twins").unwrap().0;
    let text = format!(
        "{head}mechanism star {{\n ground board {{ }}\n \
         place one = lever at (0 mm, 0 mm) merging base into board\n \
         place two = lever at (-20 mm, 20 mm) turned 90 deg about z merging base into board\n \
         place three = lever at (-40 mm, 0 mm) turned 180 deg about z merging base into board\n \
         place four = lever at (-20 mm, -20 mm) turned 270 deg about z merging base into board\n export stl\n}}\n"
    );
    let a = assembly(&text);
    assert_eq!((a.joined.len(), a.instances.len()), (1, 4));
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let Parts { artefacts, diagnostics: found, .. } =
        Compiler::default().parts(&a, &starts, &Plans::default()).unwrap();
    assert_eq!(found, []);
    let [(name, mesh)] = meshes(&artefacts).try_into().unwrap();
    let facts = check_mesh(&mesh);
    assert!(name == "star_board.stl" && facts.is_printable(), "{name}: {facts:?}");
    common::accepted_by_others(&artefacts);
}

/// Two levers that do not touch, on a board with points of its own.
fn board(points: &str) -> (Vec<(String, Mesh)>, Vec<String>) {
    let text = TWINS
        .replace("place big = lever at (0 mm, 90 mm)    scale = 1.5", "")
        .replace("big.", "two.")
        .replace("at (-20 mm, 20 mm)  turned 90 deg about z ", "at (0 mm, 0 mm, 40 mm)")
        .replace("ground board { }", &format!("{points}\n"))
        .replace("export stl", "export stl(assembled)");
    let a = assembly(&text);
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let Parts { artefacts, diagnostics: found, .. } =
        Compiler::default().parts(&a, &starts, &Plans::default()).unwrap();
    (meshes(&artefacts), found.into_iter().map(|d| d.code).collect())
}

/// Bars through the assembly's own points join grounds that stand apart; without them there are two pieces.
#[test]
fn a_ground_with_points_joins_what_is_merged_into_it() {
    let (pieces, found) = board("ground board { }");
    assert_eq!((pieces.len(), found), (2, vec!["W0640".to_string()]));
    let (parts, found) = board(
        "point A = (-20 mm, 0 mm)
        point B = (-20 mm, 0 mm, 40 mm)
        ground board { A, B }",
    );
    assert_eq!(found, [""; 0]);
    assert_eq!(parts.iter().map(|p| p.0.as_str()).collect::<Vec<_>>(), ["assembled/twins_board.stl"]);
    assert!(check_mesh(&parts[0].1).is_printable());
    let alone: f64 = pieces.iter().map(|p| p.1.volume_mm3()).sum();
    assert!(parts[0].1.volume_mm3() > alone);
    // Half-way there is nothing but the bar.
    let wall = Probe::new(&parts[0].1).thickness_mm(&Vector3::new(-20.1, 0.05, 20.02), &Vector3::x());
    assert!(wall.is_some_and(|w| w > 4.0), "{wall:?}");
}

/// What moves must keep clear of the bars too.
#[test]
fn bars_of_a_board_can_stand_in_the_way() {
    let (_, found) = board(
        "point A = (30 mm, 0 mm, -20 mm)
        point B = (30 mm, 0 mm, 20 mm)
        point C = (-20 mm, 0 mm, 0 mm)
        ground board { A, B, C }",
    );
    assert!(found.contains(&"E0641".to_string()), "{found:?}");
}

/// Where a merged ground of another instance runs through a bore, the bore is cut again.
#[test]
fn a_bore_stays_open_in_a_merged_body() {
    let v = Vector3::new;
    let bar = |points: [Vector3<f64>; 2], bored: bool| {
        let at = Eye {
            joint: 0,
            point: v(0.0, 0.0, 0.0),
            axis: v(0.0, 0.0, 1.0),
            bore: Bore::Through { diameter_mm: 5.0 },
            slot: (0, 1),
        };
        let body = BodySolid {
            name: "base".into(),
            level_mm: 0.0,
            skeleton: points.to_vec(),
            eyes: if bored { vec![at] } else { Vec::new() },
            axis: Some(v(0.0, 0.0, 1.0)),
            ..BodySolid::default()
        };
        let input = PartsInput {
            motion: Vec::new(),
            height_mm: 8.0,
            clearance_mm: 0.3,
            least_wall_mm: 0.6,
            bodies: vec![body],
            flexures: Vec::new(),
            facets: Facets::default(),
        };
        let parts = build_parts(&input).unwrap();
        (input, parts)
    };
    let bored = bar([v(0.0, 0.0, 0.0), v(30.0, 0.0, 0.0)], true);
    let plain = bar([v(0.0, -20.0, 0.0), v(0.0, 20.0, 0.0)], false);
    let place = |x: f64| Placement::new(&nalgebra::Matrix3::identity(), &v(x, 0.0, 0.0));
    let united = |x: f64| {
        let shares = [(&bored, 0.0), (&plain, x)].map(|((input, p), x)| Share {
            input,
            plans: &p.plans,
            carving: &p.carving,
            states: Vec::new(),
            placement: place(x),
            bodies: vec![0],
        });
        join(&shares, None).unwrap().build(&[0]).unwrap().0
    };
    for x in [0.5, 12.0] {
        let solids = united(x);
        assert_eq!(solids.len(), 1);
        let facts = check_mesh(&solids[0]);
        assert!(facts.is_printable(), "{facts:?}");
        for direction in [v(1.0, 0.0, 0.0), v(0.3, 1.0, 0.0)] {
            let width = Probe::new(&solids[0]).hollow_mm(&v(0.0, 0.0, 0.1), &direction).unwrap();
            assert!((5.0..5.1).contains(&width), "{x}: {width}");
        }
    }
}

#[test]
fn a_query_can_be_put_to_one_instance() {
    let text = CAR.replace(
        "export stl",
        "require min(gap(left)) >= -5 mm\n    require max(stress(left)) <= 1 GPa\n    export stl",
    );
    let a = assembly(&text);
    let found: Vec<_> = a.requirements.iter().map(|r| (r.instance, r.requirement.quantity.clone())).collect();
    assert_eq!(found[3], (Some(1), Quantity::Gap));
    assert_eq!(found[4], (Some(1), Quantity::Stress));
    assert_eq!(found[1], (None, Quantity::Stress));
}

/// An image's own motor turns the other way; a motor in common has one sketch, whoever asks for it.
#[test]
fn sketches_are_those_of_the_motors() {
    let stages =
        Counted { compiler: Compiler { iterations: 0, ..Compiler::default() }, ..Counted::default() };
    let sketch = |text: &str| -> Vec<(String, Vec<i64>)> {
        let out = build(text, &stages, None);
        let positions = |a: &Artefact| {
            let text = String::from_utf8(a.bytes.clone()).unwrap();
            let table = text.split_once("] PROGMEM = {").or(text.split_once("] = {")).expect("a table").1;
            let table = table.split_once('}').unwrap().0;
            table.split(',').filter_map(|n| n.trim().parse().ok()).collect()
        };
        out.artefacts.iter().map(|a| (a.name.clone(), positions(a))).collect()
    };
    let shared = sketch(&CAR.replace("export stl, arduino(right.servo)", "export arduino(left.servo)"));
    assert_eq!(shared[0].0, "car_right_servo/car_right_servo.ino");
    let own = CAR.replace("sharing chassis, arm", "sharing chassis");
    let own = sketch(
        &own.replace("export stl, arduino(right.servo)", "export arduino(right.servo), arduino(left.servo)"),
    );
    assert_eq!(own[1].0, "car_left_servo/car_left_servo.ino");
    assert_eq!(own[0].1, shared[0].1);
    assert!(own[0].1.len() > 8 && own[0].1.iter().any(|n| *n != 0), "{own:?}");
    assert_eq!(own[1].1, own[0].1.iter().map(|n| -n).collect::<Vec<_>>());
}

/// Ground and arm in common, each half hanging on both by its flexures: one closed solid, its own mirror image.
#[test]
fn halves_with_a_moving_body_in_common_are_printed_as_one_part() {
    // An arm so wide that the leaves of one half keep clear of the other.
    let a = in_place(&CAR.replace("R = (14 mm, 24 mm)", "R = (20 mm, 24 mm)"));
    let starts: Vec<Vec<f64>> = a.designs.iter().map(|d| d.free.iter().map(|f| f.start).collect()).collect();
    let Parts { artefacts, diagnostics: found, .. } =
        Compiler::default().parts(&a, &starts, &Plans::default()).unwrap();
    assert_eq!(found, []);
    let parts = meshes(&artefacts);
    assert_eq!(parts.iter().map(|p| p.0.as_str()).collect::<Vec<_>>(), ["car_right_chassis.stl"]);
    let facts = check_mesh(&parts[0].1);
    assert!(facts.is_printable(), "{facts:?}");
    assert!((facts.least.x + facts.largest.x).abs() < 1e-4);
    common::accepted_by_others(&artefacts);
    // The shaft still passes the eyes of both halves (above the slot between them): 5 mm and the process's room.
    let probe = Probe::new(&parts[0].1);
    let width = probe.hollow_mm(&Vector3::new(0.0, 0.0, -9.3), &Vector3::new(1.0, 0.2, 0.0)).unwrap();
    assert!((5.0..6.0).contains(&width), "{width}");
}
