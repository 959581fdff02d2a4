//! What a mechanism does when nobody holds its drives: rest states, the barriers between them, and snaps.
//!
//! Along the cycle the potential Π is followed with the drives held; τ = dΠ/dα is the drives' load. A released
//! drive rests where τ = 0 and dτ/dα > 0, and leaves that state for the next one over the highest Π between them:
//! the barrier is ∫τ dα up to there. Of one drive the states are put in the order of its value, so that a motion to
//! and fro is one profile, and a whole turn closes it; of several drives only the way of the cycle is looked at.

use super::design_load::LayoutLoad;
use super::model::Model;
use super::newton::{Equilibrium, SolveError, Solver};
use super::sweep::{Cycle, Walker};

/// Load below which a state counts as being in balance, relative to the largest of the cycle.
const BALANCE: f64 = 1e-9;
/// Steps in which a balance is refined: each brackets it, the Illinois rule converges faster than halving.
const REFINEMENTS: usize = 80;
/// Drive values nearer than this, relative to their range, are one state.
const SAME: f64 = 1e-9;
/// Energy that work along the path does not account for, relative to the range of the energy: beyond it, if
/// halving the step does not help, the mechanism snapped.
const LOST: f64 = 1e-2;
/// A mechanism whose energy changes by less has stored nothing but rounding, N mm.
const STORES_N_MM: f64 = 1e-15;
/// Halvings by which a snap is found.
const HALVINGS: usize = 10;

/// A state in which the load along the path is zero.
#[derive(Clone, Debug)]
pub struct Balance {
    /// Values of the drives relative to the drawing pose, rad or mm.
    pub drives: Vec<f64>,
    /// Place along the cycle, in states.
    pub place: f64,
    /// The state itself.
    pub equilibrium: Equilibrium,
}

/// A rest state of the released mechanism.
#[derive(Clone, Debug)]
pub struct Rest {
    /// Where and how.
    pub balance: Balance,
    /// Energy to be given before it goes on towards larger values (or along the cycle), N·mm; none if it is not
    /// known to lead to another rest state.
    pub barrier_up_n_mm: Option<f64>,
    /// The same towards smaller values.
    pub barrier_down_n_mm: Option<f64>,
}

/// A jump under held drives.
#[derive(Clone, Debug)]
pub struct Snap {
    /// State that is reached by it.
    pub state: usize,
    /// Drive values of the last state before it, rad or mm.
    pub drives: Vec<f64>,
    /// Energy that was lost, N·mm.
    pub lost_n_mm: f64,
}

/// What [`landscape`] finds.
#[derive(Clone, Debug, Default)]
pub struct Landscape {
    /// In the order of the drive's value, or along the cycle.
    pub rests: Vec<Rest>,
    /// States that a released mechanism leaves to either side, in the same order: tops of the barriers.
    pub tops: Vec<Balance>,
    /// Jumps under held drives, along the cycle.
    pub snaps: Vec<Snap>,
    /// dτ/dα of the only drive at every state, N·mm/rad or N/mm; empty for several drives.
    pub stiffness: Vec<f64>,
}

/// Looks at a followed cycle.
///
/// # Errors
/// [`SolveError`] where a state between two of the cycle cannot be solved.
pub fn landscape(model: &Model, cycle: &Cycle) -> Result<Landscape, SolveError> {
    let mut solver = Solver::new(model);
    let drives = model.layout.drives.len();
    let mut out = Landscape::default();
    // Loads that change over the cycle are not a matter of the drives' values alone.
    let steady = |l: &LayoutLoad| l.values.windows(2).all(|v| v[0] == v[1]);
    if drives == 0 || cycle.states.len() < 2 || !model.layout.loads.iter().all(steady) {
        return Ok(out);
    }
    let mut tangents = Vec::with_capacity(cycle.states.len());
    for s in 0..cycle.states.len() {
        solver.solve(model, cycle.states[s].state.clone(), &model.layout.controls(s))?;
        tangents.push(Path::tangent(model, &solver));
    }
    if drives == 1 {
        out.stiffness = tangents.iter().filter_map(|t| t.first().copied()).collect();
    }
    let path = Path::new(model, cycle);
    out.snaps = path.snaps(&mut solver, &tangents)?;
    let found = path.balances(&mut solver)?;
    path.barriers(found, &mut out);
    Ok(out)
}

/// Of rods and loads, N·mm.
fn potential(e: &Equilibrium) -> f64 {
    e.energy_n_mm + e.load_potential_n_mm
}

/// The states in the order in which they are looked at.
struct Path<'m, 'l> {
    model: &'m Model<'l>,
    cycle: &'m Cycle,
    /// Indices into the cycle.
    order: Vec<usize>,
    /// Whether the last one is the first once more.
    closed: bool,
}

/// A balance with its kind.
struct Found {
    balance: Balance,
    minimum: bool,
}

