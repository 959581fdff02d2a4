//! An [`Assembly`] is what a file builds: designs, and where instances of them stand. A single mechanism is an
//! assembly of one instance without a name, where it was drawn.

use super::expr::{ExprGraph, Node};
use super::{
    BodyId, Design, Drive, Export, ExprPoint, Fittings, Hole, Horn, JointId, JointKind, Mount, Origin,
    Profile, Requirement,
};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Designs and their instances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Assembly {
    /// Name of the mechanism that places the others.
    pub name: String,
    /// What is solved, each once. A mechanism as it is written is called after itself, one that is scaled or
    /// driven the other way after its first instance.
    pub designs: Vec<Design>,
    /// Placed designs, in the order of the text; a mirror image stands after its original.
    pub instances: Vec<Instance>,
    /// Bodies of several instances that are one.
    pub joined: Vec<Joined>,
    /// Motors: drives that instances have in common are one.
    pub motors: Vec<InstanceDrive>,
    /// Acceptance tests of the whole; those of the designs stand in them.
    pub requirements: Vec<AssemblyRequirement>,
    /// Files to emit.
    pub exports: Vec<AssemblyExport>,
    /// Places of what is fitted to joined bodies.
    #[serde(default)]
    pub exprs: ExprGraph,
    /// The free variables in [`Assembly::exprs`]: places at points of instances move with what is optimised there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub free: Vec<DesignFree>,
    /// The declaration.
    pub origin: Origin,
}

/// A placed design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instance {
    /// Name; empty for a mechanism that is built by itself.
    pub name: String,
    /// Index into [`Assembly::designs`].
    pub design: usize,
    /// From the design's coordinates to those of the assembly.
    pub placement: Placement,
    /// In which of the design's states it is at each state of the assembly; empty: in the same ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<usize>,
    /// One a drive of the design.
    pub drives: Vec<PlacedDrive>,
    /// Declaration.
    pub origin: Origin,
}

/// A drive of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlacedDrive {
    /// Index into [`Assembly::motors`].
    pub motor: usize,
    /// The motor's value is this (1 or −1) times the design's, and likewise its torque or force.
    pub sign: f64,
}

/// A free variable by its design.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DesignFree {
    /// Index into [`Assembly::designs`].
    pub design: usize,
    /// Index into its free variables.
    pub free: usize,
}

/// Values of [`Assembly::exprs`].
#[derive(Clone, Debug)]
pub struct Places(Vec<f64>);

/// A conventional hinge of an instance, and one of its bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InstanceHinge {
    /// Index into [`Assembly::instances`].
    pub instance: usize,
    /// The joint, in the instance's design.
    pub joint: JointId,
    /// The body, likewise.
    pub body: BodyId,
}

/// What stands on hinges of instances, written beside them: it is there once, in the place of all of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hinged {
    /// That of the instance that is named, and those that lie in the same place.
    pub hinges: Vec<InstanceHinge>,
    /// What.
    pub fitting: HingeFitting,
}

/// A motor or its horn; a [`JointId`] in it is that of the first hinge, a place one of [`Assembly::exprs`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HingeFitting {
    /// A motor on its hinge.
    Mount(Mount),
    /// The seat of a horn.
    Horn(Horn),
}

/// A drive by its instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InstanceDrive {
    /// Index into [`Assembly::instances`].
    pub instance: usize,
    /// Index into the drives of its design.
    pub drive: usize,
}

/// A body that several instances have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joined {
    /// Name: the body's that grounds are merged into, or of the first instance's body (`right_arm`).
    pub name: String,
    /// Instance and body.
    pub members: Vec<(usize, BodyId)>,
    /// What the body itself reaches in the assembly, places in [`Assembly::exprs`]: joined by bars, beside the members' own
    /// shapes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skeleton: Vec<ExprPoint>,
    /// Holes that it has in the assembly, their places in [`Assembly::exprs`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Hole>,
    /// Motors and meshes that it carries in the assembly, likewise.
    #[serde(default, skip_serializing_if = "Fittings::is_empty")]
    pub fittings: Fittings,
    /// Motors and horns on hinges of its members.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hinged: Vec<Hinged>,
    /// The first statement that joins them.
    pub origin: Origin,
}

