//! What recovery took, as diagnostics: one for each mistake, at its own place.

use super::grammar::{Failure, Wanted, why};
use super::lower::Lower;
use super::tree::{Kind, Node};
use crate::diagnostic::{Diagnostic, Origin};

/// State between neighbouring broken parts, so that one mistake is not told twice.
#[derive(Default)]
pub(super) struct Recovery {
    /// Parentheses that the broken statement before left open.
    open: usize,
    /// Run of declarations outside of any block: first and last byte.
    outside: Option<Origin>,
}

impl Recovery {
    /// A statement could be read: whatever was open before is over.
    pub(super) fn reset(&mut self) {
        self.open = 0;
    }
}

impl Lower<'_> {
    pub(super) fn bad_statement(&mut self, node: &Node) {
        self.broken(node, Wanted::Statement);
    }

    pub(super) fn bad_term(&mut self, node: &Node) {
        self.broken(node, Wanted::Term);
    }

    pub(super) fn bad_field(&mut self, node: &Node) {
        self.broken(node, Wanted::Field);
    }

    pub(super) fn bad_heading(&mut self, node: &Node) {
        self.broken(node.first(Kind::BadHeading).unwrap_or(node), Wanted::Item);
    }

    pub(super) fn stray(&mut self, node: &Node) {
        self.broken(node, Wanted::Item);
    }

    pub(super) fn finish(&mut self) {
        let _ = self.recovery.outside.take();
    }

    fn broken(&mut self, node: &Node, wanted: Wanted) {
        let start = node.start as usize;
        let Some(Failure { at, expected }) = why(self.source, start, wanted) else {
            let at = self.origin(node);
            self.report(Diagnostic::error("E0001", "this could not be read", at));
            return;
        };
        let at = self.at(at, at);
        self.report(Diagnostic::error("E0001", format!("expected {}", expected.join(", ")), at));
    }

    /// Reports a block whose `}` is missing.
    pub(super) fn closed(&mut self, block: &Node) {
        if block.first(Kind::NoBrace).is_none() {
            return;
        }
        let open = block.first(Kind::Punctuation).unwrap_or(block);
        let at = self.origin(open);
        self.report(Diagnostic::error("E0003", "this `{` is never closed", at));
    }
}
