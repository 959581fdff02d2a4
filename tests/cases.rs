//! Load cases: the same mechanism once more under other loads.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::elaborate::{Elaborated, Options, elaborate};
use flexura::equilibrium::Layout;
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::optimize::Problem;
use flexura::pipeline::{
    Compiler, EDGES, Request, Show, Simulation, Stages, check_requirements, measure, simulate,
};
use std::collections::BTreeMap;

const CANTILEVER: &str = include_str!("loads/cantilever.mech");
const RODS: &str = include_str!("reference/rods.csv");
const CONVERGENCE: &str = include_str!("rods_convergence.csv");
/// As in `design_loads.rs`: the error of the rod by itself is C/N², met within this factor.
const CONVERGENCE_FACTOR: f64 = 1.5;
const LENGTH_MM: f64 = 30.0;

fn elaborated(text: &str) -> Elaborated {
    elaborate(
        "main.mech",
        &BTreeMap::from([("main.mech".to_string(), text.to_string())]),
        &Options::default(),
    )
}

fn design(text: &str) -> Design {
    let out = elaborated(text);
    assert!(out.diagnostics.iter().all(|d| !d.is_error()), "{:#?}", out.diagnostics);
    out.design.unwrap()
}

fn cantilever(load: &str) -> Design {
    design(&CANTILEVER.replace("//LOAD", load))
}

fn starts(design: &Design) -> Vec<f64> {
    design.free.iter().map(|f| f.start).collect()
}

fn simulated(design: &Design) -> Simulation {
    Compiler::default().sweep(design, &starts(design)).unwrap()
}

/// A number of a table by its first three columns.
fn lookup(table: &str, row: [&str; 3]) -> f64 {
    let start = format!("{},", row.join(","));
    let line = table.lines().find(|l| l.starts_with(&start)).unwrap_or_else(|| panic!("no row {start}"));
    line[start.len()..].split(',').next().unwrap().parse().unwrap()
}

#[test]
fn a_cantilever_under_two_end_loads_meets_the_elastica_in_both() {
    let design = cantilever(
        "case light { load 3 * EI / L^2 * t along y on tip at T }
         case heavy { load 10 * EI / L^2 * t along y on tip at T }",
    );
    let simulation = simulated(&design);
    assert_eq!(simulation.cases.len(), 2);
    let tip = |s: &Simulation, state: usize| s.motion.states[state].traces_mm[0];
    let rest = tip(&simulation, 10);
    for (case, alpha) in simulation.cases.iter().zip([3, 10]) {
        let parameter = format!("alpha={alpha} benchmark flexure");
        let z = tip(case, 10);
        for (what, value) in [("w/L", (z[1] - rest[1]) / LENGTH_MM), ("u/L", (rest[0] - z[0]) / LENGTH_MM)] {
            let row = ["cantilever_tip_force_extensible", parameter.as_str(), what];
            let bound = CONVERGENCE_FACTOR * lookup(CONVERGENCE, row) / (EDGES * EDGES) as f64;
            let wanted = lookup(RODS, row);
            assert!((value - wanted).abs() < bound, "{row:?}: {value}, wanted {wanted} to {bound:e}");
        }
    }
    // Its own loads are none: it stays where it is.
    assert!(simulation.motion.states.iter().all(|s| s.stress_max_mpa < 1e-6));
}

/// A leg with two loads: one of its own, one of a case, which add up.
const LEG: &str = "load 0.3 * EI / L^2 along x on tip at T";
const PUSH: &str = "load 2 * EI / L^2 * t along y on tip at T";

#[test]
fn a_case_is_the_design_with_its_loads_written_in() {
    let cased = cantilever(&format!("{LEG}\ncase push {{ {PUSH} }}"));
    let plain = cantilever(&format!("{LEG}\n{PUSH}"));
    let (cased, plain) = (simulated(&cased), simulated(&plain));
    let [case] = cased.cases.as_slice() else { panic!("{} cases", cased.cases.len()) };
    assert_eq!(case.motion, plain.motion);
    assert!(cased.motion != plain.motion);
}

