//! The optimisation problem in the unit box: x = (p − lower) / (upper − lower).

use super::box_qp::Hinge;
use super::guards;
use super::normal::Normal;
use super::objectives::{self, Level, StateView, StatesSensitivity, Term};
use crate::equilibrium::{
    Cycle, Layout, Model, PointForce, PointForceChange, SensitivityWorkspace, Solver, State, sweep_both_ways,
};
use crate::geometry::{SkeletonCapsule, parts_input, plan_bodies, skeleton_capsules};
use crate::ir::Design;
use crate::kinematics::solve_motion;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A design, its layout and its objective.
pub struct Problem<'d> {
    design: &'d Design,
    /// Of the start; the only one where no free variable moves the geometry.
    layout: &'d Layout,
    /// Whether one does.
    moving: bool,
    objectives: Vec<Term>,
    /// Per load case one force a state, in that layout.
    cases: Vec<Vec<PointForce>>,
    /// The same design under its load cases, each with its name: their terms are added.
    under: Vec<(String, Problem<'d>)>,
    /// Largest sample of each soft maximum at the first point simulated: what its sharpness refers to.
    references: OnceLock<Vec<f64>>,
    edges: usize,
    /// Whether a term sees the links' shapes.
    needs_links: bool,
    simulations: AtomicUsize,
}

/// A design point that could be simulated.
pub struct Trial<'d> {
    /// Position in the unit box.
    pub x: Vec<f64>,
    /// The model there.
    pub model: Model<'d>,
    /// Its equilibria.
    pub cycle: Cycle,
    /// Weighted sum of all terms.
    pub cost: f64,
    /// Contribution of each term, in the order of [`Problem::term_names`].
    pub terms: Vec<f64>,
    /// Of each term that is a soft maximum.
    levels: Vec<Option<Level>>,
    /// Per load case one force a state.
    cases: Vec<Vec<PointForce>>,
    /// The links' shapes; empty where no term sees them.
    capsules: Vec<SkeletonCapsule>,
    /// Per counted state its equilibria under the load cases; empty without load cases.
    loaded: Vec<Vec<State>>,
    /// The same point under the design's load cases.
    under: Vec<Trial<'d>>,
}

impl Trial<'_> {
    /// True largest von Mises stress over the cycle, also under load cases that have terms, MPa.
    pub fn max_stress_mpa(&self) -> f64 {
        let own = self.cycle.states.iter().map(|s| s.max_stress_mpa(&self.model));
        own.chain(self.under.iter().map(Trial::max_stress_mpa)).fold(0.0, f64::max)
    }

    /// Largest distance of any trace from its target, mm: from the place of the same time, or where it is tracked
    /// by form only, from the nearest one. None without a trace or a target.
    pub fn max_error_mm(&self) -> Option<f64> {
        let layout = &self.model.layout;
        let mut largest = None;
        for trace in layout.traces.iter().filter(|t| t.has_target) {
            for (state, target) in self.cycle.states.iter().zip(&trace.target) {
                let z = state.state.poses[trace.body].point(&trace.rest);
                let target = if trace.has_no_phase { trace.nearest(&z).place } else { *target };
                largest = Some((z - target).norm().max(largest.unwrap_or(0.0)));
            }
        }
        largest
    }
}

/// Derivatives at a design point, by x.
pub struct Derivatives {
    /// Of the objective's terms.
    pub normal: Normal,
    /// Of the limits of sound rods, kept or broken.
    pub hinges: Vec<Hinge>,
}

impl Derivatives {
    /// Gradient of the whole cost.
    pub fn gradient(&self) -> nalgebra::DVector<f64> {
        let mut gradient = self.normal.gradient.clone();
        for h in self.hinges.iter().filter(|h| h.value > 0.0) {
            gradient.axpy(h.weight * h.value, &h.row, 1.0);
        }
        gradient
    }
}

