//! From all that a build knows to the [`Report`]: which numbers, curves and lists it shows.

use super::history::History;
use super::parameters::Parameter;
use super::report::{Artefact, BuildOutcome, Measures};
use super::stages::{Simulation, Stages};
use super::{Request, starts};
use crate::diagnostic::{Diagnostic, Severity};
use crate::emit::plate::Plate;
use crate::emit::report::{
    self, Check, Figure, Finding, Fixed, Motor, Plot, Report, Series, Solved, Variable, Way, Wiring,
};
use crate::emit::scene::Scene;
use crate::ir::{Aggregate, Assembly, Design, DriveUnit, ExportKind, FreeVariable, Quantity, Solution};
use crate::lint::Stage as Reached;
use std::fmt::Write;

/// A cycle: of every instance, and of the whole.
pub struct Motion {
    /// One an instance.
    pub placed: Vec<Simulation>,
    /// All of them.
    pub whole: Simulation,
}

/// What is known when all else has been made.
pub struct Known<'a> {
    /// What is built.
    pub assembly: &'a Assembly,
    /// One a design.
    pub solutions: &'a [Solution],
    /// One a design.
    pub values: &'a [Vec<f64>],
    /// At the start of the optimisation, where that can be simulated.
    pub before: Option<Motion>,
    /// The result.
    pub after: Motion,
    /// The mechanism in motion.
    pub scene: &'a Scene,
    /// Its parts on the bed.
    pub plate: &'a Plate,
}

/// Whether a report is among the exports.
pub fn is_asked(assembly: &Assembly) -> bool {
    assembly.exports.iter().any(|e| e.export.kind == ExportKind::Report)
}

/// What the check told, as the report will show it, with parameters and the way of the optimiser: a report is not the same
/// if this is not.
pub fn told_early(request: &Request, out: &BuildOutcome, checked: usize) -> String {
    let early = out.diagnostics.get(..checked).unwrap_or_default().to_vec();
    let mut text = String::new();
    for f in findings(request, out, early, out.reached) {
        let _ = writeln!(text, "{f:?}");
    }
    let _ = writeln!(text, "{:?} {:?}", out.histories, out.parameters);
    text
}

/// Adds the report to the artefacts.
pub fn emit(request: &Request, known: &Known<'_>, stages: &dyn Stages, out: &mut BuildOutcome) {
    let Some(export) = known.assembly.exports.iter().find(|e| e.export.kind == ExportKind::Report) else {
        return;
    };
    let started = known.before.as_ref().map(|b| paths(&b.whole)).unwrap_or_default();
    let report = Report {
        scene: known.scene,
        plate: known.plate,
        started,
        figures: figures(known.assembly, out.before.as_ref(), out.after.as_ref()),
        checks: out.requirements.iter().map(|r| check(r, known.plate.parts.is_empty())).collect(),
        plots: plots(known),
        parameters: out.parameters.iter().filter(|p| !p.free).map(fixed).collect(),
        solved: solved(known, &out.histories, stages),
        findings: findings(request, out, out.diagnostics.clone(), Reached::Parts),
        bought: super::bill::bought(known.assembly),
        wiring: motors(known).iter().map(Wiring::of).collect(),
        files: out.artefacts.iter().map(|a| (a.name.clone(), a.bytes.len())).collect(),
    };
    match report::report_html(&report) {
        Ok(bytes) => {
            out.artefacts.push(Artefact { name: format!("{}.html", known.assembly.name), bytes });
        }
        Err(why) => out.diagnostics.push(
            Diagnostic::error("E0648", format!("no report can be written: {why}"), export.export.origin)
                .help("build without this export, and report what was said"),
        ),
    }
}

fn paths(simulation: &Simulation) -> Vec<Vec<nalgebra::Vector3<f64>>> {
    let states = &simulation.motion.states;
    let path = |k: usize| states.iter().filter_map(|s| s.traces_mm.get(k).map(|p| (*p).into())).collect();
    (0..simulation.motion.traces.len()).map(path).collect()
}

