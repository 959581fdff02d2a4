//! Flexures of every kind: the compliant joint against the conventional one and against closed forms of beam theory.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Equilibrium, Layout, Model, PointForce, SensitivityWorkspace, Solver, sweep};
use flexura::ir::{Design, RodEnd};
use flexura::kinematics::{Motion, solve_motion};
use flexura::optimize::Problem;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

mod common;

const EDGES: usize = 20;
/// Rigur's.
const E_MPA: f64 = 1900.0;
/// Closed forms of small deflections are met to this once the discretisation, which falls as h², is taken out.
const CLOSED_FORM: f64 = 3e-4;

fn design(text: &str, set: &[(&str, &str)]) -> Design {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let set = set.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    let found = elaborate("main.mech", &files, &Options { set, ..Options::default() });
    assert_eq!(found.diagnostics, [], "{text}");
    found.design.unwrap()
}

struct Solved {
    design: Design,
    motion: Motion,
    layout: Layout,
    p: Vec<f64>,
}

fn solved(text: &str, set: &[(&str, &str)]) -> Solved {
    let design = design(text, set);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let motion = solve_motion(&design, &p).unwrap();
    let layout = Layout::new(&design, &motion, &p);
    Solved { design, motion, layout, p }
}

impl Solved {
    fn model(&self, edges: usize) -> Model<'_> {
        Model::new(&self.design, &self.layout, &self.p, edges, false).unwrap()
    }

    fn states(&self) -> Vec<Equilibrium> {
        let states = sweep(&self.model(EDGES)).unwrap().states;
        assert!(states.iter().all(|s| s.stable), "{}", self.design.name);
        states
    }

    /// Largest distance of the first trace from its target, mm.
    fn error_mm(&self) -> f64 {
        let trace = &self.layout.traces[0];
        let at = |e: &Equilibrium| e.state.poses[trace.body].point(&trace.rest);
        let states = self.states();
        states.iter().zip(&trace.target).map(|(e, t)| (at(e) - t).norm()).fold(0.0, f64::max)
    }

    /// Load of the first drive at its last state, N·mm or N, extrapolated from 20 and 40 edges, and the drive's value
    /// from rest there.
    fn last_load(&self) -> (f64, f64) {
        let [coarse, fine] = [EDGES, 2 * EDGES].map(|edges| {
            let model = self.model(edges);
            sweep(&model).unwrap().states.last().unwrap().drive_load(&model, 0)
        });
        let square = |edges: usize| ((edges - 1) as f64).powi(2);
        let weight = square(EDGES) / (square(2 * EDGES) - square(EDGES));
        let drive = &self.layout.drives[0];
        (fine + (fine - coarse) * weight, drive.values.last().unwrap() - drive.rest)
    }

    fn body(&self, name: &str) -> usize {
        self.design.bodies.iter().position(|b| b.name == name).unwrap()
    }
}

fn ellipse_inertia(thick: f64, wide: f64) -> f64 {
    std::f64::consts::PI * thick.powi(3) * wide / 64.0
}

const HEAD: &str = "use std.materials.rigur\nuse std.processes.polyjet\n";
/// Closed forms are those of slender rods; what the corrected model adds is held against finite elements in `fea.rs`.
const TAIL: &str = "    material rigur\n    print on polyjet\n    model plain\n";

/// A four-bar in space whose coupler hangs in two wires: base hinge O, crank tip A, rocker tip B, rocker hinge D.
fn wire_four_bar(length: f64, diameter: f64) -> String {
    format!(
        "{HEAD}use std.flexures.wire
mechanism four_bar {{
    point O = (0 mm, 0 mm, 0 mm)
    point A = (0 mm, 30 mm, 0 mm)
    point B = (60 mm, 40 mm, 15 mm)
    point D = (60 mm, 0 mm, 15 mm)
    point P = A + 0.5 * (B - A)
    ground base    {{ O, D }}
    link   crank   {{ O, A }}
    link   coupler {{ A, B, P }}
    link   rocker  {{ B, D }}
    hinge motor: base to crank   at O axis z
    ball  first: crank to coupler at A into crank toward A + (A - B) as wire {{ size = {length} mm / 2, diameter = {diameter} mm }}
    ball  last:  coupler to rocker at B into rocker toward B + (B - A) as wire {{ size = {length} mm / 2, diameter = {diameter} mm }}
    hinge heel:  base to rocker  at D axis z
{TAIL}    cycle 10 steps over 1 s
    drive motor from -15 deg to 15 deg
    trace tip = P on coupler
}}
"
    )
}

