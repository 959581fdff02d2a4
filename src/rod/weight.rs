//! The weight of a rod: a dead force on each of its inner vertices.
//!
//! Between the attachment planes lie the vertices 1 to N − 1, each with one edge length h = L/(N − 1) of material, so
//! that the rod weighs ρ g A L at every N. The force in a rod under its own weight is not the same in every edge; the
//! shear of the corrected model takes it to be that at link B, which is off by the shear of the weight alone.

use super::assemble::RodSystem;
use super::rest::RestShape;
use super::sensitivity::Row;
use super::{PARAMETERS, Rod, RodState};
use crate::math::dual::{Dual, Real};
use nalgebra::Vector3;

impl Rod {
    /// Volume between the attachment planes, mm³.
    pub fn volume_mm3(&self) -> f64 {
        self.area_mm2() * self.length
    }

    fn area_mm2(&self) -> f64 {
        self.ea.first().map_or(0.0, |ea| ea / self.material.e_mpa)
    }

    fn vertex_volume_mm3(&self) -> f64 {
        self.area_mm2() * self.edge_length_mm()
    }

    /// Potential of the weight relative to the rest shape, N·mm, where the weight of a volume is `specific` (N/mm³).
    pub fn weight_potential_n_mm(&self, state: &RodState, specific: &Vector3<f64>) -> f64 {
        let sunk = |(now, rest): (&Vector3<f64>, &Vector3<f64>)| specific.dot(&(now - rest));
        let inner = state.vertices.iter().zip(&self.rest.vertices).skip(1).take(self.edges - 1);
        -self.vertex_volume_mm3() * inner.map(sunk).sum::<f64>()
    }
}

impl RodSystem {
    /// Sets the weight of a volume from the next assembly on, N/mm³; zero at first.
    pub fn set_specific_weight(&mut self, specific: &Vector3<f64>) {
        self.specific_weight = *specific;
    }

    /// Adds the weight to the gradient.
    pub(crate) fn weigh(&mut self, rod: &Rod) {
        let force = self.specific_weight * rod.vertex_volume_mm3();
        for i in 1..self.n {
            for c in 0..3 {
                self.gradient[4 * i + c] -= force[c];
            }
        }
    }

    /// Its derivatives by the parameters.
    pub(crate) fn weight_columns(&self, rod: &Rod, rest: &RestShape<Dual<PARAMETERS>>, out: &mut [Row]) {
        if self.specific_weight == Vector3::zeros() {
            return;
        }
        let Some(section) = rest.stiffness.first() else { return };
        let scale = 1.0 / (rod.material.e_mpa * (self.n - 1) as f64);
        let volume = (section.ea * rest.length).scale(scale);
        for i in 1..self.n {
            for c in 0..3 {
                super::sensitivity::add_scaled(&mut out[4 * i + c], -self.specific_weight[c], &volume.eps);
            }
        }
    }
}
