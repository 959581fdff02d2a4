//! Derivatives by all free variables of any design against differences: of the rest pose and the targets, of every
//! state, and of the whole objective. For any `.mech` text with an objective.

use super::shaken;
use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Cycle, Layout, Model, SensitivityWorkspace, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::optimize::Problem;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Step in the unit box: differences of sixth order, large enough that rounding stays below 1e-6.
const STEP: f64 = 2e-3;
/// Weights of f(h) − f(−h), f(2h) − f(−2h), f(3h) − f(−3h) in 60 h f'.
const WEIGHTS: [f64; 3] = [45.0, -9.0, 1.0];
/// Derivatives agree to this part of the largest of their kind.
const AGREES: f64 = 1e-6;

/// Edges of the rods and steps of the cycle in these checks.
pub const EDGES: usize = 12;

/// Elaborates a text that must be without errors.
pub fn design(text: &str, steps: usize) -> Design {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let options = Options { steps: Some(steps), ..Options::default() };
    let found = elaborate("main.mech", &files, &options);
    assert_eq!(found.diagnostics, [], "{text}");
    found.design.unwrap()
}

/// The layout at `p`, assembled anew.
pub fn layout(design: &Design, p: &[f64]) -> Layout {
    Layout::new(design, &solve_motion(design, p).unwrap(), p)
}

fn cycle<'a>(design: &Design, p: &[f64]) -> (Model<'a>, Cycle) {
    let model = Model::new(design, layout(design, p), p, EDGES, false).unwrap();
    let cycle = sweep(&model).unwrap();
    (model, cycle)
}

/// Difference of sixth order of a list of numbers by variable `i`, per width of its bounds.
fn differences<T>(
    design: &Design,
    p: &[f64],
    i: usize,
    at: impl Fn(&[f64]) -> T,
    list: impl Fn(&T) -> Vec<f64>,
) -> Vec<f64> {
    let width = design.free[i].upper - design.free[i].lower;
    let mut out: Vec<f64> = Vec::new();
    for (k, w) in WEIGHTS.iter().enumerate() {
        for sign in [1.0, -1.0] {
            let mut q = p.to_vec();
            q[i] += sign * (k + 1) as f64 * STEP * width;
            let values = list(&at(&q));
            out.resize(values.len(), 0.0);
            for (o, v) in out.iter_mut().zip(values) {
                *o += sign * w * v / (60.0 * STEP);
            }
        }
    }
    out
}

/// Largest deviation of exact derivatives (by each variable, per width of its bounds) from differences, relative to the
/// largest of them; `by` says which kind of number each is, so that each kind is compared with its own size.
struct Worst {
    kinds: BTreeMap<&'static str, (f64, f64, String)>,
}

impl Worst {
    fn new() -> Self {
        Self { kinds: BTreeMap::new() }
    }

    fn add(&mut self, kind: &'static str, by: &str, exact: f64, difference: f64) {
        let (off, size, at) = self.kinds.entry(kind).or_insert((0.0, 0.0, String::new()));
        if (exact - difference).abs() > *off {
            (*off, *at) = ((exact - difference).abs(), by.to_string());
        }
        *size = size.max(exact.abs());
        assert!(exact.is_finite() && difference.is_finite());
    }

    fn check(&self, name: &str) {
        for (kind, (off, size, at)) in &self.kinds {
            println!("{name}: {kind} off by {:.1e} of {size:.3e}", off / size.max(1e-12));
            assert!(*off <= AGREES * size.max(1e-9), "{name}: {kind} by {at} off by {off:e} of {size:e}");
        }
    }
}

fn extend(out: &mut Vec<f64>, v: &Vector3<f64>) {
    out.extend(v.iter());
}

/// Everything in the layout that a free variable of the geometry may move, kind by kind.
fn laid(layout: &Layout) -> Vec<(&'static str, Vec<f64>)> {
    let mut frames = Vec::new();
    for end in layout.rod_ends.iter().flatten() {
        extend(&mut frames, &end.origin);
        frames.extend(end.axes.iter().map(|x| 10.0 * x));
    }
    let (mut rest, mut target) = (Vec::new(), Vec::new());
    for trace in &layout.traces {
        extend(&mut rest, &trace.rest);
        trace.target.iter().for_each(|t| extend(&mut target, t));
    }
    let drives = layout.drives.iter().map(|d| d.rest).collect();
    vec![("frames", frames), ("rest of traces", rest), ("targets", target), ("rest of drives", drives)]
}