/// A wire bent by θ shortens the way between its ends by L θ²/24 and shifts its centre by about as much; the coupler's
/// end follows, and the trace by no more than the coupler is long. What stays when L goes to zero is drive against
/// stiffness: no load acts, so nothing.
#[test]
fn a_coupler_on_wires_follows_the_conventional_path() {
    let turned = solved(&wire_four_bar(10.0, 0.2), &[]);
    // Largest turn of the coupler against crank and rocker over the drive's ±15°.
    let mut largest = 0.0f64;
    for state in &turned.motion.states {
        for (a, b) in [("crank", "coupler"), ("coupler", "rocker")] {
            let [a, b] = [a, b].map(|n| state.poses[turned.body(n)].rotation);
            largest = largest.max(((a.transpose() * b).trace() * 0.5 - 0.5).clamp(-1.0, 1.0).acos());
        }
    }
    let mut errors = Vec::new();
    for length in [10.0, 5.0] {
        let found = solved(&wire_four_bar(length, length / 50.0), &[]).error_mm();
        let bound = 2.0 * length * largest * largest / 24.0 * 2.0;
        assert!(found > 1e-4 && found < bound, "length {length}: {found} mm of {bound} mm, turn {largest}");
        errors.push(found);
    }
    // Scaled wires stray in proportion.
    assert!((1.8..2.3).contains(&(errors[0] / errors[1])), "{errors:?}");
}

/// A plate on a slider: driven along y, held by leaves only.
fn slide(template: &str, clauses: &str, to_mm: f64) -> String {
    format!(
        "{HEAD}use std.flexures.{template}
mechanism slide {{
    point S = (0 mm, 0 mm)
    point M = (50 mm, 0 mm)
    point Q = (-30 mm, 20 mm)
    ground base  {{ S, M }}
    link   crank {{ M, Q }}
    link   plate {{ S }}
    hinge  idle:  base to crank at M axis z
    slider guide: base to plate at S axis y as {template} {{ {clauses} }}
{TAIL}    links height 10 mm
    cycle 2 steps over 1 s
    drive guide from 0 mm to {to_mm} mm
    drive idle from 0 deg to 1 deg
    trace edge = Q on plate
}}
"
    )
}

/// Two guided leaves: 2 · 12 EI/L³. The next order of the stiffness is (δ/L)².
#[test]
fn parallel_leaves_have_the_stiffness_of_guided_beams() {
    let found =
        solved(&slide("parallel_leaves", "length = 30 mm, apart = 24 mm, thickness = 0.6 mm", 0.1), &[]);
    let (force, way) = found.last_load();
    let want = 2.0 * 12.0 * E_MPA * ellipse_inertia(0.6, 10.0) / 30f64.powi(3);
    assert!((force / way / want - 1.0).abs() < CLOSED_FORM, "{force} N at {way} mm, {want} N/mm");
    // It strays towards the first body by 3 δ²/(5 L).
    let states = found.states();
    let plate = &states[states.len() - 1].state.poses[found.body("plate")];
    let strays = plate.translation.x;
    let want = 0.6 * way * way / 30.0;
    assert!((strays / want - 1.0).abs() < 0.02, "{} of {want} mm", plate.translation);
    assert!(plate.translation.z.abs() < 1e-9 && (plate.rotation - Matrix3::identity()).norm() < 1e-6);
}

/// Two such pairs in series are half as stiff, and what one strays the other takes back.
#[test]
fn folded_leaves_are_half_as_stiff_and_do_not_stray() {
    let text = slide("folded_leaves", "length = 30 mm, inner = 20 mm, step = 6 mm, thickness = 0.6 mm", 0.5);
    let found = solved(&text, &[]);
    let (force, way) = found.last_load();
    let want = 12.0 * E_MPA * ellipse_inertia(0.6, 10.0) / 30f64.powi(3);
    assert!((force / way / want - 1.0).abs() < CLOSED_FORM, "{force} N at {way} mm, {want} N/mm");
    let states = found.states();
    let last = &states[states.len() - 1].state;
    let (plate, shuttle) = (&last.poses[found.body("plate")], &last.poses[found.body("guide.shuttle")]);
    let each = 0.6 * (way / 2.0).powi(2) / 30.0;
    assert!((shuttle.translation.y - way / 2.0).abs() < 1e-3 * way, "{}", shuttle.translation);
    assert!((shuttle.translation.x.abs() / each - 1.0).abs() < 0.02, "{} {each}", shuttle.translation);
    assert!(plate.translation.x.abs() < 0.02 * each, "{} {each}", plate.translation);
}

