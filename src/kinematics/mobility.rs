//! Mobility by rank: freedoms = 6 · moving bodies − rank of the constraints at a generic pose. Counting joints
//! (Grübler, Kutzbach) fails for every planar loop in space and for Bennett's linkage; rank does not.

use super::idle::Idle;
use super::linear::{Rank, Rows, moved};
use super::mechanism::Mechanism;
use super::path::correct;
use crate::diagnostic::Diagnostic;
use crate::math::Pose;
use nalgebra::DVector;

/// How far the mechanism is nudged (drives, rad; or its free motions, scaled) to leave a pose that is special only as
/// drawn.
const NUDGE: f64 = 0.02;
/// A body takes part in a null motion when its share exceeds this part of the largest. Measured: shares of bodies
/// at rest stay below 1e-13.
const TAKES_PART: f64 = 1e-6;

/// The freedoms of a mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct Mobility {
    /// Bodies that are not ground.
    pub moving_bodies: usize,
    /// Independent motions with the drives released, idle ones not counted.
    pub freedoms: usize,
    /// Idle freedoms: turns of a body about the line of its joints that move nothing else.
    pub idle: Vec<Idle>,
    /// Number of drives.
    pub drives: usize,
    /// Scalar constraint equations.
    pub rows: usize,
    /// How many of them follow from the others.
    pub redundant: usize,
    /// Motions left when all drives are held: zero for a determined mechanism.
    pub undetermined: usize,
    /// Bodies that take part in those.
    pub loose_bodies: Vec<usize>,
}

impl Mobility {
    /// Mobility of a mechanism at a generic pose near the drawing.
    pub fn of(mechanism: &Mechanism) -> Self {
        let drives = mechanism.design.drives.len();
        let drawn = Ranks::at(mechanism, &mechanism.drawing);
        // Where the drives determine the motion, constraints and drives together have the largest rank there is.
        let determined = drawn.held.null.is_empty() && drawn.free.null.len() == drives;
        let best = if determined { drawn } else { drawn.or_generic(mechanism) };
        Self {
            moving_bodies: mechanism.moving_bodies(),
            freedoms: best.free.null.len(),
            idle: mechanism.idle.clone(),
            drives,
            rows: best.free.rows,
            redundant: best.free.rows - best.free.rank,
            undetermined: best.held.null.len(),
            loose_bodies: loose(mechanism, &best.held),
        }
    }

    /// What is wrong with it, if anything.
    pub fn diagnose(&self, mechanism: &Mechanism) -> Option<Diagnostic> {
        let design = mechanism.design;
        let counted = format!("mobility {}, drives {}", self.freedoms, self.drives);
        let at = design.drives.first().map_or(design.origin, |d| d.origin);
        let first_loose = self.loose_bodies.first().and_then(|b| design.bodies.get(*b));
        if self.undetermined > 0 {
            let names =
                names(self.loose_bodies.iter().filter_map(|b| design.bodies.get(*b)).map(|b| &b.name));
            let message = if self.freedoms > self.drives {
                format!("{counted}: with the drives held, {names} can still move")
            } else {
                format!("{counted}, but the drives do not determine the motion: {names} can still move")
            };
            let place = first_loose.map_or(at, |b| b.origin);
            let mut found = Diagnostic::error("E0502", message, place).label("still free to move");
            if self.drives > 0 {
                found = found.also(at, "driven here");
            }
            let missing = self.undetermined;
            return Some(found.help(format!(
                "drive {missing} more joint{}, or join the loose bodies to others",
                if missing == 1 { "" } else { "s" }
            )));
        }
        if self.freedoms < self.drives {
            let message = if self.freedoms == 0 {
                format!("{counted}: the joints leave no motion at all")
            } else {
                format!("{counted}: the drives work against each other")
            };
            return Some(Diagnostic::error("E0502", message, at).label("cannot be turned").help(
                "remove a drive, or a joint: a loop moves when its hinge axes are parallel or meet in one point",
            ));
        }
        None
    }

