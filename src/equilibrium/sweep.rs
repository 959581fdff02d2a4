//! Continuation over the cycle: from the unstressed rest pose to the nearest state, then forward to
//! the last and backward to the first, each step predicted along the tangents by drive values and loads (`predict.rs`).
//! The loads grow from zero to those of that state before the drives move.

use super::design_load::{LayoutLoad, LayoutLoadKind};
use super::layout::Layout;
use super::model::{Model, State};
use super::newton::{Equilibrium, SolveError, Solver};
use super::predict::History;
use crate::kinematics::Constraint;

/// Smallest part of a step that is still tried when whole ones fail.
const LEAST_PART: f64 = 1.0 / 128.0;
/// States whose tangents predict a step, at most; after one that failed the last one's alone.
const ORDER: usize = 4;
/// Cycles of fewer states are followed one way: there is nothing to share.
const LEAST_STATES: usize = 4;

/// States that were reached on two ways are the same where no body and no rod is further apart than this, mm (rotations: rad). The two ways round
/// leave 2e-13 to 9e-10 in the examples.
pub const SAME_MM: f64 = 1e-6;

/// Equilibria of all states 0..=N.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// One per state.
    pub states: Vec<Equilibrium>,
}

/// The mechanism could not be followed through its cycle.
#[derive(Clone, Debug)]
pub struct SweepError {
    /// The state that could not be reached.
    pub state: usize,
    /// Drive values of the last equilibrium before it, relative to the drawing pose, rad or mm.
    pub last_drives: Vec<f64>,
    /// What went wrong there.
    pub error: SolveError,
}

/// Follows the mechanism through its cycle. The forward and the backward part are independent.
///
/// # Errors
/// [`SweepError`] at the first state that no step size reaches.
pub fn sweep(model: &Model) -> Result<Cycle, SweepError> {
    let count = model.layout.states();
    let target = |s: usize| model.layout.controls(s);
    let (nearest, first) = at_nearest(model, count)?;
    let middle = first.equilibrium.clone();
    let run = |states: &mut dyn Iterator<Item = usize>| -> Result<Vec<Equilibrium>, SweepError> {
        let mut solver = Solver::new(model);
        let mut walker = first.clone();
        let mut out = Vec::new();
        for s in states {
            walker.walk(model, &mut solver, s, &target(s))?;
            out.push(walker.equilibrium.clone());
        }
        Ok(out)
    };
    let (forward, backward) = rayon::join(|| run(&mut (nearest + 1..count)), || run(&mut (0..nearest).rev()));
    let mut states = backward?;
    states.reverse();
    states.push(middle);
    states.extend(forward?);
    Ok(Cycle { states })
}

/// Which of the first `count` states is the nearest to the rest pose, and a walker there.
fn at_nearest(model: &Model, count: usize) -> Result<(usize, Walker), SweepError> {
    let drives = model.layout.drives.len();
    let target = |s: usize| model.layout.controls(s);
    // How far from rest: by the drives, of which a design under loads may have none.
    let judged = if drives > 0 { 0..drives } else { 0..model.layout.loads.len() };
    let distance = |s: usize| target(s)[judged.clone()].iter().map(|v| v * v).sum::<f64>();
    let nearest = (0..count).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0);

    let mut solver = Solver::new(model);
    let mut first = Walker::at_rest(model, &mut solver)?;
    let mut loaded = target(nearest);
    loaded.iter_mut().take(drives).for_each(|d| *d = 0.0);
    first.walk(model, &mut solver, nearest, &loaded)?;
    first.walk(model, &mut solver, nearest, &target(nearest))?;
    Ok((nearest, first))
}

/// The same states as [`sweep`] finds. A closed cycle is followed from the rest pose both ways round, half of it each, on two threads where
/// there are two; where they do not meet in one state, or the cycle is open, it is followed one way.
///
/// # Errors
/// As [`sweep`].
pub fn sweep_both_ways(model: &Model) -> Result<Cycle, SweepError> {
    match both_ways(model) {
        Some(cycle) => Ok(cycle),
        None => sweep(model),
    }
}

fn both_ways(model: &Model) -> Option<Cycle> {
    let (layout, count) = (model.layout.as_ref(), model.layout.counted_states());
    // The potential of a moment is another after a turn.
    let moment = |l: &LayoutLoad| matches!(l.kind, LayoutLoadKind::Moment(_));
    if !layout.closed || count < LEAST_STATES || layout.loads.iter().any(moment) {
        return None;
    }
    let turned: Vec<f64> = layout.drives.iter().map(|d| d.values[count] - d.values[0]).collect();
    let (nearest, first) = at_nearest(model, count).ok()?;
    let run = |way: i64, steps: usize| -> Option<Vec<Equilibrium>> {
        let (mut solver, mut walker) = (Solver::new(model), first.clone());
        let mut out = Vec::with_capacity(steps);
        for k in 1..=steps as i64 {
            let at = nearest as i64 + way * k;
            let (round, s) = (at.div_euclid(count as i64) as f64, at.rem_euclid(count as i64) as usize);
            let mut controls = layout.controls(s);
            controls.iter_mut().zip(&turned).for_each(|(c, t)| *c += round * t);
            walker.walk(model, &mut solver, s, &controls).ok()?;
            let mut equilibrium = walker.equilibrium.clone();
            equilibrium.state.drives.iter_mut().zip(&turned).for_each(|(d, t)| *d -= round * t);
            out.push(equilibrium);
        }
        Some(out)
    };
    let half = count / 2;
    let (ahead, back) = rayon::join(|| run(1, half), || run(-1, count - half));
    let (mut ahead, back) = (ahead?, back?);
    if apart_mm(layout, &ahead.last()?.state, &back.last()?.state) > SAME_MM {
        return None;
    }
    // From the nearest state on: itself, those ahead, and those behind from the far end.
    let mut round = vec![first.equilibrium];
    round.append(&mut ahead);
    round.extend(back.into_iter().rev().skip(1));
    round.rotate_right(nearest);
    let mut last = round.first()?.clone();
    last.state.drives.iter_mut().zip(&turned).for_each(|(d, t)| *d += t);
    round.push(last);
    Some(Cycle { states: round })
}

