//! What things cost, as one report: rod kernels, single flexures, whole cycles, optimisations, meshes, the front end,
//! and how cost grows with the design and falls with threads.
//!
//! `cargo bench --bench report [-- --json] [-- --quick] [-- --only rods,cantilever,…]`. Every piece is repeated for a
//! while; least and median are told, and the least is what `--json` gives, of cycles and optimisations that on two threads. On one thread
//! unless said.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod designs;
mod front_end;
mod legs;
mod mechanisms;
mod rods;
mod threads;

use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// The parts of the report by name.
type Part = (&'static str, fn(&mut Report));
const PARTS: &[Part] = &[
    ("rods", rods::kernels),
    ("cantilever", rods::cantilevers),
    ("hinge", rods::hinges),
    ("adjoint", rods::adjoint),
    ("cycle", mechanisms::cycles),
    ("iteration", mechanisms::iterations),
    ("mesh", mechanisms::meshes),
    ("check", front_end::check),
    ("threads", threads::threads),
    ("legs", legs::legs),
    ("optimise", mechanisms::optimisations),
];

/// Time of a repeated piece, s.
#[derive(Clone, Copy)]
pub struct Time {
    pub least: f64,
    pub median: f64,
}

/// Time of a piece on this thread, s, and what it gives. What takes long is interrupted by whatever else runs on the
/// machine: then the time that the processor spent on it counts, where the system tells it.
pub fn once<T>(piece: impl FnOnce() -> T) -> (f64, T) {
    const LONG: f64 = 0.01;
    let (on_processor, began) = (processor_seconds(), Instant::now());
    let value = piece();
    let wall = began.elapsed().as_secs_f64();
    let seconds = match on_processor.zip(processor_seconds()) {
        Some((before, after)) if wall > LONG => after - before,
        _ => wall,
    };
    (seconds, value)
}

/// What the processor has spent on this thread, s; Linux tells it.
fn processor_seconds() -> Option<f64> {
    // The account is brought up to date where the thread gives way.
    std::thread::yield_now();
    let account = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(account.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

/// What has been measured so far.
pub struct Report {
    rows: Vec<[String; 6]>,
    json: Value,
    /// Rows are printed as they are found.
    human: bool,
    pub quick: bool,
    /// Two threads, for what is told of both cores.
    pub two: rayon::ThreadPool,
}

impl Report {
    /// Repeats a piece that runs on this thread for about a second (a tenth with `--quick`), once at least.
    pub fn time<T>(&self, mut piece: impl FnMut() -> T) -> Time {
        let budget = Duration::from_millis(if self.quick { 100 } else { 1000 });
        let began = Instant::now();
        let mut times = Vec::new();
        while times.is_empty() || began.elapsed() < budget && times.len() < 10_000 {
            times.push(once(|| std::hint::black_box(piece())).0);
        }
        times.sort_by(f64::total_cmp);
        Time { least: times[0], median: times[times.len() / 2] }
    }

    /// The same of a piece on two threads, by the clock on the wall.
    pub fn time_on_two<T: Send>(&self, mut piece: impl FnMut() -> T + Send) -> Time {
        let budget = Duration::from_millis(if self.quick { 100 } else { 1000 });
        let mut times = self.two.install(|| {
            let (began, mut times) = (Instant::now(), Vec::new());
            while times.is_empty() || began.elapsed() < budget && times.len() < 10_000 {
                let start = Instant::now();
                std::hint::black_box(piece());
                times.push(start.elapsed().as_secs_f64());
            }
            times
        });
        times.sort_by(f64::total_cmp);
        Time { least: times[0], median: times[times.len() / 2] }
    }

    /// A row of the table; `factor` turns seconds into the unit.
    pub fn row(&mut self, part: &str, what: &str, size: &str, time: Time, (factor, unit): (f64, &str)) {
        self.cells([
            part.into(),
            what.into(),
            size.into(),
            number(time.least * factor),
            number(time.median * factor),
            unit.into(),
        ]);
    }

    /// A row with something else than times.
    pub fn note(&mut self, part: &str, what: &str, size: &str, value: String, unit: &str) {
        self.cells([part.into(), what.into(), size.into(), value, String::new(), unit.into()]);
    }

    fn cells(&mut self, cells: [String; 6]) {
        if self.human {
            println!("| {} |", cells.join(" | "));
        }
        self.rows.push(cells);
    }

    /// An entry of the JSON object: below `key`, or itself where `size` is empty; null where there is no number.
    pub fn set(&mut self, key: &str, size: &str, value: Option<f64>) {
        let value = value.map_or(Value::Null, |v| json!(v));
        if size.is_empty() {
            self.json[key] = value;
        } else {
            self.json[key][size] = value;
        }
    }
}

/// Four significant digits at most.
fn number(x: f64) -> String {
    match x.abs() {
        0.0..1e-2 => format!("{x:.2e}"),
        1e-2..10.0 => format!("{x:.3}"),
        10.0..100.0 => format!("{x:.2}"),
        100.0..1000.0 => format!("{x:.1}"),
        _ => format!("{x:.0}"),
    }
}

pub const MICRO: (f64, &str) = (1e6, "µs");
pub const MILLI: (f64, &str) = (1e3, "ms");
pub const WHOLE: (f64, &str) = (1.0, "s");

fn main() {
    let mut only: Option<Vec<String>> = None;
    let (mut human, mut quick) = (true, false);
    // cargo itself adds `--bench`.
    let mut rest = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = rest.next() {
        match name.as_str() {
            "--json" => human = false,
            "--quick" => quick = true,
            "--only" => {
                let names = rest.next().unwrap_or_default();
                only = Some(names.split(',').map(str::to_string).collect());
            }
            _ => panic!("there is no {name}: --json, --quick, --only {}", names().join(",")),
        }
    }
    if let Some(unknown) = only.iter().flatten().find(|n| !names().contains(&n.as_str())) {
        panic!("there is no part {unknown}: {}", names().join(", "));
    }
    let json = json!({
        "newton_us_per_edge": {}, "cantilever_ms": {}, "hinge_sweep_ms": {}, "adjoint_us": {}, "cycle_ms": {},
        "optimise_s": {}, "iterations": {}, "legs_s": {}, "threads_speedup": null, "check_10k_lines_ms": null,
    });
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    let mut report = Report { rows: Vec::new(), json, human, quick, two };
    if human {
        println!("| part | what | size | least | median | unit |\n| --- | --- | --- | ---: | ---: | --- |");
    }
    // One thread for all but the parts that bring their own.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for (name, part) in PARTS {
        if only.as_ref().is_some_and(|only| !only.iter().any(|o| o == name)) {
            continue;
        }
        let report = &mut report;
        if *name == "threads" { part(report) } else { pool.install(|| part(report)) }
    }
    if !human {
        println!("{}", serde_json::to_string_pretty(&report.json).expect("plain data"));
    }
}

fn names() -> Vec<&'static str> {
    PARTS.iter().map(|p| p.0).collect()
}
