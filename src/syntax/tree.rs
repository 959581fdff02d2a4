//! The lossless concrete tree: every byte of a file belongs to exactly one leaf, trivia included,
//! so that the tree prints back what was read.

use std::ops::Range;

/// What a [`Node`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // The names are the grammar's; `grammar/mech.pest` says what each holds.
pub enum Kind {
    // trivia
    Space,
    Newline,
    Comment,
    Doc,
    ByteOrderMark,
    /// Bytes that a broken statement took and that are no trivia.
    Junk,
    // tokens
    Keyword,
    Punctuation,
    Ident,
    Text,
    Digits,
    Integer,
    Exponent,
    UnitSymbol,
    UnitPower,
    UnitOperator,
    /// A `}` that is not there (no bytes).
    NoBrace,
    // expressions
    Value,
    Free,
    Sum,
    Product,
    Unary,
    Power,
    Tuple,
    Call,
    Argument,
    About,
    Name,
    Number,
    Unit,
    UnitFactor,
    // statements and their parts
    Param,
    Dimension,
    Let,
    Point,
    Body,
    Points,
    Layer,
    Joint,
    Bodies,
    Axis,
    Pin,
    Fillet,
    Into,
    Template,
    Overrides,
    Field,
    MaterialUse,
    Print,
    Links,
    Model,
    Cycle,
    Drive,
    Range,
    By,
    Keys,
    Key,
    Drum,
    Rest,
    Trace,
    Output,
    Workspace,
    Stretch,
    Target,
    Minimize,
    Term,
    Require,
    Export,
    Artefact,
    Rod,
    RodFrom,
    RodTo,
    RodSection,
    Place,
    Turned,
    Scaled,
    Merging,
    Mirror,
    Sharing,
    Allow,
    RodAxis,
    OwnBody,
    String,
    Via,
    Load,
    Hole,
    Mount,
    Horn,
    Plate,
    Solid,
    /// The place of a solid.
    At,
    /// A clause of a mount or a horn.
    Fitted,
    Gravity,
    Moment,
    Force,
    Index,
    Assert,
    Variant,
    Setting,
    For,
    Case,
    Later,
    // items
    File,
    Edition,
    Import,
    Path,
    Mechanism,
    Flexure,
    Record,
    // what recovery took
    BadStatement,
    BadTerm,
    BadField,
    BadHeader,
    BadHeading,
    Stray,
}

impl Kind {
    /// Whether this is white space or a comment.
    pub fn is_trivia(self) -> bool {
        matches!(self, Kind::Space | Kind::Newline | Kind::Comment | Kind::Doc | Kind::ByteOrderMark)
    }
}

/// A node of the concrete tree. The children of an inner node cover its bytes without gap or
/// overlap; a leaf has none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// What it is.
    pub kind: Kind,
    /// First byte in the file.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
    /// Parts in order; empty for a leaf.
    pub children: Box<[Node]>,
}

impl Node {
    /// Byte range in the file.
    pub fn range(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    /// The bytes of this node, pieced together from its leaves.
    pub fn print(&self, source: &str) -> String {
        let mut out = String::with_capacity(self.range().len());
        self.leaves(&mut |leaf| out.push_str(source.get(leaf.range()).unwrap_or("")));
        out
    }

    /// Calls `f` for every leaf in order.
    pub fn leaves(&self, f: &mut impl FnMut(&Node)) {
        if self.children.is_empty() {
            f(self);
        }
        for child in &self.children {
            child.leaves(f);
        }
    }

    /// First direct child of a kind.
    pub fn first(&self, kind: Kind) -> Option<&Node> {
        self.children.iter().find(|c| c.kind == kind)
    }

    /// Direct children of a kind.
    pub fn all(&self, kind: Kind) -> impl Iterator<Item = &Node> {
        self.children.iter().filter(move |c| c.kind == kind)
    }

    /// Direct children that are not trivia.
    pub fn parts(&self) -> impl Iterator<Item = &Node> {
        self.children.iter().filter(|c| !c.kind.is_trivia())
    }

    /// An indented outline with byte ranges and the text of leaves, for tests and debugging.
    pub fn outline(&self, source: &str) -> String {
        let mut out = String::new();
        self.outline_into(source, 0, &mut out);
        out
    }

    fn outline_into(&self, source: &str, depth: usize, out: &mut String) {
        let Range { start, end } = self.range();
        let pad = "  ".repeat(depth);
        out.push_str(&format!("{pad}{:?} {start}..{end}", self.kind));
        if self.children.is_empty() {
            out.push_str(&format!(" {:?}", source.get(start..end).unwrap_or("")));
        }
        out.push('\n');
        for child in &self.children {
            child.outline_into(source, depth + 1, out);
        }
    }
}

/// Appends leaves for the bytes `range` of `source`, which hold trivia and, in broken parts, junk.
pub(super) fn fill(source: &str, range: Range<usize>, into: &mut Vec<Node>) {
    let mut at = range.start;
    while at < range.end {
        let rest = source.get(at..range.end).unwrap_or("");
        let (kind, length) = trivia(rest);
        let length = length.max(1).min(range.end - at);
        into.push(Node { kind, start: at as u32, end: (at + length) as u32, children: Box::default() });
        at += length;
    }
}

/// Kind and length of the first leaf of `rest`, which is not empty.
fn trivia(rest: &str) -> (Kind, usize) {
    let until = |stop: &dyn Fn(char) -> bool| rest.find(stop).unwrap_or(rest.len());
    let is_blank = |c: char| c == ' ' || c == '\t';
    let is_eol = |c: char| c == '\n' || c == '\r';
    match rest.chars().next() {
        Some(c) if is_blank(c) => (Kind::Space, until(&|c| !is_blank(c))),
        Some('\r') if rest.starts_with("\r\n") => (Kind::Newline, 2),
        Some(c) if is_eol(c) => (Kind::Newline, 1),
        Some('\u{FEFF}') => (Kind::ByteOrderMark, 3),
        Some('/') if rest.starts_with("//") => {
            let length = until(&is_eol);
            let doc = rest.starts_with("//!") || rest.starts_with("///") && !rest.starts_with("////");
            (if doc { Kind::Doc } else { Kind::Comment }, length)
        }
        _ => {
            let stop = until(&|c| is_blank(c) || is_eol(c));
            // Looked for within the word only: a search to the end would be quadratic.
            let comment = rest.get(..stop).and_then(|word| word.find("//"));
            (Kind::Junk, comment.unwrap_or(stop))
        }
    }
}