/// Rest pose, end frames and targets by every variable that moves them.
pub fn check_layout(design: &Design, seed: u64) {
    let p = shaken(design, seed);
    let here = layout(design, &p);
    let mut worst = Worst::new();
    for change in here.changes.as_ref().unwrap() {
        let i = change.parameter;
        let width = design.free[i].upper - design.free[i].lower;
        let (mut frames, mut rest, mut target) = (Vec::new(), Vec::new(), Vec::new());
        for end in change.rod_ends.iter().flatten() {
            extend(&mut frames, &end.origin);
            frames.extend(end.axes.iter().map(|x| 10.0 * x));
        }
        for trace in &change.traces {
            extend(&mut rest, &trace.rest);
            trace.target.iter().for_each(|t| extend(&mut target, t));
        }
        let drives: Vec<f64> = change.drives.iter().map(|d| d.rest).collect();
        let exact = [frames, rest, target, drives];
        for (k, exact) in exact.iter().enumerate() {
            let by = differences(design, &p, i, |q| layout(design, q), |l| laid(l)[k].1.clone());
            let kind = laid(&here)[k].0;
            assert_eq!(exact.len(), by.len());
            for (e, d) in exact.iter().zip(by) {
                worst.add(kind, &design.free[i].path, e * width, d);
            }
        }
        // Skeleton points by the accessor that others use.
        let values = design.exprs.evaluate(&p);
        for (b, body) in design.bodies.iter().enumerate() {
            for point in &body.skeleton {
                let (_, rows) = here.rest_point(&values, p.len(), b, point.position).unwrap();
                let at = |l: &(Layout, Vec<f64>)| {
                    let values = design.exprs.evaluate(&l.1);
                    let (at, _) = l.0.rest_point(&values, l.1.len(), b, point.position).unwrap();
                    at.iter().copied().collect()
                };
                let by = differences(design, &p, i, |q| (layout(design, q), q.to_vec()), at);
                for (e, d) in rows.column(i).iter().zip(by) {
                    worst.add("skeletons", &design.free[i].path, e * width, d);
                }
            }
        }
    }
    worst.check(&design.name);
}

/// World places of traces and joints, loads of the drives and energies of all states by the chosen variables.
pub fn check_states(design: &Design, seed: u64, variables: impl Iterator<Item = usize>) {
    let p = shaken(design, seed);
    let laid = layout(design, &p);
    let model = Model::new(design, &laid, &p, EDGES, true).unwrap();
    let states = sweep(&model).unwrap().states;
    let mut workspace = SensitivityWorkspace::new(&model);
    let mut worst = Worst::new();
    let first_drive = model.rows() - laid.drives.len();
    for i in variables {
        let width = design.free[i].upper - design.free[i].lower;
        let numbers = |(model, cycle): &(Model, Cycle)| -> Vec<f64> {
            let mut out = Vec::new();
            for e in &cycle.states {
                for t in &model.layout.traces {
                    extend(&mut out, &e.state.poses[t.body].point(&t.rest));
                }
                out.extend(&e.state.lambda[first_drive..]);
            }
            out
        };
        let by = differences(design, &p, i, |q| cycle(design, q), numbers);
        let mut by = by.iter();
        let change = laid.changes.iter().flatten().find(|c| c.parameter == i);
        for (s, e) in states.iter().enumerate() {
            let target: Vec<f64> = laid.drives.iter().map(|d| d.values[s] - d.rest).collect();
            let exact = workspace.at(&model, e, &target).unwrap();
            for (t, trace) in laid.traces.iter().enumerate() {
                let pose = &e.state.poses[trace.body];
                let mut rate = Vector3::zeros();
                if let Some(first) = laid.bodies[trace.body].first_dof {
                    let at = |k: usize| exact.links.fixed_view::<3, 1>(first + k, i).into_owned();
                    rate += at(0) + at(3).cross(&pose.arm(&trace.rest));
                }
                if let Some(change) = change {
                    rate += pose.direction(&change.traces[t].rest);
                }
                for c in 0..3 {
                    worst.add("traces", &design.free[i].path, rate[c] * width, *by.next().unwrap());
                }
            }
            for row in first_drive..model.rows() {
                worst.add(
                    "loads of drives",
                    &design.free[i].path,
                    exact.lambda[(row, i)] * width,
                    *by.next().unwrap(),
                );
            }
        }
    }
    worst.check(&design.name);
}

/// Gradient of the whole objective by the chosen variables; every term must act.
pub fn check_objective(design: &Design, seed: u64, variables: impl Iterator<Item = usize>) {
    let p = shaken(design, seed);
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let laid = layout(design, &start);
    let problem = Problem::new(design, &laid, EDGES);
    let x = problem.to_unit(&p);
    let trial = problem.simulate(&x).unwrap();
    let named = problem.term_names();
    let terms = trial.terms.iter().zip(&named).filter(|(_, n)| *n != "shape");
    assert!(terms.clone().all(|(t, _)| *t > 0.0), "every term must act: {:?} {:?}", trial.terms, named);
    let gradient = problem.differentiate(&trial).unwrap().gradient();
    let scale = gradient.amax();
    for i in variables {
        let by =
            differences(design, &p, i, |q| problem.simulate(&problem.to_unit(q)).unwrap().cost, |c| vec![*c])
                [0];
        let off = (gradient[i] - by).abs() / scale;
        println!("{}: {} {} {} {off:.1e}", design.name, design.free[i].path, gradient[i], by);
        assert!(
            off < AGREES,
            "{}: {} exact {}, difference {by}",
            design.name,
            design.free[i].path,
            gradient[i]
        );
    }
}
