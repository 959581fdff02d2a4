//! Linearised constraints of a mechanism: scaled sparse rows, their normal equations (of many bodies front by front), and rank by
//! singular values.
//!
//! Rows are constraint residuals (lengths divided by L) and, last, drive rows φ − α (ways divided by L). Gauges of idle
//! freedoms stand apart: they make the normal matrix regular and are counted nowhere. Redundant rows (every planar
//! loop in space has some) are no obstacle: the normal matrix JᵀJ has full rank whenever the motion is determined.
//! Squaring the condition only costs Newton's method accuracy per step, not accuracy of the result.

use super::constraint::{Constraint, Jacobian};
use super::mechanism::Mechanism;
use crate::math::Pose;
use crate::math::elimination::{Elimination, NODE};
use crate::math::fronts::{Blocks, Factors};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use std::sync::Arc;

/// Singular values below this part of the largest are zeros. Measured on the test mechanisms (largest value 2 to
/// 3): zeros stay below 1e-15, the least true one is 0.06 to 0.5 away from dead points.
pub const RANK_TOLERANCE: f64 = 1e-9;

/// Levenberg shift of the normal matrix relative to its largest diagonal: above rounding (1e-14 for 100
/// unknowns), below the square of any singular value that matters.
const SHIFT: f64 = 1e-13;

/// Of large mechanisms, singular values below this part of the largest are looked at one by one: far above the zeros, and
/// so few that they are quickly found. Its square must be above rounding.
const SMALL: f64 = 1e-4;
/// Steps of inverse iteration: each leaves 1e-5 (shift over the square of [`SMALL`]) of what is no null motion.
const INVERSE_STEPS: usize = 4;
/// Steps of the power method; the largest singular value is only a scale.
const POWER_STEPS: usize = 12;

/// One row: twelve entries, six for each of up to two moving bodies.
#[derive(Clone, Copy, Debug)]
struct Row {
    column: [Option<usize>; 2],
    entries: [[f64; 6]; 2],
}

/// Linearised rows and residuals at one pose.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    rows: Vec<Row>,
    gauges: Vec<Row>,
    /// Scaled residuals: constraints, then drives.
    pub residual: Vec<f64>,
    drives: usize,
    unknowns: usize,
    order: Arc<Elimination>,
}

impl Rows {
    /// Linearises at `poses` with the drives held at `drive` (rad or mm).
    pub fn at(mechanism: &Mechanism, poses: &[Pose], drive: &[f64]) -> Self {
        let scale = mechanism.length;
        let mut rows = Vec::with_capacity(5 * mechanism.constraints.len() / 2 + drive.len());
        let mut residual = Vec::with_capacity(rows.capacity());
        let mut jacobian = Jacobian::default();
        let mut values = [0.0; Constraint::MAX_ROWS];
        for (constraint, _) in &mechanism.constraints {
            constraint.residual(poses, &mut values);
            constraint.jacobian(poses, &mut jacobian);
            let unit = if constraint.is_length() { scale } else { 1.0 };
            let column = constraint.bodies().map(|b| mechanism.column[b]);
            for (r, value) in values.iter().enumerate().take(constraint.rows()) {
                let entry = |block: &super::constraint::Block| {
                    std::array::from_fn(|k| block[(r, k)] * if k < 3 { scale / unit } else { 1.0 / unit })
                };
                rows.push(Row { column, entries: [entry(&jacobian.a), entry(&jacobian.b)] });
                residual.push(value / unit);
            }
        }
        for (driven, value) in mechanism.drives.iter().zip(drive) {
            let unit = mechanism.drive_scale(driven);
            let g = driven.gradient(poses);
            let entry =
                |first: usize| std::array::from_fn(|k| g[first + k] * if k < 3 { scale } else { 1.0 } / unit);
            let column = driven.bodies().map(|b| mechanism.column[b]);
            rows.push(Row { column, entries: [entry(0), entry(6)] });
            residual.push((driven.value(poses, *value) - value) / unit);
        }
        let mut gauges = Vec::with_capacity(mechanism.idle.len());
        for idle in &mechanism.idle {
            let turn = poses[idle.body].direction(&idle.axis);
            let entry = std::array::from_fn(|k| if k < 3 { 0.0 } else { turn[k - 3] });
            gauges.push(Row { column: [mechanism.column[idle.body], None], entries: [entry, [0.0; 6]] });
        }
        let order = Arc::clone(&mechanism.order);
        Self { rows, gauges, residual, drives: drive.len(), unknowns: mechanism.unknowns(), order }
    }

