//! What can be aimed at: outputs of the compliant mechanism over the reach of one or two drives, as the solver finds
//! them, and the tables made of that.

use super::stages::{Failed, Response, Stages};
use crate::diagnostic::Diagnostic;
use crate::emit::motion::{AimError, AimTable, Grid, GridAxis, Motion, OutputUnit, identifier};
use crate::ir::{Assembly, Design, DriveUnit, Instance, Stretch, Wanted, Workspace};

/// Places of the solver a step of the table, of one drive and of each of two.
const REFINE: [usize; 2] = [4, 2];
/// Steps of a table that nobody asked for.
const STEPS: usize = 32;
/// Loads that change by less than this part count as constant.
const SAME_LOAD: f64 = 1e-9;

/// A workspace of a design with the solver's answers.
struct Answered {
    design: usize,
    workspace: Workspace,
    /// The longest stretch that can be inverted will do: nobody asked for the rest.
    part: bool,
    /// Drive values along each drive.
    along: Vec<Vec<f64>>,
    response: Result<Response, Failed>,
}

/// Answers of the solver for an assembly; they are asked for once, and only when motor code is.
pub struct Reach<'a> {
    assembly: &'a Assembly,
    values: &'a [Vec<f64>],
    stages: &'a dyn Stages,
    answered: Option<Vec<Answered>>,
}

impl<'a> Reach<'a> {
    /// Nothing asked yet.
    pub fn new(assembly: &'a Assembly, values: &'a [Vec<f64>], stages: &'a dyn Stages) -> Self {
        Self { assembly, values, stages, answered: None }
    }

    /// The tables for outputs that follow from some motors; `motion` holds these in the same order.
    pub fn tables(&mut self, motors: &[usize], motion: &Motion) -> (Vec<AimTable>, Vec<Diagnostic>) {
        let (assembly, values, stages) = (self.assembly, self.values, self.stages);
        let answered = self.answered.get_or_insert_with(|| answer(assembly, values, stages));
        let (mut tables, mut found) = (Vec::new(), Vec::new());
        for (instance, design) in assembly.placed() {
            for a in answered.iter().filter(|a| a.design == instance.design) {
                match table(instance, design, a, motors, motion) {
                    None | Some(Ok(Err(AimError::Flat))) if a.part => {}
                    None => {}
                    Some(Ok(Ok(table))) => tables.push(table),
                    Some(Ok(Err(_))) if a.part => {}
                    Some(Ok(Err(e))) => {
                        let message = format!("this workspace cannot be inverted: {e}");
                        found.push(Diagnostic::error("E0725", message, a.workspace.origin).help(
                            "make the workspace smaller, so that every output belongs to one place in it",
                        ));
                    }
                    Some(Err(_)) if a.part => {}
                    Some(Err(why)) => found.push(why),
                }
            }
        }
        found.dedup();
        (tables, found)
    }
}

/// All workspaces of all designs: those written, and every output of a design with one drive.
fn answer(assembly: &Assembly, values: &[Vec<f64>], stages: &dyn Stages) -> Vec<Answered> {
    let mut out = Vec::new();
    for (d, (design, values)) in assembly.designs.iter().zip(values).enumerate() {
        let written = design.aims.workspaces.iter().map(|w| (w.clone(), false));
        let implied = implied(design).into_iter().map(|w| (w, true));
        for (workspace, part) in written.chain(implied) {
            let along = along(&workspace);
            let response = match steady(design) {
                true => stages.respond(design, values, &places(design, values, &workspace, &along)),
                false => Err(vec![unsteady(design, &workspace)]),
            };
            out.push(Answered { design: d, workspace, part, along, response });
        }
    }
    out
}

/// Outputs that follow from the only drive, over the stretch that it goes in the cycle.
fn implied(design: &Design) -> Vec<Workspace> {
    let [drive] = design.drives.as_slice() else { return Vec::new() };
    let steps = design.cycle.steps;
    let values = (0..=steps).map(|s| drive.value(s as f64 / steps as f64));
    let (from, to) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let written = |i: usize| {
        let aims = |w: &Workspace| w.wanted.contains(&Wanted::Angle(i));
        design.aims.workspaces.iter().any(aims)
    };
    let named = design.aims.angles.iter().enumerate().filter(|(i, a)| a.name.is_some() && !written(*i));
    let stretch = Stretch { drive: 0, from, to, steps: STEPS };
    named
        .filter(|_| to > from)
        .map(|(i, a)| Workspace {
            wanted: vec![Wanted::Angle(i)],
            stretches: vec![stretch.clone()],
            origin: a.origin,
        })
        .collect()
}

/// Drive values of the fine grid along each drive.
fn along(workspace: &Workspace) -> Vec<Vec<f64>> {
    let refine = refine(workspace);
    let line = |s: &Stretch| {
        let n = s.steps * refine;
        (0..=n).map(|k| s.from + (s.to - s.from) * k as f64 / n as f64).collect()
    };
    workspace.stretches.iter().map(line).collect()
}

fn refine(workspace: &Workspace) -> usize {
    workspace.stretches.len().checked_sub(1).and_then(|i| REFINE.get(i).copied()).unwrap_or(1)
}

/// Values of all drives at every place, forth and back, so that neighbours follow each other; the others at rest.
fn places(design: &Design, values: &[f64], workspace: &Workspace, along: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let nodes = design.exprs.values(values);
    let rest: Vec<f64> = design.drives.iter().map(|d| d.rest_value(&nodes)).collect();
    let set = |chosen: &[f64]| {
        let mut all = rest.clone();
        for (s, v) in workspace.stretches.iter().zip(chosen) {
            if let Some(slot) = all.get_mut(s.drive) {
                *slot = *v;
            }
        }
        all
    };
    match along {
        [a] => a.iter().map(|v| set(&[*v])).collect(),
        [a, b] => {
            let row = |(i, v): (usize, &f64)| -> Vec<Vec<f64>> {
                let there = b.iter().map(|w| set(&[*v, *w]));
                if i % 2 == 0 { there.collect() } else { there.rev().collect() }
            };
            a.iter().enumerate().flat_map(row).collect()
        }
        _ => Vec::new(),
    }
}