#[test]
fn measures_and_requirements_of_a_case_are_its_own() {
    let design = cantilever(
        "load 0.1 * EI / L^2 along y on tip at T
         require max(stress()) <= 5 MPa
         case push {
             load 2 * EI / L^2 along y on tip at T
             require max(stress()) <= 5 MPa
             require max(stress()) >= 20 MPa
         }",
    );
    let simulation = simulated(&design);
    let measures = measure(&design, &simulation);
    let (own, push) = (measures.stress.max_mpa.unwrap(), measures.cases["push"].stress.max_mpa.unwrap());
    // A root moment of M bends to M a / I: 0.1 and, a little less than straight, 2.1 EI/L², a = 0.4 mm.
    let bent = |load: f64| 1500.0 * 0.4 * load / LENGTH_MM;
    assert!((own / bent(0.1) - 1.0).abs() < 0.03, "{own}");
    assert!(push < bent(2.1) && push > 0.7 * bent(2.1), "{push}");
    let mut found = Vec::new();
    let results = check_requirements(&design, &simulation, &mut found);
    let told: Vec<(&str, bool)> = results.iter().map(|r| (r.text.as_str(), r.pass)).collect();
    assert_eq!(
        told,
        [
            ("require max(stress()) <= 5 MPa", true),
            ("case push: require max(stress()) <= 5 MPa", false),
            ("case push: require max(stress()) >= 20 MPa", true),
        ]
    );
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].labels[0].at, design.cases[0].requirements[0].origin);
}

/// A leaf that is thick for its own load and thin for that of the case.
const FREE: &str = "minimize { track(end, scale = 1 mm) }
    target end = T + (0 mm, 1 mm * t)
    load 0.2 * EI / L^2 * t along y on tip at T
    case push {
        load 3 * EI / L^2 * t along y on tip at T
        minimize { stress(below = 5 MPa, scale = 1 MPa), track(end, scale = 5 mm) weight 2, stress(scale = 10 MPa) }
    }";

fn free() -> Design {
    let text = CANTILEVER
        .replace("//LOAD", FREE)
        .replace("thick: length = 0.8 mm", "thick: length = free 0.8 mm in 0.4 mm .. 2 mm")
        .replace("long:  length = 30 mm", "long: length = free 30 mm in 25 mm .. 36 mm");
    design(&text)
}

fn with_problem(design: &Design, f: impl FnOnce(&Problem)) {
    let p = starts(design);
    let layout = |d: &Design| Layout::new(d, &solve_motion(d, &p).unwrap(), &p);
    let (own, under) = (layout(design), design.under(&design.cases[0]));
    let below = layout(&under);
    let case = Problem::new(&under, &below, EDGES);
    f(&Problem::new(design, &own, EDGES).with_cases(vec![("push".into(), case)]));
}

#[test]
fn the_objective_over_cases_has_the_derivatives_of_its_differences() {
    /// Sixth order: 45 (f(h) − f(−h)) − 9 (f(2h) − …) + (f(3h) − …) is 60 h f'.
    const STEP: f64 = 2e-3;
    /// Measured 2e-8.
    const AGREES: f64 = 1e-6;
    let design = free();
    with_problem(&design, |problem| {
        assert_eq!(
            problem.term_names(),
            ["track(end)", "push: stress", "push: track(end)", "push: stress", "shape"]
        );
        let x = problem.start();
        let trial = problem.simulate(&x).unwrap();
        assert!(trial.terms[1] > 0.0 && trial.terms[0] > 0.0, "{:?}", trial.terms);
        assert!((trial.terms.iter().sum::<f64>() - trial.cost).abs() <= 1e-12 * trial.cost);
        let gradient = problem.differentiate(&trial).unwrap().gradient();
        let largest = gradient.amax();
        for i in 0..x.len() {
            let cost = |k: f64| {
                let mut x = x.clone();
                x[i] += k * STEP;
                problem.simulate(&x).unwrap().cost
            };
            let difference = [45.0, -9.0, 1.0]
                .iter()
                .zip([1.0, 2.0, 3.0])
                .map(|(w, k)| w * (cost(k) - cost(-k)))
                .sum::<f64>()
                / (60.0 * STEP);
            let off = (gradient[i] - difference).abs() / largest;
            assert!(off < AGREES, "{}: {} {difference} {off:e}", design.free[i].path, gradient[i]);
        }
    });
}

