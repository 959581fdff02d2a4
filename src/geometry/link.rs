//! A body's link: from skeleton points, stubs and eyes to a list of slots (physics.md "Geometry",
//! language.md "Layers").
//!
//! Sizes are nested on purpose: a boss is wider and higher than the bars that end in it, an eye than
//! its neck, so that no two faces coincide and the boolean kernel meets only clear crossings. What
//! is left (bars side by side under one boss) is kept apart by a small spread of heights.

use super::anchor::{Anchor, FlexureEnd, Follow, SizeBy};
use super::distance::nearer_than;
use super::fillet::Fillet;
use super::fitted::{FitFault, Pocket};
use super::mesh::Mesh;
use super::parts::{Bore, Eye, FLOOR_MM, FlexureSolid, GeometryError, PartsInput};
use super::plate::Prism;
use super::riser::Moving;
use super::skeleton::connect;
use super::slot::{Facets, Slot};
use super::solid::PlacedSolid;
use crate::diagnostic::Origin;
use nalgebra::Vector3;
use std::cell::OnceCell;

/// Half width of a bar as a part of the layer's height.
pub const BAR_PER_HEIGHT: f64 = 0.35;
/// Radius of a boss or plain eye beyond the bar's half width, mm.
pub(super) const BOSS_EXTRA_MM: f64 = 0.4;
/// How far the top of a boss stays below its layer's face, mm.
pub(super) const BOSS_BELOW_MM: f64 = 0.02;
/// How far the top of a bar stays below its layer's face, mm.
pub(super) const BAR_BELOW_MM: f64 = 0.25;
/// Largest spread of heights and widths that keeps like faces apart, mm.
pub(super) const SPREAD_MM: f64 = 0.08;
/// Half width of a stub, mm; more where a thick flexure needs it.
pub(super) const STUB_RADIUS_MM: f64 = 2.2;
/// Length of a stub in front of its boss, mm.
pub(super) const STUB_FREE_MM: f64 = 3.0;
/// How far a stub reaches over the attachment plane, mm: its round nose then holds the whole
/// thickness of a flexure at that plane on average.
pub(super) const STUB_OVER_MM: f64 = 0.05;
/// Least half height of a stub and of a neck, mm.
pub(super) const LEAST_HALF_MM: f64 = 0.1;
/// How far a stub stays below the rim of a flexure that fills its sub-layer, mm.
pub(super) const STUB_BELOW_MM: f64 = 0.06;
/// Rounding of edges, mm.
pub(super) const ROUND_MM: f64 = 0.8;
/// Rounding of a stub's edges, mm: small, so that the flexure's clamp is as wide as the flexure.
pub(super) const STUB_ROUND_MM: f64 = 0.5;
/// Wall round a bore, mm; the process's least wall if that is more.
pub(super) const BORE_WALL_MM: f64 = 2.0;
/// Kept beyond the clearance, so that rounding cannot eat it, mm.
pub(super) const CLEAR_MM: f64 = 0.01;
/// Next to its attachment a flexure may be nearer to its own link's bars than the clearance, mm.
const OWN_ROOT_MM: f64 = 2.0;
/// Sine of the angle by which axes and ends may differ in a body of layers: rounding of the rest pose.
pub(super) const FLAT: f64 = 1e-6;
/// Points nearer than this in plan are one node, mm.
pub(super) const SAME_NODE_MM: f64 = 1.0;

/// What a slot of a body is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Receives an end of the flexure with this index.
    Stub(usize),
    /// Joins bars at a node.
    Boss,
    /// Joins two nodes.
    Bar,
    /// A body's share of the conventional joint with this index.
    Eye(usize),
    /// Joins layers.
    Riser,
    /// Sleeve or bar of the conventional slider with this index.
    Guide(usize),
    /// Carries a motor.
    Mount,
    /// Covers the plate with this index; the plate is meshed in its place.
    Plate(usize),
}

/// A cylinder to be taken out of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoreCut {
    /// Joint it belongs to; none for a hole by itself.
    pub joint: Option<usize>,
    /// Lower end.
    pub start: Vector3<f64>,
    /// Upper end.
    pub end: Vector3<f64>,
    /// Diameter of the hole between opposite facets, mm.
    pub diameter_mm: f64,
}

