//! What a file consists of, and what can be folded.

use super::names::{Symbol, What};
use super::space::Text;
use crate::syntax::tree::{Kind, Node};
use std::ops::Range;

/// A declaration with those in it.
#[derive(Clone, Debug)]
pub struct Entry<'a> {
    /// The declaration.
    pub symbol: &'a Symbol,
    /// What it holds.
    pub inner: Vec<&'a Symbol>,
}

/// The declarations of a file.
pub fn outline(text: &Text) -> Vec<Entry<'_>> {
    let symbols = &text.names.symbols;
    let inner = |s: &Symbol| symbols.iter().filter(|i| s.opens.is_some() && i.block == s.opens).collect();
    symbols.iter().filter(|s| s.block.is_none()).map(|s| Entry { symbol: s, inner: inner(s) }).collect()
}

/// What can be folded: blocks, runs of comments and of imports; whether it is a comment.
pub fn folds(text: &Text) -> Vec<(Range<usize>, bool)> {
    let mut all = Vec::new();
    blocks(&text.tree, &mut all);
    let mut run: Option<(Kind, Range<usize>)> = None;
    let mut newlines = 0;
    for node in &text.tree.children {
        match node.kind {
            Kind::Newline => newlines += 1,
            Kind::Space => {}
            kind @ (Kind::Comment | Kind::Doc | Kind::Import) => {
                match &mut run {
                    Some((k, range)) if *k == kind && newlines <= 1 => range.end = node.end as usize,
                    _ => {
                        all.extend(run.take().map(|(k, r)| (r, k != Kind::Import)));
                        run = Some((kind, node.range()));
                    }
                }
                newlines = 0;
            }
            _ => all.extend(run.take().map(|(k, r)| (r, k != Kind::Import))),
        }
    }
    all.extend(run.map(|(k, r)| (r, k != Kind::Import)));
    all.retain(|(r, _)| text.text.get(r.clone()).is_some_and(|t| t.contains('\n')));
    all.sort_by_key(|(r, _)| (r.start, r.end));
    all
}

fn blocks(node: &Node, all: &mut Vec<(Range<usize>, bool)>) {
    use Kind::{Flexure, Keys, Mechanism, Minimize, Overrides, Record, Rod};
    if matches!(node.kind, Mechanism | Flexure | Record | Minimize | Rod | Keys | Overrides) {
        all.push((node.range(), false));
    }
    for child in &node.children {
        blocks(child, all);
    }
}

/// A word for what a name stands for.
pub fn word(what: What) -> &'static str {
    match what {
        What::Mechanism => "mechanism",
        What::Flexure => "flexure",
        What::Material => "material",
        What::Process => "process",
        What::Motor => "motor",
        What::Field => "field",
        What::Param => "param",
        What::Let => "let",
        What::Point => "point",
        What::Body => "body",
        What::Joint => "joint",
        What::Cable => "string",
        What::Trace => "trace",
        What::Output => "output",
        What::Instance => "instance",
        What::Rod => "rod",
        What::Case => "load case",
    }
}
