//! Newton's method on the total potential with constraints, full steps first.

use super::load::{PointForce, scatter_loads};
use super::model::{Model, State};
use super::saddle::{elimination, gather, scatter};
use crate::ir::DriveUnit;
use crate::kinematics::Jacobian;
use crate::math::Pose;
use crate::math::elimination::Elimination;
use crate::math::fronts::Factors;
use crate::rod::{RodState, RodSystem, StationStrain};
use nalgebra::DVector;
use std::sync::Arc;

/// Relative residual of an accepted state, against the largest internal force F*. Tight enough for derivatives that agree
/// with differences to 1e-6 (`tests/equilibrium.rs`), above the rounding floor that is added to it.
const RESIDUAL: f64 = 1e-9;
/// Constraints of an accepted state, mm (levers times radians for directions and angles).
const CONSTRAINT_MM: f64 = 1e-9;
/// Newton iterations before a solution counts as failed.
const ITERATIONS: usize = 40;
/// The same of a step of a sweep, which can be cut: small ones take 1 to 3, steps of 30 degrees up to 5. What takes longer
/// may have wandered off to another branch.
const STEP_ITERATIONS: usize = 10;
/// Largest rotation of a link in one iteration, rad: beyond it the chart's linearisation is poor.
const ROTATION_STEP_RAD: f64 = 0.4;
/// Largest displacement of a link in one iteration, in lever lengths.
const TRANSLATION_STEP: f64 = 0.5;

/// After a full step the Hessian is that of a state so near that a step with its factors leaves about 2 r₁²/r₀ of residuals r₀ and r₁ before and
/// after it. It is taken where that is below this part of the tolerance. Over the cycles of the examples, at start and solved, 0.01, 0.1 and 0.5 replace
/// 5 to 43, 10 to 46 and 12 to 48 % of the factorisations of steps, and take the same number of steps in all, but for one.
const CHORD: f64 = 0.1;

/// Why no equilibrium was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolveError {
    /// The iteration did not settle.
    NotConverged,
    /// Numbers left the range of the arithmetic.
    NotFinite,
    /// The model was built without the derivatives that were asked for.
    NoDerivatives,
}

/// An accepted equilibrium.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// The state.
    pub state: State,
    /// Whether it is a strict minimum with the drives held (Haynsworth inertia).
    pub stable: bool,
    /// Elastic energy, N·mm.
    pub energy_n_mm: f64,
    /// Potential of the design's loads relative to the rest pose, N·mm.
    pub load_potential_n_mm: f64,
    /// Strain measures of each rod at its stations.
    pub strains: Vec<Vec<StationStrain>>,
    /// Newton iterations taken.
    pub iterations: usize,
}

impl Equilibrium {
    /// Torque the motor exerts on the drive's second body, N·mm (of a sliding drive the force, N): τ = dΠ/dα = −λ.
    pub fn drive_load(&self, model: &Model, drive: usize) -> f64 {
        -self.state.lambda[model.rows() - model.layout.drives.len() + drive]
    }
}

impl Equilibrium {
    /// True largest von Mises stress over all rods, MPa.
    pub fn max_stress_mpa(&self, model: &Model) -> f64 {
        let largest = |(rod, strains): (&super::model::ModelRod, &Vec<StationStrain>)| {
            rod.rod.largest_stress(strains).map_or(0.0, |s| s.von_mises_mpa)
        };
        model.rods.iter().zip(&self.strains).map(largest).fold(0.0, f64::max)
    }
}

/// Workspace of one thread: rod systems and the factors of the last solved state.
pub struct Solver {
    pub(super) systems: Vec<RodSystem>,
    pub(super) order: Arc<Elimination>,
    pub(super) factors: Option<Factors>,
    pub(super) scale: DVector<f64>,
    pub(super) rods_positive: bool,
    /// How often the rods were factored: factors of the same number are the same.
    pub(super) rods_factored: u64,
    pub(super) jacobian: Jacobian,
    /// Of the last solution asked for.
    pub(super) loads: Vec<PointForce>,
    /// Sizes of the design's own loads, of the last solution asked for.
    pub(super) sizes: Vec<f64>,
}

/// What is asked of Newton's method.
#[derive(Clone, Copy)]
struct Wanted {
    /// Whether the factors at the state found are needed, too.
    factors: bool,
    /// Iterations at most.
    iterations: usize,
}

impl Wanted {
    fn factors(iterations: usize) -> Self {
        Self { factors: true, iterations }
    }
}

