//! The conventional mechanisms of the standard library, each against a closed form or a known property of its own, at its
//! own size and at another one, used as a designer uses them: imported, placed and given parameters.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Options, elaborate, std_modules};
use flexura::ir::Design;
use flexura::kinematics::{Mechanism, Mobility, Motion, solve_motion};
use nalgebra::{Complex, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

type V = Vector3<f64>;

/// Assembled points against closed forms, mm: the assembly stops at 1e-12 of the mechanism's size, and 1e-11 is the worst seen.
const EXACT_MM: f64 = 1e-9;
/// Angles against closed forms, rad.
const EXACT_RAD: f64 = 1e-9;

/// The mechanism as the library has it, with parameters given where it is placed.
fn placed(name: &str, given: &str) -> (Design, Motion) {
    let given = if given.is_empty() { String::new() } else { format!(" {{ {given} }}") };
    let text = format!(
        "use std.mechanisms.{name}\nmechanism whole {{\n    place one = {name}{given} at (0 mm, 0 mm)\n}}\n"
    );
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    let found = elaborate("main.mech", &files, &Options::default());
    assert_eq!(found.diagnostics, []);
    let design = found.assembly.unwrap().designs.remove(0);
    let motion = solve_motion(&design, &[]).unwrap_or_else(|errors| panic!("{name}: {errors:#?}"));
    assert!(motion.warnings.iter().all(|w| w.code == "A0508"), "{name}: {:#?}", motion.warnings);
    (design, motion)
}

fn trace(design: &Design, motion: &Motion, name: &str) -> Vec<V> {
    let i = design.traces.iter().position(|t| t.name == name).unwrap();
    motion.states.iter().map(|s| s.traces_mm[i]).collect()
}

/// Value of the only drive in every state, rad or mm.
fn drive(motion: &Motion) -> Vec<f64> {
    motion.states.iter().map(|s| s.drives[0]).collect()
}

fn near(found: &[V], expected: impl IntoIterator<Item = V>) {
    let expected: Vec<V> = expected.into_iter().collect();
    assert_eq!(found.len(), expected.len());
    assert!(found.len() > 50);
    let worst = found.iter().zip(&expected).fold(0.0, |m: f64, (a, b)| m.max((a - b).norm()));
    assert!(worst < EXACT_MM, "{worst:e} mm");
}

fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
}

fn xy(z: Complex<f64>) -> V {
    V::new(z.re, z.im, 0.0)
}

/// Where circles about a and b meet, left (1) or right (−1) of the way from a to b.
fn meet(a: Complex<f64>, ra: f64, b: Complex<f64>, rb: f64, side: f64) -> Complex<f64> {
    let d = b - a;
    let x = (d.norm_sqr() + ra * ra - rb * rb) / (2.0 * d.norm());
    a + d / d.norm() * Complex::new(x, side * (ra * ra - x * x).sqrt())
}

/// Moving bodies, freedoms, constraint rows, redundant ones, idle bodies.
type Freedom = (usize, usize, usize, usize, usize);

#[test]
fn every_one_has_the_freedoms_that_it_has() {
    // Planar ones waste three rows a loop; Bennett's and Hooke's chains lack two freedoms by count and have one.
    const ALL: [(&str, Freedom); 13] = [
        ("bennett", (3, 1, 20, 3, 0)),
        ("chebyshev", (3, 1, 20, 3, 0)),
        ("four_bar", (3, 1, 20, 3, 0)),
        ("hoekens", (3, 1, 20, 3, 0)),
        ("hooke", (2, 1, 14, 3, 0)),
        ("jansen", (7, 1, 50, 9, 0)),
        ("klann", (5, 1, 35, 6, 0)),
        ("pantograph", (4, 2, 25, 3, 0)),
        ("peaucellier", (7, 1, 50, 9, 0)),
        ("rssr", (3, 1, 16, 0, 1)),
        ("scotch_yoke", (3, 1, 20, 3, 0)),
        ("slider_crank", (3, 1, 20, 3, 0)),
        ("watt", (3, 1, 20, 3, 0)),
    ];
    let listed: Vec<String> =
        std_modules().iter().filter_map(|m| m.strip_prefix("mechanisms.").map(String::from)).collect();
    assert_eq!(listed, ALL.map(|(name, _)| name));
    for (name, (moving, freedoms, rows, redundant, idle)) in ALL {
        let (design, motion) = placed(name, "");
        let found = Mobility::of(&Mechanism::new(&design, &[]).unwrap());
        assert_eq!(
            (found.moving_bodies, found.freedoms, found.rows, found.redundant, found.idle.len()),
            (moving, freedoms, rows, redundant, idle),
            "{name}"
        );
        assert_eq!(design.drives.len(), freedoms, "{name}");
        assert!(!design.traces.is_empty(), "{name}");
        // What turns fully ends where it began.
        let (first, last) = (&motion.states[0], motion.states.last().unwrap());
        for (a, b) in first.traces_mm.iter().zip(&last.traces_mm) {
            assert!((a - b).norm() < EXACT_MM, "{name}");
        }
    }
}

