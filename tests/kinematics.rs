//! The conventional mechanism against independent reference motions and closed forms.
#![allow(clippy::unwrap_used, clippy::panic)]

use flexura::diagnostic::Diagnostic;
use flexura::elaborate::{Options, elaborate};
use flexura::ir::expr::{ExprGraph, Node};
use flexura::ir::{
    Body, Cycle, Design, Drive, DriveUnit, ExprPoint, Fittings, FreeVariable, Joint, JointKind, Layers,
    Material, NamedPoint, Origin, Process, Profile, Realization, Trace,
};
use flexura::kinematics::{Mechanism, Mobility, Motion, solve_motion};
use nalgebra::Vector3;
use proptest::prelude::*;
use std::collections::BTreeMap;

type V = Vector3<f64>;

/// Builds designs as elaboration would, each declaration with an origin of its own.
struct Builder(Design);

impl Builder {
    fn new(name: &str) -> Self {
        Self(Design {
            name: name.into(),
            exprs: ExprGraph::default(),
            free: Vec::new(),
            bodies: Vec::new(),
            joints: Vec::new(),
            model: Default::default(),
            rods: Vec::new(),
            drives: Vec::new(),
            loads: Vec::new(),
            cases: Vec::new(),
            strings: Vec::new(),
            cycle: Cycle { steps: 60, duration_s: 2.0, origin: origin(9, 0) },
            traces: Vec::new(),
            aims: Default::default(),
            objectives: Vec::new(),
            requirements: Vec::new(),
            material: Material {
                name: "m".into(),
                e_mpa: 1900.0,
                nu: 0.4,
                density_g_mm3: None,
                strength_mpa: None,
                yield_mpa: None,
                strain_once: None,
                strain_repeated: None,
            },
            process: Process {
                name: "p".into(),
                least_wall_mm: 0.6,
                clearance_mm: 0.5,
                machine: Default::default(),
            },
            layers: Layers { height_mm: 5.0, pitch_mm: 5.5, axis: [0.0, 0.0, 1.0] },
            exports: Vec::new(),
            origin: origin(9, 9),
        })
    }

    fn point(&mut self, at: V) -> ExprPoint {
        [at.x, at.y, at.z].map(|x| self.0.exprs.constant(x))
    }

    fn body(&mut self, name: &str, ground: bool, layer: i32) -> usize {
        let id = self.0.bodies.len();
        let skeleton: Vec<NamedPoint> = Vec::new();
        let origin = origin(1, id);
        self.0.bodies.push(Body {
            name: name.into(),
            ground,
            skeleton,
            layer,
            owner: None,
            holes: Vec::new(),
            fittings: Fittings::default(),
            printed: None,
            origin,
        });
        id
    }

    fn hinge(
        &mut self,
        name: &str,
        [a, b]: [usize; 2],
        at: V,
        axis: V,
        layer: i32,
        compliant: bool,
    ) -> usize {
        let id = self.0.joints.len();
        let point = self.point(at);
        let realization = if compliant {
            Realization::Compliant { template: "crossed_leaves".into(), rods: Vec::new() }
        } else {
            Realization::Conventional { pin_diameter_mm: None }
        };
        self.0.joints.push(Joint {
            name: name.into(),
            kind: JointKind::Hinge,
            bodies: vec![a, b],
            point,
            axis: axis.into(),
            second_axis: None,
            layer,
            toward: Vec::new(),
            realization,
            origin: origin(2, id),
        });
        id
    }

    fn drive(&mut self, joint: usize, from_deg: f64, to_deg: f64, rest_deg: f64) {
        let id = self.0.drives.len();
        self.0.drives.push(Drive {
            name: self.0.joints[joint].name.clone(),
            on: flexura::ir::DriveOn::Joint(joint),
            drum_radius_mm: None,
            unit: DriveUnit::Rad,
            profile: Profile::Range { from: from_deg.to_radians(), to: to_deg.to_radians() },
            rest: rest_deg.to_radians(),
            free_rest: None,
            motor: None,
            continuous: true,
            origin: origin(3, id),
        });
    }

    fn trace(&mut self, name: &str, body: usize, at: V) {
        let point = self.point(at);
        self.0.traces.push(Trace { name: name.into(), body, point, origin: origin(4, 0) });
    }
}

fn origin(file: u32, item: usize) -> Origin {
    let start = 10 * item as u32;
    Origin { file, start, end: start + 5 }
}

fn xy(x: f64, y: f64) -> V {
    V::new(x, y, 0.0)
}

fn polar(r: f64, degrees: f64) -> V {
    xy(r * degrees.to_radians().cos(), r * degrees.to_radians().sin())
}

/// Intersection of two circles left (side 1) or right (side −1) of the ray a → b.
fn meet(a: V, ra: f64, b: V, rb: f64, side: f64) -> V {
    let d = b - a;
    let l = d.norm();
    let x = (l * l + ra * ra - rb * rb) / (2.0 * l);
    let y = side * (ra * ra - x * x).sqrt();
    a + d / l * x + V::z().cross(&d) / l * y
}

fn solved(design: &Design) -> Motion {
    solve_motion(design, &[]).unwrap_or_else(|errors| panic!("{errors:#?}"))
}

