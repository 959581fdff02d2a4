//! Load cases, and what is asked of a mechanism or of one of its cases.

use super::codes;
use super::eval::{Evaluator, Outcome};
use super::mechanism::{Outside, quote};
use super::sheet::Sheet;
use super::structure::Structure;
use super::terms::Named;
use crate::diagnostic::Diagnostic;
use crate::ir::{LoadCase, Objective, Quantity, Requirement};
use crate::syntax::ast::Ident;

impl<'a> Evaluator<'a> {
    /// The terms and requirements of a mechanism or of a case; those that are wrong are left out.
    pub(super) fn goals(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        named: &Named,
        outside: &Outside<'_>,
    ) -> (Vec<Objective>, Vec<Requirement>) {
        let mut objectives = Vec::new();
        for term in sheet.minimize.map(|(terms, _)| terms).unwrap_or_default() {
            objectives.extend(self.objective(scope, term, named));
        }
        let mut requirements = Vec::new();
        for text in &sheet.requires {
            let line = quote(outside.sources, text.at);
            requirements.extend(self.requirement(scope, text, named.traces, named.driven, &line));
        }
        (objectives, requirements)
    }

    /// All load cases; what is wrong in them is told.
    pub(super) fn cases(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        s: &Structure<'a>,
        named: &Named,
        weightless: Option<&str>,
        outside: &Outside<'_>,
    ) -> Vec<LoadCase> {
        let mut cases = Vec::new();
        if self
            .limit(sheet.cases.len(), "load cases", sheet.cases.first().map(|c| c.2).unwrap_or_default())
            .is_err()
        {
            return cases;
        }
        for (name, inner, at) in &sheet.cases {
            let around = std::mem::replace(&mut self.as_is, false);
            let loads = self.loads(scope, inner, s, weightless);
            self.as_is = around;
            self.loaded = true;
            let (objectives, requirements) = self.goals(scope, inner, named, outside);
            let Ok(loads) = loads else { continue };
            if self.has_loads(name, inner).and_then(|()| self.without_solids(&requirements)).is_ok() {
                cases.push(LoadCase {
                    name: name.node.clone(),
                    loads,
                    objectives,
                    requirements,
                    origin: *at,
                });
            }
        }
        cases
    }

    /// A case is its loads.
    fn has_loads(&mut self, name: &Ident, sheet: &Sheet<'a>) -> Outcome<()> {
        if !sheet.loads.is_empty() || sheet.broken || sheet.later {
            return Ok(());
        }
        self.fail(
            Diagnostic::error(codes::MISSING, format!("load case `{}` has no load", name.node), name.at)
                .help("add for instance `load 2 N along (0, -1, 0) on coupler at P`"),
        )
    }

    /// Solids are compared as they move without the loads of cases.
    fn without_solids(&mut self, requirements: &[Requirement]) -> Outcome<()> {
        match requirements.iter().find(|r| r.quantity == Quantity::Gap) {
            Some(gap) => self.later(codes::LATER_TERM, "gap() in a load case", gap.origin),
            None => Ok(()),
        }
    }
}
