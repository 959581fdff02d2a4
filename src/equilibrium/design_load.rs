//! The design's own loads in rest world coordinates. They belong to the potential of every state, as the drives belong
//! to its constraints: a state is told by its controls, the drive values and then the sizes of the loads.

use super::layout::Layout;
use super::load::{PointForce, PointForceChange};
use super::model::{Model, State};
use super::newton::Solver;
use super::saddle::{scatter, scatter_matrix};
use super::weight;
use crate::ir::{Design, LoadKind};
use crate::kinematics::{HingeAngle, Motion};
use crate::math::Pose;
use crate::math::elimination::Elimination;
use crate::math::fronts::Blocks;
use nalgebra::{DVector, SMatrix, SVector, Vector3};

/// A load with its size at every state.
#[derive(Clone, Debug)]
pub struct LayoutLoad {
    /// What acts.
    pub kind: LayoutLoadKind,
    /// Size per state 0..=N: N, N·mm, or 1 for gravity.
    pub values: Vec<f64>,
}

/// What acts, of size one.
#[derive(Clone, Debug)]
pub enum LayoutLoadKind {
    /// A dead force of 1 N.
    Force(PointForce),
    /// A moment of 1 N·mm on the second body: the potential −φ of its turn about an axis of the ground. Where the body
    /// turns about that axis only, this is the moment about the axis; a tilt it leaves alone.
    Moment(HingeAngle),
    /// The weight of everything.
    Gravity {
        /// Of a volume, N/mm³.
        specific_n_mm3: Vector3<f64>,
        /// Of the links.
        links: Vec<PointForce>,
    },
}

impl LayoutLoad {
    /// All loads of a design.
    pub fn of(
        design: &Design,
        motion: &Motion,
        points: impl Fn([crate::ir::expr::ExprId; 3]) -> Vector3<f64>,
    ) -> Vec<Self> {
        let steps = design.cycle.steps;
        let make = |load: &crate::ir::Load| {
            let kind = match &load.kind {
                LoadKind::Force { body, point, direction, .. } => LayoutLoadKind::Force(PointForce {
                    body: *body,
                    rest: motion.rest_point(*body, &points(*point)),
                    force_n: Vector3::from(*direction),
                }),
                LoadKind::Moment { body, axis, .. } => {
                    LayoutLoadKind::Moment(HingeAngle::new(0, *body, &Vector3::from(*axis)))
                }
                LoadKind::Gravity { direction } => {
                    let specific_n_mm3 = weight::specific_n_mm3(&design.material, direction);
                    let links = weight::links(design, motion, &points, &specific_n_mm3);
                    LayoutLoadKind::Gravity { specific_n_mm3, links }
                }
            };
            let values = (0..=steps).map(|s| load.size(s as f64 / steps as f64)).collect();
            Self { kind, values }
        };
        design.loads.iter().map(make).collect()
    }

    /// Calls `f(bodies, gradient)` for each body it acts on, at size one.
    fn gradient(&self, poses: &[Pose], f: &mut dyn FnMut([usize; 2], &SVector<f64, 12>)) {
        let force = |force: &PointForce, f: &mut dyn FnMut([usize; 2], &SVector<f64, 12>)| {
            let mut g = SVector::<f64, 12>::zeros();
            g.fixed_rows_mut::<6>(0).copy_from(&force.gradient(&poses[force.body]));
            f([force.body; 2], &g);
        };
        match &self.kind {
            LayoutLoadKind::Force(one) => force(one, f),
            LayoutLoadKind::Moment(turn) => f([turn.a, turn.b], &-turn.gradient(poses)),
            LayoutLoadKind::Gravity { links, .. } => links.iter().for_each(|l| force(l, f)),
        }
    }

    /// Adds to `out` how the gradient on the links changes at fixed poses, per force as in [`super::LayoutChange::loads`]. A
    /// moment's turn counts from the rest pose, wherever that is.
    pub(super) fn add_gradient_change(
        &self,
        model: &Model,
        state: &State,
        changes: &[PointForceChange],
        size: f64,
        out: &mut DVector<f64>,
    ) {
        let forces = match &self.kind {
            LayoutLoadKind::Force(one) => std::slice::from_ref(one),
            LayoutLoadKind::Moment(_) => &[],
            LayoutLoadKind::Gravity { links, .. } => links,
        };
        for (force, change) in forces.iter().zip(changes) {
            if let Some(first) = model.layout.bodies[force.body].first_dof {
                let mut rows = out.fixed_rows_mut::<6>(first);
                rows += force.gradient_change(&state.poses[force.body], change) * size;
            }
        }
    }

