//! Strains and von Mises stresses of an elliptic rod, with total derivatives.
//!
//! Megaro et al. 2017, eqs. 8–16, with three corrections: curvature is integrated curvature over the *rest*
//! Voronoi length (it already contains the stretch of the centre line, which eq. 11 as printed would count
//! twice), fibres are measured by their own rest length (1 − κ̄·c), and the attachment planes, where the
//! largest stress sits but no vertex, are reached by linear extrapolation of the strain measures.
//!
//! ε_z(c) = (ε_cl − (κ − κ̄)·c)/(1 − κ̄·c), twist by St Venant's warping ψ = (b² − a²)/(a² + b²) xy, and
//! σ_v² = (Eε_z)² + 3σ_s².

use super::assemble::{FIRST_INTERNAL, RodSystem, end_coordinates, slot_signs};
use super::sensitivity::SensitivityError;
use super::{PARAMETERS, Rod, stretch_factor};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Points round a section at which stress is evaluated; a multiple of four, so that both axes are hit.
pub const SECTION_POINTS: usize = 32;
/// Strain measures and section data at a station, in the order of the fields of [`StationStrain`].
pub const STATION_VALUES: usize = 9;

/// Strain measures at one station of a rod.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StationStrain {
    /// Stretch of the centre line.
    pub stretch: f64,
    /// Curvature along m₁, 1/mm.
    pub kappa1: f64,
    /// Curvature along m₂, 1/mm.
    pub kappa2: f64,
    /// Twist rate, rad/mm.
    pub twist: f64,
    /// Rest curvature along m₁, 1/mm.
    pub rest_kappa1: f64,
    /// Rest curvature along m₂, 1/mm.
    pub rest_kappa2: f64,
    /// Rest twist rate, rad/mm.
    pub rest_twist: f64,
    /// Semi-axis along m₁, mm.
    pub a: f64,
    /// Semi-axis along m₂, mm.
    pub b: f64,
}

/// Stress at one point of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressSample {
    /// Station: 0 and N are the attachment planes, 1..N the inner vertices.
    pub station: usize,
    /// Point k at (a cos 2πk/32, b sin 2πk/32) along (m₁, m₂).
    pub point: usize,
    /// von Mises stress, MPa.
    pub von_mises_mpa: f64,
    /// Axial stress E ε_z, MPa (tension positive).
    pub axial_mpa: f64,
}

impl StationStrain {
    fn from_values(v: [f64; STATION_VALUES]) -> Self {
        let [stretch, kappa1, kappa2, twist, rest_kappa1, rest_kappa2, rest_twist, a, b] = v;
        Self { stretch, kappa1, kappa2, twist, rest_kappa1, rest_kappa2, rest_twist, a, b }
    }

    fn values(&self) -> [f64; STATION_VALUES] {
        [
            self.stretch,
            self.kappa1,
            self.kappa2,
            self.twist,
            self.rest_kappa1,
            self.rest_kappa2,
            self.rest_twist,
            self.a,
            self.b,
        ]
    }

    /// Axial strain ε_z at c = (x along m₁, y along m₂), mm.
    pub fn axial_strain(&self, x: f64, y: f64) -> f64 {
        let change = (self.kappa1 - self.rest_kappa1) * x + (self.kappa2 - self.rest_kappa2) * y;
        (self.stretch - change) / (1.0 - self.rest_kappa1 * x - self.rest_kappa2 * y)
    }

    /// Engineering shear strains (γ_xz, γ_yz) at (x, y), mm.
    pub fn shear_strains(&self, x: f64, y: f64) -> [f64; 2] {
        let rate = self.twist - self.rest_twist;
        let (a2, b2) = (self.a * self.a, self.b * self.b);
        // ψ = w xy with w = (b² − a²)/(a² + b²): γ = rate (∂ψ/∂x − y, ∂ψ/∂y + x).
        [-2.0 * a2 / (a2 + b2) * y * rate, 2.0 * b2 / (a2 + b2) * x * rate]
    }

