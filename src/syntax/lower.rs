//! Concrete tree to [`ast::File`]: declarations and their blocks. Statements are in
//! `statement.rs`, expressions in `expression.rs`, what recovery took in `errors.rs`.

use super::ast::{At, Expr, File, Flexure, Ident, Item, Mechanism, Record, Statement, Use, UseTarget};
use super::tree::{Kind, Node};
use crate::diagnostic::{Diagnostic, Origin};

/// The way from tree to AST, with what was found on it.
pub(super) struct Lower<'a> {
    pub(super) source: &'a str,
    pub(super) file: u32,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) recovery: super::errors::Recovery,
}

/// AST and diagnostics of a file's tree.
pub(super) fn lower(tree: &Node, source: &str, file: u32) -> (File, Vec<Diagnostic>) {
    let mut lower = Lower { source, file, diagnostics: Vec::new(), recovery: Default::default() };
    let ast = lower.file(tree);
    lower.finish();
    (ast, lower.diagnostics)
}

impl<'a> Lower<'a> {
    pub(super) fn report(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    pub(super) fn at(&self, start: usize, end: usize) -> Origin {
        Origin { file: self.file, start: start as u32, end: end as u32 }
    }

    pub(super) fn origin(&self, node: &Node) -> Origin {
        Origin { file: self.file, start: node.start, end: node.end }
    }

    pub(super) fn text(&self, node: &Node) -> &'a str {
        self.source.get(node.range()).unwrap_or("")
    }

    /// A token's text at its place.
    pub(super) fn named(&self, token: &Node) -> Ident {
        At { node: self.text(token).to_owned(), at: self.origin(token) }
    }

    /// Text between quotes. There are no escapes: a backslash is a backslash.
    pub(super) fn quoted(&self, token: &Node) -> String {
        let text = self.text(token);
        text.strip_prefix('"').and_then(|t| t.strip_suffix('"')).unwrap_or(text).to_owned()
    }

    /// First name directly in a node.
    pub(super) fn ident(&self, node: &Node) -> Option<Ident> {
        node.first(Kind::Ident).map(|n| self.named(n))
    }

    /// All names directly in a node.
    pub(super) fn idents(&self, node: &Node) -> Vec<Ident> {
        node.all(Kind::Ident).map(|n| self.named(n)).collect()
    }

    /// All names directly in a node, each with its index as written without spaces.
    pub(super) fn indexed(&self, node: &Node) -> Vec<Ident> {
        let mut names: Vec<Ident> = Vec::new();
        for part in &node.children {
            match (part.kind, names.last_mut()) {
                (Kind::Ident, _) => names.push(self.named(part)),
                (Kind::Index, Some(name)) => {
                    name.node.extend(self.text(part).chars().filter(|c| !c.is_whitespace()));
                    name.at.end = part.end;
                }
                _ => {}
            }
        }
        names
    }

    /// First value directly in a node.
    pub(super) fn value(&mut self, node: &Node) -> Option<Expr> {
        node.first(Kind::Value).map(|n| self.expr(n))
    }

    fn file(&mut self, tree: &Node) -> File {
        let mut file = File::default();
        let mut doc = Doc::default();
        for node in &tree.children {
            if doc.takes(self.text(node), node.kind) {
                continue;
            }
            let doc = doc.take();
            if !matches!(node.kind, Kind::BadHeader | Kind::Stray) {
                self.recovery.reset();
            }
            match node.kind {
                Kind::Edition => self.edition(node, &mut file),
                Kind::Import => file.uses.extend(self.import(node)),
                Kind::Allow => file.allows.extend(self.allow(node)),
                Kind::Mechanism => file.items.extend(self.mechanism(node, doc)),
                Kind::Flexure => file.items.extend(self.flexure(node, doc)),
                Kind::Record => file.items.extend(self.record(node, doc)),
                Kind::BadHeader if self.bad_heading(node) => drop(self.statements(node)),
                Kind::Stray => self.stray(node),
                _ => {}
            }
        }
        file
    }