impl<'d> Problem<'d> {
    /// Rods get `edges` edges each.
    pub fn new(design: &'d Design, layout: &'d Layout, edges: usize) -> Self {
        let (objectives, cases) = objectives::build(design, layout);
        Self {
            design,
            layout,
            moving: !design.geometry_variables().is_empty(),
            objectives,
            cases,
            under: Vec::new(),
            references: OnceLock::new(),
            edges,
            needs_links: objectives::needs_links(design),
            simulations: AtomicUsize::new(0),
        }
    }

    /// With the terms of load cases: by name the problem of the design under each ([`Design::under`]).
    pub fn with_cases(mut self, under: Vec<(String, Problem<'d>)>) -> Self {
        self.under = under;
        self
    }

    /// Number of design parameters.
    pub fn parameters(&self) -> usize {
        self.design.free.len()
    }

    /// Names of the terms, the guards last.
    pub fn term_names(&self) -> Vec<String> {
        let own = self.objectives.iter().map(|o| o.name().to_string());
        let cases = self.under.iter().flat_map(|(case, problem)| {
            problem.objectives.iter().map(move |o| format!("{case}: {}", o.name()))
        });
        own.chain(cases).chain(["shape".to_string()]).collect()
    }

    /// What an rms error of this part of its scale adds to the cost, of the track that counts most; zero where none has a scale.
    pub fn cost_of_error(&self, part: f64) -> f64 {
        let weight = objectives::largest_weight_of_scaled(self.design);
        let own = 0.5 * objectives::STEPS_OF_WEIGHTS * part * part * weight;
        self.under.iter().map(|(_, problem)| problem.cost_of_error(part)).fold(own, f64::max)
    }

    /// Cycles simulated so far.
    pub fn simulations(&self) -> usize {
        self.simulations.load(Ordering::Relaxed)
    }

    /// The start of every free variable.
    pub fn start(&self) -> Vec<f64> {
        let p: Vec<f64> = self.design.free.iter().map(|f| f.start).collect();
        self.to_unit(&p)
    }

    /// Unit box to design parameters.
    pub fn to_parameters(&self, x: &[f64]) -> Vec<f64> {
        // The ends are met exactly, whatever the rounding.
        x.iter()
            .zip(&self.design.free)
            .map(|(x, f)| (f.lower + x * (f.upper - f.lower)).clamp(f.lower, f.upper))
            .collect()
    }

    /// Design parameters to unit box.
    pub fn to_unit(&self, p: &[f64]) -> Vec<f64> {
        p.iter()
            .zip(&self.design.free)
            .map(|(p, f)| ((p - f.lower) / (f.upper - f.lower)).clamp(0.0, 1.0))
            .collect()
    }

    /// Simulates the cycle at `x`, once more for every load case; none where the mechanism cannot be built or followed.
    pub fn simulate(&self, x: &[f64]) -> Option<Trial<'d>> {
        let mut trial = self.simulate_own(x)?;
        for (_, problem) in &self.under {
            let under = problem.simulate_own(x)?;
            trial.terms.extend(&under.terms);
            trial.under.push(under);
        }
        trial.terms.push(guards::cost(&trial.model));
        trial.cost = trial.terms.iter().sum();
        trial.cost.is_finite().then_some(trial)
    }

