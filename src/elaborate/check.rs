//! What a value must be: dimensions, units that are missing, types, numbers that must be fixed.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Outcome};
use super::units;
use super::value::{Value, with_article};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::ExprPoint;
use crate::ir::expr::ExprId;
use crate::syntax::ast::{Expr, ExprKind, Ident};

impl<'a> Evaluator<'a> {
    pub(super) fn check_like(
        &mut self,
        v: &Value,
        e: &'a Expr,
        expected: &Value,
        default: Origin,
    ) -> Outcome<()> {
        if let (Value::Scalar(_), Value::Scalar(want)) = (v, expected) {
            return self.scalar(v.clone(), e, want.dim, "").map(|_| ());
        }
        if std::mem::discriminant(v) == std::mem::discriminant(expected) {
            return Ok(());
        }
        let d =
            Diagnostic::error(codes::TYPE, format!("{} is needed, this is {}", expected.a(), v.a()), e.at)
                .also(default, "the default it replaces");
        self.fail(d)
    }

    pub(super) fn check_type(&mut self, v: &Value, e: &'a Expr, ty: &Ident) -> Outcome<()> {
        let fits = match ty.node.as_str() {
            "point" => matches!(v, Value::Point(_)),
            "vector" => matches!(v, Value::Vector { dim, .. } if *dim == Dimension::LENGTH),
            "direction" => matches!(v, Value::Vector { dim, .. } if dim.is_number()),
            "text" => matches!(v, Value::Text(_)),
            name => match Dimension::of_type(name) {
                Some(want) => return self.scalar(v.clone(), e, want, "").map(|_| ()),
                None => {
                    let others = ["point", "vector", "direction", "text"];
                    let near = super::names::suggestion(name, Dimension::type_names().chain(others));
                    let mut d =
                        Diagnostic::error(codes::UNKNOWN_TYPE, format!("unknown type `{name}`"), ty.at);
                    d = match near {
                        Some(n) => super::lookup::meant(d, ty, &n),
                        None => d.help(format!(
                            "types are {}",
                            Dimension::type_names().chain(others).collect::<Vec<_>>().join(", ")
                        )),
                    };
                    return self.fail(d);
                }
            },
        };
        if fits {
            return Ok(());
        }
        let d = Diagnostic::error(
            codes::TYPE,
            format!("this is {}, not {}", v.a(), with_article(&ty.node)),
            e.at,
        )
        .also(ty.at, format!("declared as {} here", with_article(&ty.node)));
        self.fail(d)
    }

    /// A scalar of dimension `want`; `what` names what it is for ("the radius"), or is empty.
    pub(super) fn scalar(&mut self, v: Value, e: &Expr, want: Dimension, what: &str) -> Outcome<ExprId> {
        let found = match v {
            Value::Scalar(s) if s.dim == want => return Ok(s.id),
            Value::Scalar(s) => s.dim,
            other => {
                return self.fail(Diagnostic::error(
                    codes::TYPE,
                    format!("{} is needed, this is {}", with_article(&want.to_string()), other.a()),
                    e.at,
                ));
            }
        };
        let subject = if what.is_empty() { String::new() } else { format!("{what}: ") };
        let needed = with_article(&want.to_string());
        if found.is_number()
            && let Some(unit) = want.suggestion()
        {
            let help = match bare_number(e) {
                Some(n) => format!("write `{n} {unit}`"),
                None => format!("give it a unit, such as `{unit}`"),
            };
            return self.fail(
                Diagnostic::error(
                    codes::MISSING_UNIT,
                    format!("{subject}{needed} is needed, this number has no unit"),
                    e.at,
                )
                .label("a plain number")
                .help(help),
            );
        }
        self.fail(
            Diagnostic::error(
                codes::DIMENSION,
                format!("{subject}{needed} is needed, this is {}", with_article(&found.to_string())),
                e.at,
            )
            .label(found.to_string()),
        )
    }

    /// Evaluates to a scalar of dimension `want`.
    pub(super) fn eval_scalar(
        &mut self,
        env: &Env,
        e: &'a Expr,
        want: Dimension,
        what: &str,
    ) -> Outcome<ExprId> {
        let v = self.eval(env, e)?;
        self.scalar(v, e, want, what)
    }

    /// Evaluates to a number that depends on nothing free.
    pub(super) fn eval_fixed(
        &mut self,
        scope: usize,
        e: &'a Expr,
        want: Dimension,
        what: &str,
    ) -> Outcome<f64> {
        let id = self.eval_scalar(&Env::fixed(scope), e, want, what)?;
        self.fixed(id, e.at, what)
    }

    /// The number of a node that depends on nothing free.
    pub(super) fn fixed(&mut self, id: ExprId, at: Origin, what: &str) -> Outcome<f64> {
        match self.exprs.as_constant(id) {
            Some(v) => Ok(v),
            None => {
                let mut d = Diagnostic::error(
                    codes::NOT_FIXED,
                    format!("{what} must be a fixed number, this depends on a free value"),
                    at,
                );
                if let Some(f) = self.free_behind(id) {
                    d = d.also(f, "free here");
                }
                self.fail(d)
            }
        }
    }

    /// Where a free variable that a node depends on is declared.
    pub(super) fn free_behind(&self, id: ExprId) -> Option<Origin> {
        let first = self.exprs.free_variables(&[id]).into_iter().next()?;
        self.free.get(first).map(|f| f.origin)
    }

    /// A point; a tuple of lengths written in place counts as one.
    pub(super) fn as_point(&mut self, v: Value, e: &Expr) -> Outcome<ExprPoint> {
        match v {
            Value::Point(p) => Ok(p),
            Value::Vector { v, dim, literal: true } if dim == Dimension::LENGTH => Ok(v),
            Value::Vector { dim, literal: true, .. } if dim.is_number() => self.fail(
                Diagnostic::error(codes::MISSING_UNIT, "the coordinates of a point need a unit", e.at)
                    .label("these are plain numbers")
                    .help("write `(10 mm, 0 mm)`"),
            ),
            other => {
                let mut d =
                    Diagnostic::error(codes::TYPE, format!("a point is needed, this is {}", other.a()), e.at);
                if matches!(other, Value::Vector { .. }) {
                    d = d.help("add it to a point: `O + …`");
                }
                self.fail(d)
            }
        }
    }

    /// A number in the unit a designer would write.
    pub(super) fn show(&self, v: f64, dim: Dimension) -> String {
        let unit = dim.suggestion().unwrap_or("");
        let factor = match unit {
            "deg" => 1f64.to_radians(),
            "g" => 1.0 / units::GRAMS_PER_TONNE,
            "g/cm^3" => 1e-9,
            "deg/s" => 1f64.to_radians(),
            _ => 1.0,
        };
        let text = format!("{:.6}", v / factor);
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        format!("{text} {unit}").trim_end().to_string()
    }
}

/// A number literal without unit, as text.
fn bare_number(e: &Expr) -> Option<String> {
    match &e.kind {
        ExprKind::Number { value, unit } if unit.is_empty() => Some(value.to_string()),
        ExprKind::Negate(inner) => bare_number(inner).map(|n| format!("-{n}")),
        _ => None,
    }
}
