//! The real stages: the only place where the pipeline touches elaboration, kinematics, equilibrium,
//! optimisation and geometry.

use super::aims::AimSeries;
use super::bill;
use super::gravity;
use super::joined::{self, Solid};
use super::products::{self, Built};
use super::progress::Iteration;
use super::report::{Place, Worst};
use super::scene::{Moving, scene};
use super::solids;
use super::stability;
use super::stages::{Between, Checked, Failed, Parts, Plans, Response, Simulation, Solved, Stages};
use crate::diagnostic::{Diagnostic, Origin};
use crate::elaborate::{Files, Options, elaborate};
use crate::emit::csv::{MotionState, MotionTable};
use crate::emit::plate::Plate;
use crate::emit::scene::Scene;
use crate::equilibrium::{
    Cycle, Equilibrium, Layout, LayoutTrace, Model, ModelError, PointForce, SAME_MM, Solver, SweepError,
    apart_mm, load_factors, sweep,
};
use crate::geometry::{follows_geometry, parts_input};
use crate::ir::expr::Node;
use crate::ir::{Assembly, Design, DriveOn, ObjectiveKind, Profile, Solution};
use crate::kinematics::{Motion, solve_motion};
use crate::math::{Pose, log_so3};
use crate::optimize::{self, Ending, Method, Problem};
use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Edges of a rod while solving. At 20 edges the moments of the reference cases are within 0.3 %.
pub const EDGES: usize = 20;
/// Edges of a rod in the printed part, for smooth sides.
const MESH_EDGES: usize = 48;

/// See the module.
#[derive(Clone, Copy, Debug)]
pub struct Compiler {
    /// Which optimiser.
    pub method: Method,
    /// Iterations at most.
    pub iterations: usize,
}

impl Default for Compiler {
    fn default() -> Self {
        Self { method: Method::LevenbergMarquardt, iterations: 100 }
    }
}

impl Stages for Compiler {
    fn check(
        &self,
        source: &str,
        overrides: &[(String, String)],
        steps: Option<usize>,
        variant: Option<&str>,
        files: &dyn Files,
    ) -> Checked {
        let options = Options { set: overrides.to_vec(), steps, variant: variant.map(String::from) };
        let out = elaborate(source, files, &options);
        Checked {
            sources: out.sources,
            assembly: out.assembly,
            variants: out.variants,
            others: out.others,
            files: out.files,
            values: out.values,
            diagnostics: out.diagnostics,
        }
    }

    fn rigid(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        solids::closed(design)?;
        let motion = solve_motion(design, values)?;
        let states = motion
            .states
            .iter()
            .map(|s| MotionState {
                drives: s.drives.clone(),
                traces_mm: s.traces_mm.iter().map(|p| (*p).into()).collect(),
                poses: moving(design, |b| relative(&motion, b, &s.poses[b])),
                ..MotionState::default()
            })
            .collect();
        let aims = AimSeries::conventional(design, &motion);
        Ok(Simulation {
            motion: MotionTable { more: aims.columns(design), ..table(design, false, states) },
            aims,
            diagnostics: motion.warnings.clone(),
            conventional: Some(motion),
            ..Simulation::default()
        })
    }

    fn simulate(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        let design = &*gravity::weighed(design, values);
        let (layout, motion) = layout(design, values)?;
        let model = Model::new(design, &layout, values, EDGES, false).map_err(|e| no_rod(design, &e))?;
        let cycle = sweep(&model).map_err(|e| lost(design, &e))?;
        let mut simulation = swept(design, &layout, &model, &cycle, &motion);
        let stability = stability::released(design, &layout, &model, &cycle, &mut simulation.diagnostics);
        if let Some(planned) = solids::planned(design, &layout, &model, &cycle) {
            let gaps = solids::gaps(&planned);
            simulation.diagnostics.extend(solids::not_carved(design, &planned.carving));
            simulation.diagnostics.extend(solids::collisions(design, &gaps));
            simulation.gaps_mm = gaps.least.iter().filter_map(|g| g.map(|g| g.gap_mm)).collect();
            simulation.worst.gap = solids::nearest(design, &gaps);
            simulation.planned = Some(Arc::new(planned));
        }
        simulation.stability = stability;
        self.loaded(design, values, simulation)
    }

