//! Geometry that depends on free variables: rest pose, points, lengths. Derivatives against differences at random
//! designs, with redundant rows, idle freedoms, sliding and driven compliant joints present.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::gradient::{check_layout, check_objective, check_states, design};
use flexura::ir::Design;

/// A design of `tests/free_geometry`.
fn text(name: &str) -> String {
    let path = format!("{}/tests/free_geometry/{name}.mech", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

/// The variables of the geometry, and every `nth` of the flexures'.
fn some(design: &Design, nth: usize) -> impl Iterator<Item = usize> + use<> {
    let moving = design.geometry_variables();
    (0..design.free.len()).filter(move |i| i % nth == 0 || moving.contains(i))
}

fn check(name: &str, steps: usize, moving: usize, nth: usize) {
    let design = design(&text(name), steps);
    assert_eq!(design.geometry_variables().len(), moving);
    check_layout(&design, 3);
    check_states(&design, 3, some(&design, nth));
    check_objective(&design, 11, some(&design, nth));
}

#[test]
fn chebyshev() {
    check("chebyshev", 6, 6, 4);
}

#[test]
fn car() {
    check("car", 4, 5, 5);
}

#[test]
fn dragon() {
    check("dragon", 4, 5, 9);
}

#[test]
fn hand() {
    check("hand", 4, 4, 9);
}

#[test]
fn jansen() {
    check("jansen", 4, 3, 12);
}

#[test]
fn eye() {
    check("eye", 4, 5, 5);
}