    /// Largest residual.
    pub fn size(&self) -> f64 {
        self.residual.iter().fold(0.0, |m, r| if r.is_nan() { f64::NAN } else { f64::max(m, r.abs()) })
    }

    /// −Jᵀ r
    pub fn descent(&self) -> DVector<f64> {
        let mut out = DVector::zeros(self.unknowns);
        for (row, r) in self.rows.iter().zip(&self.residual) {
            row.add_to(&mut out, -r);
        }
        out
    }

    /// Jᵀ e: e is `rate` on the drive rows, zero elsewhere.
    pub fn drive_direction(&self, rate: &[f64]) -> DVector<f64> {
        let mut out = DVector::zeros(self.unknowns);
        let first = self.rows.len() - self.drives;
        for (row, r) in self.rows[first..].iter().zip(rate) {
            row.add_to(&mut out, *r);
        }
        out
    }

    /// JᵀK for the rows K of another pose.
    fn product(&self, other: &Self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.unknowns, self.unknowns);
        self.for_each_block(self.rows.len(), other, |i, left, j, right| {
            for (c, right) in right.iter().enumerate() {
                for (r, left) in left.iter().enumerate() {
                    out[(i + r, j + c)] += left * right;
                }
            }
        });
        out
    }

    /// The same front by front, of the first `count` rows and all gauges.
    fn blocks(&self, count: usize, other: &Self) -> Blocks {
        let mut out = Blocks::new(&self.order);
        self.for_each_block(count, other, |i, left, j, right| {
            out.add(&self.order, i, j, |r, c| left[r] * right[c]);
        });
        out
    }

    fn for_each_block(
        &self,
        count: usize,
        other: &Self,
        mut f: impl FnMut(usize, &[f64; 6], usize, &[f64; 6]),
    ) {
        let rows = self.rows.iter().take(count).chain(&self.gauges);
        for (row, col) in rows.zip(other.rows.iter().take(count).chain(&other.gauges)) {
            for (i, left) in row.blocks() {
                for (j, right) in col.blocks() {
                    f(i, left, j, right);
                }
            }
        }
    }

    /// Whether det(JᵀK) < 0 for the rows K of another pose.
    pub fn is_reversed(&self, other: &Self) -> bool {
        if self.order.is_dense() {
            return self.product(other).lu().determinant() < 0.0;
        }
        self.blocks(self.rows.len(), other).determinant_sign(&self.order) < 0.0
    }

    /// The motion that keeps all rows and gauges when the residuals move by `by`: J x = −by, which must have a solution.
    pub fn follow(&self, factor: &Factor, by: &[f64]) -> DVector<f64> {
        let mut x = DVector::zeros(self.unknowns);
        // Repeated, so that neither the shift nor the squared condition is left.
        for _ in 0..3 {
            let mut right = DVector::zeros(self.unknowns);
            let wanted = by.iter().copied().chain(std::iter::repeat(0.0));
            for (row, b) in self.rows.iter().chain(&self.gauges).zip(wanted) {
                row.add_to(&mut right, -(b + row.times(&x)));
            }
            x += factor.solve(right);
        }
        x
    }

    /// The idle motion that moves gauge number `gauge` by one and no other.
    pub fn idle_motion(&self, factor: &Factor, gauge: usize) -> DVector<f64> {
        let mut right = DVector::zeros(self.unknowns);
        if let Some(row) = self.gauges.get(gauge) {
            row.add_to(&mut right, 1.0);
        }
        factor.solve(right)
    }

    /// Factor of the (slightly shifted) normal matrix; none if an entry is not finite.
    pub fn factor(&self) -> Option<Factor> {
        if !self.order.is_dense() {
            return self.factor_blocks(self.rows.len());
        }
        let mut normal = self.product(self);
        let largest = normal.diagonal().max();
        for i in 0..self.unknowns {
            normal[(i, i)] += SHIFT * largest;
        }
        let cholesky = Cholesky::new(normal)?;
        let pivot = |l: f64| l * l / largest;
        let least =
            (0..self.unknowns).map(|i| pivot(cholesky.l_dirty()[(i, i)])).fold(f64::INFINITY, f64::min);
        Some(Factor { kind: FactorKind::Dense(cholesky), least_pivot: least })
    }

    /// The same front by front, of the first `count` rows.
    fn factor_blocks(&self, count: usize) -> Option<Factor> {
        let mut normal = self.blocks(count, self);
        let diagonal = |i| normal.diagonal(&self.order, i);
        let largest = (0..self.unknowns).map(diagonal).fold(f64::MIN_POSITIVE, f64::max);
        for i in 0..self.unknowns {
            let shifted = normal.diagonal(&self.order, i) + SHIFT * largest;
            normal.set_diagonal(&self.order, i, shifted);
        }
        let factors = normal.factor(&self.order);
        let least_pivot = factors.least_pivot() / largest;
        let definite = factors.inertia().positive == self.unknowns;
        definite.then_some(Factor { kind: FactorKind::Fronts(factors), least_pivot })
    }

    /// Products of all rows with scaled motions.
    pub fn times(&self, motions: &[DVector<f64>]) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows.len(), motions.len(), |i, j| {
            let blocks = self.rows[i].blocks();
            blocks.map(|(first, b)| (0..6).map(|k| b[k] * motions[j][first + k]).sum::<f64>()).sum()
        })
    }

    /// Rank and null space of all rows, or without the drives' rows. Idle freedoms count as held.
    pub fn rank(&self, with_drives: bool) -> Rank {
        let count = self.rows.len() - if with_drives { 0 } else { self.drives };
        if let (false, Some(rank)) = (self.order.is_dense(), self.rank_of_many(count)) {
            return rank;
        }
        // Zero rows make the matrix tall, so that the decomposition has all right singular vectors.
        let all = count + self.gauges.len();
        let mut dense = DMatrix::zeros(all.max(self.unknowns), self.unknowns);
        for (i, row) in self.rows.iter().take(count).chain(&self.gauges).enumerate() {
            for (j, block) in row.blocks() {
                for (k, x) in block.iter().enumerate() {
                    dense[(i, j + k)] += x;
                }
            }
        }
        let svd = dense.svd(false, true);
        let bound = RANK_TOLERANCE * svd.singular_values.iter().fold(0.0, |m, s| f64::max(m, *s));
        let zero: Vec<usize> = (0..self.unknowns).filter(|i| svd.singular_values[*i] <= bound).collect();
        let null = match &svd.v_t {
            Some(v_t) => zero.iter().map(|i| v_t.row(*i).transpose()).collect(),
            None => Vec::new(),
        };
        Rank { rows: count, rank: self.unknowns - zero.len() - self.gauges.len(), null }
    }

    /// Rank of the first `count` rows with the gauges, without a dense decomposition: how many singular values are small
    /// is told by the inertia of JᵀJ − σ², which they are by inverse iteration and the singular values of J on what that finds.
    /// None if an entry is not finite.
    fn rank_of_many(&self, count: usize) -> Option<Rank> {
        let rows: Vec<&Row> = self.rows.iter().take(count).chain(&self.gauges).collect();
        let times = |x: &DVector<f64>| DVector::from_iterator(rows.len(), rows.iter().map(|r| r.times(x)));
        // No start may lie in a plane of symmetry.
        let start = |k: usize, i: usize| (1.0 + (i * (k + 1)) as f64 * 0.754_877_666).sin();
        let mut x = DVector::from_fn(self.unknowns, |i, _| start(0, i));
        let mut largest = 0.0;
        for _ in 0..POWER_STEPS {
            x /= x.norm();
            let product = times(&x);
            largest = product.norm();
            x.fill(0.0);
            rows.iter().zip(product.iter()).for_each(|(row, p)| row.add_to(&mut x, *p));
        }
        let mut normal = self.blocks(count, self);
        for i in 0..self.unknowns {
            let shifted = normal.diagonal(&self.order, i) - (SMALL * largest).powi(2);
            normal.set_diagonal(&self.order, i, shifted);
        }
        let small = normal.factor(&self.order).inertia().negative;
        let factor = self.factor_blocks(count)?;
        let mut basis = DMatrix::from_fn(self.unknowns, small, |i, k| start(k + 1, i));
        for _ in 0..INVERSE_STEPS {
            basis.column_iter_mut().for_each(|mut c| {
                let solved = factor.solve(c.clone_owned());
                c.copy_from(&solved);
            });
            basis = basis.qr().q();
        }
        let bound = RANK_TOLERANCE * largest;
        let mut null = Vec::new();
        if small > 0 {
            let columns: Vec<_> = basis.column_iter().map(|c| times(&c.clone_owned())).collect();
            let mut image = DMatrix::from_columns(&columns);
            if image.nrows() < small {
                image = image.insert_rows(rows.len(), small - rows.len(), 0.0);
            }
            let svd = image.svd(false, true);
            let v_t = svd.v_t?;
            let zero = (0..small).filter(|i| svd.singular_values[*i] <= bound);
            null.extend(zero.map(|i| &basis * v_t.row(i).transpose()));
        }
        Some(Rank { rows: count, rank: self.unknowns - null.len() - self.gauges.len(), null })
    }
}