    fn sweep(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        let design = &*gravity::weighed(design, values);
        let (layout, motion) = layout(design, values)?;
        let model = Model::new(design, &layout, values, EDGES, false).map_err(|e| no_rod(design, &e))?;
        let cycle = sweep(&model).map_err(|e| lost(design, &e))?;
        self.loaded(design, values, swept(design, &layout, &model, &cycle, &motion))
    }

    fn flexure_lengths(&self, design: &Design, values: &[f64], motion: &Motion) -> Option<Vec<f64>> {
        // How the layout changes with the design is of no interest here, and costs most of it.
        let mut fixed = design.clone();
        fixed.exprs.nodes = design.exprs.values(values).into_iter().map(Node::Const).collect();
        let layout = Layout::new(&fixed, motion, values);
        let model = Model::new(design, &layout, values, EDGES, false).ok()?;
        Some(model.rods.iter().map(|r| r.rod.length_mm()).collect())
    }

    fn terms(&self, design: &Design, values: &[f64]) -> Vec<(String, f64)> {
        let design = &*gravity::weighed(design, values);
        let Ok((layout, _)) = layout(design, values) else { return Vec::new() };
        let problem = Problem::new(design, &layout, EDGES);
        let Some(trial) = problem.simulate(&problem.to_unit(values)) else { return Vec::new() };
        problem.term_names().into_iter().zip(trial.terms).collect()
    }

    fn respond(&self, design: &Design, values: &[f64], drives: &[Vec<f64>]) -> Result<Response, Failed> {
        let design = &along(design, drives);
        let design = &*gravity::weighed(design, values);
        let (layout, motion) = layout(design, values)?;
        let model = Model::new(design, &layout, values, EDGES, false).map_err(|e| no_rod(design, &e))?;
        let cycle = sweep(&model).map_err(|e| lost(design, &e))?;
        let aims = AimSeries::compliant(design, &layout, &motion, &cycle);
        let place = |t: &LayoutTrace| {
            cycle.states.iter().map(|e| e.state.poses[t.body].point(&t.rest).into()).collect()
        };
        Ok(Response {
            angles_rad: aims.angles_rad,
            traces_mm: layout.traces.iter().map(place).collect(),
            directions: aims.directions,
        })
    }

    fn between(&self, assembly: &Assembly, simulations: &[Simulation]) -> Between {
        if assembly.instances.len() < 2 && assembly.hinged(0).next().is_none() {
            return Between::default();
        }
        // What fails here has failed, and is told, where the designs were simulated.
        let designs: Option<Vec<_>> = simulations.iter().map(|s| s.planned.as_deref()).collect();
        designs.map(|d| joined::between(assembly, &d)).unwrap_or_default()
    }

