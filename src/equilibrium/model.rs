//! The compliant model at given design parameters: the layout plus one rod per flexure, with the
//! derivatives of each rod's parameters by the design parameters.

use super::frames::RodEndFrame;
use super::layout::Layout;
use crate::ir::{self, Design, Section};
use crate::math::Pose;
use crate::rod::{
    PARAMETERS, RestFrames, Rod, RodError, RodMaterial, RodModel, RodOptions, RodParameters, RodState,
    SectionShape,
};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;

/// A rod between two bodies.
#[derive(Clone, Debug)]
pub struct ModelRod {
    /// The rod.
    pub rod: Rod,
    /// Bodies of its two ends.
    pub bodies: [usize; 2],
    /// Its parameters by the design parameters, 19 × n.
    pub dq_dp: DMatrix<f64>,
}

/// The model at given parameters.
#[derive(Clone, Debug)]
pub struct Model<'l> {
    /// What the rods are put into.
    pub layout: Cow<'l, Layout>,
    /// One per flexure.
    pub rods: Vec<ModelRod>,
    /// The design parameters.
    pub p: Vec<f64>,
}

/// A flexure whose parameters make no rod.
#[derive(Clone, Debug)]
pub struct ModelError {
    /// Index into `Design::rods`.
    pub rod: usize,
    /// Why.
    pub error: RodError,
}

/// Everything that moves: poses, rods, multipliers.
#[derive(Clone, Debug)]
pub struct State {
    /// Pose of each body relative to rest.
    pub poses: Vec<Pose>,
    /// Centreline and frames of each rod.
    pub rods: Vec<RodState>,
    /// Multipliers: constraint rows in order, then drives (N, N·mm, N·mm per rad; of a sliding drive N).
    pub lambda: Vec<f64>,
    /// Drive values relative to rest, unwrapped, rad or mm.
    pub drives: Vec<f64>,
    /// Turn that each load works on, unwrapped, rad; zero for loads that are no moments.
    pub turns: Vec<f64>,
}

/// How a section of the language is modelled: wires carry frames that need no joint axis.
fn rod_options(rod: &ir::Rod, model: RodModel) -> RodOptions {
    let (section, frames) = match rod.section {
        Section::Ellipse { .. } => (SectionShape::Ellipse, RestFrames::Axis),
        Section::Rect { .. } => (SectionShape::Rectangle, RestFrames::Axis),
        Section::Round { .. } => (SectionShape::Ellipse, RestFrames::Transport),
    };
    RodOptions { section, frames, corrections: model.corrections(), taper: rod.section_to.is_some() }
}

impl<'l> Model<'l> {
    /// Builds the rods at free variables `p`, each with `edges` edges; with `derivatives` also what
    /// [`Sensitivity`](super::Sensitivity) needs of them.
    ///
    /// # Errors
    /// The first flexure whose rest shape is degenerate.
    pub fn new(
        design: &Design,
        layout: impl Into<Cow<'l, Layout>>,
        p: &[f64],
        edges: usize,
        derivatives: bool,
    ) -> Result<Self, ModelError> {
        let layout: Cow<'l, Layout> = layout.into();
        let values = design.exprs.evaluate(p);
        let material = RodMaterial { e_mpa: design.material.e_mpa, nu: design.material.nu };
        let make = |(index, (rod, ends)): (usize, (&ir::Rod, &[RodEndFrame; 2]))| {
            let mut q = [0.0; PARAMETERS];
            let mut dq_dp = DMatrix::zeros(PARAMETERS, p.len());
            for (k, (end, frame)) in [&rod.from, &rod.to].into_iter().zip(ends).enumerate() {
                let at_end = [(end.position, frame.origin), (end.derivative, Vector3::zeros())];
                for (j, (local, offset)) in at_end.into_iter().enumerate() {
                    let row = 6 * k + 3 * j;
                    let world = offset + frame.axes * values.point(local);
                    for c in 0..3 {
                        q[row + c] = world[c];
                        for (e, id) in local.iter().enumerate() {
                            for (column, g) in values.gradient(*id).iter().enumerate() {
                                dq_dp[(row + c, column)] += frame.axes[(c, e)] * g;
                            }
                        }
                    }
                }
            }
            for c in 0..3 {
                q[12 + c] = ends[0].axes[(c, 2)];
            }
            for change in layout.changes.iter().flatten() {
                let mut column = dq_dp.column_mut(change.parameter);
                for (k, (end, moved)) in
                    [&rod.from, &rod.to].into_iter().zip(&change.rod_ends[index]).enumerate()
                {
                    let mut position = column.fixed_rows_mut::<3>(6 * k);
                    position += moved.origin + moved.axes * values.point(end.position);
                    let mut derivative = column.fixed_rows_mut::<3>(6 * k + 3);
                    derivative += moved.axes * values.point(end.derivative);
                }
                column.fixed_rows_mut::<3>(12).copy_from(&change.rod_ends[index][0].axes.column(2));
            }
            let [a, b] = rod.section.half_widths();
            let [a_to, b_to] = rod.section_to.as_ref().unwrap_or(&rod.section).half_widths();
            for (row, id) in [(15, a), (16, b), (17, a_to), (18, b_to)] {
                q[row] = values.value(id);
                for (column, g) in values.gradient(id).iter().enumerate() {
                    dq_dp[(row, column)] = *g;
                }
            }
            let options = rod_options(rod, layout.rod_model);
            let q = RodParameters::from_array(&q);
            let built = Rod::with_options(&q, material, edges, options, derivatives)
                .map_err(|error| ModelError { rod: index, error })?;
            Ok(ModelRod { rod: built, bodies: [rod.from.body, rod.to.body], dq_dp })
        };
        let of_text = design.rods.par_iter().zip(&layout.rod_ends).enumerate();
        // The first that cannot be built is told, whichever thread is first.
        let rods: Vec<Result<ModelRod, ModelError>> = of_text.map(make).collect();
        Ok(Self { rods: rods.into_iter().collect::<Result<_, _>>()?, layout, p: p.to_vec() })
    }

    /// The unstressed rest state.
    pub fn rest_state(&self) -> State {
        State {
            poses: self.layout.bodies.iter().map(|b| Pose::rest(b.center)).collect(),
            rods: self.rods.iter().map(|r| r.rod.rest_state()).collect(),
            lambda: vec![0.0; self.rows()],
            drives: vec![0.0; self.layout.drives.len()],
            turns: vec![0.0; self.layout.loads.len()],
        }
    }

    /// Number of constraint and drive rows.
    pub fn rows(&self) -> usize {
        self.layout.constraints.iter().map(|c| c.rows()).sum::<usize>() + self.layout.drives.len()
    }

    /// Elastic energy of all rods, N·mm.
    pub fn energy_n_mm(&self, state: &State) -> f64 {
        self.rods.iter().zip(&state.rods).map(|(r, s)| r.rod.energy(s)).sum()
    }
}
