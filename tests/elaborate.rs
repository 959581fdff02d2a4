//! Elaboration: what the texts become, and what is said about texts that are wrong.

// Test code may panic: that is how it fails.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::annotated;
use common::folder::Folder;
use flexura::elaborate::{Elaborated, FileError, Files, Options, codes, elaborate};
use flexura::ir::{Design, ExportKind, ObjectiveKind, Profile, Quantity, Realization, Section};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

const CHEBYSHEV: &str = include_str!("../examples/chebyshev/chebyshev.mech");
const SAMPLE: &str = include_str!("elaborate/samples/chebyshev.mech");

/// A folder of test files, with one file that is a link outward and one that is no text.
struct Errors(Folder);

impl Files for Errors {
    fn read(&self, path: &str) -> Result<String, FileError> {
        assert!(!path.contains(".."), "a path that leaves the folder was read: {path}");
        match path {
            "link.mech" => Err(FileError::Outside),
            "binary.mech" => Err(FileError::NotText),
            _ => self.0.read(path),
        }
    }
}

fn errors_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/elaborate/errors")
}

fn run(text: &str) -> Elaborated {
    run_with(text, &[])
}

fn run_with(text: &str, set: &[(&str, &str)]) -> Elaborated {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let set = set.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    elaborate("main.mech", &files, &Options { set, ..Options::default() })
}

fn design(e: Elaborated) -> Design {
    assert_eq!(e.diagnostics, []);
    e.design.unwrap()
}

fn found(e: &Elaborated) -> Vec<String> {
    e.diagnostics.iter().map(|d| format!("{} {}", d.code, d.message)).collect()
}

fn starts(d: &Design) -> Vec<f64> {
    d.free.iter().map(|f| f.start).collect()
}

#[test]
fn annotated_files_give_exactly_what_they_say() {
    annotated::check_folder(&errors_folder(), |path, _| {
        let name = path.file_name().unwrap().to_str().unwrap();
        elaborate(name, &Errors(Folder(errors_folder())), &Options::default()).diagnostics
    });
}

#[test]
fn every_code_has_a_test() {
    // These need more than one file that is wrong by itself; each has a test below.
    let elsewhere =
        [codes::IMPORT_CYCLE, codes::SET_UNKNOWN, codes::SET_SYNTAX, codes::TOO_LARGE, codes::NO_VARIANT];
    let mut seen: BTreeSet<String> = elsewhere.iter().map(|c| c.to_string()).collect();
    for entry in std::fs::read_dir(errors_folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "mech") {
            let text = std::fs::read_to_string(path).unwrap();
            seen.extend(text.lines().filter_map(|l| {
                l.trim().strip_prefix("//~").and_then(|l| l.split_whitespace().next()).map(str::to_string)
            }));
        }
    }
    let missing: Vec<_> = codes::ALL.iter().filter(|c| !seen.contains(c.code)).map(|c| c.code).collect();
    assert_eq!(missing, [""; 0]);
}

#[test]
fn chebyshev_has_the_points_of_the_drawing() {
    let d = design(run(CHEBYSHEV));
    let v = d.exprs.evaluate(&starts(&d));
    let body = |name: &str| d.bodies.iter().find(|b| b.name == name).unwrap();
    let points = |name: &str| -> Vec<(String, [f64; 3])> {
        body(name).skeleton.iter().map(|p| (p.name.clone(), v.point(p.position).into())).collect()
    };
    let want = |list: &[(&str, [f64; 3])]| -> Vec<(String, [f64; 3])> {
        list.iter().map(|(n, p)| (n.to_string(), *p)).collect()
    };
    // 3-4-5 triangles: A (0, 20), D (40, 0), both 50 from B; P mirrors A in B.
    assert_eq!(points("base"), want(&[("O", [0.0; 3]), ("D", [40.0, 0.0, 0.0])]));
    assert_eq!(points("crank"), want(&[("O", [0.0; 3]), ("A", [0.0, 20.0, 0.0])]));
    for (got, want) in [
        (
            points("coupler"),
            want(&[("A", [0.0, 20.0, 0.0]), ("B", [40.0, 50.0, 0.0]), ("P", [80.0, 80.0, 0.0])]),
        ),
        (points("rocker"), want(&[("B", [40.0, 50.0, 0.0]), ("D", [40.0, 0.0, 0.0])])),
    ] {
        assert_eq!(got.len(), want.len());
        for ((n, p), (m, q)) in got.iter().zip(&want) {
            assert_eq!(n, m);
            // Rounding of one meeting point at 50 mm.
            assert!(p.iter().zip(q).all(|(a, b)| (a - b).abs() < 1e-12), "{n} {p:?} {q:?}");
        }
    }
    assert!(body("base").ground && d.bodies[0].name == "base");
    assert_eq!(d.bodies.iter().map(|b| b.layer).collect::<Vec<_>>(), [-2, -1, 0, 0]);
}