/// Where Newton's method begins.
pub(super) struct Begin {
    pub(super) state: State,
    /// Iterations already taken.
    pub(super) iteration: usize,
    /// Force residual before the last of them, N, where that was a full step.
    pub(super) before_n: Option<f64>,
    /// Whether the rods' factors are still those of that step.
    pub(super) factors_at_hand: bool,
}

impl From<State> for Begin {
    fn from(state: State) -> Self {
        Self { state, iteration: 0, before_n: None, factors_at_hand: true }
    }
}

/// Why an iteration ended without a state in balance.
pub(super) enum Halt {
    Failed(SolveError),
    /// It would go on with factors that are no longer at hand.
    FactorsGone,
}

impl From<SolveError> for Halt {
    fn from(error: SolveError) -> Self {
        Self::Failed(error)
    }
}

impl From<Halt> for SolveError {
    fn from(halt: Halt) -> Self {
        match halt {
            Halt::Failed(error) => error,
            Halt::FactorsGone => Self::NotConverged,
        }
    }
}

/// A state in balance, for which the rods are assembled, but links are not factored yet.
pub(super) struct Settled {
    pub(super) state: State,
    iterations: usize,
    tolerance_n: f64,
}

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
    tolerance_n: f64,
}

impl Residual {
    pub(super) fn small(&self) -> bool {
        self.force_n <= self.tolerance_n && self.constraint_mm <= CONSTRAINT_MM
    }

    pub(super) fn is_finite(&self) -> bool {
        self.force_n.is_finite() && self.constraint_mm.is_finite()
    }

    /// Whether one more step with the same factors does, after a full one that brought the force down from `before_n`.
    fn serves_a_chord(&self, before_n: f64) -> bool {
        let left_n = 2.0 * self.force_n.powi(2) / before_n;
        left_n <= CHORD * self.tolerance_n && self.constraint_mm <= CONSTRAINT_MM
    }
}

impl Solver {
    /// Workspace for a model with this many edges and rods.
    pub fn new(model: &Model) -> Self {
        let n = model.layout.dofs();
        let m = model.rows();
        let mut scale = DVector::from_element(n + m, 1.0);
        let lever = model.layout.length_mm;
        for i in 0..n {
            if i % 6 >= 3 {
                scale[i] = 1.0 / lever;
            }
        }
        let mut row = n;
        for c in &model.layout.constraints {
            for _ in 0..c.rows() {
                scale[row] = if c.is_length() { 1.0 } else { lever };
                row += 1;
            }
        }
        for drive in &model.layout.drives {
            scale[row] = match drive.joint.unit() {
                DriveUnit::Rad => lever,
                DriveUnit::Mm => 1.0,
            };
            row += 1;
        }
        Self {
            systems: model.rods.iter().map(|r| RodSystem::new(&r.rod)).collect(),
            order: Arc::new(elimination(model)),
            factors: None,
            scale,
            rods_positive: false,
            rods_factored: 0,
            jacobian: Jacobian::default(),
            loads: Vec::new(),
            sizes: Vec::new(),
        }
    }

    /// Solves for equilibrium at the controls `target` (drive values relative to rest, rad or mm, then sizes of the
    /// design's loads, zero where not given), from `state`.
    /// On success the factors of the solved state are kept for tangents and sensitivities.
    ///
    /// # Errors
    /// [`SolveError`]; `state` is then of no use.
    pub fn solve(&mut self, model: &Model, state: State, target: &[f64]) -> Result<Equilibrium, SolveError> {
        self.solve_loaded(model, state, target, &[])
    }

    /// The same under dead forces besides the design's loads. For large forces see [`Self::load`].
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_loaded(
        &mut self,
        model: &Model,
        state: State,
        target: &[f64],
        loads: &[PointForce],
    ) -> Result<Equilibrium, SolveError> {
        self.take_loads(loads);
        self.take_sizes(model, target);
        let settled = self.settle(model, state.into(), target, Wanted::factors(ITERATIONS))?;
        Ok(self.complete(model, settled))
    }

    /// Goes on to the equilibrium under `loads` from where it was begun.
    ///
    /// # Errors
    /// [`Halt`].
    pub(super) fn go_on(
        &mut self,
        model: &Model,
        begin: Begin,
        target: &[f64],
        loads: &[PointForce],
    ) -> Result<State, Halt> {
        self.take_loads(loads);
        self.take_sizes(model, target);
        let wanted = Wanted { factors: false, iterations: ITERATIONS };
        Ok(self.settle(model, begin, target, wanted)?.state)
    }

