//! `section A to B`: rods whose widths change along them.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use crate::diagnostic::Diagnostic;
use crate::ir::Section;
use crate::syntax::ast::{self, ExprKind};

impl<'a> Evaluator<'a> {
    /// The section at the end of a tapered rod: of the same shape as the one at its start.
    pub(super) fn section_to(
        &mut self,
        scope: usize,
        rod: &'a ast::Rod,
        path: &str,
    ) -> Outcome<Option<Section>> {
        let Some(to) = &rod.section_to else { return Ok(None) };
        if let (ExprKind::Call { function: first, .. }, ExprKind::Call { function: last, .. }) =
            (&rod.section.kind, &to.kind)
            && first.node != last.node
        {
            self.out.push(
                Diagnostic::error(
                    codes::TAPER,
                    format!("a rod cannot go from `{}` to `{}`", first.node, last.node),
                    last.at,
                )
                .also(first.at, "the section at its start")
                .help("give both ends the same shape; their widths may differ"),
            );
            return Err(Failed);
        }
        self.section(scope, to, &format!("{path}.to")).map(Some)
    }
}
