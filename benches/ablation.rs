//! The paper's comparisons on Chebyshev's linkage, as Markdown: the ablation of Fig. 8, where the time of an iteration
//! goes (Table 1), L-BFGS against CMA-ES (section 5) and ours, and what the stress term does to the stress.
//!
//! `cargo bench --bench ablation [-- --steps N --iterations N --design FILE.mech --only objectives|time|solvers|six]`. Of
//! another design its first trace and its first drive are taken. A row that cannot be had says why. `six` is asked for by
//! name only: the six mechanisms by the paper's forms with its weights.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use flexura::elaborate::{FileError, Files, Options, SolidFile, elaborate};
use flexura::equilibrium::{Layout, Model, SensitivityWorkspace, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::optimize::{Method, Problem, optimize};
use flexura::pipeline::{Compiler, DriveMeasures, EDGES, Measures, Stages, measure};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// The paper's terms with its weights (SI), one more a row.
const ABLATION: &[&str] = &[
    "track(tip)",
    "track(tip), collision(gap = 0.5 mm)",
    "track(tip), collision(gap = 0.5 mm), torque(motor, form = paper)",
    "track(tip), collision(gap = 0.5 mm), torque(motor, form = paper), stress(form = paper)",
];
/// The same without collisions.
const WITHOUT_COLLISION: &[&str] = &[
    "track(tip), torque(motor, form = paper)",
    "track(tip), torque(motor, form = paper), stress(form = paper)",
];
/// Our forms of the last.
const OURS: &[&str] = &[
    "track(tip, scale = 0.1 mm), stress(below = 25 MPa, scale = 0.2 MPa)",
    "track(tip, scale = 0.1 mm), torque(motor), stress(below = 25 MPa, scale = 0.2 MPa)",
    "track(tip, scale = 0.1 mm), sway(tip, force = 1 N, scale = 1 mm) weight 0.01, torque(motor), collision(gap = 0.5 mm), stress(below = 25 MPa, scale = 0.2 MPa)",
];
/// The six mechanisms of the paper, below `examples/`.
const SIX: &[&str] =
    &["chebyshev/chebyshev", "jansen/jansen", "eye/eye", "car/car", "hand/finger", "dragon/dragon"];
/// Repetitions of a timed piece; the least counts.
const REPEAT: usize = 5;

struct Arguments {
    design: PathBuf,
    steps: Option<usize>,
    iterations: usize,
    /// The one part that is wanted.
    only: Option<String>,
}

impl Arguments {
    fn wants(&self, part: &str) -> bool {
        self.only.as_deref().is_none_or(|only| only == part)
    }
}

fn arguments() -> Arguments {
    let example = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples/chebyshev/chebyshev.mech");
    let mut out = Arguments { design: example, steps: None, iterations: 100, only: None };
    // cargo itself adds `--bench`.
    let mut rest = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = rest.next() {
        let value = rest.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--design" => out.design = value.into(),
            "--steps" => out.steps = Some(value.parse().expect("a number of steps")),
            "--iterations" => out.iterations = value.parse().expect("a number of iterations"),
            "--only" => out.only = Some(value),
            _ => panic!("there is no {name}: --design, --steps, --iterations, --only"),
        }
    }
    out
}

/// The design with other terms, nothing required and nothing exported.
struct Variant {
    folder: PathBuf,
    name: String,
    text: String,
}

impl Files for Variant {
    fn read(&self, path: &str) -> Result<String, FileError> {
        if path == self.name {
            return Ok(self.text.clone());
        }
        std::fs::read_to_string(self.folder.join(path)).map_err(|_| FileError::NotFound)
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        let bytes = std::fs::read(self.folder.join(path)).map_err(|_| FileError::NotFound)?;
        Ok(Arc::new(SolidFile::new(bytes)))
    }
}

