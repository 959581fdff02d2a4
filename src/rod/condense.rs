//! Static condensation of a rod onto the twelve freedoms of its two links, with inertia and shift.
//!
//! With K the internal Hessian, C its coupling to the links and g the gradients, the links see
//! H − Cᵀ K⁻¹ C and g_link − Cᵀ K⁻¹ g_int. Only forward solves are needed: Cᵀ K⁻¹ C = (L⁻¹C)ᵀ D⁻¹ (L⁻¹C),
//! and the coupling to link B touches the last eight rows only.

use super::assemble::{END_COUPLING, FIRST_INTERNAL, RodSystem, end_coordinates};
use crate::math::banded::HALF_BANDWIDTH;
use nalgebra::{SMatrix, SVector};

/// First shift tried, relative to the largest diagonal entry of the vertices.
const FIRST_SHIFT: f64 = 1e-6;
/// Growth of the shift from one try to the next.
const SHIFT_GROWTH: f64 = 8.0;
/// Most shifts tried: 1e-6 · 8¹² exceeds any diagonal by far.
const MAX_SHIFTS: usize = 13;

/// Outcome of a factorisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorReport {
    /// Pivots of the unshifted internal Hessian that are not positive: its number of negative eigenvalues.
    pub negative_pivots: usize,
    /// Shift added to the diagonal (N/mm; times h² for twists), 0 if none.
    pub shift: f64,
    /// Least pivot relative to its diagonal entry, unshifted: near 1e-14 the rod is at a critical point.
    pub smallest_pivot_ratio: f64,
    /// Whether the factors in use are of a positive definite (perhaps shifted) matrix.
    pub positive_definite: bool,
}

impl RodSystem {
    /// Factors the internal Hessian; if it is not positive definite, shifts it until it is. The same
    /// shifted matrix then serves [`Self::condense`] and [`Self::back_substitute`].
    pub fn factor(&mut self) -> FactorReport {
        let mut report = self.factor_band();
        if report.positive_definite {
            return self.factor_shear(report, true);
        }
        let internal = FIRST_INTERNAL..4 * self.n - 4;
        let diagonal = internal.clone().filter(|i| !(i + 1).is_multiple_of(4)).map(|i| self.band[i][0].abs());
        let mut shift = FIRST_SHIFT * diagonal.fold(0.0, f64::max);
        let twist = self.twist_scale * self.twist_scale;
        for _ in 0..MAX_SHIFTS {
            let matrix = &self.band[internal.clone()];
            let scaled = |i: usize| if i.is_multiple_of(4) { shift * twist } else { shift };
            if self.factors.factor(matrix, scaled) == 0 {
                self.factored = Some(shift);
                report.shift = shift;
                report.positive_definite = true;
                return self.factor_shear(report, true);
            }
            shift *= SHIFT_GROWTH;
        }
        self.factor_shear(report, true)
    }

    /// Factors the internal Hessian as it is, for the inertia at an accepted state and for sensitivities.
    pub fn factor_unshifted(&mut self) -> FactorReport {
        let report = self.factor_band();
        self.factor_shear(report, false)
    }

    /// Whether the factors at hand are those of the Hessian last assembled, not shifted.
    pub fn is_factored(&self) -> bool {
        self.factored == Some(0.0)
    }

    fn factor_band(&mut self) -> FactorReport {
        let negative = self.factors.factor(&self.band[FIRST_INTERNAL..4 * self.n - 4], |_| 0.0);
        self.factored = Some(0.0);
        FactorReport {
            negative_pivots: negative,
            shift: 0.0,
            smallest_pivot_ratio: self.factors.smallest_pivot_ratio(),
            positive_definite: negative == 0,
        }
    }

    /// Coupling of the first (end 0) or last (end 1) eight internal coordinates to an end's link.
    pub(crate) fn coupling(&self, end: usize) -> SMatrix<f64, END_COUPLING, 6> {
        self.end_coupling(end) * self.jacobians[end]
    }

    /// The same before the chain rule: by the seven coordinates the end carries.
    pub(crate) fn end_coupling(&self, end: usize) -> SMatrix<f64, END_COUPLING, 7> {
        let index = end_coordinates(end, self.n);
        let first = if end == 0 { FIRST_INTERNAL } else { 4 * self.n - 4 - END_COUPLING };
        SMatrix::from_fn(|i, j| {
            let (row, column) = ((first + i).max(index[j]), (first + i).min(index[j]));
            if row - column <= HALF_BANDWIDTH { self.band[column][row - column] } else { 0.0 }
        })
    }

