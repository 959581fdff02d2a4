//! Instances with motors and horns on their hinges that are written beside them: their designs with these, in solids as if
//! they stood in the mechanism. The design that is solved knows nothing of them.

use super::joined::Known;
use crate::diagnostic::Origin;
use crate::equilibrium::{Layout, Model};
use crate::geometry::link::BodyPlan;
use crate::geometry::parts::groups;
use crate::geometry::{
    Carving, FitFault, GeometryError, MountSolid, PartsInput, carve, out_of_reach, parts_input, plan_bodies,
};
use crate::ir::assembly::{HingeFitting, Hinged, InstanceHinge, Places};
use crate::ir::expr::{ExprId, Node};
use crate::ir::{Assembly, Design, ExprPoint, Horn, Instance, Mount};
use crate::kinematics::solve_motion;
use nalgebra::Vector3;

/// An instance's design with what stands on its hinges, in the design's coordinates.
pub struct Refitted {
    /// What its parts are made of.
    pub input: PartsInput,
    /// Its bodies.
    pub plans: Vec<BodyPlan>,
    /// What made way; nothing where that was not asked for.
    pub carving: Carving,
    /// What is wrong with the seats that this instance names.
    pub faults: Vec<FitFault>,
}

/// A design at the values it was solved for, which is given fittings.
struct Shape {
    design: Design,
    layout: Layout,
    values: Vec<f64>,
}

impl Shape {
    fn new(design: &Design, values: &[f64], put_on: &[Origin]) -> Result<Self, GeometryError> {
        // How it changes with its free variables is of no interest any more, and costs most.
        let mut design = design.clone();
        // What stands in the design as well is put on anew, in its place.
        for body in &mut design.bodies {
            body.fittings.mounts.retain(|m| !put_on.contains(&m.origin));
            body.fittings.horns.retain(|h| !put_on.contains(&h.origin));
        }
        design.exprs.nodes = design.exprs.values(values).into_iter().map(Node::Const).collect();
        let motion = solve_motion(&design, values).map_err(|_| lost(&design))?;
        let layout = Layout::new(&design, &motion, values);
        Ok(Self { design, layout, values: values.to_vec() })
    }

    /// A place in the design's graph.
    fn constant(&mut self, p: &Vector3<f64>) -> ExprPoint {
        [p.x, p.y, p.z].map(|v| {
            self.design.exprs.nodes.push(Node::Const(v));
            ExprId((self.design.exprs.nodes.len() - 1) as u32)
        })
    }

    /// Puts a motor on a hinge; directions and the place `toward` as they are drawn.
    fn mount(
        &mut self,
        mount: &Mount,
        hinge: &InstanceHinge,
        along: Option<Vector3<f64>>,
        toward: Option<Vector3<f64>>,
    ) {
        let Some(position) = self.design.joints.get(hinge.joint).map(|j| j.point) else { return };
        let toward = toward.map(|q| self.constant(&q));
        let (along, joint) = (along.map(Into::into), Some(hinge.joint));
        let mount = Mount { position, along, joint, toward, ..mount.clone() };
        if let Some(body) = self.design.bodies.get_mut(hinge.body) {
            body.fittings.mounts.push(mount);
        }
    }

    fn horn(&mut self, horn: &Horn, hinge: &InstanceHinge) {
        let horn = Horn { joint: hinge.joint, ..horn.clone() };
        if let Some(body) = self.design.bodies.get_mut(hinge.body) {
            body.fittings.horns.push(horn);
        }
    }

    fn input(&self, edges: usize) -> Result<PartsInput, GeometryError> {
        let model = Model::new(&self.design, &self.layout, &self.values, edges, false);
        Ok(parts_input(&self.design, &self.layout, &model.map_err(|_| lost(&self.design))?))
    }
}

fn lost(design: &Design) -> GeometryError {
    GeometryError::Input(format!("`{}` cannot be assembled with what is fitted to it", design.name))
}

