//! From the simulated designs to what their instances do in the assembly: places, states, common motors.

use super::aims::AimSeries;
use super::measure::{check_requirement, check_requirements, is_closed, measure};
use super::report::{Measures, Place, RequirementResult, Worst};
use super::stability::{DriveValues, Stability};
use super::stages::{Between, Failed, Simulation};
use crate::diagnostic::Diagnostic;
use crate::emit::csv::{MotionState, MotionTable};
use crate::ir::{Assembly, Design, Instance, Placement};
use crate::math::exp_so3;
use nalgebra::Vector3;
use std::borrow::Cow;

/// What every instance does, in the assembly's coordinates and states; `designs` are the simulations of the designs.
/// A drive's load is that of its motor: the sum over all instances that have it in common.
pub fn place(assembly: &Assembly, designs: &[Simulation]) -> Vec<Simulation> {
    if assembly.single().is_some() {
        return designs.to_vec();
    }
    let mut placed = place_own(assembly, designs);
    // A case is one of every design that has it; the others stay as they are. So common motors bear their sums.
    let named = |d: &Design, name: &str| d.cases.iter().position(|c| c.name == name);
    for ((_, d), own) in assembly.placed().zip(&mut placed) {
        own.cases.resize(d.cases.len(), Simulation::default());
    }
    for name in case_names(assembly) {
        let of = |(d, s): (&Design, &Simulation)| {
            let case = named(d, &name).and_then(|k| s.cases.get(k)).unwrap_or(s);
            Simulation { cases: Vec::new(), ..case.clone() }
        };
        let under: Vec<Simulation> = assembly.designs.iter().zip(designs).map(of).collect();
        for ((own, under), (_, d)) in
            placed.iter_mut().zip(place_own(assembly, &under)).zip(assembly.placed())
        {
            if let Some(slot) = named(d, &name).and_then(|k| own.cases.get_mut(k)) {
                *slot = under;
            }
        }
    }
    placed
}

/// What every instance does under a load case; those without it do what they do.
///
/// # Errors
/// Where no design has it.
pub fn under(assembly: &Assembly, placed: Vec<Simulation>, name: &str) -> Result<Vec<Simulation>, Failed> {
    let known = case_names(assembly);
    if !known.iter().any(|k| k == name) {
        let d = Diagnostic::error("E0120", format!("there is no load case `{name}`"), assembly.origin);
        return Err(vec![match known.is_empty() {
            true => d.help(format!(
                "add for instance `case {name} {{ load 2 N along (0, -1, 0) on coupler at P }}`"
            )),
            false => d.help(format!("there are: {}", known.join(", "))),
        }]);
    }
    let of = |((_, d), s): ((_, &Design), Simulation)| {
        let k = d.cases.iter().position(|c| c.name == name);
        k.and_then(|k| s.cases.get(k).cloned()).unwrap_or(s)
    };
    Ok(assembly.placed().zip(placed).map(of).collect())
}

/// Names of the load cases of all designs, each once.
fn case_names(assembly: &Assembly) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for case in assembly.designs.iter().flat_map(|d| &d.cases) {
        if !names.contains(&case.name) {
            names.push(case.name.clone());
        }
    }
    names
}

fn place_own(assembly: &Assembly, designs: &[Simulation]) -> Vec<Simulation> {
    let pairs = assembly.placed().filter_map(|(i, d)| Some((i, d, designs.get(i.design)?)));
    let mut placed: Vec<Simulation> = pairs.map(|(i, d, s)| placed_simulation(assembly, i, d, s)).collect();
    for motor in 0..assembly.motors.len() {
        let members: Vec<(usize, usize, f64)> = assembly.members(motor).collect();
        if members.len() < 2 {
            continue;
        }
        let states = placed.iter().map(|s| s.motion.states.len()).min().unwrap_or(0);
        for s in 0..states {
            let load = |i: usize, k: usize| {
                placed.get(i).and_then(|p| p.motion.states.get(s)?.drive_loads.get(k).copied())
            };
            let sum: Option<f64> = members.iter().map(|(i, k, _)| load(*i, *k)).sum();
            for (i, k, _) in &members {
                let slot =
                    placed.get_mut(*i).and_then(|p| p.motion.states.get_mut(s)?.drive_loads.get_mut(*k));
                if let (Some(slot), Some(sum)) = (slot, sum) {
                    *slot = sum;
                }
            }
        }
    }
    placed
}