impl BoreCut {
    /// The hole as a disc.
    pub fn slot(&self) -> Slot {
        let middle = (self.start + self.end) / 2.0;
        Slot {
            start: middle,
            end: middle,
            axis: (self.end - self.start).try_normalize(0.0).unwrap_or_else(Vector3::z),
            disc_radius_mm: self.diameter_mm / 2.0,
            half_height_mm: (self.end - self.start).norm() / 2.0,
            round_mm: 0.0,
        }
    }
}

/// A body as primitives in the rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyPlan {
    /// What is united.
    pub slots: Vec<(Role, Slot)>,
    /// What each slot follows when the flexures change.
    pub follows: Vec<Follow>,
    /// What is then cut out.
    pub bores: Vec<BoreCut>,
    /// Plates that it is made of.
    pub plates: Vec<Prism>,
    /// Where screwdrivers have to reach, each with the motor and its statement.
    pub access: Vec<(Slot, String, Origin)>,
    /// Meshes from files that are united with it.
    pub solids: Vec<PlacedSolid>,
    /// Boxes that are cut out as well.
    pub pockets: Vec<Pocket>,
    /// Motors that it carries: not printed, but what moves must keep clear of them.
    pub carried: Vec<Slot>,
    /// What is wrong with the seats of motors and horns.
    pub faults: Vec<FitFault>,
    /// What the maker should know.
    pub notes: Vec<String>,
}

impl BodyPlan {
    /// One closed mesh a slot, then one a solid; a plate's is that of its first slot, the others have none.
    pub fn meshes(&self, facets: &Facets) -> Vec<Mesh> {
        let mesh = |(i, (role, slot)): (usize, &(Role, Slot))| match role {
            Role::Plate(_) => self.prism(i).map_or_else(Mesh::default, |p| p.mesh(facets)),
            Role::Bar | Role::Stub(_) => {
                slot.mesh_with_hidden_ends(facets, spread(i), self.hidden_ends(slot))
            }
            _ => slot.mesh(facets, spread(i)),
        };
        self.slots.iter().enumerate().map(mesh).chain(self.solids.iter().map(PlacedSolid::mesh)).collect()
    }

    /// Which ends of a bar or stub lie wholly inside of what it leads to.
    fn hidden_ends(&self, bar: &Slot) -> [bool; 2] {
        let holds = |end: &Vector3<f64>| {
            let others = self
                .slots
                .iter()
                .filter(|(role, _)| !matches!(role, Role::Bar | Role::Stub(_) | Role::Plate(_)));
            others.map(|(_, s)| s).any(|s| s.holds_end(bar, end))
        };
        [&bar.start, &bar.end].map(holds)
    }

    /// One closed mesh a bore, and one a pocket. The facets of a bore touch the stated circle from outside, so that a pin of
    /// that diameter passes.
    pub fn bore_meshes(&self, facets: &Facets) -> Vec<Mesh> {
        let bores = self.bores.iter().enumerate().map(|(i, b)| {
            let n = ((facets.around / 4).max(2) * 4) as f64;
            let radius = b.diameter_mm / 2.0 / (std::f64::consts::PI / n).cos();
            Slot { disc_radius_mm: radius, ..b.slot() }.mesh(facets, spread(i + 100) + 0.5)
        });
        bores.chain(self.pockets.iter().map(Pocket::mesh)).collect()
    }
}

/// Half width of the stub of a flexure with half thickness `a_mm`.
pub(super) fn stub_radius(a_mm: f64, wall_mm: f64) -> f64 {
    STUB_RADIUS_MM.max(a_mm + wall_mm)
}

impl FlexureSolid {
    /// Where the centre of its stub's round nose stands beyond the attachment plane, mm.
    pub(super) fn nose_center_mm(&self, at_end: bool, radius_mm: f64) -> f64 {
        let fillet = &self.fillets[usize::from(at_end)];
        fillet.as_ref().map_or(radius_mm - STUB_OVER_MM, Fillet::nose_center_mm)
    }
}

/// Spread in 0..1 by the golden ratio: any two small indices get clearly different values.
pub(super) fn spread(i: usize) -> f64 {
    (i as f64 * 0.618_033_988_749_894_9 + 0.137).fract()
}

/// A place where something of the body ends.
pub(super) struct Node {
    /// At the body's own level, if it has one.
    pub(super) at: Vector3<f64>,
    /// Eye in the body's own layer, if any: bars then end in necks at its slot's height.
    pub(super) own_eye: Option<EyeShape>,
    /// What it follows.
    pub(super) anchor: Anchor,
}

