//! `fillet`: roots of printed flexures are round, rods and locks are as without.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::parts::design;
use flexura::elaborate::{Options, elaborate};
use flexura::emit::lock::design_digest;
use flexura::geometry::{Mesh, PartsInput, check_mesh, section};
use std::collections::BTreeMap;

/// A leaf along x from -10 mm to 10 mm, 0.8 mm thick.
const PIVOT: &str = "edition 1
use std.materials.rigur
use std.processes.polyjet
use std.flexures.leaf
use std.motors.nema17
mechanism pivot {
    point G = (-40 mm, 0 mm)
    point O = (0 mm, 0 mm)
    point T = (40 mm, 0 mm)
    ground base { G, O }
    link   arm  { O, T }
    hinge  knee: base to arm at O  //JOINT
    //LINKS
    material rigur
    print on polyjet
    cycle 4 steps over 1 s
    drive knee from -5 deg to 5 deg with nema17
}
";
const LEAF: &str = "into base toward G  into arm toward T  as leaf { size = 10 mm, thickness = 0.8 mm }";
/// A wire along x, in bodies made of round bars.
const SPACE: &str = "use std.materials.rigur
use std.processes.polyjet
use std.flexures.wire
mechanism m {
    point O = (0 mm, 0 mm, 0 mm)
    point A = (-30 mm, 0 mm, 0 mm)
    point B = (30 mm, 0 mm, 0 mm)
    point C = (30 mm, 25 mm, -10 mm)
    ground wall { O, A }
    link   tip  { O, B, C }
    ball   flex: wall to tip at O  into wall toward A  into tip toward B  as wire { size = 10 mm }
    //LINKS
    material rigur
    print on polyjet
    cycle in 2 steps
    load 0.1 N * t along (0, 0, -1) on tip at B
}
";

fn pivot(links: &str, joint: &str) -> String {
    PIVOT.replace("//LINKS", links).replace("//JOINT", &format!("{joint} {LEAF}"))
}

fn codes(text: &str) -> Vec<String> {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let found = elaborate("main.mech", &files, &Options::default());
    found.diagnostics.iter().filter(|d| d.is_error()).map(|d| d.code.to_string()).collect()
}

fn input(text: &str) -> PartsInput {
    common::parts::input(&design(text))
}

fn part(text: &str) -> Mesh {
    let part = common::parts::part(text);
    let facts = check_mesh(&part);
    assert!(facts.is_printable(), "{facts:?}");
    part
}

/// Largest turn of a section's outline to the right, that is of an inner corner, near both roots of a flexure from -10 mm to 10 mm
/// along x; degrees.
fn inner_corner_deg(mesh: &Mesh, z_mm: f64) -> f64 {
    let mut worst: f64 = 0.0;
    for mut outline in section(mesh, z_mm) {
        // Of pieces that the lattice turns nothing is told: what is so near is one point.
        outline.dedup_by(|p, q| (p[0] - q[0]).hypot(p[1] - q[1]) < 0.02);
        let n = outline.len();
        for i in 0..n {
            let [p, q, r] = [outline[(i + n - 1) % n], outline[i], outline[(i + 1) % n]];
            if (q[0].abs() - 10.0).abs() > 2.0 || q[1].abs() > 1.5 {
                continue;
            }
            let (a, b) = ([q[0] - p[0], q[1] - p[1]], [r[0] - q[0], r[1] - q[1]]);
            let turn = (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]);
            worst = worst.max(-turn.to_degrees());
        }
    }
    worst
}

/// Arcs end 15° before the nose, facets add theirs.
const ROUND_DEG: f64 = 25.0;
const SHARP_DEG: f64 = 60.0;

#[test]
fn roots_are_round() {
    let sharp = part(&pivot("", ""));
    assert!(inner_corner_deg(&sharp, 0.01) > SHARP_DEG);
    for radius in [0.2, 0.5, 1.0, 2.0] {
        let round = part(&pivot(&format!("links fillet {radius} mm"), ""));
        for z in [0.01, 2.0] {
            let turn = inner_corner_deg(&round, z);
            assert!(turn > 1.0 && turn < ROUND_DEG, "radius {radius} at {z}: {turn}");
        }
    }
}

#[test]
fn a_wire_is_round_all_round() {
    assert!(inner_corner_deg(&part(SPACE), 0.01) > SHARP_DEG);
    let text = SPACE.replace("//LINKS", "links fillet 0.5 mm");
    assert!(inner_corner_deg(&part(&text), 0.01) < ROUND_DEG);
    let fillets = input(&text).flexures[0].fillets;
    assert!(fillets.iter().all(|f| f.is_some_and(|f| f.all_round > 0.5)), "{fillets:?}");
}

