//! Collisions (Megaro et al. 2017, section 4.4, eq. 7): what it costs links and flexures to be nearer to each other
//! than a gap. A double integral of the penalty of the axes' distance over both lengths, in m², so neither the
//! number of edges nor of capsules changes it: E = Σ_t share · Σ_pairs ∬ P(|x(s) − y(s')|) ds ds'.
//!
//! | pair | counts |
//! | --- | --- |
//! | link, link | but for two eyes of one conventional joint: there they are held together |
//! | flexure, link | unless the flexure is attached to it: the link is carved instead |
//! | flexure, flexure | of different joints; of one joint only where they overlap, away from their ends |

mod extent;
mod kernel;
mod placed;
mod strip;

use super::{Objective, StateView, StatesSensitivity};
use crate::geometry::link::Role;
use crate::ir::{Design, Section};
use crate::optimize::Normal;
use nalgebra::{DMatrix, DVector};
use placed::Placed;
use std::sync::OnceLock;
use strip::{StripGradient, fineness, link_jacobian, link_strip, rod_jacobian, rod_strips};

/// 1 mm² in m².
const SQUARE_METRE: f64 = 1e-6;
/// Part of a flexure at either end in which flexures of the same joint may meet.
const ROOT: f64 = 0.2;
/// Most capsules side by side that stand for a flexure.
const MOST_COPIES: f64 = 12.0;
/// f f″/f′² of a cubic: what makes a positive curvature of value and slope.
const CURVATURE: f64 = 2.0 / 3.0;

/// See the module.
pub struct Collision {
    gap_mm: f64,
    weight: f64,
    /// Per rod how many capsules side by side stand for it: ⌈b/a⌉ at the start, the same throughout a run.
    copies: Vec<usize>,
    /// Copies and panels of the links at the first point seen: while their nets stay, so does how they are summed, or
    /// the value would jump with their lengths.
    fineness: OnceLock<Vec<(usize, usize)>>,
    /// Per rod its joint.
    joints: Vec<usize>,
}

/// Where a strip comes from.
#[derive(Clone, Copy)]
enum Source {
    /// Rod, edge.
    Rod(usize, usize),
    /// Index of the capsule.
    Link(usize),
}

impl Collision {
    /// Everything that must keep `gap_mm` between its surfaces.
    pub fn new(design: &Design, gap_mm: f64, weight: f64) -> Self {
        let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
        let values = design.exprs.values(&start);
        let copies = |section: &Section| {
            let [a, b] = section.half_widths().map(|id| values[id.0 as usize]);
            (b / a).ceil().clamp(1.0, MOST_COPIES) as usize
        };
        Self {
            gap_mm,
            weight,
            copies: design.rods.iter().map(|r| copies(&r.section)).collect(),
            fineness: OnceLock::new(),
            joints: design.rods.iter().map(|r| r.joint).collect(),
        }
    }

    /// Calls `f` for every two strips nearer than the gap, with penalty (mm²) and its derivatives.
    fn for_each_pair(&self, view: &StateView, mut f: impl FnMut([Source; 2], f64, &[StripGradient; 2])) {
        let (model, poses) = (view.model, &view.equilibrium.state.poses);
        let first = self.fineness.get_or_init(|| view.capsules.iter().map(fineness).collect());
        let links = view.capsules.iter().enumerate().map(|(i, c)| {
            let same = first.get(i).filter(|_| first.len() == view.capsules.len());
            link_strip(c, &poses[c.body], same.copied().unwrap_or_else(|| fineness(c)))
        });
        let links = Placed::new(links.collect(), |i, j| view.capsules[i].body == view.capsules[j].body);
        let rods: Vec<Placed> = model
            .rods
            .iter()
            .zip(&view.equilibrium.state.rods)
            .zip(&self.copies)
            .map(|((rod, state), copies)| Placed::new(rod_strips(state, &rod.rod, *copies), |_, _| true))
            .collect();
        let body = |i: usize| view.capsules[i].body;
        for i in 0..view.capsules.len() {
            links.near(links.one(i), i + 1, self.gap_mm, |j, value, by| {
                f([Source::Link(i), Source::Link(j)], value, by);
            }, |j| {
                let held = matches!((view.capsules[i].role, view.capsules[j].role), (Role::Eye(p), Role::Eye(q)) if p == q);
                body(i) != body(j) && !held
            });
        }
        for (r, edges) in rods.iter().enumerate() {
            let own = model.rods[r].bodies;
            for e in 0..edges.len() {
                links.near(
                    edges.one(e),
                    0,
                    self.gap_mm,
                    |j, value, by| {
                        f([Source::Rod(r, e), Source::Link(j)], value, by);
                    },
                    |j| !own.contains(&body(j)),
                );
            }
            for (s, others) in rods.iter().enumerate().skip(r + 1) {
                let same = self.joints[r] == self.joints[s];
                let gap = if same { 0.0 } else { self.gap_mm };
                if edges.far(others, gap) {
                    continue;
                }
                for e in (0..edges.len()).filter(|e| !same || inner(*e, edges.len())) {
                    others.near(
                        edges.one(e),
                        0,
                        gap,
                        |k, value, by| {
                            f([Source::Rod(r, e), Source::Rod(s, k)], value, by);
                        },
                        |k| !same || inner(k, others.len()),
                    );
                }
            }
        }
    }

    fn factor(&self, view: &StateView) -> f64 {
        self.weight * view.share * SQUARE_METRE
    }
}

/// Whether an edge lies away from both ends.
fn inner(edge: usize, edges: usize) -> bool {
    let at = (edge as f64 + 0.5) / edges as f64;
    at > ROOT && at < 1.0 - ROOT
}

impl Objective for Collision {
    fn name(&self) -> &str {
        "collision"
    }

    fn cost(&self, view: &StateView) -> f64 {
        let mut cost = 0.0;
        self.for_each_pair(view, |_, value, _| cost += value);
        self.factor(view) * cost
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal) {
        let factor = self.factor(view);
        let poses = &view.equilibrium.state.poses;
        let mut links: Vec<Option<DMatrix<f64>>> = vec![None; view.capsules.len()];
        let mut edges: Vec<Vec<Option<DMatrix<f64>>>> =
            view.model.rods.iter().map(|r| vec![None; r.rod.edges()]).collect();
        self.for_each_pair(view, |pair, value, by| {
            out.cost += factor * value;
            let mut row = DVector::zeros(out.gradient.len());
            for (source, by) in pair.into_iter().zip(by) {
                match source {
                    Source::Link(i) => {
                        let capsule = &view.capsules[i];
                        let jacobian = links[i].get_or_insert_with(|| {
                            link_jacobian(view.model, &at.free, capsule, &poses[capsule.body])
                        });
                        by.chain(jacobian, &mut row);
                    }
                    Source::Rod(r, e) => {
                        if edges[r][e].is_none() {
                            edges[r][e] = rod_jacobian(view.model, at, r, e);
                        }
                        if let Some(jacobian) = &edges[r][e] {
                            by.chain(jacobian, &mut row);
                        }
                    }
                }
            }
            out.add_model(factor, factor * CURVATURE / value, row.as_slice());
        });
    }
}
