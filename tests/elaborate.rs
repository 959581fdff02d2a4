//! Elaboration: what the texts become, and what is said about texts that are wrong.

use flexura::elaborate::{Elaborated, Options, elaborate};
use std::collections::BTreeMap;

const CHEBYSHEV: &str = include_str!("../examples/chebyshev/chebyshev.mech");

fn run(text: &str) -> Elaborated {
    run_with(text, &Options::default())
}

fn run_with(text: &str, options: &Options) -> Elaborated {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    elaborate("main.mech", &files, options)
}

#[test]
fn dump() {
    let e = run(CHEBYSHEV);
    for d in &e.diagnostics {
        println!("{d:#?}");
    }
    let d = e.design.unwrap();
    let start: Vec<f64> = d.free.iter().map(|f| f.start).collect();
    let v = d.exprs.evaluate(&start);
    for b in &d.bodies {
        println!(
            "{} {:?}",
            b.name,
            b.skeleton.iter().map(|p| (p.name.clone(), v.point(p.position))).collect::<Vec<_>>()
        );
    }
    for f in &d.free {
        println!("{} {} {} {} {}", f.path, f.unit, f.start, f.lower, f.upper);
    }
    println!("{} nodes", d.exprs.nodes.len());
    println!("{:?} {:?} {:?} {:?}", d.material, d.process, d.layers, d.requirements);
}
