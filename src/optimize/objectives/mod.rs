//! The terms of the objective, one a file. A new term is a file here and a line in [`build`].
//!
//! A term is a sum over the states ([`Objective`]) or a soft maximum over all of them ([`Sampled`]).

mod aim;
mod collision;
mod paper;
mod soft_maximum;
mod stress;
mod sway;
mod torque;
mod track;

pub use soft_maximum::{Level, Sampled, SoftForm};

use crate::equilibrium::{
    Equilibrium, Layout, Model, PointForce, PointForceChange, Sensitivity, SensitivityWorkspace, State,
};
use crate::geometry::SkeletonCapsule;
use crate::ir::{Design, ObjectiveKind};
use crate::math::skew;
use crate::optimize::Normal;
use nalgebra::Matrix3xX;

/// Sums over the cycle are means times this, so that the number of steps does not change the balance
/// of the terms; the paper's weights belong to 60 steps.
pub const STEPS_OF_WEIGHTS: f64 = 60.0;

/// One state of the cycle as a term sees it.
pub struct StateView<'a> {
    /// The model at the present parameters.
    pub model: &'a Model<'a>,
    /// The equilibrium.
    pub equilibrium: &'a Equilibrium,
    /// The states in equilibrium under the load cases that [`build`] asks for.
    pub loaded: &'a [State],
    /// Index of the state.
    pub state: usize,
    /// Weight of this state in sums over the cycle: 60 / number of counted states.
    pub share: f64,
    /// The links as capsules in the rest pose; empty unless a term asks for them ([`needs_links`]).
    pub capsules: &'a [SkeletonCapsule],
}

/// Derivatives of a state's equilibria.
pub struct StatesSensitivity<'a> {
    /// Of the equilibrium without loads.
    pub free: Sensitivity,
    /// Of those under each load case, without what rods do inside.
    pub loaded: Vec<Sensitivity>,
    /// What `free` was computed with last: strains are only worked out for rods that need them.
    pub workspace: &'a SensitivityWorkspace,
}

/// A term of the objective, a sum over states.
pub trait Objective: Send + Sync {
    /// As shown to the user, e.g. `track(tip)`.
    fn name(&self) -> &str;
    /// Contribution of one state.
    fn cost(&self, view: &StateView) -> f64;
    /// Contribution of one state with its exact derivatives.
    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal);
}

/// A term by how it gathers the states.
pub enum Term {
    /// A sum over states.
    Sum(Box<dyn Objective>),
    /// A soft maximum over all states.
    Peak(Box<dyn Sampled>),
}

impl Term {
    /// As shown to the user.
    pub fn name(&self) -> &str {
        match self {
            Self::Sum(o) => o.name(),
            Self::Peak(o) => o.name(),
        }
    }
}

