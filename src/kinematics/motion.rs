//! Motion of the conventional mechanism over the cycle of its drives: poses, joint angles and traces at every
//! state, the rest pose, and the findings of a designer's first look (does it close, what turns fully).

use super::idle::unturn;
use super::mechanism::Mechanism;
use super::mobility::{Mobility, names};
use super::path::{Branch, Sample, Stuck};
use super::standing;
use crate::diagnostic::Diagnostic;
use crate::ir::{BodyId, Design, DriveOn, DriveUnit, JointId, JointKind};
use crate::math::Pose;
use nalgebra::Vector3;

/// A joint that turns this far, rad (330°), counts as turning fully: no flexure bends a turn, and the last 30° make
/// no difference to that.
const FULL_TURN_RAD: f64 = 330.0 / 180.0 * std::f64::consts::PI;
/// A closed cycle returns when no pose differs by more, in lengths L and radians. A closed one agrees to 1e-11.
const RETURNED: f64 = 1e-6;
/// Joints whose rate is above this part of the largest belong to the loop that breaks.
const BREAKING: f64 = 0.1;

/// The mechanism at one value of its drives.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Drive values, relative to the drawing pose, rad or mm.
    pub drives: Vec<f64>,
    /// Pose of every body relative to the drawing pose.
    pub poses: Vec<Pose>,
    /// Value of every joint (second body relative to the first), relative to the drawing pose and unwrapped: rad, for
    /// sliders mm; zero for joints without one value (balls, universal and fixed joints).
    pub joint_values: Vec<f64>,
    /// Position of every trace, mm.
    pub traces_mm: Vec<Vector3<f64>>,
    /// How far every body whose angle is asked for has turned from the drawing pose, unwrapped, rad.
    pub angles_rad: Vec<f64>,
}

/// Solved motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Freedoms, redundant constraints.
    pub mobility: Mobility,
    /// Physical point of every joint in the drawing pose (with its layer's offset), mm.
    pub joint_points: Vec<Vector3<f64>>,
    /// The rest pose: every drive at its `rest`.
    pub rest: State,
    /// States 0..=N of the cycle.
    pub states: Vec<State>,
    /// Findings that do not stop the work.
    pub warnings: Vec<Diagnostic>,
}

/// Largest turn of a compliant joint away from the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpan {
    /// The joint.
    pub joint: JointId,
    /// Largest |angle − angle at rest| over the cycle, rad.
    pub from_rest_rad: f64,
    /// Largest angle minus smallest over the cycle and the rest pose, rad.
    pub span_rad: f64,
}

impl Motion {
    /// A point of a body, given in drawing coordinates, in the rest pose, mm.
    pub fn rest_point(&self, body: BodyId, drawn: &Vector3<f64>) -> Vector3<f64> {
        self.rest.poses[body].point(drawn)
    }

    /// A direction carried by a body, given as drawn, in the rest pose.
    pub fn rest_direction(&self, body: BodyId, drawn: &Vector3<f64>) -> Vector3<f64> {
        self.rest.poses[body].direction(drawn)
    }

    /// Path of a trace over the states, mm.
    pub fn trace_path(&self, trace: usize) -> Vec<Vector3<f64>> {
        self.states.iter().filter_map(|s| s.traces_mm.get(trace).copied()).collect()
    }

    /// How far a joint turns.
    pub fn span(&self, joint: JointId) -> JointSpan {
        let at = |state: &State| state.joint_values.get(joint).copied().unwrap_or(0.0);
        let rest = at(&self.rest);
        let (mut low, mut high) = (rest, rest);
        for angle in self.states.iter().map(at) {
            low = low.min(angle);
            high = high.max(angle);
        }
        JointSpan { joint, from_rest_rad: (high - rest).max(rest - low), span_rad: high - low }
    }

    /// How far each compliant joint has to turn, in the order of the joints.
    pub fn compliant_spans(&self, design: &Design) -> Vec<JointSpan> {
        let compliant = design.joints.iter().enumerate().filter(|(_, j)| j.is_compliant());
        compliant.map(|(id, _)| self.span(id)).collect()
    }
}

