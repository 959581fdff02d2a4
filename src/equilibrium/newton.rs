//! Newton's method on the total potential with constraints, full steps first.

use super::load::PointForce;
use super::model::{Model, State};
use super::saddle::elimination;
use crate::ir::DriveUnit;
use crate::kinematics::Jacobian;
use crate::math::elimination::Elimination;
use crate::math::fronts::Factors;
use crate::rod::{RodSystem, StationStrain};
use nalgebra::DVector;
use std::sync::Arc;

/// Newton iterations before a solution counts as failed.
const ITERATIONS: usize = 40;
/// The same of a step of a sweep, which can be cut: small ones take 1 to 3, steps of 30 degrees up to 5. What takes longer
/// may have wandered off to another branch.
const STEP_ITERATIONS: usize = 10;
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
}
