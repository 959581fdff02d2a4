//! `free START in LOWER .. UPPER`: design variables, their paths and bounds.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::value::{Scalar, Value};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::FreeVariable;
use crate::ir::expr::{ExprId, Node};
use crate::syntax::ast::Expr;

/// Most free variables; Chebyshev's linkage has 34, 17 a hinge.
const MAX_FREE: usize = 1_000;

impl<'a> Evaluator<'a> {
    pub(super) fn free_value(
        &mut self,
        env: &Env,
        start: &'a Expr,
        lower: &'a Expr,
        upper: &'a Expr,
        at: Origin,
    ) -> Outcome<Value> {
        let inner = Env { path: None, ..env.clone() };
        let s = self.eval(&inner, start);
        let l = self.eval(&inner, lower);
        let u = self.eval(&inner, upper);
        let (s, l, u) = (s?, l?, u?);
        let Value::Scalar(Scalar { id, dim }) = s else {
            return self.fail(Diagnostic::error(
                codes::TYPE,
                format!("only a number or quantity can be free, this is {}", s.a()),
                start.at,
            ));
        };
        let lower_id = self.scalar(l, lower, dim, "lower bound")?;
        let upper_id = self.scalar(u, upper, dim, "upper bound")?;
        if env.probe {
            return Ok(Value::Scalar(Scalar { id, dim }));
        }
        let Some(path) = &env.path else {
            return self
                .fail(Diagnostic::error(codes::FREE_PLACE, "nothing may be free here", at).help(
                    "`free` stands in `param`, `let`, `point`, `rest` and the overrides of a template",
                ));
        };
        let mut bounds = [0.0; 3];
        for (slot, (id, e)) in bounds.iter_mut().zip([(id, start), (lower_id, lower), (upper_id, upper)]) {
            *slot = match self.exprs.as_constant(id) {
                Some(v) => v,
                None => {
                    let mut d = Diagnostic::error(
                        codes::FREE_NESTED,
                        "start and bounds must be fixed numbers, this depends on a free value",
                        e.at,
                    );
                    if let Some(f) = self.free_behind(id) {
                        d = d.also(f, "free here");
                    }
                    return self.fail(d);
                }
            };
        }
        let path = self.unique_path(path);
        self.settable.insert(path.clone());
        // What is set or given may be free itself: then it is what is looked at here.
        let set = self.settings.find(&path).filter(|(_, e)| e.is_none_or(|e| e.at != at));
        if let Some((index, fixed)) = set {
            // `--set` of a free value inside a template fixes it.
            self.set_used.insert(index);
            let Some(fixed) = fixed else { return Err(Failed) };
            let id = self.eval_scalar_settings(env.scope, fixed, dim)?;
            return Ok(Value::Scalar(Scalar { id, dim }));
        }
        let [start_value, lower_value, upper_value] = self.scaled_start(bounds);
        if lower_value >= upper_value {
            return self.fail(
                Diagnostic::error(
                    codes::FREE_BOUNDS,
                    format!("the lower bound of `{path}` is not below the upper one"),
                    at,
                )
                .also(lower.at, self.show(lower_value, dim))
                .also(upper.at, self.show(upper_value, dim)),
            );
        }
        if !(lower_value..=upper_value).contains(&start_value) {
            return self.fail(
                Diagnostic::error(
                    codes::FREE_BOUNDS,
                    format!("the bounds of `{path}` do not contain its start"),
                    at,
                )
                .also(start.at, format!("starts at {}", self.show(start_value, dim)))
                .also(lower.at, self.show(lower_value, dim))
                .also(upper.at, self.show(upper_value, dim))
                .help("move the start between the bounds, or widen them"),
            );
        }
        if self.free.len() >= MAX_FREE {
            return self.fail(Diagnostic::error(
                codes::TOO_LARGE,
                format!("more than {MAX_FREE} free values"),
                at,
            ));
        }
        let index = self.free.len() as u32;
        self.starts.1.push(start_value);
        self.free.push(FreeVariable {
            path,
            unit: dim.unit(),
            start: start_value,
            lower: lower_value,
            upper: upper_value,
            origin: at,
        });
        let id = self.node(Node::Free(index), at)?;
        Ok(Value::Scalar(Scalar { id, dim }))
    }

    pub(super) fn eval_scalar_settings(
        &mut self,
        scope: usize,
        e: &'a Expr,
        dim: Dimension,
    ) -> Outcome<ExprId> {
        self.eval_scalar(&Env::fixed(scope), e, dim, "")
    }

    /// The path itself, or with `.2`, `.3` … when it is taken.
    pub(super) fn unique_path(&mut self, path: &str) -> String {
        let mut unique = path.to_string();
        let mut n = 2;
        while !self.paths.insert(unique.clone()) {
            unique = format!("{path}.{n}");
            n += 1;
        }
        unique
    }
}
