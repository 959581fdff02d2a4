//! Continuation of the conventional mechanism along its drives: second-order predictor, Gauss–Newton corrector,
//! steps as short as it takes to stay on the branch, dead points and change points noticed and not jumped.
//!
//! A change point (two assembly branches crossing) is found by orientation: with J = U Σ Vᵀ continued smoothly,
//! det(J₀ᵀJ₁) changes sign when a singular value passes through zero between two poses, redundant rows or not.

use super::linear::{Factor, Rows, moved};
use super::mechanism::Mechanism;
use crate::math::{Pose, exp_so3, log_so3};
use nalgebra::{DVector, Vector3};

/// Scaled residual of a closed mechanism (times L in mm). Reached: 1e-15 to 1e-13 on all test mechanisms.
const CLOSED: f64 = 1e-13;
/// Residual accepted where rounding stops the iteration: a mechanism drawn far from the origin.
const CLOSED_BY_ROUNDING: f64 = 1e-11;
/// Corrector iterations; two to four are usual, thirty only exactly at a dead point.
const MAX_ITERATIONS: usize = 30;
/// Longest step of the drives, rad (of sliding ones, in lengths L, as all below).
const MAX_STEP_RAD: f64 = 0.2;
/// Shortest step of the drives, rad: 6e-5°. Shorter ones mean the mechanism cannot go on.
const MIN_STEP_RAD: f64 = 1e-6;
/// A step is halved when the corrector moves more than this part of the predicted way …
const MAX_CORRECTION: f64 = 0.1;
/// … or the direction of motion turns more than this.
const MAX_TURN: f64 = 0.5;
/// Least pivot (square of the least singular value, about) of a pose that counts as a dead point. Measured: 2e-3 to
/// 4e-2 over the cycles of the test mechanisms, 3e-9 at 1e-4 rad beside the change point of a parallelogram.
pub(super) const DEAD_POINT: f64 = 1e-9;
/// A change point is reported once it is known to this, rad: 0.05°.
const CHANGE_POINT_RAD: f64 = 1e-3;
/// Attempts on the way to one target. Usual are one to five, near the end of a range a hundred.
const MAX_ATTEMPTS: usize = 5000;
/// Half the distance over which a state exactly at a change point is interpolated, rad: fourth order, 1e-12.
const BRIDGE_RAD: f64 = 1e-3;

/// A closed pose and the linearisation there.
pub(super) struct Corrected {
    pub poses: Vec<Pose>,
    pub rows: Rows,
    pub factor: Factor,
    /// Length of the scaled way from the start.
    travel: f64,
}

/// Closes the mechanism near `start` with the drives at `drive`; none if that does not converge.
pub(super) fn correct(mechanism: &Mechanism, start: &[Pose], drive: &[f64]) -> Option<Corrected> {
    let mut poses = start.to_vec();
    let mut rows = Rows::at(mechanism, &poses, drive);
    let mut size = rows.size();
    let mut travel = 0.0;
    let mut factor = rows.factor()?;
    for iteration in 0..MAX_ITERATIONS {
        if !size.is_finite() {
            return None;
        }
        if size <= CLOSED {
            return Some(Corrected { poses, rows, factor, travel });
        }
        if iteration > 0 {
            factor = rows.factor()?;
        }
        let step = factor.solve(rows.descent());
        if step.amax() > 1.0 {
            return None;
        }
        travel += step.norm();
        poses = moved(mechanism, &poses, &step);
        rows = Rows::at(mechanism, &poses, drive);
        let previous = std::mem::replace(&mut size, rows.size());
        if size > 0.25 * previous && size <= CLOSED_BY_ROUNDING && previous <= CLOSED_BY_ROUNDING {
            return Some(Corrected { poses, rows, factor, travel });
        }
    }
    None
}

/// One pose on the branch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sample {
    pub drive: Vec<f64>,
    pub poses: Vec<Pose>,
    pub values: Vec<f64>,
}

/// The mechanism cannot follow its drives further.
#[derive(Clone, Debug)]
pub(super) struct Stuck {
    /// Drive values that were reached.
    pub drive: Vec<f64>,
    /// Rate of turn in every joint by the driven motion there: large in the loop that breaks.
    pub rates: Vec<f64>,
}

