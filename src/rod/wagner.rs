//! Wagner's strain: where a rod twists, fibres off its axis run along helices and stretch.
//!
//! To second order a fibre at distance r is stretched by ε + ½(τ² − τ̄²) r², with ε the stretch of the axis and τ, τ̄
//! the present and the rest twist rate. Over the section (doubly symmetric, so that bending does not mix in) this adds
//! to the energy per length E I₄ u²/2 + E I_p ε u, u = ½(τ² − τ̄²), I_p = ∫r² dA, I₄ = ∫r⁴ dA. Where no axial force
//! acts, ε = −u I_p/A and the torque of a rod without rest twist is GJτ + ½EK_wτ³, K_w = I₄ − I_p²/A; under a
//! tension N the torsional stiffness gains N I_p/A.
//!
//! In the rod u belongs to a vertex, ε to an edge. A vertex sees the mean of its two edges, next to a clamp that of the
//! one free edge: then each edge is seen over the length it stands for, and a uniformly twisted rod has the same tension
//! in every edge, at every N.

use super::assemble::RodSystem;
use super::rest::RestShape;
use super::stencil::{Twisting, VertexMeasures};
use super::{PARAMETERS, Rod};
use crate::math::dual::{Dual, Real};

/// Of a vertex: E I_p/l̄ and E I₄/l̄³.
pub(crate) type Form = [f64; 2];

/// Derivatives of one number by the parameters.
type Row = [f64; PARAMETERS];

fn form<T: Real>(before: &[T; 2], after: &[T; 2], length: T) -> [T; 2] {
    let mean = |k: usize| (before[k] + after[k]).scale(0.5);
    [mean(0) / length, mean(1) / (length * length * length)]
}

/// Forms of all vertices from the moments of the edges and the vertices' lengths; entry 0 is unused.
pub(crate) fn forms(polar: &[[f64; 2]], lengths: &[f64]) -> Vec<Form> {
    if polar.is_empty() {
        return Vec::new();
    }
    let inner = polar.windows(2).zip(lengths.iter().skip(1)).map(|(p, l)| form(&p[0], &p[1], *l));
    std::iter::once([0.0; 2]).chain(inner).collect()
}

/// Weights of the edges before and after inner vertex `i` of `n` edges in the stretch that it sees.
fn weights(i: usize, n: usize) -> [f64; 2] {
    if i == 1 {
        [0.0, 1.0]
    } else if i == n - 1 {
        [1.0, 0.0]
    } else {
        [0.5, 0.5]
    }
}

impl Rod {
    /// Stretch of free edge `j` when it is `length` long, 0 of a clamped one.
    fn edge_stretch(&self, j: usize, length: f64) -> f64 {
        if j == 0 || j + 1 == self.edges {
            return 0.0;
        }
        (length - self.edge_lengths[j]) / self.stretch_lengths[j]
    }

    /// Energy of vertex `i` by integrated twist `twist` and the lengths of its edges, N·mm.
    pub(crate) fn wagner_energy(&self, i: usize, twist: f64, lengths: [f64; 2]) -> f64 {
        let Some([p, q]) = self.wagner.get(i) else { return 0.0 };
        let rest = self.rest_measures[i][2];
        let s = 0.5 * (twist * twist - rest * rest);
        let [w0, w1] = weights(i, self.edges);
        let stretch = w0 * self.edge_stretch(i - 1, lengths[0]) + w1 * self.edge_stretch(i, lengths[1]);
        (0.5 * q * s + p * stretch) * s
    }
}

impl RodSystem {
    /// Moment, tangent and energy that vertex `i` gains for its twist, the strains held.
    pub(crate) fn wagner_twisting(&self, rod: &Rod, i: usize, measures: &VertexMeasures) -> Twisting {
        let Some([p, q]) = rod.wagner.get(i) else { return Twisting::default() };
        let (v, rest) = (measures.value[2], rod.rest_measures[i][2]);
        let s = 0.5 * (v * v - rest * rest);
        let [w0, w1] = weights(i, self.n);
        let stretch =
            w0 * rod.edge_stretch(i - 1, self.frames[i - 1].l) + w1 * rod.edge_stretch(i, self.frames[i].l);
        let force = q * s + p * stretch;
        Twisting { energy: (0.5 * q * s + p * stretch) * s, moment: force * v, tangent: force + q * v * v }
    }

    /// Adds what vertex `i` does to the stretch of its edges, and the mixed terms with its twist.
    pub(crate) fn wagner_stretch(&mut self, rod: &Rod, i: usize) {
        let Some([p, _]) = rod.wagner.get(i) else { return };
        let n = self.n;
        let m = &self.measures[i];
        let (before, after) = (m.before[2], m.after[2]);
        let (v, rest) = (m.value[2], rod.rest_measures[i][2]);
        let (s, mixed) = (0.5 * (v * v - rest * rest), p * v);
        // ε by σ, and to second order by α and β too: |e| is |e|(1 + σ + ½(α² + β²)).
        let slope = |j: usize, w: f64| w * self.frames[j].l / rod.stretch_lengths[j];
        let [w0, w1] = weights(i, n);
        let slopes = [slope(i - 1, w0), slope(i, w1)];
        for (j, slope, twist) in [(i - 1, slopes[0], &before), (i, slopes[1], &after)] {
            let (g, h) = (&mut self.edge_gradient[j], &mut self.edge_hessian[j]);
            let force = p * s * slope;
            g[2] += force;
            h[0][0] += force;
            h[1][1] += force;
            h[2][0] += mixed * slope * twist[0];
            h[2][1] += mixed * slope * twist[1];
            h[3][2] += mixed * slope * twist[3];
        }
        let block = &mut self.mixed[i];
        for k in 0..4 {
            block[2][k] += mixed * slopes[0] * after[k];
            block[k][2] += mixed * slopes[1] * before[k];
        }
    }

    /// Adds derivatives by the parameters of vertex `i`'s part of the gradient, at a fixed state: to the moment of
    /// its twist (returned), and to the rows of its two edges' stretch.
    pub(crate) fn wagner_columns(
        &self,
        rod: &Rod,
        rest: &RestShape<Dual<PARAMETERS>>,
        i: usize,
        edges: [&mut Row; 2],
    ) -> Row {
        let mut moment = [0.0; PARAMETERS];
        if rest.polar.is_empty() {
            return moment;
        }
        let n = self.n;
        let [p, q] = form(&rest.polar[i - 1], &rest.polar[i], rest.voronoi[i]);
        let v = self.measures[i].value[2];
        let s = (Dual::constant(v * v) - rest.measures[i][2] * rest.measures[i][2]).scale(0.5);
        let mut stretch = Dual::constant(0.0);
        for ((j, w), row) in [i - 1, i].into_iter().zip(weights(i, n)).zip(edges) {
            if w == 0.0 {
                continue;
            }
            let l = self.frames[j].l;
            let ratio = Dual::constant(l) / rest.edge_lengths[j];
            let factor = w * rod.edge_lengths[j] / rod.stretch_lengths[j];
            stretch += (ratio - Dual::constant(1.0)).scale(factor);
            // Work on σ: p s dε/dσ, with dε/dσ = w |e|/(|ē| stretch factor).
            let force = p * s * ratio.scale(factor);
            for (to, d) in row.iter_mut().zip(&force.eps) {
                *to += d;
            }
        }
        let total = (q * s + p * stretch).scale(v);
        moment.copy_from_slice(&total.eps);
        moment
    }
}