/// Measures of an eye.
#[derive(Clone, Copy)]
pub(super) struct EyeShape {
    pub(super) center: Vector3<f64>,
    pub(super) radius: f64,
    pub(super) half_height: f64,
    /// Radius to be kept free for the other bodies at this joint.
    pub(super) keep_out: f64,
}

/// Shared state while one body is planned.
pub(super) struct Builder<'a> {
    pub(super) input: &'a PartsInput,
    pub(super) plan: BodyPlan,
    pub(super) nodes: Vec<Node>,
    /// Axis of the body's own layers; of no meaning for a body in space.
    pub(super) axis: Vector3<f64>,
    pub(super) level: f64,
    pub(super) index: usize,
    /// What moves beside the body, seen from it; found when first asked for.
    pub(super) moving: OnceCell<Moving>,
    /// What flexures' own bodies are made of; found when first asked for.
    pub(super) of_flexures: OnceCell<Vec<Slot>>,
    /// Places of eyes in other layers that cannot be reached straight.
    pub(super) risen: Vec<Vector3<f64>>,
}

/// Plans one body.
pub(crate) fn plan_body(input: &PartsInput, index: usize) -> Result<BodyPlan, GeometryError> {
    let Some(body) = input.bodies.get(index) else {
        return Err(GeometryError::Input(format!("there is no body {index}")));
    };
    let mut b = Builder {
        input,
        plan: BodyPlan { solids: body.solids.clone(), ..BodyPlan::default() },
        moving: OnceCell::new(),
        of_flexures: OnceCell::new(),
        risen: Vec::new(),
        nodes: Vec::new(),
        axis: body.axis.unwrap_or_else(Vector3::z),
        level: body.level_mm,
        index,
    };
    if body.axis.is_none_or(|axis| !lies_flat(input, index, &axis)) {
        b.plan_in_space(body)?;
        return Ok(b.plan);
    }
    for eye in &body.eyes {
        b.add_eye(eye, &body.name);
    }
    for (f, flexure) in input.flexures.iter().enumerate() {
        for (at_end, at_body) in [(false, flexure.bodies.0), (true, flexure.bodies.1)] {
            if at_body == index {
                b.add_stub(f, at_end)?;
            }
        }
    }
    for guide in &body.guides {
        b.add_guide(guide, false)?;
    }
    for hole in &body.holes {
        b.add_hole(hole);
    }
    for seat in &body.seats {
        b.add_seat(seat, body);
    }
    for mount in &body.mounts {
        let node = b.add_mount(mount, true);
        b.node(node, None, Anchor::Fixed);
    }
    for p in body.skeleton.iter().filter(|p| !b.is_risen(p)).copied().collect::<Vec<_>>() {
        b.node(p, None, Anchor::Fixed);
    }
    b.rise_beside();
    if b.nodes.is_empty() {
        return Err(GeometryError::NoSkeleton(body.name.clone()));
    }
    let carries_all = body.plate.as_ref().is_some_and(|p| b.add_plate(p, true));
    b.connect(&body.name, carries_all);
    b.check_mounts(body);
    Ok(b.plan)
}

/// Whether everything that ends in a body can be made in layers along an axis: eyes along it, leaves across it, no
/// rod that leaves along it.
fn lies_flat(input: &PartsInput, index: usize, axis: &Vector3<f64>) -> bool {
    let eyes = input.bodies[index].eyes.iter().all(|e| e.axis.cross(axis).norm() < FLAT);
    let flat = |f: &FlexureSolid, at_end: bool| {
        let wide = if at_end { f.m2.last() } else { f.m2.first() };
        let (a, b) = f.end_axes(at_end);
        let upright = a == b || wide.is_some_and(|m| m.cross(axis).norm() < FLAT);
        let off = (f.end_point(at_end) - f.joint_point).dot(axis).abs();
        upright && f.outward(at_end).dot(axis).abs() < FLAT && off + b <= input.height_mm / 2.0 + FLAT
    };
    let ends = |f: &FlexureSolid, body: usize, at_end: bool| body != index || flat(f, at_end);
    eyes && input.flexures.iter().all(|f| ends(f, f.bodies.0, false) && ends(f, f.bodies.1, true))
}