#[test]
fn chebyshev_has_34_free_values_with_bounds_by_hand() {
    let d = design(run(CHEBYSHEV));
    let deg = PI / 180.0;
    let mut want: Vec<(String, &str, f64, f64, f64)> = Vec::new();
    // shorter_link is 50 mm at the knee (coupler A–B and rocker B–D) and 40 mm at the heel (base O–D).
    for (joint, size, thickest) in [("knee", 50.0 / 3.0, 2.0), ("heel", 40.0 / 3.0, 1.4)] {
        want.push((format!("{joint}.thickness"), "mm", 0.8, 0.6, thickest));
        for (rod, sign) in [("upper", 1.0), ("lower", -1.0)] {
            for (end, along, low, high) in [("from", 180.0, 60.0, 300.0), ("to", 0.0, -120.0, 120.0)] {
                let path = format!("{joint}.{rod}.{end}");
                want.push((format!("{path}.at.r"), "mm", size, 0.15 * size, 1.6 * size));
                want.push((format!("{path}.at.phi"), "rad", sign * 35.0 * deg, -150.0 * deg, 150.0 * deg));
                want.push((format!("{path}.along.r"), "mm", 2.0 * size, 0.2 * size, 4.0 * size));
                want.push((format!("{path}.along.phi"), "rad", along * deg, low * deg, high * deg));
            }
        }
    }
    assert_eq!(want.len(), 34);
    assert_eq!(d.free.len(), 34);
    for (f, (path, unit, start, lower, upper)) in d.free.iter().zip(want) {
        assert_eq!((f.path.as_str(), f.unit.as_str()), (path.as_str(), unit));
        for (got, want) in [(f.start, start), (f.lower, lower), (f.upper, upper)] {
            assert!((got - want).abs() < 1e-12 * want.abs().max(1.0), "{path} {got} {want}");
        }
    }
}

#[test]
fn chebyshev_has_its_rods_in_the_end_frames() {
    let d = design(run(CHEBYSHEV));
    let v = d.exprs.evaluate(&starts(&d));
    let paths: Vec<_> = d.rods.iter().map(|r| r.path.as_str()).collect();
    assert_eq!(paths, ["knee.upper", "knee.lower", "heel.upper", "heel.lower"]);
    let (coupler, rocker, base) = (2, 3, 0);
    assert_eq!((d.rods[0].from.body, d.rods[0].to.body), (coupler, rocker));
    assert_eq!((d.rods[2].from.body, d.rods[2].to.body), (rocker, base));
    // Two leaves of (12 − 0.4)/2 = 5.8 mm, their middles (12 + 0.4)/4 = 3.1 mm off the layer's middle.
    for (rod, side) in d.rods.iter().zip([1.0, -1.0, 1.0, -1.0]) {
        let size = if rod.joint == 2 { 50.0 / 3.0 } else { 40.0 / 3.0 };
        let (sin, cos) = (side * 35f64.to_radians()).sin_cos();
        for (end, along) in [(&rod.from, -1.0), (&rod.to, 1.0)] {
            let p = v.point(end.position);
            assert!((p - nalgebra::Vector3::new(size * cos, size * sin, side * 3.1)).norm() < 1e-12);
            let t = v.point(end.derivative);
            assert!((t - nalgebra::Vector3::new(along * 2.0 * size, 0.0, 0.0)).norm() < 1e-12);
        }
        let [a, b] = rod.section.half_widths();
        assert_eq!(v.value(a), 0.4);
        assert!((v.value(b) - 2.9).abs() < 1e-15);
    }
    let kinds: Vec<bool> = d.joints.iter().map(|j| j.is_compliant()).collect();
    assert_eq!(kinds, [false, false, true, true]);
    assert_eq!(d.joints[1].realization, Realization::Conventional { pin_diameter_mm: Some(3.0) });
    let toward: Vec<_> = d.joints[3].toward.iter().map(|(b, p)| (*b, v.point(*p))).collect();
    assert_eq!(toward, [(base, nalgebra::Vector3::new(40.0, -25.0, 0.0))]);
}