/// Freudenstein's equation gives the rocker's angle, the triangle of the coupler its point.
#[test]
fn four_bar() {
    for (given, [a, b, c, d], [p, q]) in [
        ("", [20.0, 50.0, 45.0, 55.0], [40.0, 30.0]),
        (
            "crank_length = 12 mm, coupler_length = 40 mm, rocker_length = 35 mm, base_length = 3 cm, reach_a = 20 mm, reach_b = 25 mm",
            [12.0, 40.0, 35.0, 30.0],
            [20.0, 25.0],
        ),
    ] {
        let (design, motion) = placed("four_bar", given);
        let (k1, k2, k3) = (d / a, d / c, (a * a - b * b + c * c + d * d) / (2.0 * a * c));
        let expected = drive(&motion).into_iter().map(|phi| {
            let phi = phi + PI / 2.0;
            let qa = phi.cos() - k1 - k2 * phi.cos() + k3;
            let qb = -2.0 * phi.sin();
            let qc = k1 - (k2 + 1.0) * phi.cos() + k3;
            let rocker = 2.0 * ((-qb - (qb * qb - 4.0 * qa * qc).sqrt()) / (2.0 * qa)).atan();
            let pin = Complex::from_polar(a, phi);
            let knee = Complex::new(d, 0.0) + Complex::from_polar(c, rocker);
            let corner = ((b * b + p * p - q * q) / (2.0 * b * p)).acos();
            xy(pin + (knee - pin) / b * Complex::from_polar(p, corner))
        });
        near(&trace(&design, &motion, "tip"), expected);
    }
}

#[test]
fn slider_crank() {
    for (given, r, l, e) in
        [("", 15.0, 50.0, 0.0), ("crank_length = 10 mm, rod_length = 35 mm, offset = 6 mm", 10.0, 35.0, 6.0)]
    {
        let (design, motion) = placed("slider_crank", given);
        let expected = drive(&motion).into_iter().map(|phi: f64| {
            let phi = phi + PI / 2.0;
            V::new(r * phi.cos() + (l * l - (r * phi.sin() - e).powi(2)).sqrt(), e, 0.0)
        });
        near(&trace(&design, &motion, "tip"), expected);
    }
}

/// End of the coupler of Chebyshev's and Hoekens' linkage, crank at `phi`.
fn lambda(crank: f64, base: f64, arm: f64, phi: f64) -> Complex<f64> {
    let pin = Complex::from_polar(crank, phi);
    pin + 2.0 * (meet(pin, arm, Complex::new(base, 0.0), arm, 1.0) - pin)
}

#[test]
fn chebyshev_runs_straight_for_half_a_turn() {
    for (given, r) in [("", 20.0), ("r = 8 mm", 8.0)] {
        let (design, motion) = placed("chebyshev", given);
        let path = trace(&design, &motion, "tip");
        near(&path, drive(&motion).into_iter().map(|phi| xy(lambda(r, 2.0 * r, 2.5 * r, phi + PI / 2.0))));
        // From the crank upright to upside down: 4 r long, 4 r up, a quarter of a per cent off; beyond an arch of √24 r.
        let straight = || path[..=30].iter();
        let (left, right) = span(straight().map(|p| p.x));
        let (low, high) = span(straight().map(|p| p.y));
        assert!(((right - left) / r - 4.0).abs() < 1e-9 && (low / r - 4.0).abs() < 1e-9);
        assert!((high - low) / (right - left) < 0.0025, "{}", (high - low) / (right - left));
        let top = span(path.iter().map(|p| p.y)).1;
        assert!((top / r - 24_f64.sqrt()).abs() < 1e-9, "{}", top / r);
    }
}

