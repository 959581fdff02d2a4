//! `mount`, `horn` and `plate`: what is emitted fits the motor, its screws and its horn, by measures of the solids.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::parts::{design, tunnels};
use flexura::emit::lock::design_digest;
use flexura::geometry::{
    Facets, Member, Mesh, MovedState, Parts, PartsInput, build_parts, check_mesh, cycle_gaps,
};
use flexura::math::Pose;
use nalgebra::Vector3;

/// Vertices are rounded to single precision, mm.
const ROUNDING_MM: f64 = 1e-4;
/// Edges up to 0.01 mm are collapsed, mm.
const SHORT_MM: f64 = 0.01;
/// Of a mesh from a finer one.
const VOLUME: f64 = 0.005;
/// Clearance of the process, mm.
const CLEARANCE_MM: f64 = 0.5;
/// Height of a layer with its clearance, and half a link, mm.
const PITCH_MM: f64 = 12.5;
const HALF_MM: f64 = 6.0;
/// Of the base's lower face.
const BEHIND_MM: f64 = -2.0 * PITCH_MM - HALF_MM;

fn nodder(motor: &str, fit: &str) -> String {
    common::parts::nodder(motor, fit, "rest motor at 0 deg", "")
}

fn input(text: &str) -> PartsInput {
    common::parts::input(&design(text))
}

fn parts(text: &str) -> Parts {
    build_parts(&input(text)).unwrap()
}

/// The only printed part.
fn part(text: &str) -> Mesh {
    let mesh = common::parts::part(text);
    assert!(check_mesh(&mesh).is_printable(), "{text}");
    mesh
}

/// Least distance of the surface's vertices between two heights from an upright line.
fn clear_radius(mesh: &Mesh, [x, y]: [f64; 2], [low, high]: [f64; 2]) -> f64 {
    let near = mesh.vertices.iter().filter(|p| p.z > low && p.z < high);
    near.map(|p| (p.x - x).hypot(p.y - y)).fold(f64::INFINITY, f64::min)
}

/// Vertices inside of a box.
fn inside(mesh: &Mesh, low: [f64; 3], high: [f64; 3]) -> usize {
    let within = |p: &&Vector3<f64>| (0..3).all(|k| p[k] > low[k] && p[k] < high[k]);
    mesh.vertices.iter().filter(within).count()
}

#[test]
fn a_servo_with_flanges_goes_through_a_window_and_its_screws_reach() {
    let none = part(&nodder("sg90", ""));
    let mesh =
        part(&nodder("sg90", "mount sg90 on base at O toward O - (20 mm, 0 mm)\n    horn sg90 on arm at O"));
    // Window, two screws, and the bore of the toothed shaft.
    assert_eq!(tunnels(&mesh), tunnels(&none) + 4);
    // The middle of a box of 22.2 mm lies 4.9 mm before the shaft; holes are 27.7 mm apart.
    let middle = 6.2 - 22.2 / 2.0;
    for x in [middle - 13.85, middle + 13.85] {
        let clear = clear_radius(&mesh, [x, 0.0], [BEHIND_MM - 0.5, BEHIND_MM + 3.5]);
        let hole = (2.0 + CLEARANCE_MM) / 2.0;
        assert!(clear >= hole - ROUNDING_MM && clear < 1.02 * hole, "{x}: {clear}");
    }
    let (long, wide) = (22.2 / 2.0 + CLEARANCE_MM, 11.8 / 2.0 + CLEARANCE_MM);
    let z = [BEHIND_MM - 31.0, BEHIND_MM + 2.0 * HALF_MM];
    let near = |more: f64| {
        let low = [middle - long - more, -wide - more, z[0]];
        inside(&mesh, low, [middle + long + more, wide + more, z[1]])
    };
    // The box with its clearance is free, with a little more it is not: the window is no larger than that.
    assert_eq!(near(-ROUNDING_MM), 0);
    assert!(near(ROUNDING_MM) > 0);
    // The shaft of 4.7 mm goes through the arm.
    let bore = clear_radius(&mesh, [0.0, 0.0], [-PITCH_MM - HALF_MM, -PITCH_MM + HALF_MM]);
    assert!((2.35 - ROUNDING_MM..2.4).contains(&bore), "{bore}");
}