impl<'m, 'l> Path<'m, 'l> {
    fn new(model: &'m Model<'l>, cycle: &'m Cycle) -> Self {
        let mut order: Vec<usize> = (0..cycle.states.len()).collect();
        let mut closed = model.layout.closed;
        if let [drive] = model.layout.drives.as_slice() {
            let value = |s: usize| drive.values.get(s).copied().unwrap_or(0.0);
            order.sort_by(|a, b| value(*a).total_cmp(&value(*b)));
            let range = value(order[order.len() - 1]) - value(order[0]);
            order.dedup_by(|b, a| (value(*b) - value(*a)).abs() <= SAME * range);
            // To and fro is not round.
            closed &= (value(0) - value(cycle.states.len() - 1)).abs() > SAME * range;
        }
        Self { model, cycle, order, closed }
    }

    fn state(&self, k: usize) -> &Equilibrium {
        &self.cycle.states[self.order[k]]
    }

    /// Change of the controls from place `k` to the next.
    fn change(&self, k: usize) -> Vec<f64> {
        let (a, b) =
            (self.model.layout.controls(self.order[k]), self.model.layout.controls(self.order[k + 1]));
        b.iter().zip(&a).map(|(b, a)| b - a).collect()
    }

    /// Load along `change`: dΠ by the part of it that is gone.
    fn load(&self, e: &Equilibrium, change: &[f64]) -> f64 {
        let drives = self.model.layout.drives.len();
        change.iter().take(drives).enumerate().map(|(d, c)| e.drive_load(self.model, d) * c).sum()
    }

    /// Derivatives of the drives' loads by the drives, row by row, at the state that was solved last.
    fn tangent(model: &Model, solver: &Solver) -> Vec<f64> {
        let n = model.layout.drives.len();
        let columns: Vec<_> = (0..n).map(|e| solver.drive_tangent(model, e)).collect();
        (0..n * n).map(|i| columns.get(i % n).map_or(0.0, |t| -t[t.len() - n + i / n])).collect()
    }

    /// Energy between two states that their loads and the loads' slopes do not account for (Euler–Maclaurin,
    /// error of fifth order in the step).
    fn lost(&self, ends: [(&Equilibrium, &[f64]); 2], change: &[f64]) -> f64 {
        let n = self.model.layout.drives.len();
        let slope = |t: &[f64]| -> f64 {
            (0..n * n).map(|i| t.get(i).copied().unwrap_or(0.0) * change[i / n] * change[i % n]).sum()
        };
        let [(a, ta), (b, tb)] = ends;
        let work = 0.5 * (self.load(a, change) + self.load(b, change)) + (slope(ta) - slope(tb)) / 12.0;
        potential(b) - potential(a) - work
    }

    /// Steps of the cycle in which energy is lost however finely they are walked.
    fn snaps(&self, solver: &mut Solver, tangents: &[Vec<f64>]) -> Result<Vec<Snap>, SolveError> {
        let states = &self.cycle.states;
        let energies = || states.iter().map(potential);
        let range = energies().fold(f64::NEG_INFINITY, f64::max) - energies().fold(f64::INFINITY, f64::min);
        let mut out = Vec::new();
        for s in 1..states.len() {
            let (mut from, to) = (self.model.layout.controls(s - 1), self.model.layout.controls(s));
            let mut change: Vec<f64> = to.iter().zip(&from).map(|(b, a)| b - a).collect();
            let mut ends =
                [(states[s - 1].clone(), tangents[s - 1].clone()), (states[s].clone(), tangents[s].clone())];
            let lost = |ends: &[(Equilibrium, Vec<f64>); 2], change: &[f64]| {
                self.lost([(&ends[0].0, &ends[0].1), (&ends[1].0, &ends[1].1)], change)
            };
            let first = lost(&ends, &change);
            let mut now = first;
            for _ in 0..HALVINGS {
                if now.abs() <= LOST * range {
                    break;
                }
                change.iter_mut().for_each(|c| *c *= 0.5);
                let half: Vec<f64> = from.iter().zip(&change).map(|(f, c)| f + c).collect();
                let mut walker = Walker::new(ends[0].0.clone(), from.clone());
                if walker.walk(self.model, solver, s, &half).is_err() {
                    break;
                }
                let middle = walker.into_equilibrium();
                solver.solve(self.model, middle.state.clone(), &half)?;
                let tangent = Self::tangent(self.model, solver);
                let halves = [
                    [ends[0].clone(), (middle.clone(), tangent.clone())],
                    [(middle, tangent), ends[1].clone()],
                ];
                let parts = [lost(&halves[0], &change), lost(&halves[1], &change)];
                let later = usize::from(parts[1].abs() > parts[0].abs());
                now = parts[later];
                if later == 1 {
                    from = half;
                }
                let [a, b] = halves;
                ends = if later == 1 { b } else { a };
            }
            if now.abs() > LOST * range && range > STORES_N_MM {
                let drives = from.iter().zip(&self.model.layout.drives).map(|(v, d)| v + d.rest).collect();
                out.push(Snap { state: s, drives, lost_n_mm: now.abs() });
            }
        }
        Ok(out)
    }