#[test]
fn hoekens_is_as_straight_as_its_page_says() {
    // Ratios, part of the turn, deviation over length.
    for (given, base, arm, part, straightness) in [
        ("", 2.2, 2.8, 0.5, 1.0e-3),
        ("base_ratio = 2, arm_ratio = 2.5", 2.0, 2.5, 0.5, 2.5e-3),
        ("base_ratio = 2.625, arm_ratio = 3.438, crank_length = 15 mm", 2.625, 3.438, 1.0 / 3.0, 1.0e-4),
        ("base_ratio = 2.9, arm_ratio = 3.85", 2.9, 3.85, 1.0 / 6.0, 3.0e-6),
    ] {
        let (design, motion) = placed("hoekens", given);
        let r = if given.contains("15 mm") { 15.0 } else { 20.0 };
        let path = trace(&design, &motion, "tip");
        near(&path, drive(&motion).into_iter().map(|phi| xy(lambda(r, base * r, arm * r, phi + PI))));
        // Around the drawing pose, in which the crank points away from the other hinge.
        let n = (60.0_f64 * part / 2.0).round() as usize;
        let straight = || path[..=n].iter().chain(&path[60 - n..]);
        let (left, right) = span(straight().map(|p| p.x));
        let (low, high) = span(straight().map(|p| p.y));
        let off = (high - low) / (right - left);
        assert!(off < straightness && off > 0.5 * straightness, "{given}: {off:e}");
    }
}

/// Watt's curve: ρ² = b² − (a sin θ ± √(c² − a² cos² θ))², with the hinges at ±a on the axis θ = 0, arms b and coupler 2 c.
#[test]
fn watt_follows_his_curve() {
    for (given, b, c) in
        [("", 60.0, 20.0), ("arm_length = 30 mm, coupler_length = 16 mm, swing = 25 deg", 30.0, 8.0)]
    {
        let (design, motion) = placed("watt", given);
        let path = trace(&design, &motion, "tip");
        let a = f64::hypot(b, c);
        let tilt = f64::atan2(c, b);
        for p in &path {
            let (rho, theta) = (p.norm(), p.y.atan2(p.x) - tilt);
            let root = (c * c - (a * theta.cos()).powi(2)).max(0.0).sqrt();
            let square = |sign: f64| b * b - (a * theta.sin() + sign * root).powi(2);
            let off = (rho * rho - square(1.0)).abs().min((rho * rho - square(-1.0)).abs());
            // In mm²: a root near its end doubles the error of θ.
            assert!(off < 1e-6 || rho < 1e-6, "{p:?}: {off:e}");
        }
        let (low, high) = span(path.iter().map(|p| p.y));
        let (left, right) = span(path.iter().map(|p| p.x));
        assert!(
            high - low > 0.4 * b && (right - left) < 0.04 * (high - low),
            "{} {}",
            high - low,
            right - left
        );
    }
}

#[test]
fn peaucellier_is_straight() {
    for (given, arm, side, crank, swing) in [
        ("", 60.0_f64, 25.0_f64, 22.0, 45.0_f64),
        (
            "arm_length = 80 mm, side_length = 40 mm, crank_length = 30 mm, swing = 30 deg",
            80.0,
            40.0,
            30.0,
            30.0,
        ),
    ] {
        let (design, motion) = placed("peaucellier", given);
        let path = trace(&design, &motion, "tip");
        let x = (arm * arm - side * side) / (2.0 * crank);
        // The line is as far up as O, P and Q in line have it: half the crank's angle is that of P seen from O.
        near(&path, drive(&motion).into_iter().map(|phi| V::new(x, x * (phi / 2.0).tan(), 0.0)));
        let (low, high) = span(path.iter().map(|p| p.y));
        assert!(high - low > 1.9 * x * (swing.to_radians() / 2.0).tan());
    }
}

/// The patent's point table, one unit a step.
fn klann_foot(crank: f64) -> [Complex<f64>; 2] {
    let z = |x, y| Complex::new(x, y);
    let (upper, lower, axle) = (z(1.366, 1.366), z(1.009, 0.574), z(1.599, 0.750));
    let [pin0, elbow0, knee0, hip0, foot0] =
        [z(1.331, 0.750), z(0.741, 0.750), z(0.232, 0.866), z(0.866, 1.500), z(0.0, 0.0)];
    let pin = axle - Complex::from_polar(0.268, crank);
    let elbow = meet(pin, (elbow0 - pin0).norm(), lower, (elbow0 - lower).norm(), -1.0);
    let knee = pin + (knee0 - pin0) * (elbow - pin) / (elbow0 - pin0);
    let hip = meet(knee, (hip0 - knee0).norm(), upper, (hip0 - upper).norm(), 1.0);
    [knee, knee + (foot0 - knee0) * (hip - knee) / (hip0 - knee0)]
}