/// An instance with what stands on its hinges; none: nothing does. `with_carving`: its links make way for its flexures anew.
///
/// # Errors
/// Bodies that cannot be planned, or a failure of the boolean kernel.
pub fn refitted(
    assembly: &Assembly,
    index: usize,
    designs: &[Known<'_>],
    with_carving: bool,
) -> Option<Result<Refitted, GeometryError>> {
    assembly.hinged(index).next()?;
    let instance = assembly.instances.get(index)?;
    let (design, known) = (assembly.designs.get(instance.design)?, designs.get(instance.design)?);
    Some(refit(assembly, (index, instance), design, (designs, known), with_carving))
}

fn refit(
    assembly: &Assembly,
    (index, instance): (usize, &Instance),
    design: &Design,
    (designs, known): (&[Known<'_>], &Known<'_>),
    with_carving: bool,
) -> Result<Refitted, GeometryError> {
    let places = assembly.places(|d| designs.get(d).map(|k| k.values));
    let put_on: Vec<Origin> = assembly.hinged(index).map(Hinged::origin).collect();
    let mut shape = Shape::new(design, known.values, &put_on)?;
    for hinged in assembly.hinged(index) {
        for hinge in hinged.hinges.iter().filter(|h| h.instance == index) {
            match &hinged.fitting {
                HingeFitting::Mount(mount) => {
                    let Some(seen) = mounted(assembly, hinged, mount, designs, &places) else { continue };
                    let seen = seen?;
                    let Some(pose) = shape.layout.rest_poses.get(hinge.body).copied() else { continue };
                    let Some(point) = shape.layout.joint_points.get(hinge.joint).copied() else { continue };
                    let drawn =
                        |d: &Vector3<f64>| pose.rotation.transpose() * instance.placement.direction_within(d);
                    let toward = point + drawn(&seen.forward);
                    shape.mount(mount, hinge, Some(drawn(&seen.axis)), Some(toward));
                }
                // Its screws need not lie symmetric to a mirror: the instance that is named cuts it for all.
                HingeFitting::Horn(horn) if hinged.hinges.first() == Some(hinge) => shape.horn(horn, hinge),
                HingeFitting::Horn(_) => {}
            }
        }
    }
    let bodies = shape.input(super::compiler::EDGES)?.bodies;
    let input = PartsInput { bodies, ..known.input.clone() };
    let plans = plan_bodies(&input)?;
    let carving = if with_carving { carve(&input, &plans, known.states)? } else { Carving::default() };
    // What stands in the design is told of the design.
    let in_design = |f: &FitFault| {
        let mut fittings = design.bodies.iter().map(|b| &b.fittings);
        fittings.any(|t| {
            t.mounts.iter().map(|m| m.origin).chain(t.horns.iter().map(|h| h.origin)).any(|o| o == f.origin)
        })
    };
    let named = |f: &FitFault| {
        assembly
            .hinged(index)
            .any(|h| h.origin() == f.origin && h.hinges.first().is_some_and(|h| h.instance == index))
    };
    let faults = plans.iter().flat_map(|p| p.faults.iter().cloned());
    let faults = faults.chain(out_of_reach(&plans, &groups(&input)));
    let faults = faults.filter(|f| named(f) && !in_design(f)).collect();
    Ok(Refitted { input, plans, carving, faults })
}

/// A motor as it stands in the assembly: as it would in the mechanism of the instance that is named.
fn mounted(
    assembly: &Assembly,
    hinged: &Hinged,
    mount: &Mount,
    designs: &[Known<'_>],
    places: &Places,
) -> Option<Result<MountSolid, GeometryError>> {
    let hinge = hinged.hinges.first()?;
    let instance = assembly.instances.get(hinge.instance)?;
    let (design, known) = (assembly.designs.get(instance.design)?, designs.get(instance.design)?);
    let placement = &instance.placement;
    let solid = || {
        let put_on: Vec<Origin> = assembly.hinged(hinge.instance).map(Hinged::origin).collect();
        let mut shape = Shape::new(design, known.values, &put_on)?;
        let along = mount.along.map(|d| placement.direction_within(&Vector3::from(d)));
        let toward = mount.toward.map(|q| placement.point_within(&places.at(q)));
        shape.mount(mount, hinge, along, toward);
        let input = shape.input(super::compiler::EDGES)?;
        let solid = input.bodies.get(hinge.body).and_then(|b| b.mounts.last()).cloned();
        solid.ok_or_else(|| lost(design))
    };
    let placed = |m: MountSolid| MountSolid {
        point: placement.point(&m.point),
        axis: placement.direction(&m.axis),
        forward: placement.direction(&m.forward),
        rest: placement.point(&m.rest),
        ..m
    };
    Some(solid().map(placed))
}
