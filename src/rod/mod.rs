//! One rod: rest shape, frames, energy, gradient, Hessian, condensation onto its two links,
//! sensitivities, stress. Discrete elastic rods (Bergou et al. 2008, 2010; Megaro et al. 2017, sec. 3.1)
//! with clamps at the midpoints of the first and last edge.
//!
//! # Model
//!
//! N edges on vertices x₀..x_N, e_j = x_{j+1} − x_j, a material frame (m₁, m₂, t) per edge. Edges 0 and
//! N − 1 are rigidly part of links A and B. Internal freedoms, interleaved: θ₁, x₂, θ₂, x₃, …, x_{N−2},
//! θ_{N−2} (4N − 11 numbers). Links move by increments (du, dφ) of [`Pose`](crate::math::Pose); the 12
//! link freedoms of a rod are ordered du_A, dφ_A, du_B, dφ_B. Energies N·mm, forces N, moments N·mm.
//!
//! Every derivative holds in the chart centred at the present state: frames are carried along by parallel
//! transport of their edge and turned by θ, and links by exp(dφ), starting from zero.
//!
//! # Use
//!
//! ```
//! use flexura::math::Pose;
//! use flexura::rod::{Rod, RodMaterial, RodParameters, RodSystem};
//! use nalgebra::{SVector, Vector3};
//!
//! let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * 30.0, Vector3::z(), 0.4, 2.5);
//! let rod = Rod::new(&q, RodMaterial { e_mpa: 1500.0, nu: 0.4 }, 20)?;
//! let mut state = rod.rest_state();
//! let mut system = RodSystem::new(&rod);
//! let a = Pose::rest(Vector3::zeros());
//! let b = Pose::rest(Vector3::x() * 30.0);
//! system.assemble(&rod, &state, &a, &b);
//! let report = system.factor();
//! assert_eq!(report.negative_pivots, 0);
//! let (gradient, hessian) = system.condense();
//! assert!(gradient.norm() < 1e-9 && hessian[(6, 6)] > 0.0);
//! // Move link B by 0.1 mm sideways: the rod follows to first order, then is solved again.
//! let mut d = SVector::<f64, 12>::zeros();
//! d[7] = 0.1;
//! let increment = system.back_substitute(&d).to_vec();
//! let b = b.retract(&Vector3::new(0.0, 0.1, 0.0), &Vector3::zeros());
//! rod.retract(&mut state, &increment, &a, &b)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Per iteration: [`RodSystem::assemble`], [`RodSystem::factor`], [`RodSystem::condense`], solve for the
//! links, [`RodSystem::back_substitute`], [`Rod::retract`]. At an equilibrium of a rod made by
//! [`Rod::with_derivatives`]: [`RodSystem::parameter_columns`], [`RodSystem::internal_sensitivity`] (or, transposed,
//! [`RodSystem::internal_pull_back`]), [`RodSystem::strain_jacobian`], [`RodSystem::edge_jacobian`].
//!
//! # Options
//!
//! [`Rod::with_options`] makes rods of rectangular section, wires whose frames need no joint axis, and rods with
//! [`Corrections`] for transverse shear, width and hindered warping; `docs/rod-model.md` holds them against
//! three-dimensional finite elements. With shear, six internal freedoms more (`shear.rs`), nothing else changes
//! for the caller.

mod adjoint;
mod assemble;
mod centreline;
mod condense;
#[cfg(test)]
mod derivative_tests;
mod expected;
mod options;
mod rest;
mod root;
mod section;
mod sensitivity;
#[cfg(test)]
mod sensitivity_tests;
mod shape;
mod shear;
pub mod single;
mod state;
mod stencil;
mod stress;
mod wagner;
mod weight;

pub use crate::ir::RodModel;
pub use assemble::RodSystem;
pub use centreline::EdgeJacobian;
pub use condense::FactorReport;
pub use expected::RodForces;
pub use options::{Corrections, RestFrames, RodOptions};
pub use rest::{MIN_EDGES, PARAMETERS, RodError, RodParameters};
pub use root::{concentration, extra_length_mm};
pub use section::{RodMaterial, SectionShape, Stiffness, ellipse_stiffness, rectangle_stiffness};
pub use sensitivity::{ParameterMatrix, SensitivityError};
pub use shape::{LARGEST_CURVATURE, LEAST_SLENDERNESS, LEAST_SPEED};
pub use state::{RetractError, RodState};
pub use stress::{
    RodDirections, SECTION_POINTS, STATION_VALUES, StationStrain, StrainJacobian, StressSample,
};

