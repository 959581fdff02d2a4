//! Expressions: concrete tree to [`ast::Expr`].

use super::ast::{Argument, BinaryOp, Expr, ExprKind, UnitFactor};
use super::lower::Lower;
use super::tree::{Kind, Node};
use crate::diagnostic::Diagnostic;

/// Deepest expression tree handed on: a chain `a + b + …` is as deep as it is long, and later
/// stages walk it recursively. Samples stay below 10.
const MAX_EXPRESSION_DEPTH: u32 = 200;

impl Lower<'_> {
    /// The expression of a [`Kind::Value`] node (or of any expression node).
    pub(super) fn expr(&mut self, node: &Node) -> Expr {
        let (expr, depth) = self.measured(node);
        if depth <= MAX_EXPRESSION_DEPTH {
            return expr;
        }
        let at = expr.at;
        self.report(
            Diagnostic::error("E0013", "this expression is too long", at)
                .label(format!("more than {MAX_EXPRESSION_DEPTH} operations within each other"))
                .help("give parts of it names with `let`"),
        );
        // Taken apart piece by piece: dropping a long chain at once would recurse as deep.
        dismantle(expr);
        Expr { kind: ExprKind::Broken, at }
    }

    /// Expression and the depth of its tree.
    fn measured(&mut self, node: &Node) -> (Expr, u32) {
        let at = self.origin(node);
        let broken = (Expr { kind: ExprKind::Broken, at }, 1);
        match node.kind {
            Kind::Value => match node.parts().next() {
                Some(inner) => self.measured(inner),
                None => broken,
            },
            Kind::Sum | Kind::Product | Kind::Power => self.chain(node).unwrap_or(broken),
            Kind::Unary => {
                let negative = node.first(Kind::Punctuation).is_some();
                let Some(inner) = node.parts().last() else { return broken };
                let (inner, depth) = self.measured(inner);
                if !negative {
                    return (inner, depth);
                }
                (Expr { kind: ExprKind::Negate(Box::new(inner)), at }, depth + 1)
            }
            Kind::Free => {
                let operands = node.parts().filter(|n| !matches!(n.kind, Kind::Keyword | Kind::Punctuation));
                let operands: Vec<_> = operands.map(|n| self.measured(n)).collect();
                let mut parts = operands.into_iter();
                match (parts.next(), parts.next(), parts.next()) {
                    (Some((start, a)), Some((lower, b)), Some((upper, c))) => {
                        let kind = ExprKind::Free {
                            start: Box::new(start),
                            lower: Box::new(lower),
                            upper: Box::new(upper),
                        };
                        (Expr { kind, at }, a.max(b).max(c) + 1)
                    }
                    _ => broken,
                }
            }
            Kind::Tuple => {
                let mut items = Vec::new();
                let mut depth = 0;
                for item in node.all(Kind::Value) {
                    let (item, d) = self.measured(item);
                    depth = d.max(depth);
                    items.push(item);
                }
                match (items.len(), items.pop()) {
                    (1, Some(only)) => (only, depth),
                    (_, Some(last)) => {
                        items.push(last);
                        (Expr { kind: ExprKind::Tuple(items), at }, depth + 1)
                    }
                    _ => broken,
                }
            }
            Kind::Call => {
                let Some(function) = self.ident(node) else { return broken };
                let mut depth = 0;
                let mut arguments = Vec::new();
                for argument in node.all(Kind::Argument) {
                    if let Some(about) = argument.first(Kind::About) {
                        if let (Some(body), Some(axis)) = (self.ident(about), about.first(Kind::Value)) {
                            let (axis, d) = self.measured(axis);
                            depth = (d + 1).max(depth);
                            let kind = ExprKind::About { body, axis: Box::new(axis) };
                            let value = Expr { kind, at: self.origin(about) };
                            arguments.push(Argument { name: None, value });
                        }
                        continue;
                    }
                    let Some(value) = argument.first(Kind::Value) else { continue };
                    let (value, d) = self.measured(value);
                    depth = d.max(depth);
                    arguments.push(Argument { name: self.ident(argument), value });
                }
                (Expr { kind: ExprKind::Call { function, arguments }, at }, depth + 1)
            }
            Kind::Name => (Expr { kind: ExprKind::Name(self.indexed(node)), at }, 1),
            Kind::Text => (Expr { kind: ExprKind::Text(self.quoted(node)), at }, 1),
            Kind::Number => (self.number(node), 1),
            Kind::Exponent => {
                let value = self.text(node).parse().unwrap_or(0.0);
                (Expr { kind: ExprKind::Number { value, unit: Vec::new() }, at }, 1)
            }
            _ => broken,
        }
    }

    /// `a op b op c`, grouped from the left. Each result spans its operands.
    fn chain(&mut self, node: &Node) -> Option<(Expr, u32)> {
        let mut parts = node.parts();
        // Parentheses are parts of the text, not of the expression inside them.
        let first = parts.next()?;
        let mut at = self.origin(first);
        let (mut left, mut depth) = self.measured(first);
        while let (Some(operator), Some(right)) = (parts.next(), parts.next()) {
            let operator = match self.text(operator) {
                "+" => BinaryOp::Add,
                "-" => BinaryOp::Subtract,
                "*" => BinaryOp::Multiply,
                "/" => BinaryOp::Divide,
                _ => BinaryOp::Power,
            };
            at.end = self.origin(right).end;
            let (right, d) = self.measured(right);
            depth = depth.max(d) + 1;
            left = Expr { kind: ExprKind::Binary(operator, Box::new(left), Box::new(right)), at };
        }
        Some((left, depth))
    }

    fn number(&mut self, node: &Node) -> Expr {
        let at = self.origin(node);
        let digits = node.first(Kind::Digits).map_or("", |n| self.text(n));
        let value: f64 = digits.parse().unwrap_or(f64::INFINITY);
        if !value.is_finite() {
            self.report(
                Diagnostic::error("E0007", "this number is too large", at)
                    .label("beyond 1.8e308")
                    .help("use a larger unit or a smaller exponent"),
            );
            return Expr { kind: ExprKind::Broken, at };
        }
        let unit = match node.first(Kind::Unit) {
            Some(unit) => self.unit(unit),
            None => Vec::new(),
        };
        Expr { kind: ExprKind::Number { value, unit }, at }
    }

    fn unit(&mut self, node: &Node) -> Vec<UnitFactor> {
        let mut factors = Vec::new();
        let mut sign = 1;
        for part in node.parts() {
            if part.kind == Kind::UnitOperator {
                sign = if self.text(part) == "/" { -1 } else { 1 };
                continue;
            }
            let Some(symbol) = part.first(Kind::UnitSymbol) else { continue };
            let power = part.first(Kind::UnitPower);
            let exponent = match power.map(|p| self.text(p).trim_start_matches('^').parse::<i8>()) {
                None => 1,
                Some(Ok(exponent)) => i32::from(exponent),
                Some(Err(_)) => {
                    let at = self.origin(part);
                    self.report(
                        Diagnostic::error("E0007", "this exponent is too large", at)
                            .label("units take exponents from -128 to 127"),
                    );
                    1
                }
            };
            let symbol = self.named(symbol);
            factors.push(UnitFactor { symbol, exponent: sign * exponent });
        }
        factors
    }
}

/// Drops an expression without recursion.
fn dismantle(expr: Expr) {
    let mut todo = vec![expr];
    while let Some(expr) = todo.pop() {
        match expr.kind {
            ExprKind::Tuple(items) => todo.extend(items),
            ExprKind::Negate(a) | ExprKind::About { axis: a, .. } => todo.push(*a),
            ExprKind::Binary(_, a, b) => todo.extend([*a, *b]),
            ExprKind::Call { arguments, .. } => todo.extend(arguments.into_iter().map(|a| a.value)),
            ExprKind::Free { start, lower, upper } => todo.extend([*start, *lower, *upper]),
            ExprKind::Number { .. } | ExprKind::Name(_) | ExprKind::Text(_) | ExprKind::Broken => {}
        }
    }
}
