//! What a second thread gains, beside what it gains on pure arithmetic at the same moment: processors may be shared.

use super::Report;
use super::designs::{example, layout};
use super::{MILLI, Time};
use flexura::optimize::Problem;
use flexura::pipeline::EDGES;
use rayon::prelude::*;

/// Chains of multiplications that the processor can neither overlap nor leave out.
fn arithmetic() -> f64 {
    let chain =
        |seed: u32| (0..2_000_000).fold(1.0 + f64::from(seed) * 1e-3, |x: f64, _| x * 0.999_999_9 + 1e-9);
    (0..64u32).into_par_iter().map(chain).collect::<Vec<f64>>().iter().sum()
}

pub fn threads(report: &mut Report) {
    let assembly = example("jansen");
    let design = &assembly.designs[0];
    let layout = layout(design);
    let pools = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    let mut probe: [Vec<f64>; 2] = Default::default();
    let mut iteration: [Vec<f64>; 2] = Default::default();
    // In turn, so that whatever else runs on the machine meets all alike.
    for _ in 0..if report.quick { 3 } else { 15 } {
        for (k, pool) in pools.iter().enumerate() {
            pool.install(|| {
                let began = std::time::Instant::now();
                std::hint::black_box(arithmetic());
                probe[k].push(began.elapsed().as_secs_f64());
                let problem = Problem::new(design, &layout, EDGES);
                let x = problem.start();
                let began = std::time::Instant::now();
                let trial = problem.simulate(&x).expect("the start can be simulated");
                std::hint::black_box(problem.differentiate(&trial).expect("and differentiated"));
                iteration[k].push(began.elapsed().as_secs_f64());
            });
        }
    }
    let time = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        Time { least: times[0], median: times[times.len() / 2] }
    };
    let [p1, p2] = probe.each_mut().map(time);
    let [i1, i2] = iteration.each_mut().map(time);
    for (n, p, i) in [("1 thread", p1, i1), ("2 threads", p2, i2)] {
        report.row("threads", "pure arithmetic", n, p, MILLI);
        report.row("threads", "an iteration of jansen", n, i, MILLI);
    }
    let gains = [p1.median / p2.median, i1.median / i2.median];
    report.note("threads", "gain of the second, pure arithmetic", "", format!("{:.2}", gains[0]), "");
    report.note("threads", "gain of the second, an iteration", "", format!("{:.2}", gains[1]), "");
    report.note("threads", "of what arithmetic gains", "", format!("{:.2}", gains[1] / gains[0]), "");
    report.set("threads_speedup", "", Some(gains[1] / gains[0]));
}