/// The design with these terms, or why this version cannot have it.
fn variant(arguments: &Arguments, terms: &str) -> Result<Design, String> {
    let text = std::fs::read_to_string(&arguments.design).expect("the design can be read");
    let from = text.find("    minimize {").expect("the design has a `minimize` block");
    let to = from + text[from..].find("    }\n").expect("closed on a line of its own") + 6;
    let kept = |part: &str| -> String {
        let dropped =
            |l: &&str| !(l.trim_start().starts_with("require") || l.trim_start().starts_with("export"));
        part.lines().filter(dropped).map(|l| format!("{l}\n")).collect()
    };
    let named = |word: &str| {
        let line = text.lines().find_map(|l| l.trim_start().strip_prefix(word));
        line.and_then(|l| l.split_whitespace().next()).expect("a trace and a drive").to_string()
    };
    let terms = terms
        .replace("(tip", &format!("({}", named("trace ")))
        .replace("(motor", &format!("({}", named("drive ")));
    let text = format!("{}    minimize {{ {terms} }}\n{}", kept(&text[..from]), kept(&text[to..]));
    let name = arguments.design.file_name().unwrap().to_str().unwrap().to_string();
    let folder = arguments.design.parent().unwrap().to_path_buf();
    let options = Options { steps: arguments.steps, ..Options::default() };
    let out = elaborate(&name, &Variant { folder, name: name.clone(), text }, &options);
    let first =
        |d: &flexura::diagnostic::Diagnostic| d.is_error().then(|| format!("{} {}", d.code, d.message));
    let why = || out.diagnostics.iter().find_map(first).unwrap_or_default();
    // Of what is placed or mirrored the design itself.
    out.assembly.and_then(|a| a.designs.into_iter().next()).ok_or_else(why)
}

fn starts(design: &Design) -> Vec<f64> {
    design.free.iter().map(|f| f.start).collect()
}

fn layout(design: &Design) -> Layout {
    let start = starts(design);
    Layout::new(design, &solve_motion(design, &start).expect("it can be assembled"), &start)
}

fn numbers(m: &Measures) -> String {
    let t = m.traces.values().next().expect("a trace");
    let torque = match *m.drives.values().next().expect("a drive") {
        DriveMeasures::Torque { max_torque_n_mm: v } | DriveMeasures::Force { max_force_n: v } => v,
    };
    let gap = m.gap.least_mm.map_or("–".into(), |g| format!("{g:.2}"));
    let stress = m.stress.max_mpa.unwrap_or(f64::NAN);
    format!("{:.3} | {:.3} | {stress:.1} | {torque:.1} | {gap}", t.mean_error_mm, t.max_error_mm)
}

/// One row of the ablation; the measures for what follows.
fn row(arguments: &Arguments, terms: &str) -> Option<Measures> {
    let design = match variant(arguments, terms) {
        Ok(design) => design,
        Err(why) => {
            println!("| {terms} | {why} | | | | | | |");
            return None;
        }
    };
    let compiler = Compiler { iterations: arguments.iterations, ..Compiler::default() };
    let cancel = AtomicBool::new(false);
    let began = Instant::now();
    let solved = match compiler.optimize(&design, &starts(&design), &|_| (), &cancel) {
        Ok(solved) => solved,
        Err(why) => {
            println!("| {terms} | {} | | | | | | |", why.first().map_or("", |d| &d.message));
            return None;
        }
    };
    let seconds = began.elapsed().as_secs_f64();
    let values: Vec<f64> = design.free.iter().map(|f| solved.solution.values[&f.path]).collect();
    let simulation = compiler.simulate(&design, &values).expect("the best point can be simulated");
    let measures = measure(&design, &simulation);
    let end = if solved.solution.converged { "" } else { " (limit)" };
    println!("| {terms} | {} | {}{end} | {seconds:.1} |", numbers(&measures), solved.solution.iterations);
    Some(measures)
}