/// Solves the conventional motion of a design at the free variables `p`: drawing pose, mobility, rest pose, and the
/// states of the cycle.
///
/// # Errors
/// What makes the mechanism impossible, each at the place that asked for it: E0500 and E0501 malformed, E0502
/// mobility, E0503 cannot be assembled over the drives' range, E0504 a compliant joint that turns fully, E0505
/// drawn at a dead point.
pub fn solve_motion(design: &Design, p: &[f64]) -> Result<Motion, Vec<Diagnostic>> {
    let mechanism = Mechanism::new(design, p)?;
    let mobility = Mobility::of(&mechanism);
    if !design.is_driven() && design.all_loads().next().is_some() {
        return standing(&mechanism, mobility);
    }
    if let Some(found) = mobility.diagnose(&mechanism) {
        return Err(vec![found]);
    }
    let steps = design.cycle.steps;
    let drives = |t: f64| design.drives.iter().map(|d| d.value(t)).collect::<Vec<f64>>();
    let targets = (0..=steps).map(|i| drives(i as f64 / steps as f64));
    let (Some(mut to_rest), Some(mut cycle)) =
        (Branch::from_drawing(&mechanism), Branch::from_drawing(&mechanism))
    else {
        return Err(vec![drawn_at_dead_point(design)]);
    };
    let values = design.exprs.values(p);
    let rest: Vec<f64> = design.drives.iter().map(|d| d.rest_value(&values)).collect();
    let mut rest = to_rest.advance(&rest).map_err(|stuck| vec![cannot_close(design, &stuck, Some(&rest))])?;
    if let Some(poses) = unturn(&mechanism, &rest.poses, &rest.drive) {
        rest.poses = poses;
    }
    let mut states = Vec::with_capacity(steps + 1);
    for target in targets {
        let sample = cycle.advance(&target).map_err(|stuck| vec![cannot_close(design, &stuck, None)])?;
        states.push(state(&mechanism, sample));
    }
    let mut warnings = Vec::new();
    let mut crossed = to_rest.change_points;
    crossed.extend(cycle.change_points);
    crossed.dedup();
    warnings.extend(mobility.advice(&mechanism));
    warnings.extend(change_point(design, &crossed));
    let closed = design.drives.iter().all(|d| d.is_closed());
    if closed {
        warnings.extend(does_not_return(&mechanism, &states));
    }
    let motion = Motion {
        mobility,
        joint_points: mechanism.joint_points.clone(),
        rest: state(&mechanism, rest),
        states,
        warnings,
    };
    let turning = full_turns(design, &motion, closed);
    if turning.is_empty() { Ok(motion) } else { Err(turning) }
}

/// Without a drive every state is the drawing.
fn standing(mechanism: &Mechanism, mobility: Mobility) -> Result<Motion, Vec<Diagnostic>> {
    if let Some(found) = standing::diagnose(mechanism) {
        return Err(vec![found]);
    }
    let rest = standing::drawn(mechanism);
    let states = vec![rest.clone(); mechanism.design.cycle.steps + 1];
    let warnings = mobility.advice(mechanism).into_iter().collect();
    Ok(Motion { mobility, joint_points: mechanism.joint_points.clone(), rest, states, warnings })
}

fn state(mechanism: &Mechanism, mut sample: Sample) -> State {
    mechanism.carry(&mut sample.poses);
    let angles_rad = sample.values.split_off(mechanism.values.len());
    State {
        angles_rad,
        traces_mm: mechanism.trace_points(&sample.poses),
        drives: sample.drive,
        poses: sample.poses,
        joint_values: sample.values,
    }
}

/// Compliant joints that would have to turn fully, one error each.
fn full_turns(design: &Design, motion: &Motion, closed: bool) -> Vec<Diagnostic> {
    let winds = |id: JointId| {
        let at = |s: Option<&State>| s.and_then(|s| s.joint_values.get(id)).copied().unwrap_or(0.0);
        closed && (at(motion.states.last()) - at(motion.states.first())).abs() > std::f64::consts::PI
    };
    let turns = |id: JointId| motion.span(id).span_rad >= FULL_TURN_RAD || winds(id);
    let is_hinge = |id: &JointId| design.joints.get(*id).is_some_and(|j| j.kind == JointKind::Hinge);
    let all: Vec<JointId> = (0..design.joints.len()).filter(is_hinge).filter(|id| turns(*id)).collect();
    let list = names(all.iter().filter_map(|id| design.joints.get(*id)).map(|j| &j.name));
    let verb = if all.len() == 1 { "turns" } else { "turn" };
    let mut found = Vec::new();
    for id in &all {
        let Some(joint) = design.joints.get(*id).filter(|j| j.is_compliant()) else { continue };
        let degrees = motion.span(*id).span_rad.to_degrees();
        let message = format!("compliant joint `{}` would have to turn fully ({degrees:.0} deg)", joint.name);
        found.push(
            Diagnostic::error("E0504", message, joint.origin).label("a flexure cannot turn fully").help(
                format!("in this mechanism {list} {verb} fully and must stay conventional: leave out `as …`"),
            ),
        );
    }
    found
}

