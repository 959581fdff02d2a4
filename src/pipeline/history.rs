//! How the optimiser came to its result. The lock keeps it, in few lines: a build from the lock shows what the build that
//! solved has seen.

use super::progress::Iteration;
pub use crate::emit::lock::History;
use std::sync::{Mutex, PoisonError};

/// Iterations that are kept at most.
const MOST: usize = 16;

/// Number of an iteration, and its terms by name.
type Noted = (usize, Vec<(String, f64)>);

/// Notes what is told while an optimisation runs.
#[derive(Default)]
pub struct Recorder(Mutex<Vec<Noted>>);

impl Recorder {
    /// An iteration is done.
    pub fn note(&self, iteration: &Iteration) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.push((iteration.number, iteration.terms.clone()));
    }

    /// The first, the last and some between, nearer to each other at the start, where more happens. Nothing where the
    /// terms are not the same throughout.
    pub fn history(self) -> History {
        let all = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        let Some((_, first)) = all.first() else { return History::default() };
        let names: Vec<String> = first.iter().map(|t| t.0.clone()).collect();
        let same = |terms: &[(String, f64)]| terms.iter().map(|t| &t.0).eq(&names);
        if all.len() < 2 || !all.iter().all(|(_, terms)| same(terms)) {
            return History::default();
        }
        let chosen: Vec<_> = chosen(all.len()).into_iter().filter_map(|k| all.get(k)).collect();
        let values = |t: usize| chosen.iter().filter_map(move |(_, terms)| Some(rounded(terms.get(t)?.1)));
        History {
            iterations: chosen.iter().map(|(number, _)| *number).collect(),
            // What is nothing throughout tells nothing.
            terms: (names.iter().enumerate())
                .map(|(t, name)| (one_word(name), values(t).collect::<Vec<f64>>()))
                .filter(|(_, values)| values.iter().any(|v| *v != 0.0))
                .collect(),
        }
    }
}

/// A term's name as a lock holds it.
fn one_word(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace() && *c != '=').collect()
}

/// Indices below `count`: all of few, else as evenly as whole numbers allow on a scale of square roots.
fn chosen(count: usize) -> Vec<usize> {
    if count <= MOST {
        return (0..count).collect();
    }
    let last = (count - 1) as f64;
    let at = |k: usize| (last * (k as f64 / (MOST - 1) as f64).powi(2)).round() as usize;
    let mut out: Vec<usize> = (0..MOST).map(at).collect();
    out.dedup();
    out
}

/// Three digits that count: a curve shows no more.
fn rounded(v: f64) -> f64 {
    format!("{v:.2e}").parse().unwrap_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(count: usize) -> History {
        let recorder = Recorder::default();
        for number in 0..count {
            let terms = vec![("track(tip)".to_string(), 1.0 / (1 + number) as f64)];
            recorder.note(&Iteration { number, terms, ..Iteration::default() });
        }
        recorder.history()
    }

    #[test]
    fn a_short_run_is_kept_whole_and_a_long_one_thinned() {
        assert_eq!(run(3).iterations, [0, 1, 2]);
        assert_eq!(run(3).terms, [("track(tip)".to_string(), vec![1.0, 0.5, 0.333])]);
        let long = run(501).iterations;
        assert_eq!((long.first(), long.last()), (Some(&0), Some(&500)));
        assert!(long.len() <= MOST && long.windows(2).all(|w| w[0] < w[1]), "{long:?}");
        assert_eq!(run(1), History::default(), "nothing was done");
    }
}
