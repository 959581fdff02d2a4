//! Prediction of the next state of a sweep from the tangents of the last ones.
//!
//! Along the way, links, multipliers, insides and forces of the rods have tangents T(σ) by the controls. A step by Δc
//! is ∫T dc, with T interpolated through the last states (Adams and Bashforth, steps of any length). The rates are
//! those of charts that move along (spatial rotations, twists against parallel transport), which is
//! exact up to commutators of third order.

use super::model::{Model, State};
use super::newton::{Equilibrium, Solver};
use super::saddle::gather;
use super::step::moved;
use crate::math::Pose;
use crate::rod::{RodForces, RodState};
use nalgebra::{DVector, Matrix4, Vector4};

/// States whose tangents are used at most.
const ORDER: usize = 4;
/// Weights beyond this amplify what the tangents do not know: fewer of them are used.
const LARGEST_WEIGHT: f64 = 8.0;
/// Cosine between one step's change of controls and the last one's below which the way has a corner.
const CORNER: f64 = 0.9;

/// Rates by one control.
#[derive(Clone, Debug)]
struct Rates {
    /// Links, then multipliers.
    links: DVector<f64>,
    /// Per rod.
    inside: Vec<Vec<f64>>,
    forces: Vec<RodForces>,
}

impl Rates {
    fn add_scaled(&mut self, scale: f64, other: &Self) {
        self.links.axpy(scale, &other.links, 1.0);
        for (to, from) in self.inside.iter_mut().flatten().zip(other.inside.iter().flatten()) {
            *to += scale * from;
        }
        for (to, from) in self.forces.iter_mut().zip(&other.forces) {
            to.add_scaled(scale, from);
        }
    }
}

/// Tangents at one state of the way.
#[derive(Clone, Debug)]
struct Tangent {
    /// Length of the way there.
    at: f64,
    /// Per control.
    by: Vec<Rates>,
    /// Of the state itself.
    forces: Vec<RodForces>,
}

/// Tangents of the last states, the latest first.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    tangents: Vec<Tangent>,
    last_change: Vec<f64>,
}

fn length(change: &[f64]) -> f64 {
    change.iter().map(|c| c * c).sum::<f64>().sqrt()
}

impl History {
    /// Whether nothing is known of the present state.
    pub(super) fn is_empty(&self) -> bool {
        self.tangents.is_empty()
    }

    /// Adds the tangents of the state that `solver` solved last, reached by a change of controls.
    pub(super) fn add(
        &mut self,
        model: &Model,
        solver: &mut Solver,
        equilibrium: &Equilibrium,
        change: &[f64],
    ) {
        let corner = || {
            let product: f64 = change.iter().zip(&self.last_change).map(|(a, b)| a * b).sum();
            product < CORNER * length(change) * length(&self.last_change)
        };
        if self.last_change.len() == change.len() && corner() {
            self.tangents.truncate(1);
        }
        let at = self.tangents.first().map_or(0.0, |t| t.at) + length(change);
        let drives = model.layout.drives.len();
        let by = (0..drives + model.layout.loads.len())
            .map(|control| match control.checked_sub(drives) {
                None => solver.drive_tangent(model, control),
                Some(load) => solver.load_tangent(model, &equilibrium.state, load),
            })
            .collect::<Vec<_>>();
        let by = by.into_iter().map(|links| rates(model, solver, links)).collect();
        let forces = solver.systems.iter().map(|s| s.forces().clone()).collect();
        self.tangents.insert(0, Tangent { at, by, forces });
        self.tangents.truncate(ORDER);
        self.last_change = change.to_vec();
    }

    /// The state after a change of controls, by `order` tangents at most; the solver then expects its forces. None
    /// where a rod cannot follow.
    pub(super) fn predict(
        &self,
        model: &Model,
        solver: &mut Solver,
        state: &State,
        change: &[f64],
        order: usize,
    ) -> Option<State> {
        let latest = self.tangents.first()?;
        let product: f64 = change.iter().zip(&self.last_change).map(|(a, b)| a * b).sum();
        let corner = product < CORNER * length(change) * length(&self.last_change);
        let known = if corner { 1 } else { order.min(self.tangents.len()) };
        let step = length(change);
        let weights = (1..=known).rev().find_map(|k| self.weights(k, step))?;
        let mut sum: Option<Rates> = None;
        for (tangent, weight) in self.tangents.iter().zip(&weights) {
            for (rates, by) in tangent.by.iter().zip(change).filter(|(_, by)| **by != 0.0) {
                match &mut sum {
                    Some(sum) => sum.add_scaled(weight * by, rates),
                    None => {
                        let mut first = rates.clone();
                        first.add_scaled(weight * by - 1.0, rates);
                        sum = Some(first);
                    }
                }
            }
        }
        let sum = sum?;
        let follow = |r: usize, rod_state: &mut RodState, poses: &[Pose]| {
            let rod = model.rods.get(r)?;
            let [a, b] = rod.bodies;
            rod.rod.retract(rod_state, sum.inside.get(r)?, &poses[a], &poses[b]).ok()
        };
        let next = moved(model, state, &sum.links, 1.0, follow)?;
        for ((system, now), change) in solver.systems.iter_mut().zip(&latest.forces).zip(&sum.forces) {
            let mut forces = now.clone();
            forces.add_scaled(1.0, change);
            system.expect_forces(&forces);
        }
        Some(next)
    }

    /// Weights of the last `k` tangents in a step of this length; none where they are too large.
    fn weights(&self, k: usize, step: f64) -> Option<Vec<f64>> {
        let origin = self.tangents.first()?.at;
        let nodes: Vec<f64> = self.tangents.iter().take(k).map(|t| (t.at - origin) / step).collect();
        // Σ w τᵐ = ∫₀¹ τᵐ dτ for m < k.
        let matrix = Matrix4::from_fn(|m, i| match (m < k, i < k) {
            (true, true) => nodes[i].powi(m as i32),
            _ => f64::from(u8::from(m == i)),
        });
        let moments = Vector4::from_fn(|m, _| if m < k { 1.0 / (m + 1) as f64 } else { 0.0 });
        let weights: Vec<f64> = matrix.lu().solve(&moments)?.iter().take(k).copied().collect();
        let sum: f64 = weights.iter().map(|w| w.abs()).sum();
        (sum <= LARGEST_WEIGHT).then_some(weights)
    }
}

fn rates(model: &Model, solver: &mut Solver, links: DVector<f64>) -> Rates {
    let mut inside = Vec::with_capacity(model.rods.len());
    let mut forces = Vec::with_capacity(model.rods.len());
    for (rod, system) in model.rods.iter().zip(&mut solver.systems) {
        let d = gather(model, rod.bodies, &links);
        let own = system.back_substitute_rate(&d).to_vec();
        let mut change = system.forces().clone();
        system.force_change(&rod.rod, &own, &d, &mut change);
        inside.push(own);
        forces.push(change);
    }
    Rates { links, inside, forces }
}
