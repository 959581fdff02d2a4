//! Operators over quantities, points, vectors and directions. A dimension error shows both sides and
//! where each came from.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::value::{Scalar, Value};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::ExprPoint;
use crate::ir::expr::{ExprId, Node};
use crate::syntax::ast::{BinaryOp, Expr, ExprKind};

/// Largest exponent of `^`.
const MAX_POWER: f64 = 12.0;

impl<'a> Evaluator<'a> {
    /// −v
    pub(super) fn negate(&mut self, v: Value, at: Origin) -> Outcome<Value> {
        match v {
            Value::Scalar(s) => Ok(Value::Scalar(Scalar { id: self.negated(s.id, at)?, dim: s.dim })),
            Value::Vector { v, dim, .. } => {
                let v = self.each(v, |me, id| me.negated(id, at))?;
                Ok(Value::Vector { v, dim, literal: false })
            }
            other => self.fail(Diagnostic::error(codes::TYPE, format!("{} has no negative", other.a()), at)),
        }
    }

    /// −a, without the sign on a zero: −0 mm reads oddly in everything that prints it.
    fn negated(&mut self, id: ExprId, at: Origin) -> Outcome<ExprId> {
        if self.exprs.as_constant(id) == Some(0.0) {
            return self.constant(0.0, at);
        }
        self.node(Node::Neg(id), at)
    }

    /// Applies `f` to every component.
    pub(super) fn each(
        &mut self,
        v: ExprPoint,
        mut f: impl FnMut(&mut Self, ExprId) -> Outcome<ExprId>,
    ) -> Outcome<ExprPoint> {
        Ok([f(self, v[0])?, f(self, v[1])?, f(self, v[2])?])
    }

    /// Component-wise node of two triples.
    pub(super) fn pairwise(
        &mut self,
        a: ExprPoint,
        b: ExprPoint,
        at: Origin,
        node: fn(ExprId, ExprId) -> Node,
    ) -> Outcome<ExprPoint> {
        Ok([
            self.node(node(a[0], b[0]), at)?,
            self.node(node(a[1], b[1]), at)?,
            self.node(node(a[2], b[2]), at)?,
        ])
    }