    fn edition(&mut self, node: &Node, file: &mut File) {
        let Some(number) = node.first(Kind::Integer) else { return };
        let at = self.origin(number);
        let Ok(value) = self.text(number).parse::<u32>() else {
            self.report(Diagnostic::error("E0007", "this number is too large", at));
            return;
        };
        match &file.edition {
            Some(first) => {
                let first = first.at;
                self.report(
                    Diagnostic::error("E0011", "the edition is given twice", self.origin(node))
                        .also(first, "first here")
                        .help("keep one of the two lines"),
                );
            }
            None => file.edition = Some(At { node: value, at }),
        }
    }

    fn import(&mut self, node: &Node) -> Option<Use> {
        let at = self.origin(node);
        let target = match (node.first(Kind::Text), node.first(Kind::Path)) {
            (Some(text), _) => UseTarget::File(At { node: self.quoted(text), at: self.origin(text) }),
            (_, Some(path)) => UseTarget::Std(self.idents(path)),
            _ => return None,
        };
        Some(Use { target, at })
    }

    fn mechanism(&mut self, node: &Node, doc: String) -> Option<Item> {
        let name = self.ident(node)?;
        let mut statements = self.statements(node);
        self.placed(&mut statements, true);
        Some(Item::Mechanism(Mechanism { name, statements, doc, at: self.origin(node) }))
    }

    fn flexure(&mut self, node: &Node, doc: String) -> Option<Item> {
        let mut names = self.idents(node).into_iter();
        let (name, replaces) = (names.next()?, names.next()?);
        let mut statements = self.statements(node);
        self.placed(&mut statements, false);
        Some(Item::Flexure(Flexure { name, replaces, statements, doc, at: self.origin(node) }))
    }

    fn record(&mut self, node: &Node, doc: String) -> Option<Item> {
        let kind = node.first(Kind::Keyword).map(|n| self.named(n))?;
        let name = self.ident(node)?;
        let mut fields = Vec::new();
        for child in &node.children {
            match child.kind {
                Kind::Field => fields.extend(self.field(child)),
                Kind::BadField => self.bad_field(child),
                _ => {}
            }
        }
        self.closed(node);
        Some(Item::Record(Record { kind, name, fields, doc, at: self.origin(node) }))
    }

    /// `name = value`.
    pub(super) fn field(&mut self, node: &Node) -> Option<(Ident, Expr)> {
        Some((self.ident(node)?, self.value(node)?))
    }

    /// The statements directly in a block.
    pub(super) fn statements(&mut self, block: &Node) -> Vec<Statement> {
        let mut statements = Vec::new();
        let mut doc = Doc::default();
        let mut inside = false;
        for node in &block.children {
            // Docs before the `{` belong to nothing in here.
            inside |= node.kind == Kind::Punctuation && self.text(node) == "{";
            if !inside || doc.takes(self.text(node), node.kind) {
                continue;
            }
            if matches!(node.kind, Kind::Punctuation | Kind::NoBrace) {
                continue;
            }
            let doc = doc.take();
            let kind = self.statement(node);
            statements.push(Statement { kind, at: self.origin(node), doc });
        }
        self.closed(block);
        statements
    }
}

/// Collects the `///` lines before a declaration.
struct Doc {
    lines: Vec<String>,
    /// Nothing but space has been on this line so far. What stands behind a declaration on its
    /// line documents nothing.
    line_start: bool,
}

impl Default for Doc {
    fn default() -> Self {
        Self { lines: Vec::new(), line_start: true }
    }
}

impl Doc {
    /// Whether a node was trivia; doc lines are kept.
    fn takes(&mut self, text: &str, kind: Kind) -> bool {
        if let (Kind::Doc, true, Some(line)) = (kind, self.line_start, text.strip_prefix("///")) {
            self.lines.push(line.strip_prefix(' ').unwrap_or(line).trim_end().to_owned());
        }
        self.line_start = match kind {
            Kind::Newline => true,
            Kind::Space | Kind::ByteOrderMark => self.line_start,
            _ => false,
        };
        kind.is_trivia()
    }

    fn take(&mut self) -> String {
        std::mem::take(&mut self.lines).join("\n")
    }
}
