//! From bodies, joints and flexures in the rest pose to printed parts: one closed solid for all
//! bodies that flexures join (language.md "Layers").
//!
//! How it is held together: every pin hole is blind at both ends of its joint's layer (with
//! [`FLOOR_MM`] left). A pin is dropped into the lower eye and caught under the upper one; flexures
//! keep the layers apart, so nothing has to be glued. A motor's shaft passes the whole joint.

use super::carve::{Carving, carve};
use super::cycle::MovedState;
use super::fillet::Fillet;
use super::fitted::{FitFault, FitFaultKind, MountSolid, PlateSolid, SeatSolid, out_of_reach};
use super::gap::{Fusion, fusions};
use super::graft::united;
use super::link::{BodyPlan, plan_body};
use super::mesh::Mesh;
use super::slot::Facets;
use super::solid::PlacedSolid;
use super::tidy::finished;
use super::union::{BooleanError, subtract_all, union_all};
use crate::math::Pose;
use crate::rod::SectionShape;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::fmt;

/// Material left at the blind end of a pin hole, mm.
pub const FLOOR_MM: f64 = 1.2;

/// Everything the printed parts are made of, in the rest pose; lengths in mm.
#[derive(Clone, Debug, PartialEq)]
pub struct PartsInput {
    /// Height of a layer.
    pub height_mm: f64,
    /// Least clearance between moving parts.
    pub clearance_mm: f64,
    /// Least wall the process prints.
    pub least_wall_mm: f64,
    /// Bodies.
    pub bodies: Vec<BodySolid>,
    /// Flexures.
    pub flexures: Vec<FlexureSolid>,
    /// How the bodies move over the cycle, as far as it is known while they are planned: the pose of each in every
    /// state, relative to rest. Risers keep clear of what moves.
    pub motion: Vec<Vec<Pose>>,
    /// Fineness of round shapes.
    pub facets: Facets,
}

/// A rigid body as a skeleton to be fleshed out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodySolid {
    /// Name.
    pub name: String,
    /// Unit axis of the body's own layers, in which it is built of upright bars; none for a body whose joints point
    /// different ways: it is a net of round bars in space.
    pub axis: Option<Vector3<f64>>,
    /// Height of the middle of the body's own layer, measured along its axis from the origin.
    pub level_mm: f64,
    /// Points the link must reach at its own level (their height along the axis is ignored): points listed for
    /// the body and conventional hinges. Points of compliant joints and of sliders do not belong here: there the
    /// link ends in stubs and guides.
    pub skeleton: Vec<Vector3<f64>>,
    /// Conventional hinges.
    pub eyes: Vec<Eye>,
    /// Conventional sliders.
    pub guides: Vec<Guide>,
    /// Holes through it, each in a boss of its own.
    pub holes: Vec<HoleSolid>,
    /// Motors that it carries.
    pub mounts: Vec<MountSolid>,
    /// It is a plate.
    pub plate: Option<PlateSolid>,
    /// Meshes from files that are part of it.
    pub solids: Vec<PlacedSolid>,
    /// Seats of motors' horns.
    pub seats: Vec<SeatSolid>,
    /// A body that a flexure's template brings along.
    pub of_flexure: bool,
}

/// A hole for a screw or a thread.
#[derive(Clone, Debug, PartialEq)]
pub struct HoleSolid {
    /// Its middle.
    pub point: Vector3<f64>,
    /// Unit direction.
    pub axis: Vector3<f64>,
    /// Diameter, mm.
    pub diameter_mm: f64,
}

/// A body's share of a conventional slider: a square bar in a sleeve.
#[derive(Clone, Debug, PartialEq)]
pub struct Guide {
    /// Index of the joint.
    pub joint: usize,
    /// The joint's physical point: the middle of the sleeve in the rest pose.
    pub point: Vector3<f64>,
    /// Unit direction in which the bar slides.
    pub direction: Vector3<f64>,
    /// Unit normal of one pair of the bar's faces.
    pub normal: Vector3<f64>,
    /// Least and largest way of the bar through the sleeve over the cycle, from the rest pose.
    pub travel_mm: (f64, f64),
    /// This body holds the sleeve, the other one the bar.
    pub sleeve: bool,
}

