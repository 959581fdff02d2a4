//! What stands beside instances at their points and on their hinges: places, and measures of the printed meshes.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use flexura::elaborate::{Elaborated, Options, elaborate};
use flexura::geometry::{Mesh, Probe, check_mesh};
use flexura::ir::Assembly;
use flexura::ir::assembly::HingeFitting;
use flexura::pipeline::{self, BuildOutcome, Compiler, Request};
use nalgebra::{Rotation3, Vector3};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// Of a mesh whose flexures an optimiser has shaped from another one: measured 1e-6.
const SAME_VOLUME: f64 = 1e-4;
/// Rounding of places, mm.
const PLACE_MM: f64 = 1e-9;

const NODDER: &str = "edition 1
use std.materials.petg
use std.processes.fdm
use std.flexures.crossed_leaves
use std.motors.sg90
use std.motors.xl320
mechanism nodder {
    point O = (0 mm, 0 mm)
    point D = (60 mm, 0 mm)
    point A = O + polar(15 mm, 90 deg)
    point B = (60 mm, 40 mm)
    point P = B + (20 mm, 20 mm)
    point X = (20 mm, -50 mm)
    point F = X + (0 mm, free 1 mm in 0 mm .. 2 mm)
    ground base    { O, D, X }  layer -2
    link   arm     { O, A }  layer -1
    link   coupler { A, B }
    link   rocker  { B, D, P }
    hinge motor: base to arm       at O  layer -1
    hinge elbow: arm to coupler    at A  as crossed_leaves { size = 8 mm }
    hinge knee:  coupler to rocker at B  as crossed_leaves { size = 8 mm }
    hinge heel:  rocker to base    at D  into base toward D - (0 mm, 25 mm) as crossed_leaves { size = 8 mm }
    //FIT
    material petg
    print on fdm
    cycle 4 steps over 2 s
    drive motor from -5 deg to 5 deg with sg90
    rest motor at 0 deg
    trace tip = P on rocker
    minimize { track(tip) }
}
";

fn text(fit: &str, assembly: &str) -> String {
    format!("{}mechanism whole {{\n{assembly}\n}}\n", NODDER.replace("//FIT", fit))
}

fn files(text: &str) -> BTreeMap<String, String> {
    BTreeMap::from([("main.mech".to_string(), text.to_string())])
}

fn elaborated(text: &str) -> Elaborated {
    elaborate("main.mech", &files(text), &Options::default())
}

fn assembly(text: &str) -> Assembly {
    let out = elaborated(text);
    assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:#?}", out.diagnostics);
    out.assembly.unwrap()
}

fn build(text: &str) -> BuildOutcome {
    let request = Request { source: "main.mech".into(), ..Request::default() };
    let out = pipeline::build(
        &request,
        &Compiler::default(),
        &files(text),
        &common::NoClock,
        &AtomicBool::new(false),
    );
    assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:#?}", out.diagnostics);
    out
}

fn codes(out: &BuildOutcome, code: &str) -> usize {
    out.diagnostics.iter().filter(|d| d.code == code).count()
}

fn read_stl(bytes: &[u8]) -> Mesh {
    let stl = stl_io::read_stl(&mut std::io::Cursor::new(bytes)).unwrap();
    let vertices = stl.vertices.iter().map(|v| Vector3::new(v[0], v[1], v[2]).cast()).collect();
    Mesh { vertices, triangles: stl.faces.iter().map(|f| f.vertices).collect() }
}

/// The only part.
fn part(out: &BuildOutcome) -> Mesh {
    let stl: Vec<_> = out.artefacts.iter().filter(|a| a.name.ends_with(".stl")).collect();
    assert_eq!(stl.len(), 1, "{:?}", out.artefacts.iter().map(|a| &a.name).collect::<Vec<_>>());
    let mesh = read_stl(&stl[0].bytes);
    assert!(check_mesh(&mesh).is_printable());
    mesh
}

fn sheet(out: &BuildOutcome) -> String {
    let sheet = out.artefacts.iter().find(|a| a.name.ends_with(".md")).unwrap();
    String::from_utf8(sheet.bytes.clone()).unwrap()
}

