//! Text to tree. The only client of pest.
//!
//! [`parse`] never fails: it gives a lossless tree, the AST of what could be understood, and a
//! diagnostic for what could not.

pub mod ast;
mod errors;
mod expression;
mod grammar;
mod lower;
mod statement;
pub mod tree;

use crate::diagnostic::Diagnostic;
use tree::Node;

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
    let tree = match grammar::tree(text) {
        Some(tree) => tree,
        None => Node { kind: tree::Kind::File, start: 0, end: text.len() as u32, children: Vec::new() },
    };
    let (ast, diagnostics) = lower::lower(&tree, text, file);
    Parse { tree, file: ast, diagnostics }
}