    fn optimize(
        &self,
        design: &Design,
        start: &[f64],
        on_iteration: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed> {
        gravity::rounds(design, start, self.iterations, on_iteration, &|design, start, iterations, told| {
            Self { iterations, ..*self }.solve(design, start, told, cancel)
        })
    }

    fn parts(&self, assembly: &Assembly, values: &[Vec<f64>], plans: &Plans) -> Result<Parts, Failed> {
        let mut found = Vec::new();
        let (mut built, mut moving) = (Vec::new(), Vec::new());
        for (d, (design, values)) in assembly.designs.iter().zip(values).enumerate() {
            solids::available(design)?;
            let design = &*gravity::weighed(design, values);
            let (layout, _) = layout(design, values)?;
            let model =
                Model::new(design, &layout, values, MESH_EDGES, false).map_err(|e| no_rod(design, &e))?;
            let solved = Model::new(design, &layout, values, EDGES, false).map_err(|e| no_rod(design, &e))?;
            let cycle = sweep(&solved).map_err(|e| lost(design, &e))?;
            // What flexures sweep over the cycle is taken out of their own links.
            let known = plans.designs.get(d).cloned().flatten();
            let planned = match known {
                Some(planned) => planned,
                None => Arc::new(solids::plan(design, &layout, &solved, &cycle)?),
            };
            let input = parts_input(design, &layout, &model);
            let (parts, findings) =
                solids::build(design, &input, &planned, &|bodies| joined::stands_alone(assembly, d, bodies))?;
            found.extend(findings);
            moving.push(Moving::new(design, &layout, &solved, &cycle));
            built.push(Solid { input, parts, states: planned.states.clone(), values: values.clone() });
        }
        let (parts, findings) = joined::parts(assembly, &built, plans.whole.as_deref())?;
        found.extend(findings);
        let whole = Built { assembly, solids: &built, moving: &moving, printed: &parts };
        let made = products::artefacts(&whole);
        found.extend(made.diagnostics);
        Ok(Parts { diagnostics: found, ..made })
    }

    fn outline(&self, assembly: &Assembly, values: &[Vec<f64>]) -> Result<(Scene, Plate), Failed> {
        let (mut outlined, mut moving) = (Vec::new(), Vec::new());
        for (design, values) in assembly.designs.iter().zip(values) {
            let design = &*gravity::weighed(design, values);
            let (layout, _) = layout(design, values)?;
            let model = Model::new(design, &layout, values, EDGES, false).map_err(|e| no_rod(design, &e))?;
            let cycle = sweep(&model).map_err(|e| lost(design, &e))?;
            moving.push(Moving::new(design, &layout, &model, &cycle));
            outlined.push(solids::outlined(design, &layout, &model, &cycle));
        }
        let scene = scene(assembly, &moving, &outlined, &joined::outlines(assembly, &outlined));
        let bought = bill::bought(assembly);
        Ok((scene, Plate { name: assembly.name.clone(), parts: Vec::new(), bought }))
    }
}

impl Compiler {
    /// A simulation with those of the design's load cases.
    fn loaded(&self, design: &Design, values: &[f64], mut own: Simulation) -> Result<Simulation, Failed> {
        for case in &design.cases {
            let here = |found: Vec<Diagnostic>| -> Vec<Diagnostic> {
                found.into_iter().map(|d| d.also(case.origin, "in this load case")).collect()
            };
            let mut under = self.sweep(&design.under(case), values).map_err(here)?;
            let mut found = std::mem::take(&mut under.diagnostics);
            found.retain(|d| !own.diagnostics.contains(d));
            own.diagnostics.extend(here(found));
            own.cases.push(under);
        }
        Ok(own)
    }