/// The leaf keeps its thickness up to where the fillet begins, has grown by what a circle has there, and the nose stands where the arc ends.
#[test]
fn a_fillet_begins_where_the_root_is_as_compliant_as_a_clamp() {
    let text = pivot("links fillet 0.5 mm", "");
    let fillet = input(&text).flexures[0].fillets[0].unwrap();
    let (t, r) = (0.8_f64, 0.5_f64);
    // docs/rod-model.md
    let start = t * (0.358 + 0.254 * (r / t).sqrt() + 0.108 * r / t);
    assert!((fillet.start_mm - start).abs() < 1e-12, "{fillet:?}");
    let outlines = section(&part(&text), 0.01);
    let half = |x: f64| {
        let crossings = outlines.iter().flat_map(|o| {
            (0..o.len()).filter_map(move |i| {
                let (p, q) = (o[i], o[(i + 1) % o.len()]);
                let inside = (p[0] - x) * (q[0] - x) < 0.0;
                inside.then(|| p[1] + (q[1] - p[1]) * (x - p[0]) / (q[0] - p[0]))
            })
        });
        crossings.filter(|y| *y > 0.0).fold(f64::INFINITY, f64::min)
    };
    // Facets of the arc are 0.06 mm long: chords leave it by 0.001 mm.
    const CHORD_MM: f64 = 2e-3;
    assert!((half(0.013) - t / 2.0).abs() < CHORD_MM);
    for x in [0.1, 0.2, 0.3, 0.38] {
        let arc = t / 2.0 + r - (r * r - x * x).sqrt();
        for side in [-1.0, 1.0] {
            let there = half(side * (10.0 - start + x));
            assert!((there - arc).abs() < CHORD_MM, "{x} behind the start: {there} for {arc}");
        }
    }
    let apex = 10.0 + fillet.nose_center_mm() - fillet.nose_radius_mm;
    assert!(half(apex + 0.4) > 1.2 && half(apex + 0.05) < 0.8, "nose at {apex}");
    // Kt by the handbook, by hand: h/r = 3.6, 2h/D = 0.818.
    assert!((fillet.concentration().unwrap() - 1.194).abs() < 1e-3);
}

#[test]
fn what_is_solved_is_as_without() {
    let (none, some) = (pivot("", ""), pivot("links fillet 0.5 mm", ""));
    assert_eq!(design_digest(&design(&none)), design_digest(&design(&some)));
    // Also where the radius is a constant that occurs elsewhere.
    for radius in ["10 mm", "0.8 mm / 2", "0.3 mm + 0.5 mm"] {
        let same = pivot(&format!("links fillet {radius}"), "fillet 0.4 mm");
        assert_eq!(design_digest(&design(&none)), design_digest(&design(&same)));
    }
    assert_ne!(input(&none), input(&some));
    assert_eq!(input(&none), input(&some).unfilleted());
    // None, in two ways.
    assert_eq!(input(&none), input(&pivot("links fillet 0 mm", "")));
    assert_eq!(input(&none), input(&pivot("links fillet 0.5 mm", "fillet 0 mm")));
}

#[test]
fn a_joint_counts_more_than_the_links() {
    let radius = |links: &str, joint: &str| design(&pivot(links, joint)).rods[0].fillet_mm;
    assert_eq!(radius("links height 8 mm fillet 0.5 mm", ""), 0.5);
    assert_eq!(radius("links fillet 0.5 mm height 8 mm", "fillet 0.3 mm"), 0.3);
    assert_eq!(radius("", "fillet 0.3 mm"), 0.3);
    assert_eq!(radius("links height 8 mm\n    links fillet 0.25 mm", ""), 0.25);
    assert_eq!(design(&pivot("links fillet 0.5 mm height 8 mm", "")).layers.height_mm, 8.0);
}

#[test]
fn wrong_fillets_are_told() {
    assert_eq!(codes(&pivot("links fillet -1 mm", "")), ["E0305"]);
    assert_eq!(codes(&pivot("", "fillet 1 deg")), ["E0201"]);
    assert_eq!(codes(&pivot("links fillet 1 mm\n    links fillet 2 mm", "")), ["E0403"]);
    assert_eq!(codes(&pivot("", "fillet 1 mm fillet 2 mm")), ["E0008"]);
    let stiff = PIVOT.replace("//JOINT", "fillet 1 mm");
    assert_eq!(codes(&stiff), ["E0414"]);
}