    /// a ∘ b for + − * /.
    pub(super) fn binary(
        &mut self,
        env: &Env,
        op: BinaryOp,
        left: (&'a Expr, Value),
        right: (&'a Expr, Value),
        at: Origin,
    ) -> Outcome<Value> {
        match op {
            BinaryOp::Add | BinaryOp::Subtract => self.sum(env, op, left, right, at),
            BinaryOp::Multiply => self.product(left.1, right.1, at),
            BinaryOp::Divide => self.quotient(left.1, right.1, at),
            // `^` is handled by `power`, which needs its right side as written.
            BinaryOp::Power => Err(Failed),
        }
    }

    fn sum(
        &mut self,
        env: &Env,
        op: BinaryOp,
        (le, l): (&'a Expr, Value),
        (re, r): (&'a Expr, Value),
        at: Origin,
    ) -> Outcome<Value> {
        let add = op == BinaryOp::Add;
        let node: fn(ExprId, ExprId) -> Node =
            if add { |a, b| Node::Add(a, b) } else { |a, b| Node::Sub(a, b) };
        let length = Dimension::LENGTH;
        match (&l, &r) {
            (Value::Scalar(a), Value::Scalar(b)) if a.dim == b.dim => {
                Ok(Value::Scalar(Scalar { id: self.node(node(a.id, b.id), at)?, dim: a.dim }))
            }
            (Value::Vector { v: a, dim: da, .. }, Value::Vector { v: b, dim: db, .. }) if da == db => {
                Ok(Value::Vector { v: self.pairwise(*a, *b, at, node)?, dim: *da, literal: false })
            }
            (Value::Point(a), Value::Vector { v: b, dim, .. }) if *dim == length => {
                Ok(Value::Point(self.pairwise(*a, *b, at, node)?))
            }
            (Value::Vector { v: a, dim, .. }, Value::Point(b)) if add && *dim == length => {
                Ok(Value::Point(self.pairwise(*a, *b, at, node)?))
            }
            (Value::Point(a), Value::Point(b)) if !add => {
                Ok(Value::Vector { v: self.pairwise(*a, *b, at, node)?, dim: length, literal: false })
            }
            _ => self.mismatch(env, add, (le, &l), (re, &r), at),
        }
    }

    fn mismatch(
        &mut self,
        env: &Env,
        add: bool,
        (le, l): (&'a Expr, &Value),
        (re, r): (&'a Expr, &Value),
        at: Origin,
    ) -> Outcome<Value> {
        let words = if add {
            format!("{} + {}", l.describe(), r.describe())
        } else {
            format!("{} − {}", l.describe(), r.describe())
        };
        let dims = |v: &Value| match v {
            Value::Scalar(s) => Some(s.dim),
            _ => None,
        };
        let bare = |e: &Expr| matches!(&e.kind, ExprKind::Number { unit, .. } if unit.is_empty());
        let (code, message) = match (dims(l), dims(r)) {
            (Some(a), Some(b)) if (a.is_number() && bare(le)) || (b.is_number() && bare(re)) => {
                (codes::MISSING_UNIT, format!("a number without unit in {words}"))
            }
            (Some(_), Some(_)) => (codes::DIMENSION, format!("dimensions do not fit: {words}")),
            _ => (codes::TYPE, format!("these do not go together: {words}")),
        };
        let mut d = Diagnostic::error(code, message, at)
            .also(le.at, format!("this is {}", l.a()))
            .also(re.at, format!("this is {}", r.a()));
        for (e, v) in [(le, l), (re, r)] {
            if let Some((place, name)) = self.declaration(env, e) {
                d = d.also(place, format!("`{name}` becomes {} here", v.a()));
            }
        }
        if code == codes::MISSING_UNIT {
            let (e, other) =
                if dims(l).is_some_and(Dimension::is_number) { (le, dims(r)) } else { (re, dims(l)) };
            if let (ExprKind::Number { value, .. }, Some(unit)) =
                (&e.kind, other.and_then(Dimension::suggestion))
            {
                d = d.help(format!("write `{value} {unit}`"));
            }
        } else if matches!((l, r), (Value::Point(_), Value::Point(_))) {
            d = d.help("the middle of two points is `A + 0.5 * (B - A)`");
        } else if matches!((l, r), (Value::Point(_) | Value::Vector { .. }, Value::Scalar(_))) {
            d = d.help(
                "a length alone has no direction: write for instance `(25 mm, 0 mm)` or `(0 mm, 25 mm)`",
            );
        } else if matches!((l, r), (Value::Vector { .. }, Value::Point(_))) {
            d = d.help("subtract a vector from a point, or two points");
        }
        self.fail(d)
    }

    /// Where the name that an expression consists of is declared.
    fn declaration(&self, env: &Env, e: &Expr) -> Option<(Origin, String)> {
        let ExprKind::Name(path) = &e.kind else { return None };
        let [name] = path.as_slice() else { return None };
        let scope = self.scopes.get(env.scope)?;
        let local = scope.locals.get(*scope.index.get(&name.node)?)?;
        if local.at == Origin::default() {
            return None;
        }
        Some((local.at, name.node.clone()))
    }

    fn product(&mut self, l: Value, r: Value, at: Origin) -> Outcome<Value> {
        match (l, r) {
            (Value::Scalar(a), Value::Scalar(b)) => {
                let dim = self.dimension(a.dim.times(b.dim), at)?;
                Ok(Value::Scalar(Scalar { id: self.node(Node::Mul(a.id, b.id), at)?, dim }))
            }
            (Value::Scalar(s), Value::Vector { v, dim, .. })
            | (Value::Vector { v, dim, .. }, Value::Scalar(s)) => {
                let dim = self.dimension(s.dim.times(dim), at)?;
                let v = self.each(v, |me, id| me.node(Node::Mul(s.id, id), at))?;
                Ok(Value::Vector { v, dim, literal: false })
            }
            (l, r) => {
                let d =
                    Diagnostic::error(codes::TYPE, format!("{} times {} has no meaning", l.a(), r.a()), at);
                let point = matches!(l, Value::Point(_)) || matches!(r, Value::Point(_));
                self.fail(if point { d.help("scale a difference of points: `A + 2 * (B - A)`") } else { d })
            }
        }
    }

    fn quotient(&mut self, l: Value, r: Value, at: Origin) -> Outcome<Value> {
        match (l, r) {
            (Value::Scalar(a), Value::Scalar(b)) => {
                let dim = self.dimension(a.dim.over(b.dim), at)?;
                Ok(Value::Scalar(Scalar { id: self.node(Node::Div(a.id, b.id), at)?, dim }))
            }
            (Value::Vector { v, dim, .. }, Value::Scalar(s)) => {
                let dim = self.dimension(dim.over(s.dim), at)?;
                let v = self.each(v, |me, id| me.node(Node::Div(id, s.id), at))?;
                Ok(Value::Vector { v, dim, literal: false })
            }
            (l, r) => self.fail(Diagnostic::error(
                codes::TYPE,
                format!("{} divided by {} has no meaning", l.a(), r.a()),
                at,
            )),
        }
    }

    /// aⁿ with a literal whole exponent.
    pub(super) fn power(&mut self, env: &Env, base: &'a Expr, exponent: &Expr, at: Origin) -> Outcome<Value> {
        let n = match literal(exponent) {
            Some(n) if n.fract() == 0.0 && n.abs() <= MAX_POWER => n as i32,
            _ => {
                return self.fail(
                    Diagnostic::error(
                        codes::EXPONENT,
                        "the exponent must be a whole number written out",
                        exponent.at,
                    )
                    .label(format!("a literal from -{MAX_POWER} to {MAX_POWER}"))
                    .help("for a root use `sqrt`"),
                );
            }
        };
        match self.eval(env, base)? {
            Value::Scalar(s) => {
                let dim = self.dimension(s.dim.power(n), at)?;
                Ok(Value::Scalar(Scalar { id: self.node(Node::Powi(s.id, n), at)?, dim }))
            }
            other => {
                self.fail(Diagnostic::error(codes::TYPE, format!("{} has no powers", other.a()), base.at))
            }
        }
    }
}

fn literal(e: &Expr) -> Option<f64> {
    match &e.kind {
        ExprKind::Number { value, unit } if unit.is_empty() => Some(*value),
        ExprKind::Negate(inner) => literal(inner).map(|v| -v),
        _ => None,
    }
}