    /// Idle freedoms of conventional joints, worth knowing: flexures would remove them.
    pub fn advice(&self, mechanism: &Mechanism) -> Option<Diagnostic> {
        let design = mechanism.design;
        let conventional = |idle: &&Idle| idle.is_conventional(design);
        let loose: Vec<&Idle> = self.idle.iter().filter(conventional).collect();
        let first = design.bodies.get(loose.first()?.body)?;
        let all = names(loose.iter().filter_map(|i| design.bodies.get(i.body)).map(|b| &b.name));
        let verb = if loose.len() == 1 {
            "turns idly about the line of its"
        } else {
            "turn idly about the line of their"
        };
        Some(
            Diagnostic::advice("A0508", format!("{all} {verb} joints"), first.origin)
                .label("nothing else moves with it, and nothing holds it")
                .help("leave it so, or let a flexure or a universal joint hold one end"),
        )
    }
}

/// Ranks at one pose with the drives released and held.
struct Ranks {
    free: Rank,
    held: Rank,
}

impl Ranks {
    fn at(mechanism: &Mechanism, poses: &[Pose]) -> Self {
        let drive: Vec<f64> = mechanism.drives.iter().map(|d| d.value(poses, 0.0)).collect();
        let rows = Rows::at(mechanism, poses, &drive);
        Self { free: rows.rank(false), held: rows.rank(true) }
    }

    /// A pose that is special only as drawn (flat, folded, a dead point) has too small a rank: tries some nudged
    /// along the free motions and along the drives, and keeps the largest.
    fn or_generic(self, mechanism: &Mechanism) -> Self {
        let mut nudged = Vec::new();
        for sign in [NUDGE, -NUDGE] {
            // Unequal shares, so that two freedoms do not stay in a special relation.
            let share = |i: usize| sign / (1.0 + 0.37 * i as f64);
            let mut way = DVector::zeros(mechanism.unknowns());
            for (i, v) in self.free.null.iter().enumerate() {
                way += v * share(i);
            }
            nudged.extend(correct(mechanism, &moved(mechanism, &mechanism.drawing, &way), &[]));
            let drives = mechanism.drives.iter().enumerate();
            let drive: Vec<f64> = drives.map(|(i, d)| share(i) * mechanism.drive_scale(d)).collect();
            nudged.extend(correct(mechanism, &mechanism.drawing, &drive));
        }
        let others = nudged.iter().map(|at| Self::at(mechanism, &at.poses));
        others.fold(self, |best, other| {
            let larger = (other.free.rank, other.held.rank) > (best.free.rank, best.held.rank);
            if larger { other } else { best }
        })
    }
}

/// Bodies with a share in the null motions.
pub(super) fn loose(mechanism: &Mechanism, held: &Rank) -> Vec<usize> {
    let share =
        |column: &usize| held.null.iter().map(|v| v.rows(*column, 6).norm_squared()).sum::<f64>().sqrt();
    let shares: Vec<f64> = mechanism.column.iter().map(|c| c.as_ref().map_or(0.0, share)).collect();
    let largest = shares.iter().fold(0.0, |m, s| f64::max(m, *s));
    (0..shares.len()).filter(|i| shares[*i] > TAKES_PART * largest && largest > 0.0).collect()
}

/// `a`, `b` and `c`; of many the first five.
pub(super) fn names<'a>(all: impl Iterator<Item = &'a String>) -> String {
    const SHOWN: usize = 5;
    let mut quoted: Vec<String> = all.map(|n| format!("`{n}`")).collect();
    if quoted.len() > SHOWN + 1 {
        let more = quoted.len() - SHOWN;
        quoted.truncate(SHOWN);
        quoted.push(format!("{more} others"));
    }
    match quoted.pop() {
        Some(last) if !quoted.is_empty() => format!("{} and {last}", quoted.join(", ")),
        Some(last) => last,
        None => "nothing".into(),
    }
}
