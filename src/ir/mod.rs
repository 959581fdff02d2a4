//! The narrow waist: a [`Design`] is all that elaboration hands to the numerical stages, and a
//! [`Solution`] all that they hand back. Plain data; units are mm, N, MPa, rad, s throughout.

mod aim;
pub mod assembly;
mod code;
mod drive;
pub mod expr;
mod fit;
mod load;
mod model;
mod solid;
mod solution;
mod used;

pub use crate::diagnostic::Origin;
pub use aim::{Aims, BodyAngle, Direction, Target, TargetOf, TargetPath};
pub use assembly::{Assembly, Instance, Placement};
pub use code::{CodeKind, MotorMotion, Stretch, Wanted, Workspace};
pub use drive::{Cable, Drive, DriveOn, DriveUnit, Profile};
use expr::{ExprGraph, ExprId};
pub use fit::{Fittings, Horn, HornForm, LinkPlate, MotorBody, MotorScrews, Mount};
pub use load::{Load, LoadCase, LoadKind};
pub use model::RodModel;
use serde::{Deserialize, Serialize};
pub use solid::{AddedSolid, SurfaceFault, SurfaceFaultKind, TriangleMesh};
pub use solution::Solution;
pub(crate) use used::{prune, with_operands};

/// Index into [`Design::bodies`].
pub type BodyId = usize;
/// Index into [`Design::joints`].
pub type JointId = usize;
/// A point or vector: three scalar expressions, mm.
pub type ExprPoint = [ExprId; 3];

/// An elaborated mechanism.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Design {
    /// Name of the mechanism.
    pub name: String,
    /// Flat graph of every scalar that may depend on a free variable.
    pub exprs: ExprGraph,
    /// Free variables, in order of declaration: the design parameters p.
    pub free: Vec<FreeVariable>,
    /// Bodies; the first ground body is body 0.
    pub bodies: Vec<Body>,
    /// Joints, conventional and compliant.
    pub joints: Vec<Joint>,
    /// Rods of all compliant joints.
    pub rods: Vec<Rod>,
    /// Theory of the rods.
    #[serde(default, skip_serializing_if = "RodModel::is_default")]
    pub model: RodModel,
    /// Drives.
    pub drives: Vec<Drive>,
    /// Strings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strings: Vec<Cable>,
    /// Loads from outside.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<Load>,
    /// Load cases: the cycle once more under further loads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cases: Vec<LoadCase>,
    /// Steps and duration.
    pub cycle: Cycle,
    /// Traced points.
    pub traces: Vec<Trace>,
    /// Traced directions, targets, angles of bodies.
    #[serde(default, skip_serializing_if = "Aims::is_empty")]
    pub aims: Aims,
    /// Terms of the objective.
    pub objectives: Vec<Objective>,
    /// Acceptance tests.
    pub requirements: Vec<Requirement>,
    /// What the part is made of.
    pub material: Material,
    /// How it is made.
    pub process: Process,
    /// Stacking of planar links.
    pub layers: Layers,
    /// Files to emit.
    pub exports: Vec<Export>,
    /// The whole mechanism declaration.
    pub origin: Origin,
}

impl Design {
    /// Indices of the free variables that move the conventional mechanism, its rest pose, end frames of flexures, or
    /// where loads act.
    pub fn geometry_variables(&self) -> Vec<usize> {
        let mut roots: Vec<ExprId> = Vec::new();
        for joint in &self.joints {
            roots.extend(joint.point);
            roots.extend(joint.toward.iter().flat_map(|(_, q)| q));
        }
        roots.extend(self.traces.iter().flat_map(|t| t.point));
        roots.extend(self.strings.iter().flat_map(|c| c.via.iter().flatten().chain(&c.point)));
        roots.extend(self.drives.iter().filter_map(|d| d.free_rest));
        for load in self.all_loads() {
            match &load.kind {
                LoadKind::Force { point, .. } => roots.extend(point),
                // Links are weighed by their skeletons.
                LoadKind::Gravity { .. } => {
                    let points = self.bodies.iter().flat_map(|b| &b.skeleton);
                    roots.extend(points.flat_map(|p| p.position));
                }
                LoadKind::Moment { .. } => {}
            }
        }
        self.exprs.free_variables(&roots).into_iter().collect()
    }
}

