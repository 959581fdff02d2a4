//! The terms of `minimize`.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Failed, Outcome};
use crate::diagnostic::Diagnostic;
use crate::ir::{Drive, Objective, ObjectiveKind};
use crate::syntax::ast::{self, Argument, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// The paper's weights (section 5) for terms in SI units.
const TRACK_WEIGHT: f64 = 1e5;
const SWAY_WEIGHT: f64 = 5e5;
const TORQUE_WEIGHT: f64 = 10.0;
const COLLISION_WEIGHT: f64 = 1e7;
const STRESS_WEIGHT: f64 = 1e-6;
/// What counts as one in the paper's torque term: SI.
const NEWTON_METRE_N_MM: f64 = 1000.0;
/// Each force of `sway` where the text is silent (the paper's, section 5).
const SWAY_FORCE_N: f64 = 1.0;

/// Objectives and queries of the target language that this version does not have.
const LATER_TERMS: &[&str] = &["force", "gap", "buckling", "tension", "multistable", "mass"];
const TERMS: &[&str] = &["track", "sway", "torque", "collision", "stress"];

/// What terms may name.
pub(super) struct Named<'n> {
    /// Traces by name.
    pub traces: &'n BTreeMap<String, usize>,
    /// Drives by name.
    pub driven: &'n BTreeMap<String, usize>,
    /// The drives themselves; none where one is wrong.
    pub drives: Option<&'n [Drive]>,
}

impl<'a> Evaluator<'a> {
    pub(super) fn objective(
        &mut self,
        scope: usize,
        term: &'a ast::Term,
        named: &Named,
    ) -> Outcome<Objective> {
        let ExprKind::Call { function, arguments } = &term.call.kind else {
            if matches!(term.call.kind, ExprKind::Broken) {
                return Err(Failed);
            }
            return self.fail(
                Diagnostic::error(codes::TYPE, "a term of `minimize` is a call", term.call.at)
                    .help("such as `track(tip)`"),
            );
        };
        let (kind, default) = match function.node.as_str() {
            "track" => self.track(scope, function, arguments, named)?,
            "sway" => self.sway(scope, function, arguments, named)?,
            "torque" => self.torque(scope, function, arguments, named)?,
            "collision" => self.collision(scope, function, arguments)?,
            "stress" => self.stress(scope, function, arguments)?,
            name if LATER_TERMS.contains(&name) => return self.later(codes::LATER_TERM, name, function.at),
            _ => return self.unknown_of(function, "objective", TERMS),
        };
        let weight = match &term.weight {
            None => default,
            Some(e) => {
                let w = self.eval_fixed(scope, e, Dimension::NUMBER, "a weight")?;
                if w < 0.0 {
                    return self.fail(Diagnostic::error(codes::SIZE, "a weight must not be negative", e.at));
                }
                w
            }
        };
        Ok(Objective { kind, weight, origin: term.at })
    }

    fn track(
        &mut self,
        scope: usize,
        function: &'a Ident,
        arguments: &'a [Argument],
        named: &Named,
    ) -> Outcome<(ObjectiveKind, f64)> {
        let slots = self.arguments(function, arguments, &["trace", "scale", "form", "emphasis"], 1)?;
        let slot = |i: usize| slots.get(i).copied().flatten();
        if let Ok(name) = self.plain_name(slot(0), "trace") {
            self.needs_target(function, &name.node)?;
            if self.is_thing(scope, name, "direction") {
                return self.aim(scope, name, [slot(1), slot(2), slot(3)]);
            }
        }
        let trace = self.trace_argument(scope, slot(0), named.traces);
        let scale_mm = self.positive(scope, slot(1), Dimension::LENGTH, "a scale");
        let closest = self.form(function, slot(2), &["same_time", "closest"]);
        let emphasis = self.emphasis(scope, slot(3));
        let (trace, scale_mm, emphasis) = (trace?, scale_mm?, emphasis?);
        let closest = closest? == Some("closest");
        let default = if scale_mm.is_some() { 1.0 } else { TRACK_WEIGHT };
        let kind = if closest || emphasis.is_some() {
            ObjectiveKind::TrackAs { trace, scale_mm, closest, emphasis }
        } else {
            ObjectiveKind::Track { trace, scale_mm }
        };
        Ok((kind, default))
    }

