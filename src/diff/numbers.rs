//! Numbers of the elaborated designs: lengths between the points of a body, bounds, starts and solved values.

use super::names::renamed;
use super::{Line, Number, same};
use crate::ir::{Assembly, Design, TargetOf, TargetPath};
use crate::pipeline::{Examined, Origin};
use std::collections::BTreeMap;

/// Of bodies with more points than this only neighbours are measured: all pairs of many say nothing to anybody.
const ALL_PAIRS: usize = 4;

/// A number's kind and name, its unit and value.
type Numbers = BTreeMap<(&'static str, String), (String, f64)>;

/// What differs in numbers that both versions have.
pub fn compare(before: &Examined, after: &Examined, renames: &BTreeMap<String, String>) -> Vec<Number> {
    let (Some(a), Some(b)) = (&before.outcome.assembly, &after.outcome.assembly) else { return Vec::new() };
    let old: Numbers = numbers(a, before)
        .into_iter()
        .map(|((kind, name), value)| ((kind, all_renamed(&name, renames)), value))
        .collect();
    let new = numbers(b, after);
    let differing = old.into_iter().filter_map(|((kind, name), (unit, before))| {
        let (other, after) = new.get(&(kind, name.clone()))?;
        (*other == unit && !same(before, *after)).then_some(Number {
            kind,
            name,
            unit,
            before,
            after: *after,
        })
    });
    differing.collect()
}

/// A name with every part as the new version calls it.
pub fn all_renamed(name: &str, renames: &BTreeMap<String, String>) -> String {
    renames.iter().fold(name.to_string(), |name, (from, to)| renamed(&name, from, to))
}

fn numbers(assembly: &Assembly, examined: &Examined) -> Numbers {
    let mut out = Numbers::new();
    let several = assembly.designs.len() > 1;
    let designs = assembly.designs.iter().zip(&examined.values).zip(&examined.origins);
    for ((design, values), origin) in designs {
        let name = |of: &str| if several { format!("{}.{of}", design.name) } else { of.to_string() };
        for (variable, value) in design.free.iter().zip(values) {
            let (unit, factor) = match variable.unit.as_str() {
                "rad" => ("deg", 1f64.to_degrees()),
                "1" => ("", 1.0),
                unit => (unit, 1.0),
            };
            let mut put = |kind, v: f64| out.insert((kind, name(&variable.path)), (unit.into(), v * factor));
            put("start", variable.start);
            put("lower bound", variable.lower);
            put("upper bound", variable.upper);
            if *origin == Origin::Lock {
                put("solved value", *value);
            }
        }
        for (of, length) in lengths(design, values) {
            out.insert(("length", name(&of)), ("mm".into(), length));
        }
    }
    out
}

/// Distances between points of a body, mm, by `body P-Q`.
fn lengths(design: &Design, values: &[f64]) -> Vec<(String, f64)> {
    let numbers = design.exprs.values(values);
    let mut out = Vec::new();
    for body in &design.bodies {
        let at = |i: usize| {
            let p = body.skeleton.get(i)?;
            let [x, y, z] = p.position.map(|id| numbers.get(id.0 as usize).copied().unwrap_or(f64::NAN));
            Some((p.name.as_str(), [x, y, z]))
        };
        let n = body.skeleton.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        for (i, j) in pairs.filter(|(i, j)| n <= ALL_PAIRS || j - i == 1) {
            if let (Some((p, a)), Some((q, b))) = (at(i), at(j)) {
                let length = a.iter().zip(&b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
                out.push((format!("{} {p}-{q}", body.name), length));
            }
        }
    }
    out
}

/// Targets that differ although the lines that name them do not: their tables have changed.
pub fn targets(before: &Examined, after: &Examined, renames: &BTreeMap<String, String>) -> Vec<Line> {
    let (Some(a), Some(b)) = (&before.outcome.assembly, &after.outcome.assembly) else { return Vec::new() };
    let (old, new) = (tables(a), tables(b));
    let differing = old.into_iter().filter_map(|(name, places)| {
        let name = all_renamed(&name, renames);
        let other = new.get(&name)?;
        (*other != places).then(|| Line {
            what: format!("target {name}"),
            scope: String::new(),
            before: format!("{} places", places.len()),
            after: format!(
                "{} places{}",
                other.len(),
                if other.len() == places.len() { ", others" } else { "" }
            ),
        })
    });
    differing.collect()
}

/// The places of targets that are tables, by trace.
fn tables(assembly: &Assembly) -> BTreeMap<String, Vec<(f64, [f64; 3])>> {
    let mut out = BTreeMap::new();
    for design in &assembly.designs {
        for target in &design.aims.targets {
            let name = match target.of {
                TargetOf::Trace(i) => design.traces.get(i).map(|t| &t.name),
                TargetOf::Direction(i) => design.aims.directions.get(i).map(|d| &d.name),
            };
            if let (Some(name), TargetPath::Places { times, places }) = (name, &target.path) {
                out.insert(name.clone(), times.iter().copied().zip(places.iter().copied()).collect());
            }
        }
    }
    out
}
