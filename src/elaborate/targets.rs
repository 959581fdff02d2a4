//! `target TRACE = …`: a file, points, or an expression of t in place of the conventional mechanism's own path.

use super::aims::AimNames;
use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::mechanism::Outside;
use super::sheet::Sheet;
use super::table;
use super::value::Value;
use crate::diagnostic::Diagnostic;
use crate::ir::expr::ExprId;
use crate::ir::{Profile, Target, TargetOf, TargetPath};
use crate::syntax::ast::{Argument, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// Largest file of a target, bytes.
const MAX_FILE_BYTES: usize = 4 << 20;
/// Directions shorter than this have none.
const NO_DIRECTION: f64 = 1e-9;

impl<'a> Evaluator<'a> {
    pub(super) fn targets(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        traces: &BTreeMap<String, usize>,
        outside: &Outside<'_>,
    ) {
        for (i, text) in sheet.targets.iter().enumerate() {
            let first = sheet.targets.iter().take(i).find(|t| t.0.node == text.0.node);
            if let Some((name, _, at)) = first {
                self.out.push(
                    Diagnostic::error(
                        codes::REPEATED,
                        format!("`target {}` may stand only once", name.node),
                        text.2,
                    )
                    .label("again here")
                    .also(*at, "first here"),
                );
                continue;
            }
            let (name, value, origin) = *text;
            let of = if self.is_thing(scope, name, "direction") {
                let directions = self.aims.directions.clone();
                self.thing(scope, &directions, name, "direction").map(TargetOf::Direction)
            } else {
                self.thing(scope, traces, name, "trace").map(TargetOf::Trace)
            };
            let Ok(of) = of else { continue };
            let directed = matches!(of, TargetOf::Direction(_));
            if let Ok(path) = self.target_path(scope, value, directed, outside)
                && self.path_is_sound(&path, directed, value).is_ok()
            {
                self.aims.made.targets.push(Target { of, path, origin });
            }
        }
    }

    fn target_path(
        &mut self,
        scope: usize,
        value: &'a Expr,
        directed: bool,
        outside: &Outside<'_>,
    ) -> Outcome<TargetPath> {
        match &value.kind {
            ExprKind::Call { function, arguments } if function.node == "path" => {
                self.target_file(scope, function, arguments, directed, outside)
            }
            ExprKind::Call { function, arguments } if function.node == "points" => {
                self.target_points(scope, function, arguments, directed)
            }
            _ => {
                let (graph, value) = self.over_time(scope, value, "a target", |me, env| {
                    let v = me.eval(env, value)?;
                    me.target_place(v, value, directed)
                })?;
                Ok(TargetPath::Expression { graph, value })
            }
        }
    }

    /// A point, or for a traced direction a direction.
    fn target_place(&mut self, v: Value, e: &Expr, directed: bool) -> Outcome<[ExprId; 3]> {
        match v {
            v if !directed => self.as_point(v, e),
            Value::Vector { v, dim, .. } if dim.is_number() => Ok(v),
            other => self.fail(
                Diagnostic::error(
                    codes::TYPE,
                    format!("the target of a direction is a direction, this is {}", other.a()),
                    e.at,
                )
                .help("write numbers without units: `(sin(20 deg * t), 0, 1)`"),
            ),
        }
    }

    fn target_points(
        &mut self,
        scope: usize,
        function: &Ident,
        arguments: &'a [Argument],
        directed: bool,
    ) -> Outcome<TargetPath> {
        if let Some(named) = arguments.iter().find_map(|a| a.name.as_ref()) {
            return self.fail(
                Diagnostic::error(
                    codes::ARGUMENTS,
                    format!("`points` has no argument `{}`", named.node),
                    named.at,
                )
                .help("list the points in their order"),
            );
        }
        if arguments.len() < 2 {
            return self.fail(
                Diagnostic::error(codes::TARGET, "a path has at least two points", function.at)
                    .help("write `points(P, Q, R)`; a target that stays is a point alone"),
            );
        }
        let mut places = Vec::with_capacity(arguments.len());
        let mut ok = Ok(());
        for a in arguments {
            let place = self.eval(&Env::fixed(scope), &a.value).and_then(|v| {
                let ids = self.target_place(v, &a.value, directed)?;
                let mut place = [0.0; 3];
                for (slot, id) in place.iter_mut().zip(ids) {
                    *slot = self.fixed(id, a.value.at, "a target")?;
                }
                Ok(place)
            });
            match place {
                Ok(place) => places.push(place),
                Err(Failed) => ok = Err(Failed),
            }
        }
        ok?;
        Ok(TargetPath::Places { times: table::even(places.len()), places })
    }

    fn target_file(
        &mut self,
        scope: usize,
        function: &Ident,
        arguments: &'a [Argument],
        directed: bool,
        outside: &Outside<'_>,
    ) -> Outcome<TargetPath> {
        let slots = self.arguments(function, arguments, &["file"], 1)?;
        let Some(e) = slots.first().copied().flatten() else { return Err(Failed) };
        let path = match self.eval(&Env::fixed(scope), e)? {
            Value::Text(path) => path,
            other => {
                return self.fail(
                    Diagnostic::error(
                        codes::TYPE,
                        format!("the name of a file is needed, this is {}", other.a()),
                        e.at,
                    )
                    .help("write `path(\"tip.csv\")`"),
                );
            }
        };
        if let Some(why) = super::load::leads_out(&path) {
            return self.fail(
                Diagnostic::error(codes::IMPORT_REFUSED, format!("`{path}` may not be read"), e.at)
                    .label(why)
                    .help("a source reads only files below its own folder"),
            );
        }
        let text = match outside.files.read(&path) {
            Ok(text) if text.len() > MAX_FILE_BYTES => Err(super::FileError::TooLarge),
            other => other,
        };
        let text = match text {
            Ok(text) => text,
            Err(why) => {
                return self.fail(
                    Diagnostic::error(codes::IMPORT_UNREADABLE, format!("cannot read `{path}`"), e.at)
                        .label(why.to_string())
                        .help("the path starts from the folder of the design"),
                );
            }
        };
        let columns = if directed { ["x", "y", "z"] } else { ["x_mm", "y_mm", "z_mm"] };
        match table::places(&text, columns, !directed) {
            Ok((times, places)) => Ok(TargetPath::Places { times, places }),
            Err(why) => self.fail(
                Diagnostic::error(codes::TARGET, format!("`{path}` is no path: {why}"), e.at).help(format!(
                    "a heading such as `t,{}` (t from 0 to 1, may be left out), then a row of numbers each place",
                    columns.join(",")
                )),
            ),
        }
    }

    /// Every state has a place, and a direction a length.
    fn path_is_sound(&mut self, path: &TargetPath, directed: bool, e: &Expr) -> Outcome<()> {
        let steps = self.aims.steps.unwrap_or(1);
        for s in 0..=steps {
            let t = s as f64 / steps as f64;
            let at = path.at(t);
            if !at.iter().all(|x| x.is_finite()) {
                return self.fail(
                    Diagnostic::error(
                        codes::NOT_FINITE,
                        format!("the target is no finite place at t = {t:.4}"),
                        e.at,
                    )
                    .help("look for a division by zero or the root of a negative number there"),
                );
            }
            if directed && at.iter().map(|x| x * x).sum::<f64>().sqrt() < NO_DIRECTION {
                return self.fail(
                    Diagnostic::error(
                        codes::TARGET,
                        format!("the target has no direction at t = {t:.4}"),
                        e.at,
                    )
                    .label("all components are zero there")
                    .help("give more directions in between"),
                );
            }
        }
        Ok(())
    }

    /// The weights of a term over the cycle: `emphasis = EXPRESSION` of t.
    pub(super) fn emphasis(&mut self, scope: usize, e: Option<&'a Expr>) -> Outcome<Option<Profile>> {
        let Some(e) = e else { return Ok(None) };
        let profile = self.of_time(scope, e, Dimension::NUMBER, ["an emphasis", "an emphasis"])?;
        let AimNames { steps: Some(steps), .. } = self.aims else { return Ok(Some(profile)) };
        let values: Vec<f64> = (0..=steps).map(|s| profile.value(s as f64 / steps as f64)).collect();
        let wrong = |v: &f64| !v.is_finite() || *v < 0.0;
        if let Some(s) = values.iter().position(wrong) {
            return self.fail(
                Diagnostic::error(codes::EMPHASIS, "an emphasis must not be negative", e.at)
                    .label(format!(
                        "{} at t = {:.4}",
                        values.get(s).unwrap_or(&f64::NAN),
                        s as f64 / steps as f64
                    ))
                    .help("cut it off: `max(0, …)`"),
            );
        }
        if values.iter().all(|v| *v == 0.0) {
            return self.fail(
                Diagnostic::error(codes::EMPHASIS, "this emphasis is zero at every step", e.at)
                    .help("leave the term out, or let it count somewhere"),
            );
        }
        Ok(Some(profile))
    }
}