    /// The same with its own loads and terms only, and without what keeps rods sound.
    fn simulate_own(&self, x: &[f64]) -> Option<Trial<'d>> {
        self.simulations.fetch_add(1, Ordering::Relaxed);
        let p = self.to_parameters(x);
        let layout = self.layout_at(&p)?;
        let cases = match &layout {
            Cow::Borrowed(_) => self.cases.clone(),
            Cow::Owned(layout) => objectives::build(self.design, layout).1,
        };
        let model = Model::new(self.design, layout, &p, self.edges, true).ok()?;
        // The two sides of a cycle are not equally long: meanwhile links are planned.
        let states = || {
            let cycle = sweep_both_ways(&model).ok()?;
            let loaded = self.load(&model, &cycle, &cases)?;
            Some((cycle, loaded))
        };
        let (capsules, states) = rayon::join(|| self.links(&model), states);
        let (capsules, (cycle, loaded)) = (capsules?, states?);
        let views: Vec<StateView> = (0..self.layout.counted_states())
            .map(|s| self.view(&model, &cycle, &loaded, &capsules, s))
            .collect();
        let references = self.references.get_or_init(|| {
            let largest = |o: &Term| match o {
                Term::Sum(_) => 0.0,
                Term::Peak(o) => Level::reference(o.as_ref(), &views),
            };
            self.objectives.iter().map(largest).collect()
        });
        let mut terms = Vec::with_capacity(self.objectives.len() + 1);
        let mut levels = Vec::with_capacity(self.objectives.len());
        for (o, reference) in self.objectives.iter().zip(references) {
            match o {
                Term::Sum(o) => {
                    // Summed in order, whatever the number of threads.
                    let costs: Vec<f64> = views.par_iter().map(|view| o.cost(view)).collect();
                    terms.push(costs.iter().sum());
                    levels.push(None);
                }
                Term::Peak(o) => {
                    let level = Level::new(o.as_ref(), &views, *reference);
                    terms.push(o.weight() * level.value);
                    levels.push(Some(level));
                }
            }
        }
        drop(views);
        let (x, cost, under) = (x.to_vec(), 0.0, Vec::new());
        Some(Trial { x, model, cycle, cost, terms, levels, cases, capsules, loaded, under })
    }

    /// Cost of the limits of sound rods at `x`, without simulating; none where the mechanism cannot be built.
    pub fn shape_cost(&self, x: &[f64]) -> Option<f64> {
        let p = self.to_parameters(x);
        let model = Model::new(self.design, self.layout_at(&p)?, &p, self.edges, true).ok()?;
        Some(guards::cost(&model))
    }

    /// The layout at parameters `p`: followed anew from the drawing where they move the geometry, always on the way of
    /// assembly that is drawn; none where that cannot be assembled.
    fn layout_at(&self, p: &[f64]) -> Option<Cow<'d, Layout>> {
        if !self.moving {
            return Some(Cow::Borrowed(self.layout));
        }
        let motion = solve_motion(self.design, p).ok()?;
        let mut layout = Layout::new(self.design, &motion, p);
        layout.rod_model = self.layout.rod_model;
        Some(Cow::Owned(layout))
    }

    /// The links' shapes, where a term sees them; none where a link has none.
    fn links(&self, model: &Model<'d>) -> Option<Vec<SkeletonCapsule>> {
        if !self.needs_links {
            return Some(Vec::new());
        }
        let plans = plan_bodies(&parts_input(self.design, &model.layout, model).unfilleted()).ok()?;
        Some(skeleton_capsules(self.design, &plans, model))
    }

    /// Equilibria under the load cases; none where one cannot be found.
    fn load(&self, model: &Model<'d>, cycle: &Cycle, cases: &[Vec<PointForce>]) -> Option<Vec<Vec<State>>> {
        if cases.is_empty() {
            return Some(Vec::new());
        }
        (0..self.layout.counted_states())
            .into_par_iter()
            .map_init(
                || Solver::new(model),
                |solver, s| {
                    let target = target(model, s);
                    let loads: Option<Vec<_>> = cases.iter().map(|case| case.get(s..=s)).collect();
                    solver.load_each(model, &cycle.states[s], &target, &loads?).ok()
                },
            )
            .collect()
    }

    fn view<'a>(
        &self,
        model: &'a Model<'d>,
        cycle: &'a Cycle,
        loaded: &'a [Vec<State>],
        capsules: &'a [SkeletonCapsule],
        state: usize,
    ) -> StateView<'a> {
        StateView {
            model,
            equilibrium: &cycle.states[state],
            loaded: loaded.get(state).map_or(&[], |l| l),
            state,
            share: objectives::STEPS_OF_WEIGHTS / self.layout.counted_states() as f64,
            capsules,
        }
    }

    /// Cost, gradient and Gauss–Newton matrix by x at a simulated point; none if an equilibrium
    /// cannot be confirmed. The states are independent; their sums are formed in order, so that the
    /// result does not depend on the number of threads.
    pub fn differentiate(&self, trial: &Trial<'d>) -> Option<Derivatives> {
        let mut normal = self.differentiate_own(trial)?;
        for ((_, problem), under) in self.under.iter().zip(&trial.under) {
            normal.merge(&problem.differentiate_own(under)?);
        }
        let mut hinges = guards::hinges(&trial.model);
        normal.complete();
        for (i, f) in self.design.free.iter().enumerate() {
            let width = f.upper - f.lower;
            normal.gradient[i] *= width;
            normal.gauss_newton.row_mut(i).scale_mut(width);
            normal.gauss_newton.column_mut(i).scale_mut(width);
            hinges.iter_mut().for_each(|h| h.row[i] *= width);
        }
        Some(Derivatives { normal, hinges })
    }

    /// Of its own loads and terms only, by p; the matrix's lower triangle.
    fn differentiate_own(&self, trial: &Trial<'d>) -> Option<Normal> {
        let n = self.parameters();
        let changes = objectives::load_changes(self.design, &trial.model.layout);
        let parts: Vec<Option<Vec<Normal>>> = (0..self.layout.counted_states())
            .into_par_iter()
            .map_init(
                || SensitivityWorkspace::new(&trial.model),
                |workspace, s| {
                    let target = target(&trial.model, s);
                    let view = self.view(&trial.model, &trial.cycle, &trial.loaded, &trial.capsules, s);
                    let loaded = trial
                        .cases
                        .iter()
                        .zip(view.loaded)
                        .enumerate()
                        .map(|(k, (case, e))| {
                            let of_state = |c: &Vec<PointForceChange>| c.get(s..=s).map(<[_]>::to_vec);
                            let moved: Vec<_> = changes.get(k)?.iter().filter_map(of_state).collect();
                            workspace.of_links(&trial.model, e, &target, case.get(s..=s)?, &moved).ok()
                        })
                        .collect::<Option<Vec<_>>>()?;
                    let free = workspace.at(&trial.model, view.equilibrium, &target).ok()?;
                    Some(self.state_parts(trial, &view, &StatesSensitivity { free, loaded, workspace }))
                },
            )
            .collect();
        let parts = parts.into_iter().collect::<Option<Vec<_>>>()?;
        // All sums together first, then each soft maximum.
        let kinds = parts.first().map_or(0, Vec::len);
        let of_kind = |k: usize| parts.iter().filter_map(|p| p.get(k)).collect::<Vec<_>>();
        let totals: Vec<Normal> = (0..kinds).map(|k| Normal::sum(n, &of_kind(k))).collect();
        let mut totals = totals.into_iter();
        let mut sum = totals.next()?;
        let peaks = self.objectives.iter().zip(&trial.levels).filter_map(|(o, level)| match (o, level) {
            (Term::Peak(o), Some(level)) => Some((o.weight(), level)),
            _ => None,
        });
        for ((weight, level), mut total) in peaks.zip(totals) {
            level.complete(weight, &mut total);
            sum.merge(&total);
        }
        Some(sum)
    }

    /// One state's contributions: that of all sums, then of each soft maximum.
    fn state_parts(&self, trial: &Trial<'d>, view: &StateView, at: &StatesSensitivity) -> Vec<Normal> {
        let n = self.parameters();
        let mut parts = vec![Normal::new(n)];
        for (o, level) in self.objectives.iter().zip(&trial.levels) {
            match (o, level) {
                (Term::Sum(o), _) => o.accumulate(view, at, &mut parts[0]),
                (Term::Peak(o), Some(level)) => {
                    let mut part = Normal::new(n);
                    o.accumulate(view, at, level, &mut part);
                    parts.push(part);
                }
                (Term::Peak(_), None) => {}
            }
        }
        parts
    }
}

/// Drive values of a state relative to rest, rad or mm, and the sizes of its loads.
fn target(model: &Model, state: usize) -> Vec<f64> {
    model.layout.controls(state)
}