#[test]
fn chebyshev_has_its_drive_goals_and_records() {
    let d = design(run(CHEBYSHEV));
    assert_eq!((d.cycle.steps, d.cycle.duration_s), (60, 2.0));
    let drive = &d.drives[0];
    assert_eq!(drive.profile, Profile::Range { from: 0.0, to: TAU });
    assert!((drive.rest - PI / 6.0).abs() < 1e-15);
    assert_eq!(drive.motor.as_ref().unwrap().stall_n_mm, 400.0);
    let track = ObjectiveKind::Track { trace: 0, scale_mm: Some(0.1) };
    assert_eq!((d.objectives[0].kind.clone(), d.objectives[0].weight), (track, 1.0));
    let stress = ObjectiveKind::StressBelow { bound_mpa: 25.0, scale_mpa: Some(0.2) };
    assert_eq!((d.objectives[1].kind.clone(), d.objectives[1].weight), (stress, 1.0));
    let bounds: Vec<_> = d.requirements.iter().map(|r| (r.quantity.clone(), r.at_most, r.bound)).collect();
    assert_eq!(
        bounds,
        [
            (Quantity::Error(0), true, 1.0),
            (Quantity::Stress, true, 40.0 / 1.5),
            (Quantity::Torque(0), true, 80.0)
        ]
    );
    assert_eq!(d.requirements[1].text, "require max(stress()) <= rigur.strength / 1.5");
    assert_eq!((d.layers.height_mm, d.layers.pitch_mm, d.layers.axis), (12.0, 12.4, [0.0, 0.0, 1.0]));
    assert_eq!((d.material.e_mpa, d.material.nu, d.material.density_g_mm3), (1900.0, 0.4, Some(1.2e-3)));
    assert_eq!((d.process.least_wall_mm, d.process.clearance_mm), (0.6, 0.4));
    let exports: Vec<_> = d.exports.iter().map(|e| e.kind.clone()).collect();
    use ExportKind::{Arduino, Glb, Png, Report, Sheet, Stl, Svg, ThreeMf};
    assert_eq!(exports, [Stl, ThreeMf, Sheet, Glb, Svg, Png, Report, Arduino(0)]);
}

#[test]
fn terms_without_scale_have_the_papers_weights() {
    let text = CHEBYSHEV.replace(", scale = 0.1 mm", "").replace(", scale = 0.2 MPa", " ");
    let d = design(run(&text));
    assert_eq!(d.objectives.iter().map(|o| o.weight).collect::<Vec<_>>(), [1e5, 1e-6]);
}

#[test]
fn the_design_as_json() {
    let d = design(run(CHEBYSHEV));
    let json = serde_json::to_string(&d).unwrap();
    assert_eq!(serde_json::from_str::<Design>(&json).unwrap(), d);
    let mut value: serde_json::Value = serde_json::from_str(&json).unwrap();
    tidy(&mut value);
    insta::with_settings!({ snapshot_path => "elaborate/snapshots", prepend_module_to_snapshot => false }, {
        insta::assert_json_snapshot!("chebyshev", value);
    });
}

/// Rounds numbers to nine digits and drops places: they change with every edit of the text.
fn tidy(v: &mut serde_json::Value) {
    use serde_json::Value;
    match v {
        Value::Number(n) => {
            if let Some(x) = n.as_f64().filter(|_| n.is_f64()) {
                *v = format!("{x:.9}").parse::<f64>().unwrap().into();
            }
        }
        Value::Array(items) => items.iter_mut().for_each(tidy),
        Value::Object(map) => {
            map.remove("origin");
            map.values_mut().for_each(tidy);
        }
        _ => {}
    }
}

