//! Newton's method for one rod with link A fixed and link B free, loaded or prescribed: the smallest whole
//! problem, for references and quick checks of one flexure. Mechanisms are solved by `equilibrium`.

use super::{FactorReport, RetractError, Rod, RodForces, RodState, RodSystem};
use crate::math::Pose;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::fmt;

/// Most iterations of one solve.
const MAX_ITERATIONS: usize = 100;
/// Residual force relative to the largest internal force; a decade above what the last Newton step leaves.
const RELATIVE_RESIDUAL: f64 = 1e-9;
/// Smallest force scale, in units of EI/L².
const LEAST_FORCE: f64 = 1e-3;
/// Longest turn of link B in one iteration, rad. Cantilevers of 20 to 1000 edges under α = 3 to 20 take 5 to 8 iterations with 0.5, 5 to 7 with
/// 0.8, 5 to 8 with 1.2 and with 2.
const MAX_TURN: f64 = 0.8;
/// Of fine rods the residual that rounding leaves hides what is left of the way, by a ten-thousandth of a millimetre at 1000 edges. The step before has to be
/// this short then, in lengths of the rod: the next one would be of its square.
const SHORT_STEP: f64 = 1e-4;

/// Weights of Adams and Bashforth for equal steps, by the number of tangents known.
const ADAMS: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [1.5, -0.5, 0.0, 0.0],
    [23.0 / 12.0, -16.0 / 12.0, 5.0 / 12.0, 0.0],
    [55.0 / 24.0, -59.0 / 24.0, 37.0 / 24.0, -9.0 / 24.0],
];

/// Dead loads on link B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndLoad {
    /// Force fixed in space, N.
    pub force: Vector3<f64>,
    /// Point of link B it acts at, rest coordinates, mm.
    pub point: Vector3<f64>,
    /// Moment, N·mm: conservative only while the link turns about this axis.
    pub moment: Vector3<f64>,
}

impl EndLoad {
    /// No load.
    pub const NONE: Self = Self {
        force: Vector3::new(0.0, 0.0, 0.0),
        point: Vector3::new(0.0, 0.0, 0.0),
        moment: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Gradient and Hessian of the load's potential by the increment of `pose`.
    pub fn derivatives(&self, pose: &Pose) -> (SVector<f64, 6>, SMatrix<f64, 6, 6>) {
        let r = pose.arm(&self.point);
        let mut g = SVector::<f64, 6>::zeros();
        g.fixed_rows_mut::<3>(0).copy_from(&-self.force);
        g.fixed_rows_mut::<3>(3).copy_from(&-(r.cross(&self.force) + self.moment));
        let outer = self.force * r.transpose();
        let mut h = SMatrix::<f64, 6, 6>::zeros();
        h.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(Matrix3::identity() * self.force.dot(&r) - (outer + outer.transpose()) * 0.5));
        (g, h)
    }
}

/// Why no equilibrium was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SingleError {
    /// The residual stayed above tolerance.
    NotConverged {
        /// Last residual, N.
        residual: f64,
    },
    /// A step stayed too long however often it was halved.
    Step(RetractError),
    /// The link's stiffness matrix is singular.
    Singular,
}

impl fmt::Display for SingleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotConverged { residual } => write!(f, "no equilibrium: residual {residual:.2e} N"),
            Self::Step(e) => write!(f, "no equilibrium: {e}"),
            Self::Singular => write!(f, "no equilibrium: the free link has a singular stiffness"),
        }
    }
}

impl std::error::Error for SingleError {}

/// One rod between a fixed link A and a link B.
#[derive(Clone, Debug)]
pub struct SingleRod {
    /// The rod.
    pub rod: Rod,
    /// Its present state.
    pub state: RodState,
    /// Pose of link A.
    pub pose_a: Pose,
    /// Pose of link B.
    pub pose_b: Pose,
    /// Workspace; after a solve, assembled and factored at the equilibrium, unshifted. See [`Self::condensed`].
    pub system: RodSystem,
    /// Factor report at the last equilibrium.
    pub report: Option<FactorReport>,
    /// Whether `system` is that of an equilibrium at `state`.
    solved: bool,
    /// Whether it is condensed there, too.
    condensed: bool,
    /// The last movements of link B, the latest first.
    moves: Vec<Move>,
}