/// The design's terms, and the load cases they need: per case one force a state.
pub fn build(design: &Design, layout: &Layout) -> (Vec<Term>, Vec<Vec<PointForce>>) {
    let mut cases = Vec::new();
    let terms = design
        .objectives
        .iter()
        .map(|o| match &o.kind {
            ObjectiveKind::Track { trace, scale_mm } => {
                let name = &design.traces[*trace].name;
                Term::Sum(Box::new(track::Track::new(name, *trace, *scale_mm, o.weight)))
            }
            ObjectiveKind::Sway { trace, force_n, scale_mm } => {
                let first = cases.len();
                cases.extend(sway::load_cases(design, layout, *trace, *force_n));
                let name = &design.traces[*trace].name;
                let term = sway::Sway::new(name, *trace, first..cases.len(), *scale_mm, o.weight);
                Term::Sum(Box::new(term))
            }
            ObjectiveKind::StressBelow { bound_mpa, scale_mpa } => {
                Term::Sum(Box::new(stress::StressBelow::new(*bound_mpa, *scale_mpa, o.weight)))
            }
            ObjectiveKind::Stress { scale_mpa } => {
                Term::Peak(Box::new(stress::StressPeak::new(*scale_mpa, o.weight)))
            }
            ObjectiveKind::Collision { gap_mm } => {
                Term::Sum(Box::new(collision::Collision::new(design, *gap_mm, o.weight)))
            }
            ObjectiveKind::Torque { drive, reference_n_mm } => {
                let name = format!("torque({})", design.drives[*drive].name);
                Term::Peak(Box::new(torque::Torque::new(name, *drive, *reference_n_mm, o.weight)))
            }
            ObjectiveKind::TrackAs { trace, scale_mm, closest, emphasis } => {
                let name = &design.traces[*trace].name;
                let emphasis = track::Emphasis::new(emphasis.as_ref(), design.cycle.steps);
                let term = track::Track::with(name, *trace, *scale_mm, o.weight, *closest, emphasis);
                Term::Sum(Box::new(term))
            }
            ObjectiveKind::Aim { direction, scale_rad, emphasis } => {
                let name = &design.aims.directions[*direction].name;
                let emphasis = track::Emphasis::new(emphasis.as_ref(), design.cycle.steps);
                Term::Sum(Box::new(aim::Aim::new(name, *direction, *scale_rad, o.weight, emphasis)))
            }
            ObjectiveKind::SwayAlong { trace, force_n, scale_mm, along } => {
                let first = cases.len();
                match along {
                    Some(along) => cases.push(sway::load_along(layout, *trace, *force_n, *along)),
                    None => {
                        cases.extend(sway::load_cases(design, layout, *trace, *force_n).into_iter().take(1))
                    }
                }
                let name = &design.traces[*trace].name;
                let term = sway::Sway::new(name, *trace, first..cases.len(), *scale_mm, o.weight);
                Term::Sum(Box::new(term))
            }
            ObjectiveKind::PaperTorque { drive, reference_n_mm } => {
                let name = &design.drives[*drive].name;
                Term::Peak(Box::new(paper::PaperTorque::new(name, *drive, *reference_n_mm, o.weight)))
            }
            ObjectiveKind::PaperStress { scale_mpa } => {
                Term::Peak(Box::new(paper::PaperStress::new(*scale_mpa, o.weight)))
            }
            ObjectiveKind::Force { drive, reference_n } => {
                let name = format!("force({})", design.drives[*drive].name);
                Term::Peak(Box::new(torque::Torque::new(name, *drive, *reference_n, o.weight)))
            }
        })
        .collect();
    (terms, cases)
}

/// How the load cases of [`build`] change with each of the layout's changes: per case, change and state.
pub fn load_changes(design: &Design, layout: &Layout) -> Vec<Vec<Vec<PointForceChange>>> {
    let mut changes = Vec::new();
    for o in &design.objectives {
        match &o.kind {
            ObjectiveKind::Sway { trace, force_n, .. } => {
                changes.extend(sway::load_case_changes(design, layout, *trace, *force_n));
            }
            ObjectiveKind::SwayAlong { trace, force_n, along: None, .. } => {
                let both = sway::load_case_changes(design, layout, *trace, *force_n);
                changes.extend(both.into_iter().take(1));
            }
            ObjectiveKind::SwayAlong { trace, along: Some(_), .. } => {
                changes.push(sway::load_along_change(layout, *trace));
            }
            _ => {}
        }
    }
    changes
}

/// Whether a term sees where links and flexures are, not only what moves.
pub fn needs_links(design: &Design) -> bool {
    design.objectives.iter().any(|o| matches!(o.kind, ObjectiveKind::Collision { .. }))
}

/// Largest weight of what is to be followed with a stated scale; zero where there is none.
pub fn largest_weight_of_scaled(design: &Design) -> f64 {
    let weight = |o: &crate::ir::Objective| match o.kind {
        ObjectiveKind::Track { scale_mm: Some(_), .. }
        | ObjectiveKind::TrackAs { scale_mm: Some(_), .. }
        | ObjectiveKind::Aim { scale_rad: Some(_), .. } => o.weight,
        _ => 0.0,
    };
    design.objectives.iter().map(weight).fold(0.0, f64::max)
}

/// Derivatives of a trace's place by the n design parameters, 3 × n: as its body moves, and as it moves within.
fn trace_rows(model: &Model, state: &State, sensitivity: &Sensitivity, index: usize) -> Matrix3xX<f64> {
    let trace = &model.layout.traces[index];
    let pose = &state.poses[trace.body];
    let mut rows = match model.layout.bodies[trace.body].first_dof {
        // δz = δu + δφ × r
        Some(first) => {
            sensitivity.links.fixed_rows::<3>(first)
                - skew(&pose.arm(&trace.rest)) * sensitivity.links.fixed_rows::<3>(first + 3)
        }
        None => Matrix3xX::zeros(model.p.len()),
    };
    for change in model.layout.changes.iter().flatten() {
        let mut column = rows.column_mut(change.parameter);
        column += pose.direction(&change.traces[index].rest);
    }
    rows
}
