//! `assert`, `variant` and `for`: what a design becomes with them, and what of the language is still to come.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Elaborated, Options, elaborate};
use flexura::ir::{Assembly, Design};
use std::collections::BTreeMap;

const DESIGN: &str = include_str!("../examples/chebyshev/chebyshev.mech");

fn run(text: &str, variant: Option<&str>, set: &[(&str, &str)]) -> Elaborated {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let set = set.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    elaborate("main.mech", &files, &Options { set, variant: variant.map(String::from), ..Options::default() })
}

fn told(e: &Elaborated) -> Vec<String> {
    e.diagnostics.iter().map(|d| format!("{} {}", d.code, d.message)).collect()
}

fn with(lines: &str) -> String {
    let at = DESIGN.rfind("    export stl").unwrap();
    format!("{}{lines}\n{}", &DESIGN[..at], &DESIGN[at..])
}

fn crank_mm(design: &Design) -> f64 {
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let values = design.exprs.values(&start);
    let crank = design.bodies.iter().find(|b| b.name == "crank").unwrap();
    let at = |i: usize| crank.skeleton[i].position.map(|id| values[id.0 as usize]);
    let (a, b) = (at(0), at(1));
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_variant_sets_parameters_of_the_mechanism_and_of_its_flexures() {
    let text =
        with("    variant large { r = 30 mm, knee.thickness = 1 mm }\n    variant small { r = 15 mm }");
    let plain = run(&text, None, &[]);
    assert_eq!(told(&plain), [""; 0]);
    assert_eq!(plain.variants, ["large", "small"]);
    assert_eq!(plain.design.as_ref().map(crank_mm), Some(20.0));
    let large = run(&text, Some("large"), &[]).design.unwrap();
    assert!((crank_mm(&large) - 30.0).abs() < 1e-12);
    assert!(!large.free.iter().any(|f| f.path == "knee.thickness"), "a number in place of a free value");
    assert_eq!(large.free.len() + 1, plain.design.unwrap().free.len());
    // What is set on the command line counts for more.
    let set = run(&text, Some("large"), &[("r", "25 mm")]).design.unwrap();
    assert!((crank_mm(&set) - 25.0).abs() < 1e-12);
    // A variant is what a design with these numbers in its text would be.
    let written = DESIGN.replace("r: length = 20 mm", "r: length = 15 mm");
    let (small, written) = (run(&text, Some("small"), &[]), run(&written, None, &[]));
    let digest = |e: &Elaborated| flexura::emit::lock::design_digest(e.design.as_ref().unwrap());
    assert_eq!(digest(&small), digest(&written));
}

#[test]
fn a_variant_that_is_not_there_is_told() {
    let text = with("    variant large { r = 30 mm }");
    let missing = run(&text, Some("lage"), &[]);
    assert_eq!(told(&missing), ["E0117 mechanism `chebyshev_lambda` has no variant `lage`"]);
    assert_eq!(missing.diagnostics[0].help.as_deref(), Some("did you mean `large`?"));
    assert!(
        run(DESIGN, Some("large"), &[]).diagnostics[0].help.as_deref().unwrap().contains("variant large {")
    );
}

#[test]
fn what_only_a_variant_breaks_names_it() {
    let text = with("    variant huge { r = 300 mm }\n    assert r <= 100 mm \"it does not fit\"");
    let found = run(&text, None, &[]);
    assert_eq!(told(&found), ["E0418 an assertion does not hold: it does not fit"]);
    let d = &found.diagnostics[0];
    let at = |k: usize| &text[d.labels[k].at.start as usize..d.labels[k].at.end as usize];
    assert_eq!(at(0), "assert r <= 100 mm \"it does not fit\"");
    assert_eq!((at(1), d.labels[1].text.as_str()), ("huge", "in this variant"));
    assert!(found.assembly.is_none());
}

/// A row of the example, by a loop.
fn row(lines: &str) -> String {
    format!(
        "{DESIGN}\nmechanism row {{\n    param n = 2\n    ground board {{ }}\n{lines}\n    export stl\n}}\n"
    )
}

fn assembly(text: &str) -> Assembly {
    let found = run(text, None, &[]);
    assert_eq!(told(&found), [""; 0], "{text}");
    found.assembly.unwrap()
}

#[test]
fn a_loop_is_what_its_statements_are_one_by_one() {
    let looped = assembly(&row(
        "    for i in 0 .. n {\n        place leg[i] = chebyshev_lambda at (0 mm, 0 mm, i * 60 mm) merging base into \
         board\n        require max(torque(leg[i].motor)) <= nema17.stall / (2 + i)\n    }\n    export arduino(leg[1].motor)",
    ));
    let plain = |i: usize| {
        format!(
            "    place leg{i} = chebyshev_lambda at (0 mm, 0 mm, {i} * 60 mm) merging base into board\n    require \
             max(torque(leg{i}.motor)) <= nema17.stall / (2 + {i})\n"
        )
    };
    let written = assembly(&row(&((0..3).map(plain).collect::<String>() + "    export arduino(leg1.motor)")));
    assert_eq!(looped.designs.len(), 1);
    let names: Vec<&str> = looped.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["leg[0]", "leg[1]", "leg[2]"]);
    for (a, b) in looped.instances.iter().zip(&written.instances) {
        assert_eq!((a.design, &a.placement, &a.drives), (b.design, &b.placement, &b.drives));
    }
    let texts: Vec<&str> = looped.requirements.iter().map(|r| r.requirement.text.as_str()).collect();
    assert_eq!(texts[2], "require max(torque(leg[i].motor)) <= nema17.stall / (2 + i) (i = 2)");
    for (a, b) in looped.requirements.iter().zip(&written.requirements) {
        assert_eq!((a.instance, a.requirement.bound), (b.instance, b.requirement.bound));
    }
    assert_eq!(looped.exports[0].instance, written.exports[0].instance);
    assert_eq!(looped.joined.len(), 1);
}

