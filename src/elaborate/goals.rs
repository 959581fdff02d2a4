//! Time, drives, traces, objectives, requirements and exports of a mechanism.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::{DriveText, RequireText, Sheet, TraceText};
use super::structure::Structure;
use crate::diagnostic::Diagnostic;
use crate::ir::{
    Aggregate, Cycle, Drive, Export, ExportKind, MotorInterface, Objective, ObjectiveKind, Profile, Quantity,
    Requirement, Trace,
};
use crate::syntax::ast::{self, Argument, Compare, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// Most steps of a cycle.
const MAX_STEPS: f64 = 100_000.0;
/// The paper's weights (section 5) for terms in SI units.
const TRACK_WEIGHT: f64 = 1e5;
const STRESS_WEIGHT: f64 = 1e-6;

/// Objectives and queries of the target language that this version does not have.
const LATER_TERMS: &[&str] =
    &["sway", "torque", "collision", "force", "gap", "buckling", "tension", "multistable", "mass"];
const TERMS: &[&str] = &["track", "stress"];
const QUANTITIES: &[&str] = &["error", "stress", "torque"];
const LATER_QUANTITIES: &[&str] = &["force", "tension", "gap", "buckling", "angle"];
const AGGREGATES: &[&str] = &["max", "min", "mean", "span", "at"];
const EXPORTS: &[&str] = &["stl", "arduino"];
const LATER_EXPORTS: &[&str] = &["threemf", "report", "gltf", "dynamixel", "micropython", "csv", "svg"];

impl<'a> Evaluator<'a> {
    pub(super) fn cycle(&mut self, scope: usize, sheet: &Sheet<'a>, steps: Option<usize>) -> Outcome<Cycle> {
        let Some((text, over, at)) = sheet.cycle else { return Err(Failed) };
        let written = self.eval_fixed(scope, text, Dimension::NUMBER, "the number of steps")?;
        if written < 1.0 || written.fract() != 0.0 || written > MAX_STEPS {
            return self.fail(
                Diagnostic::error(codes::COUNT, "the number of steps must be a whole number", text.at)
                    .label(format!("from 1 to {MAX_STEPS}")),
            );
        }
        if let Some(n) = steps
            && (n == 0 || n as f64 > MAX_STEPS)
        {
            return self.fail(Diagnostic::error(
                codes::COUNT,
                format!("`--steps {n}` is not from 1 to {MAX_STEPS}"),
                at,
            ));
        }
        let duration_s = match over {
            Some(e) => {
                let t = self.eval_fixed(scope, e, Dimension::TIME, "the duration")?;
                if t <= 0.0 {
                    return self.fail(Diagnostic::error(codes::COUNT, "the duration must be positive", e.at));
                }
                t
            }
            None => 1.0,
        };
        Ok(Cycle { steps: steps.unwrap_or(written as usize), duration_s, origin: at })
    }

    pub(super) fn drives(
        &mut self,
        scope: usize,
        module: usize,
        sheet: &Sheet<'a>,
        s: &Structure<'a>,
    ) -> Outcome<Vec<Drive>> {
        let mut out: Vec<Drive> = Vec::new();
        let mut ok = Ok(());
        let at = sheet.drives.get(1).map(|d| d.at).or(sheet.rests.get(1).map(|r| r.2)).unwrap_or_default();
        self.limit(sheet.drives.len().max(sheet.rests.len()), "drives", at)?;
        for text in &sheet.drives {
            match self.drive(scope, module, text, s, &out) {
                Ok(d) => out.push(d),
                Err(Failed) => ok = Err(Failed),
            }
        }
        for (i, (name, value, at)) in sheet.rests.iter().enumerate() {
            if sheet.later && !self.is_declared(scope, name) {
                // It may be the value of a statement that is not available yet.
                ok = Err(Failed);
                continue;
            }
            let rest = self.rest(scope, name, value);
            let earlier = sheet.rests.iter().take(i).find(|(n, ..)| n.node == name.node);
            if let Some((_, _, first)) = earlier {
                ok = self.fail(
                    Diagnostic::error(
                        codes::REPEATED,
                        format!("`rest {}` may stand only once", name.node),
                        *at,
                    )
                    .label("again here")
                    .also(*first, "first here"),
                );
                continue;
            }
            let Ok(joint) = self.thing(scope, &s.joint_index, name, "joint") else {
                ok = Err(Failed);
                continue;
            };
            match out.iter_mut().find(|d| d.joint == joint) {
                Some(drive) => match rest {
                    Ok(v) => drive.rest_rad = v,
                    Err(Failed) => ok = Err(Failed),
                },
                // A drive that is wrong itself has been reported.
                None if sheet.drives.iter().any(|d| d.joint.node == name.node) => ok = Err(Failed),
                None => {
                    ok = self.fail(
                        Diagnostic::error(
                            codes::REST,
                            format!("joint `{}` is not driven", name.node),
                            name.at,
                        )
                        .help("`rest` says at which value of its drive the part is printed"),
                    );
                }
            }
        }
        ok.map(|()| out)
    }

    fn is_declared(&self, scope: usize, name: &Ident) -> bool {
        self.scopes.get(scope).is_some_and(|s| s.index.contains_key(&name.node))
    }

    fn rest(&mut self, scope: usize, name: &Ident, value: &'a Expr) -> Outcome<f64> {
        if let ExprKind::Free { .. } = value.kind {
            return self.fail(
                Diagnostic::error(codes::LATER_FREE, "a free rest pose is not available yet", value.at)
                    .help(format!("write a number: `rest {} at 30 deg`", name.node)),
            );
        }
        let id = self.eval_scalar(&Env::fixed(scope), value, Dimension::ANGLE, "the rest value")?;
        if self.exprs.as_constant(id).is_none()
            && let Some(at) = self.free_behind(id)
        {
            return self.fail(
                Diagnostic::error(codes::LATER_FREE, "a free rest pose is not available yet", at)
                    .label("this is free")
                    .also(value.at, "the rest pose depends on it"),
            );
        }
        self.fixed(id, value.at, "the rest value")
    }

    fn drive(
        &mut self,
        scope: usize,
        module: usize,
        text: &DriveText<'a>,
        s: &Structure<'a>,
        before: &[Drive],
    ) -> Outcome<Drive> {
        let joint = self.thing(scope, &s.joint_index, text.joint, "joint");
        let profile = match text.profile {
            ast::Profile::Range(from, to) => {
                let a = self.eval_fixed(scope, from, Dimension::ANGLE, "the drive's start");
                let b = self.eval_fixed(scope, to, Dimension::ANGLE, "the drive's end");
                a.and_then(|a| Ok((a, b?)))
            }
            ast::Profile::Later(at) => self.fail(
                Diagnostic::error(codes::LATER_STATEMENT, "a drive `by …` is not available yet", *at)
                    .help("write `drive J from A to B`"),
            ),
        };
        let motor = match text.motor {
            None => Ok(None),
            Some(name) => {
                self.record_named(module, name, "motor").and_then(|item| self.motor(item).map(Some))
            }
        };
        let (joint, (from_rad, to_rad), motor) = (joint?, profile?, motor?);
        if let Some(first) = before.iter().find(|d| d.joint == joint) {
            return self.fail(
                Diagnostic::error(
                    codes::REPEATED,
                    format!("joint `{}` is driven twice", text.joint.node),
                    text.at,
                )
                .label("again here")
                .also(first.origin, "first here"),
            );
        }
        let range = motor.as_ref().and_then(|m| match m.interface {
            MotorInterface::Stepper { .. } => None,
            MotorInterface::Pwm { range_rad } | MotorInterface::Dynamixel { range_rad } => Some(range_rad),
        });
        if let Some(range) = range
            && !text.continuous
            && (to_rad - from_rad).abs() > range * (1.0 + 1e-9)
        {
            return self.fail(
                Diagnostic::error(codes::MOTOR_RANGE, "the drive goes beyond its motor's range", text.at)
                    .label(format!(
                        "turns {}, the motor {}",
                        self.show((to_rad - from_rad).abs(), Dimension::ANGLE),
                        self.show(range, Dimension::ANGLE)
                    ))
                    .help("if this motor turns without end, write `continuous` after its name"),
            );
        }
        Ok(Drive {
            name: text.joint.node.clone(),
            joint,
            profile: Profile::Range { from_rad, to_rad },
            rest_rad: 0.0,
            motor,
            continuous: text.continuous,
            origin: text.at,
        })
    }

    pub(super) fn trace(&mut self, scope: usize, text: &TraceText<'a>, s: &Structure<'a>) -> Outcome<Trace> {
        let body = self.thing(scope, &s.body_index, text.body, "body");
        let point = self.eval(&Env::fixed(scope), text.point).and_then(|v| self.as_point(v, text.point));
        Ok(Trace { name: text.name.node.clone(), body: body?, point: point?, origin: text.at })
    }

    pub(super) fn objective(
        &mut self,
        scope: usize,
        term: &'a ast::Term,
        traces: &BTreeMap<String, usize>,
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
        let name = function.node.as_str();
        let (kind, default) = match name {
            "track" => {
                let slots = self.arguments(function, arguments, &["trace", "scale"], 1)?;
                let trace = self.trace_argument(scope, slots.first().copied().flatten(), traces);
                let scale_mm = self.scale(scope, slots.get(1).copied().flatten(), Dimension::LENGTH)?;
                (
                    ObjectiveKind::Track { trace: trace?, scale_mm },
                    if scale_mm.is_some() { 1.0 } else { TRACK_WEIGHT },
                )
            }
            "stress" => {
                let slots = self.arguments(function, arguments, &["below", "scale"], 0)?;
                let Some(below) = slots.first().copied().flatten() else {
                    return self.fail(
                        Diagnostic::error(
                            codes::LATER_TERM,
                            "`stress()` without a bound is not available yet",
                            function.at,
                        )
                        .help("write `stress(below = 25 MPa)`"),
                    );
                };
                let bound_mpa = self.eval_fixed(scope, below, Dimension::STRESS, "the stress bound");
                let scale_mpa = self.scale(scope, slots.get(1).copied().flatten(), Dimension::STRESS)?;
                let bound_mpa = bound_mpa?;
                if bound_mpa <= 0.0 {
                    return self.fail(Diagnostic::error(
                        codes::SIZE,
                        "a stress bound must be positive",
                        below.at,
                    ));
                }
                let default = if scale_mpa.is_some() { 1.0 } else { STRESS_WEIGHT };
                (ObjectiveKind::StressBelow { bound_mpa, scale_mpa }, default)
            }
            _ if LATER_TERMS.contains(&name) => return self.later(codes::LATER_TERM, name, function.at),
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

    fn scale(&mut self, scope: usize, e: Option<&'a Expr>, dim: Dimension) -> Outcome<Option<f64>> {
        let Some(e) = e else { return Ok(None) };
        let v = self.eval_fixed(scope, e, dim, "a scale")?;
        if v <= 0.0 {
            return self.fail(Diagnostic::error(codes::SIZE, "a scale must be positive", e.at));
        }
        Ok(Some(v))
    }

    fn unknown_of<T>(&mut self, name: &Ident, what: &str, known: &[&str]) -> Outcome<T> {
        let d = Diagnostic::error(
            codes::UNKNOWN_FUNCTION,
            format!("there is no {what} `{}`", name.node),
            name.at,
        );
        self.fail(match super::names::suggestion(&name.node, known.iter().copied()) {
            Some(near) => d.help(format!("did you mean `{near}`?")),
            None => d.help(format!("there are {}", known.join(", "))),
        })
    }

    fn trace_argument(
        &mut self,
        scope: usize,
        e: Option<&'a Expr>,
        traces: &BTreeMap<String, usize>,
    ) -> Outcome<usize> {
        let name = self.plain_name(e, "trace")?;
        self.thing(scope, traces, name, "trace")
    }

    fn plain_name(&mut self, e: Option<&'a Expr>, what: &str) -> Outcome<&'a Ident> {
        let Some(e) = e else { return Err(Failed) };
        match &e.kind {
            ExprKind::Name(path) if path.len() == 1 => path.first().ok_or(Failed),
            ExprKind::Broken => Err(Failed),
            ExprKind::Name(path) => {
                let name: Vec<&str> = path.iter().map(|p| p.node.as_str()).collect();
                self.later(codes::LATER_TERM, &name.join("."), e.at)
            }
            _ => self.fail(Diagnostic::error(codes::TYPE, format!("the name of a {what} is needed"), e.at)),
        }
    }

    pub(super) fn requirement(
        &mut self,
        scope: usize,
        text: &RequireText<'a>,
        traces: &BTreeMap<String, usize>,
        drives: &BTreeMap<String, usize>,
        line: &str,
    ) -> Outcome<Requirement> {
        let queries = [query(text.left), query(text.right)];
        let (found, bound, at_most) = match queries {
            [Some(q), None] => (q, text.right, matches!(text.op, Compare::LessEqual | Compare::Less)),
            [None, Some(q)] => (q, text.left, matches!(text.op, Compare::GreaterEqual | Compare::Greater)),
            [Some(_), Some(_)] => {
                return self.fail(
                    Diagnostic::error(
                        codes::LATER_TERM,
                        "comparing two queries is not available yet",
                        text.at,
                    )
                    .help("compare one query with a quantity"),
                );
            }
            [None, None] => {
                if let Some(outer) = output_query(text.left).or(output_query(text.right)) {
                    return self.later(codes::LATER_TERM, &format!("{}(OUTPUT)", outer.node), outer.at);
                }
                if matches!(text.left.kind, ExprKind::Broken) || matches!(text.right.kind, ExprKind::Broken) {
                    return Err(Failed);
                }
                return self.fail(
                    Diagnostic::error(
                        codes::QUERY,
                        "nothing of the solved mechanism is asked for here",
                        text.at,
                    )
                    .help("write for instance `require max(error(tip)) <= 1 mm`"),
                );
            }
        };
        let aggregate = self.aggregate(scope, &found);
        let quantity = self.quantity(scope, found.inner, found.inner_arguments, traces, drives);
        let (aggregate, (quantity, dim)) = (aggregate?, quantity?);
        let bound = self.eval_fixed(scope, bound, dim, "the bound")?;
        Ok(Requirement {
            aggregate,
            quantity,
            at_most,
            strict: matches!(text.op, Compare::Less | Compare::Greater),
            bound,
            text: line.to_string(),
            origin: text.at,
        })
    }

    fn aggregate(&mut self, scope: usize, q: &Query<'a>) -> Outcome<Aggregate> {
        let Some(outer) = q.outer else {
            return self.fail(
                Diagnostic::error(
                    codes::QUERY,
                    "this has a value at every step, which one is meant?",
                    q.inner.at,
                )
                .help(format!("write `max({}(…))`, or min, mean, span", q.inner.node)),
            );
        };
        match outer.node.as_str() {
            "max" => Ok(Aggregate::Max),
            "min" => Ok(Aggregate::Min),
            "mean" => Ok(Aggregate::Mean),
            "span" => Ok(Aggregate::Span),
            "at" => {
                let Some(t) = q.time else {
                    return self.fail(
                        Diagnostic::error(codes::ARGUMENTS, "`at` lacks its time", outer.at)
                            .help("write `at(error(tip), 25 %)`"),
                    );
                };
                let v = self.eval_fixed(scope, t, Dimension::NUMBER, "the time")?;
                if !(0.0..=1.0).contains(&v) {
                    return self.fail(Diagnostic::error(
                        codes::COUNT,
                        "the time lies outside the cycle, 0 % to 100 %",
                        t.at,
                    ));
                }
                Ok(Aggregate::At(v))
            }
            _ => self.unknown_of(outer, "query", AGGREGATES),
        }
    }

    fn quantity(
        &mut self,
        scope: usize,
        name: &'a Ident,
        args: &'a [Argument],
        traces: &BTreeMap<String, usize>,
        drives: &BTreeMap<String, usize>,
    ) -> Outcome<(Quantity, Dimension)> {
        match name.node.as_str() {
            "error" => {
                let slots = self.arguments(name, args, &["trace"], 1)?;
                let trace = self.trace_argument(scope, slots.first().copied().flatten(), traces)?;
                Ok((Quantity::Error(trace), Dimension::LENGTH))
            }
            "stress" => {
                self.arguments(name, args, &[], 0)?;
                Ok((Quantity::Stress, Dimension::STRESS))
            }
            "torque" => {
                let slots = self.arguments(name, args, &["drive"], 1)?;
                let drive = self.plain_name(slots.first().copied().flatten(), "drive")?;
                Ok((Quantity::Torque(self.drive_named(scope, drive, drives)?), Dimension::TORQUE))
            }
            later => self.later(codes::LATER_TERM, later, name.at),
        }
    }

    /// The drive of a joint by the joint's name.
    fn drive_named(
        &mut self,
        scope: usize,
        name: &Ident,
        drives: &BTreeMap<String, usize>,
    ) -> Outcome<usize> {
        if let Some(i) = drives.get(&name.node) {
            return Ok(*i);
        }
        let joint = self.scopes.get(scope).and_then(|s| s.locals.get(*s.index.get(&name.node)?));
        if joint.is_some_and(|l| matches!(l.kind, super::scope::LocalKind::Thing("joint"))) {
            return self.fail(
                Diagnostic::error(codes::WRONG_KIND, format!("joint `{}` is not driven", name.node), name.at)
                    .label("the name of a driven joint is needed"),
            );
        }
        self.thing(scope, drives, name, "drive")
    }

    pub(super) fn export(
        &mut self,
        scope: usize,
        e: &'a Expr,
        drives: &BTreeMap<String, usize>,
        texts: &[DriveText<'a>],
    ) -> Outcome<Export> {
        let (name, args): (&'a Ident, &'a [Argument]) = match &e.kind {
            ExprKind::Name(path) if path.len() == 1 => (path.first().ok_or(Failed)?, &[]),
            ExprKind::Call { function, arguments } => (function, arguments),
            ExprKind::Broken => return Err(Failed),
            _ => {
                return self.fail(
                    Diagnostic::error(codes::EXPORT, "the name of an export is needed", e.at)
                        .help("such as `stl` or `arduino(motor)`"),
                );
            }
        };
        match name.node.as_str() {
            "stl" => {
                self.arguments(name, args, &[], 0)?;
                Ok(Export { kind: ExportKind::Stl, origin: e.at })
            }
            "arduino" => {
                let slots = self.arguments(name, args, &["drive"], 1)?;
                let drive = self.plain_name(slots.first().copied().flatten(), "drive")?;
                let index = self.drive_named(scope, drive, drives)?;
                if texts.iter().any(|d| d.joint.node == drive.node && d.motor.is_none()) {
                    return self.fail(
                        Diagnostic::error(
                            codes::EXPORT,
                            "this drive has no motor to write code for",
                            drive.at,
                        )
                        .help("write `drive … with nema17`"),
                    );
                }
                Ok(Export { kind: ExportKind::Arduino(index), origin: e.at })
            }
            later if LATER_EXPORTS.contains(&later) => {
                let later = later.to_string();
                self.later(codes::LATER_TERM, &later, name.at)
            }
            _ => self.unknown_of(name, "export", EXPORTS),
        }
    }
}

/// A query as written: `max(error(tip))`.
struct Query<'a> {
    outer: Option<&'a Ident>,
    inner: &'a Ident,
    inner_arguments: &'a [Argument],
    time: Option<&'a Expr>,
}

/// `span(curl)`: the query of an `output`, which this version does not have.
fn output_query(e: &Expr) -> Option<&Ident> {
    match &e.kind {
        ExprKind::Call { function, arguments } if matches!(function.node.as_str(), "span" | "mean") => {
            let [only] = arguments.as_slice() else { return None };
            matches!(only.value.kind, ExprKind::Name(_)).then_some(function)
        }
        _ => None,
    }
}

/// Recognises a query by the quantity it asks for.
fn query(e: &Expr) -> Option<Query<'_>> {
    let ExprKind::Call { function, arguments } = &e.kind else { return None };
    let known =
        |n: &Ident| QUANTITIES.contains(&n.node.as_str()) || LATER_QUANTITIES.contains(&n.node.as_str());
    if known(function) {
        return Some(Query { outer: None, inner: function, inner_arguments: arguments, time: None });
    }
    let (first, rest) = arguments.split_first()?;
    let ExprKind::Call { function: inner, arguments: inner_arguments } = &first.value.kind else {
        return None;
    };
    if !known(inner) {
        return None;
    }
    let time = rest.first().map(|a| &a.value);
    Some(Query { outer: Some(function), inner, inner_arguments, time })
}
