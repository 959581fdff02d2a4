//! Colours that need to know what a name stands for.

use super::names::What;
use super::space::Space;
use crate::syntax::tree::{Kind, Node};
use std::collections::BTreeMap;
use std::ops::Range;

/// Kinds of tokens, in the order of the legend.
pub const LEGEND: &[&str] = &[
    "keyword",
    "number",
    "type",
    "string",
    "comment",
    "function",
    "parameter",
    "variable",
    "property",
    "class",
    "operator",
];

/// The tokens of a file: place and index into [`LEGEND`]. None reaches over a line's end.
pub fn tokens(space: &Space, file: &str) -> Vec<(Range<usize>, usize)> {
    let Some(text) = space.files.get(file) else { return Vec::new() };
    let mut names: BTreeMap<usize, What> = BTreeMap::new();
    for mention in &text.names.mentions {
        if let Some(symbol) = space.resolve(file, mention).and_then(|p| space.symbol(&p).cloned()) {
            names.insert(mention.at.start, symbol.what);
        }
    }
    names.extend(text.names.symbols.iter().map(|s| (s.at.start, s.what)));
    let mut all = Vec::new();
    walk(&text.tree, &text.tree, &text.text, &names, &mut all);
    all
}

fn walk(
    node: &Node,
    parent: &Node,
    source: &str,
    names: &BTreeMap<usize, What>,
    all: &mut Vec<(Range<usize>, usize)>,
) {
    for child in &node.children {
        walk(child, node, source, names, all);
    }
    if !node.children.is_empty() {
        return;
    }
    let text = source.get(node.range()).unwrap_or("");
    let kind = match node.kind {
        Kind::Keyword => 0,
        Kind::Digits | Kind::Integer | Kind::Exponent => 1,
        Kind::UnitSymbol | Kind::UnitPower | Kind::UnitOperator => 2,
        Kind::Text => 3,
        Kind::Comment | Kind::Doc => 4,
        Kind::Ident => match (names.get(&(node.start as usize)), parent.kind) {
            (Some(what), _) => of(*what),
            (None, Kind::Call) => 5,
            (None, Kind::Argument | Kind::Field) => 6,
            (None, Kind::Dimension) => 2,
            // `hinge`, `yz`, `plain`: words of the language.
            (None, Kind::Joint | Kind::Flexure | Kind::Mirror | Kind::Model) => 0,
            _ => return,
        },
        Kind::Punctuation if "+-*/^<=>=..".contains(text) => 10,
        _ => return,
    };
    if !text.is_empty() {
        all.push((node.range(), kind));
    }
}

fn of(what: What) -> usize {
    match what {
        What::Mechanism | What::Flexure | What::Material | What::Process | What::Motor => 9,
        What::Field => 8,
        What::Param => 6,
        _ => 7,
    }
}