#[test]
fn klann_walks_as_in_the_patent() {
    for (given, step) in [("", 60.0), ("step = 12 cm", 120.0)] {
        let (design, motion) = placed("klann", given);
        let path = trace(&design, &motion, "foot");
        near(&path, drive(&motion).into_iter().map(|phi| xy(step * klann_foot(phi)[1])));
        // What the patent says of it, which is in none of the lengths: half a turn after full extension the foot has
        // moved by one unit along the ground, and between 180° and 360° it stays there; else it is lifted by nearly half.
        let half = path[30] / step;
        assert!((half - V::new(1.0, 0.0, 0.0)).norm() < 1e-3, "{half:?}");
        let (low, high) = span(path[30..].iter().map(|p| p.y / step));
        assert!(low > -0.05 && high < 0.01, "{low} {high}");
        let lift = span(path[..30].iter().map(|p| p.y / step)).1;
        assert!((lift - 0.48).abs() < 0.005, "{lift}");
    }
}

#[test]
fn jansen_walks_as_the_reference() {
    let csv = include_str!("reference/motion/jansen.csv");
    let reference: Vec<V> = csv
        .lines()
        .skip(1)
        .map(|l| l.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>())
        .map(|row| V::from_row_slice(&row[1..4]))
        .collect();
    for (given, u) in [("", 1.25), ("u = 1 mm", 1.0)] {
        let (design, motion) = placed("jansen", given);
        let path = trace(&design, &motion, "foot");
        let worst = path.iter().zip(&reference).fold(0.0, |m: f64, (a, b)| m.max((a / u - b).norm()));
        // The table has nine digits.
        assert!(worst < 1e-6, "{worst:e}");
        let (left, right) = span(path.iter().map(|p| p.x / u));
        assert!(((right - left) - 67.8).abs() < 0.1, "{}", right - left);
    }
}

#[test]
fn pantograph_copies_exactly() {
    for (given, ratio) in [("", 0.5), ("ratio = 0.3, bar_length = 50 mm", 0.3)] {
        let (design, motion) = placed("pantograph", given);
        let stylus = trace(&design, &motion, "stylus");
        near(&trace(&design, &motion, "pen"), stylus.iter().map(|p| ratio * p));
        let (left, right) = span(stylus.iter().map(|p| p.x));
        let (low, high) = span(stylus.iter().map(|p| p.y));
        assert!(right - left > 10.0 && high - low > 10.0, "it draws an area");
    }
}

#[test]
fn scotch_yoke_is_a_sine() {
    for (given, r, guide) in [("", 15.0, 60.0), ("crank_length = 9 mm, guide_distance = 50 mm", 9.0, 50.0)] {
        let (design, motion) = placed("scotch_yoke", given);
        let middle = V::new(15.0 + guide, -2.5 * r, 0.0);
        near(
            &trace(&design, &motion, "tip"),
            drive(&motion).into_iter().map(|phi| middle - V::x() * r * phi.sin()),
        );
    }
}

/// The difference of two angles, as the least one.
fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(TAU);
    d.min(TAU - d)
}

#[test]
fn hooke_turns_unevenly_by_the_tangent() {
    for (given, bend) in [("", 30_f64), ("bend = 45 deg, shaft_length = 20 mm", 45.0)] {
        let (design, motion) = placed("hooke", given);
        let beta = bend.to_radians();
        let shaft = V::new(beta.cos(), beta.sin(), 0.0);
        let rim = trace(&design, &motion, "rim");
        for (p, phi) in rim.iter().zip(drive(&motion)) {
            let arm = p - shaft * shaft.dot(p);
            let psi = shaft.dot(&V::z().cross(&arm)).atan2(V::z().dot(&arm));
            // tan ψ = tan φ / cos β, in its own half turn.
            let expected = phi.sin().atan2(phi.cos() * beta.cos());
            assert!(apart(psi, expected) < EXACT_RAD, "{phi}: {psi} {expected}");
        }
    }
}