    /// Condenses the factored system onto the links: gradient (12) and Hessian (12 by 12), ordered du_A,
    /// dφ_A, du_B, dφ_B. Call after [`Self::factor`] or [`Self::factor_unshifted`].
    pub fn condense(&mut self) -> (&SVector<f64, 12>, &SMatrix<f64, 12, 12>) {
        if self.shear.is_none() {
            self.condense_band();
        }
        (&self.condensed_gradient, &self.condensed_hessian)
    }

    /// As [`Self::condense`] while link A is held: gradient (6) and Hessian (6 by 6) by du_B, dφ_B. What the inside
    /// does to link A is not worked out; [`Self::back_substitute`] then serves increments of B alone.
    pub fn condense_end(&mut self) -> (SVector<f64, 6>, SMatrix<f64, 6, 6>) {
        if self.shear.is_some() {
            let (gradient, hessian) = self.condense();
            return (gradient.fixed_rows::<6>(6).into(), hessian.fixed_view::<6, 6>(6, 6).into());
        }
        let n = self.factors.order();
        let b = self.coupling(1);
        self.reduced.fill([0.0; 8]);
        self.forward_gradient();
        self.forward_b(&b);
        let inverse = self.factors.inverse_pivots();
        let first_b = n - END_COUPLING;
        let mut gradient: SVector<f64, 6> = self.link_gradient.fixed_rows::<6>(6).into();
        let mut by_inside = SVector::<f64, 6>::zeros();
        let mut bb = SMatrix::<f64, 6, 6>::zeros();
        for (i, yb) in self.reduced_b.iter().enumerate() {
            let d = inverse[first_b + i];
            let own = self.reduced[first_b + i][6];
            for r in 0..6 {
                let s = yb[r] * d;
                by_inside[r] += s * own;
                for c in 0..6 {
                    bb[(r, c)] += s * yb[c];
                }
            }
        }
        gradient -= by_inside;
        let mut hessian: SMatrix<f64, 6, 6> = self.link_hessian.fixed_view::<6, 6>(6, 6).into();
        hessian -= (bb + bb.transpose()) * 0.5;
        (gradient, (hessian + hessian.transpose()) * 0.5)
    }

    /// Condenses the gradient of the state assembled last with the factors of the one before it: all that a step with the
    /// former Hessian needs. [`Self::back_substitute`] then serves that step. Call after [`Self::condense`] or
    /// [`Self::condense_end`] and one more assembly.
    pub fn condense_gradient(&mut self) -> &SVector<f64, 12> {
        self.forward_gradient();
        let first_b = self.factors.order() - END_COUPLING;
        let inverse = self.factors.inverse_pivots();
        self.condensed_gradient = self.link_gradient;
        for (y, d) in self.reduced.iter().zip(inverse) {
            let s = y[6] * d;
            for (to, y) in self.condensed_gradient.iter_mut().zip(&y[..6]) {
                *to -= s * y;
            }
        }
        let last = self.reduced[first_b..].iter().zip(&inverse[first_b..]);
        for ((y, d), yb) in last.zip(&self.reduced_b) {
            let s = y[6] * d;
            for (to, y) in self.condensed_gradient.iter_mut().skip(6).zip(yb) {
                *to -= s * y;
            }
        }
        self.condense_shear_gradient();
        &self.condensed_gradient
    }

    /// L⁻¹ of the internal gradient.
    fn forward_gradient(&mut self) {
        let n = self.factors.order();
        let mut residual = std::mem::take(&mut self.reduced_gradient);
        residual.resize(n + HALF_BANDWIDTH, [0.0; 1]);
        for (to, from) in residual.iter_mut().zip(&self.gradient[FIRST_INTERNAL..4 * self.n - 4]) {
            to[0] = *from;
        }
        residual[n..].fill([0.0; 1]);
        self.factors.forward(&mut residual, 0);
        for (row, [g]) in self.reduced.iter_mut().zip(&residual) {
            row[6] = *g;
        }
        self.reduced_gradient = residual;
    }