fn placed_simulation(
    assembly: &Assembly,
    instance: &Instance,
    design: &Design,
    simulation: &Simulation,
) -> Simulation {
    let table = &simulation.motion;
    let order = |n: usize| (0..n).map(|s| instance.state(s));
    let states = order(table.states.len()).filter_map(|s| table.states.get(s));
    let series = |values: &[f64]| order(values.len()).filter_map(|s| values.get(s).copied()).collect();
    let aims = placed_aims(instance, &simulation.aims);
    Simulation {
        motion: MotionTable {
            drives: table.drives.iter().map(|(n, unit)| (instance.of(n), *unit)).collect(),
            traces: table.traces.iter().map(|n| instance.of(n)).collect(),
            bodies: table.bodies.iter().map(|n| instance.of(n)).collect(),
            has_forces: table.has_forces,
            has_loads: table.has_loads,
            more: aims.columns(design).into_iter().map(|(n, v)| (column(instance, &n), v)).collect(),
            states: states.map(|s| placed_state(instance, s)).collect(),
        },
        errors_mm: simulation.errors_mm.iter().map(|e| series(e)).collect(),
        gaps_mm: series(&simulation.gaps_mm),
        worst: placed_worst(instance, &simulation.worst),
        sway_mm: simulation.sway_mm.clone(),
        load_factors: series(&simulation.load_factors),
        // Those are in the coordinates of the design.
        planned: None,
        conventional: None,
        aims,
        // What a motor in common would do released is not known from one half.
        stability: match instance.drives.iter().all(|d| users(assembly, d.motor) == 1) {
            true => placed_stability(instance, &simulation.stability),
            false => Default::default(),
        },
        cases: Vec::new(),
        diagnostics: Vec::new(),
    }
}

/// How many drives have a motor.
fn users(assembly: &Assembly, motor: usize) -> usize {
    assembly.instances.iter().flat_map(|i| &i.drives).filter(|d| d.motor == motor).count()
}

/// Rest states by the assembly's names of the drives. An instance whose motors are its own goes through the design's states
/// in their order.
fn placed_stability(instance: &Instance, stability: &Stability) -> Stability {
    let drives = |d: &DriveValues| d.iter().map(|(name, v)| (instance.of(name), *v)).collect();
    let mut out = stability.clone();
    out.rest_states.iter_mut().for_each(|r| r.drives = drives(&r.drives));
    out.limit_points.iter_mut().for_each(|l| l.drives = drives(&l.drives));
    out.snaps.iter_mut().for_each(|s| s.drives = drives(&s.drives));
    out
}

/// Names and states as the assembly has them.
fn placed_worst(instance: &Instance, worst: &Worst) -> Worst {
    let placed = |w: &Option<(f64, Place)>| {
        w.as_ref().map(|(value, p)| {
            let state = instance.states.iter().position(|s| *s == p.state).unwrap_or(p.state);
            (*value, Place { of: p.of.iter().map(|n| instance.of(n)).collect(), state })
        })
    };
    Worst { stress: placed(&worst.stress), gap: placed(&worst.gap) }
}

/// `output.curl_deg` of `index` is `output.index.curl_deg`.
fn column(instance: &Instance, name: &str) -> String {
    match name.split_once('.') {
        Some((what, name)) => format!("{what}.{}", instance.of(name)),
        None => instance.of(name),
    }
}

/// Directions turn with the instance; angles are about the image of their axis.
fn placed_aims(instance: &Instance, aims: &AimSeries) -> AimSeries {
    fn order<T: Clone>(instance: &Instance, values: &[T]) -> Vec<T> {
        (0..values.len()).filter_map(|s| values.get(instance.state(s)).cloned()).collect()
    }
    let all = |lists: &[Vec<f64>]| lists.iter().map(|v| order(instance, v)).collect();
    let p = &instance.placement;
    let turned = |d: [f64; 3]| p.direction(&Vector3::from(d)).into();
    let directions = aims.directions.iter().map(|v| order(instance, v).into_iter().map(turned).collect());
    let angles = aims.angles_rad.iter();
    AimSeries {
        closest_mm: all(&aims.closest_mm),
        aim_errors_rad: all(&aims.aim_errors_rad),
        directions: directions.collect(),
        angles_rad: angles
            .map(|v| order(instance, v).into_iter().map(|a| a * p.handedness()).collect())
            .collect(),
    }
}

