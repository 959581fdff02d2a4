//! Tree to lines: what stands in one, how deep it is indented, and where its columns begin.

use super::super::tree::{Kind, Node};
use super::cells::{self, Column};

/// One line of the new text.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    pub kind: LineKind,
    /// Spaces before the first cell.
    pub indent: usize,
    /// Text in pieces, each the beginning of a column but for the first.
    pub cells: Vec<Cell>,
    /// Comment behind the text, or all of a comment's line.
    pub comment: String,
    /// A blank line stands before it.
    pub blank: bool,
    /// Goes on with the statement of the line above.
    pub continues: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum LineKind {
    #[default]
    Code,
    Comment,
    /// Left as it is, with its own indentation.
    AsIs,
}

/// A piece of a line.
#[derive(Clone, Debug, Default)]
pub(super) struct Cell {
    pub text: String,
    /// None where it is no column's beginning.
    pub column: Option<Column>,
}

/// The lines of a file, and where parts with errors begin.
pub(super) fn lines(tree: &Node, source: &str) -> (Vec<Line>, Vec<u32>) {
    let mut builder = Builder {
        source,
        lines: Vec::new(),
        line: None,
        open: Vec::new(),
        newlines: 0,
        space: "",
        starts: true,
        tight: true,
        column: None,
        left: Vec::new(),
        table: false,
    };
    builder.node(tree);
    builder.end_line();
    let mut lines = builder.lines;
    indent_comments(&mut lines);
    (lines, builder.left)
}

/// White space of the language: anything else is a sign somebody wrote.
pub(super) const BLANK: [char; 4] = [' ', '\t', '\n', '\r'];

/// Spaces of one level.
const LEVEL: usize = 4;

/// A bracket that is open.
struct Bracket {
    /// Index of the line on which it was opened.
    line: usize,
    /// Statements stand in it.
    block: bool,
}

struct Builder<'a> {
    source: &'a str,
    lines: Vec<Line>,
    line: Option<Line>,
    open: Vec<Bracket>,
    /// Line ends since the last token or comment.
    newlines: usize,
    /// White space just before what comes.
    space: &'a str,
    /// What comes is the first token of a statement.
    starts: bool,
    /// No space before what comes.
    tight: bool,
    /// What comes begins this column.
    column: Option<Column>,
    /// Where parts with errors begin.
    left: Vec<u32>,
    /// The next call's arguments are columns.
    table: bool,
}

/// Nodes whose parts are statements, one a line.
fn is_block(kind: Kind) -> bool {
    use Kind::{BadHeader, Case, File, Flexure, For, Mechanism, Minimize, Record, Rod};
    matches!(kind, File | Mechanism | Flexure | Record | Minimize | Rod | For | Case | BadHeader)
}

/// Whether a value is one call and nothing else.
fn is_call(value: &Node) -> bool {
    value.kind == Kind::Value && value.children.len() == 1 && value.first(Kind::Call).is_some()
}

/// What recovery took, and what this version does not understand.
fn is_left(node: &Node) -> bool {
    use Kind::{BadField, BadHeading, BadStatement, BadTerm, Junk, Later, Stray};
    matches!(node.kind, BadStatement | BadTerm | BadField | BadHeading | Stray | Later | Junk)
        // Without its `}` nobody knows what belongs into a block.
        || node.first(Kind::NoBrace).is_some()
}

