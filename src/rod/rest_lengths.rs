//! The adjoint gradient by the rest lengths of the edges: what every edge's own length does to a result, at the cost of
//! one back substitution. The parameters of a rod move all edges together; this tells where along it length matters.

use super::assemble::{RodSystem, slot_signs};
use super::{Rod, stretch_factor};
use nalgebra::{SVector, Vector3};

/// Local coordinates of an edge: two transversal turns, stretch, twist.
const LOCAL: usize = 4;

impl RodSystem {
    /// Derivatives of a result by the rest lengths |ē_j| of all edges, in its unit per mm; zero for the two edges that
    /// are clamped, whose length belongs to the links' geometry. `adjoint` solves H y = w for the covector w of the
    /// result on the links' increments, with the condensed Hessian H of the whole problem at its equilibrium (fixed
    /// freedoms zero). Rest turns and section stiffnesses are held. Call after [`Self::condense`] without a shift.
    ///
    /// The adjoint of the internal freedoms is −K⁻¹ C y, which is the back substitution; then
    /// dJ/d|ē_j| = −(∂²E/∂|ē_j|∂x) · (y, −K⁻¹ C y) (as Megaro et al. 2017, eq. 17, transposed). For plain rods: the
    /// slip of one with shear is held.
    pub fn rest_length_gradient(&mut self, rod: &Rod, adjoint: &SVector<f64, 12>) -> Vec<f64> {
        let n = self.n;
        // In the order of the band: what end A carries, the internal freedoms, what end B carries.
        let mut moved = vec![0.0; 4 * n + 3];
        let internal = self.back_substitute(adjoint).to_vec();
        for (to, from) in moved.iter_mut().skip(super::assemble::FIRST_INTERNAL).zip(&internal) {
            *to = *from;
        }
        for end in 0..2 {
            let carried = self.jacobians[end] * adjoint.fixed_rows::<6>(6 * end);
            for (at, value) in super::assemble::end_coordinates(end, n).into_iter().zip(carried.iter()) {
                moved[at] = *value;
            }
        }
        let local: Vec<[f64; LOCAL]> = (0..n).map(|j| self.local_increment(j, &moved)).collect();
        let mut out = vec![0.0; n];
        for j in 1..n.saturating_sub(1) {
            let (l, rest) = (self.frames[j].l, rod.edge_lengths[j]);
            // F = EA (l/l̄ − 1)/w, work on dl = l σ.
            out[j] += rod.ea[j] / stretch_factor(j, n) * l / (rest * rest) * l * local[j][2];
        }
        for i in 1..n {
            let measures = &self.measures[i];
            let mut work = 0.0;
            for f in 0..3 {
                let along = |gradient: &[f64; LOCAL], x: &[f64; LOCAL]| -> f64 {
                    gradient.iter().zip(x).map(|(g, x)| g * x).sum()
                };
                let turned = along(&measures.before[f], &local[i - 1]) + along(&measures.after[f], &local[i]);
                work += rod.vertex_stiffness[i][f] * (measures.value[f] - rod.rest_measures[i][f]) * turned;
            }
            // The stiffness is B/v with v the mean of both rest lengths.
            let share = 0.5 * work / rod.voronoi[i];
            for j in [i - 1, i] {
                if j > 0 && j < n - 1 {
                    out[j] += share;
                }
            }
        }
        out
    }

    /// Increments of the local coordinates of edge `j`.
    fn local_increment(&self, j: usize, moved: &[f64]) -> [f64; LOCAL] {
        let mut e = Vector3::zeros();
        for (s, sign) in slot_signs(j, self.n).into_iter().enumerate() {
            for c in 0..3 {
                e[c] += sign * moved[4 * (j + s) + c];
            }
        }
        let along = self.edge_basis(j).transpose() * e;
        [along.x, along.y, along.z, moved[4 * j + 3]]
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::rod::single::{EndLoad, SingleRod};
    use crate::rod::{RodMaterial, RodParameters};
    use nalgebra::SMatrix;

    /// Relative to the largest component; measured 2e-11 to 4e-11.
    const AGREEMENT: f64 = 1e-9;
    const LOAD: EndLoad = EndLoad {
        force: Vector3::new(-0.05, 0.4, 0.1),
        point: Vector3::new(30.0, 0.0, 0.0),
        moment: Vector3::new(0.0, 0.0, 0.0),
    };

    /// A cantilever whose edge `j` rests `by` mm longer.
    fn bent(j: usize, by: f64) -> SingleRod {
        let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * 30.0, Vector3::z(), 0.4, 2.5);
        let mut rod = Rod::new(&q, RodMaterial { e_mpa: 1500.0, nu: 0.4 }, 20).unwrap();
        rod.edge_lengths[j] += by;
        rod.stretch_lengths[j] = rod.edge_lengths[j] * stretch_factor(j, 20);
        for i in [j, j + 1] {
            let v = rod.voronoi[i];
            rod.voronoi[i] = v + 0.5 * by;
            rod.vertex_stiffness[i] = rod.vertex_stiffness[i].map(|b| b * v / (v + 0.5 * by));
        }
        let mut s = SingleRod::new(rod, Vector3::zeros(), Vector3::x() * 30.0);
        for part in 1..=8 {
            s.solve(&EndLoad { force: LOAD.force * (f64::from(part) / 8.0), ..LOAD }, [true; 6]).unwrap();
        }
        s
    }

    /// A result: a combination of the link's displacement.
    fn result(s: &SingleRod) -> f64 {
        s.pose_b.translation.dot(&Vector3::new(0.6, 1.0, -0.4))
    }

    #[test]
    fn agrees_with_solving_again() {
        let mut s = bent(1, 0.0);
        let (_, of_load) = LOAD.derivatives(&s.pose_b);
        let h: SMatrix<f64, 6, 6> = s.system.condensed_hessian().fixed_view::<6, 6>(6, 6) + of_load;
        let mut w = SVector::<f64, 6>::zeros();
        w.fixed_rows_mut::<3>(0).copy_from(&Vector3::new(0.6, 1.0, -0.4));
        let mut adjoint = SVector::<f64, 12>::zeros();
        adjoint.fixed_rows_mut::<6>(6).copy_from(&h.lu().solve(&w).unwrap());
        let rod = s.rod.clone();
        let gradient = s.system.rest_length_gradient(&rod, &adjoint);
        assert_eq!((gradient[0], gradient[19]), (0.0, 0.0));
        let largest = gradient.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
        for (j, got) in gradient.iter().enumerate().take(19).skip(1) {
            let step = 2e-3;
            let at = |k: f64| result(&bent(j, k * step));
            let want = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
            let error = (got - want).abs() / largest;
            println!("edge {j}: {got:.6} {want:.6} {error:.1e}");
            assert!(error < AGREEMENT, "edge {j}: {got} {want}");
        }
    }
}