/// The mechanism on its branch, followed from the drawing.
pub(super) struct Branch<'m, 'd> {
    mechanism: &'m Mechanism<'d>,
    /// What counts as one of each drive.
    scales: Vec<f64>,
    here: Sample,
    rows: Rows,
    factor: Factor,
    /// Direction of the drives, tangent by it, and length of the step before: for the second-order predictor.
    before: Option<(Vec<f64>, DVector<f64>, f64)>,
    step: f64,
    /// Inside [`Branch::bridge`], which must not call itself.
    bridging: bool,
    /// Drive values at which two branches crossed and the smooth one was kept.
    pub change_points: Vec<Vec<f64>>,
}

impl<'m, 'd> Branch<'m, 'd> {
    /// Starts at the drawing; none if that is a dead point, where the branch is not determined.
    pub fn from_drawing(mechanism: &'m Mechanism<'d>) -> Option<Self> {
        let drive = vec![0.0; mechanism.design.drives.len()];
        let at = correct(mechanism, &mechanism.drawing, &drive)?;
        if at.factor.least_pivot < DEAD_POINT {
            return None;
        }
        let values = vec![0.0; mechanism.value_count()];
        Some(Self {
            mechanism,
            scales: mechanism.drives.iter().map(|d| mechanism.drive_scale(d)).collect(),
            here: Sample { drive, poses: at.poses, values },
            rows: at.rows,
            factor: at.factor,
            before: None,
            step: MAX_STEP_RAD,
            bridging: false,
            change_points: Vec::new(),
        })
    }

    /// Follows the drives on a straight line to `target` (rad or mm) and gives the pose there.
    pub fn advance(&mut self, target: &[f64]) -> Result<Sample, Stuck> {
        for _ in 0..MAX_ATTEMPTS {
            let way = target.iter().zip(&self.here.drive).map(|(t, d)| t - d);
            let delta: Vec<f64> = way.zip(&self.scales).map(|(w, scale)| w / scale).collect();
            let length = delta.iter().fold(0.0, |m, d| f64::max(m, d.abs()));
            if length == 0.0 {
                return Ok(self.here.clone());
            }
            let rate: Vec<f64> = delta.iter().map(|d| d / length).collect();
            let whole = self.step >= length * (1.0 - 1e-9);
            let mut h = self.step.min(length);
            let mut drive = target.to_vec();
            if !whole {
                let steps = rate.iter().zip(&self.scales).map(|(r, scale)| r * h * scale);
                drive = self.here.drive.iter().zip(steps).map(|(d, step)| d + step).collect();
            }
            match self.attempt(&rate, h, drive) {
                Attempt::Accepted => {
                    // A short last step says nothing about what the next may be.
                    self.step = if whole { self.step.max(1.7 * h) } else { 1.7 * h }.min(MAX_STEP_RAD);
                    continue;
                }
                Attempt::DeadPoint(at) if whole && length > 2.5 * BRIDGE_RAD && !self.bridging => {
                    self.bridging = true;
                    let passed = self.bridge(&rate, target, &at);
                    self.bridging = false;
                    return passed;
                }
                Attempt::DeadPoint(_) | Attempt::Refused => {}
            }
            // Not a half: a point met exactly would be met again.
            h *= 0.45;
            self.step = h;
            if h < MIN_STEP_RAD {
                return Err(self.stuck(&rate));
            }
        }
        let rate = vec![1.0; target.len()];
        Err(self.stuck(&rate))
    }