impl<'a> Builder<'a> {
    fn text(&self, node: &Node) -> &'a str {
        self.source.get(node.range()).unwrap_or("")
    }

    fn node(&mut self, node: &Node) {
        if is_left(node) {
            self.left.extend((node.kind != Kind::Later).then_some(node.start));
            return self.as_is(node);
        }
        let table = node.kind == Kind::Call && std::mem::take(&mut self.table);
        let mut arguments = 0;
        for (at, child) in node.children.iter().enumerate() {
            let text = self.text(child);
            match child.kind {
                Kind::Newline => {
                    self.newlines += 1;
                    self.space = "";
                }
                Kind::Space => self.space = text,
                Kind::Comment | Kind::Doc => self.comment(text),
                // At the very start of the file; `format` sees to it.
                Kind::ByteOrderMark => {}
                _ => {
                    // The bounds of a loop are no lines of its block.
                    let bound = node.kind == Kind::For && child.kind == Kind::Value;
                    self.starts |= is_block(node.kind) && !bound && !child.children.is_empty();
                    self.column = cells::column(node, at, self.source).or(self.column.take());
                    if table && child.kind == Kind::Argument {
                        self.column =
                            cells::argument(self.function(node), arguments, node.all(Kind::Argument).count());
                        arguments += 1;
                    }
                    self.tight |= tight_before(node, at, text);
                    if child.children.is_empty() && !is_left(child) {
                        self.token(text, is_block(node.kind));
                        self.tight = tight_after(node, text);
                    } else {
                        self.table |= matches!(node.kind, Kind::Point | Kind::Let) && is_call(child);
                        self.node(child);
                    }
                    self.column = None;
                }
            }
        }
    }

    fn function(&self, call: &Node) -> &'a str {
        call.first(Kind::Ident).map_or("", |f| self.text(f))
    }

    fn level(&self) -> usize {
        let mut lines: Vec<usize> = self.open.iter().map(|b| b.line).collect();
        lines.dedup();
        lines.len() * LEVEL
    }

    fn end_line(&mut self) {
        self.lines.extend(self.line.take());
    }

    /// Begins a line unless one has begun and goes on.
    fn begin(&mut self, closes: bool) -> &mut Line {
        if self.newlines > 0 {
            self.end_line();
        }
        if self.line.is_none() {
            let block = self.open.last().is_none_or(|b| b.block);
            let continues = block && !self.starts && !closes;
            // Nothing stands apart from what encloses it.
            let opened = self.open.last().is_some_and(|b| b.line + 1 == self.lines.len());
            self.line = Some(Line {
                indent: self.level() + if continues { LEVEL } else { 0 },
                blank: self.newlines > 1 && !closes && !opened && !self.lines.is_empty(),
                continues,
                ..Line::default()
            });
            self.tight = true;
        }
        self.newlines = 0;
        self.space = "";
        self.line.get_or_insert_default()
    }

    fn token(&mut self, text: &str, block: bool) {
        let closes = matches!(text, ")" | "}");
        if closes {
            self.open.pop();
        }
        let (tight, column) = (self.tight, self.column.take());
        let fresh = self.newlines > 0 || self.line.is_none();
        let line = self.begin(closes);
        match line.cells.last_mut() {
            Some(cell) if column.is_none() => {
                if !tight && !fresh {
                    cell.text.push(' ');
                }
                cell.text.push_str(text);
            }
            // What begins a line begins no column.
            None => line.cells.push(Cell { text: text.into(), column: None }),
            Some(_) => line.cells.push(Cell { text: text.into(), column }),
        }
        if matches!(text, "(" | "{") {
            let line = self.lines.len();
            self.open.push(Bracket { line, block });
        }
        self.starts = false;
        self.tight = false;
    }

    fn comment(&mut self, text: &str) {
        let behind = self.newlines == 0 && self.line.is_some();
        if behind {
            if let Some(line) = &mut self.line {
                line.comment = text.trim_end_matches(BLANK).into();
            }
        } else {
            let starts = std::mem::replace(&mut self.starts, true);
            let line = self.begin(false);
            line.kind = LineKind::Comment;
            line.comment = text.trim_end_matches(BLANK).into();
            self.starts = starts;
        }
        self.end_line();
        self.space = "";
    }

    fn as_is(&mut self, node: &Node) {
        // The line's end is written with the others.
        let text = self.text(node).trim_end_matches(BLANK);
        if text.is_empty() {
            return;
        }
        let space = self.space;
        let fresh = self.newlines > 0 || self.line.is_none();
        let line = self.begin(false);
        line.indent = if fresh { 0 } else { line.indent };
        line.kind = LineKind::AsIs;
        line.cells.push(Cell { text: format!("{space}{text}"), column: None });
        self.starts = false;
        self.tight = false;
    }
}

/// No space between the child and what stands before it.
fn tight_before(node: &Node, at: usize, text: &str) -> bool {
    match text {
        "," | ")" | ":" | "[" | "]" => true,
        // `2 mm ^2` is a power of a length, `2 mm^2` an area.
        "^" => {
            node.kind != Kind::Power || node.first(Kind::Number).is_none_or(|n| n.first(Kind::Unit).is_none())
        }
        "(" => node.kind == Kind::Call,
        "." => true,
        _ => match node.kind {
            // Nothing stands between the parts of a unit, of a name or of a power.
            Kind::Unit | Kind::UnitFactor => at > 0,
            Kind::Number => text.starts_with('°'),
            _ => false,
        },
    }
}

/// No space behind a token.
fn tight_after(node: &Node, text: &str) -> bool {
    match text {
        "(" | "[" | "." | "^" => true,
        "-" => node.kind == Kind::Unary,
        _ => false,
    }
}

/// A comment within a statement goes with the line below it.
fn indent_comments(lines: &mut [Line]) {
    let mut below: Option<usize> = None;
    for line in lines.iter_mut().rev() {
        match line.kind {
            LineKind::Comment => line.indent = below.unwrap_or(line.indent),
            _ => below = line.continues.then_some(line.indent),
        }
    }
}
