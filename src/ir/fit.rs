//! What is fitted to bodies when a printed part becomes a machine: motors, their horns, and plates.

use super::{AddedSolid, ExprPoint, JointId, Origin};
use serde::{Deserialize, Serialize};

/// What is fitted to a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fittings {
    /// Motors that it carries.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mounts: Vec<Mount>,
    /// Horns of motors that turn it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub horns: Vec<Horn>,
    /// It is made as a plate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plate: Option<LinkPlate>,
    /// Meshes from files that are part of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub solids: Vec<AddedSolid>,
}

impl Fittings {
    /// Whether nothing is fitted.
    pub fn is_empty(&self) -> bool {
        self.mounts.is_empty() && self.horns.is_empty() && self.plate.is_none() && self.solids.is_empty()
    }
}

/// The outside of a motor, as far as its record states it. The shaft points upwards; lengths in mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotorBody {
    /// Name of the motor.
    pub name: String,
    /// Length, width (both across the shaft) and height of the box around it.
    pub size_mm: [f64; 3],
    /// From the nearer end of its length to the axis of the shaft.
    pub end_mm: f64,
    /// Screws that hold it; none: their places are not stated.
    pub screws: Option<MotorScrews>,
    /// What stands out of its mounting face round the shaft: diameter, and how far where that is stated.
    pub pilot_mm: Option<(f64, Option<f64>)>,
    /// Diameter of a plain shaft.
    pub shaft_mm: Option<f64>,
}

/// Screws of a motor: two on the middle line of its length, or four. Their pattern lies in the middle of the box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotorScrews {
    /// Distance along the length, mm; more than the length: they go through flanges.
    pub pitch_mm: f64,
    /// Distance across, mm; zero: two screws on the middle line.
    pub across_mm: f64,
    /// Diameter of the screw, mm.
    pub diameter_mm: f64,
}

impl MotorScrews {
    /// How many.
    pub fn count(&self) -> usize {
        if self.across_mm > 0.0 { 4 } else { 2 }
    }
}

impl MotorBody {
    /// Whether its screws go through flanges beside the box, so that the box goes through what carries it.
    pub fn has_flanges(&self) -> bool {
        self.screws.is_some_and(|s| s.pitch_mm > self.size_mm[0])
    }
}

/// A motor on a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mount {
    /// The motor.
    pub motor: MotorBody,
    /// A point of the shaft's axis, drawing pose.
    pub position: ExprPoint,
    /// Unit direction in which the shaft points; none: that of the joint, towards its other body.
    pub along: Option<[f64; 3]>,
    /// The joint that the motor turns, a conventional hinge of this body. The motor's bearing takes its place.
    pub joint: Option<JointId>,
    /// Towards where the longer part of the box points, seen from the shaft, drawing pose.
    pub toward: Option<ExprPoint>,
    /// Thickness of the seat, mm; none: as its kind wants.
    pub thick_mm: Option<f64>,
    /// Room on every side, mm; none: the process's clearance.
    pub clearance_mm: Option<f64>,
    /// Statement.
    pub origin: Origin,
}

/// Thickness of a seat where none is stated, mm: a screw a little longer is easily bought.
const SEAT_MM: f64 = 4.0;

impl Mount {
    /// Thickness of the seat between links of a height, mm: walls round a motor without screws are as high as these.
    pub fn thickness_mm(&self, height_mm: f64) -> f64 {
        let usual = if self.motor.screws.is_none() { height_mm } else { SEAT_MM.min(height_mm) };
        self.thick_mm.unwrap_or(usual)
    }
}

/// The form of a motor's horn, or of its toothed shaft; lengths in mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HornForm {
    /// Name of the motor.
    pub name: String,
    /// Diameter of a round horn.
    pub diameter_mm: Option<f64>,
    /// Outer diameter of the toothed shaft.
    pub spline_mm: Option<f64>,
    /// Screws: how many, diameter of their circle, diameter of each.
    pub screws: Option<(usize, f64, f64)>,
}

/// The seat of a horn on a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Horn {
    /// The horn.
    pub form: HornForm,
    /// The joint that the motor turns, a conventional hinge of this body.
    pub joint: JointId,
    /// Depth of the recess, mm.
    pub deep_mm: f64,
    /// Room on every side, mm; none: the process's clearance.
    pub clearance_mm: Option<f64>,
    /// Statement.
    pub origin: Origin,
}

/// A body made as a plate round everything that it carries in its layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkPlate {
    /// Thickness, mm.
    pub thick_mm: f64,
    /// How far it reaches beyond what it carries, mm; none: as a bar would.
    pub margin_mm: Option<f64>,
    /// Statement.
    pub origin: Origin,
}