fn ablation(arguments: &Arguments) {
    println!("\n## Objectives (Fig. 8)\n");
    println!(
        "The paper's forms and weights, then ours; Levenberg–Marquardt, {} iterations at most.\n",
        arguments.iterations
    );
    println!(
        "| terms | mean error mm | largest error mm | largest stress MPa | largest torque N·mm | least gap mm | iterations | s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let design = variant(arguments, ABLATION[0]).expect("tracking alone is there");
    let simulation =
        Compiler::default().simulate(&design, &starts(&design)).expect("the start can be simulated");
    println!("| start | {} | | |", numbers(&measure(&design, &simulation)));
    let all: Vec<Option<Measures>> =
        [ABLATION, WITHOUT_COLLISION, OURS].concat().iter().map(|terms| row(arguments, terms)).collect();
    let stress = |m: &Option<Measures>| m.as_ref().and_then(|m| m.stress.max_mpa);
    println!("\n## Stress\n");
    println!(
        "Largest stress over the cycle within the same bounds; the paper: less by more than ten times.\n"
    );
    println!("| without | with a stress term | MPa | MPa | less by |");
    println!("| --- | --- | --- | --- | --- |");
    let names = [ABLATION, WITHOUT_COLLISION, OURS].concat();
    for (without, with) in [(0, 6), (2, 3), (4, 5), (4, 7), (1, 8)] {
        if let (Some(a), Some(b)) = (stress(&all[without]), stress(&all[with])) {
            println!("| {} | {} | {a:.1} | {b:.1} | {:.1} |", names[without], names[with], a / b);
        }
    }
}

/// Least time of a piece, s.
fn least<T>(mut piece: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let began = Instant::now();
        let value = piece();
        (began.elapsed().as_secs_f64(), value)
    };
    let mut best = timed();
    for _ in 1..REPEAT {
        let again = timed();
        if again.0 < best.0 {
            best = again;
        }
    }
    best
}

fn shares(arguments: &Arguments) {
    println!("\n## Where the time of an iteration goes (Table 1)\n");
    println!(
        "At the start of the design, on one thread, ms. Simulation: rods and the sweep of equilibria. Objectives: values and"
    );
    println!("their derivatives from those of the states; with `sway` its loaded equilibria too.\n");
    println!(
        "| terms | whole iteration | simulation | derivatives of states | objectives | objectives, share |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let all = [
        ABLATION[0],
        ABLATION[1],
        ABLATION[3],
        WITHOUT_COLLISION[1],
        OURS[0],
        OURS[2],
        "track(tip), sway(tip, force = 0.2 N)",
    ];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for terms in all {
        let design = match variant(arguments, terms) {
            Ok(design) => design,
            Err(why) => {
                println!("| {terms} | {why} | | | | |");
                continue;
            }
        };
        let layout = layout(&design);
        let start = starts(&design);
        pool.install(|| {
            let (simulation, (model, cycle)) = least(|| {
                let model = Model::new(&design, &layout, &start, EDGES, true).expect("rods");
                let cycle = sweep(&model).expect("equilibria");
                (model, cycle)
            });
            let (states, ()) = least(|| {
                let mut workspace = SensitivityWorkspace::new(&model);
                for (s, e) in cycle.states.iter().take(layout.counted_states()).enumerate() {
                    workspace.at(&model, e, &layout.controls(s)).expect("derivatives");
                }
            });
            let problem = Problem::new(&design, &layout, EDGES);
            let x = problem.start();
            if problem.simulate(&x).is_none() {
                return println!("| {terms} | a state or a load of the start has no equilibrium | | | | |");
            }
            let (whole, ()) = least(|| {
                let trial = problem.simulate(&x).expect("the start can be simulated");
                problem.differentiate(&trial).expect("and differentiated");
            });
            let objectives = (whole - simulation - states).max(0.0);
            println!(
                "| {terms} | {:.1} | {:.1} | {:.1} | {:.1} | {:.0} % |",
                whole * 1e3,
                simulation * 1e3,
                states * 1e3,
                objectives * 1e3,
                100.0 * objectives / whole
            );
        });
    }
}

