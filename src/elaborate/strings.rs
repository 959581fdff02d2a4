//! Strings: what they are tied to and what guides them.

use super::codes;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::frames::{minus, norm};
use super::sheet::Sheet;
use super::structure::{SAME_POINT_MM, Structure};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Cable, ExprPoint};
use crate::syntax::ast;

impl<'a> Evaluator<'a> {
    /// Adds the strings to the structure.
    pub(super) fn strings(&mut self, scope: usize, sheet: &Sheet<'a>, s: &mut Structure<'a>) -> Outcome<()> {
        self.limit(sheet.strings.len(), "strings", sheet.strings.first().map(|c| c.1).unwrap_or_default())?;
        // Also of those that are wrong otherwise: their drives are measured as lengths all the same.
        for (text, _) in &sheet.strings {
            self.sliders.insert(text.name.node.clone());
            self.cables.insert(text.name.node.clone());
        }
        for (text, at) in &sheet.strings {
            if let Ok(cable) = self.string(scope, text, *at, s) {
                if !sheet.drives.iter().any(|d| d.joint.node == cable.name) && !sheet.broken {
                    self.out.push(
                        Diagnostic::error(
                            codes::STRING,
                            format!("string `{}` is not driven", cable.name),
                            *at,
                        )
                        .label("nothing pulls it")
                        .help(format!("add for instance `drive {} from 0 mm to 5 mm`", cable.name)),
                    );
                }
                s.string_index.insert(cable.name.clone(), s.strings.len());
                s.strings.push(cable);
            }
        }
        Ok(())
    }

    fn string(
        &mut self,
        scope: usize,
        text: &'a ast::Cable,
        at: Origin,
        s: &Structure<'a>,
    ) -> Outcome<Cable> {
        self.limit(text.via.len(), "points of a string", at)?;
        let from = self.thing(scope, &s.body_index, &text.from, "body");
        let to = self.thing(scope, &s.body_index, &text.to, "body");
        let mut point = |e: &'a ast::Expr| {
            let value = self.eval(&Env::fixed(scope), e);
            value.and_then(|v| self.as_point(v, e))
        };
        let tied = point(&text.at);
        let via: Vec<Outcome<ExprPoint>> = text.via.iter().map(point).collect();
        let (from, to, point) = (from?, to?, tied?);
        let via = via.into_iter().collect::<Outcome<Vec<_>>>()?;
        if from == to {
            return self.fail(
                Diagnostic::error(codes::STRING, "a string leads from one body to another", text.to.at)
                    .label(format!("`{}` again", text.to.node)),
            );
        }
        let Some(first) = via.first() else { return Err(Failed) };
        if norm(minus(self.start_point(*first), self.start_point(point))) < SAME_POINT_MM {
            return self.fail(
                Diagnostic::error(codes::STRING, "this string has no length to be pulled in", at)
                    .label("tied where it is guided"),
            );
        }
        Ok(Cable { name: text.name.node.clone(), from, point, to, via, origin: at })
    }
}
