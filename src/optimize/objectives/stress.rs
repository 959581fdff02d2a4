//! von Mises stress (Megaro et al. 2017, section 4.5, eqs. 8–15) in two forms.
//!
//! [`StressBelow`], a one-sided bound: ½ Σ_t Σ_rods ∫ max(0, σ_v − bound)² over length and section boundary, each
//! rod's weights of sum one. Smooth where the paper's maximum is not, and zero for every sound design.
//! [`StressPeak`], in place of eq. 16: the soft maximum of σ_v over the same points, all rods and states.

use super::{Level, Objective, STEPS_OF_WEIGHTS, Sampled, StateView, StatesSensitivity};
use crate::optimize::Normal;
use crate::rod::{PARAMETERS, SECTION_POINTS, StrainJacobian};
use nalgebra::{DMatrix, DVector, SVector};

/// See the module.
pub struct StressBelow {
    name: String,
    bound_mpa: f64,
    /// Weight over scale², per MPa².
    factor: f64,
}

/// One pascal: without a scale, stress counts in SI.
pub(super) const PASCAL_MPA: f64 = 1e-6;

impl StressBelow {
    /// `scale_mpa` is the excess that counts as one.
    pub fn new(bound_mpa: f64, scale_mpa: Option<f64>, weight: f64) -> Self {
        let scale = scale_mpa.unwrap_or(PASCAL_MPA);
        Self { name: "stress".to_string(), bound_mpa, factor: weight / (scale * scale) }
    }

    /// Calls `f(rod, station, point, weight, excess)` for every sample above the bound.
    fn for_each_excess(&self, view: &StateView, mut f: impl FnMut(usize, usize, usize, f64, f64)) {
        for (index, (rod, strains)) in view.model.rods.iter().zip(&view.equilibrium.strains).enumerate() {
            let weights = rod.rod.station_weights();
            for (station, stresses) in rod.rod.stresses(strains).iter().enumerate() {
                for (point, stress) in stresses.iter().enumerate() {
                    let excess = stress - self.bound_mpa;
                    if excess > 0.0 {
                        let weight = self.factor * view.share * weights[station] / SECTION_POINTS as f64;
                        f(index, station, point, weight, excess);
                    }
                }
            }
        }
    }
}

impl Objective for StressBelow {
    fn name(&self) -> &str {
        &self.name
    }

    fn cost(&self, view: &StateView) -> f64 {
        let mut cost = 0.0;
        self.for_each_excess(view, |_, _, _, weight, excess| cost += 0.5 * weight * excess * excess);
        cost
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal) {
        let mut own = OwnDirections::new(view, at);
        self.for_each_excess(view, |rod, station, point, weight, excess| {
            own.with_row(rod, station, point, |normal, row| normal.add(weight, excess, row));
        });
        own.chain(out);
    }
}

/// Sums in each rod's own directions first, chained to the design parameters once.
pub(super) struct OwnDirections<'a> {
    view: &'a StateView<'a>,
    at: &'a StatesSensitivity<'a>,
    rods: Vec<Option<Own>>,
}

/// One rod's strains and its sum.
struct Own {
    strains: StrainJacobian,
    sum: Normal,
}

impl<'a> OwnDirections<'a> {
    pub(super) fn new(view: &'a StateView<'a>, at: &'a StatesSensitivity<'a>) -> Self {
        Self { view, at, rods: view.model.rods.iter().map(|_| None).collect() }
    }

    /// Calls `f(sum of the rod, gradient of the stress at the sample)`.
    pub(super) fn with_row(
        &mut self,
        rod: usize,
        station: usize,
        point: usize,
        f: impl FnOnce(&mut Normal, &[f64]),
    ) {
        if self.rods[rod].is_none() {
            let strains = self.at.workspace.strains(self.view.model, rod);
            self.rods[rod] = strains.map(|strains| Own { strains, sum: Normal::new(12 + PARAMETERS) });
        }
        let Some(own) = &mut self.rods[rod] else { return };
        if let Some((_, d)) = own.strains.stress(&self.view.model.rods[rod].rod, station, point) {
            let mut row = [0.0; 12 + PARAMETERS];
            row[..12].copy_from_slice(d.link.as_slice());
            row[12..].copy_from_slice(d.parameters.as_slice());
            f(&mut own.sum, &row);
        }
    }

