//! Strains and von Mises stresses of a rod, with total derivatives.
//!
//! Megaro et al. 2017, eqs. 8–16, with three corrections: curvature is integrated curvature over the *rest*
//! Voronoi length (it already contains the stretch of the centre line, which eq. 11 as printed would count
//! twice), fibres are measured by their own rest length (1 − κ̄·c), and the attachment planes, where the
//! largest stress sits but no vertex, are reached by linear extrapolation of the strain measures.
//!
//! ε_z(c) = (ε_cl − (κ − κ̄)·c + ½(τ² − τ̄²)|c|²)/(1 − κ̄·c), the last term only with Wagner's strain, twist by St Venant's warping (of the ellipse ψ = (b² − a²)/(a² + b²) xy),
//! and σ_v² = (Eε_z)² + 3σ_s². Transverse shear is left out: it vanishes where bending is largest.

use super::assemble::{FIRST_INTERNAL, RodSystem, end_coordinates, slot_signs};
use super::sensitivity::{FIRST_PARAMETER, SensitivityError, WIDTH};
use super::{PARAMETERS, Rod, stretch_factor};
use nalgebra::SVector;

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
    /// Half width along m₁, mm.
    pub a: f64,
    /// Half width along m₂, mm.
    pub b: f64,
    /// Whether fibres stretch by ½(τ² − τ̄²) r² ([`Corrections::wagner`](super::Corrections::wagner)).
    pub wagner: bool,
}

/// Stress at one point of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressSample {
    /// Station: 0 and N are the attachment planes, 1..N the inner vertices.
    pub station: usize,
    /// Point of the boundary: see [`SectionShape::boundary`](super::SectionShape::boundary).
    pub point: usize,
    /// von Mises stress, MPa.
    pub von_mises_mpa: f64,
    /// Axial stress E ε_z, MPa (tension positive).
    pub axial_mpa: f64,
}

