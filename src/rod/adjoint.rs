//! Gradient of a functional by the rest lengths of all free edges at an equilibrium, by one solve with the factors at
//! hand (Megaro et al. 2017, eqs. 17–19, transposed).

use super::Rod;
use super::assemble::RodSystem;
use super::sensitivity::SensitivityError;
use super::stencil::Local;
use nalgebra::Vector3;

impl RodSystem {
    /// Derivatives of a functional with gradient `w` by the internal freedoms (θ₁, x₂, θ₂, …) by the rest length of each
    /// edge, per mm, with the links held: zero for the clamped ones. The rest curvatures, integrated over a vertex, stay.
    /// Call at an equilibrium after [`Self::factor_unshifted`]; back-substitutions then need the condensation anew.
    ///
    /// # Errors
    /// For rods with shear or Wagner's strain, and where `w` or `out` has the wrong length.
    pub fn rest_length_gradient(
        &mut self,
        rod: &Rod,
        w: &[f64],
        out: &mut [f64],
    ) -> Result<(), SensitivityError> {
        let n = self.n;
        if !rod.shear.is_empty() || !rod.wagner.is_empty() {
            return Err(SensitivityError::Corrected);
        }
        if w.len() != self.factors.order() || out.len() != n {
            return Err(SensitivityError::Shape);
        }
        // λ = K⁻¹ w: dJ/dl̄ = −λᵀ ∂g/∂l̄.
        for (to, from) in self.solution.iter_mut().zip(w.iter().chain(std::iter::repeat(&0.0))) {
            to[0] = *from;
        }
        self.factors.forward(&mut self.solution, 0);
        self.factors.backward(&mut self.solution);
        out.fill(0.0);
        let lambda = &self.solution;
        let vertex = |k: usize| match k {
            k if k >= 2 && k < n - 1 => {
                Vector3::new(lambda[4 * k - 7][0], lambda[4 * k - 6][0], lambda[4 * k - 5][0])
            }
            _ => Vector3::zeros(),
        };
        let mut start = Vector3::zeros();
        let mut before: Local = [0.0; 4];
        for j in 0..n {
            let end = vertex(j + 1);
            let e = end - start;
            start = end;
            let free = j > 0 && j < n - 1;
            let f = &self.frames[j];
            let r = 1.0 / f.l;
            let theta = if free { lambda[4 * j - 4][0] } else { 0.0 };
            let after = [f.m1.dot(&e) * r, f.m2.dot(&e) * r, f.t.dot(&e) * r, theta];
            if j > 0 {
                // A vertex's moments go as 1/l̄, with l̄ the mean of its edges.
                let (m, moments) = (&self.measures[j], &self.forces.moments[j]);
                let mut work = 0.0;
                for (k, moment) in moments.iter().enumerate() {
                    let by: f64 = (0..4).map(|c| m.before[k][c] * before[c] + m.after[k][c] * after[c]).sum();
                    work += moment * by;
                }
                let half = 0.5 * work / rod.voronoi[j];
                out[j - 1] += half;
                out[j] += half;
            }
            if free {
                let rigid = rod.ea[j] / rod.stretch_lengths[j];
                out[j] += rigid * f.l * f.l / rod.edge_lengths[j] * after[2];
            }
            before = after;
        }
        (out[0], out[n - 1]) = (0.0, 0.0);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::single::SingleRod;
    use super::super::{Rod, RodMaterial, RodParameters};
    use nalgebra::Vector3;

    /// Of five points of the difference quotient of fourth order, at 1e-3 of a rest length: measured 3.4e-10.
    const AGREES: f64 = 1e-7;

    /// A curved rod with one rest length off by `by`, bent to the same place.
    fn bent(edge: usize, by: f64) -> SingleRod {
        let material = RodMaterial { e_mpa: 1500.0, nu: 0.4 };
        let mut q =
            RodParameters::straight(Vector3::zeros(), Vector3::new(28.0, 4.0, 0.0), Vector3::z(), 0.4, 2.5);
        q.derivative_a += Vector3::new(0.0, 9.0, 2.0);
        let mut rod = Rod::new(&q, material, 20).unwrap();
        let old = (rod.edge_lengths[edge], rod.voronoi.clone());
        rod.stretch_lengths[edge] *= (old.0 + by) / old.0;
        rod.edge_lengths[edge] += by;
        for i in [edge, edge + 1] {
            rod.voronoi[i] += 0.5 * by;
            let ratio = old.1[i] / rod.voronoi[i];
            rod.vertex_stiffness[i].iter_mut().for_each(|b| *b *= ratio);
        }
        let mut s = SingleRod::new(rod, Vector3::zeros(), Vector3::new(28.0, 4.0, 0.0));
        for _ in 0..6 {
            s.move_b(&Vector3::new(-0.3, 0.4, 0.1), &Vector3::new(0.03, -0.02, 0.08)).unwrap();
        }
        s
    }

    #[test]
    fn agrees_with_differences() {
        let mut s = bent(5, 0.0);
        let n = s.rod.edges();
        // J = Σ w·x over the inner vertices.
        let weight = |i: usize| if i.is_multiple_of(4) { 0.0 } else { (i as f64 * 0.9).sin() };
        let w: Vec<f64> = (0..s.rod.internal_freedoms()).map(weight).collect();
        let value = |s: &SingleRod| -> f64 {
            let inner = s.state.vertices[2..n - 1].iter().enumerate();
            inner.map(|(k, x)| (0..3).map(|c| w[4 * k + 1 + c] * x[c]).sum::<f64>()).sum()
        };
        let mut gradient = vec![0.0; n];
        s.system.rest_length_gradient(&s.rod, &w, &mut gradient).unwrap();
        let scale = gradient.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
        let h = 1.5e-3;
        for (edge, exact) in gradient.iter().enumerate().take(n - 1).skip(1) {
            let at = |k: f64| value(&bent(edge, k * h));
            let difference = (at(-2.0) - 8.0 * at(-1.0) + 8.0 * at(1.0) - at(2.0)) / (12.0 * h);
            assert!((difference - exact).abs() < AGREES * scale, "{edge}: {exact} {difference} {scale}");
        }
    }
}
