//! Tapered rods against integrals of beam theory, and the taper from the text to the printed part.

#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model};
use flexura::geometry::{Mesh, Probe, check_mesh};
use flexura::kinematics::solve_motion;
use flexura::pipeline::{Compiler, Stages};
use flexura::rod::single::{EndLoad, SingleRod};
use flexura::rod::{Corrections, Rod, RodMaterial, RodOptions, RodParameters, SectionShape};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

const MATERIAL: RodMaterial = RodMaterial { e_mpa: 2000.0, nu: 0.35 };
const L: f64 = 30.0;
/// Half thickness at the two ends, and half width.
const A: [f64; 2] = [0.8, 0.4];
const B: f64 = 2.5;
/// Part of L by which the tip moves: a beam bends less than linear theory says by the square of this.
const SMALL: f64 = 1e-5;

fn cantilever(section: SectionShape, corrections: Corrections, edges: usize) -> SingleRod {
    let q = RodParameters {
        a_to: A[1],
        ..RodParameters::straight(Vector3::zeros(), Vector3::x() * L, Vector3::z(), A[0], B)
    };
    let options = RodOptions { section, corrections, taper: true, ..RodOptions::default() };
    let rod = Rod::with_options(&q, MATERIAL, edges, options, false).unwrap();
    SingleRod::new(rod, Vector3::zeros(), Vector3::x() * L)
}

fn loaded(section: SectionShape, corrections: Corrections, edges: usize, load: EndLoad) -> SingleRod {
    let mut s = cantilever(section, corrections, edges);
    s.solve(&EndLoad { point: Vector3::x() * L, ..load }, [true; 6]).unwrap();
    s
}

/// ∫₀¹ (1 − x)²/(1 + (r − 1)x)³ dx: a cantilever whose thickness runs from 1 to r under a force at its tip.
fn bending_integral(r: f64) -> f64 {
    (r.ln() + 1.5 - 2.0 * r + 0.5 * r * r) / (r - 1.0).powi(3)
}

/// EI at the thick end: of the ellipse, of the rectangle.
fn stiffness(section: SectionShape) -> f64 {
    let form = if section == SectionShape::Ellipse { PI / 4.0 } else { 4.0 / 3.0 };
    MATERIAL.e_mpa * form * A[0].powi(3) * B
}

/// EA at the thick end.
fn axial(section: SectionShape) -> f64 {
    MATERIAL.e_mpa * A[0] * B * if section == SectionShape::Ellipse { PI } else { 4.0 }
}

/// Errors at three resolutions: the finest small, and falling with the square of the edge length.
fn second_order(what: &str, error: impl Fn(usize) -> f64, finest: f64) {
    let [coarse, middle, fine] = [10, 20, 40].map(|n| error(n).abs());
    println!("{what}: {coarse:.1e} {middle:.1e} {fine:.1e}");
    assert!(fine < finest, "{what}: {fine}");
    assert!(middle < coarse / 3.0 && fine < middle / 3.0, "{what}: {coarse:e} {middle:e} {fine:e}");
}

#[test]
fn bends_as_the_integral_says() {
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        let unit = L.powi(3) * bending_integral(A[1] / A[0]) / stiffness(section);
        let force = SMALL * L / unit;
        let load = EndLoad { force: Vector3::y() * force, ..EndLoad::NONE };
        let tip = |edges: usize, corrections: Corrections| {
            loaded(section, corrections, edges, load).pose_b.translation.y / force
        };
        let plain = |edges| tip(edges, Corrections::default());
        second_order(&format!("{section:?}, tip"), |n| plain(n) / unit - 1.0, 2e-3);
        // Shear adds ∫ds/(k_s G A).
        let shear = Corrections { shear: true, ..Corrections::default() };
        let factor = section.shear_factor() / (2.0 * (1.0 + MATERIAL.nu));
        let r = A[1] / A[0];
        let slip = L * r.ln() / (r - 1.0) / (factor * axial(section));
        second_order(&format!("{section:?}, shear"), |n| (tip(n, shear) - plain(n)) / slip - 1.0, 1e-3);
    }
}

#[test]
fn stretches_as_the_integral_says() {
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        let r = A[1] / A[0];
        let unit = L * r.ln() / (r - 1.0) / axial(section);
        let force = SMALL * L / unit;
        let load = EndLoad { force: Vector3::x() * force, ..EndLoad::NONE };
        let error = |n: usize| {
            let s = loaded(section, Corrections::default(), n, load);
            s.pose_b.translation.x / force / unit - 1.0
        };
        second_order(&format!("{section:?}, stretch"), error, 1e-3);
    }
}

/// Twist by a torque about the rod: J = πa³b³/(a² + b²), integrated by Simpson's rule.
#[test]
fn twists_as_the_integral_says() {
    let compliance = |x: f64| {
        let a = A[0] + (A[1] - A[0]) * x;
        (a * a + B * B) / (PI * (a * B).powi(3) * MATERIAL.shear_modulus_mpa())
    };
    let n = 2000;
    let sum: f64 = (0..=n)
        .map(|k| {
            let weight = if k == 0 || k == n { 1.0 } else { 2.0 + 2.0 * f64::from(k % 2) };
            weight * compliance(f64::from(k) / f64::from(n))
        })
        .sum();
    let unit = L * sum / (3.0 * f64::from(n));
    let moment = SMALL / unit;
    let load = EndLoad { moment: Vector3::x() * moment, ..EndLoad::NONE };
    let error = |n: usize| {
        let s = loaded(SectionShape::Ellipse, Corrections::default(), n, load);
        flexura::math::log_so3(&s.pose_b.rotation).x / moment / unit - 1.0
    };
    second_order("twist", error, 2e-3);
}