/// Findings as their levels have them. What tells of this run of the solver, of the lock and of requirements is left
/// out: the page shows these by themselves, and it is the same however the values were come by.
fn findings(
    request: &Request,
    out: &BuildOutcome,
    mut all: Vec<Diagnostic>,
    reached: Reached,
) -> Vec<Finding> {
    all.retain(|d| !d.code.starts_with("W07") && !matches!(d.code.as_str(), "W0610" | "E0801"));
    request.levels.apply(&mut all, &out.sources, &out.files, reached);
    all.sort_by_key(|d| std::cmp::Reverse(d.severity));
    let shown = |d: Diagnostic| Finding {
        label: d.labels.first().map(|l| l.text.clone()).unwrap_or_default(),
        code: d.code,
        severity: d.severity,
        message: d.message,
        help: d.help.unwrap_or_default(),
    };
    all.into_iter().filter(|d| d.severity >= Severity::Advice).map(shown).collect()
}

fn check(r: &super::RequirementResult, without_solids: bool) -> Check {
    let open = without_solids && r.value.is_none();
    Check {
        text: r.text.clone(),
        value: r.value,
        bound: r.bound,
        unit: r.unit.to_string(),
        pass: r.pass,
        open,
    }
}

/// Whether an earlier instance of the same design says the same.
fn repeated(assembly: &Assembly, name: &str) -> bool {
    let instance = name.split_once('.').map_or("", |n| n.0);
    let Some(at) = assembly.instances.iter().position(|i| i.name == instance) else { return false };
    let design = |i: usize| assembly.instances.get(i).map(|i| i.design);
    assembly.single().is_none() && (0..at).any(|k| design(k) == design(at))
}

/// The numbers that matter, those of equal instances once.
fn figures(assembly: &Assembly, before: Option<&Measures>, after: Option<&Measures>) -> Vec<Figure> {
    let mut out: Vec<Figure> = Vec::new();
    for (m, late) in [(before, false), (after, true)] {
        let Some(m) = m else { continue };
        let mut rows: Vec<(String, Option<f64>, &str)> = Vec::new();
        for (name, t) in &m.traces {
            rows.push((format!("{name}: mean error"), Some(t.mean_error_mm), "mm"));
            rows.push((format!("{name}: largest error"), Some(t.max_error_mm), "mm"));
        }
        for (name, d) in &m.directions {
            rows.push((format!("{name}: mean error"), Some(d.mean_error_deg), "deg"));
            rows.push((format!("{name}: largest error"), Some(d.max_error_deg), "deg"));
        }
        for (name, o) in &m.outputs {
            rows.push((format!("{name}: span"), Some(o.span_deg), "deg"));
        }
        for (name, d) in &m.drives {
            let (what, value, unit) = d.parts();
            rows.push((format!("{name}: {what}"), Some(value), unit));
        }
        rows.push(("largest stress".into(), m.stress.max_mpa, "MPa"));
        rows.push(("least gap".into(), m.gap.least_mm, "mm"));
        for (name, value, unit) in rows {
            if repeated(assembly, &name) {
                continue;
            }
            let value = value.filter(|v| v.is_finite());
            let row = match out.iter_mut().find(|f| f.name == name) {
                Some(row) => row,
                None => {
                    out.push(Figure { name, before: None, after: None, unit: unit.into() });
                    let Some(row) = out.last_mut() else { continue };
                    row
                }
            };
            if late {
                row.after = value;
            } else {
                row.before = value;
            }
        }
    }
    out.retain(|f| f.before.or(f.after).is_some());
    out
}

/// What a design requires of a quantity as its largest (or least) value, the strictest.
fn required(design: &Design, quantity: &Quantity, least: bool) -> Option<f64> {
    let (aggregate, at_most) = if least { (Aggregate::Min, false) } else { (Aggregate::Max, true) };
    let of = design.requirements.iter().filter(|r| r.quantity == *quantity);
    let bounds = of.filter(|r| r.aggregate == aggregate && r.at_most == at_most).map(|r| r.bound);
    bounds.reduce(if least { f64::max } else { f64::min })
}

/// The strictest of all designs.
fn limit(
    assembly: &Assembly,
    quantity: impl Fn(&Design) -> Vec<Quantity>,
    least: bool,
) -> Vec<(String, f64)> {
    let bounds = assembly
        .designs
        .iter()
        .flat_map(|d| quantity(d).into_iter().filter_map(move |q| required(d, &q, least)));
    let strictest = bounds.reduce(if least { f64::max } else { f64::min });
    strictest.map(|v| ("required".to_string(), v)).into_iter().collect()
}

