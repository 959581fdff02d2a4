//! The optimisation problem in the unit box: x = (p − lower) / (upper − lower).

use super::box_qp::Hinge;
use super::guards;
use super::normal::Normal;
use super::objectives::{self, Objective, StateView};
use crate::equilibrium::{Cycle, Layout, Model, SensitivityWorkspace, sweep};
use crate::ir::Design;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A design, its layout and its objective.
pub struct Problem<'d> {
    design: &'d Design,
    layout: &'d Layout,
    objectives: Vec<Box<dyn Objective>>,
    edges: usize,
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
}

impl Trial<'_> {
    /// True largest von Mises stress over the cycle, MPa.
    pub fn max_stress_mpa(&self) -> f64 {
        self.cycle.states.iter().map(|s| s.max_stress_mpa(&self.model)).fold(0.0, f64::max)
    }

    /// Largest distance of any trace from its target, mm; none without a trace.
    pub fn max_error_mm(&self) -> Option<f64> {
        let layout = self.model.layout;
        let mut largest = None;
        for trace in &layout.traces {
            for (state, target) in self.cycle.states.iter().zip(&trace.target) {
                let z = state.state.poses[trace.body].point(&trace.rest);
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
        Self {
            design,
            layout,
            objectives: objectives::build(design),
            edges,
            simulations: AtomicUsize::new(0),
        }
    }

    /// Number of design parameters.
    pub fn parameters(&self) -> usize {
        self.design.free.len()
    }

    /// Names of the terms, the guards last.
    pub fn term_names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.objectives.iter().map(|o| o.name().to_string()).collect();
        names.push("shape".to_string());
        names
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

    /// Simulates the cycle at `x`; none where the mechanism cannot be built or followed.
    pub fn simulate(&self, x: &[f64]) -> Option<Trial<'d>> {
        self.simulations.fetch_add(1, Ordering::Relaxed);
        let p = self.to_parameters(x);
        let model = Model::new(self.design, self.layout, &p, self.edges, true).ok()?;
        let cycle = sweep(&model).ok()?;
        let mut terms: Vec<f64> = self
            .objectives
            .iter()
            .map(|o| (0..self.layout.counted_states()).map(|s| o.cost(&self.view(&model, &cycle, s))).sum())
            .collect();
        terms.push(guards::cost(&model));
        let cost: f64 = terms.iter().sum();
        cost.is_finite().then(|| Trial { x: x.to_vec(), model, cycle, cost, terms })
    }

    fn view<'a>(&self, model: &'a Model<'d>, cycle: &'a Cycle, state: usize) -> StateView<'a> {
        StateView {
            model,
            equilibrium: &cycle.states[state],
            state,
            share: objectives::STEPS_OF_WEIGHTS / self.layout.counted_states() as f64,
        }
    }

    /// Cost, gradient and Gauss–Newton matrix by x at a simulated point; none if an equilibrium
    /// cannot be confirmed. The states are independent; their sums are formed in order, so that the
    /// result does not depend on the number of threads.
    pub fn differentiate(&self, trial: &Trial<'d>) -> Option<Derivatives> {
        let n = self.parameters();
        let parts: Vec<Option<Normal>> = (0..self.layout.counted_states())
            .into_par_iter()
            .map_init(
                || SensitivityWorkspace::new(&trial.model),
                |workspace, s| {
                    let target: Vec<f64> = self.layout.drives.iter().map(|d| d.values[s] - d.rest).collect();
                    let view = self.view(&trial.model, &trial.cycle, s);
                    let sensitivity = workspace.at(&trial.model, view.equilibrium, &target).ok()?;
                    let mut part = Normal::new(n);
                    for o in &self.objectives {
                        o.accumulate(&view, &sensitivity, &mut part);
                    }
                    Some(part)
                },
            )
            .collect();
        let mut sum = Normal::new(n);
        for part in parts {
            sum.merge(&part?);
        }
        let mut hinges = guards::hinges(&trial.model);
        sum.complete();
        for (i, f) in self.design.free.iter().enumerate() {
            let width = f.upper - f.lower;
            sum.gradient[i] *= width;
            sum.gauss_newton.row_mut(i).scale_mut(width);
            sum.gauss_newton.column_mut(i).scale_mut(width);
            hinges.iter_mut().for_each(|h| h.row[i] *= width);
        }
        Some(Derivatives { normal: sum, hinges })
    }
}