    /// Assembles and factors at an equilibrium found before, which takes no further iteration.
    ///
    /// # Errors
    /// As [`Self::solve`] if the state given is none.
    pub(super) fn return_to(
        &mut self,
        model: &Model,
        state: &State,
        target: &[f64],
        loads: &[PointForce],
    ) -> Result<(), SolveError> {
        self.take_loads(loads);
        self.take_sizes(model, target);
        let settled = self.settle(model, state.clone().into(), target, Wanted::factors(ITERATIONS))?;
        self.factor_settled(model, &settled);
        Ok(())
    }

    pub(super) fn take_loads(&mut self, loads: &[PointForce]) {
        self.loads.clear();
        self.loads.extend_from_slice(loads);
    }

    /// As [`Self::solve`] from a predicted `state`, near enough to be reached in a few iterations.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub(super) fn correct(
        &mut self,
        model: &Model,
        state: State,
        target: &[f64],
    ) -> Result<Equilibrium, SolveError> {
        self.loads.clear();
        self.take_sizes(model, target);
        let settled = self.settle(model, state.into(), target, Wanted::factors(STEP_ITERATIONS))?;
        Ok(self.complete(model, settled))
    }

    fn settle(
        &mut self,
        model: &Model,
        begin: Begin,
        target: &[f64],
        wanted: Wanted,
    ) -> Result<Settled, Halt> {
        let found = self.iterations(model, begin, target, wanted);
        if found.is_err() {
            self.systems.iter_mut().for_each(RodSystem::forget_expected);
        }
        found
    }

    fn iterations(
        &mut self,
        model: &Model,
        begin: Begin,
        target: &[f64],
        wanted: Wanted,
    ) -> Result<Settled, Halt> {
        let Begin { mut state, iteration, mut before_n, mut factors_at_hand } = begin;
        for iterations in iteration..wanted.iterations {
            // Where no step with the former factors can follow, each rod is factored while it is at hand.
            let factored = before_n.is_none() && wanted.factors;
            let rods = self.assemble_rods(model, &state, factored);
            let residual = self.residual(model, &state, target, &rods);
            if !residual.is_finite() {
                return Err(SolveError::NotFinite.into());
            }
            if residual.small() {
                return Ok(Settled { state, iterations, tolerance_n: residual.tolerance_n });
            }
            let chord = before_n.take().is_some_and(|r| residual.serves_a_chord(r));
            if chord && !factors_at_hand {
                return Err(Halt::FactorsGone);
            }
            if chord {
                self.systems.iter_mut().for_each(|s| {
                    s.condense_gradient();
                });
            } else {
                if !factored {
                    self.factor_rods(false);
                }
                self.factor_links(model, &state, false);
                factors_at_hand = true;
            }
            let taken = self.step(model, &mut state, target)?;
            before_n = (!chord && taken >= 1.0).then_some(residual.force_n);
        }
        Err(SolveError::NotConverged.into())
    }

    /// Newton's step with the factors at hand, shortened where a link or rod would move too far; by which fraction.
    pub(super) fn step(
        &mut self,
        model: &Model,
        state: &mut State,
        target: &[f64],
    ) -> Result<f64, SolveError> {
        let step = self.newton_step(model, state, target);
        if step.iter().any(|v| !v.is_finite()) {
            return Err(SolveError::NotFinite);
        }
        let fraction = step_fraction(model, &step);
        self.advance(model, state, &step, fraction)
    }

    /// Factors at a settled state with its exact Hessian; whether it is a strict minimum.
    fn factor_settled(&mut self, model: &Model, settled: &Settled) -> bool {
        let exact = self.systems.iter().all(|s| s.is_exact(settled.tolerance_n));
        if !exact {
            self.assemble_rods(model, &settled.state, true);
        }
        if !self.systems.iter().all(RodSystem::is_factored) {
            self.factor_rods(true);
        }
        self.factor_links(model, &settled.state, true)
    }

    fn complete(&mut self, model: &Model, settled: Settled) -> Equilibrium {
        let stable = self.factor_settled(model, &settled);
        let Settled { state, iterations, .. } = settled;
        let energy_n_mm = self.systems.iter().map(|s| s.energy()).sum();
        let strains = model.rods.iter().zip(&self.systems).map(|(r, s)| s.strains(&r.rod)).collect();
        let load_potential_n_mm = model.load_potential_n_mm(&state, &self.sizes);
        Equilibrium { state, stable, energy_n_mm, load_potential_n_mm, strains, iterations }
    }

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

    /// Right-hand side of the scaled system for a full Newton step, and its solution: link
    /// increments, then the change of the multipliers.
    fn newton_step(&mut self, model: &Model, state: &State, target: &[f64]) -> DVector<f64> {
        let n = model.layout.dofs();
        let mut rhs = DVector::zeros(n + model.rows());
        let mut gradient = DVector::zeros(n);
        for (rod, system) in model.rods.iter().zip(&self.systems) {
            scatter(model, rod.bodies, &system.condensed_gradient, &mut gradient);
        }
        self.for_each_row(model, state, target, |row, bodies, lambda, residual, _, row_gradient| {
            scatter(model, bodies, &(row_gradient * lambda), &mut gradient);
            rhs[n + row] = -residual;
        });
        scatter_loads(model, state, &self.loads, |first, g| {
            let mut rows = gradient.fixed_rows_mut::<6>(first);
            rows += g;
        });
        self.add_load_gradient(model, state, &mut gradient);
        for i in 0..n {
            rhs[i] = -gradient[i];
        }
        self.solve_scaled(&mut rhs);
        rhs
    }

    /// Derivative of links and multipliers by drive value `drive` at the last solved state.
    pub(super) fn drive_tangent(&self, model: &Model, drive: usize) -> DVector<f64> {
        let n = model.layout.dofs();
        let m = model.rows();
        let mut rhs = DVector::zeros(n + m);
        rhs[n + m - model.layout.drives.len() + drive] = 1.0;
        self.solve_scaled(&mut rhs);
        rhs
    }

    /// Moves the state along `step` (links, multipliers) with the rods following; by which fraction.
    fn advance(
        &mut self,
        model: &Model,
        state: &mut State,
        step: &DVector<f64>,
        mut fraction: f64,
    ) -> Result<f64, SolveError> {
        // A frame that would turn by more than a right angle leaves the branch of its twist: shorten.
        for _ in 0..8 {
            let systems = &mut self.systems;
            let follow = |r: usize, rod_state: &mut RodState, poses: &[Pose]| {
                let (rod, system) = (model.rods.get(r)?, systems.get_mut(r)?);
                let inside = system.back_substitute(&gather(model, rod.bodies, step));
                let scaled: Vec<f64> = inside.iter().map(|v| v * fraction).collect();
                let [a, b] = rod.bodies;
                rod.rod.retract(rod_state, &scaled, &poses[a], &poses[b]).ok()?;
                system.expect(&rod.rod, fraction);
                Some(())
            };
            if let Some(next) = moved(model, state, step, fraction, follow) {
                *state = next;
                return Ok(fraction);
            }
            fraction *= 0.5;
        }
        Err(SolveError::NotConverged)
    }
}