    /// Axial, von Mises stress at the section point at angle `phi`, with the derivative of the latter by
    /// the nine station values (zero where the stress vanishes).
    fn stress(&self, phi: f64, e: f64, g: f64) -> (f64, f64, [f64; STATION_VALUES]) {
        let (c, s) = (phi.cos(), phi.sin());
        let (x, y) = (self.a * c, self.b * s);
        let fibre = 1.0 - self.rest_kappa1 * x - self.rest_kappa2 * y;
        let strain = self.axial_strain(x, y);
        let axial = e * strain;
        let [gx, gy] = self.shear_strains(x, y);
        let shear2 = g * g * (gx * gx + gy * gy);
        let mises = (axial * axial + 3.0 * shear2).sqrt();
        let mut d = [0.0; STATION_VALUES];
        if mises == 0.0 {
            return (axial, mises, d);
        }
        // ε_z fibre = stretch − (κ − κ̄)·c.
        let w = e * axial / (mises * fibre);
        d[0] = w;
        d[1] = -w * x;
        d[2] = -w * y;
        d[4] = w * x * (1.0 + strain);
        d[5] = w * y * (1.0 + strain);
        d[7] = w * c * (strain * self.rest_kappa1 - (self.kappa1 - self.rest_kappa1));
        d[8] = w * s * (strain * self.rest_kappa2 - (self.kappa2 - self.rest_kappa2));
        // ½ d(3σ_s²)/σ_v, γ² = 4 rate² a²b² (a² s² + b² c²)/(a² + b²)².
        let rate = self.twist - self.rest_twist;
        let (a, b) = (self.a, self.b);
        let (a2, b2) = (a * a, b * b);
        let sum = a2 + b2;
        let form = a2 * s * s + b2 * c * c;
        let k = 6.0 * g * g / mises;
        let base = a2 * b2 / (sum * sum);
        d[3] = k * 2.0 * rate * base * form;
        d[6] = -d[3];
        let r2 = k * rate * rate;
        d[7] += r2 * (2.0 * a * b2 / (sum * sum) * form * (1.0 - 2.0 * a2 / sum) + base * 2.0 * a * s * s);
        d[8] += r2 * (2.0 * b * a2 / (sum * sum) * form * (1.0 - 2.0 * b2 / sum) + base * 2.0 * b * c * c);
        (axial, mises, d)
    }
}

/// Angle of section point `k`.
fn section_angle(k: usize) -> f64 {
    TAU * k as f64 / SECTION_POINTS as f64
}

/// Weights of the two nearest free edges in the stretch at inner vertex `i` of `n` edges. The strain of an
/// edge is its tension over EA, and the tension belongs to the edge's own direction, at its middle: between
/// two free edges the mean, next to a clamp a linear extrapolation.
fn stretch_weights(i: usize, n: usize) -> [(usize, f64); 2] {
    if i == 1 {
        [(1, 1.5), (2, -0.5)]
    } else if i == n - 1 {
        [(n - 2, 1.5), (n - 3, -0.5)]
    } else {
        [(i - 1, 0.5), (i, 0.5)]
    }
}

impl Rod {
    /// Position of station `k` along the rest length, mm.
    pub fn station_position_mm(&self, k: usize) -> f64 {
        ((k as f64 - 0.5) * self.edge_length_mm()).clamp(0.0, self.length)
    }

    /// Quadrature weights of the stations (trapezia over the rest length), of sum 1.
    pub fn station_weights(&self) -> Vec<f64> {
        let n = self.edges;
        let s: Vec<f64> = (0..=n).map(|k| self.station_position_mm(k)).collect();
        (0..=n).map(|k| 0.5 * (s[(k + 1).min(n)] - s[k.saturating_sub(1)]) / self.length).collect()
    }

    /// von Mises and axial stress at point `point` of a section with these strains.
    pub fn stress_sample(
        &self,
        strains: &[StationStrain],
        station: usize,
        point: usize,
    ) -> Option<StressSample> {
        let (e, g) = (self.material.e_mpa, self.material.shear_modulus_mpa());
        let (axial, mises, _) = strains.get(station)?.stress(section_angle(point), e, g);
        Some(StressSample { station, point, von_mises_mpa: mises, axial_mpa: axial })
    }

