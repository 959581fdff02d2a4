//! Who declares and who mentions a name, in one file. Read off the concrete tree, so that what stands around a mistake is
//! seen as before.

use crate::syntax::tree::{Kind, Node};
use std::ops::Range;

/// What a name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // The names are the language's words.
pub enum What {
    Mechanism,
    Flexure,
    Material,
    Process,
    Motor,
    Field,
    Param,
    Let,
    Point,
    Body,
    Joint,
    Cable,
    Trace,
    Output,
    Instance,
    Rod,
    Case,
}

/// A declared name.
#[derive(Clone, Debug, PartialEq)]
pub struct Symbol {
    /// The name.
    pub name: String,
    /// What it stands for.
    pub what: What,
    /// The name's place.
    pub at: Range<usize>,
    /// The whole declaration.
    pub whole: Range<usize>,
    /// The block it stands in; none at the top of the file.
    pub block: Option<usize>,
    /// The block it opens.
    pub opens: Option<usize>,
    /// `///` lines above it.
    pub doc: String,
    /// The mechanism of an instance, the image's original, the template of a joint.
    pub of: Option<String>,
}

/// A name that is used.
#[derive(Clone, Debug, PartialEq)]
pub struct Mention {
    /// Its place.
    pub at: Range<usize>,
    /// What leads to it, itself last: `one.motor` is two mentions, `[one]` and `[one, motor]`.
    pub path: Vec<String>,
    /// The block it stands in.
    pub block: Option<usize>,
    /// The template whose parameter this is.
    pub template: Option<String>,
}

/// An import.
#[derive(Clone, Debug, PartialEq)]
pub struct Use {
    /// The whole line.
    pub at: Range<usize>,
    /// `std.materials.rigur`, or a path.
    pub target: String,
    /// The target's place.
    pub target_at: Range<usize>,
    /// It is a path in quotes.
    pub file: bool,
}

/// The names of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Names {
    /// Declarations in order.
    pub symbols: Vec<Symbol>,
    /// Mentions in order.
    pub mentions: Vec<Mention>,
    /// Imports in order.
    pub uses: Vec<Use>,
    /// Whole places of mechanisms, flexures and records.
    pub blocks: Vec<(Kind, Range<usize>)>,
}

impl Names {
    /// Of a file's tree.
    pub fn of(tree: &Node, source: &str) -> Self {
        let mut walk = Walk { source, names: Self::default(), block: None };
        walk.node(tree);
        walk.names
    }

    /// The block around a place.
    pub fn block_at(&self, at: usize) -> Option<usize> {
        self.blocks.iter().position(|(_, r)| r.start <= at && at <= r.end)
    }

    /// A declaration in a block, or at the top.
    pub fn find(&self, block: Option<usize>, name: &str) -> Option<usize> {
        self.symbols.iter().position(|s| s.block == block && s.name == name)
    }
}

struct Walk<'a> {
    source: &'a str,
    names: Names,
    block: Option<usize>,
}

