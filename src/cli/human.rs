//! What a build tells a person: short, aligned, the numbers that matter first.

use super::style::Style;
use flexura::ir::Assembly;
use flexura::pipeline::{BuildOutcome, Measures, Origin};
use std::fmt::Write;

/// The report of a build; `written` are the files with their sizes in bytes.
pub fn report(out: &BuildOutcome, written: &[(String, usize)], style: Style) -> String {
    let mut text = String::new();
    if let Some(assembly) = &out.assembly {
        heading(&mut text, assembly, style);
    }
    if let Some(solution) = &out.solution {
        let how = match out.solved_from {
            Origin::Nothing => String::new(),
            Origin::Lock => "taken from the lock, nothing to solve".into(),
            Origin::Start => count(solution.iterations, "iteration", "iterations"),
            Origin::OldLock => {
                format!(
                    "{} from the old lock's values",
                    count(solution.iterations, "iteration", "iterations")
                )
            }
        };
        let end = if solution.converged { "converged" } else { "not converged" };
        let _ = writeln!(text, "solved  {how}, {end}");
    }
    measures(&mut text, out, style);
    if let Some(after) = &out.after {
        let rests = super::released::released(&after.stability);
        if !rests.is_empty() {
            let _ = write!(text, "\n{rests}");
        }
    }
    requirements(&mut text, out, style);
    artefacts(&mut text, written, style);
    let s = &out.seconds;
    let times = format!(
        "{:.2} s: check {:.2}, solve {:.2}, mesh {:.2}, emit {:.2}",
        s.total, s.check, s.solve, s.mesh, s.emit
    );
    let unchanged = if out.unchanged { "nothing has changed since the last build, " } else { "" };
    let _ = writeln!(text, "\n{}", style.dim(&format!("{unchanged}{times}")));
    text
}

/// What is built: the mechanism, or every design with its instances.
fn heading(text: &mut String, assembly: &Assembly, style: Style) {
    let single = assembly.single().is_some();
    if !single {
        let (i, d) = (assembly.instances.len(), assembly.designs.len());
        let solved = count(d, "design", "designs");
        let _ = writeln!(
            text,
            "{}  {} of {solved}",
            style.bold(&assembly.name),
            count(i, "instance", "instances")
        );
    }
    for (k, design) in assembly.designs.iter().enumerate() {
        let joints = design.joints.iter().filter(|j| j.is_compliant()).count();
        let _ = write!(
            text,
            "{}  {}, {} flexible of {}, {}, {}",
            if single { style.bold(&design.name) } else { format!("  {}", design.name) },
            count(design.bodies.len(), "body", "bodies"),
            joints,
            count(design.joints.len(), "joint", "joints"),
            count(design.rods.len(), "rod", "rods"),
            count(design.free.len(), "free variable", "free variables"),
        );
        let of: Vec<&str> =
            assembly.instances.iter().filter(|i| i.design == k).map(|i| i.name.as_str()).collect();
        let _ = if single { writeln!(text) } else { writeln!(text, ": {}", of.join(", ")) };
    }
}

/// Whether an instance does what an earlier one of the same design does: its numbers are the same.
fn repeated(out: &BuildOutcome, name: &str) -> bool {
    let Some(assembly) = out.assembly.as_ref().filter(|a| a.single().is_none()) else { return false };
    let instance = name.split_once('.').map_or("", |n| n.0);
    let at = assembly.instances.iter().position(|i| i.name == instance);
    let Some((at, own)) = at.and_then(|k| Some((k, assembly.instances.get(k)?))) else { return false };
    assembly.instances.iter().take(at).any(|i| i.design == own.design)
}

fn measures(text: &mut String, out: &BuildOutcome, style: Style) {
    let (before, after) = (out.before.as_ref(), out.after.as_ref());
    let Some(result) = after.or(before) else { return };
    let mut rows = of_cycle(out, before, after);
    for name in result.cases.keys() {
        let of = |m: Option<&'_ Measures>| m.and_then(|m| m.cases.get(name)).cloned();
        let under = of_cycle(out, of(before).as_ref(), of(after).as_ref());
        rows.extend(under.into_iter().map(|(what, b, a, unit)| (format!("case {name}: {what}"), b, a, unit)));
    }
    // What cannot be compared, as the error of a trace without a target, is left out.
    rows.retain(|(_, b, a, _)| [b, a].iter().any(|v| v.is_some_and(f64::is_finite)));
    let width = rows.iter().map(|r| r.0.chars().count()).max().unwrap_or(0).max(16);
    let heading = format!("{:width$}  {:>10}  {:>10}", "", "before", "after");
    let _ = writeln!(text, "\n{}", style.dim(&heading));
    for (name, b, a, unit) in rows {
        let _ = writeln!(
            text,
            "{name:width$}  {:>10}  {}  {unit}",
            number(b),
            style.bold(&format!("{:>10}", number(a)))
        );
    }
}