    /// von Mises stresses, MPa, at the [`SECTION_POINTS`] points of every station.
    pub fn stresses(&self, strains: &[StationStrain]) -> Vec<[f64; SECTION_POINTS]> {
        let (e, g) = (self.material.e_mpa, self.material.shear_modulus_mpa());
        strains.iter().map(|s| std::array::from_fn(|k| s.stress(section_angle(k), e, g).1)).collect()
    }

    /// The largest von Mises stress; of equals the first.
    pub fn largest_stress(&self, strains: &[StationStrain]) -> Option<StressSample> {
        let mut best: Option<StressSample> = None;
        for station in 0..strains.len() {
            for point in 0..SECTION_POINTS {
                let sample = self.stress_sample(strains, station, point);
                if let Some(s) = sample {
                    if best.is_none_or(|b| s.von_mises_mpa > b.von_mises_mpa) {
                        best = sample;
                    }
                }
            }
        }
        best
    }
}

/// Extrapolates station values (inner stations filled) to the two attachment planes, half an edge outside.
fn extrapolate(values: &mut [[f64; STATION_VALUES]]) {
    let n = values.len() - 1;
    for (to, near, far) in [(0, 1, 2), (n, n - 1, n - 2)] {
        values[to] = std::array::from_fn(|c| 1.5 * values[near][c] - 0.5 * values[far][c]);
    }
}

impl RodSystem {
    /// Strain measures of the last assembled state at the N + 1 stations: plane A, vertices 1..N, plane B.
    pub fn strains(&self, rod: &Rod) -> Vec<StationStrain> {
        let n = self.n;
        let strain = |j: usize| (self.frames[j].l - rod.edge_lengths[j]) / rod.stretch_lengths[j];
        let mut values = vec![[0.0; STATION_VALUES]; n + 1];
        for (i, v) in values.iter_mut().enumerate().take(n).skip(1) {
            let [(j0, w0), (j1, w1)] = stretch_weights(i, n);
            let r = 1.0 / rod.voronoi[i];
            let (now, rest) = (&self.measures[i].value, &rod.rest_measures[i]);
            let (s0, s1) = (&rod.sections[i - 1], &rod.sections[i]);
            *v = [
                w0 * strain(j0) + w1 * strain(j1),
                now[0] * r,
                now[1] * r,
                now[2] * r,
                rest[0] * r,
                rest[1] * r,
                rest[2] * r,
                0.5 * (s0[0] + s1[0]),
                0.5 * (s0[1] + s1[1]),
            ];
        }
        extrapolate(&mut values);
        values.into_iter().map(StationStrain::from_values).collect()
    }