#[test]
fn terms_have_the_papers_weights_and_their_scales() {
    let terms = |text: &str| {
        let d = design(run(&CHEBYSHEV.replace("track(tip, scale = 0.1 mm)", text)));
        (d.objectives[0].kind.clone(), d.objectives[0].weight)
    };
    let torque = |reference_n_mm| ObjectiveKind::Torque { drive: 0, reference_n_mm };
    assert_eq!(terms("torque(motor)"), (torque(400.0), 10.0));
    assert_eq!(terms("torque(motor) weight 3"), (torque(400.0), 3.0));
    assert_eq!(terms("torque(motor, scale = 50 N*mm)"), (torque(50.0), 1.0));
    let sway = |force_n, scale_mm| ObjectiveKind::Sway { trace: 0, force_n, scale_mm };
    assert_eq!(terms("sway(tip)"), (sway(1.0, None), 5e5));
    assert_eq!(terms("sway(tip, force = 200 mN, scale = 0.2 mm)"), (sway(0.2, Some(0.2)), 1.0));
    assert_eq!(terms("stress()"), (ObjectiveKind::Stress { scale_mpa: None }, 1e-6));
    let scaled = ObjectiveKind::Stress { scale_mpa: Some(5.0) };
    assert_eq!(terms("stress(scale = 5 MPa)"), (scaled, 1.0));
    assert_eq!(terms("track(tip)"), (ObjectiveKind::Track { trace: 0, scale_mm: None }, 1e5));
}

#[test]
fn a_gap_can_be_required() {
    let d = design(run(&CHEBYSHEV.replace(
        "require max(error(tip))    <= 1 mm",
        "require min(gap()) >= 0.2 mm\n    require 0.2 mm <= min(gap())",
    )));
    let gaps: Vec<_> = d.requirements.iter().take(2).map(|r| (&r.quantity, r.aggregate, r.at_most)).collect();
    assert_eq!(gaps, [(&Quantity::Gap, flexura::ir::Aggregate::Min, false); 2]);
    assert!((d.requirements[0].bound - 0.2).abs() < 1e-12);
}

#[test]
fn torque_needs_something_to_compare_with() {
    let text = CHEBYSHEV
        .replace("track(tip, scale = 0.1 mm)", "torque(motor)")
        .replace(" with nema17", "")
        .replace("export arduino(motor)", "");
    assert_eq!(found(&run(&text)), ["E0204 which torque is large is not known here"]);
    design(run(&text.replace("torque(motor)\n", "torque(motor, scale = 80 N*mm)\n")));
}

/// A design with a joint for a flexure of the standard library: of the kind, and of as many bodies, as its text says.
fn host_of(module: &str) -> String {
    let path = format!("{}/stdlib/{}.mech", env!("CARGO_MANIFEST_DIR"), module.replace('.', "/"));
    let text = std::fs::read_to_string(path).unwrap();
    let kind = text.split(" replaces ").nth(1).unwrap().split(' ').next().unwrap();
    let third = if text.contains("to   c at") { ", k" } else { "" };
    let axes = match kind {
        "ball" => "",
        "universal" => "axis x and y",
        _ => "axis x",
    };
    let name = module.rsplit('.').next().unwrap();
    format!(
        "use std.{module}
        use std.materials.rigur
        use std.processes.polyjet
        mechanism host {{
            point O = (0 mm, 0 mm, 0 mm)
            point Q = (30 mm, 10 mm, 20 mm)
            point R = (-20 mm, 25 mm, -10 mm)
            ground g {{ O, Q }}
            link l {{ O, Q }}
            link k {{ O, R }}
            {kind} j: g to l{third} at O {axes} as {name}
            hinge first: g to l at Q axis z
            hinge second: g to k at R axis z
            material rigur
            print on polyjet
            cycle 4 steps over 1 s
            drive first from 0 deg to 1 deg
        }}"
    )
}

#[test]
fn every_standard_material_and_process_elaborates() {
    for module in flexura::elaborate::std_modules() {
        let name = module.rsplit('.').next().unwrap();
        let text = match module.split('.').next().unwrap() {
            "materials" => CHEBYSHEV
                .replace("use std.materials.rigur", &format!("use std.{module}"))
                .replace("material rigur", &format!("material {name}"))
                .replace("rigur.strength / 1.5", &format!("{name}.E / 100")),
            "processes" => CHEBYSHEV
                .replace("use std.processes.polyjet", &format!("use std.{module}"))
                .replace("print on polyjet", &format!("print on {name}")),
            // The crank turns fully, which a servo only does where it is said to.
            "motors" => {
                let text = CHEBYSHEV.replace("nema17", name);
                text.replace(&format!("with {name}"), &format!("with {name} continuous"))
            }
            "flexures" => host_of(&module),
            // Placed, and compared with what they are known for, in `tests/library.rs`.
            "mechanisms" => continue,
            other => panic!("a folder without a test: {other}"),
        };
        design(run(&text));
    }
}

#[test]
fn the_target_sample_is_understood() {
    assert_eq!(found(&run(SAMPLE)), [""; 0]);
}

