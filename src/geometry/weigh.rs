//! What links weigh: volume and centre of mass of their printed form, before anything is meshed.
//!
//! The form is planned at given values and measured on a grid of distances. What it has beyond flat bars
//! through the link's points (bosses, stubs, risers, less the bores) is a constant of the body, so that gravity
//! is a smooth function of the design whose derivatives are those of the bars (`equilibrium/weight.rs`). The pipeline
//! weighs anew where values have changed (`pipeline/gravity.rs`).

use super::field::Field;
use super::input::parts_input;
use super::link::BodyPlan;
use super::mesh::Mesh;
use super::parts::plan_bodies;
use super::slot::Slot;
use crate::equilibrium::{Layout, Model, volume_and_center};
use crate::ir::{Design, LoadKind, PrintedExtra};
use crate::kinematics::solve_motion;
use nalgebra::Vector3;

/// Step of the grid, mm: from 0.8 to 0.25 the parts of the Chebyshev and Jansen examples change by less than 0.3 %.
const STEP_MM: f64 = 0.5;
/// Edges of a rod while planning; ends of flexures, all that matters here, do not depend on it.
const EDGES: usize = 20;

/// Whether weight matters.
pub fn has_gravity(design: &Design) -> bool {
    design.all_loads().any(|l| matches!(l.kind, LoadKind::Gravity { .. }))
}

/// What the printed form of each body has beyond flat bars at `values` (the free variables in order). None for a design
/// that cannot be planned: its links weigh what the bars do.
pub fn weigh(design: &Design, values: &[f64]) -> Option<Vec<PrintedExtra>> {
    let motion = solve_motion(design, values).ok()?;
    let layout = Layout::new(design, &motion, values);
    let model = Model::new(design, &layout, values, EDGES, false).ok()?;
    let plans = plan_bodies(&parts_input(design, &layout, &model).unfilleted()).ok()?;
    let at = design.exprs.evaluate(values);
    let extra = |(b, plan): (usize, &BodyPlan)| {
        let points: Vec<Vector3<f64>> =
            design.bodies[b].skeleton.iter().map(|p| at.point(p.position)).collect();
        let (bars, of_bars) = volume_and_center(&points, design.layers.height_mm);
        let (volume, at_rest) = printed_volume_and_center(plan, STEP_MM);
        let drawn = layout.rest_poses[b].back(&at_rest);
        PrintedExtra { printed_mm3: volume, volume_mm3: volume - bars, center_mm: (drawn - of_bars).into() }
    };
    Some(plans.iter().enumerate().map(extra).collect())
}

/// Volume (mm³) and centre (mm, rest pose) of a planned body on a grid of `step_mm`. Cells that the surface cuts count by
/// the distance of their centres from it, which is exact for faces along the grid on average and second order else.
pub fn printed_volume_and_center(plan: &BodyPlan, step_mm: f64) -> (f64, Vector3<f64>) {
    let reach = step_mm * 1.5;
    let corner = |s: &Slot| s.extent() + Vector3::repeat(reach);
    let slots = || plan.slots.iter().map(|(_, s)| s);
    let solids: Vec<Mesh> = plan.solids.iter().map(|s| s.mesh()).collect();
    let around = |low: bool| {
        let boxes = solids.iter().filter_map(Mesh::bounding_box);
        boxes.map(move |b| if low { b.0.add_scalar(-reach) } else { b.1.add_scalar(reach) })
    };
    let least = slots().map(|s| s.start.inf(&s.end) - corner(s)).chain(around(true)).reduce(|a, b| a.inf(&b));
    let largest =
        slots().map(|s| s.start.sup(&s.end) + corner(s)).chain(around(false)).reduce(|a, b| a.sup(&b));
    let (Some(least), Some(largest)) = (least, largest) else { return (0.0, Vector3::zeros()) };
    let mut field = Field::new(&least, &largest, step_mm, f64::INFINITY);
    // A larger body has wider steps.
    let reach = field.step * 1.5;
    slots().for_each(|s| field.add(s, 0.0, reach));
    solids.iter().for_each(|s| field.add_mesh(s, reach));
    for bore in plan.bores.iter().map(|b| b.slot()) {
        field.near(&bore, reach, |p, value| *value = value.max(-bore.signed_distance(p)));
    }
    for pocket in &plan.pockets {
        field.near(&pocket.around(), reach, |p, value| *value = value.max(-pocket.signed_distance(p)));
    }
    let cell = field.step.powi(3);
    let (mut volume, mut moment) = (0.0, Vector3::zeros());
    for (i, distance) in field.values.iter().enumerate() {
        let inside = (0.5 - distance / field.step).clamp(0.0, 1.0) * cell;
        if inside > 0.0 {
            volume += inside;
            moment += field.point(i) * inside;
        }
    }
    if volume > 0.0 { (volume, moment / volume) } else { (0.0, Vector3::zeros()) }
}