/// The state moved by a fraction of increments of links and multipliers (`step`), while `follow` moves each rod's state to
/// the links' new poses; none where a rod cannot follow.
pub(super) fn moved(
    model: &Model,
    state: &State,
    step: &DVector<f64>,
    fraction: f64,
    mut follow: impl FnMut(usize, &mut RodState, &[Pose]) -> Option<()>,
) -> Option<State> {
    let n = model.layout.dofs();
    let mut next = state.clone();
    for (pose, body) in next.poses.iter_mut().zip(&model.layout.bodies) {
        if let Some(first) = body.first_dof {
            let d = step.fixed_rows::<6>(first) * fraction;
            *pose = pose.retract(&d.fixed_rows::<3>(0).into(), &d.fixed_rows::<3>(3).into());
        }
    }
    for (r, rod_state) in next.rods.iter_mut().enumerate() {
        follow(r, rod_state, &next.poses)?;
    }
    for (l, d) in next.lambda.iter_mut().zip(step.rows(n, model.rows()).iter()) {
        *l += fraction * d;
    }
    for (value, drive) in next.drives.iter_mut().zip(&model.layout.drives) {
        *value = drive.joint.value(&next.poses, *value);
    }
    for (turn, load) in next.turns.iter_mut().zip(&model.layout.loads) {
        *turn = load.turn(&next.poses, *turn);
    }
    Some(next)
}

fn step_fraction(model: &Model, step: &DVector<f64>) -> f64 {
    let mut fraction = 1.0f64;
    for body in &model.layout.bodies {
        if let Some(first) = body.first_dof {
            let du = step.fixed_rows::<3>(first).norm();
            let dphi = step.fixed_rows::<3>(first + 3).norm();
            fraction = fraction.min(TRANSLATION_STEP * model.layout.length_mm / du.max(f64::MIN_POSITIVE));
            fraction = fraction.min(ROTATION_STEP_RAD / dphi.max(f64::MIN_POSITIVE));
        }
    }
    fraction
}