fn placed_state(instance: &Instance, state: &MotionState) -> MotionState {
    let p = &instance.placement;
    let signed = |values: &[f64]| {
        let sign = |k: usize| instance.drives.get(k).map_or(1.0, |d| d.sign);
        values.iter().enumerate().map(|(k, v)| sign(k) * v).collect()
    };
    MotionState {
        drives: signed(&state.drives),
        traces_mm: state.traces_mm.iter().map(|t| p.point(&Vector3::from(*t)).into()).collect(),
        drive_loads: signed(&state.drive_loads),
        energy_n_mm: state.energy_n_mm,
        load_potential_n_mm: state.load_potential_n_mm,
        stress_max_mpa: state.stress_max_mpa,
        poses: state.poses.iter().map(|pose| placed_pose(p, pose)).collect(),
    }
}

/// Translation and rotation vector of x = t + R X in the assembly, from those in the design.
fn placed_pose(p: &Placement, (t, r): &([f64; 3], [f64; 3])) -> ([f64; 3], [f64; 3]) {
    if *p == Placement::IDENTITY {
        return (*t, *r);
    }
    let turn = p.turn(&Vector3::from(*r));
    // The design's origin lies at the placement's translation: it moves to the image of t.
    let translation = p.point(&Vector3::from(*t)) - exp_so3(&turn) * Vector3::from(p.translation);
    (translation.into(), turn.into())
}

/// One table for all instances: their columns side by side, a motor in common once, energies added, the largest
/// stress and the least gap of all, that between instances included.
pub fn combine(assembly: &Assembly, placed: Vec<Simulation>, between: &Between) -> Simulation {
    if assembly.single().is_some() {
        return placed.into_iter().next().unwrap_or_default();
    }
    let first = |i: usize, k: usize| {
        let motor = assembly.instances.get(i).and_then(|n| assembly.motors.get(n.drives.get(k)?.motor));
        motor.is_some_and(|m| (m.instance, m.drive) == (i, k))
    };
    let once = |i: usize, body: &String| {
        let index = |b: &crate::ir::Body, n: &Instance| n.of(&b.name) == *body;
        let (n, d) = (
            assembly.instances.get(i),
            assembly.instances.get(i).and_then(|n| assembly.designs.get(n.design)),
        );
        let Some(b) = n.zip(d).and_then(|(n, d)| d.bodies.iter().position(|b| index(b, n))) else {
            return true;
        };
        let group = assembly.joined.iter().find(|j| j.members.contains(&(i, b)));
        group.is_none_or(|j| j.members.first() == Some(&(i, b)))
    };
    let mut out = Simulation::default();
    let states = placed.iter().map(|p| p.motion.states.len()).min().unwrap_or(0);
    out.motion.has_forces = placed.iter().any(|p| p.motion.has_forces);
    out.motion.states = vec![MotionState::default(); states];
    for (i, p) in placed.iter().enumerate() {
        let table = &p.motion;
        let drives: Vec<bool> = (0..table.drives.len()).map(|k| first(i, k)).collect();
        let bodies: Vec<bool> = table.bodies.iter().map(|b| once(i, b)).collect();
        out.motion.drives.extend(kept(&table.drives, &drives));
        out.motion.traces.extend(table.traces.iter().cloned());
        out.motion.bodies.extend(kept(&table.bodies, &bodies));
        out.motion.more.extend(table.more.iter().cloned());
        out.motion.has_loads |= table.has_loads;
        out.errors_mm.extend(p.errors_mm.iter().cloned());
        for (sum, s) in out.motion.states.iter_mut().zip(&table.states) {
            sum.drives.extend(kept(&s.drives, &drives));
            sum.drive_loads.extend(kept(&s.drive_loads, &drives));
            sum.traces_mm.extend(s.traces_mm.iter().copied());
            sum.poses.extend(kept(&s.poses, &bodies));
            sum.energy_n_mm += s.energy_n_mm;
            sum.load_potential_n_mm += s.load_potential_n_mm;
            sum.stress_max_mpa = sum.stress_max_mpa.max(s.stress_max_mpa);
        }
        out.worst.take(&p.worst);
        nearer(&mut out.gaps_mm, &p.gaps_mm);
    }
    nearer(&mut out.gaps_mm, &between.gaps_mm);
    out.worst.take(&between.worst);
    out
}

/// The lesser of two gaps at every state; a list that is empty has none to compare.
fn nearer(gaps_mm: &mut Vec<f64>, others_mm: &[f64]) {
    match gaps_mm.is_empty() {
        true => *gaps_mm = others_mm.to_vec(),
        false => gaps_mm.iter_mut().zip(others_mm).for_each(|(a, b)| *a = a.min(*b)),
    }
}