#[test]
fn what_a_case_asks_decides_the_solution() {
    let never = std::sync::atomic::AtomicBool::new(false);
    let solved = |d: &Design| {
        let found = Compiler::default().optimize(d, &starts(d), &|_| {}, &never).unwrap();
        d.free.iter().map(|f| found.solution.values[&f.path]).collect::<Vec<f64>>()
    };
    let with = free();
    let mut without = with.clone();
    without.cases[0].objectives.clear();
    let stress = |values: &[f64]| {
        Compiler::default().sweep(&with, values).unwrap().cases[0].motion.states[10].stress_max_mpa
    };
    let (a, b) = (stress(&solved(&with)), stress(&solved(&without)));
    assert!(a < 0.8 * b, "{a} MPa with the case, {b} MPa without");
}

#[test]
fn simulate_shows_a_case_and_says_which_there_are() {
    let text = CANTILEVER.replace("//LOAD", &format!("{LEG}\ncase push {{ {PUSH} }}"));
    let files = BTreeMap::from([("main.mech".to_string(), text)]);
    let show = |case: &str| {
        let request = Request { source: "main.mech".into(), case: Some(case.into()), ..Request::default() };
        simulate(&request, Show::default(), &Compiler::default(), &files)
    };
    let (_, pushed) = show("push");
    let pushed = pushed.unwrap();
    assert_eq!(pushed.motion.states, simulated(&cantilever(&format!("{LEG}\n{PUSH}"))).motion.states);
    let (out, none) = show("pull");
    assert!(none.is_none());
    let told = out.diagnostics.iter().find(|d| d.code == "E0120").unwrap();
    assert_eq!(told.help.as_deref(), Some("there are: push"));
}

#[test]
fn a_case_that_cannot_be_borne_is_named() {
    let text = "case crush { load 1e9 N along (-1, 0, 0) on tip at T }";
    let design = cantilever(text);
    let found = Compiler::default().sweep(&design, &starts(&design)).unwrap_err();
    assert_eq!(found[0].code, "E0602");
    assert!(found[0].labels.iter().any(|l| l.text == "in this load case" && l.at == design.cases[0].origin));
}

#[test]
fn requirements_of_a_case_do_not_change_the_lock() {
    use flexura::emit::lock::design_digest;
    let digest = |line: &str| design_digest(&cantilever(&format!("case push {{\n{PUSH}\n{line}\n}}")));
    assert_eq!(digest(""), digest("require max(stress()) <= 5 MPa"));
    assert_ne!(digest(""), digest("minimize { stress() }"));
    assert_ne!(digest(""), digest("load gravity y"));
}

/// Euler's load of a column held at its foot, N: π² EI / (2 L)².
fn euler_n() -> f64 {
    let ei = 1500.0 * std::f64::consts::PI / 4.0 * 0.4f64.powi(3) * 2.5;
    std::f64::consts::PI.powi(2) * ei / (2.0 * LENGTH_MM).powi(2)
}

#[test]
fn a_column_buckles_under_eulers_load() {
    /// The rod's 20 edges; measured 0.1 %.
    const AGREES: f64 = 5e-3;
    let design = cantilever(
        "load 0.1 N * t along (-1, 0, 0) on tip at T
         require min(buckling()) >= 5
         case more { load 0.1 N * t along (-1, 0, 0) on tip at T
             require min(buckling()) >= 3 }
         case pulled { load 0.3 N along x on tip at T
             require min(buckling()) >= 10 }
         case fallen { load 0.7 N along (-1, 0, 0) on tip at T
             require min(buckling()) >= 1 }",
    );
    let simulation = simulated(&design);
    let mut found = Vec::new();
    let results = check_requirements(&design, &simulation, &mut found);
    let euler = euler_n();
    for (result, load) in results.iter().zip([0.1, 0.2, f64::MIN_POSITIVE, 0.8]) {
        let (value, wanted) = (result.value.unwrap(), (euler / load).min(10.0));
        assert!((value / wanted - 1.0).abs() < AGREES, "{}: {value}, Euler {wanted}", result.text);
    }
    assert_eq!(results.iter().map(|r| r.pass).collect::<Vec<_>>(), [true, false, true, false]);
    // Nothing loads it at the beginning; by then the factor falls as the load grows.
    let [first, second, .., last] = simulation.load_factors.as_slice() else { panic!() };
    assert!(*first == 10.0 && *second == 10.0 && *last < 6.0);
    assert!(simulated(&cantilever(PUSH)).load_factors.is_empty(), "only where it is asked for");
}