/// A body's share of a conventional hinge.
#[derive(Clone, Debug, PartialEq)]
pub struct Eye {
    /// Index of the joint: eyes of one joint share their layer.
    pub joint: usize,
    /// The joint's physical point, in the middle of its layer.
    pub point: Vector3<f64>,
    /// Unit axis of the joint, the same for all its bodies.
    pub axis: Vector3<f64>,
    /// The hole along the axis.
    pub bore: Bore,
    /// This body is number `slot.0`, counted from 0 upwards along the axis, of `slot.1` bodies.
    pub slot: (usize, usize),
}

/// The hole in an eye; diameters are those of the hole, clearance included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bore {
    /// None: no diameter is stated, the eye stays solid to be drilled.
    Solid,
    /// For a pin, closed at both ends of the joint's layer.
    Blind {
        /// Diameter of the hole, mm.
        diameter_mm: f64,
    },
    /// Through the body in all layers, for a motor's shaft.
    Through {
        /// Diameter of the hole, mm.
        diameter_mm: f64,
    },
}

impl Bore {
    /// Diameter of the hole; none if solid.
    pub fn diameter_mm(&self) -> Option<f64> {
        match *self {
            Bore::Solid => None,
            Bore::Blind { diameter_mm } | Bore::Through { diameter_mm } => Some(diameter_mm),
        }
    }
}

/// A flexure between two bodies: stations from one attachment plane to the other.
#[derive(Clone, Debug, PartialEq)]
pub struct FlexureSolid {
    /// Path, e.g. `knee.upper`.
    pub path: String,
    /// Index of the joint: its flexures share their layer.
    pub joint: usize,
    /// The joint's physical point, in the middle of its layer.
    pub joint_point: Vector3<f64>,
    /// Bodies at the first and the last station.
    pub bodies: (usize, usize),
    /// Cross section; a circle is an ellipse.
    pub section: SectionShape,
    /// Centres, the attachment points first and last.
    pub centreline: Vec<Vector3<f64>>,
    /// Thin direction at each station; m₁ × m₂ is the unit tangent.
    pub m1: Vec<Vector3<f64>>,
    /// Wide direction at each station.
    pub m2: Vec<Vector3<f64>>,
    /// Semi-axis along m₁ at each station.
    pub a_mm: Vec<f64>,
    /// Semi-axis along m₂ at each station.
    pub b_mm: Vec<f64>,
    /// Fillets at its start and at its end.
    pub fillets: [Option<Fillet>; 2],
}

/// A part to print.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Name of its first body.
    pub name: String,
    /// Indices of its bodies.
    pub bodies: Vec<usize>,
    /// Closed, oriented mesh in the rest pose, mm, coordinates exact in `f32`.
    pub mesh: Mesh,
    /// Of each body the link by itself, without flexures.
    pub links: Vec<Mesh>,
    /// What the maker should know, one sentence each.
    pub notes: Vec<String>,
}

/// The parts, and what is wrong with them.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// Printed parts, in the order of their first bodies.
    pub parts: Vec<Part>,
    /// The rigid plan of each body, for distance checks over the cycle.
    pub plans: Vec<BodyPlan>,
    /// Links that made way for their own flexures.
    pub carving: Carving,
    /// Places where things grow together that must not.
    pub fusions: Vec<Fusion>,
    /// Motors whose screws no driver reaches, solids that do not hold on to their links.
    pub out_of_reach: Vec<FitFault>,
}

/// Why no parts could be made.
#[derive(Clone, Debug, PartialEq)]
pub enum GeometryError {
    /// A number is not finite, or a size not positive, or lists differ in length.
    Input(String),
    /// A body has nothing to build on.
    NoSkeleton(String),
    /// A solid could not be united.
    Boolean {
        /// The part or body.
        name: String,
        /// What the kernel said.
        error: BooleanError,
    },
}

impl fmt::Display for GeometryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GeometryError::Input(text) => write!(f, "cannot build a solid: {text}"),
            GeometryError::NoSkeleton(name) => {
                write!(f, "`{name}` has neither points nor joints: there is nothing to print")
            }
            GeometryError::Boolean { name, error } => write!(f, "`{name}` cannot be united: {error}"),
        }
    }
}

impl std::error::Error for GeometryError {}

/// Builds all printed parts.
///
/// # Errors
/// Meaningless input, a body without any point, or a failure of the boolean kernel. Overlaps in the
/// rest pose are no errors: they are returned as [`Parts::fusions`].
pub fn build_parts(input: &PartsInput) -> Result<Parts, GeometryError> {
    let plans = plan_bodies(input)?;
    build_planned(input, plans, Carving::default(), &|_| true)
}