/// A pure moment stresses each section by M/W with its own W, at the clamps too.
#[test]
fn stress_is_that_of_the_local_section() {
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        let moment = 1e-3;
        let load = EndLoad { moment: Vector3::z() * moment, ..EndLoad::NONE };
        for (station, a) in [(0, A[0]), (1, A[1])] {
            let resistance = stiffness(section) / MATERIAL.e_mpa * (a / A[0]).powi(3) / a;
            let error = |n: usize| {
                let s = loaded(section, Corrections::default(), n, load);
                let at = station * n;
                assert!((s.rod.station_half_widths_mm(at)[0] - a).abs() < 1e-12);
                let strains = s.system.strains(&s.rod);
                s.rod.stress_sample(&strains, at, 0).unwrap().von_mises_mpa / (moment / resistance) - 1.0
            };
            second_order(&format!("{section:?}, stress at end {station}"), error, 5e-3);
        }
    }
}

/// A taper that does not taper is the uniform rod, to the last bit of its rest shape and to rounding in its forces.
#[test]
fn without_a_difference_it_is_the_uniform_rod() {
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * L, Vector3::z(), A[0], B);
        let build = |taper: bool| {
            let corrections = Corrections { shear: true, width: true, warping: true };
            let options = RodOptions { section, corrections, taper, ..RodOptions::default() };
            let rod = Rod::with_options(&q, MATERIAL, 12, options, false).unwrap();
            let mut s = SingleRod::new(rod, Vector3::zeros(), Vector3::x() * L);
            s.move_b(&Vector3::new(-0.1, 1.0, 0.3), &Vector3::new(0.2, 0.0, 0.1)).unwrap();
            (s.system.energy(), s.rod.largest_stress(&s.system.strains(&s.rod)).unwrap().von_mises_mpa)
        };
        let (a, b) = (build(true), build(false));
        assert!((a.0 / b.0 - 1.0).abs() < 1e-9 && (a.1 / b.1 - 1.0).abs() < 1e-9, "{a:?} {b:?}");
    }
}

/// Text to solid: every leaf of the printed part measured at its stations.
#[test]
fn the_printed_leaf_tapers() {
    const TOLERANCE: f64 = 1e-2;
    let leaves = include_str!("../stdlib/flexures/crossed_leaves.mech").replace(
        "section ellipse(thick = thickness, wide = wide)",
        "section ellipse(thick = 1.5 * thickness, wide = wide)\n            to ellipse(thick = thickness, wide = 0.8 * wide)",
    );
    let main = include_str!("../examples/chebyshev/chebyshev.mech");
    let main = main.replace("use std.flexures.crossed_leaves", "use \"leaves.mech\"");
    let files = BTreeMap::from([("main.mech".to_string(), main), ("leaves.mech".to_string(), leaves)]);
    let design =
        elaborate("main.mech", &files, &Options { steps: Some(4), ..Options::default() }).design.unwrap();
    let lock = include_str!("../examples/chebyshev/chebyshev.lock");
    let p = flexura::emit::lock::Lock::parse(lock, 0).unwrap().start_values(&design);
    let layout = Layout::new(&design, &solve_motion(&design, &p).unwrap(), &p);
    let model = Model::new(&design, &layout, &p, 48, false).unwrap();
    let (files, _) = Compiler::default().mesh(&design, &p).unwrap();
    let base = files.iter().find(|f| f.name.ends_with("_base.stl")).unwrap();
    let stl = stl_io::read_stl(&mut std::io::Cursor::new(&base.bytes)).unwrap();
    let mesh = Mesh {
        vertices: stl.vertices.iter().map(|v| Vector3::from([v[0], v[1], v[2]].map(f64::from))).collect(),
        triangles: stl.faces.iter().map(|f| f.vertices).collect(),
    };
    assert!(check_mesh(&mesh).is_printable());
    let probe = Probe::new(&mesh);
    for built in &model.rods {
        let rest = built.rod.rest_state();
        let q = built.rod.parameters();
        assert!((q.a / q.a_to - 1.5).abs() < 1e-12 && (q.b_to / q.b - 0.8).abs() < 1e-12);
        for k in [14, 20, 24, 28, 34] {
            let (from, to) = (rest.vertices[k], rest.vertices[k + 1]);
            let t = (to - from).normalize();
            let m1 = rest.m1[k];
            let middle = (from + to) / 2.0 + (t + t.cross(&m1)) * 1e-3;
            let u = k as f64 / 47.0;
            let (a, b) = (q.a + (q.a_to - q.a) * u, q.b + (q.b_to - q.b) * u);
            for (direction, wanted) in [(m1, 2.0 * a), (t.cross(&m1), 2.0 * b)] {
                let measured = probe.thickness_mm(&middle, &direction).unwrap();
                assert!((measured / wanted - 1.0).abs() < TOLERANCE, "edge {k}: {measured} mm, {wanted}");
            }
        }
    }
}
