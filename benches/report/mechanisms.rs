//! The six mechanisms: a cycle, an iteration, a whole optimisation from the design's own start, the printed parts.

use super::designs::{NAMES, OPTIMISED, example, layout, solved, starts};
use super::{MILLI, Report, Time, WHOLE, once};
use flexura::equilibrium::{Model, sweep, sweep_both_ways};
use flexura::ir::{Design, ExportKind};
use flexura::optimize::Problem;
use flexura::pipeline::{Compiler, EDGES, Plans, Stages};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn size(design: &Design) -> String {
    format!("{} rods, {} free, {} steps", design.rods.len(), design.free.len(), design.cycle.steps)
}

/// Rods and the equilibria of all states at the design's start, the conventional motion being known.
pub fn cycles(report: &mut Report) {
    for name in NAMES {
        let mut sum = 0.0;
        for design in &example(name).designs {
            let (layout, start) = (layout(design), starts(design));
            let time = report.time(|| {
                let model = Model::new(design, &layout, &start, EDGES, false).expect("rods");
                sweep(&model).expect("equilibria").states.len()
            });
            report.row("cycle", name, &size(design), time, MILLI);
            let time = report.time_on_two(|| {
                let model = Model::new(design, &layout, &start, EDGES, false).expect("rods");
                sweep_both_ways(&model).expect("equilibria").states.len()
            });
            report.row("cycle", &format!("{name}, two threads"), &size(design), time, MILLI);
            sum += time.least * MILLI.0;
        }
        report.set("cycle_ms", name, Some(sum));
    }
}

/// One cycle with the derivatives of all terms.
pub fn iterations(report: &mut Report) {
    for name in OPTIMISED {
        for design in &example(name).designs {
            let layout = layout(design);
            let problem = Problem::new(design, &layout, EDGES);
            let x = problem.start();
            let time = report.time(|| {
                let trial = problem.simulate(&x).expect("the start can be simulated");
                problem.differentiate(&trial).expect("and differentiated").gradient().len()
            });
            report.row("iteration", name, &size(design), time, MILLI);
        }
    }
}

/// As `flexura build --fresh` optimises.
pub fn optimisations(report: &mut Report) {
    for name in OPTIMISED {
        let (mut seconds, mut on_two, mut iterations, mut ended) = (0.0, 0.0, 0, true);
        let assembly = example(name);
        for design in &assembly.designs {
            let cancel = AtomicBool::new(false);
            let solve = || Compiler::default().optimize(design, &starts(design), &|_| (), &cancel);
            let (time, found) = once(solve);
            seconds += time;
            on_two += report.two.install(|| {
                let began = Instant::now();
                let _ = std::hint::black_box(solve());
                began.elapsed().as_secs_f64()
            });
            let solution = found.unwrap_or_else(|e| panic!("{name}: {e:?}")).solution;
            iterations += solution.iterations;
            ended &= solution.converged;
        }
        let what = format!("{name}, {iterations} iterations{}", if ended { "" } else { " (limit)" });
        let size = size(&assembly.designs[0]);
        for (what, s) in [(what.as_str(), seconds), (&format!("{name}, two threads"), on_two)] {
            report.row("optimise", what, &size, Time { least: s, median: s }, WHOLE);
        }
        report.set("optimise_s", name, Some(on_two));
        report.set("iterations", name, Some(f64::from(u32::try_from(iterations).expect("few"))));
    }
}

/// Printed parts of the solved design, its cycle included: links make way for what the flexures sweep.
pub fn meshes(report: &mut Report) {
    for name in NAMES {
        let assembly = example(name);
        if !assembly.exports.iter().any(|e| e.export.kind == ExportKind::Stl) {
            continue;
        }
        let values = solved(name, &assembly);
        let compiler = Compiler::default();
        let mut bytes = 0;
        let mut mesh = || {
            let parts = compiler
                .parts(&assembly, &values, &Plans::default())
                .unwrap_or_else(|e| panic!("{name}: {e:?}"));
            bytes = parts.artefacts.iter().map(|p| p.bytes.len()).sum();
        };
        let (one, two) = (report.time(&mut mesh), report.time_on_two(&mut mesh));
        let size = format!("{:.1} MB of STL", bytes as f64 / 1e6);
        report.row("mesh", name, &size, one, WHOLE);
        report.row("mesh", &format!("{name}, two threads"), &size, two, WHOLE);
    }
}