#[test]
fn the_clearance_and_the_thickness_are_as_written() {
    let text = nodder("sg90", "mount sg90 on base at O toward O - (20 mm, 0 mm) thick 6 mm clearance 0.2 mm");
    let mesh = part(&text);
    let wide = 11.8 / 2.0 + 0.2;
    let frame = |p: &&Vector3<f64>| p.x < -18.0 && p.y.abs() < wide && p.z < -PITCH_MM - HALF_MM;
    let high = mesh.vertices.iter().filter(frame).map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    assert!((high - BEHIND_MM - 6.0).abs() < 0.09, "{high}");
    let window = mesh.vertices.iter().filter(|p| p.x < 0.0 && p.x > -14.0 && p.z < BEHIND_MM + 5.0);
    let least = window.map(|p| p.y.abs()).fold(f64::INFINITY, f64::min);
    assert!((least - wide).abs() < SHORT_MM, "{least}");
}

#[test]
fn a_servo_without_screws_rests_on_a_lip() {
    let mesh = part(&nodder(
        "xl320",
        "mount xl320 on base at O toward O - (20 mm, 0 mm)\n    horn xl320 on arm at O",
    ));
    let c = CLEARANCE_MM - ROUNDING_MM;
    let top = BEHIND_MM + 2.0 * HALF_MM;
    let (low, high) = ([-27.0 - c, -12.0 - c, top - 2.0 - 27.0], [9.0 + c, 12.0 + c, top - 2.0]);
    assert_eq!(inside(&mesh, low, high), 0);
    // Under its edge there is material, and the middle is open.
    assert!(inside(&mesh, [-27.0, -12.0, top - 2.1], [9.0, 12.0, top + 0.1]) > 0);
    assert_eq!(inside(&mesh, [-25.4, -10.4, top - 2.1], [7.4, 10.4, top + 0.1]), 0);
    // A horn of 20 mm lies in a recess 1 mm deep in the arm's lower face.
    let face = -PITCH_MM - HALF_MM;
    let recess = clear_radius(&mesh, [0.0, 0.0], [face - 0.1, face + 0.9]);
    assert!((10.5 - ROUNDING_MM..10.6).contains(&recess), "{recess}");
}

#[test]
fn screws_of_face_and_horn_lie_on_their_patterns() {
    let text = nodder(
        "xl330_m288",
        "mount xl330_m288 on base at O toward O - (20 mm, 0 mm)\n    horn xl330_m288 on arm at O deep 1.5 mm",
    );
    let parts = parts(&text);
    let mesh = &parts.parts[0].mesh;
    assert!(check_mesh(mesh).is_printable());
    let hole = (2.0 + CLEARANCE_MM) / 2.0;
    let is_hole = |at: [f64; 2], z: [f64; 2]| {
        let clear = clear_radius(mesh, at, z);
        assert!(clear >= hole - ROUNDING_MM && clear < 1.02 * hole, "{at:?}: {clear}");
    };
    let middle = 9.5 - 17.0;
    for (x, y) in [(-15.0, -8.0), (15.0, -8.0), (15.0, 8.0), (-15.0, 8.0)] {
        is_hole([middle + x, y], [BEHIND_MM - 0.5, BEHIND_MM + 3.5]);
    }
    let face = -PITCH_MM - HALF_MM;
    for k in 0..4 {
        let (sin, cos) = (std::f64::consts::FRAC_PI_4 * (2 * k + 1) as f64).sin_cos();
        is_hole([6.0 * cos, 6.0 * sin], [face + 1.4, face + 4.0]);
    }
    // Two of its screws are under the arm, which is printed in one piece with the base.
    let told: Vec<String> = parts.out_of_reach.iter().map(|f| format!("{} {:?}", f.motor, f.kind)).collect();
    assert_eq!(told, ["xl330_m288 NoReach(2)"]);
}

#[test]
fn a_stepper_is_screwed_to_a_ring_round_its_pilot() {
    let none = part(&nodder("nema17", ""));
    let mesh = part(&nodder("nema17", "mount nema17 on base at O toward D"));
    // Four screws; ring and frame leave no windows between them.
    assert_eq!(tunnels(&mesh), tunnels(&none) + 4);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let clear = clear_radius(&mesh, [15.5 * x, 15.5 * y], [BEHIND_MM - 0.5, BEHIND_MM + 3.5]);
        assert!((1.75 - ROUNDING_MM..1.78).contains(&clear), "{clear}");
    }
    let pilot = mesh.vertices.iter().filter(|p| p.z < BEHIND_MM + 2.4).map(|p| p.x.hypot(p.y));
    let pilot = pilot.fold(f64::INFINITY, f64::min);
    assert!((11.5 - ROUNDING_MM..11.6).contains(&pilot), "{pilot}");
    let shaft = clear_radius(&mesh, [0.0, 0.0], [BEHIND_MM, BEHIND_MM + 2.0 * HALF_MM]);
    assert!(shaft >= 2.5, "{shaft}");
}