/// Curves of a quantity of the whole, before and after.
fn curves(known: &Known<'_>, name: &str, of: impl Fn(&Simulation) -> Vec<f64>) -> Series {
    let before = known.before.as_ref().map(|b| of(&b.whole)).unwrap_or_default();
    Series { name: name.into(), after: of(&known.after.whole), before }
}

fn plots(known: &Known<'_>) -> Vec<Plot> {
    let (assembly, whole) = (known.assembly, &known.after.whole);
    let states = |of: fn(&crate::emit::csv::MotionState) -> f64| {
        move |s: &Simulation| s.motion.states.iter().map(of).collect::<Vec<f64>>()
    };
    let errors = (whole.motion.traces.iter().enumerate())
        .map(|(k, name)| curves(known, name, |s| s.errors_mm.get(k).cloned().unwrap_or_default()));
    let drives = |unit: DriveUnit, of: fn(&crate::emit::csv::MotionState, usize) -> Option<f64>| {
        let chosen = whole.motion.drives.iter().enumerate().filter(move |(_, d)| d.1 == unit);
        let series = chosen.map(move |(k, d)| {
            curves(known, &d.0, |s| s.motion.states.iter().filter_map(|state| of(state, k)).collect())
        });
        series.collect::<Vec<Series>>()
    };
    let all_traces = |d: &Design| (0..d.traces.len()).map(Quantity::Error).collect();
    let all_torques = |d: &Design| (0..d.drives.len()).map(Quantity::Torque).collect();
    let all_forces = |d: &Design| (0..d.drives.len()).map(Quantity::Force).collect();
    let mut stress = limit(assembly, |_| vec![Quantity::Stress], false);
    let strength = assembly.designs.iter().filter_map(|d| d.material.strength_mpa).reduce(f64::min);
    stress.extend(strength.map(|s| ("strength".to_string(), s)));
    let load = |s: &crate::emit::csv::MotionState, k: usize| s.drive_loads.get(k).copied();
    let energy = |s: &crate::emit::csv::MotionState| s.energy_n_mm;
    let potential = |s: &crate::emit::csv::MotionState| s.load_potential_n_mm;
    let mut energies = vec![curves(known, "elastic", states(energy))];
    if whole.motion.has_loads {
        energies.push(curves(known, "of the loads", states(potential)));
    }
    let turned = |s: &crate::emit::csv::MotionState, k: usize| s.drives.get(k).map(|v| v.to_degrees());
    let slid = |s: &crate::emit::csv::MotionState, k: usize| s.drives.get(k).copied();
    let outputs = whole.motion.more.iter().enumerate().filter_map(|(k, (name, _))| {
        let name = name.strip_suffix("_deg").filter(|n| n.contains("output."))?.replacen("output.", "", 1);
        Some(curves(known, &name, |s| s.motion.more.get(k).map(|m| m.1.clone()).unwrap_or_default()))
    });
    let largest_stress = curves(known, "largest of all flexures", states(|s| s.stress_max_mpa));
    let gap = curves(known, "least of all", |s| s.gaps_mm.clone());
    let plot = |id: &str, title: &str, unit: &str, from_zero: bool, series: Vec<Series>, limits| Plot {
        id: id.into(),
        title: title.into(),
        unit: unit.into(),
        series,
        limits,
        from_zero,
    };
    let none = Vec::new;
    let all = [
        plot("error", "Error", "mm", true, errors.collect(), limit(assembly, all_traces, false)),
        plot("aim", "Error of direction", "deg", true, aim_errors(known), none()),
        plot(
            "torque",
            "Torque",
            "N·mm",
            true,
            drives(DriveUnit::Rad, load),
            limit(assembly, all_torques, false),
        ),
        plot("force", "Force", "N", true, drives(DriveUnit::Mm, load), limit(assembly, all_forces, false)),
        plot("stress", "Stress", "MPa", true, vec![largest_stress], stress),
        plot("energy", "Energy", "N·mm", true, energies, none()),
        plot("gap", "Gap", "mm", true, vec![gap], limit(assembly, |_| vec![Quantity::Gap], true)),
        plot("output", "Output", "deg", false, outputs.collect(), none()),
        plot("turn", "Drive", "deg", false, drives(DriveUnit::Rad, turned), none()),
        plot("way", "Drive", "mm", false, drives(DriveUnit::Mm, slid), none()),
    ];
    let shown = all.into_iter().map(|mut p| {
        p.series.retain(|s| !s.after.is_empty());
        p.merged()
    });
    shown.filter(|p| !p.is_empty()).collect()
}

