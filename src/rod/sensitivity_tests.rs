//! Parameter columns, equilibrium sensitivities and stress derivatives against differences.

use super::derivative_tests::{MATERIAL, curved, dense, difference, kinds, sample_of};
use super::single::{EndLoad, SingleRod};
use super::*;
use nalgebra::{DMatrix, DVector, SMatrix};

/// Size of a parameter's change in differences: vertices move by a few hundredths of a millimetre.
fn step_of(k: usize) -> f64 {
    if k < 12 { 4e-2 } else { 4e-3 }
}

/// Parameters that a rod depends on.
fn live(options: &RodOptions) -> usize {
    if options.taper { PARAMETERS } else { PARAMETERS - 2 }
}

fn shifted(q: &RodParameters, k: usize, s: f64) -> RodParameters {
    let mut q = q.to_array();
    q[k] += s;
    RodParameters::from_array(&q)
}

#[test]
fn parameter_columns_match_differences() {
    kinds().into_iter().for_each(parameter_columns_of);
}

fn parameter_columns_of(options: RodOptions) {
    let sample = sample_of(5, 8, options);
    let mut system = RodSystem::new(&sample.rod);
    system.assemble(&sample.rod, &sample.state, &sample.a, &sample.b);
    system.factor_unshifted();
    system.condense();
    let condensed = system.parameter_columns(&sample.rod, &sample.a, &sample.b).unwrap();
    assert_eq!(
        system.links_parameter_columns(&sample.rod, &sample.a, &sample.b),
        Ok(condensed),
        "{options:?}"
    );
    let n = sample.rod.internal_freedoms();
    let p = -system
        .internal_sensitivity(&DMatrix::zeros(12, PARAMETERS), &DMatrix::identity(PARAMETERS, PARAMETERS))
        .unwrap();
    let q0 = curved();
    let energy = |k: usize, dq: f64, i: usize, d: f64| {
        let rod = Rod::with_options(&shifted(&q0, k, dq), MATERIAL, 8, options, false).unwrap();
        let mut all = DVector::zeros(n + 12);
        all[i] = d;
        let v = |i: usize| Vector3::new(all[n + i], all[n + i + 1], all[n + i + 2]);
        let (a, b) = (sample.a.retract(&v(0), &v(3)), sample.b.retract(&v(6), &v(9)));
        let mut state = sample.state.clone();
        rod.retract(&mut state, &all.as_slice()[..n], &a, &b).unwrap();
        rod.energy(&state)
    };
    // Mixed second derivatives in the chart of the present state.
    let mut columns = DMatrix::zeros(n + 12, PARAMETERS);
    for k in 0..live(&options) {
        let dq = step_of(k) * 0.2;
        let own_q = difference(|s| energy(k, s * dq, 0, 0.0), 1.0).1;
        for i in 0..n + 12 {
            let di = 4e-3;
            let both = difference(|s| energy(k, s * dq, i, s * di), 1.0).1;
            let own_d = difference(|s| energy(k, 0.0, i, s * di), 1.0).1;
            columns[(i, k)] = 0.5 * (both - own_q - own_d) / (dq * di);
        }
    }
    let (_, h) = dense(&system);
    let (inner, coupling) = (h.view((0, 0), (n, n)), h.view((0, n), (n, 12)));
    let got_internal = inner * &p;
    let want_internal = columns.rows(0, n);
    let got_link = DMatrix::from_fn(12, PARAMETERS, |i, j| condensed[(i, j)]) + coupling.transpose() * &p;
    let want_link = columns.rows(n, 12);
    for k in 0..live(&options) {
        let scale = columns.column(k).amax();
        let e1 = (got_internal.column(k) - want_internal.column(k)).amax() / scale;
        let e2 = (got_link.column(k) - want_link.column(k)).amax() / scale;
        println!("q{k}: internal {e1:.1e}, link {e2:.1e} of {scale:.2e}");
        assert!(e1 < 1e-6 && e2 < 1e-6);
    }
    // The transposed map is the transpose.
    let w: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
    let (_, pulled) = system.internal_pull_back(&w).unwrap();
    let want = -p.tr_mul(&DVector::from_vec(w));
    assert!((0..live(&options)).all(|k| (pulled[k] - want[k]).abs() < 1e-9 * want.amax()));
}

fn clamped(q: &RodParameters, options: RodOptions) -> SingleRod {
    let rod = Rod::with_options(q, MATERIAL, 20, options, true).unwrap();
    let mut s = SingleRod::new(rod, Vector3::zeros(), Vector3::new(19.0, 7.0, 3.0));
    for _ in 0..4 {
        s.move_b(&Vector3::new(-0.4, 0.5, 0.2), &Vector3::new(0.04, -0.03, 0.12)).unwrap();
    }
    s
}

