//! Requirements: queries over the solved cycle, compared with quantities.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Failed, Outcome};
use super::sheet::RequireText;
use crate::diagnostic::Diagnostic;
use crate::ir::{Aggregate, Quantity, Requirement};
use crate::syntax::ast::{Argument, Compare, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

const AGGREGATES: &[&str] = &["max", "min", "mean", "span", "at"];
const LATER_QUANTITIES: &[&str] = &["robust"];
const QUANTITIES: &[&str] = &["error", "stress", "torque", "force", "tension", "gap", "angle", "buckling"];
/// A query as written: `max(error(tip))`.
struct Query<'a> {
    outer: Option<&'a Ident>,
    inner: &'a Ident,
    inner_arguments: &'a [Argument],
    time: Option<&'a Expr>,
    /// It is the name of an output.
    output: bool,
}

impl<'a> Evaluator<'a> {
    pub(super) fn requirement(
        &mut self,
        scope: usize,
        text: &RequireText<'a>,
        traces: &BTreeMap<String, usize>,
        drives: &BTreeMap<String, usize>,
        line: &str,
    ) -> Outcome<Requirement> {
        let is_output = |n: &Ident| self.is_thing(scope, n, "output");
        let queries = [query(text.left, &is_output), query(text.right, &is_output)];
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
                if let Some(name) = output_query(text.left).or(output_query(text.right)) {
                    let outputs = self.aims.outputs.clone();
                    return self.thing(scope, &outputs, name, "output").and(Err(Failed));
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
        if LATER_QUANTITIES.contains(&found.inner.node.as_str()) {
            return self.later(codes::LATER_TERM, &found.inner.node, found.inner.at);
        }
        let aggregate = self.aggregate(scope, &found);
        let quantity = if found.output {
            let outputs = self.aims.outputs.clone();
            let index = self.thing(scope, &outputs, found.inner, "output");
            index.map(|i| (Quantity::Angle(i), Dimension::ANGLE))
        } else {
            self.quantity(scope, found.inner, found.inner_arguments, traces, drives)
        };
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
                let slots = self.arguments(name, args, &["trace", "form"], 1)?;
                let form = slots.get(1).copied().flatten();
                let closest = self.form(name, form, &["same_time", "closest"])? == Some("closest");
                let of = self.plain_name(slots.first().copied().flatten(), "trace")?;
                if self.is_thing(scope, of, "direction") {
                    if let (true, Some(e)) = (closest, form) {
                        return self.later(codes::LATER_TERM, "error(DIRECTION, form = closest)", e.at);
                    }
                    let directions = self.aims.directions.clone();
                    let index = self.thing(scope, &directions, of, "direction")?;
                    self.needs_target(name, &of.node)?;
                    return Ok((Quantity::AimError(index), Dimension::ANGLE));
                }
                let trace = self.thing(scope, traces, of, "trace")?;
                self.needs_target(name, &of.node)?;
                let quantity = if closest { Quantity::ErrorClosest } else { Quantity::Error };
                Ok((quantity(trace), Dimension::LENGTH))
            }
            "angle" => {
                let index = self.angle(scope, name, args, None, name.at)?;
                Ok((Quantity::Angle(index), Dimension::ANGLE))
            }
            "stress" => {
                self.arguments(name, args, &[], 0)?;
                Ok((Quantity::Stress, Dimension::STRESS))
            }
            "gap" => {
                self.arguments(name, args, &[], 0)?;
                Ok((Quantity::Gap, Dimension::LENGTH))
            }
            "buckling" => {
                self.arguments(name, args, &[], 0)?;
                if !self.loaded {
                    // What drives alone press together has no load that could grow.
                    return self.later(codes::LATER_TERM, "buckling() without a load", name.at);
                }
                Ok((Quantity::Buckling, Dimension::NUMBER))
            }
            "torque" => {
                let slots = self.arguments(name, args, &["drive"], 1)?;
                let drive = self.plain_name(slots.first().copied().flatten(), "drive")?;
                let index = self.drive_named(scope, drive, drives)?;
                self.slides(drive, false)?;
                Ok((Quantity::Torque(index), Dimension::TORQUE))
            }
            "force" => {
                let slots = self.arguments(name, args, &["drive"], 1)?;
                let drive = self.plain_name(slots.first().copied().flatten(), "drive")?;
                let index = self.drive_named(scope, drive, drives)?;
                self.slides(drive, true)?;
                Ok((Quantity::Force(index), Dimension::FORCE))
            }
            "tension" => {
                let slots = self.arguments(name, args, &["string"], 1)?;
                let string = self.plain_name(slots.first().copied().flatten(), "string")?;
                let index = self.drive_named(scope, string, drives)?;
                if !self.cables.contains(&string.node) {
                    return self.fail(
                        Diagnostic::error(codes::TYPE, format!("`{}` is no string", string.node), string.at)
                            .help(format!("write `force({})` or `torque({})`", string.node, string.node)),
                    );
                }
                Ok((Quantity::Tension(index), Dimension::FORCE))
            }
            later => self.later(codes::LATER_TERM, later, name.at),
        }
    }

    /// Reports a driven joint that turns where one that slides is meant, or the other way round.
    pub(super) fn slides(&mut self, drive: &Ident, wanted: bool) -> Outcome<()> {
        let name = &drive.node;
        if self.sliders.contains(name) == wanted {
            return Ok(());
        }
        let (does, right) = if wanted { ("turns", "torque") } else { ("slides", "force") };
        self.fail(
            Diagnostic::error(codes::TYPE, format!("`{name}` {does}: its motor has a {right}"), drive.at)
                .help(format!("write `{right}({name})`")),
        )
    }

    /// The drive of a joint by the joint's name.
    pub(super) fn drive_named(
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
}

/// The name in `span(curl)` or `mean(curl)`: these exist for queries only, so it must be meant as an output.
fn output_query(e: &Expr) -> Option<&Ident> {
    match &e.kind {
        ExprKind::Call { function, arguments } if matches!(function.node.as_str(), "span" | "mean") => {
            let [only] = arguments.as_slice() else { return None };
            match &only.value.kind {
                ExprKind::Name(path) if path.len() == 1 => path.first(),
                _ => None,
            }
        }
        _ => None,
    }
}

/// Recognises a query by the quantity it asks for.
fn query<'a>(e: &'a Expr, is_output: &dyn Fn(&Ident) -> bool) -> Option<Query<'a>> {
    let ExprKind::Call { function, arguments } = &e.kind else { return None };
    let known =
        |n: &Ident| QUANTITIES.contains(&n.node.as_str()) || LATER_QUANTITIES.contains(&n.node.as_str());
    if known(function) {
        return Some(Query {
            outer: None,
            inner: function,
            inner_arguments: arguments,
            time: None,
            output: false,
        });
    }
    let (first, rest) = arguments.split_first()?;
    let time = rest.first().map(|a| &a.value);
    if let ExprKind::Name(path) = &first.value.kind {
        let inner = path.first().filter(|n| path.len() == 1 && is_output(n))?;
        return Some(Query { outer: Some(function), inner, inner_arguments: &[], time, output: true });
    }
    let ExprKind::Call { function: inner, arguments: inner_arguments } = &first.value.kind else {
        return None;
    };
    if !known(inner) {
        return None;
    }
    Some(Query { outer: Some(function), inner, inner_arguments, time, output: false })
}