    fn attempt(&mut self, rate: &[f64], h: f64, drive: Vec<f64>) -> Attempt {
        let tangent = self.factor.solve(self.rows.drive_direction(rate));
        let mut way = &tangent * h;
        if let Some((old_rate, old, old_h)) = &self.before
            && old_rate.iter().zip(rate).all(|(a, b)| (a - b).abs() < 1e-6)
        {
            way += (&tangent - old) * (0.5 * h * h / old_h);
        }
        if way.amax() > 1.0 {
            return Attempt::Refused;
        }
        let start = moved(self.mechanism, &self.here.poses, &way);
        let Some(at) = correct(self.mechanism, &start, &drive) else { return Attempt::Refused };
        if at.travel > MAX_CORRECTION * way.norm() {
            return Attempt::Refused;
        }
        let values = self.mechanism.joint_values(&at.poses, &self.here.values);
        let sample = Sample { drive, poses: at.poses, values };
        if at.factor.least_pivot < DEAD_POINT {
            return Attempt::DeadPoint(sample);
        }
        let turned = at.factor.solve(at.rows.drive_direction(rate));
        if (&turned - &tangent).norm() > MAX_TURN * turned.norm().max(tangent.norm()) {
            return Attempt::Refused;
        }
        if self.rows.is_reversed(&at.rows) {
            if h > CHANGE_POINT_RAD {
                return Attempt::Refused;
            }
            self.change_points.push(sample.drive.clone());
        }
        self.before = Some((rate.to_vec(), tangent, h));
        self.here = sample;
        self.rows = at.rows;
        self.factor = at.factor;
        Attempt::Accepted
    }

    /// The pose at a target that is itself a dead point: between four poses around it if the mechanism passes it,
    /// else the pose as the corrector found it.
    fn bridge(&mut self, rate: &[f64], target: &[f64], found: &Sample) -> Result<Sample, Stuck> {
        let aside = rate.iter().zip(&self.scales).map(|(r, scale)| r * BRIDGE_RAD * scale);
        let aside: Vec<f64> = aside.collect();
        let at = |k: f64| -> Vec<f64> { target.iter().zip(&aside).map(|(t, a)| t + k * a).collect() };
        let mut around = Vec::new();
        for k in [-2.0, -1.0, 1.0, 2.0] {
            match self.advance(&at(k)) {
                Ok(sample) => around.push(sample),
                Err(stuck) if k < 0.0 => return Err(stuck),
                Err(_) => return Ok(found.clone()),
            }
        }
        Ok(Sample { drive: target.to_vec(), ..middle(&around) })
    }

    fn stuck(&self, rate: &[f64]) -> Stuck {
        let mechanism = self.mechanism;
        let tangent = self.factor.solve(self.rows.drive_direction(rate));
        let turn = |body: usize| match mechanism.column[body] {
            Some(j) => Vector3::new(tangent[j + 3], tangent[j + 4], tangent[j + 5]),
            None => Vector3::zeros(),
        };
        let rate =
            |j: &crate::ir::Joint| j.pairs().map(|[a, b]| (turn(b) - turn(a)).norm()).fold(0.0, f64::max);
        let rates = mechanism.design.joints.iter().map(rate).collect();
        Stuck { drive: self.here.drive.clone(), rates }
    }
}

enum Attempt {
    Accepted,
    Refused,
    /// Closed, but at a pose where the drives do not determine the motion.
    DeadPoint(Sample),
}

/// Value in the middle of samples at −2, −1, 1, 2, by the cubic through them.
fn middle(around: &[Sample]) -> Sample {
    const WEIGHTS: [f64; 4] = [-1.0 / 6.0, 4.0 / 6.0, 4.0 / 6.0, -1.0 / 6.0];
    let Some(first) = around.first() else {
        return Sample { drive: Vec::new(), poses: Vec::new(), values: Vec::new() };
    };
    let mut out = first.clone();
    for (i, pose) in out.poses.iter_mut().enumerate() {
        let base = first.poses[i].rotation;
        let mut turn = Vector3::zeros();
        pose.translation = Vector3::zeros();
        for (sample, w) in around.iter().zip(WEIGHTS) {
            pose.translation += sample.poses[i].translation * w;
            turn += log_so3(&(sample.poses[i].rotation * base.transpose())) * w;
        }
        pose.rotation = exp_so3(&turn) * base;
    }
    for (i, value) in out.values.iter_mut().enumerate() {
        *value = around.iter().zip(WEIGHTS).map(|(sample, w)| sample.values[i] * w).sum();
    }
    out
}