/// The same with links carved where a flexure attached to them would hit them, in the rest pose or in one of the
/// `states`.
///
/// # Errors
/// As [`build_parts`].
pub fn build_carved_parts(input: &PartsInput, states: &[MovedState]) -> Result<Parts, GeometryError> {
    let plans = plan_bodies(input)?;
    let carving = carve(input, &plans, states)?;
    build_planned(input, plans, carving, &|_| true)
}

/// The same from bodies that have been planned and carved, meshed only where wanted, by the bodies of a part; the mesh of any
/// other is empty.
///
/// # Errors
/// As [`build_parts`].
pub fn build_planned(
    input: &PartsInput,
    plans: Vec<BodyPlan>,
    carving: Carving,
    wanted: &(dyn Fn(&[usize]) -> bool + Sync),
) -> Result<Parts, GeometryError> {
    let groups = groups(input);
    let fusions = fusions(input, &plans, &groups, &carving);
    let mut out_of_reach = out_of_reach(&plans, &groups);
    for (solid, gap, at) in plans.iter().flat_map(BodyPlan::loose_solids) {
        let (motor, kind) = (solid.file.clone(), FitFaultKind::Loose(gap));
        out_of_reach.push(FitFault { motor, kind, at, origin: solid.origin });
    }
    let build = |bodies: &Vec<usize>| {
        if wanted(bodies) {
            return build_part(input, &plans, &carving, bodies);
        }
        let name = bodies.first().map(|i| input.bodies[*i].name.clone()).unwrap_or_default();
        let notes = bodies.iter().flat_map(|i| plans[*i].notes.iter().cloned()).collect();
        Ok(Part { name, bodies: bodies.clone(), mesh: Mesh::default(), links: Vec::new(), notes })
    };
    let parts = groups.par_iter().map(build).collect::<Result<Vec<Part>, GeometryError>>()?;
    Ok(Parts { parts, plans, carving, fusions, out_of_reach })
}

/// The primitives of every body, without any meshing: enough for distance checks.
///
/// # Errors
/// Meaningless input, or a body without any point.
pub fn plan_bodies(input: &PartsInput) -> Result<Vec<BodyPlan>, GeometryError> {
    validate(input)?;
    // Gathered before it is judged: the first body that fails is told, on any number of threads.
    let plans: Vec<_> = (0..input.bodies.len()).into_par_iter().map(|i| plan_body(input, i)).collect();
    plans.into_iter().collect()
}

/// Bodies joined by flexures, each group sorted, groups in the order of their first bodies.
pub fn groups(input: &PartsInput) -> Vec<Vec<usize>> {
    let mut leader: Vec<usize> = (0..input.bodies.len()).collect();
    for flexure in &input.flexures {
        let (Some(&a), Some(&b)) = (leader.get(flexure.bodies.0), leader.get(flexure.bodies.1)) else {
            continue;
        };
        let (low, high) = (a.min(b), a.max(b));
        leader.iter_mut().filter(|l| **l == high).for_each(|l| *l = low);
    }
    (0..input.bodies.len())
        .map(|first| (0..input.bodies.len()).filter(|i| leader[*i] == first).collect::<Vec<_>>())
        .filter(|g| !g.is_empty())
        .collect()
}

/// One solid of some bodies and the flexures between them.
pub(super) fn build_part(
    input: &PartsInput,
    plans: &[BodyPlan],
    carving: &Carving,
    bodies: &[usize],
) -> Result<Part, GeometryError> {
    let name = bodies.first().map(|i| input.bodies[*i].name.clone()).unwrap_or_default();
    let failed = |error| GeometryError::Boolean { name: name.clone(), error };
    let solids: Vec<Mesh> = bodies
        .par_iter()
        .map(|i| {
            if let Some(link) = carving.links.get(i) {
                return Ok(link.clone());
            }
            let plan = &plans[*i];
            let body = union_all(&plan.meshes(&input.facets))?;
            subtract_all(&body, &plan.bore_meshes(&input.facets))
        })
        .collect::<Result<_, BooleanError>>()
        .map_err(failed)?;
    let inside = |f: &&FlexureSolid| bodies.contains(&f.bodies.0);
    let links = bodies.par_iter().zip(&solids).map(|(b, link)| with_fillets(input, *b, link));
    let links = links.collect::<Result<_, BooleanError>>().map_err(failed)?;
    let flexures: Vec<Mesh> =
        input.flexures.iter().filter(inside).map(|f| f.mesh(input.facets.around)).collect();
    let united = united(&solids, &flexures).map_err(failed)?;
    let mesh = finished(&united);
    let notes = bodies.iter().flat_map(|i| plans[*i].notes.iter().cloned()).collect();
    Ok(Part { name, bodies: bodies.to_vec(), mesh, links, notes })
}