    /// All balances in order.
    fn balances(&self, solver: &mut Solver) -> Result<Vec<Found>, SolveError> {
        let count = self.order.len();
        let mut loads = Vec::new();
        for k in 0..count - 1 {
            let change = self.change(k);
            loads.push([self.load(self.state(k), &change), self.load(self.state(k + 1), &change)]);
        }
        let largest = loads.iter().flatten().fold(0.0f64, |m, l| m.max(l.abs()));
        let sign = |l: f64| if l.abs() <= BALANCE * largest { 0.0 } else { l.signum() };
        let mut out = Vec::new();
        for k in 0..count {
            // Of a closed path the end is the beginning.
            if k + 1 == count && self.closed {
                break;
            }
            let before = if k > 0 {
                loads.get(k - 1)
            } else if self.closed {
                loads.last()
            } else {
                None
            };
            let after = loads.get(k);
            let zero = before.is_none_or(|l| sign(l[1]) == 0.0) && after.is_none_or(|l| sign(l[0]) == 0.0);
            if zero && largest > 0.0 {
                let (left, right) = (before.map_or(0.0, |l| sign(l[0])), after.map_or(0.0, |l| sign(l[1])));
                if left != right && left * right <= 0.0 {
                    let minimum = left < 0.0 || right > 0.0;
                    let target = self.model.layout.controls(self.order[k]);
                    let place = self.order[k] as f64;
                    out.push(Found { balance: self.balance(place, &target, self.state(k).clone()), minimum });
                }
            }
            if let Some(ends) = after
                && sign(ends[0]) * sign(ends[1]) < 0.0
            {
                out.push(self.between(solver, k, *ends, BALANCE * largest)?);
            }
        }
        Ok(out)
    }

    fn balance(&self, place: f64, target: &[f64], equilibrium: Equilibrium) -> Balance {
        let drives = target.iter().zip(&self.model.layout.drives).map(|(v, d)| v + d.rest).collect();
        Balance { drives, place, equilibrium }
    }

    /// The balance between places `k` and `k + 1`, whose loads have different signs: regula falsi with the Illinois
    /// rule, a solution at every step.
    fn between(
        &self,
        solver: &mut Solver,
        k: usize,
        ends: [f64; 2],
        enough: f64,
    ) -> Result<Found, SolveError> {
        let (from, change) = (self.model.layout.controls(self.order[k]), self.change(k));
        let at = |u: f64| -> Vec<f64> { from.iter().zip(&change).map(|(f, c)| f + u * c).collect() };
        let mut walker = Walker::new(self.state(k).clone(), from.clone());
        let (mut low, mut high) = ((0.0, ends[0]), (1.0, ends[1]));
        let mut u = 0.0;
        let mut side = 0;
        for _ in 0..REFINEMENTS {
            u = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            walker.walk(self.model, solver, self.order[k], &at(u)).map_err(|e| e.error)?;
            let load = self.load(walker.equilibrium(), &change);
            if load.abs() <= enough || high.0 - low.0 <= f64::EPSILON {
                break;
            }
            if load * high.1 > 0.0 {
                high = (u, load);
                if side == 1 {
                    low.1 *= 0.5;
                }
                side = 1;
            } else {
                low = (u, load);
                if side == -1 {
                    high.1 *= 0.5;
                }
                side = -1;
            }
        }
        let (first, next) = (self.order[k] as f64, self.order[k + 1] as f64);
        let balance = self.balance(first + u * (next - first), &at(u), walker.into_equilibrium());
        Ok(Found { balance, minimum: ends[0] < 0.0 })
    }

    /// Barriers to both sides: the highest energy on the way to the next rest state.
    fn barriers(&self, found: Vec<Found>, out: &mut Landscape) {
        let count = found.len();
        let energy = |k: usize| potential(&found[k % count].balance.equilibrium);
        for (k, f) in found.iter().enumerate().filter(|(_, f)| f.minimum) {
            // Steps to the side until the next minimum, on an open path not beyond its ends.
            let side = |forward: bool| -> Option<f64> {
                let mut top: Option<f64> = None;
                for step in 1..=count {
                    let j = if forward { k + step } else { k + count - step };
                    let outside = if forward { j >= count } else { j < count };
                    if outside && !self.closed {
                        return None;
                    }
                    if found[j % count].minimum {
                        return top.map(|t| t - energy(k));
                    }
                    top = Some(top.map_or(energy(j), |t: f64| t.max(energy(j))));
                }
                None
            };
            out.rests.push(Rest {
                balance: f.balance.clone(),
                barrier_up_n_mm: side(true),
                barrier_down_n_mm: side(false),
            });
        }
        out.tops = found.into_iter().filter(|f| !f.minimum).map(|f| f.balance).collect();
    }
}