fn solvers(arguments: &Arguments) {
    const LIMIT: usize = 50;
    println!("\n## Solvers, {LIMIT} iterations of tracking alone\n");
    println!("Cost in parts of the start's; CMA-ES simulates a whole generation an iteration.\n");
    println!("| solver | after 10 | after 25 | after {LIMIT} | cycles simulated | s |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let design = variant(arguments, ABLATION[0]).expect("tracking alone is there");
    let layout = layout(&design);
    let methods = [
        ("Levenberg–Marquardt", Method::LevenbergMarquardt),
        ("L-BFGS", Method::Lbfgs),
        ("CMA-ES", Method::CmaEs),
    ];
    for (name, method) in methods {
        let costs: Mutex<Vec<(usize, f64)>> = Mutex::new(Vec::new());
        let told = |i: &flexura::optimize::Iteration| costs.lock().unwrap().push((i.number, i.cost));
        let cancel = AtomicBool::new(false);
        let problem = Problem::new(&design, &layout, EDGES);
        let first = problem.simulate(&problem.start()).expect("the start can be simulated").cost;
        let began = Instant::now();
        let found = optimize(problem, method, &starts(&design), LIMIT, &cancel, &told);
        let seconds = began.elapsed().as_secs_f64();
        let costs = costs.into_inner().unwrap();
        let after = |n: usize| {
            let until = costs.iter().filter(|(number, _)| *number <= n).map(|(_, c)| *c);
            until.fold(f64::INFINITY, f64::min) / first
        };
        println!(
            "| {name} | {:.1e} | {:.1e} | {:.1e} | {} | {seconds:.1} |",
            after(10),
            after(25),
            found.cost / first,
            found.simulations
        );
    }
}

/// The paper's terms for the traces and drives of a text.
fn papers_terms(text: &str) -> String {
    let words = |line: &str| -> Vec<String> { line.split_whitespace().map(String::from).collect() };
    let lines = |word: &str| -> Vec<Vec<String>> {
        text.lines().map(words).filter(|w| w.first().is_some_and(|w| w == word)).collect()
    };
    let mut terms: Vec<String> = Vec::new();
    for trace in lines("trace") {
        terms.push(format!("track({})", trace[1]));
        // The paper's sway asks for the normal of a path in a plane; in space it goes along both normals.
        if trace.get(3).is_some_and(|w| w != "direction") {
            let form = if text.contains(" ball ") { "" } else { ", form = paper" };
            terms.push(format!("sway({}, force = 0.1 N{form})", trace[1]));
        }
    }
    for drive in lines("drive") {
        let name = &drive[1];
        // The paper's form is of torques.
        let slides = |w: &Vec<String>| w.get(1).is_some_and(|n| n.trim_end_matches(':') == name);
        let slides = lines("string").iter().any(slides) || lines("slider").iter().any(slides);
        terms.push(if slides { format!("force({name})") } else { format!("torque({name}, form = paper)") });
    }
    terms.push("collision(gap = 0.5 mm)".into());
    terms.push("stress(form = paper)".into());
    terms.join(", ")
}

/// The six mechanisms by the paper's objective: all its terms, its forms, its weights, no goal attached.
fn six(arguments: &Arguments) {
    println!("\n## The six mechanisms by the paper's forms and weights\n");
    println!("{} iterations at most. Before and after.\n", arguments.iterations);
    println!(
        "| mechanism | mean error mm | largest error mm | largest stress MPa | largest torque N·mm or force N | least gap mm | iterations | s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for name in SIX {
        let design = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("examples/{name}.mech"));
        let arguments = Arguments { design, only: None, ..*arguments };
        let text = std::fs::read_to_string(&arguments.design).expect("the example can be read");
        let terms = papers_terms(&text);
        if let Ok(design) = variant(&arguments, &terms)
            && let Ok(simulation) = Compiler::default().simulate(&design, &starts(&design))
        {
            println!("| {name} | {} | | |", numbers(&measure(&design, &simulation)));
        }
        row(&arguments, &terms);
    }
}

fn main() {
    let arguments = arguments();
    if arguments.only.as_deref() == Some("six") {
        return six(&arguments);
    }
    println!("# {}", arguments.design.file_stem().unwrap().to_string_lossy());
    if arguments.wants("objectives") {
        ablation(&arguments);
    }
    if arguments.wants("time") {
        shares(&arguments);
    }
    if arguments.wants("solvers") {
        solvers(&arguments);
    }
}