    /// With Z the links by the design parameters and Q the rod's parameters by them, of which few columns are not
    /// zero, a rod adds Zᵀ G_zz Z + Zᵀ G_zq Q + Qᵀ G_qz Z + Qᵀ G_qq Q. The rods are summed before the products with
    /// Z: they share it.
    pub(super) fn chain(mut self, out: &mut Normal) {
        let model = self.view.model;
        let links = &self.at.free.links;
        let (dofs, n) = links.shape();
        // Zᵀ W + Wᵀ Z with W = ½ G_zz Z + G_zq Q.
        let mut by_links = DMatrix::zeros(dofs, dofs);
        let mut w = DMatrix::zeros(dofs, n);
        let (mut gradient, mut tilt) = (DVector::zeros(dofs), DVector::zeros(dofs));
        let mut any = false;
        for (own, rod) in self.rods.iter_mut().zip(&model.rods) {
            let Some(Own { sum, .. }) = own else { continue };
            any = true;
            sum.complete();
            out.cost += sum.cost;
            let firsts = rod.bodies.map(|body| model.layout.bodies[body].first_dof);
            for (half, first) in firsts.iter().enumerate() {
                let Some(first) = *first else { continue };
                for (other, column) in firsts.iter().enumerate() {
                    let Some(column) = *column else { continue };
                    let mut to = by_links.fixed_view_mut::<6, 6>(first, column);
                    to += sum.gauss_newton.fixed_view::<6, 6>(6 * half, 6 * other);
                }
                let mut to = gradient.fixed_rows_mut::<6>(first);
                to += sum.gradient.fixed_rows::<6>(6 * half);
                let mut to = tilt.fixed_rows_mut::<6>(first);
                to += sum.tilt.fixed_rows::<6>(6 * half);
            }
            let own_columns: Vec<(usize, SVector<f64, PARAMETERS>)> = (0..n)
                .filter(|c| rod.dq_dp.column(*c).iter().any(|v| *v != 0.0))
                .map(|c| (c, rod.dq_dp.fixed_view::<PARAMETERS, 1>(0, c).into_owned()))
                .collect();
            let by_own = sum.gauss_newton.columns(12, PARAMETERS);
            for (c, q) in &own_columns {
                let g = by_own * q;
                for (half, first) in firsts.iter().enumerate() {
                    if let Some(first) = *first {
                        let mut to = w.fixed_view_mut::<6, 1>(first, *c);
                        to += g.fixed_rows::<6>(6 * half);
                    }
                }
                for (r, other) in own_columns.iter().filter(|(r, _)| r >= c) {
                    out.gauss_newton[(*r, *c)] += other.dot(&g.fixed_rows::<PARAMETERS>(12));
                }
                out.gradient[*c] += q.dot(&sum.gradient.fixed_rows::<PARAMETERS>(12));
                out.tilt[*c] += q.dot(&sum.tilt.fixed_rows::<PARAMETERS>(12));
            }
        }
        if !any {
            return;
        }
        w += (by_links * links) * 0.5;
        out.gradient.gemv_tr(1.0, links, &gradient, 1.0);
        out.tilt.gemv_tr(1.0, links, &tilt, 1.0);
        let product = links.transpose() * w;
        for c in 0..n {
            for r in c..n {
                out.gauss_newton[(r, c)] += product[(r, c)] + product[(c, r)];
            }
        }
    }
}

/// See the module.
pub struct StressPeak {
    name: String,
    /// Weight over scale, per MPa.
    factor: f64,
}

impl StressPeak {
    /// `scale_mpa` is the stress that counts as one.
    pub fn new(scale_mpa: Option<f64>, weight: f64) -> Self {
        Self { name: "stress".to_string(), factor: weight / scale_mpa.unwrap_or(PASCAL_MPA) }
    }
}

/// Calls `f(rod, station, point, stress, weight)` for every sample of a state.
pub(super) fn for_each_sample(view: &StateView, mut f: impl FnMut(usize, usize, usize, f64, f64)) {
    let share = view.share / STEPS_OF_WEIGHTS / (view.model.rods.len().max(1) * SECTION_POINTS) as f64;
    for (index, (rod, strains)) in view.model.rods.iter().zip(&view.equilibrium.strains).enumerate() {
        let weights = rod.rod.station_weights();
        for (station, stresses) in rod.rod.stresses(strains).iter().enumerate() {
            for (point, stress) in stresses.iter().enumerate() {
                f(index, station, point, *stress, share * weights[station]);
            }
        }
    }
}

impl Sampled for StressPeak {
    fn name(&self) -> &str {
        &self.name
    }

    fn weight(&self) -> f64 {
        self.factor
    }

    fn samples(&self, view: &StateView, f: &mut dyn FnMut(f64, f64)) {
        for_each_sample(view, |_, _, _, stress, weight| f(stress, weight));
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, level: &Level, out: &mut Normal) {
        let mut own = OwnDirections::new(view, at);
        for_each_sample(view, |rod, station, point, stress, weight| {
            let slope = level.slope(stress, weight);
            if slope > 0.0 {
                let curvature = self.factor * level.curvature(slope);
                own.with_row(rod, station, point, |normal, row| {
                    normal.add_model(self.factor * slope, curvature, row);
                });
            }
        });
        own.chain(out);
    }
}
