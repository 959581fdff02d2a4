//! Gradient and Hessian against differences at bent and twisted states, including link increments.

use super::*;
use crate::math::{Pose, exp_so3};
use nalgebra::{DMatrix, DVector, SVector};

pub(crate) const MATERIAL: RodMaterial = RodMaterial { e_mpa: 1500.0, nu: 0.4 };

/// Deterministic numbers in (−1, 1).
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2) + 1)
    }
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64 / (1u64 << 53) as f64) * 2.0 - 1.0
    }
    pub(crate) fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next()) * size
    }
}

pub(crate) fn curved() -> RodParameters {
    RodParameters {
        position_a: Vector3::new(1.0, -2.0, 0.5),
        derivative_a: Vector3::new(25.0, 6.0, -1.0),
        position_b: Vector3::new(19.0, 7.0, 3.0),
        derivative_b: Vector3::new(10.0, 18.0, 5.0),
        axis: Vector3::new(0.1, -0.2, 1.3),
        a: 0.45,
        b: 1.1,
        a_to: 0.7,
        b_to: 0.8,
    }
}

pub(crate) struct Sample {
    pub(crate) rod: Rod,
    pub(crate) state: RodState,
    pub(crate) a: Pose,
    pub(crate) b: Pose,
}

/// Kinds of rods every derivative is tested for.
pub(crate) fn kinds() -> [RodOptions; 6] {
    let plain = RodOptions::default();
    let corrected = RodModel::Corrected.corrections();
    [
        plain,
        RodOptions { section: SectionShape::Rectangle, ..plain },
        RodOptions { corrections: corrected, ..plain },
        RodOptions {
            section: SectionShape::Rectangle,
            frames: RestFrames::Transport,
            corrections: corrected,
            taper: false,
        },
        RodOptions { taper: true, ..plain },
        RodOptions { section: SectionShape::Rectangle, corrections: corrected, taper: true, ..plain },
    ]
}

/// A state bent and twisted at random, of a plain rod.
pub(crate) fn random_sample(seed: u64, edges: usize) -> Sample {
    sample_of(seed, edges, RodOptions::default())
}

/// A state bent and twisted at random, with slip and force if the rod shears.
pub(crate) fn sample_of(seed: u64, edges: usize, options: RodOptions) -> Sample {
    let mut noise = Noise::new(seed);
    let rod = Rod::with_options(&curved(), MATERIAL, edges, options, true).unwrap();
    let mut state = rod.rest_state();
    let mut a = Pose::rest(Vector3::new(-2.0, 1.0, 0.0));
    let mut b = Pose::rest(Vector3::new(22.0, 9.0, 1.0));
    for _ in 0..6 {
        let d: Vec<f64> = (0..rod.internal_freedoms()).map(|_| noise.next() * 0.15).collect();
        let (na, nb) = (
            a.retract(&noise.vector(0.2), &noise.vector(0.08)),
            b.retract(&noise.vector(0.2), &noise.vector(0.08)),
        );
        if rod.retract(&mut state, &d, &na, &nb).is_ok() {
            (a, b) = (na, nb);
        }
    }
    Sample { rod, state, a, b }
}

impl Sample {
    /// The state moved by (internal, link A, link B) increments.
    pub(crate) fn moved(&self, d: &DVector<f64>) -> (RodState, Pose, Pose) {
        let n = self.rod.internal_freedoms();
        let v = |i: usize| Vector3::new(d[n + i], d[n + i + 1], d[n + i + 2]);
        let (a, b) = (self.a.retract(&v(0), &v(3)), self.b.retract(&v(6), &v(9)));
        let mut state = self.state.clone();
        self.rod.retract(&mut state, &d.as_slice()[..n], &a, &b).unwrap();
        (state, a, b)
    }

    fn energy(&self, d: &DVector<f64>) -> f64 {
        self.rod.energy(&self.moved(d).0)
    }
}

/// First and second derivative of `f` at 0 by eighth-order central differences.
pub(crate) fn difference(f: impl Fn(f64) -> f64, h: f64) -> (f64, f64) {
    let w1 = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let w2 = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
    let mut d1 = 0.0;
    let mut d2 = -205.0 / 72.0 * f(0.0);
    for k in 0..4 {
        let s = (k + 1) as f64 * h;
        let (p, m) = (f(s), f(-s));
        d1 += w1[k] * (p - m);
        d2 += w2[k] * (p + m);
    }
    (d1 / h, d2 / (h * h))
}