/// A requirement on one instance, or on all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AssemblyRequirement {
    /// Index into [`Assembly::instances`]; none: the worst of all.
    pub instance: Option<usize>,
    /// Its indices count in the instance's design.
    pub requirement: Requirement,
}

/// An export of the whole, or of one instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AssemblyExport {
    /// Index into [`Assembly::instances`]; none: of the whole.
    pub instance: Option<usize>,
    /// Its indices count in the instance's design.
    pub export: Export,
    /// Of motor code for drives of several instances, their motors in the order written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motors: Vec<usize>,
}

/// x = rotation · X + translation; the rotation is improper for a mirror image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Orthogonal, in rows.
    pub rotation: [[f64; 3]; 3],
    /// mm.
    pub translation: [f64; 3],
}

impl Placement {
    /// Where it was drawn.
    pub const IDENTITY: Self =
        Self { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// A rotation and then a translation (mm).
    pub fn new(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> Self {
        let row = |i: usize| [0, 1, 2].map(|j| rotation[(i, j)]);
        Self { rotation: [row(0), row(1), row(2)], translation: (*translation).into() }
    }

    /// The rotation as a matrix.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.rotation.get(i).and_then(|r| r.get(j)).copied().unwrap_or(f64::NAN))
    }

    /// The image of this placement in the plane through the origin that is normal to axis 0, 1 or 2.
    pub fn mirrored(&self, axis: usize) -> Self {
        let mut out = *self;
        if let (Some(row), Some(t)) = (out.rotation.get_mut(axis), out.translation.get_mut(axis)) {
            *row = row.map(|x| -x);
            *t = -*t;
        }
        out
    }

    /// Whether it is a mirror image.
    pub fn is_mirrored(&self) -> bool {
        self.matrix().determinant() < 0.0
    }

    /// A point of the design, in the assembly, mm.
    pub fn point(&self, p: &Vector3<f64>) -> Vector3<f64> {
        if *self == Self::IDENTITY { *p } else { self.matrix() * p + Vector3::from(self.translation) }
    }

    /// A direction of the design, in the assembly.
    pub fn direction(&self, d: &Vector3<f64>) -> Vector3<f64> {
        if *self == Self::IDENTITY { *d } else { self.matrix() * d }
    }

    /// A point of the assembly, in the design's coordinates, mm.
    pub fn point_within(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.direction_within(&(p - Vector3::from(self.translation)))
    }

    /// A direction of the assembly, in the design's coordinates.
    pub fn direction_within(&self, d: &Vector3<f64>) -> Vector3<f64> {
        self.matrix().transpose() * d
    }

    /// A rotation vector of the design, in the assembly, rad: a mirror turns the sense of rotations.
    pub fn turn(&self, r: &Vector3<f64>) -> Vector3<f64> {
        self.direction(r) * self.handedness()
    }

    /// 1, or −1 for a mirror image.
    pub fn handedness(&self) -> f64 {
        if self.is_mirrored() { -1.0 } else { 1.0 }
    }

    /// Value of a placed drive about (or along) the image of its axis, right-handed, relative to the design's.
    pub fn sense(&self, kind: JointKind) -> f64 {
        if kind == JointKind::Slider { 1.0 } else { self.handedness() }
    }
}

impl Places {
    /// A place, mm.
    pub fn at(&self, p: ExprPoint) -> Vector3<f64> {
        Vector3::from(p.map(|id| self.0.get(id.0 as usize).copied().unwrap_or(f64::NAN)))
    }
}

impl Instance {
    /// The design's state at a state of the assembly.
    pub fn state(&self, state: usize) -> usize {
        self.states.get(state).copied().unwrap_or(state)
    }