/// The plate turns on a driven hinge about one axis, beside the leaves at the same point.
fn gimbal(driven: &str) -> String {
    format!(
        "{HEAD}use std.flexures.universal_leaves
mechanism gimbal {{
    point C = (0 mm, 0 mm, 0 mm)
    point M = (50 mm, 0 mm, -20 mm)
    point Q = (0 mm, 0 mm, 40 mm)
    ground base  {{ C, M }}
    link   crank {{ M }}
    link   plate {{ C, Q }}
    hinge  idle:  base to crank at M axis y
    universal cross: base to plate at C axis y and x into plate toward Q as universal_leaves {{ size = 10 mm, outer = 0.6 mm, inner = 0.8 mm, strip = 4 mm }}
    hinge  shaft: base to plate at C axis {driven}
{TAIL}    cycle 2 steps over 1 s
    drive shaft from 0 deg to 0.1 deg
    drive idle from 0 deg to 1 deg
    trace tip = Q on plate
}}
"
    )
}

/// About each axis one pair of strips bends; the other, whose strips stand apart along the first, is 3000 times as
/// stiff. The shaft holds what bending would shorten by L θ²/24: at 0.1° that adds 4e-4.
#[test]
fn universal_leaves_bend_about_each_of_their_axes() {
    for (axis, thick) in [("y", 0.6), ("x", 0.8)] {
        let (torque, angle) = solved(&gimbal(axis), &[]).last_load();
        let want = 2.0 * E_MPA * ellipse_inertia(thick, 4.0) / 20.0;
        let found = torque / angle / want;
        assert!((found - 1.0).abs() < 1e-3, "{axis}: {torque} N mm at {angle} rad: {found}");
    }
}

/// Three bodies on one axis; `exchanged` names b and c the other way round.
fn three(exchanged: bool) -> String {
    let order = if exchanged { "right, left" } else { "left, right" };
    format!(
        "{HEAD}use std.flexures.coupled_leaves
mechanism three {{
    point O = (0 mm, 0 mm)
    point B = (0 mm, -30 mm)
    point L = (-26 mm, 15 mm)
    point R = (26 mm, 15 mm)
    ground base  {{ O, B }}
    link   left  {{ O, L }}
    link   right {{ O, R }}
    link   ties  {{ B }}
    hinge  idle:  base to ties at B
    hinge  many:  base to {order} at O into left toward L into right toward R as coupled_leaves
    hinge  turn:  base to left at O layer 1
    hinge  other: base to right at O layer -1
{TAIL}    cycle 2 steps over 1 s
    drive turn from 0 deg to 10 deg
    drive other from 0 deg to -10 deg
    drive idle from 0 deg to 1 deg
    trace end = L on left
}}
"
    )
}

/// Which body is b and which c only mirrors the stack of leaves along the axis.
#[test]
fn coupled_leaves_do_not_know_the_order_of_their_bodies() {
    let (one, other) = (solved(&three(false), &[]), solved(&three(true), &[]));
    let loads = |s: &Solved| {
        let model = s.model(EDGES);
        let states = sweep(&model).unwrap().states;
        let last = &states[states.len() - 1];
        ([last.drive_load(&model, 0), last.drive_load(&model, 1)], last.energy_n_mm)
    };
    let (a, b) = (loads(&one), loads(&other));
    assert!(a.1 > 0.1);
    for (x, y) in [(a.0[0], b.0[0]), (a.0[1], b.0[1]), (a.1, b.1)] {
        assert!((x - y).abs() < 1e-6 * x.abs(), "{a:?} {b:?}");
    }
    // Mirrored halves, driven alike: equal and opposite torques.
    assert!((a.0[0] + a.0[1]).abs() < 1e-6 * a.0[0].abs(), "{a:?}");
}

