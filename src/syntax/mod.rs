//! Text to tree. The only client of pest.
//!
//! [`parse`] never fails: it gives a lossless tree, the AST of what could be understood, and a
//! diagnostic for what could not.

pub mod ast;
mod errors;
mod expression;
pub mod format;
mod found;
mod grammar;
mod instances;
pub mod limits;
mod lower;
mod statement;
pub mod tree;
mod words;

use crate::diagnostic::{Diagnostic, Origin};
use tree::{Kind, Node};

/// What [`parse`] gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Parse {
    /// Lossless tree: it prints back the text, byte by byte.
    pub tree: Node,
    /// What was understood.
    pub file: ast::File,
    /// What was not, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
}

/// Parses the text of a `.mech` file; `file` is its index in the source map.
pub fn parse(file: u32, text: &str) -> Parse {
    if let Some(diagnostic) = limits::check(file, text) {
        return unread(text, diagnostic);
    }
    match grammar::tree(text) {
        Some(tree) => {
            let (ast, diagnostics) = lower::lower(&tree, text, file);
            Parse { tree, file: ast, diagnostics }
        }
        // The grammar accepts every text; it gives up only where the thread's stack is too small.
        None => {
            let at = Origin { file, start: 0, end: 0 };
            let message = "this file could not be read: its nesting needs more stack than there is";
            unread(text, Diagnostic::error("E0006", message, at))
        }
    }
}

/// A tree of one leaf, for text that the grammar is not given.
fn unread(text: &str, diagnostic: Diagnostic) -> Parse {
    // Offsets are 32 bits wide: of a larger text the tree holds what it can count.
    let end = u32::try_from(text.len()).unwrap_or(u32::MAX);
    let leaf = Node { kind: Kind::Junk, start: 0, end, children: Box::default() };
    let tree = Node { kind: Kind::File, start: 0, end, children: Box::new([leaf]) };
    Parse { tree, file: ast::File::default(), diagnostics: vec![diagnostic] }
}

/// Words that can start a line in a block of a kind, or at the top of a file for [`tree::Kind::File`].
pub fn starting_words(block: tree::Kind) -> Vec<&'static str> {
    words::starting(block)
}

/// How a statement is written, by the word it starts with.
pub fn statement_form(word: &str) -> Option<&'static str> {
    words::form(word)
}