/// A design variable: `free START in LOWER .. UPPER`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeVariable {
    /// Path, unique, e.g. `knee.thickness`, `knee.upper.from.at.r`.
    pub path: String,
    /// Unit of the three numbers: `mm`, `rad`, `1`, …
    pub unit: String,
    /// Start value.
    pub start: f64,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// The `free` expression.
    pub origin: Origin,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Fixed to the world.
    pub ground: bool,
    /// Skeleton points in the drawing pose: the listed points, then joint points not listed.
    pub skeleton: Vec<NamedPoint>,
    /// Layer along the stacking axis.
    pub layer: i32,
    /// Of a body that a template brings along, the joint it belongs to: it is called `joint.body`, stands after the
    /// text's bodies and has no skeleton. The conventional mechanism carries it with the joint's first body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<JointId>,
    /// Holes through it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Hole>,
    /// Motors and horns on it, or that it is a plate.
    #[serde(default, skip_serializing_if = "Fittings::is_empty")]
    pub fittings: Fittings,
    /// What gravity needs of the printed form at some values; derived, and so no part of the design's text form.
    #[serde(skip)]
    pub printed: Option<PrintedExtra>,
    /// Declaration.
    pub origin: Origin,
}

/// A hole through a body, for a screw or a thread.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hole {
    /// Its middle in the drawing pose. No point of the skeleton: frames of flexures do not depend on it.
    pub position: ExprPoint,
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// Unit direction in the drawing pose.
    pub axis: [f64; 3],
    /// Statement.
    pub origin: Origin,
}

/// What a printed link has beyond flat bars through its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedExtra {
    /// Printed volume, mm³.
    pub printed_mm3: f64,
    /// Volume more than the bars', mm³.
    pub volume_mm3: f64,
    /// Centre of mass from the bars' (from the origin where there are none), in the drawing pose, mm.
    pub center_mm: [f64; 3],
}

/// A named point of a skeleton.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedPoint {
    /// Name of the point, or of the joint it comes from.
    pub name: String,
    /// Position in the drawing pose.
    pub position: ExprPoint,
}

/// Kinds of conventional joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// One rotation about the axis.
    Hinge,
    /// Three rotations.
    Ball,
    /// Two rotations about orthogonal axes.
    Universal,
    /// One translation along the axis.
    Slider,
    /// One rotation and one translation along the same axis.
    Cylindrical,
    /// No freedom.
    Fixed,
}

impl JointKind {
    /// All kinds.
    pub const ALL: [Self; 6] =
        [Self::Hinge, Self::Ball, Self::Universal, Self::Slider, Self::Cylindrical, Self::Fixed];

    /// Its keyword.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hinge => "hinge",
            Self::Ball => "ball",
            Self::Universal => "universal",
            Self::Slider => "slider",
            Self::Cylindrical => "cylindrical",
            Self::Fixed => "fixed",
        }
    }
}

/// A joint of two or more bodies at one point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: JointKind,
    /// Bodies in the order written; the joint's value is the second relative to the first. A conventional joint of
    /// more than two bodies joins every later one to the first.
    pub bodies: Vec<BodyId>,
    /// Position in the drawing pose, without the layer's offset.
    pub point: ExprPoint,
    /// Unit axis in the drawing pose.
    pub axis: [f64; 3],
    /// Second unit axis of a universal joint, carried by the second body (the first by the first).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_axis: Option<[f64; 3]>,
    /// Layer the joint lies in: its physical point is `point + layer * pitch * stacking axis`.
    pub layer: i32,
    /// `into BODY toward Q`: overrides e1 of that body's end frame. Points in the drawing pose.
    pub toward: Vec<(BodyId, ExprPoint)>,
    /// How it is made.
    pub realization: Realization,
    /// Declaration.
    pub origin: Origin,
}

impl Joint {
    /// Whether flexures replace the conventional joint.
    pub fn is_compliant(&self) -> bool {
        matches!(self.realization, Realization::Compliant { .. })
    }

    /// The two-body joints it is made of when conventional: the first body with every later one.
    pub fn pairs(&self) -> impl Iterator<Item = [BodyId; 2]> {
        let first = self.bodies.first().copied();
        self.bodies.iter().skip(1).filter_map(move |b| Some([first?, *b]))
    }
}