impl StationStrain {
    fn from_values(v: [f64; STATION_VALUES], wagner: bool) -> Self {
        let [stretch, kappa1, kappa2, twist, rest_kappa1, rest_kappa2, rest_twist, a, b] = v;
        Self { stretch, kappa1, kappa2, twist, rest_kappa1, rest_kappa2, rest_twist, a, b, wagner }
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
    #[inline(always)]
    pub fn axial_strain(&self, x: f64, y: f64) -> f64 {
        let change = (self.kappa1 - self.rest_kappa1) * x + (self.kappa2 - self.rest_kappa2) * y;
        let helix = if self.wagner { self.helix() * (x * x + y * y) } else { 0.0 };
        (self.stretch - change + helix) / (1.0 - self.rest_kappa1 * x - self.rest_kappa2 * y)
    }

    /// ½(τ² − τ̄²), 1/mm².
    #[inline(always)]
    fn helix(&self) -> f64 {
        0.5 * (self.twist * self.twist - self.rest_twist * self.rest_twist)
    }

    /// Engineering shear strains (γ_xz, γ_yz) of an elliptic section at (x, y), mm.
    #[inline(always)]
    pub fn shear_strains(&self, x: f64, y: f64) -> [f64; 2] {
        let rate = self.twist - self.rest_twist;
        let (a2, b2) = (self.a * self.a, self.b * self.b);
        // ψ = w xy with w = (b² − a²)/(a² + b²): γ = rate (∂ψ/∂x − y, ∂ψ/∂y + x).
        [-2.0 * a2 / (a2 + b2) * y * rate, 2.0 * b2 / (a2 + b2) * x * rate]
    }

    /// Axial and von Mises stress at a boundary point.
    fn stress(&self, point: &BoundaryPoint, e: f64, g: f64) -> (f64, f64) {
        match &point.shear {
            None => self.ellipse_stress((point.x, point.y), e, g),
            Some([form, ..]) => self.formed_stress((point.x, point.y), *form, e, g),
        }
    }

    /// That of an ellipse at (a c, b s).
    #[inline(always)]
    fn ellipse_stress(&self, (c, s): (f64, f64), e: f64, g: f64) -> (f64, f64) {
        let (x, y) = (self.a * c, self.b * s);
        let axial = e * self.axial_strain(x, y);
        let [gx, gy] = self.shear_strains(x, y);
        (axial, (axial * axial + 3.0 * g * g * (gx * gx + gy * gy)).sqrt())
    }

    /// That with γ² per twist rate given, mm².
    fn formed_stress(&self, (c, s): (f64, f64), form: f64, e: f64, g: f64) -> (f64, f64) {
        let axial = e * self.axial_strain(self.a * c, self.b * s);
        let shear = g * (self.twist - self.rest_twist);
        (axial, (axial * axial + 3.0 * shear * shear * form).sqrt())
    }

    /// von Mises stress with its derivative by the nine station values (zero where it vanishes).
    fn stress_gradient(&self, point: &BoundaryPoint, e: f64, g: f64) -> (f64, [f64; STATION_VALUES]) {
        let (c, s) = (point.x, point.y);
        let (x, y) = (self.a * c, self.b * s);
        let fibre = 1.0 - self.rest_kappa1 * x - self.rest_kappa2 * y;
        let (axial, mises) = self.stress(point, e, g);
        let strain = axial / e;
        let mut d = [0.0; STATION_VALUES];
        if mises == 0.0 {
            return (mises, d);
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
        if self.wagner {
            let r2 = x * x + y * y;
            d[3] = w * self.twist * r2;
            d[6] = -w * self.rest_twist * r2;
            d[7] += 2.0 * w * self.helix() * x * c;
            d[8] += 2.0 * w * self.helix() * y * s;
        }
        if let Some([form, by_a, by_b]) = &point.shear {
            let rate = self.twist - self.rest_twist;
            let k = 3.0 * g * g * rate / mises;
            d[3] += k * form;
            d[6] -= k * form;
            d[7] += 0.5 * k * rate * by_a;
            d[8] += 0.5 * k * rate * by_b;
            return (mises, d);
        }
        // ½ d(3σ_s²)/σ_v, γ² = 4 rate² a²b² (a² s² + b² c²)/(a² + b²)².
        let rate = self.twist - self.rest_twist;
        let (a, b) = (self.a, self.b);
        let (a2, b2) = (a * a, b * b);
        let sum = a2 + b2;
        let form = a2 * s * s + b2 * c * c;
        let k = 6.0 * g * g / mises;
        let base = a2 * b2 / (sum * sum);
        let by_rate = k * 2.0 * rate * base * form;
        d[3] += by_rate;
        d[6] -= by_rate;
        let r2 = k * rate * rate;
        d[7] += r2 * (2.0 * a * b2 / (sum * sum) * form * (1.0 - 2.0 * a2 / sum) + base * 2.0 * a * s * s);
        d[8] += r2 * (2.0 * b * a2 / (sum * sum) * form * (1.0 - 2.0 * b2 / sum) + base * 2.0 * b * c * c);
        (mises, d)
    }
}

/// A point of a section's boundary.
struct BoundaryPoint {
    /// Position in half widths.
    x: f64,
    y: f64,
    /// γ² per twist rate with its derivatives by a and b; of an ellipse in closed form.
    shear: Option<[f64; 3]>,
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

    /// Half widths (a, b) at station `k`, mm.
    pub fn station_half_widths_mm(&self, k: usize) -> [f64; 2] {
        station_widths(&self.sections, k)
    }

    /// Half widths (a, b) at the middle of edge `j`, mm.
    pub fn edge_half_widths_mm(&self, j: usize) -> [f64; 2] {
        self.sections.get(j).copied().unwrap_or_default()
    }

    /// Share of the widths at end B in those of edge `j`: zero unless the rod is tapered.
    pub fn taper_at_edge(&self, j: usize) -> f64 {
        if self.options().taper { j as f64 / (self.edges - 1) as f64 } else { 0.0 }
    }

    /// Quadrature weights of the stations (trapezia over the rest length), of sum 1.
    pub fn station_weights(&self) -> Vec<f64> {
        let n = self.edges;
        let s: Vec<f64> = (0..=n).map(|k| self.station_position_mm(k)).collect();
        (0..=n).map(|k| 0.5 * (s[(k + 1).min(n)] - s[k.saturating_sub(1)]) / self.length).collect()
    }

    /// Of a rectangle, γ² per twist rate round the section at a station.
    fn shear_forms(&self, station: usize) -> Option<&[[f64; 3]; SECTION_POINTS]> {
        self.torsion.get(station.min(self.torsion.len().saturating_sub(1)))
    }

    fn boundary_point(&self, station: usize, k: usize) -> BoundaryPoint {
        let (x, y) = self.options.section.boundary(k);
        let shear = self.shear_forms(station).map(|forms| forms[k % SECTION_POINTS]);
        BoundaryPoint { x, y, shear }
    }

    /// von Mises and axial stress at point `point` of a section with these strains.
    pub fn stress_sample(
        &self,
        strains: &[StationStrain],
        station: usize,
        point: usize,
    ) -> Option<StressSample> {
        let (e, g) = (self.material.e_mpa, self.material.shear_modulus_mpa());
        let (axial, mises) = strains.get(station)?.stress(&self.boundary_point(station, point), e, g);
        Some(StressSample { station, point, von_mises_mpa: mises, axial_mpa: axial })
    }

    /// von Mises stresses, MPa, at the [`SECTION_POINTS`] points of every station.
    pub fn stresses(&self, strains: &[StationStrain]) -> Vec<[f64; SECTION_POINTS]> {
        let (e, g) = (self.material.e_mpa, self.material.shear_modulus_mpa());
        let points: [(f64, f64); SECTION_POINTS] = std::array::from_fn(|k| self.options.section.boundary(k));
        let row = |(station, s): (usize, &StationStrain)| match self.shear_forms(station) {
            None => points.map(|at| s.ellipse_stress(at, e, g).1),
            Some(forms) => std::array::from_fn(|k| s.formed_stress(points[k], forms[k][0], e, g).1),
        };
        strains.iter().enumerate().map(row).collect()
    }

    /// The largest von Mises stress; of equals the first.
    pub fn largest_stress(&self, strains: &[StationStrain]) -> Option<StressSample> {
        let mut best: Option<(usize, usize, f64)> = None;
        for (station, row) in self.stresses(strains).iter().enumerate() {
            for (point, &stress) in row.iter().enumerate() {
                if best.is_none_or(|b| stress > b.2) {
                    best = Some((station, point, stress));
                }
            }
        }
        best.and_then(|(station, point, _)| self.stress_sample(strains, station, point))
    }
}

/// Half widths at station `k` from those of the edges: at a vertex the mean of its two edges, at the attachment
/// planes those of the clamped ones, whose middles lie there.
pub(crate) fn station_widths(sections: &[[f64; 2]], k: usize) -> [f64; 2] {
    let at = |j: usize| sections.get(j.min(sections.len().saturating_sub(1))).copied().unwrap_or_default();
    if k == 0 || k >= sections.len() {
        return at(k);
    }
    let (s, r) = (at(k - 1), at(k));
    [0.5 * (s[0] + r[0]), 0.5 * (s[1] + r[1])]
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
        values.into_iter().map(|v| StationStrain::from_values(v, rod.options.corrections.wagner)).collect()
    }

    /// Derivatives of the strain measures of the last assembled equilibrium by the rod's own 31 directions:
    /// the 12 link freedoms, then the 19 parameters, the inside of the rod following both.
    ///
    /// # Errors
    /// Without derivatives, or without parameter columns for this state.
    pub fn strain_jacobian(&self, rod: &Rod) -> Result<StrainJacobian, SensitivityError> {
        let rest = rod.derivatives.as_deref().ok_or(SensitivityError::NoDerivatives)?;
        let columns = self.columns.as_deref().ok_or(SensitivityError::NoColumns)?;
        let n = self.n;
        let mut full = vec![[0.0; WIDTH]; 4 * n + 3];
        for (to, from) in full[FIRST_INTERNAL..4 * n - 4].iter_mut().zip(&columns.solved) {
            *to = from.map(|x| -x);
        }
        for end in 0..2 {
            for (i, at) in end_coordinates(end, n).into_iter().enumerate() {
                let mut row = [0.0; WIDTH];
                for c in 0..6 {
                    row[6 * end + c] = self.jacobians[end][(i, c)];
                }
                for c in 0..PARAMETERS {
                    row[FIRST_PARAMETER + c] = columns.ends[end][(i, c)];
                }
                if let (1, Some(slip)) = (end, &columns.slip) {
                    // Link B carries its end of the chain less the slip.
                    let by_b: [f64; 3] = std::array::from_fn(|k| row[6 + k]);
                    for (c, to) in row.iter_mut().enumerate().take(slip.ncols()) {
                        for (k, d) in by_b.iter().enumerate() {
                            *to -= d * slip[(k, c)];
                        }
                    }
                }
                full[at] = row;
            }
        }
        let mut local = vec![[[0.0; WIDTH]; 4]; n];
        for (j, to) in local.iter_mut().enumerate() {
            let basis = self.edge_basis(j);
            for (s, sign) in slot_signs(j, n).into_iter().enumerate() {
                for r in 0..3 {
                    for (c, row) in to.iter_mut().enumerate().take(3) {
                        add_scaled(row, sign * basis[(r, c)], &full[4 * (j + s) + r]);
                    }
                }
            }
            to[3] = full[4 * j + 3];
        }
        // Strains of the free edges: (|e|/|ē| − 1)/w.
        let mut stretch = vec![[0.0; WIDTH]; n];
        for (j, to) in stretch.iter_mut().enumerate().take(n - 1).skip(1) {
            let (l, l0) = (self.frames[j].l, &rest.edge_lengths[j]);
            let scale = l / (l0.re * stretch_factor(j, n));
            add_scaled(to, scale, &local[j][2]);
            add_parameters(to, -scale / l0.re, &l0.eps);
        }
        let strains = self.strains(rod);
        let mut rows = vec![[[0.0; WIDTH]; STATION_VALUES]; n + 1];
        for (i, to) in rows.iter_mut().enumerate().take(n).skip(1) {
            let v = &rest.voronoi[i];
            let (r, now) = (1.0 / v.re, strains[i].values());
            for (j, w) in stretch_weights(i, n) {
                add_scaled(&mut to[0], w, &stretch[j]);
            }
            let m = &self.measures[i];
            for f in 0..3 {
                for (gradient, edge) in [(&m.before[f], i - 1), (&m.after[f], i)] {
                    for (g, row) in gradient.iter().zip(&local[edge]) {
                        add_scaled(&mut to[1 + f], g * r, row);
                    }
                }
                add_parameters(&mut to[1 + f], -now[1 + f] * r, &v.eps);
                add_parameters(&mut to[4 + f], r, &rest.measures[i][f].eps);
                add_parameters(&mut to[4 + f], -now[4 + f] * r, &v.eps);
            }
            for f in 0..2 {
                for s in [&rest.sections[i - 1][f], &rest.sections[i][f]] {
                    add_parameters(&mut to[7 + f], 0.5, &s.eps);
                }
            }
        }
        for (to, near, far) in [(0, 1, 2), (n, n - 1, n - 2)] {
            rows[to] = std::array::from_fn(|c| {
                std::array::from_fn(|d| 1.5 * rows[near][c][d] - 0.5 * rows[far][c][d])
            });
        }
        Ok(StrainJacobian { rows, strains })
    }
}

fn add_scaled(to: &mut [f64; WIDTH], s: f64, from: &[f64; WIDTH]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += s * f;
    }
}