fn knee(template: &str, clauses: &str) -> String {
    format!(
        "{HEAD}use std.flexures.{template}
mechanism knee {{
    point O = (0 mm, 0 mm)
    point B = (-45 mm, 0 mm)
    point T = (45 mm, 0 mm)
    ground base {{ B, O }}
    link   shin {{ O, T }}
    link   idler {{ B }}
    hinge  idle: base to idler at B
    hinge  bend: base to shin at O into shin toward T as {template} {{ {clauses} }}
{TAIL}    links height 8 mm
    cycle 2 steps over 1 s
    drive bend from 0 deg to 5 deg
    drive idle from 0 deg to 1 deg
    trace tip = T on shin
}}
"
    )
}

/// The drive turns the flexure and leaves it free otherwise: a straight leaf bends to a circle, M = EI θ/L.
#[test]
fn a_leaf_has_the_stiffness_of_its_beam() {
    let found = solved(&knee("leaf", "size = 12 mm, thickness = 0.6 mm"), &[]);
    let (torque, angle) = found.last_load();
    let want = E_MPA * ellipse_inertia(0.6, 8.0) / 24.0 * angle;
    assert!((torque / want - 1.0).abs() < CLOSED_FORM, "{torque} {want}");
}

/// Its hub stays in the middle, half turned, and its axis more true than that of a single leaf.
#[test]
fn a_cartwheel_is_centred_by_its_hub() {
    let wheel = solved(&knee("cartwheel", "size = 12 mm, thickness = 0.6 mm"), &[]);
    let states = wheel.states();
    let last = &states[states.len() - 1].state;
    let hub = &last.poses[wheel.body("bend.hub")];
    let angle = wheel.layout.drives[0].values[2];
    assert!((hub.rotation[(1, 0)].asin() / angle - 0.5).abs() < 1e-6, "{}", hub.rotation);
    let leaf = solved(&knee("leaf", "size = 12 mm, thickness = 0.6 mm"), &[]);
    // Under a force across the free end, the pivot gives way less.
    let gives = |s: &Solved| {
        let model = s.model(EDGES);
        let states = sweep(&model).unwrap().states;
        let (drives, free) = (&s.layout.drives, &states[states.len() - 1]);
        let target: Vec<f64> = drives.iter().map(|d| d.values[2] - d.rest).collect();
        let shin = s.body("shin");
        let load = PointForce { body: shin, rest: Vector3::zeros(), force_n: Vector3::y() * 0.05 };
        let moved = Solver::new(&model).load(&model, free, &target, &[load]).unwrap();
        let at = |e: &Equilibrium| e.state.poses[shin].point(&Vector3::zeros());
        (at(&moved) - at(free)).norm()
    };
    assert!(gives(&wheel) < 0.5 * gives(&leaf), "{} {}", gives(&wheel), gives(&leaf));
}

/// Frames as documented in `ir::RodEnd`, checked on a gimbal whose bodies lie on opposite sides.
#[test]
fn end_frames_follow_the_kind_of_joint() {
    let found = solved(&gimbal("y"), &[]);
    let frames = |rod: &str| {
        let i = found.design.rods.iter().position(|r| r.path == rod).unwrap();
        (&found.layout.rod_ends[i], &found.design.rods[i])
    };
    let (ends, _) = frames("cross.outer_left");
    let column = |k: usize, c: usize, ends: &[flexura::equilibrium::RodEndFrame; 2]| {
        ends[k].axes.column(c).into_owned()
    };
    // The base lies below, the ring takes the frame of the rod's other end.
    for k in [0, 1] {
        assert!((column(k, 2, ends) - Vector3::y()).norm() < 1e-12);
        assert!((column(k, 0, ends) + Vector3::z()).norm() < 1e-12);
    }
    let (ends, rod) = frames("cross.inner_left");
    assert!(rod.second_axis);
    let ring = found.body("cross.ring");
    assert_eq!((rod.from.body, rod.to.body), (ring, found.body("plate")));
    assert_eq!(found.design.bodies[ring].owner, Some(rod.joint));
    for k in [0, 1] {
        assert!((column(k, 2, ends) - Vector3::x()).norm() < 1e-12);
        assert!((column(k, 0, ends) - Vector3::z()).norm() < 1e-12);
    }
    // The conventional mechanism carries the ring with the base.
    let rest = &found.motion.rest.poses;
    assert_eq!(rest[ring], rest[found.body("base")]);
    assert_eq!(found.motion.mobility.moving_bodies, 2);
    let _: &RodEnd = &rod.from;

    let slider = solved(&slide("parallel_leaves", "", 0.1), &[]);
    for end in slider.layout.rod_ends.iter().flatten() {
        // The base lies at +x, the motion is y, the leaves are wide along z.
        assert!((end.axes - Matrix3::identity()).norm() < 1e-12, "{}", end.axes);
    }
    let wires = solved(&wire_four_bar(10.0, 0.4), &[]);
    let way = Vector3::new(60.0, 10.0, 15.0).normalize();
    let [crank, coupler] = &wires.layout.rod_ends[0];
    assert!((crank.axes.column(0) + way).norm() < 1e-12 && (coupler.axes.column(0) - way).norm() < 1e-12);
    assert!(coupler.axes.column(2).z > 0.9 && coupler.axes.column(2).dot(&way).abs() < 1e-12);
}

