//! Assembly of a rod's energy, gradient and banded Hessian.
//!
//! All coordinates of a rod form one banded sequence of 4N + 3 numbers: e₀, θ₀, x₁ (what link A carries),
//! θ₁, x₂, θ₂, …, x_{N−2}, θ_{N−2} (internal), x_{N−1}, θ_{N−1}, e_{N−1} (what link B carries). Slot k of
//! three numbers begins at 4k, θ_j is number 4j + 3; the half bandwidth is 10 throughout.

use super::expected::RodForces;
use super::shear::ShearSystem;
use super::stencil::{Block, EdgeFrame, Local, VertexMeasures};
use super::{Rod, RodState};
use crate::math::Pose;
use crate::math::banded::{BandColumn, BandedLdl, COLUMN, HALF_BANDWIDTH};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// First internal coordinate in the banded sequence: θ₁.
pub(crate) const FIRST_INTERNAL: usize = 7;
/// Internal coordinates that one end couples to.
pub(crate) const END_COUPLING: usize = 8;
/// Jacobian of the seven coordinates an end carries by (du, dφ) of its link.
pub(crate) type EndJacobian = SMatrix<f64, 7, 6>;

/// Preallocated workspace of one rod: assembled system, factors, condensation.
#[derive(Clone, Debug)]
pub struct RodSystem {
    pub(crate) n: usize,
    pub(crate) energy: f64,
    pub(crate) frames: Vec<EdgeFrame>,
    /// See [`Self::edge_basis`].
    pub(crate) bases: Vec<Matrix3<f64>>,
    pub(crate) measures: Vec<VertexMeasures>,
    pub(crate) edge_gradient: Vec<Local>,
    pub(crate) edge_hessian: Vec<Block>,
    pub(crate) mixed: Vec<Block>,
    /// Of the last assembled state.
    pub(crate) forces: RodForces,
    /// What the next assembly, if `expecting`, or the last, unless `exact`, forms its geometric stiffness with.
    pub(crate) expected: RodForces,
    pub(crate) expecting: bool,
    pub(crate) exact: bool,
    /// Stiffness of each vertex by its measures, N·mm.
    pub(crate) tangents: Vec<[f64; 3]>,
    /// Scratch: a change of forces, and all coordinates of the rod in their banded order.
    pub(crate) changing: RodForces,
    pub(crate) coordinates: Vec<f64>,
    pub(crate) gradient: Vec<f64>,
    pub(crate) band: Vec<BandColumn>,
    /// Moment arms of x₁ and x_{N−1} from their link's centre.
    pub(crate) arms: [Vector3<f64>; 2],
    pub(crate) jacobians: [EndJacobian; 2],
    pub(crate) link_gradient: SVector<f64, 12>,
    pub(crate) link_hessian: SMatrix<f64, 12, 12>,
    pub(crate) factors: BandedLdl,
    /// Columns 0..6: L⁻¹ of the coupling to link A; column 6: L⁻¹ of the internal gradient.
    pub(crate) reduced: Vec<[f64; 8]>,
    /// Of the gradient alone, where link A is held.
    pub(crate) reduced_gradient: Vec<[f64; 1]>,
    /// L⁻¹ of the coupling to link B, whose rows before the last [`END_COUPLING`] are zero.
    pub(crate) reduced_b: [[f64; 6]; END_COUPLING],
    pub(crate) condensed_gradient: SVector<f64, 12>,
    pub(crate) condensed_hessian: SMatrix<f64, 12, 12>,
    pub(crate) solution: Vec<[f64; 1]>,
    pub(crate) increment: Vec<f64>,
    /// Of the last back-substitution.
    pub(crate) last_link: SVector<f64, 12>,
    pub(crate) columns: Option<Box<super::sensitivity::ParameterColumns>>,
    pub(crate) twist_scale: f64,
    /// Only for rods with shear.
    pub(crate) shear: Option<Box<ShearSystem>>,
    /// Weight of a volume, N/mm³.
    pub(crate) specific_weight: Vector3<f64>,
    /// Shift of the factors in use; none since the last assembly.
    pub(crate) factored: Option<f64>,
}

