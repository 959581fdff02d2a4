//! What links are taken to weigh, against their printed solids.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{FileError, Files};
use flexura::equilibrium::{Layout, Model, volume_and_center};
use flexura::geometry::weigh;
use flexura::ir::{Design, PrintedExtra};
use flexura::kinematics::solve_motion;
use flexura::pipeline::{Compiler, Stages};
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;

mod common;

/// Of what is printed: the parts of the Chebyshev example differ by 0.2 % at their start and 0.4 % in the solution.
const APART: f64 = 0.01;

/// Volume (mm³) and centre of a binary STL.
fn solid(bytes: &[u8]) -> (f64, Vector3<f64>) {
    let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
    let corner = |at: usize| Vector3::new(float(at), float(at + 4), float(at + 8));
    let (mut volume, mut moment) = (0.0, Vector3::zeros());
    for t in (84..bytes.len()).step_by(50) {
        let [a, b, c] = [corner(t + 12), corner(t + 24), corner(t + 36)];
        let v = a.dot(&b.cross(&c)) / 6.0;
        volume += v;
        moment += (a + b + c) / 4.0 * v;
    }
    (volume, moment / volume)
}

/// An example in which gravity acts.
struct Heavy(&'static str);

impl Files for Heavy {
    fn read(&self, path: &str) -> Result<String, FileError> {
        let text = common::ExampleFiles.read(path)?;
        Ok(if path == self.0 {
            text.replacen("    cycle ", "    load gravity (0, -1, 0)\n    cycle ", 1)
        } else {
            text
        })
    }
}

fn heavy(file: &'static str) -> Design {
    let checked = Compiler::default().check(file, &[], None, None, &Heavy(file));
    let design = checked.assembly.unwrap().designs.swap_remove(0);
    assert_eq!(design.loads.len(), 1);
    design
}

/// Weighed over printed volume of the part with all flexures, and the links as they are weighed.
fn ratio(design: &Design, values: &[f64]) -> (f64, Vec<PrintedExtra>) {
    let layout = Layout::new(design, &solve_motion(design, values).unwrap(), values);
    let model = Model::new(design, &layout, values, 20, false).unwrap();
    let flexures: f64 = model.rods.iter().map(|r| r.rod.volume_mm3()).sum();
    let (parts, _) = Compiler::default().mesh(design, values).unwrap();
    let (printed, _) = solid(&parts.iter().find(|p| p.name.ends_with("_base.stl")).unwrap().bytes);
    let extra = weigh(design, values).unwrap();
    let of_part = design.bodies.iter().zip(&extra).filter(|(b, _)| b.name != "crank");
    let links: f64 = of_part.map(|(_, e)| e.printed_mm3).sum();
    println!("weighed {} of printed {printed} mm³", links + flexures);
    ((links + flexures) / printed, extra)
}

#[test]
fn links_weigh_what_their_solids_do() {
    let design = heavy("chebyshev.mech");
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let (part, extra) = ratio(&design, &start);
    assert!((part - 1.0).abs() < APART, "{part}");
    // A crank of 20 mm is no bar: eyes that share their height with others leave it half of one.
    let (parts, _) = Compiler::default().mesh(&design, &start).unwrap();
    let (volume, center) = solid(&parts.iter().find(|p| p.name.ends_with("_crank.stl")).unwrap().bytes);
    let index = design.bodies.iter().position(|b| b.name == "crank").unwrap();
    let at = design.exprs.evaluate(&start);
    let points = design.bodies[index].skeleton.iter().map(|p| at.point(p.position)).collect::<Vec<_>>();
    let (bars, of_bars) = volume_and_center(&points, design.layers.height_mm);
    let more = extra[index];
    assert!((more.volume_mm3 + bars - more.printed_mm3).abs() < 1e-9 * bars);
    let drawn = of_bars + Vector3::from(more.center_mm);
    let weighed = solve_motion(&design, &start).unwrap().rest_point(index, &drawn);
    println!("crank {} {weighed:?}, printed {volume} {center:?}", more.printed_mm3);
    assert!((more.printed_mm3 / volume - 1.0).abs() < APART, "{} {volume}", more.printed_mm3);
    assert!((weighed - center).norm() < 0.02, "{weighed:?} {center:?}");
}

/// The stubs of the solved Chebyshev linkage are shorter than at its start: by 8 % of the part's weight. What is solved must
/// be what is printed, and what is simulated afterwards.
#[test]
fn solutions_weigh_what_is_printed() {
    let design = heavy("chebyshev.mech");
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let numbers = std::sync::Mutex::new(Vec::new());
    let told = |i: &flexura::pipeline::Iteration| numbers.lock().unwrap().push(i.number);
    let solved = Compiler::default().optimize(&design, &start, &told, &AtomicBool::new(false)).unwrap();
    assert!(solved.solution.converged);
    let values: Vec<f64> = design.free.iter().map(|f| solved.solution.values[&f.path]).collect();
    let (part, extra) = ratio(&design, &values);
    assert!((part - 1.0).abs() < APART, "{part}");
    let (_, before) = ratio(&design, &start);
    let of = |all: &[PrintedExtra]| all.iter().map(|e| e.volume_mm3).sum::<f64>();
    let whole: f64 = extra.iter().map(|e| e.printed_mm3).sum();
    assert!(
        (of(&before) - of(&extra)).abs() > 0.03 * whole,
        "the weights must change for this to test anything"
    );
    let errors = |s: &flexura::pipeline::Simulation| s.errors_mm[0].iter().copied().fold(0.0, f64::max);
    let simulated = Compiler::default().simulate(&design, &values).unwrap();
    println!("largest error {} mm", errors(&simulated));
    assert!(errors(&simulated) < 0.02, "the last run solved for another weight: {}", errors(&simulated));
    // Every run begins with its start; their numbers go on.
    let numbers = numbers.into_inner().unwrap();
    assert!(numbers.is_sorted() && *numbers.last().unwrap() <= solved.solution.iterations, "{numbers:?}");
}
