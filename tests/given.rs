//! `place NAME = MECHANISM { parameter = value }`: what is given reaches the mechanism, equal instances stay one design, and
//! mistakes are told at their place.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Elaborated, Options, elaborate};
use flexura::ir::Design;
use std::collections::BTreeMap;

const ARM: &str = "use std.materials.pla
use std.processes.fdm
mechanism arm {
    param size: length = 30 mm
    param swing: angle = 20 deg
    param _own: length = 1 mm
    let   half = size / 2
    point O = (0 mm, 0 mm)
    point A = O + (size + half + _own, 0 mm)
    ground base { O }
    link   bar { O, A }
    hinge turn: base to bar at O
    material pla
    print on fdm
    cycle 10 steps
    drive turn from 0 deg to swing
    trace tip = A on bar
    minimize { track(tip) }
}
";

fn run(body: &str, set: &[(&str, &str)]) -> Elaborated {
    let text = format!("{ARM}mechanism whole {{\n{body}}}\n");
    let set = set.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    elaborate("main.mech", &files, &Options { set, steps: None, variant: None })
}

/// Where the tip is drawn, mm.
fn tip(design: &Design) -> f64 {
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let values = design.exprs.values(&start);
    values[design.traces[0].point[0].0 as usize]
}

#[test]
fn what_is_given_reaches_the_mechanism() {
    let body = "    param large: length = 6 cm
    place a = arm at (0 mm, 0 mm)
    place b = arm { size = large / 2 } at (0 mm, 0 mm, 50 mm)
    place c = arm { swing = 0.125 turn, size = large } at (0 mm, 0 mm, 100 mm)
    place d = arm {
        size = 2 * 30 mm
        swing = 45 deg
    } at (0 mm, 0 mm, 150 mm)
    place e = arm { size = 30 mm } at (0 mm, 0 mm, 200 mm) scale = 2
";
    let found = run(body, &[]);
    assert_eq!(found.diagnostics, []);
    let assembly = found.assembly.unwrap();
    let of = |name: &str| assembly.instances.iter().find(|i| i.name == name).unwrap().design;
    assert_eq!(of("c"), of("d"), "equal instances are one design, however they are written");
    assert_eq!(assembly.designs.len(), 4);
    let names: Vec<&str> = assembly.designs.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names, ["arm", "b", "c", "e"], "in the lock each has a name of its own");
    for (name, x) in [("a", 46.0), ("b", 46.0), ("c", 91.0), ("e", 92.0)] {
        let at = tip(&assembly.designs[of(name)]);
        assert!((at - x).abs() < 1e-12, "{name}: {at}");
    }
    let swing = |name: &str| assembly.designs[of(name)].drives[0].profile.clone();
    assert_eq!(format!("{:?}", swing("c")), format!("{:?}", swing("d")));
    // `--set` beats what is given: of the assembly, and of the mechanism in all its instances.
    let set = run(body, &[("large", "80 mm")]).assembly.unwrap();
    assert!((tip(&set.designs[1]) - 61.0).abs() < 1e-12);
    let set = run(body, &[("arm.size", "10 mm")]).assembly.unwrap();
    assert!(set.designs.iter().take(3).all(|d| (tip(d) - 16.0).abs() < 1e-12));
}

#[test]
fn free_values_can_be_given() {
    let found = run("    place a = arm { size = free 20 mm in 10 mm .. 4 cm } at (0 mm, 0 mm)\n", &[]);
    assert_eq!(found.diagnostics, []);
    let design = &found.assembly.unwrap().designs[0];
    let f = &design.free[0];
    assert_eq!((f.path.as_str(), f.start, f.lower, f.upper), ("size", 20.0, 10.0, 40.0));
}

#[test]
fn mistakes_are_told_at_their_place() {
    for (given, code, at, words) in [
        ("{ siez = 3 mm }", "E0101", "siez", "`arm` has no parameter `siez`"),
        ("{ half = 3 mm }", "E0406", "half", "is a `let` of `arm`"),
        ("{ _own = 3 mm }", "E0104", "_own", "private to `arm`"),
        ("{ size = 3 mm, size = 4 mm }", "E0102", "size", "given twice"),
        ("{ size = 3 deg }", "E0201", "3 deg", ""),
        ("{ size = 3 }", "E0202", "3", ""),
        ("{ size = O }", "E0101", "O", ""),
        ("{ size = (1 mm, 2 mm) }", "E0203", "(1 mm, 2 mm)", "a number or quantity is needed"),
        ("{ size = }", "E0001", "}", ""),
    ] {
        let found = run(&format!("    place a = arm {given} at (0 mm, 0 mm)\n"), &[]);
        assert!(found.assembly.is_none());
        let told: Vec<_> = found.diagnostics.iter().map(|d| (d.code.to_string(), &d.message)).collect();
        assert_eq!(told.len(), 1, "{given}: {told:?}");
        assert_eq!(told[0].0, code, "{given}: {told:?}");
        assert!(told[0].1.contains(words), "{given}: {told:?}");
        let place = found.diagnostics[0].labels[0].at;
        let text = &found.sources.files[place.file as usize].text[place.start as usize..place.end as usize];
        assert_eq!(text, at, "{given}");
    }
}