fn mobility(design: &Design) -> Mobility {
    Mobility::of(&Mechanism::new(design, &[]).unwrap())
}

fn chebyshev(compliant_pin: bool) -> Design {
    let r = 20.0;
    let (o, d, a) = (xy(0.0, 0.0), xy(2.0 * r, 0.0), polar(r, 90.0));
    let b = meet(a, 2.5 * r, d, 2.5 * r, 1.0);
    let mut m = Builder::new("chebyshev_lambda");
    let base = m.body("base", true, -2);
    let crank = m.body("crank", false, -1);
    let coupler = m.body("coupler", false, 0);
    let rocker = m.body("rocker", false, 0);
    let motor = m.hinge("motor", [base, crank], o, V::z(), -1, false);
    m.hinge("pin", [crank, coupler], a, V::z(), -1, compliant_pin);
    m.hinge("knee", [coupler, rocker], b, V::z(), 0, true);
    m.hinge("heel", [rocker, base], d, V::z(), 0, true);
    m.drive(motor, 0.0, 360.0, 30.0);
    m.trace("tip", coupler, a + (b - a) * 2.0);
    m.0
}

fn jansen() -> Design {
    let (o, g) = (xy(0.0, 0.0), xy(-38.0, -7.8));
    let a = polar(15.0, 0.0);
    let t = meet(a, 50.0, g, 41.5, -1.0);
    let l = meet(a, 61.9, g, 39.3, 1.0);
    let e = meet(g, 40.1, t, 55.8, 1.0);
    let f = meet(e, 39.4, l, 36.7, -1.0);
    let h = meet(l, 49.0, f, 65.7, 1.0);
    let mut m = Builder::new("jansen");
    let base = m.body("base", true, -2);
    let crank = m.body("crank", false, -1);
    let [j, k, upper, link_f, c, lower] = ["j", "k", "upper", "f", "c", "lower"].map(|n| m.body(n, false, 0));
    let motor = m.hinge("motor", [base, crank], o, V::z(), -1, false);
    m.hinge("pin", [crank, k], a, V::z(), -1, false);
    m.hinge("wrist", [k, j], a, V::z(), 0, true);
    m.hinge("top", [j, upper], t, V::z(), 0, true);
    m.hinge("hip", [base, upper], g, V::z(), 0, true);
    m.hinge("hip_c", [base, c], g, V::z(), 0, true);
    m.hinge("back", [upper, link_f], e, V::z(), 0, true);
    m.hinge("heel", [link_f, lower], f, V::z(), 0, true);
    m.hinge("knee", [c, k], l, V::z(), 0, true);
    m.hinge("knee_lower", [c, lower], l, V::z(), 0, true);
    m.drive(motor, 0.0, 360.0, 132.0);
    m.trace("foot", lower, h);
    m.0
}

/// Four-bar O–A–B–D in the plane, drawn with the crank at `angle` (deg).
fn four_bar(crank: f64, coupler: f64, rocker: f64, base: f64, angle: f64, side: f64) -> Builder {
    let (o, d, a) = (xy(0.0, 0.0), xy(base, 0.0), polar(crank, angle));
    let b = meet(a, coupler, d, rocker, side);
    let mut m = Builder::new("four_bar");
    let ids = [("base", true), ("crank", false), ("coupler", false), ("rocker", false)];
    let [base, crank, coupler, rocker] = ids.map(|(n, ground)| m.body(n, ground, 0));
    m.hinge("motor", [base, crank], o, V::z(), 0, false);
    m.hinge("pin", [crank, coupler], a, V::z(), 0, false);
    m.hinge("knee", [coupler, rocker], b, V::z(), 0, true);
    m.hinge("heel", [rocker, base], d, V::z(), 0, true);
    m.trace("knee", coupler, b);
    m
}

fn check_reference(design: &Design, csv: &str) {
    let motion = solved(design);
    let rows: Vec<Vec<f64>> =
        csv.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), design.cycle.steps + 1);
    assert_eq!(motion.states.len(), rows.len());
    let mut worst: f64 = 0.0;
    for (row, state) in rows.iter().zip(&motion.states) {
        let (drives, point) = row.split_at(design.drives.len());
        assert!(drives.iter().zip(&state.drives).all(|(a, b)| (a - b).abs() < 1e-8));
        worst = worst.max((V::from_row_slice(point) - state.traces_mm[0]).norm());
    }
    println!("{}: worst {worst:e} mm", design.name);
    assert!(worst < 1e-6, "{worst} mm");
    assert!(motion.warnings.iter().all(|w| w.code == "A0508"), "{:#?}", motion.warnings);
    // The joints are closed too, not only the trace right.
    let mechanism = Mechanism::new(design, &[]).unwrap();
    for state in motion.states.iter().chain([&motion.rest]) {
        let mut gap = [0.0; 3];
        for (constraint, _) in &mechanism.constraints {
            constraint.residual(&state.poses, &mut gap);
            assert!(gap.iter().take(constraint.rows()).all(|x| x.abs() < 1e-10), "{gap:?}");
        }
    }
}

