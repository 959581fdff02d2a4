//! `place NAME = MECHANISM { parameter = value … }`: values are worked out where they are written and handed to the placed
//! mechanism as numbers, since the names of the two are apart.

use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Outcome};
use crate::diagnostic::Origin;
use crate::syntax::ast::{At, Expr, ExprKind, Ident, Item, UnitFactor};

/// What is given for a parameter.
#[derive(Clone)]
pub struct Given {
    /// The parameter.
    pub name: String,
    /// A number with its unit, or `free` between such numbers.
    pub value: Expr,
    /// The numbers, in internal units.
    numbers: Vec<f64>,
}

/// Tells given values apart: name, and bits of the numbers. Their dimensions are those of the parameter.
pub type GivenKey = (String, Vec<u64>);

impl Given {
    /// Equal keys give equal designs.
    pub fn key(&self) -> GivenKey {
        (self.name.clone(), self.numbers.iter().map(|x| x.to_bits()).collect())
    }
}

/// Kilograms in the internal mass unit.
const KG_PER_TONNE: f64 = 1e3;

impl<'a> Evaluator<'a> {
    /// What a `place` gives for the parameters of the mechanism at `item`, sorted by name.
    pub(super) fn given(
        &mut self,
        scope: usize,
        item: (usize, usize),
        overrides: &'a [(Ident, Expr)],
    ) -> Outcome<Vec<Given>> {
        let Some(Item::Mechanism(m)) = self.program.item(item) else { return Ok(Vec::new()) };
        if let Some((first, _)) = overrides.first() {
            self.limit(overrides.len(), "overrides", first.at)?;
        }
        let mut ok = self.check_overrides(&m.name.node, &m.statements, overrides);
        let mut all = Vec::new();
        for (name, value) in overrides {
            match self.given_value(scope, value) {
                Ok((value, numbers)) => all.push(Given { name: name.node.clone(), value, numbers }),
                Err(failed) => ok = Err(failed),
            }
        }
        all.sort_by(|a, b| a.name.cmp(&b.name));
        ok.map(|()| all)
    }

    fn given_value(&mut self, scope: usize, e: &'a Expr) -> Outcome<(Expr, Vec<f64>)> {
        let ExprKind::Free { start, lower, upper } = &e.kind else {
            let (value, x) = self.given_number(scope, e)?;
            return Ok((value, vec![x]));
        };
        let (start, lower, upper) = (
            self.given_number(scope, start),
            self.given_number(scope, lower),
            self.given_number(scope, upper),
        );
        let ((start, a), (lower, b), (upper, c)) = (start?, lower?, upper?);
        let kind = ExprKind::Free { start: Box::new(start), lower: Box::new(lower), upper: Box::new(upper) };
        Ok((Expr { kind, at: e.at }, vec![a, b, c]))
    }

    fn given_number(&mut self, scope: usize, e: &'a Expr) -> Outcome<(Expr, f64)> {
        let s = self.any_scalar(&Env::fixed(scope), e)?;
        let x = self.fixed(s.id, e.at, "a parameter of an instance")?;
        Ok((number(x, s.dim, e.at), x))
    }
}

/// The literal of a value in internal units.
fn number(x: f64, dim: Dimension, at: Origin) -> Expr {
    let [length, mass, time, angle] = dim.0;
    let factors = [("mm", length), ("kg", mass), ("s", time), ("rad", angle)];
    let unit = factors
        .into_iter()
        .filter(|(_, e)| *e != 0)
        .map(|(symbol, e)| UnitFactor { symbol: At { node: symbol.into(), at }, exponent: e.into() })
        .collect();
    Expr { kind: ExprKind::Number { value: x * KG_PER_TONNE.powi(mass.into()), unit }, at }
}
