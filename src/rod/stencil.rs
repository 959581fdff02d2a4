//! Integrated curvatures and twist at one vertex with analytic first and second derivatives.
//!
//! Edge variations are written in the edge's own frame, δe = |e|(α m₁ + β m₂ + σ t), with θ the turn of the
//! frame after parallel transport. To second order the frame then changes by rows of
//!   m₁: (−½α²−½θ², θ−½αβ, −α(1−σ)−θβ)   m₂: (−θ−½αβ, −½β²−½θ², −β(1−σ)+θα)   t: (α(1−σ), β(1−σ), −½α²−½β²)
//! in the basis (m₁, m₂, t), which follows from v(t) = v − (v·τ)t̂ − ½(v·τ)τ. All measures are functions of
//! D_ij = d_i⁰·d_j¹, the products of the two frames (index 3 is t):
//!   κ₁ = (D₁₃ − D₃₁)/χ, κ₂ = (D₂₃ − D₃₂)/χ, χ = 1 + D₃₃, χ exp(iτ) = (D₁₁ + D₂₂) + i(D₂₁ − D₁₂).
//! Each has the form f = n/χ to the needs of a second derivative (for τ: Im d²ln z), so that the Hessian of
//! ½ΣB(f − f̄)² is ΣB ∇f∇fᵀ + (W − g∇χᵀ − ∇χgᵀ)/χ, with g its gradient and W = ΣM∇²n − (ΣMκ)∇²χ,
//! M = B(f − f̄). Same quantities as in Bergou et al. 2010 and Megaro et al. 2017, sec. 3.1.

use nalgebra::Vector3;

/// An edge's direction, material frame and length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeFrame {
    pub t: Vector3<f64>,
    pub m1: Vector3<f64>,
    pub m2: Vector3<f64>,
    pub l: f64,
}

impl EdgeFrame {
    pub(crate) const ZERO: Self = Self {
        t: Vector3::new(0.0, 0.0, 0.0),
        m1: Vector3::new(0.0, 0.0, 0.0),
        m2: Vector3::new(0.0, 0.0, 0.0),
        l: 0.0,
    };

    /// Frame of the edge from `x0` to `x1` with thin direction `m1`.
    #[inline]
    pub(crate) fn new(x0: &Vector3<f64>, x1: &Vector3<f64>, m1: &Vector3<f64>) -> Self {
        let e = x1 - x0;
        let l = e.norm();
        let t = e * (1.0 / l);
        Self { t, m1: *m1, m2: t.cross(m1), l }
    }
}

/// Four local coordinates (α, β, σ, θ) of an edge.
pub(crate) type Local = [f64; 4];
/// A block between the local coordinates of two edges.
pub(crate) type Block = [[f64; 4]; 4];

/// Measures of one vertex and their gradients, per edge side in local coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VertexMeasures {
    /// κ₁, κ₂, τ (integrated, rad).
    pub value: [f64; 3],
    /// Gradients by the local coordinates of the edge before.
    pub before: [Local; 3],
    /// Gradients by the local coordinates of the edge after.
    pub after: [Local; 3],
    chi: f64,
    d: [[f64; 3]; 3],
    twist: [f64; 2],
}

/// Gradient and Hessian of one vertex energy in local coordinates; the diagonal blocks lower triangles.
pub(crate) struct VertexEnergy {
    pub energy: f64,
    pub g_before: Local,
    pub g_after: Local,
    pub before: Block,
    pub after: Block,
    /// Rows: edge before; columns: edge after.
    pub mixed: Block,
    /// Conjugate to the measures, N·mm.
    pub moments: [f64; 3],
    /// Their derivatives by the measures.
    pub tangents: [f64; 3],
}

/// Energy of a vertex beyond ½ΣB(f − f̄)², a function of its twist, with its first and second derivative by it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Twisting {
    pub energy: f64,
    pub moment: f64,
    pub tangent: f64,
}

/// Local coordinates by which the measures have derivatives: all but the stretch σ.
const TURNING: [usize; 3] = [0, 1, 3];