/// How far two states are apart, mm: the furthest point of a rod or centre of a body, or turn of a body (rad), how far it has
/// turned idly aside.
pub fn apart_mm(layout: &Layout, a: &State, b: &State) -> f64 {
    let idle = |body: usize| {
        let gauge = |c: &Constraint| matches!(c, Constraint::Gauge { body: b, .. } if *b == body);
        layout.constraints.iter().any(gauge)
    };
    let bodies = a.poses.iter().zip(&b.poses).enumerate().map(|(body, (a, b))| {
        let turned = if idle(body) { 0.0 } else { (a.rotation - b.rotation).norm() };
        (a.translation - b.translation).norm().max(turned)
    });
    let rods = a.rods.iter().zip(&b.rods).flat_map(|(a, b)| a.vertices.iter().zip(&b.vertices));
    bodies.chain(rods.map(|(a, b)| (a - b).norm())).fold(0.0, f64::max)
}

/// A followed equilibrium and the controls it belongs to.
#[derive(Clone)]
pub(super) struct Walker {
    equilibrium: Equilibrium,
    controls: Vec<f64>,
    history: History,
}

impl Walker {
    /// At an equilibrium and the controls it belongs to.
    pub(super) fn new(equilibrium: Equilibrium, controls: Vec<f64>) -> Self {
        Self { equilibrium, controls, history: History::default() }
    }

    pub(super) fn equilibrium(&self) -> &Equilibrium {
        &self.equilibrium
    }

    pub(super) fn into_equilibrium(self) -> Equilibrium {
        self.equilibrium
    }

    fn at_rest(model: &Model, solver: &mut Solver) -> Result<Self, SweepError> {
        let controls = vec![0.0; model.layout.drives.len() + model.layout.loads.len()];
        let equilibrium = solver
            .solve(model, model.rest_state(), &controls)
            .map_err(|error| Self::lost(model, &controls, 0, error))?;
        let mut this = Self::new(equilibrium, controls);
        this.remember(model, solver, &vec![0.0; this.controls.len()]);
        Ok(this)
    }

    fn lost(model: &Model, controls: &[f64], state: usize, error: SolveError) -> SweepError {
        let last_drives = controls.iter().zip(&model.layout.drives).map(|(v, d)| v + d.rest).collect();
        SweepError { state, last_drives, error }
    }

    /// Goes to `target`, in one step where that works.
    pub(super) fn walk(
        &mut self,
        model: &Model,
        solver: &mut Solver,
        state: usize,
        target: &[f64],
    ) -> Result<(), SweepError> {
        let mut part = 1.0;
        let mut order = ORDER;
        loop {
            let change: Vec<f64> = target.iter().zip(&self.controls).map(|(t, d)| t - d).collect();
            if change.iter().all(|c| c.abs() < 1e-15) {
                return Ok(());
            }
            let next: Vec<f64> = if part >= 1.0 {
                target.to_vec()
            } else {
                self.controls.iter().zip(&change).map(|(d, c)| d + part * c).collect()
            };
            let change: Vec<f64> = next.iter().zip(&self.controls).map(|(n, d)| n - d).collect();
            match self.try_step(model, solver, &next, &change, order) {
                Ok(equilibrium) => {
                    self.equilibrium = equilibrium;
                    self.controls = next;
                    self.remember(model, solver, &change);
                    if part >= 1.0 {
                        return Ok(());
                    }
                    // The rest of the way counts as the new whole: try twice the step just made.
                    part = (2.0 * part / (1.0 - part)).min(1.0);
                }
                Err(error) => {
                    part *= 0.5;
                    order = 1;
                    if part < LEAST_PART {
                        return Err(Self::lost(model, &self.controls, state, error));
                    }
                }
            }
        }
    }

    fn remember(&mut self, model: &Model, solver: &mut Solver, change: &[f64]) {
        self.history.add(model, solver, &self.equilibrium, change);
    }

    /// One predicted and corrected step.
    fn try_step(
        &mut self,
        model: &Model,
        solver: &mut Solver,
        next: &[f64],
        change: &[f64],
        order: usize,
    ) -> Result<Equilibrium, SolveError> {
        if self.history.is_empty() {
            solver.solve(model, self.equilibrium.state.clone(), &self.controls)?;
            self.remember(model, solver, &vec![0.0; self.controls.len()]);
        }
        let state = self.history.predict(model, solver, &self.equilibrium.state, change, order);
        solver.correct(model, state.ok_or(SolveError::NotConverged)?, next)
    }
}