impl Row {
    fn blocks(&self) -> impl Iterator<Item = (usize, &[f64; 6])> {
        self.column.iter().zip(&self.entries).filter_map(|(column, entries)| Some(((*column)?, entries)))
    }

    fn times(&self, x: &DVector<f64>) -> f64 {
        self.blocks().map(|(j, block)| block.iter().enumerate().map(|(k, e)| e * x[j + k]).sum::<f64>()).sum()
    }

    fn add_to(&self, out: &mut DVector<f64>, factor: f64) {
        for (j, block) in self.blocks() {
            for (k, x) in block.iter().enumerate() {
                out[j + k] += factor * x;
            }
        }
    }
}

/// Factor of the normal matrix.
pub(super) struct Factor {
    kind: FactorKind,
    /// Least pivot relative to the largest diagonal: about the square of the least singular value.
    pub least_pivot: f64,
}

enum FactorKind {
    Dense(Cholesky<f64, Dyn>),
    Fronts(Factors),
}

impl Factor {
    /// Solves in place.
    pub fn solve(&self, mut right: DVector<f64>) -> DVector<f64> {
        match &self.kind {
            FactorKind::Dense(cholesky) => cholesky.solve_mut(&mut right),
            FactorKind::Fronts(factors) => factors.solve_column(right.as_mut_slice()),
        }
        right
    }
}