/// Position of the numbers of an end in its seven coordinates (x, θ, e).
pub(crate) fn end_coordinates(end: usize, n: usize) -> [usize; 7] {
    if end == 0 {
        [4, 5, 6, 3, 0, 1, 2]
    } else {
        let x = 4 * (n - 1);
        [x, x + 1, x + 2, x + 3, x + 4, x + 5, x + 6]
    }
}

/// Coefficients of slots j and j + 1 in e_j: the end slots hold edges, the others vertices.
pub(crate) fn slot_signs(j: usize, n: usize) -> [f64; 2] {
    if j == 0 {
        [1.0, 0.0]
    } else if j == n - 1 {
        [0.0, 1.0]
    } else {
        [-1.0, 1.0]
    }
}

/// Cross-product matrix of `v`, negated: d(φ × v)/dφ.
fn minus_skew(v: &Vector3<f64>) -> Matrix3<f64> {
    -crate::math::skew(v)
}

impl RodSystem {
    /// Workspace for rods with as many edges as `rod`.
    pub fn new(rod: &Rod) -> Self {
        let n = rod.edges;
        let internal = rod.band_freedoms();
        Self {
            n,
            energy: 0.0,
            frames: vec![EdgeFrame::ZERO; n],
            bases: vec![Matrix3::zeros(); n],
            measures: vec![VertexMeasures::ZERO; n],
            edge_gradient: vec![[0.0; 4]; n],
            edge_hessian: vec![[[0.0; 4]; 4]; n],
            mixed: vec![[[0.0; 4]; 4]; n],
            forces: RodForces::zeros(n),
            expected: RodForces::zeros(n),
            expecting: false,
            exact: true,
            tangents: vec![[0.0; 3]; n],
            changing: RodForces::zeros(n),
            coordinates: vec![0.0; 4 * n + 3],
            gradient: vec![0.0; 4 * n + 3],
            band: vec![[0.0; COLUMN]; 4 * n + 3],
            arms: [Vector3::zeros(); 2],
            jacobians: [EndJacobian::zeros(); 2],
            link_gradient: SVector::zeros(),
            link_hessian: SMatrix::zeros(),
            factors: BandedLdl::new(internal),
            reduced: vec![[0.0; 8]; internal + HALF_BANDWIDTH],
            reduced_gradient: Vec::new(),
            reduced_b: [[0.0; 6]; END_COUPLING],
            condensed_gradient: SVector::zeros(),
            condensed_hessian: SMatrix::zeros(),
            solution: vec![[0.0; 1]; internal + HALF_BANDWIDTH],
            increment: vec![0.0; internal],
            last_link: SVector::zeros(),
            columns: None,
            twist_scale: 1.0,
            shear: (!rod.shear.is_empty()).then(|| Box::new(ShearSystem::new(n))),
            specific_weight: Vector3::zeros(),
            factored: None,
        }
    }

    /// Energy of the last assembled state, N·mm.
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Gradient by the internal freedoms (θ₁, x₂, θ₂, …), N·mm and N.
    pub fn internal_gradient(&self) -> &[f64] {
        &self.gradient[FIRST_INTERNAL..4 * self.n - 4]
    }

    /// Gradient by the links' increments with the internal freedoms held (forces N, moments N·mm about the
    /// links' moved centres): what the links must exert on the rod, not yet condensed.
    pub fn link_gradient(&self) -> &SVector<f64, 12> {
        &self.link_gradient
    }

    /// Euclidean norm of the internal gradient with moments divided by the edge length, N. With shear it
    /// contains what the slip misses, in N by the rod's shear stiffness.
    pub fn internal_residual_norm(&self) -> f64 {
        let square: f64 = self
            .internal_gradient()
            .iter()
            .enumerate()
            .map(|(i, g)| if i % 4 == 0 { g / self.twist_scale } else { *g })
            .map(|g| g * g)
            .sum();
        let shear = self.shear.as_deref().map_or(0.0, |s| s.residual_square());
        (square + shear).sqrt()
    }