/// Of every traced direction of every instance, deg.
fn aim_errors(known: &Known<'_>) -> Vec<Series> {
    let of = |motion: &Motion, i: usize, k: usize| -> Vec<f64> {
        let series = motion.placed.get(i).and_then(|s| s.aims.aim_errors_rad.get(k));
        series.map(|s| s.iter().map(|v| v.to_degrees()).collect()).unwrap_or_default()
    };
    let mut out = Vec::new();
    for (i, (instance, design)) in known.assembly.placed().enumerate() {
        for (k, d) in design.aims.directions.iter().enumerate() {
            let before = known.before.as_ref().map(|b| of(b, i, k)).unwrap_or_default();
            out.push(Series { name: instance.of(&d.name), after: of(&known.after, i, k), before });
        }
    }
    out
}

fn fixed(p: &Parameter) -> Fixed {
    Fixed { path: p.path.clone(), text: p.text.clone(), doc: p.doc.clone() }
}

fn solved(known: &Known<'_>, histories: &[History], stages: &dyn Stages) -> Vec<Solved> {
    let assembly = known.assembly;
    let all = assembly.designs.iter().enumerate().zip(known.solutions).zip(known.values);
    all.map(|(((k, design), solution), values)| {
        let of = assembly.instances.iter().filter(|i| i.design == k && !i.name.is_empty());
        let (first, last) = match design.objectives.is_empty() || design.free.is_empty() {
            true => Default::default(),
            false => (stages.terms(design, &starts(design)), stages.terms(design, values)),
        };
        let terms = first.into_iter().zip(last).map(|((name, a), (_, b))| (name, a, b));
        Solved {
            name: design.name.clone(),
            instances: of.map(|i| i.name.clone()).collect(),
            iterations: solution.iterations,
            converged: solution.converged,
            terms: terms.collect(),
            way: histories.get(k).and_then(way),
            variables: design.free.iter().zip(values).map(|(v, value)| variable(v, *value)).collect(),
        }
    })
    .collect()
}

/// The terms over the iterations, largest first; what is nothing throughout is left out.
fn way(history: &History) -> Option<Way> {
    let mut terms = history.terms.clone();
    terms.retain(|(_, values)| values.iter().any(|v| *v > 0.0));
    terms.sort_by(|a, b| b.1.first().unwrap_or(&0.0).total_cmp(a.1.first().unwrap_or(&0.0)));
    let way = Way { iterations: history.iterations.clone(), terms };
    (!history.is_empty() && !way.terms.is_empty()).then_some(way)
}

fn variable(v: &FreeVariable, value: f64) -> Variable {
    let (unit, per) = match v.unit.as_str() {
        "rad" => ("deg", 1.0_f64.to_degrees()),
        "1" => ("", 1.0),
        other => (other, 1.0),
    };
    let [start, value, lower, upper] = [v.start, value, v.lower, v.upper].map(|x| x * per);
    Variable { path: v.path.clone(), unit: unit.into(), start, value, lower, upper }
}

/// Every motor with the drives that it moves.
fn motors<'a>(known: &Known<'a>) -> Vec<Motor<'a>> {
    let assembly = known.assembly;
    let mut out = Vec::new();
    for (m, first) in assembly.motors.iter().enumerate() {
        let Some(instance) = assembly.instances.get(first.instance) else { continue };
        let Some(design) = assembly.designs.get(instance.design) else { continue };
        let Some(drive) = design.drives.get(first.drive) else { continue };
        let (Some(motor), Some(placed)) = (&drive.motor, instance.drives.get(first.drive)) else { continue };
        let named = |(i, d, _): (usize, usize, f64)| {
            let (instance, design) = assembly.placed().nth(i)?;
            Some(instance.of(&design.drives.get(d)?.name))
        };
        let nodes = design.exprs.values(known.values.get(instance.design).map_or(&[], Vec::as_slice));
        out.push(Motor {
            drives: assembly.members(m).filter_map(named).collect(),
            unit: drive.unit,
            rest: placed.sign * drive.rest_value(&nodes),
            drum_radius_mm: drive.drum_radius_mm,
            motor,
        });
    }
    out
}