/// A line of the table: name, before, after, unit.
type Row = (String, Option<f64>, Option<f64>, &'static str);

/// What is measured over a cycle.
fn of_cycle(out: &BuildOutcome, before: Option<&Measures>, after: Option<&Measures>) -> Vec<Row> {
    let Some(result) = after.or(before) else { return Vec::new() };
    let mut rows: Vec<Row> = Vec::new();
    for name in result.traces.keys().filter(|n| !repeated(out, n)) {
        let of = |m: Option<&Measures>| m.and_then(|m| m.traces.get(name)).cloned();
        let (b, a) = (of(before), of(after));
        let mean = |t: &Option<flexura::pipeline::TraceMeasures>| t.as_ref().map(|t| t.mean_error_mm);
        let most = |t: &Option<flexura::pipeline::TraceMeasures>| t.as_ref().map(|t| t.max_error_mm);
        rows.push((format!("{name}, mean error"), mean(&b), mean(&a), "mm"));
        rows.push((format!("{name}, largest error"), most(&b), most(&a), "mm"));
    }
    for name in result.directions.keys().filter(|n| !repeated(out, n)) {
        let of = |m: Option<&Measures>| m.and_then(|m| m.directions.get(name)).cloned();
        let (b, a) = (of(before), of(after));
        let mean = |d: &Option<flexura::pipeline::DirectionMeasures>| d.as_ref().map(|d| d.mean_error_deg);
        let most = |d: &Option<flexura::pipeline::DirectionMeasures>| d.as_ref().map(|d| d.max_error_deg);
        rows.push((format!("{name}, mean error"), mean(&b), mean(&a), "deg"));
        rows.push((format!("{name}, largest error"), most(&b), most(&a), "deg"));
    }
    for name in result.outputs.keys().filter(|n| !repeated(out, n)) {
        let of = |m: Option<&Measures>| m.and_then(|m| m.outputs.get(name)).map(|o| o.span_deg);
        rows.push((format!("{name}, span"), of(before), of(after), "deg"));
    }
    for (name, drive) in result.drives.iter().filter(|(n, _)| !repeated(out, n)) {
        let of = |m: Option<&Measures>| m.and_then(|m| m.drives.get(name)).map(|d| d.parts().1);
        let (what, _, unit) = drive.parts();
        rows.push((format!("{name}, {what}"), of(before), of(after), unit));
    }
    let stress = |m: Option<&Measures>| m.and_then(|m| m.stress.max_mpa);
    if stress(before).or(stress(after)).is_some() {
        rows.push(("largest stress".into(), stress(before), stress(after), "MPa"));
    }
    let gap = |m: Option<&Measures>| m.and_then(|m| m.gap.least_mm);
    if gap(before).or(gap(after)).is_some() {
        rows.push(("least gap".into(), gap(before), gap(after), "mm"));
    }
    rows
}

fn requirements(text: &mut String, out: &BuildOutcome, style: Style) {
    if out.requirements.is_empty() {
        return;
    }
    let width = out.requirements.iter().map(|r| r.text.chars().count()).max().unwrap_or(0);
    text.push('\n');
    for r in &out.requirements {
        let verdict = if r.pass { style.green("pass") } else { style.red("FAIL") };
        let _ = writeln!(text, "{verdict}  {:width$}  {:>10} {}", r.text, number(r.value), r.unit);
    }
}

fn artefacts(text: &mut String, written: &[(String, usize)], style: Style) {
    if written.is_empty() {
        return;
    }
    let width = written.iter().map(|w| w.0.chars().count()).max().unwrap_or(0);
    text.push('\n');
    for (path, bytes) in written {
        let _ = writeln!(text, "{path:width$}  {}", style.dim(&format!("{:>9}", size(*bytes))));
    }
}

fn number(value: Option<f64>) -> String {
    // What has no target has no error.
    value.filter(|v| v.is_finite()).map_or("-".into(), |v| format!("{v:.3}"))
}

fn size(bytes: usize) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}

fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexura::pipeline::{DriveMeasures, RequirementResult, Seconds, StressMeasures, TraceMeasures};

    fn sample(mean: f64) -> Measures {
        let trace = TraceMeasures { mean_error_mm: mean, max_error_mm: 2.0 * mean, path_length_mm: 300.0 };
        Measures {
            traces: [("tip".to_string(), trace)].into(),
            drives: [("motor".to_string(), DriveMeasures::Torque { max_torque_n_mm: 41.5 })].into(),
            stress: StressMeasures { max_mpa: Some(24.91), place: None },
            ..Measures::default()
        }
    }

    #[test]
    fn a_build_in_a_few_lines() {
        let out = BuildOutcome {
            before: Some(sample(6.0)),
            after: Some(sample(0.17)),
            solution: Some(flexura::ir::Solution { iterations: 23, converged: true, ..Default::default() }),
            solved_from: Origin::Start,
            requirements: vec![RequirementResult {
                text: "max(error(tip)) <= 1 mm".into(),
                value: Some(0.34),
                unit: "mm".into(),
                bound: 1.0,
                pass: true,
            }],
            seconds: Seconds { total: 3.21, check: 0.01, solve: 2.5, mesh: 0.6, emit: 0.1 },
            ..BuildOutcome::default()
        };
        let written = [("out/part.stl".to_string(), 1_234_567), ("out/s/s.ino".to_string(), 4321)];
        insta::assert_snapshot!(report(&out, &written, Style::plain()));
    }
}