/// How a joint is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Realization {
    /// A conventional bearing.
    Conventional {
        /// Diameter of a bought pin, if stated.
        pin_diameter_mm: Option<f64>,
    },
    /// Flexures of a template.
    Compliant {
        /// Template name.
        template: String,
        /// Indices into [`Design::rods`].
        rods: Vec<usize>,
    },
}

/// A flexure modelled as a rod between two bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rod {
    /// Path, e.g. `knee.upper`.
    pub path: String,
    /// The joint it belongs to.
    pub joint: JointId,
    /// Start.
    pub from: RodEnd,
    /// End.
    pub to: RodEnd,
    /// Its ends' e3 is the second axis of a universal joint.
    #[serde(default, skip_serializing_if = "is_false")]
    pub second_axis: bool,
    /// Cross-section, of a tapered rod at its start.
    pub section: Section,
    /// Of a tapered rod the cross-section at its end, of the same shape: half widths run linearly in arc length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub section_to: Option<Section>,
    /// Radius of the fillets at its ends, mm; 0: none. The rod is the same with and without.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub fillet_mm: f64,
    /// Declaration in the template.
    pub origin: Origin,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

fn is_false(b: &bool) -> bool {
    !b
}

/// One end of a rod, in the end frame of its body at the joint, in the rest pose. Let w be the way from the joint
/// point to the centroid of the body's other joint points (or to the `toward` point). Of a rod at a hinge, ball or universal
/// joint between two bodies without a `toward` point, w_a and w_b are replaced by ±(w_a/|w_a| − w_b/|w_b|), so that both
/// ends lie on one line. e2 = e3 × e1 always, and of a
///
/// - hinge: e3 the axis, e1 along w, normal to e3;
/// - ball: e1 along w, e3 world z (x where w is parallel to it), normal to e1;
/// - universal joint: e3 the first axis (or the second, [`Rod::second_axis`]), e1 normal to both on the side of w;
/// - slider: e2 the axis, e1 along w, normal to e2, so that e3 lies across the motion; w is that of the joint's
///   first body, whose frame serves every end.
///
/// An end in a body of the template's own takes the frame of the rod's other end (of the joint's first body where
/// that is an own one too). Origin: the joint's physical point (with its layer's offset).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RodEnd {
    /// The body it is clamped in.
    pub body: BodyId,
    /// Attachment point, Cartesian components on (e1, e2, e3), mm.
    pub position: ExprPoint,
    /// Hermite derivative dP/du, u in 0..1 from → to, components on (e1, e2, e3), mm.
    pub derivative: ExprPoint,
}

/// Cross-section; half widths, mm. `a` along m₁ (thin, normal to the axis), `b` along m₂ (the axis).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// Solid ellipse.
    Ellipse {
        /// Half the thickness.
        a: ExprId,
        /// Half the width.
        b: ExprId,
    },
    /// Solid rectangle.
    Rect {
        /// Half the thickness.
        a: ExprId,
        /// Half the width.
        b: ExprId,
    },
    /// Solid circle: a wire, whose centre line may run in any direction.
    Round {
        /// Radius.
        r: ExprId,
    },
}

impl Section {
    /// Half widths along m₁ and m₂.
    pub fn half_widths(&self) -> [ExprId; 2] {
        match *self {
            Self::Ellipse { a, b } | Self::Rect { a, b } => [a, b],
            Self::Round { r } => [r, r],
        }
    }
}

/// Steps and duration: states 0..=steps at t = state / steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cycle {
    /// Number of steps N.
    pub steps: usize,
    /// Duration of one cycle.
    pub duration_s: f64,
    /// Declaration.
    pub origin: Origin,
}

/// A traced point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// Name.
    pub name: String,
    /// Body that carries it.
    pub body: BodyId,
    /// Position in the drawing pose.
    pub point: ExprPoint,
    /// Declaration.
    pub origin: Origin,
}

/// A term of the objective.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Objective {
    /// What is minimised.
    pub kind: ObjectiveKind,
    /// Weight; the paper's default where the text is silent (1 where a scale is given).
    pub weight: f64,
    /// The term.
    pub origin: Origin,
}