fn drawn_at_dead_point(design: &Design) -> Diagnostic {
    let at = design.drives.first().map_or(design.origin, |d| d.origin);
    Diagnostic::error(
        "E0505",
        "the mechanism is drawn at a dead point: its drive does not determine which way it goes",
        at,
    )
    .label("driven here")
    .help("draw it a little further on in the cycle, and shift the drive's range by as much")
}

/// The loop opens on the way: to the rest pose, if that is given, or over the cycle.
fn cannot_close(design: &Design, stuck: &Stuck, rest: Option<&[f64]>) -> Diagnostic {
    let value = |(drive, v): (&crate::ir::Drive, &f64)| format!("`{}` = {}", drive.name, drive.unit.show(*v));
    let list = |values: &[f64]| design.drives.iter().zip(values).map(value).collect::<Vec<_>>().join(", ");
    let whither = match rest {
        Some(rest) => format!(" on the way to the rest pose at {}", list(rest)),
        None => String::new(),
    };
    let message = format!("the mechanism cannot be assembled beyond {}{whither}", list(&stuck.drive));
    let fastest = stuck.rates.iter().fold(0.0, |m, r| f64::max(m, *r));
    let driven: Vec<JointId> = design.drives.iter().filter_map(|d| d.joint()).collect();
    let in_loop = |(id, joint)| {
        let breaks = stuck.rates.get(id).is_some_and(|r| *r > BREAKING * fastest) && !driven.contains(&id);
        breaks.then_some(joint)
    };
    let joints: Vec<&crate::ir::Joint> = design.joints.iter().enumerate().filter_map(in_loop).collect();
    let driven_joint = driven.first().and_then(|id| design.joints.get(*id));
    let string = design.drives.first().and_then(|d| match d.on {
        DriveOn::Joint(_) => None,
        DriveOn::String(string) => design.strings.get(string),
    });
    let place = string.map(|c| c.origin).or(driven_joint.map(|j| j.origin));
    let mut found = Diagnostic::error("E0503", message, place.unwrap_or(design.origin)).label("driven here");
    if let Some(drive) = design.drives.first() {
        found = found.also(drive.origin, "this range goes too far");
    }
    if let Some(joint) = joints.first() {
        found = found
            .also(joint.origin, format!("the loop through {} opens", names(joints.iter().map(|j| &j.name))));
    }
    found.help("change the lengths of the loop, or keep the drive inside what it can reach")
}

fn change_point(design: &Design, crossed: &[Vec<f64>]) -> Option<Diagnostic> {
    let first = crossed.first()?;
    let drive = design.drives.first()?;
    let at = match drive.unit {
        DriveUnit::Rad => format!("{:.1} deg", first.first()?.to_degrees()),
        DriveUnit::Mm => format!("{:.2} mm", first.first()?),
    };
    let more =
        if crossed.len() > 1 { format!(" (and {} more times)", crossed.len() - 1) } else { String::new() };
    let message =
        format!("at `{}` = {at}{more} two ways of going on cross; the smooth one was taken", drive.name);
    Some(
        Diagnostic::warning("W0506", message, drive.origin)
            .label("a real mechanism may take the other way here")
            .help("change a length slightly, so that the loop never lies flat"),
    )
}

fn apart(mechanism: &Mechanism, a: &Pose, b: &Pose) -> bool {
    (a.translation - b.translation).norm() > RETURNED * mechanism.length
        || (a.rotation - b.rotation).norm() > RETURNED
}

fn does_not_return(mechanism: &Mechanism, states: &[State]) -> Option<Diagnostic> {
    let (first, last) = (states.first()?, states.last()?);
    let differs = first.poses.iter().zip(&last.poses).enumerate().any(|(body, (a, b))| {
        let turned = match mechanism.idle.iter().find(|i| i.bodies.contains(&body)) {
            // How far a body has turned idly means nothing.
            Some(idle) if idle.body == body => (a.rotation - b.rotation) * idle.axis,
            Some(_) => Vector3::zeros(),
            None => return apart(mechanism, a, b),
        };
        (a.translation - b.translation).norm() > RETURNED * mechanism.length || turned.norm() > RETURNED
    });
    let drive = mechanism.design.drives.first()?;
    differs.then(|| {
        Diagnostic::warning(
            "W0507",
            "after one cycle the mechanism is not in the pose it started from",
            drive.origin,
        )
        .label("one cycle of this drive")
        .help("it changed its way of assembly, or needs several turns of the drive to return")
    })
}
