//! How the optimiser came to what the lock holds: a line with the iterations that are told of, and one a term. A term's name
//! holds no space, a design's neither: where a lock is of several designs, its name stands before.

use super::Lock;
use std::fmt::Write;

/// Terms of the objective at some iterations. Text for people: nothing that is built depends on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Numbers of the iterations, rising, from 0 for the start.
    pub iterations: Vec<usize>,
    /// Each term by name (one word, without `=`), with a value an iteration.
    pub terms: Vec<(String, Vec<f64>)>,
}

impl History {
    /// Whether there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.iterations.len() < 2 || !self.terms.iter().any(|t| t.1.len() == self.iterations.len())
    }

    fn write(&self, design: &str, out: &mut String) {
        if self.is_empty() {
            return;
        }
        let before = if design.is_empty() { String::new() } else { format!(" {design}:") };
        let _ = write!(out, "history{before}");
        self.iterations.iter().for_each(|n| out.push_str(&format!(" {n}")));
        out.push('\n');
        for (name, values) in &self.terms {
            let _ = write!(out, "term{before} {name}");
            values.iter().for_each(|v| out.push_str(&format!(" {v:?}")));
            out.push('\n');
        }
    }
}

/// The lines of a lock.
pub(super) fn lines(lock: &Lock) -> String {
    let mut out = String::new();
    if lock.named.is_empty() {
        lock.history.write("", &mut out);
    }
    for (name, head) in &lock.named {
        head.history.write(name, &mut out);
    }
    out
}

/// A line as it is read.
pub(super) struct Line {
    /// The design, empty where there is one only.
    pub design: String,
    /// The term, empty in the line of iterations.
    pub term: String,
    values: Vec<f64>,
}

impl Line {
    /// From a heading and what follows it; none where that is something else.
    pub fn read(key: &str, value: &str) -> Option<Self> {
        let mut words = value.split_whitespace().peekable();
        let design = words.next_if(|w| w.ends_with(':')).map_or("", |w| w.trim_end_matches(':')).to_string();
        let term = if key == "term" { words.next()?.to_string() } else { String::new() };
        let values = words.map(|w| w.parse::<f64>().ok().filter(|v| v.is_finite())).collect::<Option<_>>()?;
        Some(Self { design, term, values })
    }
}

/// Adds a line to the lock; false where its numbers do not fit the iterations.
pub(super) fn keep(lock: &mut Lock, line: &Line) -> bool {
    let history = match line.design.as_str() {
        "" => &mut lock.history,
        name => &mut lock.named.entry(name.to_string()).or_default().history,
    };
    if line.term.is_empty() {
        let whole = line.values.iter().all(|v| *v >= 0.0 && v.fract() == 0.0);
        let rising = line.values.windows(2).all(|w| w.first() < w.last());
        history.iterations = line.values.iter().map(|v| *v as usize).collect();
        return whole && rising;
    }
    history.terms.push((line.term.clone(), line.values.clone()));
    line.values.len() == history.iterations.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history() -> History {
        History { iterations: vec![0, 1, 9], terms: vec![("track(tip)".into(), vec![12.5, 3e-7, 0.25])] }
    }

    #[test]
    fn it_is_read_as_it_was_written() {
        let mut text = String::new();
        history().write("", &mut text);
        assert_eq!(text, "history 0 1 9\nterm track(tip) 12.5 3e-7 0.25\n");
        let mut lock = Lock::default();
        for line in text.lines() {
            let (key, value) = line.split_once(' ').unwrap();
            assert!(keep(&mut lock, &Line::read(key, value).unwrap()));
        }
        assert_eq!(lock.history, history());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut lock = Lock { history: history(), ..Lock::default() };
        assert!(!keep(&mut lock, &Line::read("term", "b 1 2").unwrap()), "two of three");
        assert!(!keep(&mut lock, &Line::read("history", "0 2 1").unwrap()));
        assert!(Line::read("term", "b 1 two 3").is_none());
        assert!(Line::read("history", "0 NaN").is_none());
    }
}