/// A mechanism from its text in `tests/kinematics`.
fn from_text(name: &str) -> Design {
    let path = format!("{}/tests/kinematics/{name}.mech", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    let found = elaborate("main.mech", &files, &Options::default());
    assert_eq!(found.diagnostics, []);
    found.design.unwrap()
}

/// Name, freedoms, idle bodies, constraint rows, redundant ones.
type Expected = (&'static str, usize, &'static [&'static str], usize, usize);

#[test]
fn all_six_mechanisms_of_the_paper_match_their_references() {
    const SIX: [Expected; 7] = [
        ("chebyshev", 1, &[], 20, 3),
        ("jansen", 1, &[], 50, 9),
        ("eye", 2, &["rod_y", "rod_p"], 32, 0),
        ("eye_universal", 2, &["rod_y", "rod_p"], 26, 0),
        ("car", 1, &["drag_link"], 16, 0),
        ("hand", 1, &[], 50, 9),
        ("dragon", 1, &[], 23, 0),
    ];
    for (name, freedoms, idle, rows, redundant) in SIX {
        let design = from_text(name);
        let reference = name.trim_end_matches("_universal");
        let path = format!("{}/tests/reference/motion/{reference}.csv", env!("CARGO_MANIFEST_DIR"));
        check_reference(&design, &std::fs::read_to_string(path).unwrap());
        let found = mobility(&design);
        assert_eq!((found.freedoms, found.rows, found.redundant), (freedoms, rows, redundant), "{name}");
        let bodies: Vec<&str> = found.idle.iter().map(|i| design.bodies[i.body].name.as_str()).collect();
        assert_eq!(bodies, idle, "{name}");
    }
}

#[test]
fn chebyshev_matches_the_reference() {
    let design = chebyshev(false);
    check_reference(&design, include_str!("reference/motion/chebyshev.csv"));
    let found = mobility(&design);
    assert_eq!((found.moving_bodies, found.freedoms, found.rows, found.redundant), (3, 1, 20, 3));
}

#[test]
fn jansen_matches_the_reference() {
    let design = jansen();
    check_reference(&design, include_str!("reference/motion/jansen.csv"));
    let found = mobility(&design);
    assert_eq!((found.moving_bodies, found.freedoms, found.rows, found.redundant), (7, 1, 50, 9));
}

#[test]
fn rest_pose_is_on_the_branch_and_spans_are_measured_from_it() {
    // 53 deg as drawn against 41 deg at 30 deg, 128 against 67 at 132 deg: known from independent planar trials.
    for (design, drawn, rest) in [(chebyshev(false), 53.0, 41.0), (jansen(), 128.0, 67.0)] {
        let motion = solved(&design);
        let largest = |motion: &Motion| {
            let spans = motion.compliant_spans(&design);
            spans.iter().fold(0.0, |m: f64, s| m.max(s.from_rest_rad)).to_degrees()
        };
        assert!((largest(&motion) - rest).abs() < 1.0, "{} deg", largest(&motion));
        let mut as_drawn = motion.clone();
        as_drawn.rest = motion.states[0].clone();
        assert!((largest(&as_drawn) - drawn).abs() < 1.0, "{} deg", largest(&as_drawn));
    }
    // Chebyshev's state 5 of 60 is 30 deg: the rest pose.
    let motion = solved(&chebyshev(false));
    for (a, b) in motion.rest.poses.iter().zip(&motion.states[5].poses) {
        assert!((a.translation - b.translation).norm() < 1e-10 && (a.rotation - b.rotation).norm() < 1e-12);
    }
}

#[test]
fn compliant_pin_that_turns_fully_is_an_error_at_the_pin() {
    let errors = solve_motion(&chebyshev(true), &[]).unwrap_err();
    assert_eq!(errors.len(), 1);
    assert_eq!(errors[0].code, "E0504");
    assert_eq!(errors[0].labels[0].at, origin(2, 1));
    let help = errors[0].help.as_deref().unwrap();
    assert!(help.contains("`motor` and `pin` turn fully"), "{help}");
}

#[test]
fn parallelogram_is_redundant_and_keeps_its_branch_through_the_change_points() {
    let mut m = four_bar(20.0, 50.0, 20.0, 50.0, 60.0, 1.0);
    // The other assembly is the crossed one: make sure the parallelogram was drawn.
    m.0.joints[2].point = m.point(polar(20.0, 60.0) + xy(50.0, 0.0));
    m.drive(0, 0.0, 360.0, 30.0);
    m.0.joints.iter_mut().for_each(|j| j.realization = Realization::Conventional { pin_diameter_mm: None });
    let found = mobility(&m.0);
    assert_eq!((found.freedoms, found.redundant), (1, 3));
    let motion = solved(&m.0);
    // State 20 is 120 deg on from 60: exactly flat, and state 50 again.
    for (i, state) in motion.states.iter().enumerate() {
        let exact = polar(20.0, 60.0 + 6.0 * i as f64) + xy(50.0, 0.0);
        let path = m.0.traces[0].body;
        assert_eq!(path, 2);
        let knee = state.poses[2].point(&(polar(20.0, 60.0) + xy(50.0, 0.0)));
        assert!((knee - exact).norm() < 1e-9, "state {i}: {:e}", (knee - exact).norm());
    }
    assert_eq!(motion.warnings.len(), 1, "{:#?}", motion.warnings);
    assert_eq!(motion.warnings[0].code, "W0506");
    assert!(motion.warnings[0].message.contains("120.0 deg"), "{}", motion.warnings[0].message);
}

#[test]
fn three_parallel_cranks_move_though_counting_says_they_cannot() {
    let mut m = Builder::new("double_parallelogram");
    let base = m.body("base", true, 0);
    let bar = m.body("bar", false, 0);
    let mut motor = 0;
    for (i, x) in [0.0, 40.0, 75.0].into_iter().enumerate() {
        let crank = m.body(&format!("crank{i}"), false, 0);
        let hinge = m.hinge(&format!("foot{i}"), [base, crank], xy(x, 0.0), V::z(), 0, false);
        m.hinge(&format!("head{i}"), [crank, bar], xy(x, 0.0) + polar(15.0, 70.0), V::z(), 0, false);
        motor = if i == 0 { hinge } else { motor };
    }
    m.drive(motor, 0.0, 90.0, 0.0);
    m.trace("bar", bar, xy(10.0, 30.0));
    // Even in the plane 3·4 − 2·6 = 0.
    let found = mobility(&m.0);
    assert_eq!((found.freedoms, found.rows, found.redundant), (1, 30, 7));
    let motion = solved(&m.0);
    let swung = polar(15.0, 160.0) - polar(15.0, 70.0);
    assert!((motion.states[60].traces_mm[0] - (xy(10.0, 30.0) + swung)).norm() < 1e-9);
}

/// Bennett's linkage: opposite links equal, a / sin α = b / sin β.
fn bennett() -> Design {
    let (a, alpha, beta) = (40.0_f64, 40.0_f64.to_radians(), 75.0_f64.to_radians());
    let b = a * beta.sin() / alpha.sin();
    // Denavit–Hartenberg chain with the joint angles related by
    // tan(θ₁/2) tan(θ₂/2) = sin((β+α)/2) / sin((β−α)/2), θ₃ = −θ₁, θ₄ = −θ₂.
    let theta1 = 100.0_f64.to_radians();
    let k = ((beta + alpha) / 2.0).sin() / ((beta - alpha) / 2.0).sin();
    let theta2 = 2.0 * (k / (theta1 / 2.0).tan()).atan();
    let mut frame = nalgebra::Isometry3::identity();
    let mut joints = Vec::new();
    for (theta, length, twist) in
        [(theta1, a, alpha), (theta2, b, beta), (-theta1, a, alpha), (-theta2, b, beta)]
    {
        joints.push((frame.translation.vector, frame.rotation * V::z()));
        let turn = nalgebra::Isometry3::rotation(V::z() * theta);
        let shift = nalgebra::Isometry3::translation(length, 0.0, 0.0);
        frame = frame * turn * shift * nalgebra::Isometry3::rotation(V::x() * twist);
    }
    assert!(frame.translation.vector.norm() < 1e-12 && frame.rotation.angle() < 1e-12, "{frame}");
    let mut m = Builder::new("bennett");
    let ids = [("base", true), ("crank", false), ("coupler", false), ("rocker", false)];
    let bodies = ids.map(|(n, ground)| m.body(n, ground, 0));
    for (i, (at, axis)) in joints.iter().enumerate() {
        m.hinge(&format!("h{i}"), [bodies[i], bodies[(i + 1) % 4]], *at, *axis, 0, false);
    }
    m.drive(0, 0.0, 360.0, 20.0);
    m.trace("far", bodies[2], joints[2].0);
    m.0
}

#[test]
fn bennett_moves_though_counting_says_minus_two() {
    let design = bennett();
    let found = mobility(&design);
    assert_eq!((found.freedoms, found.rows, found.redundant), (1, 20, 3));
    let motion = solved(&design);
    assert!(motion.warnings.is_empty(), "{:#?}", motion.warnings);
    // The input–output relation holds all the way round: tan(θ₁/2) tan(θ₂/2) = const.
    let (alpha, beta) = (40.0_f64.to_radians(), 75.0_f64.to_radians());
    let k = ((beta + alpha) / 2.0).sin() / ((beta - alpha) / 2.0).sin();
    let theta1 = 100.0_f64.to_radians();
    let theta2 = 2.0 * (k / (theta1 / 2.0).tan()).atan();
    // Which way the chain's angles run against the hinges' is a matter of convention, but one for all states.
    let off = |first: f64, second: f64| {
        let at = |a: &[f64]| ((theta1 + first * a[0]) / 2.0, (theta2 + second * a[1]) / 2.0);
        let error = |(u, v): (f64, f64)| (u.sin() * v.sin() - k * u.cos() * v.cos()).abs();
        motion.states.iter().map(|s| error(at(&s.joint_values))).fold(0.0, f64::max)
    };
    let least = off(1.0, 1.0).min(off(1.0, -1.0)).min(off(-1.0, 1.0)).min(off(-1.0, -1.0));
    assert!(least < 1e-9, "{least}");
    // Opposite joints turn equally.
    for state in &motion.states {
        let a = &state.joint_values;
        assert!((a[0].abs() - a[2].abs()).abs() < 1e-9 && (a[1].abs() - a[3].abs()).abs() < 1e-9, "{a:?}");
    }
}

#[test]
fn skew_four_hinge_loop_is_locked() {
    let mut design = bennett();
    design.joints[2].axis = (V::from(design.joints[2].axis) + V::new(0.2, 0.0, 0.1)).normalize().into();
    let errors = solve_motion(&design, &[]).unwrap_err();
    assert_eq!(errors[0].code, "E0502");
    assert!(errors[0].message.starts_with("mobility 0, drives 1"), "{}", errors[0].message);
}

#[test]
fn underdriven_five_bar_names_the_loose_bodies() {
    let mut m = Builder::new("five_bar");
    let base = m.body("base", true, 0);
    let links = ["left", "mid", "right", "last"].map(|n| m.body(n, false, 0));
    let at = [xy(0.0, 0.0), xy(-10.0, 30.0), xy(20.0, 55.0), xy(50.0, 28.0), xy(40.0, 0.0)];
    let around = [base, links[0], links[1], links[2], links[3], base];
    for (i, p) in at.iter().enumerate() {
        m.hinge(&format!("h{i}"), [around[i], around[i + 1]], *p, V::z(), 0, false);
    }
    m.drive(0, 0.0, 20.0, 0.0);
    let errors = solve_motion(&m.0, &[]).unwrap_err();
    assert_eq!(errors.len(), 1);
    assert_eq!(errors[0].code, "E0502");
    assert_eq!(
        errors[0].message,
        "mobility 2, drives 1: with the drives held, `mid`, `right` and `last` can still move"
    );
    assert_eq!(errors[0].labels[0].at, origin(1, 2));
    // With its second drive it moves.
    m.drive(4, 0.0, -15.0, 0.0);
    assert_eq!(solved(&m.0).mobility.freedoms, 2);
}

#[test]
fn too_many_drives_is_an_error() {
    let mut m = four_bar(20.0, 50.0, 50.0, 40.0, 90.0, 1.0);
    m.drive(0, 0.0, 10.0, 0.0);
    m.drive(3, 0.0, 10.0, 0.0);
    let errors = solve_motion(&m.0, &[]).unwrap_err();
    assert!(errors[0].message.starts_with("mobility 1, drives 2"), "{}", errors[0].message);
}

#[test]
fn loop_that_breaks_is_reported_where_it_breaks() {
    // |A − D| ≤ coupler + rocker: breaks where cos θ = (crank² + base² − (coupler + rocker)²) / (2 crank base).
    for (crank, coupler, rocker, base, drawn) in
        [(60.0, 35.0, 30.0, 40.0, 40.0), (30.0, 20.0, 40.0, 55.0, 35.0), (80.0, 50.0, 45.0, 60.0, 35.0)]
    {
        for side in [1.0, -1.0] {
            let mut m = four_bar(crank, coupler, rocker, base, drawn, side);
            m.drive(0, 0.0, 360.0, 0.0);
            let reach: f64 = coupler + rocker;
            let cosine: f64 = (crank * crank + base * base - reach * reach) / (2.0 * crank * base);
            let exact = cosine.acos().to_degrees() - drawn;
            let errors = solve_motion(&m.0, &[]).unwrap_err();
            assert_eq!(errors[0].code, "E0503");
            let said: f64 = errors[0]
                .message
                .strip_prefix("the mechanism cannot be assembled beyond `motor` = ")
                .and_then(|s| s.strip_suffix(" deg"))
                .unwrap_or_else(|| panic!("{}", errors[0].message))
                .parse()
                .unwrap();
            assert!((said - exact).abs() < 0.01, "{said} {exact}");
            assert_eq!(errors[0].labels[0].at, origin(2, 0));
            assert_eq!(errors[0].labels[1].at, origin(3, 0));
            assert!(errors[0].labels[2].text.contains("`knee`"), "{:?}", errors[0].labels);
        }
    }
    // And on the way to the rest pose.
    let mut m = four_bar(60.0, 35.0, 30.0, 40.0, 40.0, 1.0);
    m.drive(0, 0.0, 5.0, 170.0);
    let errors = solve_motion(&m.0, &[]).unwrap_err();
    assert!(errors[0].message.contains("on the way to the rest pose at `motor` = 170.00 deg"), "{errors:?}");
}

#[test]
fn rocker_cannot_drive_past_its_toggle() {
    // Crank–rocker driven at the rocker: ends where crank and coupler stand in line, |O − B| = coupler ± crank.
    let b = meet(polar(20.0, 75.0), 70.0, xy(60.0, 0.0), 50.0, 1.0);
    let angle =
        |reach: f64| ((60.0_f64.powi(2) + 50.0_f64.powi(2) - reach * reach) / 6000.0).acos().to_degrees();
    // The base relative to the rocker turns backwards when the rocker turns forwards, away from O.
    for (reach, target) in [(90.0, 120.0), (50.0, -120.0)] {
        let mut m = four_bar(20.0, 70.0, 50.0, 60.0, 75.0, 1.0);
        m.drive(3, 0.0, target, 0.0);
        let exact = angle(reach) - angle(b.norm());
        let message = solve_motion(&m.0, &[]).unwrap_err()[0].message.clone();
        let said: f64 = message.split([' ']).find_map(|word| word.parse().ok()).unwrap();
        assert!((said - exact).abs() < 0.01, "{message} {exact}");
    }
}

#[test]
fn galloping_kite_needs_two_turns_and_says_so() {
    // The knee lies on the bisector of crank and base: half a turn of it a turn of the crank.
    let mut m = four_bar(20.0, 50.0, 50.0, 20.0, 90.0, 1.0);
    m.0.joints.iter_mut().for_each(|j| j.realization = Realization::Conventional { pin_diameter_mm: None });
    m.drive(0, 0.0, 360.0, 0.0);
    let once = solved(&m.0);
    let codes: Vec<&str> = once.warnings.iter().map(|w| w.code.as_str()).collect();
    println!("{:#?}", once.warnings);
    assert_eq!(codes, ["W0506", "W0507"]);
    m.0.drives.clear();
    m.drive(0, 0.0, 720.0, 0.0);
    assert!(solved(&m.0).warnings.iter().all(|w| w.code == "W0506"));
}

#[test]
fn drawing_at_a_dead_point_is_said() {
    // The rocker drives; crank and coupler stand in line as drawn.
    let (o, d) = (xy(0.0, 0.0), xy(40.0, 0.0));
    let b = meet(o, 70.0, d, 50.0, 1.0);
    let a = b * (20.0 / 70.0);
    let mut m = Builder::new("toggle");
    let ids = [("base", true), ("crank", false), ("coupler", false), ("rocker", false)];
    let [base, crank, coupler, rocker] = ids.map(|(n, ground)| m.body(n, ground, 0));
    m.hinge("free", [base, crank], o, V::z(), 0, false);
    m.hinge("pin", [crank, coupler], a, V::z(), 0, false);
    m.hinge("knee", [coupler, rocker], b, V::z(), 0, false);
    let heel = m.hinge("heel", [rocker, base], d, V::z(), 0, false);
    m.drive(heel, 0.0, -10.0, 0.0);
    let errors = solve_motion(&m.0, &[]).unwrap_err();
    assert_eq!(errors[0].code, "E0505", "{errors:?}");
}

#[test]
fn bad_data_are_diagnostics() {
    let mut design = chebyshev(false);
    design.joints[0].kind = JointKind::Ball;
    let errors = solve_motion(&design, &[]).unwrap_err();
    let codes: Vec<&str> = errors.iter().map(|e: &Diagnostic| e.code.as_str()).collect();
    assert_eq!(codes, ["E0500"]);
    assert_eq!(errors[0].labels[0].at, origin(3, 0));
    let mut design = chebyshev(false);
    design.joints[1].bodies.truncate(1);
    assert_eq!(solve_motion(&design, &[]).unwrap_err()[0].code, "E0500");
    let mut design = chebyshev(false);
    design.joints[1].bodies[1] = 77;
    assert_eq!(solve_motion(&design, &[]).unwrap_err()[0].code, "E0500");
    let design = chebyshev(false);
    assert_eq!(solve_motion(&design, &[1.0]).unwrap_err()[0].code, "E0500");
    for spoil in [
        |d: &mut Design| d.cycle.steps = 0,
        |d: &mut Design| d.cycle.steps = usize::MAX,
        |d: &mut Design| d.drives[0].rest = f64::NAN,
        |d: &mut Design| d.drives[0].profile = Profile::Range { from: 0.0, to: 1e12 },
        |d: &mut Design| d.bodies.iter_mut().for_each(|b| b.ground = true),
    ] {
        let mut design = chebyshev(false);
        spoil(&mut design);
        assert_eq!(solve_motion(&design, &[]).unwrap_err()[0].code, "E0500");
    }
    let mut design = chebyshev(false);
    design.traces[0].point[0] = design.exprs.constant(f64::NAN);
    let wrong = solve_motion(&design, &[]).unwrap_err();
    assert_eq!((wrong[0].code.as_str(), wrong[0].labels[0].at), ("E0501", design.traces[0].origin));
}

#[test]
fn coarse_cycle_meets_the_same_states_as_a_fine_one() {
    let fine = solved(&jansen());
    let mut design = jansen();
    design.cycle.steps = 4;
    let coarse = solved(&design);
    for (state, same) in coarse.states.iter().zip(fine.states.iter().step_by(15)) {
        assert!((state.traces_mm[0] - same.traces_mm[0]).norm() < 1e-9);
        let turned = state.joint_values.iter().zip(&same.joint_values);
        assert!(turned.clone().all(|(a, b)| (a - b).abs() < 1e-10), "{turned:?}");
    }
}

#[test]
fn geometry_follows_the_free_variables() {
    let mut design = chebyshev(false);
    design.free.push(FreeVariable {
        path: "reach".into(),
        unit: "mm".into(),
        start: 20.0,
        lower: 15.0,
        upper: 25.0,
        origin: origin(5, 0),
    });
    design.joints[1].point[1] = design.exprs.push(Node::Free(0));
    let (same, fixed) = (solve_motion(&design, &[20.0]).unwrap(), solved(&chebyshev(false)));
    assert_eq!(same.states, fixed.states);
    let longer = solve_motion(&design, &[22.0]).unwrap();
    let drawn = polar(22.0, 90.0);
    for state in &longer.states {
        let pin = state.poses[2].point(&V::new(0.0, 22.0, -5.5));
        assert!(((pin - V::new(0.0, 0.0, -5.5)).norm() - drawn.norm()).abs() < 1e-10);
    }
    assert!((longer.states[30].traces_mm[0] - fixed.states[30].traces_mm[0]).norm() > 0.5);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Crank–rockers of any size, anywhere in space, against the intersection of two circles.
    #[test]
    fn any_crank_rocker_matches_its_closed_form(
        crank in 8.0..20.0_f64, coupler in 45.0..60.0_f64, rocker in 40.0..55.0_f64, base in 42.0..60.0_f64,
        drawn in 0.0..360.0_f64, right in any::<bool>(), turn in [-3.0..3.0_f64, -3.0..3.0, -3.0..3.0],
        away in [-500.0..500.0_f64, -500.0..500.0, -500.0..500.0], steps in 5_usize..90,
    ) {
        let mut lengths = [crank, coupler, rocker, base];
        lengths.sort_by(f64::total_cmp);
        // Grashof with some room, so that the loop never lies flat.
        prop_assume!(lengths[0] + lengths[3] + 2.0 < lengths[1] + lengths[2]);
        let side = if right { -1.0 } else { 1.0 };
        let place = nalgebra::Isometry3::new(V::from(away), V::from(turn));
        let mut m = four_bar(crank, coupler, rocker, base, drawn, side);
        for i in 0..4 {
            let e = m.0.joints[i].point.map(|id| m.0.exprs.as_constant(id).unwrap());
            let at = (place * nalgebra::Point3::from(V::from(e))).coords;
            m.0.joints[i].point = m.point(at);
            m.0.joints[i].axis = (place.rotation * V::z()).into();
            m.0.joints[i].realization = Realization::Conventional { pin_diameter_mm: None };
            // Layers must not matter to the motion in the plane.
            m.0.joints[i].layer = i as i32 - 2;
        }
        m.0.traces.clear();
        let knee = |angle: f64| {
            let b = meet(polar(crank, angle), coupler, xy(base, 0.0), rocker, side);
            (place * nalgebra::Point3::from(b)).coords
        };
        m.trace("knee", 2, knee(drawn));
        m.0.cycle.steps = steps;
        m.drive(0, 0.0, 360.0, 200.0);
        let motion = solve_motion(&m.0, &[]).map_err(|e| TestCaseError::fail(format!("{e:?}")))?;
        prop_assert!(motion.warnings.is_empty());
        for (i, state) in motion.states.iter().enumerate() {
            let exact = knee(drawn + 360.0 * i as f64 / steps as f64);
            let off = (state.traces_mm[0] - exact).norm();
            prop_assert!(off < 1e-8, "state {i}: {off}");
        }
        let resting = motion.rest_point(2, &knee(drawn));
        prop_assert!((resting - knee(drawn + 200.0)).norm() < 1e-8);
        prop_assert!((motion.span(0).span_rad - std::f64::consts::TAU).abs() < 1e-9);
    }

    /// Almost a parallelogram: two branches pass each other closely. Either the true one is kept, or it is said.
    #[test]
    fn nearly_crossing_branches_are_kept_apart_or_reported(exponent in -6.0..0.0_f64, drawn in 20.0..160.0_f64) {
        let room = 10.0_f64.powf(exponent);
        let (crank, coupler, rocker, base) = (20.0, 50.0, 20.0 + room, 50.0 + 0.5 * room);
        let mut m = four_bar(crank, coupler, rocker, base, drawn, 1.0);
        m.0.joints.iter_mut().for_each(|j| j.realization = Realization::Conventional { pin_diameter_mm: None });
        m.drive(0, 0.0, 360.0, 0.0);
        let motion = solve_motion(&m.0, &[]).map_err(|e| TestCaseError::fail(format!("{e:?}")))?;
        let exact = |i: usize| meet(polar(crank, drawn + 6.0 * i as f64), coupler, xy(base, 0.0), rocker, 1.0);
        let off = |(i, s): (usize, &flexura::kinematics::State)| (s.traces_mm[0] - exact(i)).norm();
        let worst = motion.states.iter().enumerate().map(off).fold(0.0, f64::max);
        // Close to the crossing the pose is badly conditioned: rounding over the least singular value.
        let kept = worst < 1e-6;
        prop_assert!(kept || motion.warnings.iter().any(|w| w.code == "W0506"), "room {room}: {worst}");
        // What is reported as crossing is indeed that close.
        prop_assert!(kept || room < 1e-3, "room {room}: {worst}");
    }
}

/// A crank and a rocker joined by a rod with balls at both ends, its second part joined to the first as `splice` says.
fn spliced_rod(splice: JointKind, at: V) -> Builder {
    let mut m = Builder::new("spliced");
    let base = m.body("base", true, 0);
    let [crank, first, second, rocker] = ["crank", "first", "second", "rocker"].map(|n| m.body(n, false, 0));
    let (a, b) = (V::new(0.0, 15.0, 5.0), V::new(60.0, 35.0, -5.0));
    let motor = m.hinge("motor", [base, crank], xy(0.0, 0.0), V::z(), 0, false);
    m.hinge("near", [crank, first], a, V::z(), 0, false);
    m.hinge("splice", [first, second], at, (b - a).normalize(), 0, false);
    m.hinge("far", [second, rocker], b, V::z(), 0, false);
    m.hinge("heel", [rocker, base], xy(60.0, 0.0), V::z(), 0, false);
    for (joint, kind) in [(1, JointKind::Ball), (2, splice), (3, JointKind::Ball)] {
        m.0.joints[joint].kind = kind;
    }
    m.drive(motor, 0.0, 40.0, 0.0);
    m.trace("tip", rocker, b);
    m
}

#[test]
fn idle_freedoms_of_several_bodies_are_found_by_rank() {
    let middle = V::new(30.0, 25.0, 0.0);
    // In one piece the two halves turn together; with a hinge along the rod each by itself.
    for (splice, count) in [(JointKind::Fixed, 1), (JointKind::Hinge, 2)] {
        let m = spliced_rod(splice, middle);
        let found = mobility(&m.0);
        assert_eq!((found.freedoms, found.undetermined, found.idle.len()), (1, 0, count), "{splice:?}");
        let bodies: std::collections::BTreeSet<usize> =
            found.idle.iter().flat_map(|i| i.bodies.iter().copied()).collect();
        assert_eq!(bodies.into_iter().collect::<Vec<_>>(), [2, 3], "{splice:?}");
        let motion = solved(&m.0);
        assert_eq!(motion.warnings.iter().map(|w| w.code.as_str()).collect::<Vec<_>>(), ["A0508"]);
        // The motion is that of the rod in one piece, whatever it is made of.
        let plain = solved(&spliced_rod(JointKind::Fixed, middle).0);
        for (a, b) in motion.states.iter().zip(&plain.states) {
            assert!((a.traces_mm[0] - b.traces_mm[0]).norm() < 1e-9);
        }
    }
}

#[test]
fn what_moves_something_is_not_idle() {
    // A point off the line of the balls goes round with the rod: its place is not determined.
    let middle = V::new(30.0, 25.0, 0.0);
    let mut m = spliced_rod(JointKind::Fixed, middle);
    m.trace("flag", 2, V::new(30.0, 25.0, 10.0));
    let errors = solve_motion(&m.0, &[]).unwrap_err();
    assert_eq!(errors[0].code, "E0502");
    assert!(errors[0].message.starts_with("mobility 2, drives 1"), "{}", errors[0].message);
    // A third ball in the rod is a real freedom too.
    let errors = solve_motion(&spliced_rod(JointKind::Ball, middle).0, &[]).unwrap_err();
    assert_eq!(errors[0].code, "E0502");
}

#[test]
fn sliders_and_cylinders_follow_their_closed_form() {
    // Crank and slider: the block on the x axis, between a cylindrical joint and a slider in turn.
    for kind in [JointKind::Slider, JointKind::Cylindrical] {
        let mut m = Builder::new("engine");
        let base = m.body("base", true, 0);
        let [crank, rod, block] = ["crank", "rod", "block"].map(|n| m.body(n, false, 0));
        let (r, l) = (20.0_f64, 55.0_f64);
        let at = |degrees: f64| {
            let pin = polar(r, degrees);
            xy(pin.x + (l * l - pin.y * pin.y).sqrt(), 0.0)
        };
        let motor = m.hinge("motor", [base, crank], xy(0.0, 0.0), V::z(), 0, false);
        m.hinge("pin", [crank, rod], polar(r, 50.0), V::z(), 0, false);
        m.hinge("gudgeon", [rod, block], at(50.0), V::z(), 0, false);
        let guide = m.hinge("guide", [base, block], at(50.0), V::x(), 0, false);
        m.0.joints[guide].kind = kind;
        m.drive(motor, 0.0, 360.0, 0.0);
        m.trace("block", block, at(50.0));
        let motion = solved(&m.0);
        assert!(motion.warnings.is_empty());
        for (i, state) in motion.states.iter().enumerate() {
            let exact = at(50.0 + 6.0 * i as f64);
            assert!((state.traces_mm[0] - exact).norm() < 1e-9);
            let way = if kind == JointKind::Slider { exact.x - at(50.0).x } else { 0.0 };
            assert!((state.joint_values[guide] - way).abs() < 1e-9);
        }
    }
}

#[test]
fn a_sliding_drive_that_goes_too_far_says_where_in_millimetres() {
    let design = from_text("hand");
    let mut far = design.clone();
    far.drives[0].profile = Profile::Range { from: 0.0, to: 30.0 };
    let errors = solve_motion(&far, &[]).unwrap_err();
    assert_eq!(errors[0].code, "E0503");
    assert!(errors[0].message.contains(" mm"), "{}", errors[0].message);
}