    /// The same for second derivatives.
    fn hessian(&self, poses: &[Pose], f: &mut dyn FnMut([usize; 2], &SMatrix<f64, 12, 12>)) {
        let force = |force: &PointForce, f: &mut dyn FnMut([usize; 2], &SMatrix<f64, 12, 12>)| {
            let mut h = SMatrix::<f64, 12, 12>::zeros();
            h.fixed_view_mut::<6, 6>(0, 0).copy_from(&force.hessian(&poses[force.body]));
            f([force.body; 2], &h);
        };
        match &self.kind {
            LayoutLoadKind::Force(one) => force(one, f),
            LayoutLoadKind::Moment(turn) => f([turn.a, turn.b], &-turn.hessian(poses)),
            LayoutLoadKind::Gravity { links, .. } => links.iter().for_each(|l| force(l, f)),
        }
    }

    /// The two bodies that second derivatives couple, if any.
    pub(super) fn pair(&self) -> Option<[usize; 2]> {
        match &self.kind {
            LayoutLoadKind::Moment(turn) => Some([turn.a, turn.b]),
            LayoutLoadKind::Force(_) | LayoutLoadKind::Gravity { .. } => None,
        }
    }

    /// The turn a moment works on, rad, on the branch nearest `near`; zero for other loads.
    pub(super) fn turn(&self, poses: &[Pose], near: f64) -> f64 {
        match &self.kind {
            LayoutLoadKind::Moment(turn) => turn.value(poses, near),
            LayoutLoadKind::Force(_) | LayoutLoadKind::Gravity { .. } => 0.0,
        }
    }
}

impl Layout {
    /// What a state is held at: drive values relative to rest (rad or mm), then the sizes of the loads.
    pub fn controls(&self, state: usize) -> Vec<f64> {
        let drives = self.drives.iter().map(|d| d.values[state] - d.rest);
        drives.chain(self.loads.iter().map(|l| l.values[state])).collect()
    }
}

impl Model<'_> {
    /// Potential of the loads at sizes `sizes`, N·mm, zero in the rest pose.
    pub fn load_potential_n_mm(&self, state: &State, sizes: &[f64]) -> f64 {
        let mut sum = 0.0;
        for ((load, size), turn) in self.layout.loads.iter().zip(sizes).zip(&state.turns) {
            let force = |f: &PointForce| f.potential_n_mm(&state.poses[f.body]);
            sum += size
                * match &load.kind {
                    LayoutLoadKind::Force(one) => force(one),
                    LayoutLoadKind::Moment(_) => -turn,
                    LayoutLoadKind::Gravity { specific_n_mm3, links } => {
                        let rods = self.rods.iter().zip(&state.rods);
                        links.iter().map(force).sum::<f64>()
                            + rods.map(|(r, s)| r.rod.weight_potential_n_mm(s, specific_n_mm3)).sum::<f64>()
                    }
                };
        }
        sum
    }
}

impl Solver {
    /// Takes over the sizes of the loads behind the drive values; those not given are zero.
    pub(super) fn take_sizes(&mut self, model: &Model, controls: &[f64]) {
        self.sizes.clear();
        self.sizes.extend(controls.iter().skip(model.layout.drives.len()));
        self.sizes.resize(model.layout.loads.len(), 0.0);
        let mut specific = Vector3::zeros();
        for (load, size) in model.layout.loads.iter().zip(&self.sizes) {
            if let LayoutLoadKind::Gravity { specific_n_mm3, .. } = &load.kind {
                specific += specific_n_mm3 * *size;
            }
        }
        self.systems.iter_mut().for_each(|s| s.set_specific_weight(&specific));
    }

    /// Adds the loads' part of the links' gradient; that of the rods is in the rods.
    pub(super) fn add_load_gradient(&self, model: &Model, state: &State, out: &mut DVector<f64>) {
        for (load, size) in model.layout.loads.iter().zip(&self.sizes) {
            load.gradient(&state.poses, &mut |bodies, g| scatter(model, bodies, &(g * *size), out));
        }
    }

    /// Adds their second derivatives.
    pub(super) fn add_load_hessian(
        &self,
        model: &Model,
        state: &State,
        order: &Elimination,
        out: &mut Blocks,
    ) {
        for (load, size) in model.layout.loads.iter().zip(&self.sizes) {
            load.hessian(&state.poses, &mut |bodies, h| {
                scatter_matrix(model, order, bodies, &(h * *size), out)
            });
        }
    }

    /// Derivative of links and multipliers by the size of a load at the last solved state. Of gravity, which only
    /// grows before the first state, without the weight of the rods.
    pub(super) fn load_tangent(&self, model: &Model, state: &State, load: usize) -> DVector<f64> {
        let mut links = DVector::zeros(model.layout.dofs());
        let load = &model.layout.loads[load];
        load.gradient(&state.poses, &mut |bodies, g| scatter(model, bodies, g, &mut links));
        let mut rhs = DVector::zeros(links.len() + model.rows());
        rhs.rows_mut(0, links.len()).copy_from(&-links);
        self.solve_scaled(&mut rhs);
        rhs
    }
}