impl Builder<'_> {
    pub(super) fn axis(&self) -> Vector3<f64> {
        self.axis
    }

    pub(super) fn half(&self) -> f64 {
        self.input.height_mm / 2.0
    }

    pub(super) fn bar_radius(&self) -> f64 {
        self.input.height_mm * BAR_PER_HEIGHT
    }

    pub(super) fn boss_radius(&self) -> f64 {
        self.bar_radius() + BOSS_EXTRA_MM
    }

    /// A point moved along the axis to a level.
    pub(super) fn at_level(&self, p: &Vector3<f64>, level: f64) -> Vector3<f64> {
        p + self.axis() * (level - p.dot(&self.axis()))
    }

    /// Adds a slot that is where the conventional mechanism puts it.
    pub(super) fn push(&mut self, role: Role, slot: Slot) {
        self.push_following(role, slot, Follow::default());
    }

    pub(super) fn push_following(&mut self, role: Role, slot: Slot, follow: Follow) {
        self.plan.slots.push((role, slot));
        self.plan.follows.push(follow);
    }

    /// The node at a place in plan, made if there is none.
    pub(super) fn node(&mut self, p: Vector3<f64>, own_eye: Option<EyeShape>, anchor: Anchor) -> usize {
        let at = self.at_level(&p, self.level);
        if let Some(i) = self.nodes.iter().position(|n| (n.at - at).norm() < SAME_NODE_MM) {
            if self.nodes[i].own_eye.is_none() {
                self.nodes[i].own_eye = own_eye;
            }
            return i;
        }
        self.nodes.push(Node { at, own_eye, anchor });
        self.nodes.len() - 1
    }

    /// Measures of an eye: its share of the joint's layer, and the radius all of them need.
    pub(super) fn eye_shape(&self, eye: &Eye) -> EyeShape {
        let (k, n) = (eye.slot.0 as f64, eye.slot.1 as f64);
        let c = self.input.clearance_mm;
        let share = (self.input.height_mm - (n - 1.0) * c) / n;
        let middle = -self.half() + share / 2.0 + k * (share + c);
        let wall = BORE_WALL_MM.max(self.input.least_wall_mm);
        let radius_of =
            |bore: &Bore| self.boss_radius().max(bore.diameter_mm().map_or(0.0, |d| d / 2.0 + wall));
        let others = self.input.bodies.iter().flat_map(|b| &b.eyes).filter(|e| e.joint == eye.joint);
        EyeShape {
            center: eye.point + eye.axis * middle,
            radius: radius_of(&eye.bore),
            half_height: share / 2.0,
            keep_out: others.map(|e| radius_of(&e.bore)).fold(0.0, f64::max) + c + CLEAR_MM,
        }
    }

    fn add_eye(&mut self, eye: &Eye, name: &str) {
        let shape = self.eye_shape(eye);
        let (center, half) = (shape.center, shape.half_height - BOSS_BELOW_MM);
        let level = center.dot(&self.axis());
        if (eye.point.dot(&self.axis()) - self.level).abs() < 0.5 * self.input.height_mm {
            let slot = Slot::bar(center, center, self.axis(), shape.radius, half, ROUND_MM);
            self.push(Role::Eye(eye.joint), slot);
            self.node(eye.point, Some(shape), Anchor::Fixed);
        } else {
            let span = (level - half, level + half);
            let straight = self.column_slot(&eye.point, span, shape.radius);
            if self.meets_moving(&straight) {
                // Bars and stubs come first: the way round leads to them.
                self.risen.push(eye.point);
                let slot = Slot::bar(center, center, self.axis(), shape.radius, half, ROUND_MM);
                self.push(Role::Eye(eye.joint), slot);
            } else {
                self.column(Role::Eye(eye.joint), &eye.point, span, shape.radius, &Anchor::Fixed);
                self.node(eye.point, None, Anchor::Fixed);
            }
        }
        self.bore(eye, &shape, name);
    }

    pub(super) fn bore(&mut self, eye: &Eye, shape: &EyeShape, name: &str) {
        let axis = eye.axis;
        let c = self.input.clearance_mm;
        match eye.bore {
            Bore::Solid => self.plan.notes.push(format!(
                "`{name}`: no pin diameter is stated for the joint at ({:.1}, {:.1}) mm, so its eye has no hole.",
                eye.point.x, eye.point.y
            )),
            Bore::Blind { diameter_mm } => {
                // To the middle of the clearance where another eye follows, else to the floor.
                let reach = shape.half_height + c / 2.0;
                let middle = (shape.center - eye.point).dot(&axis);
                let low = if eye.slot.0 == 0 { FLOOR_MM - self.half() } else { middle - reach };
                let high = if eye.slot.0 + 1 == eye.slot.1 { self.half() - FLOOR_MM } else { middle + reach };
                let (start, end) = (eye.point + axis * low, eye.point + axis * high);
                self.plan.bores.push(BoreCut { joint: Some(eye.joint), start, end, diameter_mm });
                if eye.slot.0 == 0 {
                    let length = self.input.height_mm - 2.0 * FLOOR_MM - c;
                    self.plan.notes.push(format!(
                        "`{name}`: the pin at ({:.1}, {:.1}) mm drops into a hole of {diameter_mm:.2} mm; cut it {length:.1} mm long.",
                        eye.point.x, eye.point.y
                    ));
                }
            }
            Bore::Through { diameter_mm } => {
                // A body in space is passed within the joint's own stack.
                let layers = if self.input.bodies[self.index].axis.is_some() {
                    (eye.point.dot(&axis) - self.level).abs()
                } else {
                    0.0
                };
                let reach = layers + self.input.height_mm;
                let (start, end) = (eye.point - axis * reach, eye.point + axis * reach);
                self.plan.bores.push(BoreCut { joint: Some(eye.joint), start, end, diameter_mm });
            }
        }
    }

    fn add_stub(&mut self, index: usize, at_end: bool) -> Result<(), GeometryError> {
        let Some(flexure) = self.input.flexures.get(index) else { return Ok(()) };
        let axis = self.axis();
        let p = flexure.end_point(at_end);
        let outward = flexure.outward(at_end);
        let flat = outward - axis * outward.dot(&axis);
        let Some(flat) = flat.try_normalize(0.2) else {
            return Err(GeometryError::Input(format!(
                "`{}` leaves its link along the stacking axis",
                flexure.path
            )));
        };
        let (a, b) = flexure.end_axes(at_end);
        let wall = self.input.least_wall_mm;
        let radius = stub_radius(a, wall);
        // Room along the axis: the layer's faces, and the rims of other flexures of this joint.
        let middle = p.dot(&axis);
        let level = flexure.joint_point.dot(&axis);
        let (mut low, mut high) = (middle - b - wall, middle + b + wall);
        // Which of the two follow the flexure, and which are faces of the layer.
        let mut follows = [
            low >= level - self.half() || level - self.half() >= middle - b,
            high <= level + self.half() || level + self.half() <= middle + b,
        ];
        low = low.max(level - self.half()).min(middle - b);
        high = high.min(level + self.half()).max(middle + b);
        for other in self.input.flexures.iter().filter(|f| f.joint == flexure.joint && f.path != flexure.path)
        {
            let z = other.centreline.first().map_or(middle, |q| q.dot(&axis));
            if z < middle - 1e-6 {
                low = middle - b;
                follows[0] = true;
            } else if z > middle + 1e-6 {
                high = middle + b;
                follows[1] = true;
            }
        }
        let half_height =
            (high - low) / 2.0 - STUB_BELOW_MM - 0.5 * SPREAD_MM * spread(2 * index + usize::from(at_end));
        let center = self.at_level(&p, (low + high) / 2.0);
        let nose_mm = flexure.nose_center_mm(at_end, radius);
        let nose = center + flat * nose_mm;
        let root = center + flat * (STUB_FREE_MM + self.boss_radius());
        // The height of each face by the flexure, then of middle and half of the stub.
        let [lower, upper] = follows.map(|f| if f { 1.0 } else { 0.0 });
        let centred = SizeBy { level: 0.5 * (upper + lower), a: 0.0, b: 0.5 * (upper - lower) };
        let mut half_by = SizeBy { level: 0.5 * (upper - lower), a: 0.0, b: 0.5 * (upper + lower) };
        if half_height <= LEAST_HALF_MM {
            half_by = SizeBy::default();
        }
        let radius_by = SizeBy { a: f64::from(u8::from(a + wall > STUB_RADIUS_MM)), ..SizeBy::default() };
        let end = FlexureEnd { flexure: index, at_end, axis };
        let along =
            |along_mm: f64, along: SizeBy, level: SizeBy| Anchor::Stub { end, along_mm, along, level };
        let reach = STUB_FREE_MM + self.boss_radius();
        let nose_anchor = along(nose_mm, radius_by, centred);
        self.push_following(
            Role::Stub(index),
            Slot::bar(nose, root, axis, radius, half_height.max(LEAST_HALF_MM), STUB_ROUND_MM),
            Follow {
                ends: [nose_anchor, along(reach, SizeBy::default(), centred)],
                sized_by: Some(end),
                radius: radius_by,
                half_height: half_by,
                upright: None,
            },
        );
        let anchor = along(reach, SizeBy::default(), SizeBy::default());
        if (level - self.level).abs() < 0.5 * self.input.height_mm {
            self.boss(self.at_level(&root, self.level), self.boss_radius(), &anchor);
        } else {
            let half = self.half() - BOSS_BELOW_MM - SPREAD_MM * spread(self.plan.slots.len());
            let span = (level - half, level + half);
            let straight = self.column_slot(&root, span, self.boss_radius());
            let on_level = self.at_level(&root, level);
            let arm = |foot: &Vector3<f64>| {
                Slot::bar(on_level, *foot, axis, self.bar_radius(), half - BAR_BELOW_MM, ROUND_MM)
            };
            let foot = if self.meets_moving(&straight) {
                self.foot(&on_level, span, self.bar_radius(), arm)
            } else {
                None
            };
            if let Some(foot) = foot {
                // It stays where it is beside the stub.
                let (arm, radius) = (arm(&foot), self.bar_radius());
                let boss = Slot::bar(on_level, on_level, axis, self.boss_radius(), half, ROUND_MM);
                self.push_following(Role::Boss, boss, Follow::point(&anchor));
                self.push_following(Role::Bar, arm, Follow::point(&anchor));
                self.column(Role::Riser, &foot, span, radius + 0.5 * BOSS_EXTRA_MM, &anchor);
                self.node(foot, None, anchor);
                return Ok(());
            }
            self.column(Role::Riser, &root, span, self.boss_radius(), &anchor);
        }
        self.node(root, None, anchor);
        Ok(())
    }

    /// A full-height disc, unless something as wide stands there already.
    pub(super) fn boss(&mut self, at: Vector3<f64>, radius: f64, anchor: &Anchor) {
        let half = self.half() - BOSS_BELOW_MM - SPREAD_MM * spread(self.plan.slots.len());
        let axis = self.axis();
        let taken = self.plan.slots.iter().any(|(role, s)| {
            let off = at - s.start;
            let reach = s.half_height_mm + s.round_mm + SPREAD_MM;
            !matches!(role, Role::Stub(_) | Role::Bar)
                && (off - axis * off.dot(&axis)).norm() < SAME_NODE_MM
                && off.dot(&axis).abs() + half <= reach
                && s.radius_mm() >= radius - SPREAD_MM
        });
        if !taken {
            let slot = Slot::bar(at, at, axis, radius, half, ROUND_MM);
            self.push_following(Role::Boss, slot, Follow::point(anchor));
        }
    }

    /// One upright cylinder from the body's own layer through `span` (levels) in another layer: a
    /// riser without steps.
    pub(super) fn column(
        &mut self,
        role: Role,
        at: &Vector3<f64>,
        span: (f64, f64),
        radius: f64,
        anchor: &Anchor,
    ) {
        let slot = self.column_slot(at, span, radius);
        self.push_following(role, slot, Follow::point(anchor));
    }

    pub(super) fn column_slot(&self, at: &Vector3<f64>, span: (f64, f64), radius: f64) -> Slot {
        let half = self.half() - BOSS_BELOW_MM - SPREAD_MM * spread(self.plan.slots.len());
        let (low, high) = (span.0.min(self.level - half), span.1.max(self.level + half));
        let middle = self.at_level(at, (low + high) / 2.0);
        Slot::bar(middle, middle, self.axis(), radius, (high - low) / 2.0, ROUND_MM)
    }

    /// Bars between the nodes, in the body's own layer; none where a plate joins them.
    fn connect(&mut self, name: &str, on_plate: bool) {
        for i in 0..self.nodes.len() {
            let (at, is_eye) = (self.nodes[i].at, self.nodes[i].own_eye.is_some());
            if !is_eye {
                let anchor = self.nodes[i].anchor.clone();
                self.boss(at, self.boss_radius(), &anchor);
            }
        }
        if on_plate {
            return;
        }
        let points: Vec<Vector3<f64>> = self.nodes.iter().map(|n| n.at).collect();
        let net = connect(&points, |p, q| self.blocked(p, q));
        if let Some(hub) = net.hub {
            let nodes = self.nodes.iter().map(|n| (n.at, n.anchor.clone())).collect();
            let anchor = Anchor::Hub { nodes, at: hub };
            self.boss(hub, self.boss_radius(), &anchor);
            self.nodes.push(Node { at: hub, own_eye: None, anchor });
        }
        for (i, j) in net.edges {
            self.bar(i, j, name);
        }
    }

    /// The same for a bar in the body's own layer.
    fn blocked(&self, p: &Vector3<f64>, q: &Vector3<f64>) -> bool {
        let half = self.half() - BAR_BELOW_MM;
        let bar = Slot::bar(*p, *q, self.axis(), self.bar_radius(), half, ROUND_MM);
        self.hits(&bar) || self.in_guide(&bar, false)
    }

    /// Whether a bar would run into a flexure, its own ones included, or into another body's stub.
    pub(super) fn hits(&self, bar: &Slot) -> bool {
        let hits = |s: &Slot| nearer_than(bar, s, self.input.clearance_mm);
        self.input.flexures.iter().any(|f| {
            let own = |at_end: bool| self.index == if at_end { f.bodies.1 } else { f.bodies.0 };
            let free = |s: &Slot| {
                [false, true].iter().all(|e| !own(*e) || (s.start - f.end_point(*e)).norm() > OWN_ROOT_MM)
            };
            f.slots().iter().filter(|s| free(s)).any(hits)
                || [false, true].iter().filter(|e| !own(**e)).any(|e| {
                    let (at, out) = (f.end_point(*e), f.outward(*e));
                    let reach = STUB_FREE_MM + self.boss_radius();
                    hits(&Slot::capsule(at, at + out * reach, STUB_RADIUS_MM.max(f.end_axes(*e).0)))
                })
        })
    }

    fn bar(&mut self, i: usize, j: usize, name: &str) {
        let axis = self.axis();
        let index = self.plan.slots.len();
        let radius = self.bar_radius() - SPREAD_MM * spread(index);
        let half = self.half() - BAR_BELOW_MM - SPREAD_MM * spread(index);
        let (p, q) = (self.nodes[i].at, self.nodes[j].at);
        let length = (q - p).norm();
        let Some(along) = (q - p).try_normalize(1e-9) else { return };
        let eyes = (self.nodes[i].own_eye, self.nodes[j].own_eye);
        // The nose of the full-height piece stops short of the other bodies' eyes.
        let trim = |eye: &Option<EyeShape>| eye.map_or(0.0, |e| e.keep_out + radius);
        let (from, to) = (trim(&eyes.0), length - trim(&eyes.1));
        let ends = [(p, self.nodes[i].anchor.clone()), (q, self.nodes[j].anchor.clone())];
        if eyes.0.is_none() && eyes.1.is_none() {
            let follow = Follow::bar(ends.map(|e| e.1));
            self.push_following(Role::Bar, Slot::bar(p, q, axis, radius, half, ROUND_MM), follow);
            return;
        }
        if to - from < 0.0 {
            self.plan.notes.push(format!("`{name}`: two eyes stand too close for a bar between them."));
        }
        let towards = |k: usize, along_mm: f64| Anchor::Toward {
            nodes: Box::new([ends[k].clone(), ends[1 - k].clone()]),
            along_mm,
        };
        // Where they are too close, both ends are that of the second eye.
        let last = towards(1, length - to);
        let first = if from <= to { towards(0, from) } else { towards(1, (length - to).min(length)) };
        let anchors = [first, last];
        let (from, to) = (from.min(to).max(0.0), to.max(from.min(to)));
        let (start, end) = (p + along * from, p + along * to);
        let middle = (start + end) / 2.0;
        let halfway = Anchor::Middle(Box::new(anchors.clone()));
        self.push_following(
            Role::Bar,
            Slot::bar(start, end, axis, radius, half, ROUND_MM),
            Follow::bar(anchors),
        );
        for eye in [eyes.0, eyes.1].into_iter().flatten() {
            let level = eye.center.dot(&axis);
            let neck = eye.half_height - BAR_BELOW_MM - SPREAD_MM * spread(self.plan.slots.len());
            let inner = self.at_level(&middle, level);
            let slot = Slot::bar(eye.center, inner, axis, radius - 0.3, neck.max(LEAST_HALF_MM), ROUND_MM);
            self.push_following(Role::Bar, slot, Follow::bar([Anchor::Fixed, halfway.clone()]));
        }
    }
}