    /// One run of the optimiser.
    fn solve(
        &self,
        design: &Design,
        start: &[f64],
        on_iteration: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed> {
        let (layout, _) = layout(design, start)?;
        if layout.changes.is_none() {
            return Err(vec![dead_point(design)]);
        }
        if let Some(term) =
            design.all_objectives().find(|o| matches!(o.kind, ObjectiveKind::Collision { .. }))
        {
            let asks = |d: Diagnostic| {
                d.also(term.origin, "this term sees the printed form").help(
                    "without `collision` and `export stl` the mechanism can be checked, simulated and solved",
                )
            };
            solids::available(design)
                .map_err(|found| found.into_iter().map(asks).collect::<Vec<Diagnostic>>())?;
            if !follows_geometry(design) {
                return Err(vec![not_followed(design, term.origin)]);
            }
            solids::plannable(design, &layout, start, EDGES)?;
        }
        let asked = design.cases.iter().filter(|c| !c.objectives.is_empty());
        let cases: Vec<_> = asked.map(|c| (&c.name, design.under(c))).collect();
        let layouts = cases.iter().map(|(_, d)| Ok(self::layout(d, start)?.0));
        let layouts = layouts.collect::<Result<Vec<Layout>, Failed>>()?;
        let under =
            cases.iter().zip(&layouts).map(|((name, d), l)| ((*name).clone(), Problem::new(d, l, EDGES)));
        let problem = Problem::new(design, &layout, EDGES).with_cases(under.collect());
        let names = problem.term_names();
        let told = |i: &optimize::Iteration| {
            on_iteration(&Iteration {
                number: i.number,
                objective: i.cost,
                terms: names.iter().cloned().zip(i.terms.iter().copied()).collect(),
                max_error_mm: i.max_error_mm,
                max_stress_mpa: Some(i.max_stress_mpa),
            });
        };
        let found = optimize::optimize(problem, self.method, start, self.iterations, cancel, &told);
        if found.ending == Ending::NoStart {
            // Say why, by simulating the start once more.
            self.simulate(design, start)?;
            let message = "the optimiser has nowhere to begin: an objective cannot be computed at the start";
            let loaded = design
                .all_objectives()
                .find(|o| matches!(o.kind, ObjectiveKind::Sway { .. } | ObjectiveKind::SwayAlong { .. }));
            let at = loaded.map_or(design.origin, |o| o.origin);
            return Err(vec![
                Diagnostic::error("E0611", message, at)
                    .help("a `sway` force may be more than the flexures bear: give it a smaller `force`"),
            ]);
        }
        let values = design.free.iter().map(|f| f.path.clone()).zip(found.p).collect();
        let mut diagnostics = Vec::new();
        if found.ending == Ending::Limit {
            let message = format!("the optimiser was still improving after {} iterations", found.iterations);
            diagnostics.push(
                Diagnostic::warning("W0610", message, design.origin)
                    .help("take the result if it is good enough, or go on from it with `--resume`"),
            );
        }
        Ok(Solved {
            solution: Solution {
                values,
                iterations: found.iterations,
                converged: found.ending == Ending::Converged,
            },
            interrupted: found.ending == Ending::Interrupted,
            diagnostics,
        })
    }
}

/// What a sweep shows without printed solids.
fn swept(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle, motion: &Motion) -> Simulation {
    let states = cycle.states.iter().enumerate().map(|(s, e)| MotionState {
        drives: layout.drives.iter().map(|d| d.values[s]).collect(),
        traces_mm: layout.traces.iter().map(|t| e.state.poses[t.body].point(&t.rest).into()).collect(),
        drive_loads: (0..layout.drives.len()).map(|d| e.drive_load(model, d)).collect(),
        energy_n_mm: e.energy_n_mm,
        load_potential_n_mm: e.load_potential_n_mm,
        stress_max_mpa: e.max_stress_mpa(model),
        poses: moving(design, |b| from_rest(&e.state.poses[b])),
    });
    let errors_mm = layout
        .traces
        .iter()
        .enumerate()
        .map(|(i, t)| {
            let distance = |(e, target): (&Equilibrium, &Vector3<f64>)| {
                (e.state.poses[t.body].point(&t.rest) - target).norm()
            };
            // Without a drive the conventional mechanism stands still: that is no target.
            let states = if design.has_target(i) { cycle.states.as_slice() } else { &[] };
            states.iter().zip(&t.target).map(distance).collect()
        })
        .collect();
    let mut diagnostics = judge(design, layout, cycle);
    diagnostics.extend(news(design, motion));
    diagnostics.extend(slack(design, model, cycle));
    let aims = AimSeries::compliant(design, layout, motion, cycle);
    let motion = MotionTable { more: aims.columns(design), ..table(design, true, states.collect()) };
    let stress = most_stressed(design, model, cycle);
    let sway_mm = gives_way(design, layout, model, cycle);
    let worst = Worst { stress, gap: None };
    let load_factors = if design.asks_for_buckling() { load_factors(model, cycle) } else { Vec::new() };
    Simulation { motion, errors_mm, aims, worst, sway_mm, load_factors, diagnostics, ..Simulation::default() }
}

/// States at which the give of the traced points is looked at.
const GIVE_STATES: usize = 8;

/// How far each traced point gives way to 1 N across its path, at most over some states, mm: the directions are the
/// stacking axis and the in-plane normal, to first order.
fn gives_way(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> Vec<f64> {
    let mut most = vec![0.0; layout.traces.len()];
    if layout.traces.is_empty() || cycle.states.len() < 2 {
        return most;
    }
    let mut solver = Solver::new(model);
    let axis = Vector3::from(design.layers.axis);
    let step = (cycle.states.len() / GIVE_STATES).max(1);
    for s in (0..cycle.states.len() - 1).step_by(step) {
        let (Some(here), Some(next)) = (cycle.states.get(s), cycle.states.get(s + 1)) else { continue };
        let Ok(held) = solver.solve(model, here.state.clone(), &layout.controls(s)) else { continue };
        for (most, trace) in most.iter_mut().zip(&layout.traces) {
            let at = |e: &Equilibrium| e.state.poses[trace.body].point(&trace.rest);
            let along = (at(next) - at(here)).try_normalize(NO_WAY_MM).unwrap_or_else(Vector3::x);
            let normals = [axis.cross(&along), along.cross(&axis.cross(&along))];
            for n in normals.iter().filter_map(|n| n.try_normalize(NO_WAY_MM)) {
                let force = PointForce { body: trace.body, rest: trace.rest, force_n: n };
                let response = solver.response(model, &held.state, &[force]);
                if let Some(first) = layout.bodies.get(trace.body).and_then(|b| b.first_dof) {
                    let part = |i: usize| Vector3::from_fn(|k, _| response[first + i + k]);
                    let arm = held.state.poses[trace.body].arm(&trace.rest);
                    *most = f64::max(*most, (part(0) + part(3).cross(&arm)).norm());
                }
            }
        }
    }
    most
}

/// Ways shorter than this have no direction, mm.
const NO_WAY_MM: f64 = 1e-9;

/// The design with a cycle that takes its drives through given places, and no goals. Its loads must be constant.
fn along(design: &Design, drives: &[Vec<f64>]) -> Design {
    let mut design = design.clone();
    let last = drives.len().saturating_sub(1).max(1);
    for (d, drive) in design.drives.iter_mut().enumerate() {
        let key = |(k, place): (usize, &Vec<f64>)| {
            (k as f64 / last as f64, place.get(d).copied().unwrap_or(f64::NAN))
        };
        let keys = drives.iter().enumerate().map(key).collect();
        drive.profile = Profile::Keys { smooth: false, keys, closed: false };
    }
    design.cycle.steps = last;
    design.aims.targets.clear();
    design.objectives.clear();
    design.requirements.clear();
    design.cases.clear();
    design
}

/// Conventional motion and layout.
pub(super) fn layout(design: &Design, values: &[f64]) -> Result<(Layout, Motion), Failed> {
    let motion = solve_motion(design, values)?;
    Ok((Layout::new(design, &motion, values), motion))
}

/// Findings of the conventional motion where free variables have moved it: those at the start are told by the check.
fn news(design: &Design, motion: &Motion) -> Vec<Diagnostic> {
    if design.geometry_variables().is_empty() || motion.warnings.is_empty() {
        return Vec::new();
    }
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let told = solve_motion(design, &start).map(|m| m.warnings).unwrap_or_default();
    motion.warnings.iter().filter(|w| !told.contains(w)).cloned().collect()
}

/// The geometry is to vary, but the conventional motion cannot be differentiated at the start.
fn dead_point(design: &Design) -> Diagnostic {
    let moving = design.geometry_variables();
    let first = moving.first().and_then(|i| design.free.get(*i));
    let message = "points cannot be free in a cycle that stops exactly at a dead point";
    Diagnostic::error("E0612", message, first.map_or(design.origin, |f| f.origin))
        .label("this moves points of the mechanism, or its rest pose")
        .help("shift the drive's range a little, take another number of steps, or write a number here")
}

/// The objective sees links whose form cannot be followed exactly when the mechanism's own geometry varies.
fn not_followed(design: &Design, term: Origin) -> Diagnostic {
    let message = "`collision` cannot follow free points yet in a mechanism in space or with a sliding pair";
    let points = design.bodies.iter().flat_map(|b| &b.skeleton).flat_map(|p| p.position);
    let drawn = design.exprs.free_variables(&points.collect::<Vec<_>>()).into_iter().next();
    let first = design.geometry_variables().first().copied().or(drawn).and_then(|i| design.free.get(i));
    Diagnostic::error("E0613", message, first.map_or(design.origin, |f| f.origin))
        .label("this moves points of the mechanism, or its rest pose")
        .also(term, "this term sees the printed form")
        .help("write a number here, or leave `collision` out")
}

fn table(design: &Design, has_forces: bool, states: Vec<MotionState>) -> MotionTable {
    MotionTable {
        drives: design.drives.iter().map(|d| (d.name.clone(), d.unit)).collect(),
        traces: design.traces.iter().map(|t| t.name.clone()).collect(),
        bodies: design.bodies.iter().filter(|b| !b.ground).map(|b| b.name.clone()).collect(),
        has_forces,
        has_loads: design.all_loads().next().is_some(),
        states,
        ..MotionTable::default()
    }
}

fn moving<T>(design: &Design, f: impl Fn(usize) -> T) -> Vec<T> {
    (0..design.bodies.len()).filter(|b| !design.bodies[*b].ground).map(f).collect()
}

/// Translation t and rotation vector of x = t + R X, with X in the rest pose.
fn from_rest(pose: &Pose) -> ([f64; 3], [f64; 3]) {
    (pose.point(&Vector3::zeros()).into(), log_so3(&pose.rotation).into())
}

/// The same for a pose given relative to the drawing pose.
fn relative(motion: &Motion, body: usize, pose: &Pose) -> ([f64; 3], [f64; 3]) {
    let rest = &motion.rest.poses[body];
    let rotation = pose.rotation * rest.rotation.transpose();
    // The drawing's origin lies at rest.point(0) in the rest pose.
    let t = pose.point(&Vector3::zeros()) - rotation * rest.point(&Vector3::zeros());
    (t.into(), log_so3(&rotation).into())
}

fn no_rod(design: &Design, error: &ModelError) -> Failed {
    let rod = &design.rods[error.rod];
    let message = format!("the flexure `{}` has no shape: {}", rod.path, error.error);
    vec![
        Diagnostic::error("E0601", message, rod.origin)
            .also(design.joints[rod.joint].origin, "for this joint")
            .help("move its ends apart, or give its ends a direction that leads from one to the other"),
    ]
}

fn lost(design: &Design, error: &SweepError) -> Failed {
    let values = stability::shown(design, &error.last_drives);
    let message = format!("the mechanism cannot be followed to state {}", error.state);
    if let ([], Some(load)) = (design.drives.as_slice(), design.loads.first()) {
        return vec![
            Diagnostic::error("E0602", message, load.origin)
                .label("no equilibrium under this load")
                .help("the flexures bear less than that: thicken them, or make the load smaller"),
        ];
    }
    let at = design.drives.first().map_or(design.origin, |d| d.origin);
    vec![Diagnostic::error("E0602", message, at).label(format!("last equilibrium at {values}")).help(
        "the flexures are asked for more than they can do there: lengthen them, or rest nearer to this value",
    )]
}

/// The largest von Mises stress over the cycle (MPa), the rod and the state.
fn most_stressed(design: &Design, model: &Model, cycle: &Cycle) -> Option<(f64, Place)> {
    let all = cycle.states.iter().enumerate().flat_map(|(s, e)| {
        let rods = model.rods.iter().zip(&e.strains).zip(&design.rods);
        rods.filter_map(move |((rod, strains), told)| {
            let stress = rod.rod.largest_stress(strains)?.von_mises_mpa;
            Some((stress, Place { of: vec![told.path.clone()], state: s }))
        })
    });
    all.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Strings that would have to push.
fn slack(design: &Design, model: &Model, cycle: &Cycle) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for (d, drive) in design.drives.iter().enumerate() {
        let DriveOn::String(string) = drive.on else { continue };
        let pulls: Vec<f64> = cycle.states.iter().map(|e| e.drive_load(model, d)).collect();
        let none = super::measure::no_pull(&pulls);
        let pushing: Vec<usize> = (0..pulls.len()).filter(|s| pulls[*s] < -none).collect();
        let (Some(first), Some(at)) = (pushing.first(), design.strings.get(string).map(|c| c.origin)) else {
            continue;
        };
        let (most, count) = (pulls.iter().fold(0.0, |m, p| f64::min(m, *p)), pushing.len());
        let message = format!("the string `{}` would have to push from state {first}", drive.name);
        found.push(
            Diagnostic::warning("W0620", message, at)
                .label(format!("up to {:.3} N, at {count} of {} states", -most, pulls.len()))
                .also(drive.origin, "driven here")
                .help(
                    "a slack string holds nothing: rest where it begins to pull, or let a load keep it taut",
                ),
        );
    }
    found
}

/// What a followed cycle says about itself.
pub(super) fn judge(design: &Design, layout: &Layout, cycle: &Cycle) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let saddle = |(s, e): (usize, &Equilibrium)| {
        let drives: Vec<f64> = layout.drives.iter().map(|d| d.values[s]).collect();
        (!e.stable).then(|| format!("{s} ({})", stability::shown(design, &drives)))
    };
    let saddles: Vec<String> = cycle.states.iter().enumerate().filter_map(saddle).collect();
    if !saddles.is_empty() {
        let message =
            format!("the mechanism would buckle: no stable equilibrium at state {}", saddles.join(", "));
        found.push(
            Diagnostic::warning("W0603", message, design.origin)
                .help("thicken or shorten the flexures that work in compression"),
        );
    }
    if let (true, Some(first), Some(last)) = (layout.closed, cycle.states.first(), cycle.states.last())
        && apart_mm(layout, &first.state, &last.state) > SAME_MM
    {
        found.push(
            Diagnostic::warning(
                "W0604",
                "after a whole cycle the mechanism is not where it began",
                design.origin,
            )
            .help(
                "it snaps from one equilibrium to another on the way: see the energy in `flexura simulate`",
            ),
        );
    }
    found
}