const LOAD: EndLoad = EndLoad {
    force: Vector3::new(-0.3, 0.5, 0.2),
    point: Vector3::new(21.0, 8.0, 1.0),
    moment: Vector3::new(0.0, 0.0, 0.0),
};

fn cantilever(q: &RodParameters, options: RodOptions) -> SingleRod {
    let rod = Rod::with_options(q, MATERIAL, 20, options, true).unwrap();
    let mut s = SingleRod::new(rod, Vector3::zeros(), Vector3::new(19.0, 7.0, 3.0));
    for k in 1..=4 {
        let part = EndLoad { force: LOAD.force * 0.25 * f64::from(k), ..LOAD };
        s.solve(&part, [true; 6]).unwrap();
    }
    s
}

/// All results that must have the right derivatives: vertices, pose of B, stresses, wide directions.
fn results(s: &SingleRod) -> Vec<f64> {
    let mut out = Vec::new();
    for v in &s.state.vertices {
        out.extend_from_slice(v.as_slice());
    }
    out.extend_from_slice(s.pose_b.translation.as_slice());
    for row in s.rod.stresses(&s.system.strains(&s.rod)) {
        out.extend_from_slice(&row);
    }
    for (x, m1) in s.state.vertices.windows(2).zip(&s.state.m1) {
        out.extend_from_slice((x[1] - x[0]).normalize().cross(m1).as_slice());
    }
    out
}

fn check(build: impl Fn(&RodParameters) -> SingleRod, free: bool) {
    let q0 = curved();
    let mut s = build(&q0);
    let (pose_a, pose_b) = (s.pose_a, s.pose_b);
    let h: SMatrix<f64, 12, 12> = *s.condensed().1;
    let columns = s.system.parameter_columns(&s.rod, &pose_a, &pose_b).unwrap();
    let dq = DMatrix::identity(PARAMETERS, PARAMETERS);
    let mut d_link = DMatrix::zeros(12, PARAMETERS);
    if free {
        let (_, lh) = LOAD.derivatives(&pose_b);
        let k: SMatrix<f64, 6, 6> = h.fixed_view::<6, 6>(6, 6) + lh;
        let b: SMatrix<f64, 6, PARAMETERS> = columns.fixed_rows::<6>(6).into_owned();
        let d = k.lu().solve(&-b).unwrap();
        d_link.rows_mut(6, 6).copy_from(&d);
    }
    let d_internal = s.system.internal_sensitivity(&d_link, &dq).unwrap();
    let derivatives = s.system.strain_jacobian(&s.rod).unwrap();
    let edges = s.rod.edges();
    let line: Vec<_> = (0..edges).map(|j| s.system.edge_jacobian(&s.rod, j, &d_link, &dq).unwrap()).collect();
    assert!(line.windows(2).all(|e| e[0].vertices[1] == e[1].vertices[0]));
    let vertex = |j: usize| if j < edges { &line[j].vertices[0] } else { &line[j - 1].vertices[1] };
    let stations = edges + 1;
    let base = results(&s);
    for k in 0..PARAMETERS {
        let mut want = Vec::new();
        for j in 2..=edges - 2 {
            for c in 0..3 {
                let inner = d_internal[(4 * j - 7 + c, k)];
                assert!((inner - vertex(j)[(c, k)]).abs() <= 1e-12 * inner.abs());
            }
        }
        let frames = base.len() - 3 * edges;
        for c in 0..3 {
            want.extend((0..=edges).map(|j| (3 * j + c, vertex(j)[(c, k)])));
        }
        let pose = 3 * (edges + 1);
        for c in 0..3 {
            want.push((pose + c, d_link[(6 + c, k)]));
        }
        let stress = pose + 3;
        for station in 0..stations {
            for point in 0..SECTION_POINTS {
                let (mises, d) = derivatives.stress(&s.rod, station, point).unwrap();
                let at = stress + station * SECTION_POINTS + point;
                assert!((mises - base[at]).abs() < 1e-9 * (1.0 + mises));
                want.push((at, d.link.dot(&d_link.fixed_view::<12, 1>(0, k)) + d.parameters[k]));
            }
        }
        let turned: Vec<(usize, f64)> = (0..edges)
            .flat_map(|j| (0..3).map(move |c| (j, c)))
            .map(|(j, c)| (frames + 3 * j + c, line[j].m2[(c, k)]))
            .collect();
        let dq = step_of(k);
        let samples: Vec<Vec<f64>> =
            [-2.0, -1.0, 1.0, 2.0].map(|s| results(&build(&shifted(&q0, k, s * dq * 0.25)))).to_vec();
        let slope = |at: usize| {
            (8.0 * (samples[2][at] - samples[1][at]) - (samples[3][at] - samples[0][at])) / (12.0 * dq * 0.25)
        };
        let largest = turned.iter().map(|(_, got)| got.abs()).fold(1e-3, f64::max);
        let turn = turned.iter().map(|(at, got)| (got - slope(*at)).abs() / largest).fold(0.0, f64::max);
        assert!(turn < 1e-6, "q{k}: {turn:e}");
        let mut worst = [0.0f64; 2];
        let mut scale = [0.0f64; 2];
        for (at, _) in &want {
            let d = slope(*at);
            let kind = usize::from(*at >= stress);
            scale[kind] = scale[kind].max(d.abs());
        }
        for (at, got) in &want {
            let d = slope(*at);
            let kind = usize::from(*at >= stress);
            worst[kind] = worst[kind].max((got - d).abs() / scale[kind]);
        }
        println!("q{k}: shape {:.1e}, stress {:.1e}", worst[0], worst[1]);
        assert!(worst[0] < 1e-6 && worst[1] < 1e-6, "q{k}: {worst:?}");
    }
}