fn kept<T: Clone>(values: &[T], which: &[bool]) -> Vec<T> {
    values.iter().zip(which).filter(|(_, keep)| **keep).map(|(v, _)| v.clone()).collect()
}

/// Measures by instance (`right.wheel`), a motor in common once, stress and gap of all; under a load case, of the
/// instances that have it.
pub fn measure_all(assembly: &Assembly, placed: &[Simulation], between: &Between) -> Measures {
    if assembly.single().is_some() {
        let pair = assembly.placed().zip(placed).next();
        return pair.map(|((_, design), s)| measure(design, s)).unwrap_or_default();
    }
    let own = assembly.placed().zip(placed).map(|((_, d), s)| Some((Cow::Borrowed(d), s)));
    let mut all = merged(assembly, own, &between.worst);
    all.gap.least_mm =
        between.gaps_mm.iter().fold(all.gap.least_mm, |least, g| more(least, Some(*g), f64::min));
    for name in case_names(assembly) {
        let under = assembly.placed().zip(placed).map(|((_, d), s)| {
            let k = d.cases.iter().position(|c| c.name == name)?;
            Some((Cow::Owned(d.under(d.cases.get(k)?)), s.cases.get(k)?))
        });
        let under = merged(assembly, under, &Worst::default());
        all.cases.insert(name, under);
    }
    all
}

/// Of what every instance is and does; none where it is not looked at.
fn merged<'a>(
    assembly: &Assembly,
    of: impl Iterator<Item = Option<(Cow<'a, Design>, &'a Simulation)>>,
    between: &Worst,
) -> Measures {
    let mut all = Measures::default();
    let mut worst = Worst::default();
    for (i, (instance, of)) in assembly.instances.iter().zip(of).enumerate() {
        let Some((design, simulation)) = of else { continue };
        let own = measure(&design, simulation);
        all.directions.extend(own.directions.into_iter().map(|(n, d)| (instance.of(&n), d)));
        all.outputs.extend(own.outputs.into_iter().map(|(n, o)| (instance.of(&n), o)));
        all.traces.extend(own.traces.into_iter().map(|(n, t)| (instance.of(&n), t)));
        for (k, drive) in design.drives.iter().enumerate() {
            let motor = instance.drives.get(k).and_then(|d| assembly.motors.get(d.motor));
            let loads = own
                .drives
                .get(&drive.name)
                .filter(|_| motor.is_some_and(|m| (m.instance, m.drive) == (i, k)));
            all.drives.extend(loads.map(|l| (instance.of(&drive.name), *l)));
        }
        all.stress.max_mpa = more(all.stress.max_mpa, own.stress.max_mpa, f64::max);
        all.gap.least_mm = more(all.gap.least_mm, own.gap.least_mm, f64::min);
        worst.take(&simulation.worst);
        // Equal instances, and images, say the same.
        if assembly.instances.iter().position(|n| n.design == instance.design) == Some(i) {
            all.stability.rest_states.extend(own.stability.rest_states);
            all.stability.limit_points.extend(own.stability.limit_points);
            all.stability.snaps.extend(own.stability.snaps);
        }
    }
    worst.take(between);
    all.stress.place = worst.stress.map(|w| w.1);
    all.gap.place = worst.gap.map(|w| w.1);
    all
}

fn more(a: Option<f64>, b: Option<f64>, how: fn(f64, f64) -> f64) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(how(a, b)),
        (a, b) => a.or(b),
    }
}

/// Checks the requirements of every design once, and those of the assembly.
pub fn check_all(
    assembly: &Assembly,
    designs: &[Simulation],
    placed: &[Simulation],
    between: &Between,
    found: &mut Vec<Diagnostic>,
) -> Vec<RequirementResult> {
    let mut out = Vec::new();
    for (design, simulation) in assembly.designs.iter().zip(designs) {
        let results = check_requirements(design, simulation, found);
        out.extend(results.into_iter().map(|r| match assembly.single() {
            Some(_) => r,
            None => RequirementResult { text: format!("{}: {}", design.name, r.text), ..r },
        }));
    }
    if assembly.requirements.is_empty() {
        return out;
    }
    let closed = assembly.designs.iter().all(is_closed);
    let mut whole = combine(assembly, placed.to_vec(), between);
    if assembly.instances.len() > 1 && between.gaps_mm.is_empty() {
        // The gap of the whole is not that of its instances.
        whole.gaps_mm.clear();
    }
    for r in &assembly.requirements {
        let of = r.instance.and_then(|i| placed.get(i)).unwrap_or(&whole);
        out.push(check_requirement(&r.requirement, closed, of, found));
    }
    out
}
