//! Flexure ends that the text does not aim lie on one line through their joint, at whatever angle the links meet.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::gradient::{check_layout, design, layout};
use flexura::equilibrium::Layout;
use flexura::ir::Design;
use nalgebra::Vector3;

const HEAD: &str = "use std.materials.rigur\nuse std.processes.polyjet\n";
const TAIL: &str = "material rigur\nprint on polyjet\ncycle 2 steps over 1 s\ntrace tip = T on shin\n";
const EXACT: f64 = 1e-12;

/// Base and shin meet at O; seen from there the base's other joint lies at `B`, the shin's at `T`.
fn meeting(joint: &str, clauses: &str, b: [f64; 3], t: [f64; 3]) -> (Design, Layout) {
    let template = clauses.rsplit("as ").next().unwrap();
    let point = |p: [f64; 3]| format!("({} mm, {} mm, {} mm)", p[0], p[1], p[2]);
    let text = format!(
        "{HEAD}use std.flexures.{template}\nmechanism m {{\npoint O = (0 mm, 0 mm, 0 mm)\npoint B = {}\npoint T = {}\n\
         ground base {{ O, B }}\nlink shin {{ O, T }}\nlink idler {{ B }}\nlink foot {{ T }}\n\
         hinge idle: base to idler at B axis z\nhinge toe: shin to foot at T axis z\n{joint} {clauses}\n\
         hinge shaft: base to shin at O axis z\n\
         drive shaft from 0 deg to 1 deg\ndrive idle from 0 deg to 1 deg\ndrive toe from 0 deg to 1 deg\n{TAIL}}}\n",
        point(b),
        point(t)
    );
    let design = design(&text, 2);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = layout(&design, &p);
    (design, layout)
}

/// e1 at the ends in base and shin; every rod of a joint must agree, those of bodies of its own with their other end.
fn ends((design, layout): &(Design, Layout)) -> [Vector3<f64>; 2] {
    let named = |n: &str| design.bodies.iter().position(|b| b.name == n).unwrap();
    ["base", "shin"].map(|body| {
        let mut found = Vec::new();
        for rod in &layout.rod_ends {
            for k in [0, 1].into_iter().filter(|k| rod[*k].body == named(body)) {
                found.push(rod[k].axes.column(0).into_owned());
                let own = design.bodies[rod[1 - k].body].owner.is_some();
                assert!(!own || (rod[1 - k].axes - rod[k].axes).norm() < EXACT);
            }
        }
        assert!(found.iter().all(|e| (e - found[0]).norm() < EXACT));
        found[0]
    })
}

const HINGE: &str = "hinge bend: base to shin at O axis z";
const BALL: &str = "ball bend: base to shin at O";
const UNIVERSAL: &str = "universal bend: base to shin at O axis y and z";

/// The ways enclose 60°, 90° and 150°: e1 is the direction of their difference.
#[test]
fn ends_are_turned_apart_onto_one_line() {
    for degrees in [60.0_f64, 90.0, 150.0] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let (b, t) = ([40.0, 0.0, 0.0], [30.0 * cosine, 30.0 * sine, 0.0]);
        let want = Vector3::new(1.0 - cosine, -sine, 0.0).normalize();
        for (joint, clauses) in
            [(HINGE, "as leaf"), (HINGE, "as crossed_leaves"), (HINGE, "as cartwheel"), (BALL, "as wire")]
        {
            let [base, shin] = ends(&meeting(joint, clauses, b, t));
            assert!((base - want).norm() < EXACT && (shin + want).norm() < EXACT, "{clauses}: {base} {shin}");
        }
        // Normal to both axes, of which the shin must not lie in the plane; the nearer to it gives way.
        if cosine.abs() > 0.1 {
            let [base, shin] = ends(&meeting(UNIVERSAL, "as universal_leaves", b, t));
            assert!(
                (base - Vector3::x()).norm() < EXACT && (shin + Vector3::x()).norm() < EXACT,
                "{base} {shin}"
            );
        }
    }
}

/// A hinge knows only what lies across its axis.
#[test]
fn what_lies_along_the_axis_does_not_turn_the_ends_of_a_hinge() {
    let flat = ends(&meeting(HINGE, "as leaf", [40.0, 0.0, 0.0], [20.0, 30.0, 0.0]));
    let raised = ends(&meeting(HINGE, "as leaf", [40.0, 0.0, 25.0], [20.0, 30.0, -70.0]));
    for (a, b) in flat.iter().zip(&raised) {
        assert!((a - b).norm() < EXACT, "{a} {b}");
    }
}

