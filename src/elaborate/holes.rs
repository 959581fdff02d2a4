//! Holes of bodies.

use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::Sheet;
use super::structure::Structure;
use crate::diagnostic::Origin;
use crate::ir::Hole;
use crate::syntax::ast;

impl<'a> Evaluator<'a> {
    /// All holes, each in its body.
    pub(super) fn holes(&mut self, scope: usize, sheet: &Sheet<'a>, s: &mut Structure<'a>) {
        let first = sheet.holes.first().map(|h| h.1).unwrap_or_default();
        if self.limit(sheet.holes.len(), "holes", first).is_err() {
            return;
        }
        for (text, at) in &sheet.holes {
            let Ok((body, hole)) = self.hole(scope, text, *at, s) else { continue };
            s.bodies.get_mut(body).into_iter().for_each(|b| b.holes.push(hole.clone()));
        }
    }

    pub(super) fn hole(
        &mut self,
        scope: usize,
        text: &'a ast::Hole,
        at: Origin,
        s: &Structure<'a>,
    ) -> Outcome<(usize, Hole)> {
        let env = Env::fixed(scope);
        // Screws do not grow with the drawing.
        let what = "the diameter of a hole";
        let diameter = self.unscaled(|e| e.positive(scope, Some(&text.diameter), Dimension::LENGTH, what));
        let body = self.thing(scope, &s.body_index, &text.body, "body");
        let point = self.eval(&env, &text.point).and_then(|v| self.as_point(v, &text.point));
        let axis = match &text.along {
            Some(along) => self.unit_direction(
                scope,
                along,
                "the direction of a hole",
                "write `(0, 1, 0)`, or `x`, `y`, `z`",
            ),
            None => Ok([0.0, 0.0, 1.0]),
        };
        let (diameter_mm, body, position, axis) = (diameter?.ok_or(Failed)?, body?, point?, axis?);
        Ok((body, Hole { position, diameter_mm, axis, origin: at }))
    }
}
