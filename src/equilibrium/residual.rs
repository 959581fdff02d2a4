//! What is not yet in balance in a state, and when that is little enough.

use super::load::scatter_loads;
use super::model::{Model, State};
use super::newton::Solver;
use super::saddle::scatter;
use nalgebra::DVector;

/// Relative residual of an accepted state, against the largest internal force F*. Tight enough for derivatives that agree
/// with differences to 1e-6 (`tests/equilibrium.rs`), above the rounding floor that is added to it.
const RESIDUAL: f64 = 1e-9;
/// Constraints of an accepted state, mm (levers times radians for directions and angles).
const CONSTRAINT_MM: f64 = 1e-9;
/// After a full step the Hessian is that of a state so near that a step with its factors leaves about 2 r₁²/r₀ of residuals r₀ and r₁ before and
/// after it. It is taken where that is below this part of the tolerance. Over the cycles of the examples, at start and solved, 0.01, 0.1 and 0.5 replace
/// 5 to 43, 10 to 46 and 12 to 48 % of the factorisations of steps, and take the same number of steps in all, but for one.
const CHORD: f64 = 0.1;

/// What all rods together add to a residual.
pub(super) struct AssembledRods {
    gradient: DVector<f64>,
    internal_n: f64,
    tolerance_n: f64,
}

/// Sizes of what is not yet in balance.
pub(super) struct Residual {
    pub(super) force_n: f64,
    constraint_mm: f64,
    pub(super) tolerance_n: f64,
}

impl Residual {
    pub(super) fn small(&self) -> bool {
        self.force_n <= self.tolerance_n && self.constraint_mm <= CONSTRAINT_MM
    }

    pub(super) fn is_finite(&self) -> bool {
        self.force_n.is_finite() && self.constraint_mm.is_finite()
    }

    /// Whether one more step with the same factors does, after a full one that brought the force down from `before_n`.
    pub(super) fn serves_a_chord(&self, before_n: f64) -> bool {
        let left_n = 2.0 * self.force_n.powi(2) / before_n;
        left_n <= CHORD * self.tolerance_n && self.constraint_mm <= CONSTRAINT_MM
    }
}

impl Solver {
    /// Assembles all rods; `factored` also factors and condenses each while its numbers are at hand.
    pub(super) fn assemble_rods(&mut self, model: &Model, state: &State, factored: bool) -> AssembledRods {
        if factored {
            self.rods_positive = true;
            self.rods_factored += 1;
        }
        let mut gradient = DVector::zeros(model.layout.dofs());
        let (mut internal_n, mut largest, mut least_stiffness, mut floor) =
            (0.0f64, 0.0f64, f64::MAX, 0.0f64);
        for ((rod, system), rod_state) in model.rods.iter().zip(&mut self.systems).zip(&state.rods) {
            let [a, b] = rod.bodies;
            system.assemble(&rod.rod, rod_state, &state.poses[a], &state.poses[b]);
            internal_n = internal_n.max(system.internal_residual_norm());
            largest = largest.max(system.largest_internal_force());
            least_stiffness =
                least_stiffness.min(rod.rod.least_bending_stiffness() / rod.rod.length_mm().powi(2));
            floor = floor.max(system.rounding_floor(&rod.rod, rod_state));
            scatter(model, rod.bodies, system.link_gradient(), &mut gradient);
            if factored {
                self.rods_positive &= system.factor().negative_pivots == 0;
                system.condense();
            }
        }
        let tolerance_n = RESIDUAL * largest.max(1e-3 * least_stiffness) + floor;
        AssembledRods { gradient, internal_n, tolerance_n }
    }

    /// The residual of assembled rods with constraints, drives and the present loads.
    pub(super) fn residual(
        &mut self,
        model: &Model,
        state: &State,
        target: &[f64],
        rods: &AssembledRods,
    ) -> Residual {
        let mut gradient = rods.gradient.clone();
        let mut constraint_mm = 0.0f64;
        self.for_each_row(model, state, target, |_, bodies, lambda, residual, weight, row| {
            constraint_mm = constraint_mm.max((residual * weight).abs());
            scatter(model, bodies, &(row * lambda), &mut gradient);
        });
        scatter_loads(model, state, &self.loads, |first, g| {
            let mut rows = gradient.fixed_rows_mut::<6>(first);
            rows += g;
        });
        self.add_load_gradient(model, state, &mut gradient);
        let mut force_n = rods.internal_n;
        for i in 0..gradient.len() {
            force_n = force_n.max((gradient[i] * self.scale[i]).abs());
        }
        Residual { force_n, constraint_mm, tolerance_n: rods.tolerance_n }
    }
}