fn add_parameters(to: &mut [f64; WIDTH], s: f64, from: &[f64; PARAMETERS]) {
    for (t, f) in to[FIRST_PARAMETER..].iter_mut().zip(from) {
        *t += s * f;
    }
}

/// Strain measures of an equilibrium with their derivatives by the rod's 29 own directions, which the
/// caller chains with dz/dp (12 by n) and dq/dp (19 by n): sums over many samples first, then once.
#[derive(Clone, Debug)]
pub struct StrainJacobian {
    rows: Vec<[[f64; WIDTH]; STATION_VALUES]>,
    strains: Vec<StationStrain>,
}

impl StrainJacobian {
    /// The strain measures themselves.
    pub fn strains(&self) -> &[StationStrain] {
        &self.strains
    }

    /// Derivatives of value `value` (in the order of [`StationStrain`]) at a station, if there is such.
    pub fn row(&self, station: usize, value: usize) -> Option<RodDirections> {
        self.rows.get(station)?.get(value).map(directions)
    }

    /// von Mises stress (MPa) at a sample and its derivatives, if there is such a station.
    pub fn stress(&self, rod: &Rod, station: usize, point: usize) -> Option<(f64, RodDirections)> {
        let (strain, rows) = (self.strains.get(station)?, self.rows.get(station)?);
        let (e, g) = (rod.material.e_mpa, rod.material.shear_modulus_mpa());
        let (mises, d) = strain.stress_gradient(&rod.boundary_point(station, point), e, g);
        let mut sum = [0.0; WIDTH];
        for (d, row) in d.into_iter().zip(rows) {
            add_scaled(&mut sum, d, row);
        }
        Some((mises, directions(&sum)))
    }
}

fn directions(row: &[f64; WIDTH]) -> RodDirections {
    RodDirections {
        link: SVector::from_fn(|i, _| row[i]),
        parameters: SVector::from_fn(|i, _| row[FIRST_PARAMETER + i]),
    }
}

/// Derivatives of a scalar by a rod's link freedoms and parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodDirections {
    /// By the 12 link freedoms.
    pub link: SVector<f64, 12>,
    /// By the 19 parameters.
    pub parameters: SVector<f64, PARAMETERS>,
}