/// Lower triangle of Σ s gᵀ + r (w − gr xᵀ − x grᵀ), where s, g, gr and x have no part along σ.
#[inline(always)]
fn lower(w: &Block, s: &[Local; 3], g: &[Local; 3], gr: &Local, x: &Local, r: f64) -> Block {
    let mut out = [[0.0; 4]; 4];
    for i in TURNING {
        for j in TURNING.into_iter().filter(|j| *j <= i) {
            out[i][j] = s[0][i] * g[0][j]
                + s[1][i] * g[1][j]
                + s[2][i] * g[2][j]
                + r * (w[i][j] - gr[i] * x[j] - x[i] * gr[j]);
        }
    }
    out[2] = w[2].map(|w| r * w);
    out
}

impl VertexMeasures {
    pub(crate) const ZERO: Self = Self {
        value: [0.0; 3],
        before: [[0.0; 4]; 3],
        after: [[0.0; 4]; 3],
        chi: 1.0,
        d: [[0.0; 3]; 3],
        twist: [1.0, 0.0],
    };

    /// Measures between two consecutive edges.
    #[inline]
    pub(crate) fn new(f0: &EdgeFrame, f1: &EdgeFrame) -> Self {
        let row = |v: &Vector3<f64>| [v.dot(&f1.m1), v.dot(&f1.m2), v.dot(&f1.t)];
        let d = [row(&f0.m1), row(&f0.m2), row(&f0.t)];
        let chi = 1.0 + d[2][2];
        let r = 1.0 / chi;
        let k1 = (d[0][2] - d[2][0]) * r;
        let k2 = (d[1][2] - d[2][1]) * r;
        let (sine, cosine) = (d[1][0] - d[0][1], d[0][0] + d[1][1]);
        let tt = d[2][2];
        let scaled =
            |g: [f64; 4], k: f64, x: f64, y: f64| [(g[0] - k * x) * r, (g[1] - k * y) * r, 0.0, g[3] * r];
        let before = [
            scaled([-tt - d[0][0], -d[1][0], 0.0, d[1][2]], k1, d[0][2], d[1][2]),
            scaled([-d[0][1], -tt - d[1][1], 0.0, -d[0][2]], k2, d[0][2], d[1][2]),
            [-d[1][2] * r, d[0][2] * r, 0.0, -1.0],
        ];
        let after = [
            scaled([d[0][0] + tt, d[0][1], 0.0, -d[2][1]], k1, d[2][0], d[2][1]),
            scaled([d[1][0], d[1][1] + tt, 0.0, d[2][0]], k2, d[2][0], d[2][1]),
            [d[2][1] * r, -d[2][0] * r, 0.0, 1.0],
        ];
        // |z| = χ, up to rounding.
        Self { value: [k1, k2, sine.atan2(cosine)], before, after, chi, d, twist: [cosine * r, sine * r] }
    }

