//! `assert`: what must hold of a design's own numbers, before anything is solved.

use super::codes;
use super::eval::{Env, Evaluator, Outcome};
use super::sheet::Sheet;
use super::value::Value;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::expr::ExprId;
use crate::syntax::ast::{Assert, Compare, Expr};

/// Two sides that agree to this part of the larger are equal: 0.1 mm three times is 0.3 mm.
const EQUAL: f64 = 1e-12;

impl<'a> Evaluator<'a> {
    /// Reports every assertion of a mechanism that does not hold.
    pub(super) fn assertions(&mut self, scope: usize, sheet: &Sheet<'a>) {
        for (assert, at) in &sheet.asserts {
            // What is wrong in one has been told.
            let _ = self.assertion(scope, assert, *at);
        }
    }

    fn assertion(&mut self, scope: usize, assert: &'a Assert, at: Origin) -> Outcome<()> {
        let value = self.eval(&Env::fixed(scope), &assert.left)?;
        let Value::Scalar(left) = &value else {
            let message = format!("only numbers and quantities can be compared, this is {}", value.a());
            return self.fail(Diagnostic::error(codes::TYPE, message, assert.left.at));
        };
        let dim = left.dim;
        let left = self.asserted(left.id, &assert.left)?;
        let right = self.eval_scalar(&Env::fixed(scope), &assert.right, dim, "")?;
        let right = self.asserted(right, &assert.right)?;
        let equal = (left - right).abs() <= EQUAL * left.abs().max(right.abs());
        let holds = match assert.op.node {
            Compare::LessEqual => equal || left < right,
            Compare::GreaterEqual => equal || left > right,
            Compare::Less => !equal && left < right,
            Compare::Greater => !equal && left > right,
        };
        if holds {
            return Ok(());
        }
        let shown = |v: f64| match dim.unit().as_str() {
            "1" => format!("{v}"),
            "rad" => format!("{:.6} deg", v.to_degrees()),
            unit => format!("{v:.6} {unit}"),
        };
        let message = format!("an assertion does not hold: {}", assert.message.node);
        self.fail(Diagnostic::error(codes::ASSERTION, message, at).label(format!(
            "{} on the left, {} on the right",
            shown(left),
            shown(right)
        )))
    }

    fn asserted(&mut self, id: ExprId, e: &Expr) -> Outcome<f64> {
        self.fixed(id, e.at, "what is asserted")
    }
}