#[test]
fn clamped_sensitivities_match_resolving() {
    kinds().into_iter().for_each(|options| check(|q| clamped(q, options), false));
}

#[test]
fn cantilever_sensitivities_match_resolving() {
    kinds().into_iter().for_each(|options| check(|q| cantilever(q, options), true));
}

/// Axial strain over the section must give back the bending energy, and the inside of a bend be compressed.
#[test]
fn section_integral_is_the_bending_energy() {
    let s = StationStrain { kappa1: 0.02, kappa2: -0.01, a: 0.4, b: 2.5, ..StationStrain::default() };
    let (mut sum, rings, spokes) = (0.0, 400, 64);
    for i in 0..rings {
        let r = (f64::from(i) + 0.5) / f64::from(rings);
        for k in 0..spokes {
            let phi = std::f64::consts::TAU * f64::from(k) / f64::from(spokes);
            let strain = s.axial_strain(s.a * r * phi.cos(), s.b * r * phi.sin());
            let area = s.a * s.b * r / f64::from(rings) * std::f64::consts::TAU / f64::from(spokes);
            sum += 0.5 * MATERIAL.e_mpa * strain * strain * area;
        }
    }
    let k = ellipse_stiffness(s.a, s.b, &MATERIAL);
    let want = 0.5 * (k.ei1 * s.kappa1 * s.kappa1 + k.ei2 * s.kappa2 * s.kappa2);
    assert!((sum - want).abs() < 1e-5 * want, "{sum} {want}");
    // Shear stress of the same section against GJ.
    let t = StationStrain { twist: 0.03, a: 0.4, b: 2.5, ..StationStrain::default() };
    let mut sum = 0.0;
    for i in 0..rings {
        let r = (f64::from(i) + 0.5) / f64::from(rings);
        for k in 0..spokes {
            let phi = std::f64::consts::TAU * f64::from(k) / f64::from(spokes);
            let [gx, gy] = t.shear_strains(t.a * r * phi.cos(), t.b * r * phi.sin());
            let area = t.a * t.b * r / f64::from(rings) * std::f64::consts::TAU / f64::from(spokes);
            sum += 0.5 * MATERIAL.shear_modulus_mpa() * (gx * gx + gy * gy) * area;
        }
    }
    assert!((sum - 0.5 * k.gj * 0.03 * 0.03).abs() < 1e-5 * sum);

    let rod = Rod::new(
        &RodParameters::straight(Vector3::zeros(), Vector3::x() * 30.0, Vector3::z(), 0.4, 2.5),
        MATERIAL,
        20,
    )
    .unwrap();
    let mut s = SingleRod::new(rod, Vector3::zeros(), Vector3::x() * 30.0);
    s.solve(&EndLoad { moment: Vector3::z() * 3.0, ..EndLoad::NONE }, [true; 6]).unwrap();
    let strains = s.system.strains(&s.rod);
    // m₁ = m₂ × t = z × x = y; bent towards +y: fibres at +y are on the inside.
    assert!(s.rod.rest_state().m1[0].dot(&Vector3::y()) > 0.999);
    assert!(s.pose_b.translation.y > 0.0);
    let inside = s.rod.stress_sample(&strains, 10, 0).unwrap();
    let outside = s.rod.stress_sample(&strains, 10, SECTION_POINTS / 2).unwrap();
    assert!(inside.axial_mpa < 0.0 && outside.axial_mpa > 0.0);
    let want = 3.0 / 188.4955592 * 0.4 * 1500.0;
    assert!((outside.axial_mpa - want).abs() < 1e-3 * want, "{} {want}", outside.axial_mpa);
}