    /// Energy ½ΣB(f − f̄)² of this vertex, and `more` of its twist, with their derivatives; `b` are EI₁/l̄, EI₂/l̄,
    /// GJ/l̄. The geometric stiffness is that of the moments `expected`, or else of the present ones.
    #[inline]
    pub(crate) fn energy(
        &self,
        b: &[f64; 3],
        rest: &[f64; 3],
        more: &Twisting,
        expected: Option<&[f64; 3]>,
    ) -> VertexEnergy {
        let mut m: [f64; 3] = std::array::from_fn(|i| b[i] * (self.value[i] - rest[i]));
        let energy = 0.5 * (0..3).map(|i| m[i] * (self.value[i] - rest[i])).sum::<f64>() + more.energy;
        m[2] += more.moment;
        let b = &[b[0], b[1], b[2] + more.tangent];
        let sum = |m: &[f64; 3], g: &[Local; 3]| -> Local {
            std::array::from_fn(|i| m[0] * g[0][i] + m[1] * g[1][i] + m[2] * g[2][i])
        };
        let (g_before, g_after) = (sum(&m, &self.before), sum(&m, &self.after));
        let moments = m;
        let m = expected.unwrap_or(&m);
        let (g0, g1) = match expected {
            Some(m) => (sum(m, &self.before), sum(m, &self.after)),
            None => (g_before, g_after),
        };
        let d = &self.d;
        let (d11, d12, d13) = (d[0][0], d[0][1], d[0][2]);
        let (d21, d22, d23) = (d[1][0], d[1][1], d[1][2]);
        let (d31, d32, d33) = (d[2][0], d[2][1], d[2][2]);
        let (m1, m2) = (m[0], m[1]);
        // Twist enters as P = M cos τ, Q = −M sin τ; curvature over χ as K.
        let (p, q) = (m[2] * self.twist[0], -m[2] * self.twist[1]);
        let k = m1 * self.value[0] + m2 * self.value[1];
        let r = 1.0 / self.chi;

        let aa = m1 * (d31 - d13) + m2 * d32 + k * d33;
        let bb = m1 * d31 + m2 * (d32 - d23) + k * d33;
        let w0 = [
            [aa + p * d12 - q * d11, 0.0, 0.0, 0.0],
            [
                -0.5 * (m1 * d23 + m2 * d13) + 0.5 * (p * (d22 - d11) - q * (d21 + d12)),
                bb - p * d21 - q * d22,
                0.0,
                0.0,
            ],
            [
                m1 * (d33 + d11) + m2 * d12 + k * d13 - p * d32 + q * d31,
                m1 * d21 + m2 * (d33 + d22) + k * d23 + p * d31 + q * d32,
                0.0,
                0.0,
            ],
            [m2 * d33 + p * d31 + q * d32, -m1 * d33 + p * d32 - q * d31, 0.0, -m1 * d13 - m2 * d23],
        ];
        let aa = m1 * (d31 - d13) - m2 * d23 + k * d33;
        let bb = -m1 * d13 + m2 * (d32 - d23) + k * d33;
        let w1 = [
            [aa - p * d21 - q * d11, 0.0, 0.0, 0.0],
            [
                0.5 * (m1 * d32 + m2 * d31) + 0.5 * (p * (d11 - d22) - q * (d12 + d21)),
                bb + p * d12 - q * d22,
                0.0,
                0.0,
            ],
            [
                -m1 * (d11 + d33) - m2 * d21 + k * d31 + p * d23 + q * d13,
                -m1 * d12 - m2 * (d22 + d33) + k * d32 - p * d13 + q * d23,
                0.0,
                0.0,
            ],
            [-m2 * d33 - p * d13 + q * d23, m1 * d33 - p * d23 - q * d13, 0.0, m1 * d31 + m2 * d32],
        ];
        let w01 = [
            [
                m1 * (d13 - d31) - k * d11 + q * d33,
                -m1 * d32 + m2 * d13 - k * d12 - p * d33,
                0.0,
                -m1 * d12 + m2 * d11 - p * d31 - q * d32,
            ],
            [
                m1 * d23 - m2 * d31 - k * d21 + p * d33,
                m2 * (d23 - d32) - k * d22 + q * d33,
                0.0,
                -m1 * d22 + m2 * d21 - p * d32 + q * d31,
            ],
            [0.0; 4],
            [m1 * d21 - m2 * d11 + p * d13 - q * d23, m1 * d22 - m2 * d12 + p * d23 + q * d13, 0.0, 0.0],
        ];
        let (x0, x1) = ([d13, d23, 0.0, 0.0], [d31, d32, 0.0, 0.0]);
        let scaled = |g: &[Local; 3]| -> [Local; 3] { std::array::from_fn(|f| g[f].map(|v| b[f] * v)) };
        let (s0, s1) = (scaled(&self.before), scaled(&self.after));
        let before = lower(&w0, &s0, &self.before, &g0, &x0, r);
        let after = lower(&w1, &s1, &self.after, &g1, &x1, r);
        let mut mixed = [[0.0; 4]; 4];
        for i in TURNING {
            for j in TURNING {
                mixed[i][j] = s0[0][i] * self.after[0][j]
                    + s0[1][i] * self.after[1][j]
                    + s0[2][i] * self.after[2][j]
                    + r * (w01[i][j] - g0[i] * x1[j] - x0[i] * g1[j]);
            }
        }
        VertexEnergy { energy, g_before, g_after, before, after, mixed, moments, tangents: *b }
    }
}
