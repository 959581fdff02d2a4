//! `hole`: a tunnel of its diameter through its body, whatever the body is made of.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::parts::{design, part};
use flexura::elaborate::{Options, elaborate};
use flexura::geometry::{Mesh, check_mesh};
use nalgebra::Vector3;
use std::collections::BTreeMap;

const CANTILEVER: &str = include_str!("loads/cantilever.mech");
/// Vertices are rounded to single precision, mm.
const ROUNDING_MM: f64 = 1e-4;
/// A ball and leaves in two planes: no body lies in layers.
const SPACE: &str = "use std.materials.rigur
use std.processes.polyjet
use std.flexures.wire
mechanism m {
    point O = (0 mm, 0 mm, 0 mm)
    point A = (-30 mm, 0 mm, 0 mm)
    point B = (30 mm, 0 mm, 10 mm)
    point C = (30 mm, 25 mm, -10 mm)
    ground wall { O, A }
    link   tip  { O, B, C }
    ball   flex: wall to tip at O  into wall toward A  into tip toward B  as wire
    material rigur
    print on polyjet
    cycle in 2 steps
    load 0.1 N * t along (0, 0, -1) on tip at B
    //HOLES
}
";

fn with(text: &str, holes: &str) -> String {
    let text = text.replace("//LOAD", "load 0.1 N * t along (0, -1) on tip at T\n    //HOLES");
    text.replace("//HOLES", holes)
}

/// Of a surface that is printable.
fn tunnels(mesh: &Mesh) -> i64 {
    assert!(check_mesh(mesh).is_printable());
    common::parts::tunnels(mesh)
}

/// Least distance of the surface's vertices from a line, as far along it as a link is high.
fn clear_radius(mesh: &Mesh, point: Vector3<f64>, axis: Vector3<f64>) -> f64 {
    let near = mesh.vertices.iter().map(|p| p - point).filter(|d| d.dot(&axis).abs() < 5.0);
    near.map(|d| (d - axis * d.dot(&axis)).norm()).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_hole_is_a_tunnel_of_its_diameter() {
    let (none, three) = (
        part(&with(CANTILEVER, "")),
        part(&with(
            CANTILEVER,
            "hole 3.4 mm on wall at A
    hole 2 mm on tip at B
    hole 5 mm on tip at (30 mm, 12 mm)",
        )),
    );
    assert_eq!(tunnels(&three), tunnels(&none) + 3);
    for (at, diameter) in [([-40.0, 0.0], 3.4), ([40.0, 0.0], 2.0), ([30.0, 12.0], 5.0)] {
        let point = Vector3::new(at[0], at[1], 0.0);
        let clear = clear_radius(&three, point, Vector3::z());
        assert!((clear - diameter / 2.0).abs() < 0.01 * diameter, "{at:?}: {clear}");
        assert!(clear >= diameter / 2.0 - ROUNDING_MM, "what has that diameter passes: {clear}");
        // A wall of 2 mm all round: the part's own rim.
        let rim = |d: Vector3<f64>| (point + d).x.abs();
        let outward = Vector3::x() * at[0].signum();
        assert!(three.vertices.iter().any(|p| p.x.abs() > rim(outward * (diameter / 2.0 + 1.9))));
    }
}

#[test]
fn a_hole_across_the_layers_and_in_a_body_in_space() {
    let across = part(&with(CANTILEVER, "hole 2 mm on tip at B along (0, 1, 0)"));
    assert_eq!(tunnels(&across), tunnels(&part(&with(CANTILEVER, ""))) + 1);
    let clear = clear_radius(&across, Vector3::new(40.0, 0.0, 0.0), Vector3::y());
    assert!((clear - 1.0).abs() < 0.01, "{clear}");

    let axis = Vector3::new(0.6, 0.0, 0.8);
    let space = part(&with(SPACE, "hole 3 mm on tip at C along (3, 0, 4)"));
    assert_eq!(tunnels(&space), tunnels(&part(&with(SPACE, ""))) + 1);
    let clear = clear_radius(&space, Vector3::new(30.0, 25.0, -10.0), axis);
    assert!((clear - 1.5).abs() < 0.015, "{clear}");
}

/// A point in the skeleton would turn the flexure's end frame; a hole must not.
#[test]
fn a_hole_does_not_turn_the_flexures_end() {
    let ends = |text: &str| {
        let d = design(&with(CANTILEVER, text));
        let at = d.exprs.evaluate(&[]);
        let end = |e: &flexura::ir::RodEnd| [at.point(e.position), at.point(e.derivative)];
        d.rods.iter().map(|r| [end(&r.from), end(&r.to)]).collect::<Vec<_>>()
    };
    assert_eq!(ends("hole 5 mm on tip at (30 mm, 12 mm)"), ends(""));
}

#[test]
fn what_is_wrong_with_a_hole_is_told_where_it_stands() {
    for (line, code, at) in [
        ("hole -2 mm on tip at B", "E0305", "-2 mm"),
        ("hole 2 N on tip at B", "E0201", "2 N"),
        ("hole 2 mm on tap at B", "E0101", "tap"),
        ("hole 2 mm on tip at 3 mm", "E0203", "3 mm"),
        ("hole 2 mm on tip at B along 3", "E0203", "3"),
    ] {
        let text = with(CANTILEVER, line);
        let files = BTreeMap::from([("main.mech".to_string(), text.clone())]);
        let found = elaborate("main.mech", &files, &Options::default());
        let errors: Vec<_> = found.diagnostics.iter().filter(|d| d.is_error()).collect();
        assert_eq!(errors.len(), 1, "{line}: {errors:#?}");
        let label = errors[0].labels[0].at;
        assert_eq!(
            (errors[0].code.as_str(), &text[label.start as usize..label.end as usize]),
            (code, at),
            "{line}: {errors:#?}"
        );
    }
}