use crate::math::dual::Dual;
use nalgebra::Vector3;
use rest::{RestShape, rest_shape};

/// A rod: its rest shape and stiffnesses, and on demand their derivatives by the 19 parameters.
#[derive(Clone, Debug)]
pub struct Rod {
    parameters: RodParameters,
    material: RodMaterial,
    options: RodOptions,
    edges: usize,
    length: f64,
    rest: RodState,
    /// |ē_j|, mm.
    edge_lengths: Vec<f64>,
    /// Length w_j|ē_j| over which edge j is stretched: 1.5 |ē_j| for the first and last free edge.
    stretch_lengths: Vec<f64>,
    /// Stretch stiffness EA per edge, N.
    ea: Vec<f64>,
    /// Voronoi lengths per vertex (entry 0 unused), mm.
    voronoi: Vec<f64>,
    /// κ̄₁, κ̄₂, τ̄ per vertex (entry 0 unused), rad.
    rest_measures: Vec<[f64; 3]>,
    /// EI₁/l̄, EI₂/l̄, GJ/l̄ per vertex (entry 0 unused), N·mm.
    vertex_stiffness: Vec<[f64; 3]>,
    /// Half widths (a, b) per edge, mm.
    sections: Vec<[f64; 2]>,
    /// Shear compliance per edge, mm/N; empty without shear.
    shear: Vec<f64>,
    /// [`wagner::Form`] per vertex (entry 0 unused); empty without Wagner's strain.
    wagner: Vec<wagner::Form>,
    /// Of a rectangle, γ² per twist rate at the boundary points with its derivatives by a and b: once, of a
    /// tapered rod per station. Empty for ellipses.
    torsion: Vec<[[f64; 3]; SECTION_POINTS]>,
    derivatives: Option<Box<RestShape<Dual<PARAMETERS>>>>,
}

/// Factor on the rest length over which edge `j` of `n` is stretched: the first and last free edge carry
/// the half edges inside the clamps too, so that the axial compliance is L/EA at every N.
fn stretch_factor(j: usize, n: usize) -> f64 {
    if j == 1 || j == n - 2 { 1.5 } else { 1.0 }
}

impl Rod {
    /// A plain rod of elliptic section with `edges` edges.
    ///
    /// # Errors
    /// When the rest shape cannot be built: see [`RodError`].
    pub fn new(q: &RodParameters, material: RodMaterial, edges: usize) -> Result<Self, RodError> {
        Self::with_options(q, material, edges, RodOptions::default(), false)
    }

    /// As [`Self::new`], with the derivatives of the rest shape that the sensitivities need.
    ///
    /// # Errors
    /// See [`RodError`].
    pub fn with_derivatives(
        q: &RodParameters,
        material: RodMaterial,
        edges: usize,
    ) -> Result<Self, RodError> {
        Self::with_options(q, material, edges, RodOptions::default(), true)
    }

    /// A rod of any section, frames and theory, with the derivatives of its rest shape if wanted.
    ///
    /// # Errors
    /// See [`RodError`].
    pub fn with_options(
        q: &RodParameters,
        material: RodMaterial,
        edges: usize,
        options: RodOptions,
        derivatives: bool,
    ) -> Result<Self, RodError> {
        let mut rod = Self::build(q, material, edges, options, None)?;
        if derivatives {
            let plain = q.to_array();
            let dual: [Dual<PARAMETERS>; PARAMETERS] = std::array::from_fn(|i| Dual::variable(plain[i], i));
            rod.derivatives = Some(Box::new(rest_shape(&dual, &material, edges, &options, None)?));
        }
        Ok(rod)
    }

    /// A plain rod with section stiffnesses given instead of computed from a and b (which then only serve
    /// the stresses). It has no derivatives by its parameters.
    ///
    /// # Errors
    /// See [`RodError`].
    pub fn with_stiffness(
        q: &RodParameters,
        material: RodMaterial,
        edges: usize,
        stiffness: Stiffness,
    ) -> Result<Self, RodError> {
        Self::build(q, material, edges, RodOptions::default(), Some(stiffness))
    }

