//! Weight of printed links, where gravity acts. While values vary, what a link weighs beyond its bars stands still; it is
//! weighed anew where they have come to rest, and the optimiser goes on from there until its result weighs what it
//! was solved with.

use super::progress::Iteration;
use super::stages::{Failed, Solved};
use crate::geometry::{has_gravity, weigh};
use crate::ir::Design;
use std::borrow::Cow;

/// Weights that differ by less than this part of the whole are the same: the grid knows them no better.
const SAME_WEIGHT: f64 = 0.005;
/// Runs of the optimiser at most; two are the rule.
const ROUNDS: usize = 4;

/// The design with the weights of its links at `values`, if gravity acts.
pub fn weighed<'d>(design: &'d Design, values: &[f64]) -> Cow<'d, Design> {
    if !has_gravity(design) {
        return Cow::Borrowed(design);
    }
    let mut heavy = design.clone();
    for (body, extra) in heavy.bodies.iter_mut().zip(weigh(design, values).unwrap_or_default()) {
        body.printed = Some(extra);
    }
    Cow::Owned(heavy)
}

/// One run of the optimiser: design, start, iterations at most, progress.
type Solve<'a> = &'a dyn Fn(&Design, &[f64], usize, &dyn Fn(&Iteration)) -> Result<Solved, Failed>;

/// Solves with `solve`, again where the solution weighs something else.
///
/// # Errors
/// Those of `solve`.
pub fn rounds(
    design: &Design,
    start: &[f64],
    iterations: usize,
    on_iteration: &dyn Fn(&Iteration),
    solve: Solve,
) -> Result<Solved, Failed> {
    let mut heavy = weighed(design, start);
    let mut solved = solve(&heavy, start, iterations, on_iteration)?;
    for _ in 1..ROUNDS {
        let done = solved.solution.iterations;
        if !has_gravity(design) || solved.interrupted || done >= iterations {
            break;
        }
        let value = |f: &crate::ir::FreeVariable| solved.solution.values.get(&f.path).copied();
        let values: Vec<f64> = design.free.iter().map(|f| value(f).unwrap_or(f.start)).collect();
        let anew = weighed(design, &values);
        if change(&heavy, &anew) < SAME_WEIGHT {
            break;
        }
        heavy = anew;
        let told = |i: &Iteration| on_iteration(&Iteration { number: i.number + done, ..i.clone() });
        solved = solve(&heavy, &values, iterations - done, &told)?;
        solved.solution.iterations += done;
    }
    Ok(solved)
}

/// How much two states of a design differ in what links weigh beyond their bars, as a part of their whole weight.
fn change(a: &Design, b: &Design) -> f64 {
    let pairs = || a.bodies.iter().zip(&b.bodies).filter_map(|(a, b)| Some((a.printed?, b.printed?)));
    let apart: f64 = pairs().map(|(a, b)| (a.volume_mm3 - b.volume_mm3).abs()).sum();
    let whole: f64 = pairs().map(|(_, b)| b.printed_mm3).sum();
    if whole > 0.0 { apart / whole } else { 0.0 }
}
