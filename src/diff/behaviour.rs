//! What the mechanism does, before and after: errors, loads, stress, gap, volume and requirements.

use super::numbers::all_renamed;
use crate::pipeline::{Examined, Measures};
use serde::Serialize;
use std::collections::BTreeMap;

/// A measure of both versions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What is measured.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// In the old version; none where it has no such measure.
    pub before: Option<f64>,
    /// In the new version.
    pub after: Option<f64>,
    /// Of a requirement, whether it held and whether it holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holds: Option<[Option<bool>; 2]>,
}

impl Row {
    /// Relative change in percent, where it means something.
    pub fn percent(&self) -> Option<f64> {
        let (a, b) = (self.before?, self.after?);
        let change = 100.0 * (b - a) / a.abs();
        change.is_finite().then_some(change)
    }

    /// Whether value or verdict differ.
    pub fn differs(&self) -> bool {
        let values = match (self.before, self.after) {
            (Some(a), Some(b)) => !super::same(a, b),
            (a, b) => a.is_some() != b.is_some(),
        };
        values || self.holds.is_some_and(|[a, b]| a != b)
    }
}

/// The measures of both, in the order of the new version; empty where one was not simulated.
pub fn compare(before: &Examined, after: &Examined, renames: &BTreeMap<String, String>) -> Vec<Row> {
    if before.outcome.after.is_none() || after.outcome.after.is_none() {
        return Vec::new();
    }
    let mut old = measures(before);
    old.iter_mut().for_each(|m| m.name = all_renamed(&m.name, renames));
    let mut rows: Vec<Row> = Vec::new();
    for mut m in measures(after) {
        if let Some(i) = old.iter().position(|o| o.name == m.name && o.unit == m.unit) {
            let other = old.remove(i);
            m.before = other.after;
            m.holds = m.holds.map(|[_, now]| [other.holds.and_then(|h| h[1]), now]);
        }
        rows.push(m);
    }
    let gone = |m: Row| Row { before: m.after, after: None, holds: m.holds.map(|[_, was]| [was, None]), ..m };
    rows.extend(old.into_iter().map(gone));
    rows
}

/// Measures of one version, as `after`.
fn measures(version: &Examined) -> Vec<Row> {
    let Some(m) = &version.outcome.after else { return Vec::new() };
    let mut rows = of_cycle(m, "");
    for (case, under) in &m.cases {
        rows.extend(of_cycle(under, &format!("case {case}: ")));
    }
    rows.extend(row("volume".into(), version.volume_mm3.map_or(f64::NAN, |v| v / 1e3), "cm³"));
    for r in &version.outcome.requirements {
        rows.push(Row {
            name: query(&r.text).to_string(),
            unit: r.unit.to_string(),
            before: None,
            after: r.value,
            holds: Some([None, Some(r.pass)]),
        });
    }
    rows
}

/// A measure, if it is a number: what cannot be compared, as the error of a trace without a target, is none.
fn row(name: String, value: f64, unit: &str) -> Option<Row> {
    let row = Row { name, unit: unit.into(), before: None, after: Some(value), holds: None };
    value.is_finite().then_some(row)
}

/// What is measured over a cycle; `of` says under which case.
fn of_cycle(m: &Measures, of: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    for (name, t) in &m.traces {
        rows.extend(row(format!("{of}{name}, mean error"), t.mean_error_mm, "mm"));
        rows.extend(row(format!("{of}{name}, largest error"), t.max_error_mm, "mm"));
    }
    for (name, d) in &m.directions {
        rows.extend(row(format!("{of}{name}, mean error"), d.mean_error_deg, "deg"));
        rows.extend(row(format!("{of}{name}, largest error"), d.max_error_deg, "deg"));
    }
    for (name, o) in &m.outputs {
        rows.extend(row(format!("{of}{name}, span"), o.span_deg, "deg"));
    }
    for (name, drive) in &m.drives {
        let (what, value, unit) = drive.parts();
        rows.extend(row(format!("{of}{name}, {what}"), value, unit));
    }
    rows.extend(row(format!("{of}largest stress"), m.stress.max_mpa.unwrap_or(f64::NAN), "MPa"));
    rows.extend(row(format!("{of}least gap"), m.gap.least_mm.unwrap_or(f64::NAN), "mm"));
    rows
}

/// A `require` line without its bound, which may be what has changed.
fn query(line: &str) -> &str {
    line.split(['<', '>']).next().unwrap_or(line).trim_end()
}
