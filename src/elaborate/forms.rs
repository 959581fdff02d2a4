//! Forms of terms: `form = …`, directions as what is tracked, stated loads of `sway`.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Failed, Outcome};
use crate::diagnostic::Diagnostic;
use crate::ir::ObjectiveKind;
use crate::syntax::ast::{Expr, ExprKind, Ident};

/// A direction without scale counts as a point 100 mm away does with the paper's weight: 1e5 · (0.1 m)².
const AIM_WEIGHT: f64 = 1e3;

impl<'a> Evaluator<'a> {
    /// `form = NAME`, one of `known`.
    pub(super) fn form(
        &mut self,
        function: &Ident,
        e: Option<&'a Expr>,
        known: &[&'static str],
    ) -> Outcome<Option<&'static str>> {
        let Some(e) = e else { return Ok(None) };
        let name = match &e.kind {
            ExprKind::Name(path) if path.len() == 1 => path.first().map_or("", |p| p.node.as_str()),
            ExprKind::Broken => return Err(Failed),
            _ => "",
        };
        if let Some(form) = known.iter().find(|k| **k == name) {
            return Ok(Some(form));
        }
        let d = Diagnostic::error(codes::ARGUMENTS, format!("`{}` has no such form", function.node), e.at);
        self.fail(d.help(format!("its `form` may be {}", known.join(" or "))))
    }

    /// `track` of a direction; scale, form and emphasis as written.
    pub(super) fn aim(
        &mut self,
        scope: usize,
        name: &Ident,
        [scale, form, emphasis]: [Option<&'a Expr>; 3],
    ) -> Outcome<(ObjectiveKind, f64)> {
        let directions = self.aims.directions.clone();
        let direction = self.thing(scope, &directions, name, "direction");
        let scale_rad = self.positive(scope, scale, Dimension::ANGLE, "a scale");
        let emphasis = self.emphasis(scope, emphasis);
        if let Some(e) = form {
            return self.fail(
                Diagnostic::error(codes::LATER_TERM, "forms for a direction are not available yet", e.at)
                    .help("a direction is compared with that of the same time"),
            );
        }
        let scale_rad = scale_rad?;
        let default = if scale_rad.is_some() { 1.0 } else { AIM_WEIGHT };
        Ok((ObjectiveKind::Aim { direction: direction?, scale_rad, emphasis: emphasis? }, default))
    }

    /// The load of `sway` where it is not the default pair: along a stated direction, or for the paper's form (none)
    /// along the in-plane normal of the path.
    pub(super) fn sway_loads(
        &mut self,
        scope: usize,
        function: &Ident,
        [along, form]: [Option<&'a Expr>; 2],
    ) -> Outcome<Option<Option<[f64; 3]>>> {
        let paper = self.form(function, form, &["paper"])?.is_some();
        match along {
            Some(e) => {
                let help = "write `along = z` or `along = (0, 0, 1)`";
                Ok(Some(Some(self.unit_direction(scope, e, "the direction of a force", help)?)))
            }
            None if paper => Ok(Some(None)),
            None => Ok(None),
        }
    }
}
