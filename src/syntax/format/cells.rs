//! Where columns begin: the table of what is set below what in neighbouring lines.

use super::super::tree::{Kind, Node};

/// The beginning of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Column {
    /// Columns of a line in order. Only equal ranks of neighbouring lines are set below each other …
    pub rank: u8,
    /// … and only where this is equal too.
    pub key: String,
    /// Spaces before it at least.
    pub space: usize,
}

/// A table's first clause, its others, and where templates stand.
const FIRST_CLAUSE: u8 = 4;
const TEMPLATE: u8 = 30;
const OVERRIDES: u8 = 31;
const ARGUMENT: u8 = 10;

/// The column that begins at child `at` of `node`, if one does.
pub(super) fn column(node: &Node, at: usize, source: &str) -> Option<Column> {
    let child = node.children.get(at)?;
    let text = source.get(child.range()).unwrap_or("");
    let new = |rank: u8, key: &str| Some(Column { rank, key: key.into(), space: 1 });
    let wide = |rank: u8, key: &str| Some(Column { rank, key: key.into(), space: 2 });
    match (node.kind, child.kind) {
        (Kind::Param | Kind::Let | Kind::Point, Kind::Ident) => new(0, "declared"),
        (Kind::Let | Kind::Point, Kind::Punctuation) if text == "=" => new(1, &format!("{:?}", node.kind)),
        (Kind::Body, Kind::Ident) => new(0, "body"),
        (Kind::Body, Kind::Points) => new(1, "body"),
        (Kind::Body, Kind::Layer) => wide(2, "body"),
        (Kind::Joint, Kind::Ident) if at > 0 => new(0, "joint"),
        (Kind::Joint, Kind::Bodies) => new(1, "joint"),
        (Kind::Joint, Kind::Keyword) => new(2, "joint"),
        (Kind::Joint, Kind::Template) => wide(TEMPLATE, "as"),
        (Kind::Joint, Kind::Axis | Kind::Layer | Kind::Pin | Kind::Fillet | Kind::Into) => {
            clause(node, at, "joint")
        }
        (Kind::Template, Kind::Overrides) => {
            let name = node.first(Kind::Ident).and_then(|i| source.get(i.range()));
            new(OVERRIDES, name.unwrap_or(""))
        }
        (Kind::Overrides, Kind::Field) => {
            let name = |n: &Node| n.first(Kind::Ident).and_then(|i| source.get(i.range())).unwrap_or("");
            let mut before: Vec<&str> =
                node.children.iter().take(at).filter(|c| c.kind == Kind::Field).map(name).collect();
            let rank = u8::try_from(before.len()).ok()?.checked_add(OVERRIDES)?;
            before.push(name(child));
            (before.len() > 1).then(|| Column { rank, key: before.join(","), space: 1 })
        }
        (Kind::Field, Kind::Punctuation) => new(0, "field"),
        (Kind::Drive | Kind::Rest, Kind::Ident) if at < 3 => new(0, "drive"),
        (Kind::Hole, Kind::Keyword) if at > 0 => match text {
            "on" => new(0, "hole"),
            "at" => new(1, "hole"),
            _ => new(2, "hole"),
        },
        (Kind::Mount | Kind::Horn, Kind::Ident) if at < 3 => new(0, "fitted"),
        (Kind::Mount | Kind::Horn, Kind::Keyword) if at > 0 => match text {
            "on" => new(1, "fitted"),
            _ => new(2, "fitted"),
        },
        (Kind::Solid, Kind::Text) => new(0, "solid"),
        (Kind::Solid, Kind::Keyword) if at > 0 => new(1, "solid"),
        (Kind::Solid, Kind::At) => new(2, "solid"),
        (Kind::Solid, Kind::Turned | Kind::Scaled) => clause(node, at, "solid"),
        (Kind::Load, Kind::Gravity | Kind::Moment | Kind::Force) => new(0, "drive"),
        (Kind::Drive, Kind::Range | Kind::By | Kind::Keys) => new(1, "drive"),
        (Kind::Rest, Kind::Keyword) if at > 0 => new(1, "drive"),
        (Kind::Range, Kind::Keyword) if at > 0 => new(2, "drive"),
        (Kind::Drive, Kind::Keyword) if text == "with" => new(3, "drive"),
        (Kind::Trace | Kind::Output | Kind::Target, Kind::Ident) if at < 3 => new(0, "watched"),
        (Kind::Trace | Kind::Output | Kind::Target, Kind::Punctuation) => new(1, "watched"),
        (Kind::Require, Kind::Punctuation) => new(0, "required"),
        (Kind::Term, Kind::Keyword) => new(0, "term"),
        (Kind::Place | Kind::Mirror, Kind::Ident) if at < 3 => new(0, "instance"),
        (Kind::Place | Kind::Mirror, Kind::Punctuation) => new(1, "instance"),
        (Kind::Place, Kind::Keyword) if at > 0 => new(2, "place"),
        (Kind::Mirror, Kind::Keyword) if at > 0 => new(2, "mirror"),
        (Kind::Place, Kind::Turned | Kind::Scaled | Kind::Merging) => clause(node, at, "place"),
        (Kind::Mirror, Kind::Sharing) => new(3, "mirror"),
        (Kind::RodFrom | Kind::RodTo, Kind::Ident) => new(0, "rod"),
        (Kind::RodFrom | Kind::RodTo, Kind::Keyword) if text == "at" => new(1, "rod"),
        (Kind::RodFrom | Kind::RodTo, Kind::Keyword) if text == "along" => new(2, "rod"),
        _ => None,
    }
}

/// A clause: the first ones stand below each other whatever they are, further ones below their like.
fn clause(node: &Node, at: usize, table: &str) -> Option<Column> {
    let is_clause = |k: Kind| {
        use Kind::{Axis, Fillet, Into, Layer, Merging, Pin, Scaled, Template, Turned};
        matches!(k, Axis | Fillet | Into | Layer | Merging | Pin | Scaled | Template | Turned)
    };
    let before: Vec<Kind> = node.children.iter().take(at).map(|c| c.kind).filter(|k| is_clause(*k)).collect();
    let rank = u8::try_from(before.len()).ok()?.checked_add(FIRST_CLAUSE)?;
    let key = match before.is_empty() {
        true => table.to_owned(),
        false => format!("{before:?}{:?}", node.children.get(at)?.kind),
    };
    (rank < TEMPLATE).then_some(Column { rank, key, space: 2 })
}

/// The column of argument `number` of a call that is all of a point's or `let`'s value.
pub(super) fn argument(function: &str, number: usize, count: usize) -> Option<Column> {
    let rank = u8::try_from(number).ok()?.checked_add(ARGUMENT)?;
    (number > 0).then(|| Column { rank, key: format!("{function}/{count}"), space: 1 })
}