/// Links, multipliers and the gradient of an objective by the parameters, with wires, three bodies and bodies of
/// flexures' own, against differences of fourth order.
#[test]
fn derivatives_hold_with_flexures_of_every_kind() {
    let all = [("eye", 3), ("car", 3), ("jansen", 2)];
    for (name, some) in if common::skipped() { &all[..1] } else { &all[..] } {
        let path = format!("{}/tests/mechanisms/{name}.mech", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        let files = BTreeMap::from([("main.mech".to_string(), text)]);
        let options = Options { steps: Some(4), ..Options::default() };
        let design = elaborate("main.mech", &files, &options).design.unwrap();
        let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
        let layout = Layout::new(&design, &solve_motion(&design, &start).unwrap(), &start);
        let p: Vec<f64> =
            common::shaken(&design, 7).iter().zip(&start).map(|(s, p)| p + 0.3 * (s - p)).collect();
        let states_at =
            |p: &[f64]| sweep(&Model::new(&design, &layout, p, 12, false).unwrap()).unwrap().states;
        let model = Model::new(&design, &layout, &p, 12, true).unwrap();
        let states = sweep(&model).unwrap().states;
        let mut workspace = SensitivityWorkspace::new(&model);
        let row = model.rows() - 1;
        let size = states.iter().map(|e| e.state.lambda[row].abs()).fold(1.0, f64::max);
        let mut worst = 0.0f64;
        for i in (0..p.len()).step_by(p.len() / some) {
            let width = design.free[i].upper - design.free[i].lower;
            let step = 1e-3 * width;
            let shifted = [-2.0, -1.0, 1.0, 2.0].map(|k| {
                let mut q = p.clone();
                q[i] += k * step;
                states_at(&q)
            });
            for (s, state) in states.iter().enumerate() {
                let target: Vec<f64> = layout.drives.iter().map(|d| d.values[s] - d.rest).collect();
                let exact = workspace.at(&model, state, &target).unwrap();
                let difference = |f: &dyn Fn(&Equilibrium) -> f64| {
                    let v = |k: usize| f(&shifted[k][s]);
                    (v(0) - 8.0 * v(1) + 8.0 * v(2) - v(3)) / (12.0 * step)
                };
                let load = difference(&|e| e.state.lambda[row]);
                worst = worst.max((exact.lambda[(row, i)] - load).abs() * width / size);
                for (b, body) in layout.bodies.iter().enumerate() {
                    let Some(first) = body.first_dof else { continue };
                    for c in 0..3 {
                        let moved = difference(&|e| e.state.poses[b].translation[c]);
                        let error = (exact.links[(first + c, i)] - moved).abs() * width;
                        worst = worst.max(error / layout.length_mm);
                    }
                }
            }
        }
        println!("{name}: worst {worst:.2e}");
        assert!(worst < 1e-6, "{name}: {worst}");
        let problem = Problem::new(&design, &layout, 12);
        let x = problem.to_unit(&p);
        let trial = problem.simulate(&x).unwrap();
        let gradient = problem.differentiate(&trial).unwrap().gradient();
        for i in (3..x.len()).step_by(x.len() / some) {
            let value = |factor: f64| {
                let mut y = x.clone();
                y[i] += factor * 2e-4;
                problem.simulate(&y).unwrap().cost
            };
            let difference =
                (value(-2.0) - 8.0 * value(-1.0) + 8.0 * value(1.0) - value(2.0)) / (12.0 * 2e-4);
            let error = (difference - gradient[i]).abs() / gradient.amax().max(gradient[i].abs());
            assert!(error < 1e-6, "{name}, {}: {} {difference}", design.free[i].path, gradient[i]);
        }
    }
}