/// What is minimised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectiveKind {
    /// Distance of a trace from its target (paper, eq. 3).
    Track {
        /// Index into [`Design::traces`].
        trace: usize,
        /// Length that counts as one; none: SI (1 m).
        scale_mm: Option<f64>,
    },
    /// Displacement of a trace under forces normal to its path (paper, eq. 4).
    Sway {
        /// Index into [`Design::traces`].
        trace: usize,
        /// Size of each force.
        force_n: f64,
        /// Length that counts as one; none: SI (1 m).
        scale_mm: Option<f64>,
    },
    /// Squared excess of von Mises stress over a bound.
    StressBelow {
        /// The bound.
        bound_mpa: f64,
        /// Stress that counts as one; none: SI (1 Pa).
        scale_mpa: Option<f64>,
    },
    /// Soft maximum of von Mises stress (paper, eq. 16, made monotone).
    Stress {
        /// Stress that counts as one; none: SI (1 Pa).
        scale_mpa: Option<f64>,
    },
    /// Links and flexures nearer to each other than a gap (paper, eq. 7), in m² of their lengths.
    Collision {
        /// The gap.
        gap_mm: f64,
    },
    /// Soft maximum of the squared torque (paper, eq. 6, made monotone).
    Torque {
        /// Index into [`Design::drives`].
        drive: usize,
        /// Torque that counts as one: the motor's stall torque, or the scale in the text.
        reference_n_mm: f64,
    },
    /// Tracking by form or with an emphasis of its own.
    TrackAs {
        /// Index into [`Design::traces`].
        trace: usize,
        /// Length that counts as one; none: SI (1 m).
        scale_mm: Option<f64>,
        /// Distance from the nearest place of the target, at whatever time; else from that of the same time.
        closest: bool,
        /// Weight of each time.
        emphasis: Option<Profile>,
    },
    /// Angle between a traced direction and its target.
    Aim {
        /// Index into [`Aims::directions`].
        direction: usize,
        /// Angle that counts as one; none: SI (1 rad).
        scale_rad: Option<f64>,
        /// Weight of each time.
        emphasis: Option<Profile>,
    },
    /// Displacement of a trace under one force of stated direction.
    SwayAlong {
        /// Index into [`Design::traces`].
        trace: usize,
        /// Size of the force.
        force_n: f64,
        /// Length that counts as one; none: SI (1 m).
        scale_mm: Option<f64>,
        /// Its unit direction in space; none: the in-plane normal of the conventional path.
        along: Option<[f64; 3]>,
    },
    /// The paper's soft maximum of the squared torque (eq. 6).
    PaperTorque {
        /// Index into [`Design::drives`].
        drive: usize,
        /// Torque that counts as one.
        reference_n_mm: f64,
    },
    /// The paper's soft maximum of von Mises stress (eq. 16).
    PaperStress {
        /// Stress that counts as one; none: SI (1 Pa).
        scale_mpa: Option<f64>,
    },
    /// As `Torque`, for the force of a drive that slides.
    Force {
        /// Index into [`Design::drives`].
        drive: usize,
        /// Force that counts as one: where the motor stalls, or the scale in the text.
        reference_n: f64,
    },
}

/// `require QUERY <= BOUND`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Requirement {
    /// Aggregate over the cycle.
    pub aggregate: Aggregate,
    /// What is measured.
    pub quantity: Quantity,
    /// True for `<=` and `<`, false for `>=` and `>`.
    pub at_most: bool,
    /// True for `<` and `>`.
    pub strict: bool,
    /// Bound in the quantity's unit.
    pub bound: f64,
    /// The line as written.
    pub text: String,
    /// Its place.
    pub origin: Origin,
}

/// How a quantity over the cycle becomes one number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aggregate {
    /// Largest.
    Max,
    /// Smallest.
    Min,
    /// Mean over the states (a closed cycle's last state counts once).
    Mean,
    /// Largest minus smallest.
    Span,
    /// At time t in 0..1.
    At(f64),
}

/// A measurable quantity of the solved mechanism.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Distance of a trace from its target, mm. Index into [`Design::traces`].
    Error(usize),
    /// True largest von Mises stress over all rods, MPa.
    Stress,
    /// Least gap of the printed solids, mm; negative where two overlap.
    Gap,
    /// Size of the drive's torque, N·mm. Index into [`Design::drives`].
    Torque(usize),
    /// Size of a sliding drive's force, N. Index into [`Design::drives`].
    Force(usize),
    /// Distance of a trace from the nearest place of its target, mm. Index into [`Design::traces`].
    ErrorClosest(usize),
    /// Angle between a traced direction and its target, rad. Index into [`Aims::directions`].
    AimError(usize),
    /// How far a body has turned, rad. Index into [`Aims::angles`].
    Angle(usize),
    /// Pull of a string, N, negative where it would have to push. Index into [`Design::drives`].
    Tension(usize),
    /// Factor by which all loads can grow before the mechanism buckles.
    Buckling,
}