#[test]
fn a_point_of_an_instance_is_the_drawn_one_in_its_place() {
    let a = assembly(&text(
        "",
        "ground own { }
    place one = nodder at (5 mm, 7 mm, 9 mm) turned 90 deg about z scale = 2 merging base into own
    mirror two = one across yz
    point Q = two.D + (0 mm, 0 mm, 1 mm)
    place three = nodder at one.D
    hole 3 mm on own at one.P
    hole 3 mm on own at Q
    hole 3 mm on own at one.F
    hole 3 mm on own at three.D",
    ));
    let at = |p: [f64; 3]| Vector3::from(p);
    let turned = |p: [f64; 3]| Rotation3::from_axis_angle(&Vector3::z_axis(), 90_f64.to_radians()) * at(p);
    let place = |p: [f64; 3]| turned(p) * 2.0 + at([5.0, 7.0, 9.0]);
    let holes: Vec<_> = a.joined[0].holes.iter().map(|h| h.position).collect();
    let one_d = place([60.0, 0.0, 0.0]);
    let wanted = [
        place([80.0, 60.0, 0.0]),
        at([-one_d.x, one_d.y, one_d.z + 1.0]),
        place([20.0, -49.0, 0.0]),
        one_d + at([60.0, 0.0, 0.0]),
    ];
    let start = a.places(|_| None);
    for (hole, wanted) in holes.iter().zip(wanted) {
        assert!((start.at(*hole) - wanted).norm() < PLACE_MM, "{:?} {wanted:?}", start.at(*hole));
    }
    // One moves with what is optimised in its instance.
    let design = a.instances[0].design;
    let free = a.designs[design].free.iter().position(|f| f.path.starts_with('F')).unwrap();
    let mut values: Vec<f64> = a.designs[design].free.iter().map(|f| f.start).collect();
    values[free] += 0.25;
    let moved = a.places(|d| (d == design).then_some(values.as_slice()));
    let by: Vec<f64> = holes.iter().map(|h| (moved.at(*h) - start.at(*h)).norm()).collect();
    assert!((by[2] - 0.25).abs() < PLACE_MM || (by[2] - 0.5).abs() < PLACE_MM, "{by:?}");
    assert!([0, 1, 3].iter().all(|k| by[*k] == 0.0), "{by:?}");
}

#[test]
fn a_motor_on_an_instances_hinge_is_as_in_its_mechanism() {
    let place = "place one = nodder at (10 mm, 20 mm, 5 mm) turned 30 deg about z";
    let inside = text(
        "mount sg90 on base at O toward O - (20 mm, 0 mm)
    horn sg90 on arm at O",
        &format!("{place}\nexport stl(assembled), sheet"),
    );
    let beside = text(
        "",
        &format!(
            "{place}
    mount sg90 on one.base at one.O toward one.O - polar(20 mm, 30 deg)
    horn sg90 on one.arm at one.O
    export stl(assembled), sheet"
        ),
    );
    let bare = build(&text("", &format!("{place}\nexport stl(assembled), sheet")));
    let (inside, beside) = (build(&inside), build(&beside));
    let (wanted, found) = (part(&inside), part(&beside));
    let (v, w) = (wanted.volume_mm3(), found.volume_mm3());
    assert!((v - w).abs() < SAME_VOLUME * v, "{v} {w}");
    assert!((part(&bare).volume_mm3() - w).abs() > 50.0 * SAME_VOLUME * v);
    // The same to buy, the same to say.
    assert_eq!(sheet(&inside).replace("one.", ""), sheet(&beside).replace("one.", ""));
    for code in ["W0649", "W0634", "W0635", "W1312"] {
        assert_eq!(codes(&inside, code), codes(&beside, code), "{code}");
    }
    // Where the flanges' screws are: 27.7 mm apart, the box's middle 4.9 mm before the shaft.
    let along = Vector3::new(30_f64.to_radians().cos(), 30_f64.to_radians().sin(), 0.0);
    let shaft = Vector3::new(10.0, 20.0, 5.0);
    let near = |m: &Mesh, p: Vector3<f64>| {
        let off = |q: &Vector3<f64>| (q.x - p.x).hypot(q.y - p.y);
        m.vertices.iter().map(off).fold(f64::INFINITY, f64::min)
    };
    for end in [-4.9 - 13.85, -4.9 + 13.85] {
        let (there, bare) = (shaft + along * end, part(&bare));
        let radius = near(&found, there);
        assert!(radius > 0.9 && radius < 1.5, "a screw hole {radius} {}", near(&bare, there));
    }
}