    /// Total derivatives of the strain measures for n directions: `d_internal` is (4N − 11) by n as from
    /// [`Self::internal_sensitivity`], `d_link` 12 by n, `dq` 17 by n.
    ///
    /// # Errors
    /// Without derivatives or parameter columns, or with matrices of the wrong shape.
    pub fn strain_derivatives(
        &self,
        rod: &Rod,
        d_internal: &DMatrix<f64>,
        d_link: &DMatrix<f64>,
        dq: &DMatrix<f64>,
    ) -> Result<StrainDerivatives, SensitivityError> {
        let rest = rod.derivatives.as_deref().ok_or(SensitivityError::NoDerivatives)?;
        let columns = self.columns.as_deref().ok_or(SensitivityError::NoColumns)?;
        let (n, directions) = (self.n, d_link.ncols());
        let shaped = |m: &DMatrix<f64>, rows: usize| m.nrows() == rows && m.ncols() == directions;
        if !shaped(d_internal, self.factors.order()) || !shaped(d_link, 12) || !shaped(dq, PARAMETERS) {
            return Err(SensitivityError::Shape);
        }
        let strains = self.strains(rod);
        let mut data = DMatrix::zeros(STATION_VALUES * (n + 1), directions);
        let mut full = vec![0.0; 4 * n + 3];
        let mut local = vec![[0.0; 4]; n];
        let mut values = vec![[0.0; STATION_VALUES]; n + 1];
        for p in 0..directions {
            let q = dq.column(p);
            let along =
                |eps: &[f64; PARAMETERS]| -> f64 { eps.iter().zip(q.iter()).map(|(a, b)| a * b).sum() };
            for (to, from) in full[FIRST_INTERNAL..].iter_mut().zip(d_internal.column(p).iter()) {
                *to = *from;
            }
            for end in 0..2 {
                let carried = self.jacobians[end] * d_link.fixed_view::<6, 1>(6 * end, p)
                    + columns.ends[end] * dq.fixed_view::<PARAMETERS, 1>(0, p);
                for (i, at) in end_coordinates(end, n).into_iter().enumerate() {
                    full[at] = carried[i];
                }
            }
            for (j, to) in local.iter_mut().enumerate() {
                let signs = slot_signs(j, n);
                let de = nalgebra::Vector3::from_fn(|c, _| {
                    signs[0] * full[4 * j + c] + signs[1] * full[4 * j + 4 + c]
                });
                let v = self.edge_basis(j).transpose() * de;
                *to = [v.x, v.y, v.z, full[4 * j + 3]];
            }
            let d_strain = |j: usize| {
                let (l, l0) = (self.frames[j].l, rod.edge_lengths[j]);
                let relative = local[j][2] - along(&rest.edge_lengths[j].eps) / l0;
                relative * l / (l0 * stretch_factor(j, n))
            };
            for (i, to) in values.iter_mut().enumerate().take(n).skip(1) {
                let [(j0, w0), (j1, w1)] = stretch_weights(i, n);
                let v = rest.voronoi[i];
                let (r, dv) = (1.0 / v.re, along(&v.eps) / v.re);
                let (m, now) = (&self.measures[i], strains[i].values());
                to[0] = w0 * d_strain(j0) + w1 * d_strain(j1);
                for f in 0..3 {
                    let sum: f64 =
                        (0..4).map(|c| m.before[f][c] * local[i - 1][c] + m.after[f][c] * local[i][c]).sum();
                    to[1 + f] = sum * r - now[1 + f] * dv;
                    to[4 + f] = along(&rest.measures[i][f].eps) * r - now[4 + f] * dv;
                }
                for f in 0..2 {
                    let (s0, s1) = (&rest.sections[i - 1][f], &rest.sections[i][f]);
                    to[7 + f] = 0.5 * (along(&s0.eps) + along(&s1.eps));
                }
            }
            extrapolate(&mut values);
            for (k, v) in values.iter().enumerate() {
                for (c, x) in v.iter().enumerate() {
                    data[(STATION_VALUES * k + c, p)] = *x;
                }
            }
        }
        Ok(StrainDerivatives { data, strains })
    }
}

/// Strain measures of a state with their total derivatives.
#[derive(Clone, Debug)]
pub struct StrainDerivatives {
    /// Rows: nine values per station; columns: directions.
    data: DMatrix<f64>,
    strains: Vec<StationStrain>,
}

impl StrainDerivatives {
    /// The strain measures themselves.
    pub fn strains(&self) -> &[StationStrain] {
        &self.strains
    }

    /// Derivatives of the nine values of [`StationStrain`] at a station (9 by n), if there is such a station.
    pub fn station(&self, station: usize) -> Option<nalgebra::DMatrixView<'_, f64>> {
        (station < self.strains.len())
            .then(|| self.data.rows(STATION_VALUES * station, STATION_VALUES))
            .map(|rows| rows.into())
    }

    /// von Mises stress (MPa) at a sample and its total derivatives by the n directions.
    pub fn stress(&self, rod: &Rod, station: usize, point: usize) -> Option<(f64, DVector<f64>)> {
        let strain = self.strains.get(station)?;
        let (e, g) = (rod.material.e_mpa, rod.material.shear_modulus_mpa());
        let (_, mises, d) = strain.stress(section_angle(point), e, g);
        let rows = self.data.rows(STATION_VALUES * station, STATION_VALUES);
        Some((mises, rows.tr_mul(&DVector::from_column_slice(&d))))
    }
}
