//! What rules look at, stage by stage. Each view holds the one before it.

use super::shapes::Flexure;
use crate::diagnostic::{Edit, Fix, Origin, SourceMap};
use crate::elaborate::OwnFile;
use crate::ir::expr::ExprId;
use crate::ir::{Assembly, Design, ExprPoint, Requirement};
use crate::kinematics::Motion;
use crate::pipeline::Simulation;
use crate::syntax::ast::{Ident, Item, Statement, StatementKind};
use nalgebra::Vector3;
use std::collections::HashSet;

/// The design's own texts.
pub struct Text<'a> {
    /// All files read, also those of the standard library.
    pub sources: &'a SourceMap,
    /// The design's own files as understood, the root file first.
    pub files: &'a [OwnFile],
    /// Their mechanisms and flexures.
    pub blocks: Vec<Block<'a>>,
    /// Names of items that anything refers to, in any file.
    pub items: HashSet<&'a str>,
    /// Names behind a dot, in any file: `tip` of `one.tip`.
    pub dotted: HashSet<&'a str>,
}

/// A mechanism or a flexure.
pub struct Block<'a> {
    /// Its name.
    pub name: &'a Ident,
    /// Whether it is a mechanism.
    pub mechanism: bool,
    /// Its statements.
    pub statements: &'a [Statement],
    /// The whole declaration.
    pub at: Origin,
    /// Names to which its statements refer.
    pub used: HashSet<&'a str>,
}

impl<'a> Text<'a> {
    /// The view of these files.
    pub fn new(sources: &'a SourceMap, files: &'a [OwnFile]) -> Self {
        let (mut items, mut dotted) = (HashSet::new(), HashSet::new());
        let mut blocks = Vec::new();
        let mut expression = |e: &'a crate::syntax::ast::Expr| {
            super::walk::each(e, &mut |e| {
                if let crate::syntax::ast::ExprKind::Name(path) = &e.kind {
                    dotted.extend(path.iter().skip(1).map(|i| i.node.as_str()));
                }
            });
        };
        for item in files.iter().flat_map(|f| &f.ast.items) {
            let (name, statements, at, mechanism) = match item {
                Item::Mechanism(m) => (&m.name, m.statements.as_slice(), m.at, true),
                Item::Flexure(f) => (&f.name, f.statements.as_slice(), f.at, false),
                Item::Record(r) => {
                    for (_, value) in &r.fields {
                        super::walk::names(value, &mut |i| {
                            items.insert(i.node.as_str());
                        });
                    }
                    continue;
                }
            };
            let mut used = HashSet::new();
            for s in statements {
                super::walk::references(s, &mut |i| {
                    used.insert(i.node.as_str());
                });
                super::walk::expressions(s, &mut expression);
            }
            items.extend(used.iter().copied());
            blocks.push(Block { name, mechanism, statements, at, used });
        }
        Self { sources, files, blocks, items, dotted }
    }

    /// The text of a file.
    pub fn of(&self, file: u32) -> &'a str {
        self.sources.files.get(file as usize).map_or("", |f| f.text.as_str())
    }

    /// Names that `declares` finds in a statement and to which nothing in its block refers, with the statement's place.
    pub fn unused<'s>(
        &'s self,
        declares: impl Fn(&'a StatementKind) -> Option<&'a Ident> + 's,
    ) -> impl Iterator<Item = (&'a Ident, Origin)> + 's {
        let all = self.blocks.iter().flat_map(|b| b.statements.iter().map(move |s| (b, s)));
        all.filter_map(move |(b, s)| {
            let name = declares(&s.kind)?;
            (!b.used.contains(name.node.as_str())).then_some((name, s.at))
        })
    }

    /// The repair that takes a statement out, which changes nothing that is built.
    pub fn remove(&self, at: Origin) -> Fix {
        Fix::safe("remove it", vec![Edit::remove(self.of(at.file), at)])
    }

    /// What stands at a place.
    pub fn at(&self, at: Origin) -> &'a str {
        self.of(at.file).get(at.start as usize..at.end as usize).unwrap_or("")
    }

    /// Whether a place lies in one of the design's own files.
    pub fn owns(&self, at: Origin) -> bool {
        self.files.iter().any(|f| f.id == at.file)
    }

    /// The statements of the block around a place.
    pub fn statements(&self, at: Origin) -> &'a [Statement] {
        let inside = |b: &&Block| b.at.file == at.file && b.at.start <= at.start && at.end <= b.at.end;
        self.blocks.iter().find(inside).map_or(&[], |b| b.statements)
    }

    /// The statement that stands at a place.
    pub fn statement(&self, at: Origin) -> Option<&'a Statement> {
        self.statements(at).iter().find(|s| s.at == at)
    }
}