    fn build(
        q: &RodParameters,
        material: RodMaterial,
        edges: usize,
        options: RodOptions,
        stiffness: Option<Stiffness>,
    ) -> Result<Self, RodError> {
        let shape = rest_shape::<f64>(&q.to_array(), &material, edges, &options, stiffness)?;
        let torsion = match (options.section, options.taper) {
            (SectionShape::Ellipse, _) => Vec::new(),
            (SectionShape::Rectangle, false) => vec![section::rectangle_shear_forms(q.a, q.b)],
            (SectionShape::Rectangle, true) => (0..=edges)
                .map(|k| stress::station_widths(&shape.sections, k))
                .map(|[a, b]| section::rectangle_shear_forms(a, b))
                .collect(),
        };
        let vertex_stiffness = (0..edges)
            .map(|i| {
                if i == 0 {
                    return [0.0; 3];
                }
                let (s, r) = (&shape.stiffness[i - 1], &shape.stiffness[i]);
                [s.ei1 + r.ei1, s.ei2 + r.ei2, s.gj + r.gj].map(|x| 0.5 * x / shape.voronoi[i])
            })
            .collect();
        let wagner_lengths = shape.voronoi.clone();
        let stretch_lengths =
            shape.edge_lengths.iter().enumerate().map(|(j, l)| l * stretch_factor(j, edges)).collect();
        Ok(Self {
            parameters: *q,
            material,
            options,
            edges,
            length: shape.length,
            rest: RodState {
                vertices: shape.vertices.iter().map(|v| Vector3::from(*v)).collect(),
                m1: shape.m1.iter().map(|v| Vector3::from(*v)).collect(),
                slip: Vector3::zeros(),
                force: Vector3::zeros(),
            },
            stretch_lengths,
            ea: shape.stiffness.iter().map(|s| s.ea).collect(),
            edge_lengths: shape.edge_lengths,
            voronoi: shape.voronoi,
            rest_measures: shape.measures,
            vertex_stiffness,
            sections: shape.sections,
            shear: shape.shear,
            wagner: wagner::forms(&shape.polar, &wagner_lengths),
            torsion,
            derivatives: None,
        })
    }

    /// The parameters it was built from.
    pub fn parameters(&self) -> &RodParameters {
        &self.parameters
    }

    /// Its material.
    pub fn material(&self) -> &RodMaterial {
        &self.material
    }

    /// Number of edges N.
    pub fn edges(&self) -> usize {
        self.edges
    }

    /// Section, rest frames and corrections.
    pub fn options(&self) -> &RodOptions {
        &self.options
    }

    /// Number of internal freedoms: 4N − 11, and with shear six more at the end, the increments of
    /// [`RodState::slip`] and [`RodState::force`].
    pub fn internal_freedoms(&self) -> usize {
        self.band_freedoms() + if self.shear.is_empty() { 0 } else { shear::FREEDOMS }
    }

    /// Those in the band, θ₁, x₂, …
    fn band_freedoms(&self) -> usize {
        4 * self.edges - 11
    }

    /// Arc length of the rest curve between the attachment planes, mm.
    pub fn length_mm(&self) -> f64 {
        self.length
    }

    /// Edge length h = L/(N − 1), mm.
    pub fn edge_length_mm(&self) -> f64 {
        self.length / (self.edges - 1) as f64
    }

    /// Least bending stiffness over the rod, N·mm².
    pub fn least_bending_stiffness(&self) -> f64 {
        (1..self.edges)
            .map(|i| self.voronoi[i] * self.vertex_stiffness[i][0].min(self.vertex_stiffness[i][1]))
            .fold(f64::INFINITY, f64::min)
    }

    /// Largest bending stiffness over the rod, N·mm².
    pub fn largest_bending_stiffness(&self) -> f64 {
        (1..self.edges)
            .map(|i| self.voronoi[i] * self.vertex_stiffness[i][0].max(self.vertex_stiffness[i][1]))
            .fold(0.0, f64::max)
    }

    /// The unstressed state, with both links in their rest pose.
    pub fn rest_state(&self) -> RodState {
        self.rest.clone()
    }
}