#[test]
fn the_other_samples_give_only_what_is_not_available_yet() {
    for text in [
        include_str!("elaborate/samples/jansen.mech"),
        include_str!("elaborate/samples/car.mech"),
        include_str!("elaborate/samples/hand.mech"),
    ] {
        for d in run(text).diagnostics {
            // E0107: parts of the standard library that come later.
            assert!(d.code.starts_with("E09") || d.code == "E0107", "{} {}", d.code, d.message);
        }
    }
}

#[test]
fn settings_replace_parameters_and_fix_free_values() {
    let d = design(run_with(
        CHEBYSHEV,
        &[
            ("r", "30 mm"),
            ("knee.thickness", "0.9 mm"),
            ("heel.lower.to.at.phi", "-20 deg"),
            ("heel.height", "2 * r"),
        ],
    ));
    assert_eq!(d.free.len(), 32);
    assert!(!d.free.iter().any(|f| f.path == "knee.thickness" || f.path == "heel.lower.to.at.phi"));
    let v = d.exprs.evaluate(&starts(&d));
    assert_eq!(v.point(d.bodies[1].skeleton[1].position).y, 30.0);
    let [a, _] = d.rods[0].section.half_widths();
    assert_eq!(v.value(a), 0.45);
    let p = v.point(d.rods[3].to.position);
    assert!((p.y.atan2(p.x) + 20f64.to_radians()).abs() < 1e-15);
    // height 60 mm: lift = (60 + 0.4) / 4
    assert!((p.z + 15.1).abs() < 1e-12);
    // The shorter link at the heel is 2 r = 60 mm.
    let r = d.free.iter().find(|f| f.path == "heel.upper.from.at.r").unwrap();
    assert!((r.start - 20.0).abs() < 1e-12);
}

#[test]
fn settings_that_are_wrong_are_errors() {
    for (set, want) in [
        (("rr", "3 mm"), "E0114 there is nothing to set by the name `rr`"),
        (("half", "3 mm"), "E0114 there is nothing to set by the name `half`"),
        (("knee.wide", "3 mm"), "E0114 there is nothing to set by the name `knee.wide`"),
        (("r", "20"), "E0202 a length (mm) is needed, this number has no unit"),
        (("r", ""), "E0115 `` is not a value for `r`"),
        (("r", "3 mm\n    let x = 2"), "E0115 `3 mm\n    let x = 2` is not a value for `r`"),
        (("r", "3 mm } mechanism m {"), "E0115 `3 mm } mechanism m {` is not a value for `r`"),
        (("r", "3 mm +"), "E0115 `3 mm +` is not a value for `r`"),
    ] {
        assert_eq!(found(&run_with(CHEBYSHEV, &[set])), [want], "{set:?}");
    }
    let e = run_with(CHEBYSHEV, &[("knee.thicknes", "1 mm")]);
    assert_eq!(e.diagnostics[0].help.as_deref(), Some("did you mean `knee.thickness`?"));
    let twice = run_with(CHEBYSHEV, &[("r", "1 mm"), ("r", "2 mm")]);
    assert_eq!(found(&twice), ["E0102 `r` is set twice"]);
    // The place of a finding is the value itself.
    let e = run_with(CHEBYSHEV, &[("r", "20 mm + 3 deg")]);
    let at = e.diagnostics[0].labels[2].at;
    let file = &e.sources.files[at.file as usize];
    assert_eq!((file.name.as_str(), &file.text[at.start as usize..at.end as usize]), ("--set r", "3 deg"));
}

#[test]
fn steps_can_be_given_from_outside() {
    let files = BTreeMap::from([("main.mech".to_string(), CHEBYSHEV.to_string())]);
    let go = |n| elaborate("main.mech", &files, &Options { steps: Some(n), ..Options::default() });
    assert_eq!(go(120).design.unwrap().cycle.steps, 120);
    assert_eq!(found(&go(0)), ["E0413 `--steps 0` is not from 1 to 100000"]);
}

#[test]
fn imports_in_a_circle_show_the_circle() {
    let files = Errors(Folder(errors_folder().join("lib")));
    let e = elaborate("ring_a.mech", &files, &Options::default());
    assert!(
        found(&e).contains(
            &"E0106 files import each other in a circle: ring_a.mech → ring_b.mech → ring_a.mech".into()
        ),
        "{:?}",
        found(&e)
    );
}

