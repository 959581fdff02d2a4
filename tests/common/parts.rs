//! Printed parts of small designs, at their start.

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model};
use flexura::geometry::{Mesh, PartsInput, build_parts, parts_input};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use std::collections::BTreeMap;

/// Edges of the rods.
const EDGES: usize = 20;

/// Four bars moved by a motor under its base; see [`nodder`].
const NODDER: &str = "use std.materials.petg
use std.processes.fdm
use std.flexures.crossed_leaves
use std.motors.MOTOR
mechanism nodder {
    point O = (0 mm, 0 mm)
    point D = (60 mm, 0 mm)
    point A = O + polar(15 mm, 90 deg)
    point B = (60 mm, 40 mm)
    point P = B + (20 mm, 20 mm)
    point X = (20 mm, -50 mm)
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
    drive motor from -5 deg to 5 deg with MOTOR
    //REST
    trace tip = P on rocker
    minimize { track(tip) }
    //EXPORT
}
";

/// The nodder with a motor of the library, with `fit` on its bodies; `rest` and `export` are statements of their own.
pub fn nodder(motor: &str, fit: &str, rest: &str, export: &str) -> String {
    let text = NODDER.replace("//FIT", fit).replace("//REST", rest).replace("//EXPORT", export);
    text.replace("MOTOR", motor)
}

/// The design of a text that must be without errors.
pub fn design(text: &str) -> Design {
    design_of(&BTreeMap::from([("main.mech".to_string(), text.to_string())]))
}

/// The design of `main.mech` among files; it must be without errors.
pub fn design_of(files: &BTreeMap<String, String>) -> Design {
    let found = elaborate("main.mech", files, &Options::default());
    assert!(found.diagnostics.iter().all(|d| !d.is_error()), "{:#?}", found.diagnostics);
    found.design.unwrap()
}

/// What is printed of a design at its start.
pub fn input(design: &Design) -> PartsInput {
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let motion = solve_motion(design, &start).unwrap();
    let layout = Layout::new(design, &motion, &start);
    let model = Model::new(design, &layout, &start, EDGES, false).unwrap();
    parts_input(design, &layout, &model)
}

/// The only printed part of a text.
pub fn part(text: &str) -> Mesh {
    let parts = build_parts(&input(&design(text))).unwrap();
    assert_eq!(parts.parts.len(), 1);
    parts.parts[0].mesh.clone()
}

/// Tunnels through a closed surface of one piece, by Euler's formula.
pub fn tunnels(mesh: &Mesh) -> i64 {
    let (v, f) = (mesh.vertices.len() as i64, mesh.triangles.len() as i64);
    (2 - (v - 3 * f / 2 + f)) / 2
}