    /// `INSTANCE.NAME`, or the name itself where the instance has none.
    pub fn of(&self, name: &str) -> String {
        if self.name.is_empty() { name.into() } else { format!("{}.{name}", self.name) }
    }
}

impl Hinged {
    /// Its statement.
    pub fn origin(&self) -> Origin {
        match &self.fitting {
            HingeFitting::Mount(m) => m.origin,
            HingeFitting::Horn(h) => h.origin,
        }
    }
}

impl Joined {
    /// Whether it has something of its own that stands in no member, besides what its members are.
    pub fn has_own(&self) -> bool {
        !(self.skeleton.is_empty() && self.holes.is_empty() && self.fittings.is_empty())
    }
}

impl Assembly {
    /// All places of what is fitted to joined bodies, where designs have these values; of a design without, where they start.
    pub fn places<'v>(&self, values: impl Fn(usize) -> Option<&'v [f64]>) -> Places {
        let start = |f: &DesignFree| self.designs.get(f.design)?.free.get(f.free).map(|v| v.start);
        let value = |f: &DesignFree| match values(f.design) {
            Some(values) => values.get(f.free).copied(),
            None => start(f),
        };
        let free: Vec<f64> = self.free.iter().map(|f| value(f).unwrap_or(f64::NAN)).collect();
        Places(self.exprs.values(&free))
    }

    /// What stands on hinges of an instance.
    pub fn hinged(&self, instance: usize) -> impl Iterator<Item = &Hinged> {
        let of = move |h: &&Hinged| h.hinges.iter().any(|h| h.instance == instance);
        self.joined.iter().flat_map(|j| &j.hinged).filter(of)
    }

    /// A mechanism by itself.
    pub fn of(design: Design) -> Self {
        let motors = (0..design.drives.len()).map(|drive| InstanceDrive { instance: 0, drive }).collect();
        let export = |e: &Export| AssemblyExport { instance: Some(0), export: e.clone(), motors: Vec::new() };
        Self {
            name: design.name.clone(),
            instances: vec![Instance {
                name: String::new(),
                design: 0,
                placement: Placement::IDENTITY,
                states: Vec::new(),
                drives: (0..design.drives.len()).map(|motor| PlacedDrive { motor, sign: 1.0 }).collect(),
                origin: design.origin,
            }],
            joined: Vec::new(),
            motors,
            requirements: Vec::new(),
            exprs: ExprGraph::default(),
            free: Vec::new(),
            exports: design.exports.iter().map(export).collect(),
            origin: design.origin,
            designs: vec![design],
        }
    }

    /// The design of a file that holds one mechanism and places none.
    pub fn single(&self) -> Option<&Design> {
        let alone = self.instances.first().is_some_and(|i| i.name.is_empty());
        self.designs.first().filter(|_| alone)
    }

    /// An instance with its design.
    pub fn placed(&self) -> impl Iterator<Item = (&Instance, &Design)> {
        self.instances.iter().filter_map(|i| Some((i, self.designs.get(i.design)?)))
    }

    /// The members of the motor with this index: instance, drive and sign.
    pub fn members(&self, motor: usize) -> impl Iterator<Item = (usize, usize, f64)> {
        self.instances.iter().enumerate().flat_map(move |(i, instance)| {
            let drives = instance.drives.iter().enumerate();
            drives.filter(move |(_, d)| d.motor == motor).map(move |(k, d)| (i, k, d.sign))
        })
    }
}

impl Drive {
    /// Turns the drive the other way; `exprs` is its design's graph.
    pub fn reverse(&mut self, exprs: &mut ExprGraph) {
        self.profile = self.profile.reversed();
        self.rest = -self.rest;
        self.free_rest = self.free_rest.map(|id| exprs.push(Node::Neg(id)));
    }
}

impl Profile {
    /// The same the other way round.
    pub fn reversed(&self) -> Self {
        match self {
            Profile::Range { from, to } => Profile::Range { from: -from, to: -to },
            Profile::Expression { graph, value } => {
                let mut graph = graph.clone();
                let value = graph.push(Node::Neg(*value));
                Profile::Expression { graph, value }
            }
            Profile::Keys { smooth, keys, closed } => Profile::Keys {
                smooth: *smooth,
                keys: keys.iter().map(|(t, v)| (*t, -v)).collect(),
                closed: *closed,
            },
        }
    }
}