#[test]
fn imports_cannot_leave_the_folder_through_a_chain() {
    let text = "use \"lib/outward.mech\"\n".to_string();
    let outward = std::fs::read_to_string(errors_folder().join("lib/outward.mech")).unwrap();
    struct Guarded(BTreeMap<String, String>);
    impl Files for Guarded {
        fn read(&self, path: &str) -> Result<String, FileError> {
            self.0.get(path).cloned().ok_or_else(|| panic!("asked for {path}"))
        }
    }
    let files = Guarded(BTreeMap::from([("a.mech".into(), text), ("lib/outward.mech".into(), outward)]));
    let e = elaborate("a.mech", &files, &Options::default());
    assert!(found(&e).contains(&"E0108 `../../secret.mech` may not be imported".into()), "{:?}", found(&e));
}

#[test]
fn imports_are_relative_to_the_importing_file() {
    let lib = CHEBYSHEV.replace("use std.materials.rigur\n", "");
    let files = BTreeMap::from([
        ("main.mech".to_string(), lib.replace("edition 1\n", "edition 1\nuse \"parts/all.mech\"\n").replace("material rigur", "material plain")
            .replace("rigur.strength", "plain.strength")),
        ("parts/all.mech".to_string(), "use \"deep/e.mech\"\nmaterial plain {\n    E = 2 * base.E\n    nu = 0.3\n    strength = 40 MPa\n}\n".to_string()),
        ("parts/deep/e.mech".to_string(), "material base {\n    E = 1 GPa\n    nu = 0.3\n}\n".to_string()),
    ]);
    let d = design(elaborate("main.mech", &files, &Options::default()));
    assert_eq!(d.material.e_mpa, 2000.0);
}

#[test]
fn a_root_that_cannot_be_read_is_an_error() {
    let e = elaborate("gone.mech", &BTreeMap::new(), &Options::default());
    assert_eq!(found(&e), ["E0109 cannot read `gone.mech`"]);
    assert_eq!(e.sources.files.len(), 1);
}

#[test]
fn five_independent_mistakes_give_five_errors() {
    let text = CHEBYSHEV
        .replace("= 20 mm\n", "= 20\n")
        .replace("2.5 * r", "2.5 * q")
        .replace("0.6 mm .. 1.4 mm", "0.9 mm .. 1.4 mm")
        .replace("print on polyjet", "print on polijet")
        .replace("track(tip", "track(tap");
    let e = run(&text);
    let codes: Vec<_> = e.diagnostics.iter().map(|d| d.code.as_str()).collect();
    assert_eq!(codes, ["E0202", "E0101", "E0207", "E0101", "E0101"], "{:?}", found(&e));
}

#[test]
fn expressions_have_right_derivatives() {
    let text = CHEBYSHEV.replace(
        "as crossed_leaves { thickness = free 0.8 mm in 0.6 mm .. 1.4 mm }",
        "as crossed_leaves { thickness = w }",
    );
    let text = text.replace(
        "    let   half = 2.5 * r\n",
        "    let   half = 2.5 * r
    let   q = free 0.3 in 0.1 .. 0.9
    let   g = free 2 mm in 1 mm .. 3 mm
    let   phi = atan2(q * g, 1 mm) + asin(q) - acos(q) + 90 deg
    let   c = circle(O + (g, 0 mm), 3 mm)
    let   m = meet(c, circle(O, g * 2), right)
    let   w = min(sqrt(g^2 + (q * 1 mm)^2) / 4, max(g, 9 mm)) * abs(sin(phi) * cos(phi) + 2)
              + distance(m, O + polar(g, phi)) / 20 - tan(phi / 8) * 0.1 mm + (g / 1 mm)^-2 * 1 mm\n",
    );
    let d = design(run(&text));
    let p = starts(&d);
    let v = d.exprs.evaluate(&p);
    let [a, _] = d.rods[2].section.half_widths();
    let mut ids = vec![a];
    for r in &d.rods {
        ids.extend([r.from.position, r.from.derivative, r.to.position, r.to.derivative].concat());
    }
    let mut moving = 0;
    for id in ids {
        for k in 0..p.len() {
            // Central differences: error h² f'''/6 + ε f/h, least near h = 1e-5 of the value.
            let h = 1e-5 * p[k].abs().max(1.0);
            let shifted = |s: f64| {
                let mut q = p.clone();
                q[k] += s;
                d.exprs.values(&q)[id.0 as usize]
            };
            let difference = (shifted(h) - shifted(-h)) / (2.0 * h);
            let exact = v.gradient(id)[k];
            moving += usize::from(exact != 0.0);
            assert!(
                (difference - exact).abs() < 1e-8 * (1.0 + exact.abs()),
                "{} {exact} {difference}",
                d.free[k].path
            );
        }
    }
    assert!(moving > 50, "{moving}");
    let w = v.gradient(a);
    assert!(w.iter().filter(|g| **g != 0.0).count() == 2, "the section depends on q and g");
}

