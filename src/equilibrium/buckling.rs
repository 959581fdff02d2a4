//! How far the loads are from making an equilibrium buckle: they are let grow together with the drives held, along the
//! path of equilibria, until one is no minimum any more or there is none. On a path that stays straight this is Euler's
//! load; one that bends aside from the beginning may bear any load, bent.

use super::model::Model;
use super::newton::{Equilibrium, Solver};
use super::sweep::{Cycle, Walker};
use rayon::prelude::*;

/// Factors beyond this are not looked for: ten times the load is safe enough, and far from what was designed.
pub const MOST_FACTOR: f64 = 10.0;
/// Growth of the loads from one equilibrium to the next; the walk between them halves its steps where it has to.
const GROWTH: f64 = 1.25;
/// The factor is found to this part of itself.
const EXACT: f64 = 1e-4;

/// Of every state of a cycle the factor by which all its loads can grow before it buckles, at most [`MOST_FACTOR`], also
/// where nothing loads it; below 1 where it has buckled.
pub fn load_factors(model: &Model, cycle: &Cycle) -> Vec<f64> {
    let one = |solver: &mut Solver, (s, e): (usize, &Equilibrium)| load_factor(model, solver, e, s);
    cycle.states.par_iter().enumerate().map_init(|| Solver::new(model), one).collect()
}

fn load_factor(model: &Model, solver: &mut Solver, at: &Equilibrium, state: usize) -> f64 {
    let controls = model.layout.controls(state);
    let drives = model.layout.drives.len();
    if controls.iter().skip(drives).all(|size| *size == 0.0) {
        return MOST_FACTOR;
    }
    let loaded = |factor: f64| -> Vec<f64> {
        let size = |(k, c): (usize, &f64)| if k < drives { *c } else { factor * c };
        controls.iter().enumerate().map(size).collect()
    };
    let mut reach = |from: &Walker, factor: f64| {
        let mut walker = from.clone();
        walker.walk(model, solver, state, &loaded(factor)).ok()?;
        walker.equilibrium().stable.then_some(walker)
    };
    // An equilibrium that has buckled: the loads shrink until one has not.
    let (mut good, mut sound, mut bad) = (1.0, Walker::new(at.clone(), controls.clone()), f64::INFINITY);
    if !at.stable {
        let buckled = sound.clone();
        loop {
            bad = good;
            good /= GROWTH;
            if good < 1.0 / MOST_FACTOR {
                return 0.0;
            }
            if let Some(walker) = reach(&buckled, good) {
                sound = walker;
                break;
            }
        }
    }
    while bad > good * (1.0 + EXACT) {
        let next = if bad.is_finite() { (good * bad).sqrt() } else { (good * GROWTH).min(MOST_FACTOR) };
        match reach(&sound, next) {
            Some(_) if next >= MOST_FACTOR => return MOST_FACTOR,
            Some(walker) => (good, sound) = (next, walker),
            None => bad = next,
        }
    }
    good
}