/// Whole gradient and Hessian on (internal, link) coordinates.
pub(crate) fn dense(system: &RodSystem) -> (DVector<f64>, DMatrix<f64>) {
    let band = system.internal_gradient().len();
    let n = band + if system.shear.is_some() { 6 } else { 0 };
    let mut g = DVector::zeros(n + 12);
    let mut h = DMatrix::zeros(n + 12, n + 12);
    for i in 0..band {
        g[i] = system.internal_gradient()[i];
        for d in 0..=10.min(band - 1 - i) {
            let v = system.band[assemble::FIRST_INTERNAL + i][d];
            h[(i + d, i)] = v;
            h[(i, i + d)] = v;
        }
    }
    for end in 0..2 {
        let c = system.coupling(end);
        let first = if end == 0 { 0 } else { band - 8 };
        for i in 0..8 {
            for j in 0..6 {
                h[(first + i, n + 6 * end + j)] = c[(i, j)];
                h[(n + 6 * end + j, first + i)] = c[(i, j)];
            }
        }
    }
    g.rows_mut(n, 12).copy_from(system.link_gradient());
    h.view_mut((n, n), (12, 12)).copy_from(&system.link_hessian);
    if system.shear.is_some() {
        system.dense_shear(band, &mut g, &mut h);
    }
    (g, h)
}

#[test]
fn gradient_and_hessian_match_differences() {
    for seed in 0..4 {
        let sample = sample_of(seed, 8, kinds()[seed as usize]);
        let mut system = RodSystem::new(&sample.rod);
        system.assemble(&sample.rod, &sample.state, &sample.a, &sample.b);
        let (g, h) = dense(&system);
        assert!((system.energy() - sample.rod.energy(&sample.state)).abs() < 1e-12 * system.energy().abs());
        let n = g.len();
        let unit = |i: usize| DVector::from_fn(n, |r, _| if r == i { 1.0 } else { 0.0 });
        let step = 4e-3;
        let (mut worst_g, mut worst_h) = (0.0f64, 0.0f64);
        let mut diagonal = vec![0.0; n];
        for i in 0..n {
            let (d1, d2) = difference(|s| sample.energy(&(unit(i) * s)), step);
            diagonal[i] = d2;
            worst_g = worst_g.max((d1 - g[i]).abs() / g.amax());
            worst_h = worst_h.max((d2 - h[(i, i)]).abs() / h[(i, i)].abs().max(1e-3 * h.amax()));
        }
        for i in 0..n {
            for j in 0..i {
                let d2 = difference(|s| sample.energy(&((unit(i) + unit(j)) * s)), step).1;
                let mixed = 0.5 * (d2 - diagonal[i] - diagonal[j]);
                let scale = (h[(i, i)] * h[(j, j)]).abs().sqrt().max(1e-3 * h.amax());
                let error = (mixed - h[(i, j)]).abs() / scale;
                assert!(error < 1e-6, "({i},{j}) of {n}: {mixed} {}", h[(i, j)]);
                worst_h = worst_h.max(error);
            }
        }
        println!("seed {seed}: gradient {worst_g:.1e}, Hessian {worst_h:.1e}");
        assert!(worst_g < 1e-8 && worst_h < 1e-6, "{worst_g:e} {worst_h:e}");
    }
}

#[test]
fn condensation_matches_dense() {
    kinds().into_iter().for_each(condensation_of);
}