/// Full widths in the text, half widths in the design.
#[test]
fn sections_of_every_shape() {
    let leaves = include_str!("../stdlib/flexures/crossed_leaves.mech");
    let rect =
        leaves.replacen("ellipse(thick = thickness, wide = wide)", "rect(wide = wide, thick = thickness)", 1);
    let both = rect.replacen("ellipse(thick = thickness, wide = wide)", "round(thickness)", 1);
    let main = CHEBYSHEV.replace("use std.flexures.crossed_leaves", "use \"leaves.mech\"");
    let files = BTreeMap::from([("main.mech".to_string(), main), ("leaves.mech".to_string(), both)]);
    let d = design(elaborate("main.mech", &files, &Options::default()));
    let v = d.exprs.values(&starts(&d));
    let halves = |s: &Section| s.half_widths().map(|id| v[id.0 as usize]);
    assert!(matches!(d.rods[0].section, Section::Rect { .. }), "{:?}", d.rods[0].section);
    assert_eq!(halves(&d.rods[0].section)[0], 0.4);
    assert!(halves(&d.rods[0].section)[1] > 1.0);
    assert!(matches!(d.rods[1].section, Section::Round { .. }), "{:?}", d.rods[1].section);
    assert_eq!(halves(&d.rods[1].section), [0.4; 2]);
}

#[test]
fn too_much_is_an_error_not_a_hang() {
    let wrap = |body: &str| format!("mechanism m {{\n{body}}}\n");
    let lines = |n: usize, f: &dyn Fn(usize) -> String| (0..n).map(f).collect::<String>();
    let chain = lines(5000, &|i| format!("    let v{i} = v{} + 1\n", i + 1));
    let rod = "    rod R {\n        from a at cyl(1 mm, 0 deg) along cyl(1 mm, 0 deg)\n        to b at cyl(1 mm, 0 deg) along cyl(1 mm, 0 deg)\n        section round(1 mm)\n    }\n";
    let template = format!(
        "flexure big replaces hinge {{\n{}{}}}\n",
        lines(2000, &|i| format!("    let v{i} = {i}.5 mm * 2\n")),
        lines(100, &|i| rod.replace('R', &format!("r{i}")))
    );
    let joints =
        "    point O = (0 mm, 0 mm)\n    ground g { O }\n    link l { O }\n    point Q = (1 mm, 0 mm)\n"
            .to_string()
            + &lines(256, &|i| {
                format!("    hinge h{i}: g to l at {} as big\n", if i % 2 == 0 { "O" } else { "Q" })
            });
    for (what, text) in [
        ("chain", wrap(&format!("{chain}    let v5000 = 1\n"))),
        ("deep", wrap(&format!("    let v = {}1{}\n", "(".repeat(20_000), ")".repeat(20_000)))),
        ("sum", wrap(&format!("    let v = 1{}\n", " + 1".repeat(20_000)))),
        ("many", wrap(&lines(30_000, &|i| format!("    let v{i} = {i}.5 mm * 2\n")))),
        ("unknown", wrap(&lines(20_000, &|i| format!("    let v{i} = w{i}\n")))),
        ("points", wrap(&format!("    ground g {{ {} Q }}\n", lines(50_000, &|i| format!("P{i}, "))))),
        ("template", template + &wrap(&joints)),
    ] {
        let begin = std::time::Instant::now();
        let e = run(&text);
        println!("{what}: {:?}, {} findings", begin.elapsed(), e.diagnostics.len());
        assert!(e.design.is_none(), "{what}");
        assert!(e.diagnostics.len() <= 101, "{what}");
        assert!(begin.elapsed().as_secs() < 20, "{what}");
    }
    let e = run(&wrap(&format!("{chain}    let v5000 = 1\n")));
    assert!(e.diagnostics.iter().any(|d| d.code == codes::TOO_LARGE && d.message.contains("nested")));
}

