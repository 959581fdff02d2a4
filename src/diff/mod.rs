//! What changed between two versions of a design: in names, in lines, in numbers, and in what the mechanism does.
//!
//! Lines are compared as what they say, not as they are written: comments, spaces and the order of statements do not
//! count. Likely renames are found first, so that a renamed joint is one change and not one in every line.

mod behaviour;
mod entries;
mod names;
mod numbers;
#[cfg(test)]
mod tests;

use crate::pipeline::{Examined, Origin};
pub use behaviour::Row;
use serde::Serialize;

/// Two numbers that agree to this part of the larger are equal: solved values differ by more or not at all.
const SAME: f64 = 1e-9;

/// Everything that differs between two versions.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Diff {
    /// Nothing differs but comments, format and order.
    pub unchanged: bool,
    /// Names that came, went, or were changed.
    pub names: Vec<Name>,
    /// Lines of both versions that say something else.
    pub lines: Vec<Line>,
    /// Lengths, bounds and values.
    pub numbers: Vec<Number>,
    /// What the mechanism does; empty where nothing differs or one version could not be simulated.
    pub behaviour: Vec<Row>,
    /// With which values each version was simulated.
    pub values: [Simulated; 2],
}

/// With which values a version was simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Simulated {
    /// It has errors.
    #[default]
    Not,
    /// Those of its lock.
    Lock,
    /// Those of its own start: it has no lock, or one of another state of the design.
    Start,
    /// Some of its designs with those of the lock.
    Partly,
}

/// What happened to a name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Name {
    /// What happened.
    pub change: NameChange,
    /// `point`, `joint`, `requirement`, …
    pub kind: String,
    /// Where: `mechanism lambda`; empty at the top of the file.
    pub scope: String,
    /// The name, or what the line says where it has none.
    pub name: String,
    /// The new name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
}

/// What happened to a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum NameChange {
    /// Only the new version has it.
    Added,
    /// Only the old version has it.
    Removed,
    /// The new version seems to call it otherwise.
    Renamed,
}

/// A line that says something else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Line {
    /// `param r`, `joint knee`, …
    pub what: String,
    /// Where: `mechanism lambda`; empty at the top of the file.
    pub scope: String,
    /// What it said.
    pub before: String,
    /// What it says.
    pub after: String,
}

/// A number of the elaborated design.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// `length`, `start`, `lower bound`, `upper bound` or `solved value`.
    pub kind: &'static str,
    /// Of what; with several designs the design's name is in it.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// In the old version.
    pub before: f64,
    /// In the new one.
    pub after: f64,
}

/// Compares two versions, each examined as far as its text allows.
pub fn compare(before: &Examined, after: &Examined) -> Diff {
    let (old, new) = (entries::of(&before.outcome.sources), entries::of(&after.outcome.sources));
    let found = names::compare(old, &new);
    let numbers = numbers::compare(before, after, &found.renames);
    let tables = numbers::targets(before, after, &found.renames);
    let mut diff = Diff { names: found.names, lines: found.lines, numbers, ..Diff::default() };
    // A line that has changed says it already.
    let told = |t: &Line| diff.lines.iter().any(|l| l.what == t.what);
    let tables: Vec<Line> = tables.into_iter().filter(|t| !told(t)).collect();
    diff.lines.extend(tables);
    diff.values = [simulated(before), simulated(after)];
    // A version whose lock is of another state does something else, though it says the same.
    diff.unchanged = diff.names.is_empty()
        && diff.lines.is_empty()
        && diff.numbers.is_empty()
        && diff.values[0] == diff.values[1];
    if !diff.unchanged {
        diff.behaviour = behaviour::compare(before, after, &found.renames);
    }
    diff
}

fn simulated(version: &Examined) -> Simulated {
    let locked = version.origins.iter().filter(|o| **o == Origin::Lock).count();
    match locked {
        _ if version.origins.is_empty() => Simulated::Not,
        0 => Simulated::Start,
        n if n == version.origins.len() => Simulated::Lock,
        _ => Simulated::Partly,
    }
}

/// Whether two numbers are the same but for rounding.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs()) || a.is_nan() && b.is_nan()
}
