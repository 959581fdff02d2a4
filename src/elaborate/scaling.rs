//! `place … scale = k`: every length drawn in the mechanism, and every bound, is multiplied where it is read. What
//! does not grow with the drawing stays: records (a process's limits, bought motors), pins, goals, and parameters of
//! a flexure that stand for a limit of the process.

use super::dimension::Dimension;
use super::eval::Evaluator;
use super::scope::LocalKind;
use crate::syntax::ast::{Expr, ExprKind};

impl<'a> Evaluator<'a> {
    /// What a number of this dimension is multiplied by: areas and volumes too, but nothing with a mass or time in it.
    pub(super) fn drawn(&self, dim: Dimension) -> f64 {
        let [length, rest @ ..] = dim.0;
        if self.as_is || self.scale == 1.0 || rest != [0; 3] { 1.0 } else { self.scale.powi(length.into()) }
    }

    /// Evaluates something that is not drawn.
    pub(super) fn unscaled<T>(&mut self, f: impl FnOnce(&mut Self) -> T) -> T {
        let around = std::mem::replace(&mut self.as_is, true);
        let value = f(self);
        self.as_is = around;
        value
    }

    /// Start and bounds of a free value. A start that shrinks while its bound, a limit of the process, does not,
    /// moves to that bound.
    pub(super) fn scaled_start(&self, [start, lower, upper]: [f64; 3]) -> [f64; 3] {
        let inside = if self.scale == 1.0 || lower >= upper { start } else { start.clamp(lower, upper) };
        [inside, lower, upper]
    }
}

/// Whether a value, or the default it replaces, stands for a limit of the process.
pub fn is_limit(kind: &LocalKind<'_>) -> bool {
    match kind {
        LocalKind::Value { value, default, .. } => names_process(default.map_or(value, |(_, d)| d)),
        _ => false,
    }
}

fn names_process(e: &Expr) -> bool {
    match &e.kind {
        ExprKind::Name(path) => path.len() == 2 && path.first().is_some_and(|p| p.node == "process"),
        ExprKind::Negate(inner) => names_process(inner),
        ExprKind::Binary(_, a, b) => names_process(a) || names_process(b),
        ExprKind::Call { arguments, .. } => arguments.iter().any(|a| names_process(&a.value)),
        ExprKind::Tuple(items) => items.iter().any(names_process),
        // A range may end at a limit without being one.
        ExprKind::About { .. }
        | ExprKind::Free { .. }
        | ExprKind::Number { .. }
        | ExprKind::Text(_)
        | ExprKind::Broken => false,
    }
}