/// Whether loads stay as they are: else an output does not tell the drives.
fn steady(design: &Design) -> bool {
    let steps = design.cycle.steps.max(1);
    design.loads.iter().all(|l| {
        let first = l.size(0.0);
        (1..=steps).all(|s| (l.size(s as f64 / steps as f64) - first).abs() <= SAME_LOAD * first.abs())
    })
}

fn unsteady(design: &Design, workspace: &Workspace) -> Diagnostic {
    let at = design.loads.first().map_or(workspace.origin, |l| l.origin);
    Diagnostic::error("E0726", "a workspace needs loads that do not change over the cycle", workspace.origin)
        .also(at, "a load of this design")
        .help("under another load the same drives give another output")
}

/// The table of an instance; none where another motor moves it, or the answer is of no use.
fn table(
    instance: &Instance,
    design: &Design,
    answered: &Answered,
    motors: &[usize],
    motion: &Motion,
) -> Option<Result<Result<AimTable, AimError>, Diagnostic>> {
    let workspace = &answered.workspace;
    let mut axes = Vec::new();
    for (s, values) in workspace.stretches.iter().zip(&answered.along) {
        let placed = instance.drives.get(s.drive)?;
        let index = motors.iter().position(|m| *m == placed.motor)?;
        let axis = motion.axes.get(index)?;
        let shaft = values.iter().map(|v| axis.shaft_rad(placed.sign * v).map(f64::to_degrees));
        axes.push(GridAxis {
            axis: index,
            name: axis.name.clone(),
            shaft_deg: shaft.collect::<Option<_>>()?,
            value: values.iter().map(|v| axis.shown(placed.sign * v)).collect(),
            unit: if axis.unit == DriveUnit::Rad { "deg" } else { "mm" },
            resolution_deg: axis.resolution_rad().to_degrees(),
        });
    }
    let response = match &answered.response {
        Ok(response) => response,
        Err(found) => {
            let why = found.first().map_or("no equilibrium", |d| d.message.as_str());
            let first = found.first().filter(|d| d.code == "E0726").cloned();
            let message = format!("the mechanism cannot be followed over this workspace: {why}");
            let d = Diagnostic::error("E0726", message, workspace.origin);
            let label = found.first().and_then(|d| d.labels.first()).map(|l| l.text.clone());
            let d = match label.filter(|l| !l.is_empty()) {
                Some(l) => d.label(l),
                None => d,
            };
            return Some(Err(first.unwrap_or_else(|| d.help("make the workspace smaller"))));
        }
    };
    let columns = answered.along.get(1).map_or(1, Vec::len);
    let ordered = |list: Vec<f64>| -> Vec<f64> {
        let mut list = list;
        if answered.along.len() == 2 {
            for (i, row) in list.chunks_mut(columns).enumerate() {
                if i % 2 == 1 {
                    row.reverse();
                }
            }
        }
        list
    };
    let outputs: Option<Vec<Vec<f64>>> =
        workspace.wanted.iter().map(|w| response.series(*w, instance).map(ordered)).collect();
    let wanted: Option<Vec<(String, OutputUnit)>> =
        workspace.wanted.iter().map(|w| called(design, instance, *w)).collect();
    let (outputs, wanted) = (outputs?, wanted?);
    let name = match wanted.as_slice() {
        [(a, _), (b, _)] => match (a.rsplit_once('.'), b.rsplit_once('.')) {
            (Some((p, x)), Some((q, y))) if p == q => format!("{p}_{x}{y}"),
            _ => format!("{a}_{b}"),
        },
        [(a, _)] => a.clone(),
        _ => return None,
    };
    let grid = Grid {
        name: identifier(&name),
        wanted,
        axes,
        refine: refine(workspace),
        outputs,
        part: answered.part,
    };
    Some(Ok(AimTable::new(&grid)))
}

fn called(design: &Design, instance: &Instance, wanted: Wanted) -> Option<(String, OutputUnit)> {
    let letter = |axis: usize| ["x", "y", "z"].get(axis).copied().unwrap_or("");
    Some(match wanted {
        Wanted::Angle(i) => (instance.of(design.aims.angles.get(i)?.name.as_ref()?), OutputUnit::Deg),
        Wanted::Place { trace, axis } => {
            (format!("{}.{}", instance.of(&design.traces.get(trace)?.name), letter(axis)), OutputUnit::Mm)
        }
        Wanted::Direction { direction, axis } => {
            let name = &design.aims.directions.get(direction)?.name;
            (format!("{}.{}", instance.of(name), letter(axis)), OutputUnit::One)
        }
    })
}

impl Response {
    /// One value a place: degrees of an angle as the assembly counts it, mm and components in the design's own axes.
    fn series(&self, wanted: Wanted, instance: &Instance) -> Option<Vec<f64>> {
        let component = |list: &[[f64; 3]], axis: usize| -> Option<Vec<f64>> {
            list.iter().map(|p| p.get(axis).copied()).collect()
        };
        match wanted {
            Wanted::Angle(i) => {
                let hand = instance.placement.handedness();
                Some(self.angles_rad.get(i)?.iter().map(|a| (a * hand).to_degrees()).collect())
            }
            Wanted::Place { trace, axis } => component(self.traces_mm.get(trace)?, axis),
            Wanted::Direction { direction, axis } => component(self.directions.get(direction)?, axis),
        }
    }
}