/// Rank of a set of rows.
pub(super) struct Rank {
    /// Number of rows.
    pub rows: usize,
    /// Number of independent rows.
    pub rank: usize,
    /// Orthonormal basis of the scaled motions that violate no row to first order.
    pub null: Vec<DVector<f64>>,
}

/// In which order the bodies are eliminated.
pub(super) fn elimination(mechanism: &Mechanism) -> Elimination {
    let moving = |bodies: [usize; 2]| bodies.map(|b| mechanism.column[b].map(|first| first / NODE));
    let constraints = mechanism.constraints.iter().map(|(c, _)| moving(c.bodies()));
    let pairs: Vec<_> = constraints.chain(mechanism.drives.iter().map(|d| moving(d.bodies()))).collect();
    Elimination::new(mechanism.moving_bodies(), &pairs, &[])
}

/// Moves all bodies by scaled increments.
pub(super) fn moved(mechanism: &Mechanism, poses: &[Pose], step: &DVector<f64>) -> Vec<Pose> {
    let at = |j: usize| Vector3::new(step[j], step[j + 1], step[j + 2]);
    poses
        .iter()
        .zip(&mechanism.column)
        .map(|(pose, column)| match column {
            Some(j) => pose.retract(&(at(*j) * mechanism.length), &at(j + 3)),
            None => *pose,
        })
        .collect()
}