/// A link with the fillets of its flexures, as it is seen without them.
fn with_fillets(input: &PartsInput, body: usize, link: &Mesh) -> Result<Mesh, BooleanError> {
    let ends =
        |f: &FlexureSolid| [(false, f.bodies.0), (true, f.bodies.1)].map(|(at_end, b)| (at_end, b == body));
    let roots = input.flexures.iter().flat_map(|f| {
        let own = ends(f).into_iter().filter(|e| e.1);
        own.filter_map(|(at_end, _)| f.root_mesh(at_end, input.facets.around)).collect::<Vec<_>>()
    });
    let mut pieces: Vec<Mesh> = roots.collect();
    if pieces.is_empty() {
        return Ok(link.clone());
    }
    pieces.insert(0, link.clone());
    union_all(&pieces)
}

fn validate(input: &PartsInput) -> Result<(), GeometryError> {
    let fail = |text: String| Err(GeometryError::Input(text));
    let finite = |p: &Vector3<f64>| p.iter().all(|x| x.is_finite() && x.abs() < 1e6);
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !positive(input.height_mm) || !positive(input.clearance_mm) || !positive(input.least_wall_mm) {
        return fail("layer height, clearance and least wall must be positive".into());
    }
    for body in &input.bodies {
        let points = body.skeleton.iter().chain(body.eyes.iter().map(|e| &e.point));
        let unit = |a: &Vector3<f64>| finite(a) && (a.norm() - 1.0).abs() < 1e-6;
        if !body.axis.iter().chain(body.eyes.iter().map(|e| &e.axis)).all(unit) {
            return fail(format!("an axis of `{}` is not a unit vector", body.name));
        }
        if !points.clone().all(finite) || !body.level_mm.is_finite() {
            return fail(format!("a point of `{}` is not finite", body.name));
        }
        for guide in &body.guides {
            let across = guide.direction.dot(&guide.normal).abs() < 1e-6;
            if !unit(&guide.direction) || !unit(&guide.normal) || !across || !finite(&guide.point) {
                return fail(format!("a guide of `{}` has no direction", body.name));
            }
            if guide.travel_mm.0.is_nan()
                || guide.travel_mm.1.is_nan()
                || guide.travel_mm.0 > guide.travel_mm.1
            {
                return fail(format!("a guide of `{}` has no way", body.name));
            }
        }
        for eye in &body.eyes {
            if eye.slot.0 >= eye.slot.1 || eye.slot.1 > 8 {
                return fail(format!("an eye of `{}` has slot {} of {}", body.name, eye.slot.0, eye.slot.1));
            }
            if eye.bore.diameter_mm().is_some_and(|d| !positive(d)) {
                return fail(format!("a bore of `{}` has no positive diameter", body.name));
            }
        }
    }
    if input.motion.iter().any(|poses| poses.len() != input.bodies.len()) {
        return fail("a state has not one pose a body".into());
    }
    for f in &input.flexures {
        let n = f.centreline.len();
        if n < 2 || [f.m1.len(), f.m2.len(), f.a_mm.len(), f.b_mm.len()].iter().any(|k| *k != n) {
            return fail(format!("`{}` needs two or more stations with frames and semi-axes", f.path));
        }
        let vectors = f.centreline.iter().chain(&f.m1).chain(&f.m2);
        if !vectors.clone().all(finite) || !f.a_mm.iter().chain(&f.b_mm).all(|x| positive(*x)) {
            return fail(format!("`{}` has a station that is not finite or not thick", f.path));
        }
        if f.bodies.0 >= input.bodies.len() || f.bodies.1 >= input.bodies.len() {
            return fail(format!("`{}` is attached to a body that does not exist", f.path));
        }
        if f.outward(false) == Vector3::zeros() || f.outward(true) == Vector3::zeros() {
            return fail(format!("`{}` has an end without direction", f.path));
        }
    }
    Ok(())
}