    /// Condenses what is in the band; with shear, [`Self::factor_shear`] goes on from there.
    pub(crate) fn condense_band(&mut self) {
        let n = self.factors.order();
        let (a, b) = (self.coupling(0), self.coupling(1));
        self.reduced.fill([0.0; 8]);
        for (row, g) in self.reduced.iter_mut().zip(&self.gradient[FIRST_INTERNAL..4 * self.n - 4]) {
            row[6] = *g;
        }
        for (i, row) in self.reduced.iter_mut().enumerate().take(END_COUPLING) {
            for (c, value) in row.iter_mut().enumerate().take(6) {
                *value = a[(i, c)];
            }
        }
        self.factors.forward(&mut self.reduced, 0);
        let first_b = n - END_COUPLING;
        self.forward_b(&b);

        let inverse = self.factors.inverse_pivots();
        let mut aa = SMatrix::<f64, 7, 7>::zeros();
        for (y, d) in self.reduced.iter().zip(inverse) {
            for c in 0..7 {
                let s = y[c] * d;
                for r in c..7 {
                    aa[(r, c)] += s * y[r];
                }
            }
        }
        let mut ba = SMatrix::<f64, 6, 7>::zeros();
        let mut bb = SMatrix::<f64, 6, 6>::zeros();
        for (i, yb) in self.reduced_b.iter().enumerate() {
            let d = inverse[first_b + i];
            let ya = &self.reduced[first_b + i];
            for r in 0..6 {
                let s = yb[r] * d;
                for c in 0..7 {
                    ba[(r, c)] += s * ya[c];
                }
                for c in 0..6 {
                    bb[(r, c)] += s * yb[c];
                }
            }
        }
        self.condensed_gradient = self.link_gradient;
        self.condensed_hessian = self.link_hessian;
        for i in 0..6 {
            self.condensed_gradient[i] -= aa[(6, i)];
            self.condensed_gradient[6 + i] -= ba[(i, 6)];
            for j in 0..6 {
                self.condensed_hessian[(i, j)] -= aa[(i.max(j), i.min(j))];
                self.condensed_hessian[(6 + i, 6 + j)] -= 0.5 * (bb[(i, j)] + bb[(j, i)]);
                self.condensed_hessian[(6 + i, j)] = -ba[(i, j)];
                self.condensed_hessian[(j, 6 + i)] = -ba[(i, j)];
            }
        }
        // Symmetric to the last bit: the end blocks were products of three matrices.
        for i in 0..12 {
            for j in 0..i {
                let mean = 0.5 * (self.condensed_hessian[(i, j)] + self.condensed_hessian[(j, i)]);
                self.condensed_hessian[(i, j)] = mean;
                self.condensed_hessian[(j, i)] = mean;
            }
        }
    }

    /// Gradient of the last [`Self::condense`].
    pub fn condensed_gradient(&self) -> &SVector<f64, 12> {
        &self.condensed_gradient
    }

    /// Hessian of the last [`Self::condense`].
    pub fn condensed_hessian(&self) -> &SMatrix<f64, 12, 12> {
        &self.condensed_hessian
    }

    /// L⁻¹ of the coupling to link B: its forward solve begins eight rows before the end.
    fn forward_b(&mut self, b: &SMatrix<f64, END_COUPLING, 6>) {
        let n = self.factors.order();
        let mut tail = [[0.0; 6]; END_COUPLING];
        for (i, row) in tail.iter_mut().enumerate() {
            *row = std::array::from_fn(|c| b[(i, c)]);
        }
        self.factors.forward_tail(&mut tail, n - END_COUPLING);
        self.reduced_b = tail;
    }

    /// Internal increment −K⁻¹(g_int + C d) of the links' increment `d`, ordered θ₁, x₂, θ₂, …, with shear then
    /// slip and force; for
    /// [`Rod::retract`](super::Rod::retract). Call after [`Self::condense`].
    pub fn back_substitute(&mut self, d_link: &SVector<f64, 12>) -> &[f64] {
        self.substitute(d_link, 1.0)
    }

    /// The same without what balances the rod: −K⁻¹C d, its rate when the links move at the rate `d`.
    pub fn back_substitute_rate(&mut self, d_link: &SVector<f64, 12>) -> &[f64] {
        self.substitute(d_link, 0.0)
    }

    /// −K⁻¹(`share` g_int + C d).
    fn substitute(&mut self, d_link: &SVector<f64, 12>, share: f64) -> &[f64] {
        let n = self.factors.order();
        let mut chain = *d_link;
        let extra = self.shear_increment(&mut chain, share);
        self.last_link = *d_link;
        let d_link = &chain;
        for (x, y) in self.solution.iter_mut().zip(&self.reduced) {
            let mut sum = share * y[6];
            for c in 0..6 {
                sum += y[c] * d_link[c];
            }
            x[0] = -sum;
        }
        for (x, y) in self.solution[n - END_COUPLING..n].iter_mut().zip(&self.reduced_b) {
            for c in 0..6 {
                x[0] -= y[c] * d_link[6 + c];
            }
        }
        if let (Some(shear), Some(extra)) = (&self.shear, &extra) {
            for (x, y) in self.solution.iter_mut().zip(&shear.reduced) {
                x[0] -= y[0] * extra[3] + y[1] * extra[4] + y[2] * extra[5];
            }
        }
        self.factors.backward(&mut self.solution);
        for (to, from) in self.increment.iter_mut().zip(&self.solution) {
            *to = from[0];
        }
        if let Some(extra) = extra {
            self.increment.truncate(n);
            self.increment.extend_from_slice(extra.as_slice());
        }
        &self.increment
    }
}