#[test]
fn a_motor_in_the_way_of_what_moves_is_a_gap() {
    let overlap = |fit: &str| {
        let input = input(&nodder("mg996r", fit));
        let plans = flexura::geometry::plan_bodies(&input).unwrap();
        let rest = vec![Pose::rest(Vector3::zeros()); input.bodies.len()];
        let state = MovedState { poses: rest, flexures: input.flexures.clone() };
        let found = cycle_gaps(&plans, &[state], |_, _| false);
        found.overlaps.iter().map(|o| (o.a, o.b)).collect::<Vec<_>>()
    };
    assert_eq!(overlap("mount mg996r on base at O"), []);
    // The shaft points downwards: the box stands in the layers of the other links, from the base on.
    let met = overlap("mount mg996r on base at O along (0, 0, -1) toward D");
    assert!(met.contains(&(Member::Body(0), Member::Body(1))), "{met:?}");
}

#[test]
fn a_plate_is_flat_and_covers_what_it_carries() {
    let fit = "plate 4 mm on base margin 7 mm";
    let mesh = part(&nodder("sg90", fit));
    let low = mesh.vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    assert!((low - BEHIND_MM).abs() < ROUNDING_MM);
    // Seven beyond O and X.
    let left = mesh.vertices.iter().filter(|p| p.z < low + 0.1).map(|p| p.x).fold(f64::INFINITY, f64::min);
    assert!((left + 7.0).abs() < 0.02, "{left}");
    let deep = mesh.vertices.iter().filter(|p| p.z < low + 0.1).map(|p| p.y).fold(f64::INFINITY, f64::min);
    assert!((deep + 57.0).abs() < 0.02, "{deep}");
    // Between O, D and X there is no window: one of the three bars' triangle is filled.
    let top = |p: &&Vector3<f64>| (p.z - low - 4.0).abs() < ROUNDING_MM;
    assert!(mesh.vertices.iter().filter(top).count() > 20);
    // And a finer mesh holds the same.
    let mut fine = input(&nodder("sg90", fit));
    fine.facets = Facets { around: 160, edge: 12, piece_mm: 6.0 };
    let fine = build_parts(&fine).unwrap().parts[0].mesh.volume_mm3();
    let volume = mesh.volume_mm3();
    assert!((volume / fine - 1.0).abs() < VOLUME, "{volume} {fine}");
}

#[test]
fn seats_hold_the_same_in_a_finer_mesh() {
    for motor in ["sg90", "xl320", "xl330_m288"] {
        let text = nodder(motor, "mount MOTOR on base at O\n    horn MOTOR on arm at O");
        let mut fine = input(&text);
        fine.facets = Facets { around: 160, edge: 12, piece_mm: 6.0 };
        let fine = build_parts(&fine).unwrap().parts[0].mesh.volume_mm3();
        let volume = part(&text).volume_mm3();
        assert!((volume / fine - 1.0).abs() < VOLUME, "{motor}: {volume} {fine}");
    }
}

/// Where neither weight nor distances are asked for, a seat changes nothing that is solved.
#[test]
fn a_lock_outlives_a_mount() {
    let fit = "mount sg90 on base at O";
    let digest = |fit: &str, more: &str| {
        design_digest(&design(&nodder("sg90", fit).replace("track(tip)", &format!("track(tip){more}"))))
    };
    let apart = "\n    collision(gap = 0.5 mm)\n";
    // Also where its place is of numbers that the design has nowhere else.
    let places =
        ["mount sg90 on base at O + (1.7 mm, 2.3 mm, 0 mm)", "hole 3.3 mm on base at (-7.1 mm, 3.9 mm)"];
    for fit in places.into_iter().chain([fit]) {
        assert_eq!(digest("", ""), digest(fit, ""), "{fit}");
        assert_ne!(digest("", apart), digest(fit, apart), "{fit}");
    }
}