/// Rates of a rod at the beginning of a movement of link B.
#[derive(Clone, Debug)]
struct Move {
    by: SVector<f64, 12>,
    inside: Vec<f64>,
    forces: RodForces,
}

impl SingleRod {
    /// At rest; the reference points of the links (about which moments are taken) in rest coordinates.
    pub fn new(rod: Rod, center_a: Vector3<f64>, center_b: Vector3<f64>) -> Self {
        let system = RodSystem::new(&rod);
        let (pose_a, pose_b) = (Pose::rest(center_a), Pose::rest(center_b));
        let (solved, condensed, moves) = (false, false, Vec::new());
        Self { state: rod.rest_state(), rod, pose_a, pose_b, system, report: None, solved, condensed, moves }
    }

    /// What the links exert on the rod (12: forces N, moments N·mm, of A and of B) and their stiffness (12 by 12) at the equilibrium
    /// last solved, with the rod inside in balance: [`RodSystem::condense`], done when first asked for.
    pub fn condensed(&mut self) -> (&SVector<f64, 12>, &SMatrix<f64, 12, 12>) {
        if !std::mem::replace(&mut self.condensed, true) {
            self.system.condense();
        }
        (self.system.condensed_gradient(), self.system.condensed_hessian())
    }

    fn assemble(&mut self) {
        self.system.assemble(&self.rod, &self.state, &self.pose_a, &self.pose_b);
    }

    /// Turns the increment of a rod whose link B is free to move into one that keeps its edges' lengths: each edge is turned as far as the
    /// increment, a tangent, would turn it, and stretched by what it has along the edge, from link A on. Returns where link B then is.
    fn unrolled(&self, increment: &mut [f64], du: &Vector3<f64>, dphi: &Vector3<f64>) -> Pose {
        let last = self.rod.edges() - 1;
        let at = &self.state.vertices;
        let mut b = self.pose_b.retract(du, dphi);
        let end = self.pose_b.arm(&self.rod.rest.vertices[last]);
        let moved = |k: usize, increment: &[f64]| match k {
            0 | 1 => Vector3::zeros(),
            k if k == last => du + dphi.cross(&end),
            k => Vector3::from_column_slice(&increment[4 * k - 7..4 * k - 4]),
        };
        let (mut here, mut before) = (at[1], moved(1, increment));
        for k in 2..=last {
            let e = at[k] - at[k - 1];
            let by = moved(k, increment);
            let (change, length) = (by - before, e.norm());
            let stretch = e.dot(&change) / (length * length);
            // Turned within the plane of the edge and its change.
            let across = change - e * stretch;
            let (sin, cos) = (across.norm() / length).sin_cos();
            let aside = across.norm().max(f64::MIN_POSITIVE);
            here += (e * cos + across * (sin * length / aside)) * (1.0 + stretch);
            before = by;
            if k < last {
                increment[4 * k - 7..4 * k - 4].copy_from_slice((here - at[k]).as_slice());
            }
        }
        b.translation += here - b.point(&self.rod.rest.vertices[last]);
        b
    }

    /// Applies increments of B and the matching internal ones, halved until the rod follows.
    fn advance(&mut self, d: &SVector<f64, 12>, whole: bool, free: bool) -> Result<(), SingleError> {
        let turn = d.fixed_rows::<3>(9).norm();
        let mut scale = if whole { 1.0 } else { (MAX_TURN / turn.max(f64::MIN_POSITIVE)).min(1.0) };
        let internal = self.system.back_substitute(d).to_vec();
        let mut outcome = Ok(());
        for _ in 0..30 {
            let mut scaled: Vec<f64> = internal.iter().map(|x| x * scale).collect();
            let step = if whole { 1.0 } else { scale };
            let (du, dphi) = (d.fixed_rows::<3>(6) * step, d.fixed_rows::<3>(9) * step);
            let b =
                if free { self.unrolled(&mut scaled, &du, &dphi) } else { self.pose_b.retract(&du, &dphi) };
            outcome = self.rod.retract(&mut self.state, &scaled, &self.pose_a, &b);
            if outcome.is_ok() {
                self.system.expect(&self.rod, scale);
                self.pose_b = b;
                return Ok(());
            }
            scale *= 0.5;
        }
        outcome.map_err(SingleError::Step)
    }