impl<'a> Walk<'a> {
    fn text(&self, node: &Node) -> &'a str {
        self.source.get(node.range()).unwrap_or("")
    }

    fn node(&mut self, node: &Node) {
        let mut doc = Vec::new();
        for child in &node.children {
            match child.kind {
                Kind::Doc => doc.extend(self.text(child).strip_prefix("///").map(|l| l.trim().to_string())),
                Kind::Space | Kind::Newline | Kind::Comment => {}
                _ => {
                    self.part(node, child, doc.join("\n"));
                    doc.clear();
                }
            }
        }
    }

    fn part(&mut self, parent: &Node, node: &Node, doc: String) {
        let idents: Vec<&Node> = node.all(Kind::Ident).collect();
        let own = |what: What, i: usize| Some((what, *idents.get(i)?));
        let declared = match node.kind {
            Kind::Mechanism => own(What::Mechanism, 0),
            Kind::Flexure => own(What::Flexure, 0),
            Kind::Record => match node.first(Kind::Keyword).map(|k| self.text(k)) {
                Some("material") => own(What::Material, 0),
                Some("process") => own(What::Process, 0),
                _ => own(What::Motor, 0),
            },
            Kind::Field if parent.kind == Kind::Record => own(What::Field, 0),
            Kind::Param => own(What::Param, 0),
            Kind::Let => own(What::Let, 0),
            Kind::Point => own(What::Point, 0),
            Kind::Body | Kind::OwnBody => own(What::Body, 0),
            Kind::Joint => own(What::Joint, 1),
            Kind::String => own(What::Cable, 0),
            Kind::Trace => own(What::Trace, 0),
            Kind::Output => own(What::Output, 0),
            Kind::Place | Kind::Mirror => own(What::Instance, 0),
            Kind::Rod => own(What::Rod, 0),
            Kind::Case => own(What::Case, 0),
            _ => None,
        };
        let outer = self.block;
        let opens = matches!(node.kind, Kind::Mechanism | Kind::Flexure | Kind::Record).then(|| {
            self.names.blocks.push((node.kind, node.range()));
            self.names.blocks.len() - 1
        });
        if let Some((what, name)) = declared {
            let of = match node.kind {
                Kind::Place | Kind::Mirror => idents.get(1).copied(),
                Kind::Joint => node.first(Kind::Template).and_then(|t| t.first(Kind::Ident)),
                _ => None,
            };
            let symbol = Symbol {
                name: self.text(name).into(),
                what,
                at: name.range(),
                whole: node.range(),
                block: outer,
                opens,
                doc,
                of: of.map(|n| self.text(n).into()),
            };
            self.names.symbols.push(symbol);
        }
        self.block = opens.or(outer);
        // Which of its names are no mentions: the declared one, and words of the language.
        let skipped = match node.kind {
            Kind::Mechanism | Kind::Flexure | Kind::Record | Kind::Model | Kind::Dimension => usize::MAX,
            Kind::Call | Kind::Argument => usize::MAX,
            Kind::Joint => 2,
            _ if declared.is_some() => 1,
            _ => 0,
        };
        match node.kind {
            Kind::Import => self.import(node),
            Kind::Name => {
                let path: Vec<String> = idents.iter().map(|i| self.text(i).into()).collect();
                for (i, ident) in idents.iter().enumerate() {
                    self.mention(ident, path.get(..=i).unwrap_or_default().to_vec(), None);
                }
            }
            // What an instance has is looked for in it.
            Kind::Merging | Kind::Sharing => {
                let of = parent.all(Kind::Ident).nth(usize::from(node.kind == Kind::Sharing));
                let instance = of.map_or("", |n| self.text(n));
                for (i, ident) in idents.iter().enumerate() {
                    let name = self.text(ident).to_string();
                    let inside = node.kind == Kind::Sharing || i == 0;
                    let path = if inside { vec![instance.to_string(), name] } else { vec![name] };
                    self.mention(ident, path, None);
                }
            }
            Kind::Template => {
                for ident in idents.iter().take(1) {
                    self.mention(ident, vec![self.text(ident).into()], None);
                }
                let template = idents.first().map(|i| self.text(i).to_string());
                for field in node.first(Kind::Overrides).into_iter().flat_map(|o| o.all(Kind::Field)) {
                    if let Some(name) = field.first(Kind::Ident) {
                        self.mention(name, vec![self.text(name).into()], template.clone());
                    }
                }
            }
            Kind::Field if parent.kind == Kind::Overrides => {}
            Kind::Mirror => {
                // The third name is a plane.
                for ident in idents.iter().skip(1).take(1) {
                    self.mention(ident, vec![self.text(ident).into()], None);
                }
            }
            _ => {
                for ident in idents.iter().skip(skipped) {
                    self.mention(ident, vec![self.text(ident).into()], None);
                }
            }
        }
        self.node(node);
        self.block = outer;
    }

    fn mention(&mut self, node: &Node, path: Vec<String>, template: Option<String>) {
        self.names.mentions.push(Mention { at: node.range(), path, block: self.block, template });
    }

    fn import(&mut self, node: &Node) {
        let Some(target) = node.first(Kind::Text).or(node.first(Kind::Path)) else { return };
        let file = target.kind == Kind::Text;
        let text = self.text(target).trim_matches('"').to_string();
        self.names.uses.push(Use { at: node.range(), target: text, target_at: target.range(), file });
    }
}