fn condensation_of(options: RodOptions) {
    let sample = sample_of(7, 9, options);
    let mut system = RodSystem::new(&sample.rod);
    system.assemble(&sample.rod, &sample.state, &sample.a, &sample.b);
    let (g, h) = dense(&system);
    let report = system.factor_unshifted();
    let (cg, ch) = system.condense();
    let (cg, ch) = (*cg, *ch);
    let n = g.len() - 12;
    let inner = h.view((0, 0), (n, n)).into_owned();
    let eigen = inner.symmetric_eigenvalues();
    // The force of a rod with shear is a multiplier: three negative eigenvalues more.
    let multipliers = if system.shear.is_some() { 3 } else { 0 };
    assert_eq!(report.negative_pivots + multipliers, eigen.iter().filter(|&&e| e < 0.0).count());
    let inverse = inner.try_inverse().unwrap();
    let c = h.view((0, n), (n, 12)).into_owned();
    let want_h = h.view((n, n), (12, 12)) - c.tr_mul(&(&inverse * &c));
    let want_g = g.rows(n, 12) - c.transpose() * &inverse * g.rows(0, n);
    assert!((ch - &want_h).amax() < 1e-9 * h.amax());
    assert!((cg - want_g).amax() < 1e-9 * g.amax());
    assert_eq!(ch, ch.transpose());
    let d = SVector::<f64, 12>::from_fn(|i, _| (i as f64).sin());
    let x = system.back_substitute(&d);
    let want = -(&inverse * (g.rows(0, n) + &c * d));
    for i in 0..n {
        assert!((x[i] - want[i]).abs() < 1e-8 * want.amax());
    }
    // A step at another state with the factors of this one.
    let other = sample_of(8, 9, options);
    system.assemble(&sample.rod, &other.state, &other.a, &other.b);
    let (g, _) = dense(&system);
    let cg = *system.condense_gradient();
    let want_g = g.rows(n, 12) - c.transpose() * &inverse * g.rows(0, n);
    assert!((cg - &want_g).amax() < 1e-9 * want_g.amax(), "{:e}", (cg - &want_g).amax() / want_g.amax());
    let x = system.back_substitute(&d);
    let want = -(inverse * (g.rows(0, n) + &c * d));
    for i in 0..n {
        assert!((x[i] - want[i]).abs() < 1e-8 * want.amax());
    }
}

#[test]
fn shift_makes_positive_definite() {
    let sample = random_sample(3, 9);
    let mut system = RodSystem::new(&sample.rod);
    // Strong compression: every rod buckles.
    let mut state = sample.rod.rest_state();
    for v in &mut state.vertices {
        *v *= 0.7;
    }
    system.assemble(&sample.rod, &state, &sample.a, &sample.b);
    let report = system.factor();
    assert!(report.negative_pivots > 0 && report.shift > 0.0 && report.positive_definite, "{report:?}");
}

#[test]
fn rest_state_is_stress_free() {
    for (edges, options) in [6, 7, 20, 55].into_iter().zip(kinds()) {
        let rod = Rod::with_options(&curved(), MATERIAL, edges, options, false).unwrap();
        let mut system = RodSystem::new(&rod);
        let mut state = rod.rest_state();
        let (a, b) = (Pose::rest(Vector3::x()), Pose::rest(Vector3::y()));
        rod.set_clamps(&mut state, &a, &b);
        system.assemble(&rod, &state, &a, &b);
        let report = system.factor();
        assert!(report.negative_pivots == 0 && report.shift == 0.0, "{report:?}");
        let g = *system.condense().0;
        let floor = system.rounding_floor(&rod, &state);
        assert!(g.norm() < 10.0 * floor, "{} {}", g.norm(), floor);
        assert!(system.internal_residual_norm() < 10.0 * floor);
        assert!(system.energy() < 1e-18);
    }
}

#[test]
fn energy_is_invariant_under_rigid_motion() {
    kinds().into_iter().for_each(invariance_of);
}

fn invariance_of(options: RodOptions) {
    let sample = sample_of(11, 12, options);
    let energy = sample.rod.energy(&sample.state);
    let rotation = exp_so3(&Vector3::new(1.1, -2.0, 0.4));
    let mut moved = sample.state.clone();
    for v in &mut moved.vertices {
        *v = rotation * *v + Vector3::new(3.0, 4.0, -5.0);
    }
    for m in &mut moved.m1 {
        *m = rotation * *m;
    }
    (moved.slip, moved.force) = (rotation * moved.slip, rotation * moved.force);
    assert!((sample.rod.energy(&moved) - energy).abs() < 1e-11 * energy.abs());
    // And to second order: rigid motions of the condensed system do no work at first order.
    let mut system = RodSystem::new(&sample.rod);
    system.assemble(&sample.rod, &sample.state, &sample.a, &sample.b);
    let (g, _) = dense(&system);
    let force: Vector3<f64> = g.fixed_rows::<3>(g.len() - 12) + g.fixed_rows::<3>(g.len() - 6);
    let inner: Vector3<f64> =
        (2..=sample.rod.edges() - 2).map(|k| Vector3::new(g[4 * k - 7], g[4 * k - 6], g[4 * k - 5])).sum();
    assert!((force + inner).norm() < 1e-10 * g.norm());
}