    /// Largest internal force (resultant over the edges, clamped ones left out), N.
    pub fn largest_internal_force(&self) -> f64 {
        (1..self.n - 1)
            .map(|j| {
                let g = &self.edge_gradient[j];
                (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt() / self.frames[j].l
            })
            .fold(0.0, f64::max)
    }

    /// Force below which the residual is rounding: 64 ε (|x|/h)(EI_max/h² + EA), N.
    pub fn rounding_floor(&self, rod: &Rod, state: &RodState) -> f64 {
        let h = rod.edge_length_mm();
        let x = state.vertices.iter().map(|v| v.amax()).fold(0.0, f64::max);
        let ea = rod.ea.iter().copied().fold(0.0, f64::max);
        64.0 * f64::EPSILON * (x / h) * (rod.largest_bending_stiffness() / (h * h) + ea)
    }

    /// Assembles energy, gradient and Hessian of `rod` at `state`, whose clamps must agree with the poses.
    /// Not finite where consecutive edges fold back on each other.
    pub fn assemble(&mut self, rod: &Rod, state: &RodState, pose_a: &Pose, pose_b: &Pose) {
        debug_assert_eq!(self.n, rod.edges);
        let n = self.n;
        self.columns = None;
        self.factored = None;
        self.exact = !std::mem::take(&mut self.expecting);
        self.twist_scale = rod.edge_length_mm();
        self.local_terms(rod, state);
        self.shear_terms(rod, state);
        self.gradient.fill(0.0);
        self.band.fill([0.0; COLUMN]);
        for j in 0..n {
            self.scatter_edge(j);
        }
        for i in 1..n {
            self.scatter_mixed(i);
        }
        self.weigh(rod);
        let pose_b = rod.chain_pose(state, pose_b);
        for (end, pose) in [pose_a, &pose_b].into_iter().enumerate() {
            let vertex = if end == 0 { 1 } else { n - 1 };
            self.arms[end] = state.vertices[vertex] - (pose.center + pose.translation);
            self.link_terms(end);
        }
        self.shear_columns(rod);
    }

    /// Energies with derivatives in the edges' local coordinates.
    fn local_terms(&mut self, rod: &Rod, state: &RodState) {
        let n = self.n;
        self.energy = 0.0;
        let zipped = self.frames.iter_mut().zip(state.vertices.windows(2)).zip(&state.m1);
        for ((frame, x), m1) in zipped {
            *frame = EdgeFrame::new(&x[0], &x[1], m1);
        }
        for (basis, f) in self.bases.iter_mut().zip(&self.frames) {
            *basis = Matrix3::from_columns(&[f.m1, f.m2, f.t]) * (1.0 / f.l);
        }
        for (j, frame) in self.frames.iter().enumerate() {
            let mut g = [0.0; 4];
            let mut h = [[0.0; 4]; 4];
            self.forces.axial[j] = 0.0;
            if j > 0 && j < n - 1 {
                let stretch = frame.l - rod.edge_lengths[j];
                let force = rod.ea[j] * stretch / rod.stretch_lengths[j];
                self.forces.axial[j] = force;
                self.energy += 0.5 * force * stretch;
                g[2] = force * frame.l;
                h[0][0] = if self.exact { force } else { self.expected.axial[j] } * frame.l;
                h[1][1] = h[0][0];
                h[2][2] = rod.ea[j] / rod.stretch_lengths[j] * frame.l * frame.l;
            }
            self.edge_gradient[j] = g;
            self.edge_hessian[j] = h;
        }
        for i in 1..n {
            let measures = VertexMeasures::new(&self.frames[i - 1], &self.frames[i]);
            let more = self.wagner_twisting(rod, i, &measures);
            let expected = (!self.exact).then(|| &self.expected.moments[i]);
            let term = measures.energy(&rod.vertex_stiffness[i], &rod.rest_measures[i], &more, expected);
            self.measures[i] = measures;
            self.forces.moments[i] = term.moments;
            self.tangents[i] = term.tangents;
            self.energy += term.energy;
            add_local(&mut self.edge_gradient[i - 1], &term.g_before);
            add_local(&mut self.edge_gradient[i], &term.g_after);
            add_block(&mut self.edge_hessian[i - 1], &term.before);
            add_block(&mut self.edge_hessian[i], &term.after);
            self.mixed[i] = term.mixed;
            self.wagner_stretch(rod, i);
        }
    }

    /// Columns of the map from a local to a spatial covector of edge `j`: (m₁, m₂, t)/|e|.
    pub(crate) fn edge_basis(&self, j: usize) -> Matrix3<f64> {
        self.bases[j]
    }

    /// Adds gradient and diagonal block of edge `j` to the banded system.
    fn scatter_edge(&mut self, j: usize) {
        let basis = self.edge_basis(j);
        let g = &self.edge_gradient[j];
        let h = &self.edge_hessian[j];
        let force = basis * Vector3::new(g[0], g[1], g[2]);
        let sym = Matrix3::new(
            h[0][0], h[1][0], h[2][0], //
            h[1][0], h[1][1], h[2][1], //
            h[2][0], h[2][1], h[2][2],
        );
        let block = basis * sym * basis.transpose();
        let turn = basis * Vector3::new(h[3][0], h[3][1], h[3][2]);
        let [s0, s1] = slot_signs(j, self.n);
        // Slot j, θ_j, slot j + 1.
        let Some(to) = self.gradient[4 * j..].first_chunk_mut::<7>() else { return };
        to[3] += g[3];
        for c in 0..3 {
            to[c] += s0 * force[c];
            to[4 + c] += s1 * force[c];
        }
        let Some(to) = self.band[4 * j..].first_chunk_mut::<7>() else { return };
        to[3][0] += h[3][3];
        for c in 0..3 {
            for r in c..3 {
                to[c][r - c] += s0 * s0 * block[(r, c)];
                to[4 + c][r - c] += s1 * s1 * block[(r, c)];
            }
            for r in 0..3 {
                to[c][4 + r - c] += s0 * s1 * block[(r, c)];
            }
            to[c][3 - c] += s0 * turn[c];
            to[3][1 + c] += s1 * turn[c];
        }
    }

    /// Adds the block between edges `i − 1` and `i`.
    fn scatter_mixed(&mut self, i: usize) {
        let m = &self.mixed[i];
        let (basis0, basis1) = (self.edge_basis(i - 1), self.edge_basis(i));
        let inner = Matrix3::from_fn(|r, c| m[r][c]);
        // Rows: edge i, columns: edge i − 1, as the lower triangle wants them.
        let block = basis1 * inner.transpose() * basis0.transpose();
        let turn0 = basis1 * Vector3::new(m[3][0], m[3][1], m[3][2]);
        let turn1 = basis0 * Vector3::new(m[0][3], m[1][3], m[2][3]);
        let ([a, b], [c, d]) = (slot_signs(i - 1, self.n), slot_signs(i, self.n));
        // Slot i − 1, θ_{i−1}, slot i, θ_i, slot i + 1.
        let Some(to) = self.band[4 * i - 4..].first_chunk_mut::<11>() else { return };
        to[3][4] += m[3][3];
        for k in 0..3 {
            to[3][1 + k] += c * turn0[k];
            to[3][5 + k] += d * turn0[k];
            to[k][7 - k] += a * turn1[k];
            to[4 + k][3 - k] += b * turn1[k];
            for r in 0..3 {
                to[k][4 + r - k] += a * c * block[(r, k)];
                to[k][8 + r - k] += a * d * block[(r, k)];
                to[4 + k][4 + r - k] += b * d * block[(r, k)];
            }
            for r in k..3 {
                to[4 + k][r - k] += b * c * (block[(r, k)] + block[(k, r)]);
            }
        }
    }

    /// Gradient and Hessian of one end by its link's increment: x = c + u + exp(φ)r, e = exp(φ)ê,
    /// θ = φ·t̂ up to third order.
    fn link_terms(&mut self, end: usize) {
        let n = self.n;
        let index = end_coordinates(end, n);
        let frame = &self.frames[if end == 0 { 0 } else { n - 1 }];
        let (r, e) = (self.arms[end], frame.t * frame.l);
        let mut jacobian = EndJacobian::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&minus_skew(&r));
        jacobian.fixed_view_mut::<1, 3>(3, 3).copy_from(&frame.t.transpose());
        jacobian.fixed_view_mut::<3, 3>(4, 3).copy_from(&minus_skew(&e));
        let g = SVector::<f64, 7>::from_fn(|i, _| self.gradient[index[i]]);
        let h = SMatrix::<f64, 7, 7>::from_fn(|i, j| {
            let (row, column) = (index[i].max(index[j]), index[i].min(index[j]));
            self.band[column][row - column]
        });
        let mut hessian = jacobian.transpose() * h * jacobian;
        let mut forces: [Vector3<f64>; 2] = [g.fixed_rows::<3>(0).into(), g.fixed_rows::<3>(4).into()];
        if !self.exact {
            // The free edge pulls at its vertex, the clamped one at itself.
            let [free, clamped] = if end == 0 { [1, 0] } else { [n - 2, n - 1] };
            for (force, j, sign) in [(0, free, if end == 0 { -1.0 } else { 1.0 }), (1, clamped, 1.0)] {
                let [a, b, s, _] = self.expected_excess(j);
                forces[force] += self.edge_basis(j) * Vector3::new(a, b, s) * sign;
            }
        }
        for (g, v) in [(forces[0], &r), (forces[1], &e)] {
            let outer = g * v.transpose();
            let second = (outer + outer.transpose()) * 0.5 - Matrix3::identity() * g.dot(v);
            let mut block = hessian.fixed_view_mut::<3, 3>(3, 3);
            block += second;
        }
        self.link_gradient.fixed_rows_mut::<6>(6 * end).copy_from(&(jacobian.transpose() * g));
        self.link_hessian.fixed_view_mut::<6, 6>(6 * end, 6 * end).copy_from(&hessian);
        self.jacobians[end] = jacobian;
    }
}

