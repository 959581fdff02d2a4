//! What a link is taken to weigh, against its printed solid.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model, volume_and_center};
use flexura::kinematics::solve_motion;
use flexura::pipeline::{Compiler, Stages};
use nalgebra::Vector3;

mod common;

/// Volume of a binary STL, mm³.
fn volume(bytes: &[u8]) -> f64 {
    let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
    let corner = |at: usize| Vector3::new(float(at), float(at + 4), float(at + 8));
    let triangles = (84..bytes.len()).step_by(50);
    triangles.map(|t| corner(t + 12).dot(&corner(t + 24).cross(&corner(t + 36))) / 6.0).sum()
}

/// The printed part of Chebyshev's linkage (base, coupler and rocker in one) has bosses and stubs that the skeleton has
/// not: the skeletons and flexures make 82 % of it. A crank of 20 mm, whose eyes share their height with others, is the
/// other way round: 1.8 times too heavy.
#[test]
fn links_weigh_about_what_their_solids_do() {
    let options = Options::default();
    let design = elaborate("chebyshev.mech", &common::ExampleFiles, &options).design.unwrap();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let values = design.exprs.evaluate(&start);
    let by_skeleton = |name: &str| {
        let body = design.bodies.iter().find(|b| b.name == name).unwrap();
        let points: Vec<Vector3<f64>> = body.skeleton.iter().map(|p| values.point(p.position)).collect();
        volume_and_center(&points, design.layers.height_mm).0
    };
    let layout = Layout::new(&design, &solve_motion(&design, &start).unwrap(), &start);
    let model = Model::new(&design, &layout, &start, 20, false).unwrap();
    let flexures: f64 = model.rods.iter().map(|r| r.rod.volume_mm3()).sum();
    let (parts, _) = Compiler::default().mesh(&design, &start).unwrap();
    let printed = |name: &str| volume(&parts.iter().find(|p| p.name.contains(name)).unwrap().bytes);
    let links: f64 = ["base", "coupler", "rocker"].map(by_skeleton).iter().sum();
    let part = (links + flexures) / printed("_base");
    let crank = by_skeleton("crank") / printed("_crank");
    println!("part {part}, crank {crank}");
    assert!((0.78..0.88).contains(&part), "{part}");
    assert!((1.7..1.9).contains(&crank), "{crank}");
}