    fn sway(
        &mut self,
        scope: usize,
        function: &'a Ident,
        arguments: &'a [Argument],
        named: &Named,
    ) -> Outcome<(ObjectiveKind, f64)> {
        let names = ["trace", "force", "scale", "along", "form"];
        let slots = self.arguments(function, arguments, &names, 1)?;
        let trace = self.trace_argument(scope, slots.first().copied().flatten(), named.traces);
        let force_n = self.positive(scope, slots.get(1).copied().flatten(), Dimension::FORCE, "a force");
        let scale_mm = self.positive(scope, slots.get(2).copied().flatten(), Dimension::LENGTH, "a scale")?;
        let default = if scale_mm.is_some() { 1.0 } else { SWAY_WEIGHT };
        let force_n = force_n?.unwrap_or(SWAY_FORCE_N);
        let trace = trace?;
        let kind = match self.sway_loads(scope, function, [3, 4].map(|i| slots.get(i).copied().flatten()))? {
            None => ObjectiveKind::Sway { trace, force_n, scale_mm },
            Some(along) => ObjectiveKind::SwayAlong { trace, force_n, scale_mm, along },
        };
        Ok((kind, default))
    }

    fn torque(
        &mut self,
        scope: usize,
        function: &'a Ident,
        arguments: &'a [Argument],
        named: &Named,
    ) -> Outcome<(ObjectiveKind, f64)> {
        let slots = self.arguments(function, arguments, &["drive", "scale", "form"], 1)?;
        let name = self.plain_name(slots.first().copied().flatten(), "drive")?;
        let drive = self.drive_named(scope, name, named.driven);
        let scale = slots.get(1).copied().flatten();
        let scale = self.positive(scope, scale, Dimension::TORQUE, "a scale")?;
        let drive = drive?;
        self.slides(name, false)?;
        if self.form(function, slots.get(2).copied().flatten(), &["paper"])?.is_some() {
            let default = if scale.is_some() { 1.0 } else { TORQUE_WEIGHT };
            let reference_n_mm = scale.unwrap_or(NEWTON_METRE_N_MM);
            return Ok((ObjectiveKind::PaperTorque { drive, reference_n_mm }, default));
        }
        if let Some(reference_n_mm) = scale {
            return Ok((ObjectiveKind::Torque { drive, reference_n_mm }, 1.0));
        }
        let Some(stated) = named.drives.and_then(|d| d.get(drive)) else { return Err(Failed) };
        match &stated.motor {
            Some(motor) => {
                Ok((ObjectiveKind::Torque { drive, reference_n_mm: motor.stall_n_mm }, TORQUE_WEIGHT))
            }
            None => self.fail(
                Diagnostic::error(codes::ARGUMENTS, "which torque is large is not known here", function.at)
                    .label(format!("`{}` has no motor to compare with", name.node))
                    .also(stated.origin, "this drive")
                    .help(format!(
                        "write `drive … with nema17`, or `torque({}, scale = 100 N*mm)`",
                        name.node
                    )),
            ),
        }
    }

    fn collision(
        &mut self,
        scope: usize,
        function: &'a Ident,
        arguments: &'a [Argument],
    ) -> Outcome<(ObjectiveKind, f64)> {
        let slots = self.arguments(function, arguments, &["gap"], 1)?;
        let gap_mm = self
            .positive(scope, slots.first().copied().flatten(), Dimension::LENGTH, "a gap")?
            .ok_or(Failed)?;
        Ok((ObjectiveKind::Collision { gap_mm }, COLLISION_WEIGHT))
    }

    fn stress(
        &mut self,
        scope: usize,
        function: &'a Ident,
        arguments: &'a [Argument],
    ) -> Outcome<(ObjectiveKind, f64)> {
        let slots = self.arguments(function, arguments, &["below", "scale", "form"], 0)?;
        let paper = self.form(function, slots.get(2).copied().flatten(), &["paper"])?.is_some();
        if let (true, Some(e)) = (paper, slots.first().copied().flatten()) {
            return self.fail(
                Diagnostic::error(codes::ARGUMENTS, "the paper's form has no bound", e.at)
                    .help("write `stress(below = …)` or `stress(form = paper)`"),
            );
        }
        let below = slots.first().copied().flatten();
        let bound_mpa = self.positive(scope, below, Dimension::STRESS, "a stress bound");
        let scale_mpa =
            self.positive(scope, slots.get(1).copied().flatten(), Dimension::STRESS, "a scale")?;
        let kind = match bound_mpa? {
            Some(bound_mpa) => ObjectiveKind::StressBelow { bound_mpa, scale_mpa },
            None if paper => ObjectiveKind::PaperStress { scale_mpa },
            None => ObjectiveKind::Stress { scale_mpa },
        };
        Ok((kind, if scale_mpa.is_some() { 1.0 } else { STRESS_WEIGHT }))
    }

    /// A positive quantity where one is written.
    pub(super) fn positive(
        &mut self,
        scope: usize,
        e: Option<&'a Expr>,
        dim: Dimension,
        what: &str,
    ) -> Outcome<Option<f64>> {
        let Some(e) = e else { return Ok(None) };
        let v = self.eval_fixed(scope, e, dim, what)?;
        if v <= 0.0 {
            return self.fail(Diagnostic::error(codes::SIZE, format!("{what} must be positive"), e.at));
        }
        Ok(Some(v))
    }
}
