//! What names came to, for whoever shows it beside the text.

use super::dimension::Dimension;
use super::eval::Evaluator;
use super::scope::State;
use super::value::Value;
use crate::diagnostic::Origin;

/// The value of a declared name, at the start values of what is free.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownValue {
    /// Place of the name where it is declared.
    pub at: Origin,
    /// `50 mm`, `(40 mm, 0 mm, 0 mm)`.
    pub text: String,
}

impl Evaluator<'_> {
    /// Values of all names that could be evaluated: of a template used several times, those of its first use.
    pub(super) fn known(&self) -> Vec<KnownValue> {
        let locals = self.scopes.iter().flat_map(|s| &s.locals);
        locals
            .filter(|l| l.at != Origin::default())
            .filter_map(|l| match &l.state {
                State::Done(value) => Some(KnownValue { at: l.at, text: self.shown(value)? }),
                _ => None,
            })
            .chain(self.placed_values.iter().cloned())
            .collect()
    }

    fn shown(&self, value: &Value) -> Option<String> {
        let triple = |p: &[crate::ir::expr::ExprId; 3], unit: &str| {
            let [x, y, z] = p.map(|id| quantity(self.start_value(id), unit));
            format!("({x}, {y}, {z})")
        };
        Some(match value {
            Value::Scalar(s) => quantity(self.start_value(s.id), &s.dim.unit()),
            Value::Point(p) => triple(p, &Dimension::LENGTH.unit()),
            Value::Vector { v, dim, .. } => triple(v, &dim.unit()),
            Value::Circle { .. } | Value::Text(_) | Value::Record(_) => return None,
        })
    }
}

/// Significant digits that are shown: more than a printer keeps, fewer than a sum of tenths shows.
const DIGITS: i32 = 5;

/// A value in internal units as a designer reads it; angles in degrees.
pub fn quantity(value: f64, unit: &str) -> String {
    let (value, unit) = if unit == "rad" { (value.to_degrees(), "deg") } else { (value, unit) };
    let size = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    let rounded = if (-4..7).contains(&size) {
        let step = 10_f64.powi(DIGITS - 1 - size);
        // Adding zero takes the sign from a zero.
        format!("{}", (value * step).round() / step + 0.0)
    } else {
        format!("{value:.*e}", (DIGITS - 1) as usize)
    };
    if unit.is_empty() || unit == "1" { rounded } else { format!("{rounded} {unit}") }
}

#[cfg(test)]
mod tests {
    #[test]
    fn values_are_shown_as_designers_read_them() {
        for (value, unit, shown) in [
            (50.0, "mm", "50 mm"),
            (0.1 + 0.2, "mm", "0.3 mm"),
            (-0.0, "mm", "0 mm"),
            (std::f64::consts::FRAC_PI_6, "rad", "30 deg"),
            (1.0 / 3.0, "1", "0.33333"),
            (1.27e-9, "t/mm^3", "1.2700e-9 t/mm^3"),
            (123_456.7, "MPa", "123460 MPa"),
        ] {
            assert_eq!(super::quantity(value, unit), shown);
        }
    }
}