#[test]
fn the_deepest_nesting_fits_a_small_stack() {
    let chain: String = (0..1000).map(|i| format!("    let v{i} = abs(v{} + 1)\n", i + 1)).collect();
    let text = format!("mechanism m {{\n{chain}    let v1000 = 1\n}}\n");
    let work = move || run(&text).diagnostics.iter().any(|d| d.message.contains("nested"));
    let thread = std::thread::Builder::new().stack_size(512 << 10).spawn(work).unwrap();
    assert!(thread.join().unwrap());
}

#[test]
fn the_result_does_not_depend_on_the_order_of_declarations() {
    let d = design(run(CHEBYSHEV));
    let line = "    let   half = 2.5 * r\n";
    let moved =
        CHEBYSHEV.replace(line, "").replace("    material rigur\n", &format!("    material rigur\n{line}"));
    let e = design(run(&moved));
    let strip = |d: &Design| {
        let mut v = serde_json::to_value(d).unwrap();
        tidy(&mut v);
        v["exprs"] = serde_json::Value::Null;
        v
    };
    assert_eq!(d.exprs.nodes.len(), e.exprs.nodes.len());
    assert_eq!(strip(&d)["free"], strip(&e)["free"]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Words moved, doubled, dropped or replaced: whatever comes out, nothing panics, and a design
    /// comes only without errors.
    #[test]
    fn mutated_samples_never_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), 0usize..5, any::<prop::sample::Index>()), 1..6)) {
        let mut words: Vec<String> = split(CHEBYSHEV);
        for (at, kind, from) in edits {
            let i = at.index(words.len());
            let other = words[from.index(words.len())].clone();
            match kind {
                0 => drop(words.remove(i)),
                1 => words.insert(i, other),
                2 => words[i] = other,
                3 => words[i] = "0".into(),
                _ => words[i] = "free 1 mm in 0 mm .. 2 mm".into(),
            }
        }
        let e = run(&words.concat());
        prop_assert_eq!(e.design.is_some(), !e.diagnostics.iter().any(|d| d.is_error()));
        for label in e.diagnostics.iter().flat_map(|d| &d.labels) {
            let text = &e.sources.files[label.at.file as usize].text;
            prop_assert!(text.get(label.at.start as usize..label.at.end as usize).is_some());
        }
    }

    /// Values for `--set` are arbitrary text from outside.
    #[test]
    fn settings_never_panic(value in "[0-9a-z .()+*/^,{}=\\n\"-]{0,24}") {
        run_with(CHEBYSHEV, &[("r", &value), ("knee.thickness", &value)]);
    }
}

/// Words, numbers and single signs, with the white space kept as words of its own.
fn split(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for c in text.chars() {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        match out.last_mut() {
            Some(last) if word(c) && last.chars().all(word) => last.push(c),
            _ => out.push(c.to_string()),
        }
    }
    out
}

#[test]
fn the_rest_pose_may_be_free() {
    let free = |value: &str| CHEBYSHEV.replace("rest  motor at 30 deg", &format!("rest  motor at {value}"));
    let d = design(run(&free("free 30 deg in 0 deg .. 90 deg")));
    let i = d.free.iter().position(|f| f.path == "motor.rest").unwrap();
    assert_eq!((d.free[i].unit.as_str(), d.free[i].lower), ("rad", 0.0));
    assert_eq!(d.geometry_variables(), [i]);
    let mut p: Vec<f64> = d.free.iter().map(|f| f.start).collect();
    p[i] = 1.0;
    let drive = &d.drives[0];
    assert!((drive.rest - PI / 6.0).abs() < 1e-15 && drive.rest_value(&d.exprs.values(&p)) == 1.0);
    let again: flexura::ir::Design = serde_json::from_str(&serde_json::to_string(&d).unwrap()).unwrap();
    assert_eq!(again.drives[0].free_rest, drive.free_rest);
    let codes = |text: &str| run(text).diagnostics.iter().map(|d| d.code.clone()).collect::<Vec<_>>();
    assert_eq!(codes(&free("free 3 mm in 1 mm .. 4 mm")), ["E0201"]);
    assert_eq!(codes(&free("1 / 0 * 30 deg")), ["E0302"]);
    // A number of the command line takes the place of the free value.
    let fixed = design(run_with(&free("free 30 deg in 0 deg .. 90 deg"), &[("motor.rest", "40 deg")]));
    assert_eq!(fixed.drives[0].free_rest, None);
    assert!((fixed.drives[0].rest - 40.0_f64.to_radians()).abs() < 1e-15);
}