/// Only one of two instances has it: the other one keeps its bearing.
#[test]
fn a_motor_of_one_instance_is_not_the_other_ones() {
    let two = |fit: &str| {
        let place = "ground board { }
    place one = nodder at (0 mm, 0 mm) merging base into board
    place two = nodder at (0 mm, 0 mm, 80 mm) merging base into board";
        build(&text("", &format!("{place}\n{fit}\nexport stl(assembled), sheet")))
    };
    let volume = |out: &BuildOutcome| -> f64 {
        let stl = out.artefacts.iter().filter(|a| a.name.ends_with(".stl"));
        stl.map(|a| read_stl(&a.bytes).volume_mm3()).sum()
    };
    let (none, first) = (two(""), two("mount sg90 on one.base at one.O toward one.O - (20 mm, 0 mm)"));
    let second = two("mount sg90 on board at two.O toward two.O - (20 mm, 0 mm)");
    let (v, a, b) = (volume(&none), volume(&first), volume(&second));
    assert!((a - v).abs() > 50.0, "{v} {a}");
    assert!((a - b).abs() < SAME_VOLUME * v, "{a} {b}");
    assert!(sheet(&first).contains("screw with nut") && !sheet(&none).contains("screw with nut"));
}

const CAR: &str = include_str!("instances/car.mech");

fn car(fit: &str) -> String {
    let text = CAR.replace("nema17", "xl320").replace("at S  layer -1", "at S").replace(
        "export stl, arduino(right.servo)",
        &format!("{fit}\n    export stl(assembled), sheet, dynamixel(right.servo, left.servo)"),
    );
    format!("edition 1\n{text}")
}

/// The arm and the chassis of two halves: one motor, one horn, wherever its box points.
#[test]
fn a_hinge_that_halves_share_has_one_motor_and_one_horn() {
    let named = |side: &str| {
        car(&format!(
            "mount xl320 on {side}.chassis at {side}.S toward {side}.C
    horn xl320 on {side}.arm at {side}.S"
        ))
    };
    let a = assembly(&named("right"));
    let hinged: Vec<_> = a.joined.iter().flat_map(|j| &j.hinged).collect();
    assert_eq!(hinged.len(), 2);
    assert!(hinged.iter().all(|h| h.hinges.len() == 2 && h.hinges[0].instance == 0), "{hinged:?}");
    assert!(hinged.iter().any(|h| matches!(h.fitting, HingeFitting::Horn(_))));
    let (right, left, none) = (build(&named("right")), build(&named("left")), build(&car("")));
    let (r, l, n) = (part(&right), part(&left), part(&none));
    // What one names is the image of what the other names, and it is there once.
    let (v, w) = (r.volume_mm3(), l.volume_mm3());
    assert!((v - w).abs() < 2e-3 * v, "{v} {w}");
    assert!((n.volume_mm3() - v).abs() > 100.0, "{v} {}", n.volume_mm3());
    // The box points to +x and −y: there the seat is, and its image is not.
    let solid = |m: &Mesh, x: f64| {
        let probe = Probe::new(m);
        let grid = |k: usize| Vector3::new(x * (4.0 + (k % 30) as f64), -20.0 + (k / 30) as f64, -8.0);
        let up = Vector3::new(0.013, 0.017, 1.0).normalize();
        (0..900).filter(|k| probe.hits(&grid(*k), &up, 1e3).len() % 2 == 1).count()
    };
    let (there, image) = (solid(&r, 1.0), solid(&r, -1.0));
    assert!(there.abs_diff(image) > 20, "{there} {image}");
    assert_eq!(codes(&right, "W0640"), 0, "{:?}", right.diagnostics);
    let bill = sheet(&right);
    assert_eq!(bill.matches("round horn of xl320").count(), 1, "{bill}");
    // One motor: its code is there once, though both halves are named.
    let sketches: Vec<_> = right.artefacts.iter().filter(|a| a.name.ends_with(".ino")).collect();
    assert_eq!(sketches.len(), 1);
}

/// One sketch with a motor each, in the order written, from drives of several instances.
#[test]
fn code_for_drives_of_several_instances_is_one() {
    let out = build(
        &text(
            "",
            "place one = nodder at (0 mm, 0 mm)
    place two = nodder at (0 mm, 0 mm, 80 mm)
    place three = nodder at (0 mm, 0 mm, 160 mm)
    export dynamixel(three.motor, one.motor), json(two.motor, three.motor)",
        )
        .replace("with sg90", "with xl320"),
    );
    let named = |end: &str| out.artefacts.iter().filter(|a| a.name.ends_with(end)).collect::<Vec<_>>();
    let sketches = named(".ino");
    assert_eq!(sketches.len(), 1);
    assert!(sketches[0].name.contains("whole_three_one"), "{}", sketches[0].name);
    let code = String::from_utf8(sketches[0].bytes.clone()).unwrap();
    let (first, second) = (code.find("three.motor").unwrap(), code.find("one.motor").unwrap());
    assert!(first < second && !code.contains("two.motor"), "{code}");
    let json = String::from_utf8(named("_motion.json")[0].bytes.clone()).unwrap();
    assert!(json.contains("two.motor") && json.contains("three.motor") && !json.contains("one.motor"));
}