/// |A(φ) − B(ψ)| is the rod: an equation a cos ψ + b sin ψ = c.
#[test]
fn rssr_keeps_its_rod() {
    for (given, [r, s, base], skew) in [
        ("", [15.0, 40.0, 60.0], 90_f64),
        (
            "crank_length = 10 mm, rocker_length = 30 mm, base_length = 50 mm, skew = 60 deg",
            [10.0, 30.0, 50.0],
            60.0,
        ),
    ] {
        let (design, motion) = placed("rssr", given);
        let skew = skew.to_radians();
        let axis = V::new(skew.sin(), 0.0, skew.cos());
        let out = V::new(-skew.cos(), 0.0, skew.sin());
        let aside = axis.cross(&out);
        let hinge = V::new(0.0, base, 0.0);
        let rod = (hinge + out * s - V::new(r, 0.0, 0.0)).norm();
        let mut last = 0.0;
        let expected: Vec<V> = drive(&motion)
            .into_iter()
            .map(|phi: f64| {
                let d = hinge - V::new(r * phi.cos(), r * phi.sin(), 0.0);
                let (a, b) = (2.0 * s * d.dot(&out), 2.0 * s * d.dot(&aside));
                let c = rod * rod - s * s - d.norm_squared();
                let (middle, half) = (b.atan2(a), (c / a.hypot(b)).acos());
                // Of the two ways to assemble it, the one it is in.
                let psi = [middle + half, middle - half]
                    .into_iter()
                    .min_by(|x, y| apart(*x, last).total_cmp(&apart(*y, last)))
                    .unwrap();
                last = psi;
                hinge + s * (psi.cos() * out + psi.sin() * aside)
            })
            .collect();
        near(&trace(&design, &motion, "tip"), expected);
    }
}

/// Opposite bars are equal, sin α / a = sin β / b, and the tangents of half the angles of neighbouring hinges keep one ratio.
#[test]
fn bennett_closes_all_the_way_round() {
    for (given, [u, v, h], crossing) in [
        ("", [30.0, 20.0, 25.0], 60_f64),
        (
            "first_half = 25 mm, second_half = 25 mm, height = 10 mm, crossing = 40 deg",
            [25.0, 25.0, 10.0],
            40.0,
        ),
    ] {
        let (design, motion) = placed("bennett", given);
        let (s, c) = crossing.to_radians().sin_cos();
        let [p1, p2, p3, p4] =
            [V::new(u, 0.0, 0.0), V::new(v * c, v * s, h), V::new(-u, 0.0, 0.0), V::new(-v * c, -v * s, h)];
        let (long, short) = ((p1 - p2).norm(), (p2 - p3).norm());
        assert!(((p3 - p4).norm() - long).abs() < 1e-9 && ((p4 - p1).norm() - short).abs() < 1e-9);
        let axis = |before: V, at: V, after: V| (at - before).cross(&(after - at)).normalize();
        let [n1, n2, n4] = [axis(p4, p1, p2), axis(p1, p2, p3), axis(p3, p4, p1)];
        let twist = |a: &V, b: &V| a.cross(b).norm();
        assert!((twist(&n1, &n2) / long - twist(&n4, &n1) / short).abs() < 1e-12);
        // Angle of hinge 1 from the drive, of hinge 4 from the traced knee: exterior ones, between one bar and the next.
        let turn = |axis: &V, from: V, to: V| axis.dot(&from.cross(&to)).atan2(from.dot(&to));
        let first = turn(&n1, p1 - p4, p2 - p1);
        let mut ratio = None;
        let mut turned = 0.0;
        let mut last = None;
        for (p, phi) in trace(&design, &motion, "tip").iter().zip(drive(&motion)) {
            assert!(((p - p4).norm() - long).abs() < EXACT_MM && n4.dot(&(p - p4)).abs() < EXACT_MM);
            let theta = turn(&n4, p4 - p, p1 - p4);
            let k = ((first + phi) / 2.0).tan() * (theta / 2.0).tan();
            let expected = *ratio.get_or_insert(k);
            assert!((k / expected - 1.0).abs() < 1e-6, "{phi}: {k} {expected}");
            turned += last.map_or(0.0, |l: f64| (theta - l + PI).rem_euclid(TAU) - PI);
            last = Some(theta);
        }
        assert!((turned.abs() - TAU).abs() < 1e-6, "the rocker turns fully: {turned}");
    }
}
