//! What the page is told: one small description of all that goes on, anew whenever something has changed. Who is slow sees
//! the newest one and misses what was between, so that nothing piles up.

use flexura::pipeline::{Iteration, Parameter};
use serde::Serialize;
use std::collections::BTreeMap;

/// Points of the curve of an optimisation at most.
const MOST_POINTS: usize = 120;

/// What goes on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Told {
    /// Number of the page; it rises with every new one, 0 before the first.
    pub version: u64,
    /// The page has solids, gaps and print sheet.
    pub whole: bool,
    /// What is being done; empty: nothing.
    pub phase: &'static str,
    /// Findings that keep the page from being renewed, as text; none where it is that of the text.
    pub fault: Option<String>,
    /// The values do not belong to this text or these parameters: they have not been solved for it.
    pub stale: bool,
    /// The optimiser ended before its own rule let it.
    pub unfinished: bool,
    /// Something is free and there is something to make small.
    pub solvable: bool,
    /// The optimisation that runs, or has ended last.
    pub solving: Option<Solving>,
    /// Parameters.
    pub parameters: Vec<Slider>,
}

/// An optimisation.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Solving {
    /// Of which design, where there are several.
    pub design: String,
    /// Still at work.
    pub running: bool,
    /// Its iterations, thinned where there are many; the last one is always there.
    pub points: Vec<Point>,
    /// The least objective so far.
    pub best: f64,
}

/// State after an iteration.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    n: usize,
    cost: f64,
    terms: Vec<(String, f64)>,
    error_mm: Option<f64>,
}

impl Solving {
    /// Takes note of an iteration.
    pub fn note(&mut self, iteration: &Iteration) {
        let cost = iteration.objective;
        self.best = if self.points.is_empty() { cost } else { self.best.min(cost) };
        if self.points.len() >= MOST_POINTS {
            let mut k = 0;
            self.points.retain(|_| {
                k += 1;
                k % 2 == 1
            });
        }
        self.points.push(Point {
            n: iteration.number,
            cost,
            terms: iteration.terms.clone(),
            error_mm: iteration.max_error_mm,
        });
    }
}

/// A parameter as it can be moved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Slider {
    /// Name.
    pub path: String,
    /// `///` lines above it.
    pub doc: String,
    /// As it is written.
    pub text: String,
    /// The number in it.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Least and largest value that the slider reaches, and its step. Any other can be typed.
    pub range: [f64; 3],
    /// What it is set to here, in place of what is written.
    pub set: Option<String>,
}

/// Sliders of what is a number and not the optimiser's.
pub fn sliders(all: &[Parameter], set: &BTreeMap<String, String>) -> Vec<Slider> {
    let slider = |p: &Parameter| {
        let value = p.value.filter(|_| !p.free)?;
        Some(Slider {
            path: p.path.clone(),
            doc: p.doc.clone(),
            text: p.text.clone(),
            value,
            unit: p.unit.clone(),
            range: range(value, &p.unit),
            set: set.get(&p.path).cloned(),
        })
    };
    all.iter().filter_map(slider).collect()
}

/// From a half to one and a half, in about a hundred round steps; what counts something moves by ones, and an angle of
/// nothing by half a right one to both sides.
fn range(value: f64, unit: &str) -> [f64; 3] {
    if unit.is_empty() && value.fract() == 0.0 && (1.0..=12.0).contains(&value) {
        return [1.0, (2.0 * value).max(4.0), 1.0];
    }
    if value == 0.0 {
        let wide = if unit == "deg" { 45.0 } else { 10.0 };
        return [-wide, wide, wide / 50.0];
    }
    let step = round(value.abs() / 100.0);
    let ends = [0.5 * value, 1.5 * value].map(|x| (x / step).round() * step);
    // Sums of tenths would show their rounding.
    let tidy = |x: f64| format!("{x:.6e}").parse().unwrap_or(x);
    [tidy(ends[0].min(ends[1])), tidy(ends[0].max(ends[1])), step]
}

/// The next smaller 1, 2 or 5 times a power of ten.
fn round(x: f64) -> f64 {
    let power = 10_f64.powf(x.log10().floor());
    let digit = [5.0, 2.0, 1.0].into_iter().find(|d| d * power <= x * 1.000_001).unwrap_or(1.0);
    format!("{:.1e}", digit * power).parse().unwrap_or(digit * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sliders_run_in_round_steps_about_what_is_written() {
        assert_eq!(range(20.0, "mm"), [10.0, 30.0, 0.2]);
        assert_eq!(range(-1.6, "mm"), [-2.4, -0.8, 0.01]);
        assert_eq!(range(0.0, "deg"), [-45.0, 45.0, 0.9]);
        assert_eq!(range(3.0, ""), [1.0, 6.0, 1.0]);
        let [low, high, step] = range(0.33333, "");
        assert!(low < 0.2 && high > 0.49 && step == 0.002, "{low} {high} {step}");
    }

    #[test]
    fn a_long_optimisation_stays_small() {
        let mut solving = Solving::default();
        for number in 0..10_000 {
            let objective = 1.0 / (1.0 + number as f64);
            solving.note(&Iteration { number, objective, ..Iteration::default() });
            assert!(solving.points.len() <= MOST_POINTS);
        }
        assert_eq!(solving.points.last().map(|p| p.n), Some(9999));
        assert_eq!(solving.points.first().map(|p| p.n), Some(0));
        assert!((solving.best - 1e-4).abs() < 1e-9);
    }
}