    /// Moves link B by an increment, with the rod following as predicted by its tangents here and, of a movement that
    /// goes on, at the states before (Adams and Bashforth), and solves again.
    ///
    /// # Errors
    /// When no equilibrium is reached.
    pub fn move_b(&mut self, du: &Vector3<f64>, dphi: &Vector3<f64>) -> Result<usize, SingleError> {
        if !self.solved {
            self.assemble();
            self.report = Some(self.system.factor_unshifted());
            self.condensed = false;
        }
        self.condensed();
        let mut d = SVector::<f64, 12>::zeros();
        d.fixed_rows_mut::<3>(6).copy_from(du);
        d.fixed_rows_mut::<3>(9).copy_from(dphi);
        if self.moves.first().is_some_and(|last| last.by != d) {
            self.moves.clear();
        }
        let inside = self.system.back_substitute_rate(&d).to_vec();
        let mut forces = self.system.forces().clone();
        self.system.force_change(&self.rod, &inside, &d, &mut forces);
        self.moves.insert(0, Move { by: d, inside, forces });
        self.moves.truncate(ADAMS.len());
        let mut inside = vec![0.0; self.rod.internal_freedoms()];
        let mut forces = self.system.forces().clone();
        for (of, weight) in self.moves.iter().zip(ADAMS[self.moves.len() - 1]) {
            forces.add_scaled(weight, &of.forces);
            inside.iter_mut().zip(&of.inside).for_each(|(to, from)| *to += weight * from);
        }
        let b = self.pose_b.retract(du, dphi);
        self.solved = false;
        if self.rod.retract(&mut self.state, &inside, &self.pose_a, &b).is_ok() {
            self.pose_b = b;
            self.system.expect_forces(&forces);
        } else {
            self.moves.clear();
            self.advance(&d, true, false)?;
        }
        let solved = self.solve(&EndLoad::NONE, [false; 6]);
        if solved.is_err() {
            self.moves.clear();
        }
        solved
    }

    /// Newton's method for the internal freedoms and the `free` ones of link B (du, dφ). Returns the
    /// number of iterations.
    ///
    /// # Errors
    /// When no equilibrium is reached; the state is then the last iterate.
    pub fn solve(&mut self, load: &EndLoad, free: [bool; 6]) -> Result<usize, SingleError> {
        let mut residual = f64::INFINITY;
        // A state that is an equilibrium already takes no step.
        let mut last_step = 0.0;
        (self.solved, self.condensed) = (false, false);
        let length = self.rod.length_mm();
        let unrolls = free[..3] == [true; 3] && self.rod.shear.is_empty();
        let least = LEAST_FORCE * self.rod.least_bending_stiffness() / (length * length);
        for iteration in 0..MAX_ITERATIONS {
            self.assemble();
            let (lg, lh) = load.derivatives(&self.pose_b);
            // What the condensed gradient misses while the rod is out of balance is the residual itself.
            let link = (0..6)
                .filter(|&i| free[i])
                .map(|i| {
                    let g = self.system.link_gradient()[6 + i] + lg[i];
                    if i < 3 { g } else { g / length }
                })
                .fold(0.0f64, |m, x| m.hypot(x));
            residual = self.system.internal_residual_norm().hypot(link);
            let scale = self.system.largest_internal_force().max(least);
            let sure = RELATIVE_RESIDUAL * scale;
            let tolerance = sure + self.system.rounding_floor(&self.rod, &self.state);
            if residual <= sure || residual <= tolerance && last_step <= SHORT_STEP {
                if !self.system.is_exact(tolerance) {
                    self.assemble();
                }
                self.report = Some(self.system.factor_unshifted());
                self.solved = true;
                return Ok(iteration);
            }
            self.system.factor();
            let (g, h) = self.system.condense_end();
            let (mut g6, mut h6) = (g + lg, h + lh);
            for (i, free) in free.into_iter().enumerate() {
                if !free {
                    g6[i] = 0.0;
                    h6.row_mut(i).fill(0.0);
                    h6.column_mut(i).fill(0.0);
                    h6[(i, i)] = 1.0;
                }
            }
            let step = h6.lu().solve(&-g6).ok_or(SingleError::Singular)?;
            let mut d = SVector::<f64, 12>::zeros();
            d.fixed_rows_mut::<6>(6).copy_from(&step);
            last_step = (step.fixed_rows::<3>(0).norm() / length).max(step.fixed_rows::<3>(3).norm());
            self.advance(&d, false, unrolls)?;
        }
        Err(SingleError::NotConverged { residual })
    }
}