/// One aimed body is enough for both to keep their own ways.
#[test]
fn an_aimed_body_and_its_partner_keep_their_ways() {
    let (b, t) = ([40.0, 0.0, 0.0], [20.0, 30.0, 0.0]);
    let (along_b, along_t) = (Vector3::from(b).normalize(), Vector3::from(t).normalize());
    for (joint, template) in [(HINGE, "leaf"), (BALL, "wire")] {
        let [base, shin] = ends(&meeting(joint, &format!("into base toward B as {template}"), b, t));
        assert!((base - along_b).norm() < EXACT && (shin - along_t).norm() < EXACT, "{base} {shin}");
        let clauses = format!("into shin toward (0 mm, -9 mm, 0 mm) as {template}");
        let [base, shin] = ends(&meeting(joint, &clauses, b, t));
        assert!((base - along_b).norm() < EXACT && (shin + Vector3::y()).norm() < EXACT, "{base} {shin}");
    }
}

/// Both ways are one: the ends lie square to them, opposed, also where bodies of the flexure's own stand between.
#[test]
fn ends_of_links_that_lie_on_each_other_are_square_to_them() {
    let across = |way: [f64; 3]| {
        move |ends: [Vector3<f64>; 2], what: &str| {
            let [base, shin] = ends;
            assert!(
                (base + shin).norm() < EXACT && base.dot(&Vector3::from(way)).abs() < EXACT,
                "{what}: {base} {shin}"
            );
        }
    };
    let (x, z) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let at = |way: [f64; 3], l: f64| way.map(|c| c * l);
    for (joint, clauses) in [(HINGE, "as leaf"), (HINGE, "as cartwheel"), (BALL, "as wire")] {
        across(x)(ends(&meeting(joint, clauses, at(x, 40.0), at(x, 30.0))), clauses);
    }
    across(z)(ends(&meeting(BALL, "as wire", at(z, 40.0), at(z, 30.0))), "upright");
    // A universal joint's ends are normal to its axes: opposed is all they can be.
    let [base, shin] = ends(&meeting(UNIVERSAL, "as universal_leaves", at(x, 40.0), at(x, 30.0)));
    assert!((base - Vector3::x()).norm() < EXACT && (shin + Vector3::x()).norm() < EXACT, "{base} {shin}");
}

/// A loop of a wire, a universal joint and a leaf, none of them aimed: end frames by free points, by a free rest pose
/// and by all that follows from them.
#[test]
fn derivatives_of_the_frames_hold() {
    let text = format!(
        "{HEAD}use std.flexures.wire\nuse std.flexures.universal_leaves\nuse std.flexures.leaf\nmechanism loop {{\n\
         point O = (0 mm, 0 mm, 0 mm)\npoint A = (free 2 mm in -2 mm .. 6 mm, 30 mm, 0 mm)\n\
         point T = (45 mm, free 25 mm in 22 mm .. 28 mm, 15 mm)\npoint D = (40 mm, 0 mm, free 15 mm in 12 mm .. 18 mm)\n\
         ground base {{ O, D }}\nlink crank {{ O, A }}\nlink coupler {{ A, T }}\nlink shin {{ T, D }}\n\
         hinge motor: base to crank at O axis z\nball first: crank to coupler at A as wire\n\
         universal last: coupler to shin at T axis z and y as universal_leaves\n\
         hinge heel: shin to base at D axis (0.2, 0, 1) as leaf\n\
         drive motor from -8 deg to 8 deg\nrest motor at free 2 deg in 0 deg .. 6 deg\n{TAIL}}}\n"
    );
    let design = design(&text, 2);
    assert_eq!(design.geometry_variables().len(), 4);
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    // A leaf and a wire go straight through; pairs of strips meet in a ring.
    for (rod, text) in layout(&design, &p).rod_ends.iter().zip(&design.rods) {
        if !rod.iter().any(|end| design.bodies[end.body].owner.is_some()) {
            let off = (rod[0].axes.column(0) + rod[1].axes.column(0)).norm();
            // The hinge's axis is carried by both of its bodies: the same line in the rest pose.
            assert!(off < 1e-9, "{}: {off}", text.path);
        }
    }
    for seed in [3, 8] {
        check_layout(&design, seed);
    }
}
