//! Large twist of straight rods against the closed form of Wagner's theory.

#![allow(clippy::unwrap_used)]

use flexura::rod::single::{EndLoad, SingleRod};
use flexura::rod::{
    Corrections, Rod, RodMaterial, RodOptions, RodParameters, SECTION_POINTS, SectionShape, Stiffness,
};
use nalgebra::Vector3;

const MATERIAL: RodMaterial = RodMaterial { e_mpa: 1800.0, nu: 0.38 };
const L: f64 = 25.0;
const A: f64 = 0.4;
const B: f64 = 2.5;
/// Relative: twist and stretch are the same everywhere, nothing is discretised; what is left is the solver.
const EXACT: f64 = 1e-6;

fn rod(section: SectionShape, edges: usize) -> Rod {
    let corrections = Corrections { wagner: true, ..Corrections::default() };
    let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * L, Vector3::z(), A, B);
    let options = RodOptions { section, corrections, ..RodOptions::default() };
    Rod::with_options(&q, MATERIAL, edges, options, false).unwrap()
}

/// Twisted by `angle` about its axis, free to shorten or not.
fn twisted(section: SectionShape, edges: usize, angle: f64, shortens: bool) -> SingleRod {
    let mut s = SingleRod::new(rod(section, edges), Vector3::zeros(), Vector3::x() * L);
    for _ in 0..10 {
        s.move_b(&Vector3::zeros(), &(Vector3::x() * angle / 10.0)).unwrap();
        s.solve(&EndLoad::NONE, [shortens, false, false, false, false, false]).unwrap();
    }
    s
}

/// A, I_p = ∫r² dA, K_w = ∫r⁴ dA − I_p²/A by a fine midpoint sum, to 1e-5.
fn moments(section: SectionShape) -> [f64; 3] {
    let n = 2000;
    let (mut area, mut polar, mut fourth) = (0.0, 0.0, 0.0);
    let cell = 4.0 * A * B / f64::from(n * n);
    for i in 0..n {
        for j in 0..n {
            let (x, y) = (
                (2.0 * f64::from(i) + 1.0) / f64::from(n) - 1.0,
                (2.0 * f64::from(j) + 1.0) / f64::from(n) - 1.0,
            );
            if section == SectionShape::Ellipse && x * x + y * y > 1.0 {
                continue;
            }
            let r2 = (A * x).powi(2) + (B * y).powi(2);
            area += cell;
            polar += cell * r2;
            fourth += cell * r2 * r2;
        }
    }
    [area, polar, fourth - polar * polar / area]
}

fn stiffness(section: SectionShape) -> Stiffness {
    section.stiffness(A, B, &MATERIAL)
}

#[test]
fn the_moments_are_those_of_the_section() {
    // Of a thin strip E t w⁵/360 τ³ is the torque (Timoshenko, Strength of Materials II, ch. "Torsion").
    let s = twisted(SectionShape::Rectangle, 12, 1e-3, true);
    assert!(s.system.energy() > 0.0);
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        let [area, polar, k] = moments(section);
        let (e, gj) = (MATERIAL.e_mpa, stiffness(section).gj);
        for angle in [0.3, 1.2] {
            let rate: f64 = angle / L;
            let mut free = twisted(section, 12, angle, true);
            let torque = free.condensed().0[9];
            let want = gj * rate + 0.5 * e * k * rate.powi(3);
            assert!((torque / want - 1.0).abs() < 1e-4, "{section:?}: {torque} {want}");
            assert!(free.condensed().0[6].abs() < 1e-6);
            let shortening = -free.pose_b.translation.x / L;
            assert!((shortening / (0.5 * rate * rate * polar / area) - 1.0).abs() < 1e-4);

            let mut held = twisted(section, 12, angle, false);
            let (torque, tension) = (held.condensed().0[9], held.condensed().0[6]);
            let want = gj * rate + 0.5 * e * (k + polar * polar / area) * rate.powi(3);
            assert!((torque / want - 1.0).abs() < 1e-4, "{section:?}: {torque} {want}");
            assert!((tension / (0.5 * e * polar * rate * rate) - 1.0).abs() < 1e-4);
        }
    }
    let strip = 0.5 * moments(SectionShape::Rectangle)[2];
    let thin = (2.0 * A) * (2.0 * B).powi(5) / 360.0;
    // The strip's own thickness adds a little: terms of (t/w)².
    assert!((strip / thin - 1.0).abs() < 0.05, "{strip} {thin}");
}

#[test]
fn it_does_not_depend_on_the_number_of_edges() {
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        for shortens in [true, false] {
            let energy = |n| twisted(section, n, 1.0, shortens).system.energy();
            let (few, many) = (energy(8), energy(40));
            assert!((few / many - 1.0).abs() < EXACT, "{few} {many}");
        }
    }
}

/// Fibres: E ½τ²(r² − I_p/A) when no axial force acts, all over the boundary.
#[test]
fn stress_follows_the_radius() {
    for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
        let s = twisted(section, 12, 1.0, true);
        let [area, polar, _] = moments(section);
        let rate: f64 = 1.0 / L;
        let strains = s.system.strains(&s.rod);
        for station in [0, 5, 12] {
            for point in 0..SECTION_POINTS {
                let (x, y) = section.boundary(point);
                let r2 = (A * x).powi(2) + (B * y).powi(2);
                let want = MATERIAL.e_mpa * 0.5 * rate * rate * (r2 - polar / area);
                let got = s.rod.stress_sample(&strains, station, point).unwrap().axial_mpa;
                assert!(
                    (got - want).abs() < 1e-3 * MATERIAL.e_mpa * 0.5 * rate * rate * B * B,
                    "{got} {want}"
                );
            }
        }
    }
}

/// Tension N stiffens torsion by N I_p/A, and a rod without the correction does not know it.
#[test]
fn tension_stiffens_torsion() {
    let section = SectionShape::Rectangle;
    let [area, polar, _] = moments(section);
    let stiffness_at = |force: f64| {
        let mut s = SingleRod::new(rod(section, 20), Vector3::zeros(), Vector3::x() * L);
        let load = EndLoad { force: Vector3::x() * force, point: Vector3::x() * L, ..EndLoad::NONE };
        s.solve(&load, [true, false, false, false, false, false]).unwrap();
        s.condensed().1[(9, 9)] * L
    };
    let force = 40.0;
    let gained = stiffness_at(force) - stiffness_at(0.0);
    let want = force * polar / area;
    // The link's own rotation is about the axis of the force: nothing else acts. The rod is 0.6 % longer.
    assert!((gained / want - 1.0).abs() < 2e-2, "{gained} {want}");
}