impl Rod {
    /// Elastic energy of a state, N·mm.
    pub fn energy(&self, state: &RodState) -> f64 {
        let mut energy = 0.0;
        let mut previous: Option<EdgeFrame> = None;
        for (j, (x, m1)) in state.vertices.windows(2).zip(&state.m1).enumerate().take(self.edges) {
            let frame = EdgeFrame::new(&x[0], &x[1], m1);
            if j > 0 && j < self.edges - 1 {
                let stretch = frame.l - self.edge_lengths[j];
                energy += 0.5 * self.ea[j] * stretch * stretch / self.stretch_lengths[j];
            }
            if let Some(p) = &previous {
                let values = VertexMeasures::new(p, &frame).value;
                for ((v, r), b) in values.iter().zip(&self.rest_measures[j]).zip(&self.vertex_stiffness[j]) {
                    energy += 0.5 * b * (v - r) * (v - r);
                }
                energy += self.wagner_energy(j, values[2], [p.l, frame.l]);
            }
            if let Some(c) = self.shear.get(j) {
                energy += 0.5 * c * frame.t.dot(&state.force).powi(2);
            }
            previous = Some(frame);
        }
        energy + self.slip_energy(state)
    }
}

fn add_local(to: &mut Local, from: &Local) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += f;
    }
}

fn add_block(to: &mut Block, from: &Block) {
    for (t, f) in to.iter_mut().zip(from) {
        add_local(t, f);
    }
}
