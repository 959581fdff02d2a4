//! `solid "FILE" on BODY`: what is read becomes part of the link, in the printed form, in what is measured and in what is weighed.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::parts;
use flexura::elaborate::{Options, elaborate};
use flexura::emit::lock::design_digest;
use flexura::geometry::{
    FitFaultKind, Member, MovedState, PartsInput, Probe, build_carved_parts, build_parts, carved_cycle_gaps,
    check_mesh, cycle_gaps, printed_volume_and_center,
};
use flexura::ir::Design;
use flexura::math::Pose;
use flexura::pipeline::{self, BuildOutcome, Compiler, Request};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// Volumes on the grid, of those of the meshes: a body with a block of 12 mm on it, measured 0.1 %.
const WEIGHED: f64 = 0.01;
/// Clearance of the process, mm.
const CLEARANCE_MM: f64 = 0.5;

/// A block by half its edges, mm, as ASCII STL.
fn block(half: [f64; 3]) -> String {
    let corner =
        |i: usize| (0..3).map(move |k| format!(" {}", if i >> k & 1 == 1 { half[k] } else { -half[k] }));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    let facet = |t: [usize; 3]| {
        let corners: String =
            t.iter().map(|i| format!("vertex{}\n", corner(*i).collect::<String>())).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid block\n{}endsolid block\n", triangles.map(facet).collect::<String>())
}

fn nodder(fit: &str) -> String {
    parts::nodder("nema17", fit, "", "export stl")
}

fn files(fit: &str, half: [f64; 3]) -> BTreeMap<String, String> {
    [("main.mech", nodder(fit)), ("block.stl", block(half))]
        .map(|(name, text)| (name.to_string(), text))
        .into()
}

fn design(fit: &str, half: [f64; 3]) -> Design {
    parts::design_of(&files(fit, half))
}

fn input(fit: &str, half: [f64; 3]) -> PartsInput {
    parts::input(&design(fit, half))
}

fn rest(input: &PartsInput) -> MovedState {
    let poses = vec![Pose::rest(Vector3::zeros()); input.bodies.len()];
    MovedState { poses, flexures: input.flexures.clone() }
}

const BASE: usize = 0;
const ROCKER: usize = 3;

#[test]
fn a_solid_is_where_and_as_large_as_it_is_put() {
    let fit = "solid \"block.stl\" on rocker at P + (4 mm, 4 mm) turned 90 deg about z scale = 2";
    let (with, without) = (input(fit, [2.0, 3.0, 4.0]), input("", [1.0; 3]));
    let (parts, bare) = (build_parts(&with).unwrap(), build_parts(&without).unwrap());
    let (mesh, bare) = (&parts.parts[0].mesh, &bare.parts[0].mesh);
    assert!(check_mesh(mesh).is_printable() && parts.out_of_reach.is_empty());
    let added = mesh.volume_mm3() - bare.volume_mm3();
    // Some of it lies in the link.
    assert!(added < 8.0 * 192.0 && added > 0.6 * 8.0 * 192.0, "{added}");
    // Turned and scaled: 12 mm along x, 8 along y, 16 along z.
    let probe = Probe::new(mesh);
    let at = Vector3::new(84.0 + 3.0, 64.0 + 3.0, 0.3);
    for (direction, size) in [(Vector3::x(), 12.0), (Vector3::z(), 16.0)] {
        let found = probe.thickness_mm(&(at + Vector3::new(2.0, 0.4, 6.0)), &direction).unwrap();
        assert!((found - size).abs() < 1e-4, "{found} {size}");
    }
}

#[test]
fn a_solid_is_weighed() {
    let fit = "solid \"block.stl\" on rocker at P + (7 mm, 5 mm)";
    for input in [input(fit, [6.0, 6.0, 6.0]), input("", [1.0; 3])] {
        let parts = build_parts(&input).unwrap();
        let link = &parts.parts[0].links[parts.parts[0].bodies.iter().position(|b| *b == ROCKER).unwrap()];
        let (volume, center) = printed_volume_and_center(&parts.plans[ROCKER], 0.4);
        assert!((volume / link.volume_mm3() - 1.0).abs() < WEIGHED, "{volume} {}", link.volume_mm3());
        // By the divergence theorem, as the volume.
        let moment: Vector3<f64> = (0..link.triangles.len())
            .map(|t| {
                let [a, b, c] = link.corners(t);
                (a + b + c) / 4.0 * a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((moment / link.volume_mm3() - center).norm() < 0.2, "{center}");
    }
}

#[test]
fn gaps_are_measured_to_the_surface() {
    // Beside the boss at P, which is 0.35 · 12 + 0.4 mm wide, and as high as its layer.
    let beside = |gap: f64| format!("solid \"block.stl\" on base at P + ({} mm, 0 mm)", 4.6 + gap + 5.0);
    for gap in [0.7, 2.0] {
        let input = input(&beside(gap), [5.0, 5.0, 5.0]);
        let parts = build_parts(&input).unwrap();
        let others = |a: Member, b: Member| (a, b) != (Member::Body(BASE), Member::Body(ROCKER));
        let found = cycle_gaps(&parts.plans, &[rest(&input)], others).least[0].unwrap();
        assert!((found.gap_mm - gap).abs() < 1e-3, "{} {gap}", found.gap_mm);
        // Moved with its body, it comes nearer.
        let mut moved = rest(&input);
        moved.poses[ROCKER].translation.x = 0.5;
        let found = cycle_gaps(&parts.plans, &[moved], others).least[0].unwrap();
        assert!((found.gap_mm - gap + 0.5).abs() < 1e-3, "{} {gap}", found.gap_mm);
        // And it is no part of anything.
        let loose = parts.out_of_reach.iter().any(|f| matches!(f.kind, FitFaultKind::Loose(_)));
        assert!(loose, "{:?}", parts.out_of_reach);
    }
    let parts = build_parts(&input(&beside(-1.0), [5.0, 5.0, 5.0])).unwrap();
    let told = parts.fusions.iter().find(|f| (f.a, f.b) == (Member::Body(BASE), Member::Body(ROCKER)));
    assert!(told.is_some_and(|f| f.depth_mm > 0.5), "{:?}", parts.fusions);
}

#[test]
fn what_flexures_of_the_link_sweep_is_taken_out_of_its_solid() {
    // Round the joint, on the rocker: both leaves of the knee pass through it.
    let input = input("solid \"block.stl\" on rocker at B", [11.0, 9.0, 5.9]);
    let states = [rest(&input)];
    let whole = build_parts(&input).unwrap();
    let knee: Vec<usize> =
        (0..input.flexures.len()).filter(|f| input.flexures[*f].path.starts_with("knee")).collect();
    let others = |a: Member, b: Member| {
        !(a == Member::Body(ROCKER) && matches!(b, Member::Flexure(f) if knee.contains(&f)))
    };
    let before = cycle_gaps(&whole.plans, &states, others).least[0].unwrap();
    assert!(before.gap_mm < 0.0, "{before:?}");
    let parts = build_carved_parts(&input, &states).unwrap();
    assert!(knee.iter().all(|f| parts.carving.made(ROCKER, *f)), "{:?}", parts.carving.cuts);
    let after = carved_cycle_gaps(&parts.plans, &states, &parts.carving, CLEARANCE_MM, others).least[0];
    assert!(after.is_none_or(|g| g.gap_mm >= CLEARANCE_MM), "{after:?}");
    assert!(check_mesh(&parts.parts[0].mesh).is_sound());
}

#[test]
fn a_lock_outlives_a_solid_unless_it_is_weighed() {
    let fit = "solid \"block.stl\" on rocker at P";
    let digest = |fit: &str, size: f64| design_digest(&design(fit, [size; 3]));
    assert_eq!(digest(fit, 5.0), digest("", 5.0));
    assert_eq!(digest("solid \"block.stl\" on rocker at P + (0.3 mm, 0.7 mm, 0 mm)", 5.0), digest("", 5.0));
    let heavy = format!("{fit}\n    load gravity (0, -1, 0)");
    assert_ne!(digest(&heavy, 5.0), digest(&heavy, 6.0));
    let apart = |fit: &str| {
        let text = nodder(fit).replace("track(tip)", "track(tip), collision(gap = 0.5 mm)");
        let mut files = files("", [5.0; 3]);
        files.insert("main.mech".into(), text);
        design_digest(&elaborate("main.mech", &files, &Options::default()).design.unwrap())
    };
    assert_eq!(apart(fit), apart(""));
}

fn built(files: &BTreeMap<String, String>) -> BuildOutcome {
    let request = Request { source: "main.mech".into(), ..Request::default() };
    let compiler = Compiler { iterations: 0, ..Compiler::default() };
    pipeline::build(&request, &compiler, files, &common::NoClock, &AtomicBool::new(false))
}

fn told(out: &BuildOutcome, code: &str) -> Vec<String> {
    let own = out.diagnostics.iter().filter(|d| d.code == code);
    own.map(|d| format!("{}; {}", d.message, d.labels[0].text)).collect()
}

#[test]
fn what_is_wrong_with_a_solid_is_told() {
    let mut open = files("solid \"block.stl\" on rocker at P", [5.0; 3]);
    let text = open["block.stl"].replacen("facet", "cut", 1);
    let first = text.find("cut normal").unwrap();
    let end = text[first..].find("endfacet\n").unwrap() + first + "endfacet\n".len();
    open.insert("block.stl".into(), format!("{}{}", &text[..first], &text[end..]));
    let found = told(&built(&open), "E0465");
    assert!(found[0].contains("bounds no solid; 3 edges have one triangle only"), "{found:?}");

    let mut two = files("solid \"block.stl\" on rocker at P", [5.0; 3]);
    let other = block([3.0, 4.0, 8.0]).replacen("solid block\n", "", 1);
    let both = two["block.stl"].replacen("endsolid block\n", &other, 1);
    two.insert("block.stl".into(), both);
    let found = told(&built(&two), "E0465");
    assert!(found[0].contains("pairs of triangles cross"), "{found:?}");

    let far = files("solid \"block.stl\" on rocker at P + (0 mm, 0 mm, 40 mm)", [5.0; 3]);
    let found = told(&built(&far), "E0655");
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("29."), "40 mm, less 5 and half a link: {found:?}");
}

const PAIR: &str = "
mechanism pair {
    ground board { }
    place one = nodder at (0 mm, 0 mm)         merging base into board
    place two = nodder at (0 mm, 0 mm, 60 mm)  merging base into board
    //OWN
    export stl, sheet
}
";

fn pair(own: &str) -> BuildOutcome {
    let mut files = files("", [20.0, 6.0, 45.0]);
    let text = format!("{}{}", files["main.mech"], PAIR.replace("//OWN", own));
    files.insert("main.mech".into(), text);
    built(&files)
}

#[test]
fn a_ground_of_instances_carries_holes_motors_and_solids() {
    let own = "solid \"block.stl\" on board at (20 mm, -50 mm, 5 mm)
    hole 4 mm on board at (20 mm, -70 mm, -25 mm)
    mount nema17 on two.base at (-20 mm, -60 mm, 35 mm)  along (0, 0, 1)";
    let out = pair(own);
    // What is wrong with the nodders by themselves.
    let bare = pair("");
    let errors = |out: &BuildOutcome| -> Vec<String> {
        out.diagnostics.iter().filter(|d| d.is_error()).map(|d| d.message.clone()).collect()
    };
    assert_eq!(errors(&out), errors(&bare));
    // The block joins what without it are two parts.
    assert!(told(&out, "W0640").is_empty(), "{:?}", told(&out, "W0640"));
    assert!(!told(&bare, "W0640").is_empty());
    let sheet = out.artefacts.iter().find(|a| a.name.ends_with(".md")).unwrap();
    let sheet = String::from_utf8(sheet.bytes.clone()).unwrap();
    assert!(sheet.contains("nema17") && sheet.contains("screw"), "{sheet}");
}