/// Material data; what the text does not state is absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Name.
    pub name: String,
    /// Young's modulus, MPa.
    pub e_mpa: f64,
    /// Poisson's ratio.
    pub nu: f64,
    /// Density, g/mm³.
    pub density_g_mm3: Option<f64>,
    /// Strength, MPa.
    pub strength_mpa: Option<f64>,
    /// Yield stress, MPa.
    pub yield_mpa: Option<f64>,
    /// Design strain for a single bend.
    pub strain_once: Option<f64>,
    /// Design strain for repeated bending.
    pub strain_repeated: Option<f64>,
}

/// Printing process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Process {
    /// Name.
    pub name: String,
    /// Least wall or flexure thickness, mm.
    pub least_wall_mm: f64,
    /// Least clearance between moving parts, mm.
    pub clearance_mm: f64,
    /// How a part is put on the machine: of no influence on the design.
    #[serde(default)]
    pub machine: Machine,
}

/// What a process says of its machine, where it is stated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Height of a printed layer, mm.
    pub layer_mm: Option<f64>,
    /// Width of an extruded line, mm.
    pub line_mm: Option<f64>,
    /// Strength across the layers relative to that within them.
    pub across: Option<f64>,
    /// Largest angle of a face from the upright that is printed without support, rad.
    #[serde(default)]
    pub overhang_rad: Option<f64>,
    /// Room for parts: width, depth, height, mm.
    pub bed_mm: Option<[f64; 3]>,
}

/// Stacking of planar links along their common axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layers {
    /// Height of a link, mm.
    pub height_mm: f64,
    /// Distance of neighbouring layers: height + clearance, mm.
    pub pitch_mm: f64,
    /// Common unit axis of the planar links.
    pub axis: [f64; 3],
}

/// Motor data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motor {
    /// Name.
    pub name: String,
    /// Interface.
    pub interface: MotorInterface,
    /// Stall (holding) torque, N·mm.
    pub stall_n_mm: f64,
    /// Shaft diameter, mm.
    pub shaft_diameter_mm: Option<f64>,
    /// How it moves and is commanded: of no influence on the design.
    #[serde(default, skip_serializing_if = "MotorMotion::is_empty")]
    pub motion: MotorMotion,
}

/// How a motor is commanded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotorInterface {
    /// Step and direction pulses.
    Stepper {
        /// Full steps a turn.
        steps_per_turn: u32,
        /// Microsteps a full step, as set on the driver.
        microsteps: u32,
    },
    /// Pulse width.
    Pwm {
        /// Range of travel, rad.
        range_rad: f64,
    },
    /// Dynamixel bus.
    Dynamixel {
        /// Range of travel, rad.
        range_rad: f64,
    },
}

/// A file to emit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Export {
    /// What.
    pub kind: ExportKind,
    /// Its place.
    pub origin: Origin,
}

/// Kinds of export.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExportKind {
    /// One binary STL per printed part, as it lies on the bed.
    Stl,
    /// The same where the part is in the rest pose of the assembly.
    StlAssembled,
    /// One binary glTF of the whole, moving.
    Glb,
    /// One 3MF with all parts on the bed.
    ThreeMf,
    /// A print sheet.
    Sheet,
    /// A picture of the rest pose.
    Png,
    /// A drawing of the rest pose.
    Svg,
    /// One DXF per printed part: its outlines, for what is cut from plates.
    Dxf,
    /// A page that shows all of it.
    Report,
    /// Arduino sketch for one drive. Index into [`Design::drives`].
    Arduino(usize),
    /// Code or keyframes for these drives, all where none is named. Indices into [`Design::drives`].
    Code(CodeKind, Vec<usize>),
}

impl ExportKind {
    /// Whether it shows the printed parts.
    pub fn of_solids(&self) -> bool {
        !matches!(self, Self::Arduino(_) | Self::Code(..))
    }
}