/// A design at the start of its free variables.
pub struct OfDesign<'a> {
    /// The texts.
    pub text: &'a Text<'a>,
    /// What is built.
    pub assembly: &'a Assembly,
    /// One of its designs.
    pub design: &'a Design,
    /// Values of all nodes of its graph at the start.
    pub values: Vec<f64>,
}

impl<'a> OfDesign<'a> {
    /// The view of a design.
    pub fn new(text: &'a Text<'a>, assembly: &'a Assembly, design: &'a Design) -> Self {
        let starts: Vec<f64> = design.free.iter().map(|f| f.start).collect();
        Self { text, assembly, design, values: design.exprs.values(&starts) }
    }

    /// A number at the start.
    pub fn value(&self, id: ExprId) -> f64 {
        self.values.get(id.0 as usize).copied().unwrap_or(f64::NAN)
    }

    /// A point at the start, mm.
    pub fn point(&self, p: ExprPoint) -> Vector3<f64> {
        Vector3::new(self.value(p[0]), self.value(p[1]), self.value(p[2]))
    }

    /// The statements of its mechanism; none where that stands in another file than the design's own.
    pub fn statements(&self) -> &'a [Statement] {
        self.text.statements(self.design.origin)
    }

    /// What is required of it: by itself, and by the mechanism that places it.
    pub fn requirements(&self) -> impl Iterator<Item = &'a Requirement> {
        self.design.all_requirements().chain(self.assembly.requirements.iter().map(|r| &r.requirement))
    }

    /// Whether everything turns about one direction: a planar mechanism of hinges.
    pub fn is_planar(&self) -> bool {
        let axis = Vector3::from(self.design.layers.axis);
        self.design.joints.iter().all(|j| {
            let along = Vector3::from(j.axis).dot(&axis).abs();
            j.kind == crate::ir::JointKind::Hinge && along > PARALLEL
        })
    }
}

/// Cosine from which on axes count as parallel: 0.08°.
const PARALLEL: f64 = 1.0 - 1e-6;

/// A design with its conventional motion at the start.
pub struct OfMotion<'a> {
    /// The design.
    pub of: &'a OfDesign<'a>,
    /// Its motion.
    pub motion: &'a Motion,
}

/// A design with the shapes of its flexures at the start.
pub struct OfFlexures<'a> {
    /// The design.
    pub of: &'a OfDesign<'a>,
    /// Its motion.
    pub motion: &'a Motion,
    /// One a rod of the design.
    pub flexures: &'a [Flexure],
}

/// A solved design.
pub struct OfSolution<'a> {
    /// The design.
    pub of: &'a OfDesign<'a>,
    /// Values of its free variables, in order.
    pub solved: &'a [f64],
    /// What was simulated with them; without gaps where only a check asks.
    pub simulation: &'a Simulation,
    /// The terms of the objective at the start, by name; empty where they are not known.
    pub terms: &'a [(String, f64)],
}

/// What is printed.
pub struct OfParts<'a> {
    /// What is built.
    pub assembly: &'a Assembly,
    /// Its parts.
    pub parts: &'a [Part],
}

/// The surface of a printed part: its triangles, mm, in the order of corners that has the outside to the left.
pub struct Part {
    /// Name of its file.
    pub name: String,
    /// Triangles.
    pub triangles: Vec<[Vector3<f64>; 3]>,
}