#[test]
fn loops_nest_and_their_bounds_may_be_parameters() {
    let text = row(
        "    for i in 0 .. 1 {\n        for k in i .. n {\n            place leg[3*i] = chebyshev_lambda at (0 mm, 0 mm)\n        }\n    }",
    );
    // A product is no index: the grammar of an index is sums.
    assert!(told(&run(&text, None, &[])).iter().any(|t| t.starts_with("E0001")));
    let text = row(
        "    for i in 0 .. 1 {\n        for k in i .. n {\n            place leg[i+i+i+k] = chebyshev_lambda at (i * 300 mm, -200 mm * k, -20 mm) merging base into board\n        }\n    }\n    mirror back[0] = leg[4] across zx",
    );
    let found = assembly(&text);
    let names: Vec<&str> = found.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["leg[0]", "leg[1]", "leg[2]", "leg[4]", "leg[5]", "back[0]"]);
    assert_eq!(found.instances[3].placement.translation, [300.0, -200.0, -20.0]);
    let more = run(&text, None, &[("n", "3")]).assembly.unwrap();
    assert_eq!(more.instances.len(), 8);
}

/// Each statement that is still to come, with the place that is told.
#[test]
fn what_is_still_to_come_says_so_at_its_keyword() {
    for statement in [
        "spring back: rocker to base rate 2 N*mm",
        "stop knee from -20 deg to 20 deg",
        "tolerance r 0.1 mm",
        "fatigue 100000",
        "sweep r from 15 mm to 25 mm",
    ] {
        let text = with(&format!("    {statement}"));
        let found = run(&text, None, &[]);
        let keyword = statement.split(' ').next().unwrap();
        assert_eq!(told(&found), [format!("E0901 `{keyword}` is not available yet")], "{statement}");
        let at = found.diagnostics[0].labels[0].at;
        let expected = text.find(statement).unwrap();
        assert_eq!((at.start as usize, at.end as usize), (expected, expected + keyword.len()), "{statement}");
    }
    let text = with("    require robust(max(error(tip))) <= 1 mm");
    let found = run(&text, None, &[]);
    assert_eq!(told(&found), ["E0902 `robust` is not available yet"]);
    let at = found.diagnostics[0].labels[0].at;
    assert_eq!(&text[at.start as usize..at.end as usize], "robust");
}

#[test]
fn a_check_follows_the_motion_of_every_variant() {
    use flexura::pipeline::{Compiler, Request, check};
    // A crank that the coupler cannot follow all the way round.
    let text = with("    param reach = 2.5\n    variant stiff { reach = 1.2 }")
        .replace("half = 2.5 * r", "half = reach * r");
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    let request = Request { source: "main.mech".into(), ..Request::default() };
    let out = check(&request, &Compiler::default(), &files);
    assert!(out.assembly.is_some(), "as it stands it is right");
    let messages: Vec<String> = out.diagnostics.iter().map(|d| format!("{} {}", d.code, d.message)).collect();
    assert!(out.failed() && messages.iter().all(|m| m.ends_with("(variant `stiff`)")), "{messages:?}");
}
