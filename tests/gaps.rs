//! Gaps of the printed solids over the cycle of the example: measured, required, and told where they are none.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::emit::lock::Lock;
use flexura::ir::{Aggregate, Design, Quantity, Requirement};
use flexura::pipeline::{Compiler, Simulation, Stages, check_requirements, measure};

mod common;

fn example() -> Design {
    let options = Options { steps: Some(20), ..Options::default() };
    elaborate("chebyshev.mech", &common::ExampleFiles, &options).design.unwrap()
}

fn least(simulation: &Simulation) -> f64 {
    simulation.gaps_mm.iter().copied().fold(f64::INFINITY, f64::min)
}

fn require_gap(design: &mut Design, bound: f64) {
    design.requirements = vec![Requirement {
        aggregate: Aggregate::Min,
        quantity: Quantity::Gap,
        at_most: false,
        strict: false,
        bound,
        text: "require min(gap())".into(),
        origin: design.origin,
    }];
}

#[test]
fn the_solved_example_keeps_its_clearance() {
    let mut design = example();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/chebyshev/chebyshev.lock");
    let lock = Lock::parse(&std::fs::read_to_string(path).unwrap(), 0).unwrap();
    let simulation = Compiler::default().simulate(&design, &lock.start_values(&design)).unwrap();
    assert_eq!(simulation.gaps_mm.len(), 21);
    let gap = least(&simulation);
    assert!(gap >= design.process.clearance_mm, "{gap}");
    assert!(gap < 1.0, "neighbouring layers are near: {gap}");
    assert!(
        !simulation.diagnostics.iter().any(|d| d.code.starts_with("W063")),
        "{:?}",
        simulation.diagnostics
    );
    let measures = measure(&design, &simulation);
    assert_eq!(measures.gap.least_mm, Some(gap));
    // Where it is: two of the design's members, in the state whose gap it is; and so for the stress.
    let place = measures.gap.place.unwrap();
    assert_eq!((place.of.len(), simulation.gaps_mm[place.state]), (2, gap));
    let known =
        |n: &String| design.bodies.iter().any(|b| b.name == *n) || design.rods.iter().any(|r| r.path == *n);
    assert!(place.of.iter().all(known), "{place:?}");
    let stressed = measures.stress.place.unwrap();
    assert_eq!(Some(simulation.motion.states[stressed.state].stress_max_mpa), measures.stress.max_mpa);
    assert!(design.rods.iter().any(|r| [r.path.clone()] == stressed.of[..]), "{stressed:?}");
    for (bound, holds) in [(gap - 1e-3, true), (gap + 1e-3, false)] {
        require_gap(&mut design, bound);
        let mut found = Vec::new();
        let result = check_requirements(&design, &simulation, &mut found);
        assert_eq!((result[0].pass, result[0].value, result[0].unit.as_ref()), (holds, Some(gap), "mm"));
        assert_eq!(found.is_empty(), holds);
        let told = |d: &flexura::diagnostic::Diagnostic| d.labels[0].text.contains(&place.told());
        assert!(found.iter().all(told), "{found:?}");
    }
}

/// The unsolved start bends a leaf into its own link: the link is carved, and what is measured keeps the clearance.
#[test]
fn a_link_makes_way_for_its_own_leaf() {
    let design = example();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let simulation = Compiler::default().simulate(&design, &start).unwrap();
    assert!(least(&simulation) >= design.process.clearance_mm, "{}", least(&simulation));
    let rubs = |d: &&flexura::diagnostic::Diagnostic| ["W0636", "W0637"].contains(&d.code.as_str());
    assert_eq!(simulation.diagnostics.iter().filter(rubs).count(), 0, "{:?}", simulation.diagnostics);
}
