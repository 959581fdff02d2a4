//! Text of a file to its page. Values are shown as they are written: the page tells what stands in the file.

use super::{Entry, Fact, Page, Parameter};
use crate::diagnostic::Origin;
use crate::elaborate::dimension::Dimension;
use crate::syntax::ast::{
    Expr, ExprKind, Flexure, Ident, Item, Joint, Mechanism, Record, Statement, StatementKind, UseTarget,
};

pub fn page(path: &str, text: &str) -> Page {
    let file = crate::syntax::parse(0, text).file;
    let source = Source { text };
    let items = file.items.iter().filter_map(|item| source.entry(item, path)).collect();
    let import = |target: &UseTarget| match target {
        UseTarget::Std(path) => Some(path.iter().map(|p| p.node.as_str()).collect::<Vec<_>>().join(".")),
        UseTarget::File(_) => None,
    };
    let imports = file.uses.iter().filter_map(|u| import(&u.target)).collect();
    Page { path: path.into(), about: about_file(text), imports, items }
}

/// The `//!` lines at the head of a file.
fn about_file(text: &str) -> String {
    let lines = text.trim_start_matches('\u{feff}').lines().map(str::trim_start);
    let about = lines.skip_while(|l| l.is_empty()).map_while(|l| l.strip_prefix("//!"));
    about.map(|l| l.strip_prefix(' ').unwrap_or(l).trim_end()).collect::<Vec<_>>().join("\n").trim().into()
}

struct Source<'t> {
    text: &'t str,
}

impl Source<'_> {
    /// What is written at a place, on one line.
    fn at(&self, at: Origin) -> String {
        let text = self.text.get(at.start as usize..at.end as usize).unwrap_or_default();
        let plain: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or_default()).collect();
        plain.join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn entry(&self, item: &Item, path: &str) -> Option<Entry> {
        let entry = match item {
            Item::Mechanism(m) => self.mechanism(m),
            Item::Flexure(f) => self.flexure(f),
            Item::Record(r) => self.record(r),
        };
        let import = match path.strip_prefix("std.") {
            Some(_) => format!("use {path}"),
            None => format!("use \"{}\"", path.rsplit('/').next().unwrap_or(path)),
        };
        let example = format!("{import}\n{}", entry.example);
        (!entry.name.starts_with('_')).then_some(Entry { example, ..entry })
    }

    fn parameter(&self, name: &Ident, ty: Option<&Ident>, value: &Expr, about: &str) -> Parameter {
        let (default, bounds) = match &value.kind {
            ExprKind::Free { start, lower, upper } => {
                (self.at(start.at), Some((self.at(lower.at), self.at(upper.at))))
            }
            _ => (self.at(value.at), None),
        };
        let kind = ty.map(|t| t.node.clone());
        let unit = kind.as_deref().and_then(Dimension::unit_of_type).map(String::from);
        Parameter { name: name.node.clone(), kind, unit, default, bounds, about: about.into() }
    }

    /// Parameters, and free values besides.
    fn values(&self, statements: &[Statement]) -> (Vec<Parameter>, Vec<Parameter>) {
        let (mut parameters, mut free) = (Vec::new(), Vec::new());
        for s in statements {
            match &s.kind {
                StatementKind::Param { name, ty, value } if !name.node.starts_with('_') => {
                    parameters.push(self.parameter(name, ty.as_ref(), value, &s.doc));
                }
                StatementKind::Let { name, value } if matches!(value.kind, ExprKind::Free { .. }) => {
                    free.push(self.parameter(name, None, value, &s.doc));
                }
                StatementKind::Rest { joint, value } if matches!(value.kind, ExprKind::Free { .. }) => {
                    let mut p = self.parameter(joint, None, value, &s.doc);
                    p.name = format!("rest {}", joint.node);
                    free.push(p);
                }
                _ => {}
            }
        }
        (parameters, free)
    }

    fn mechanism(&self, m: &Mechanism) -> Entry {
        let (parameters, free) = self.values(&m.statements);
        let mut facts = Vec::new();
        for s in &m.statements {
            let (label, value) = match &s.kind {
                StatementKind::Body { name, .. } => {
                    (if self.at(s.at).starts_with("ground") { "ground" } else { "link" }, name.node.clone())
                }
                StatementKind::Joint(j) => (j.kind.node.as_str(), joint(j)),
                StatementKind::String(c) => {
                    ("string", format!("{}: {} to {}", c.name.node, c.from.node, c.to.node))
                }
                StatementKind::Drive { .. } => ("drive", without("drive", &self.at(s.at))),
                StatementKind::Trace { .. } => ("trace", without("trace", &self.at(s.at))),
                StatementKind::Output { .. } => ("output", without("output", &self.at(s.at))),
                StatementKind::Load(_) => ("load", without("load", &self.at(s.at))),
                StatementKind::Hole(_) => ("hole", without("hole", &self.at(s.at))),
                StatementKind::Mount(_) => ("mount", without("mount", &self.at(s.at))),
                StatementKind::Horn(_) => ("horn", without("horn", &self.at(s.at))),
                StatementKind::Plate(_) => ("plate", without("plate", &self.at(s.at))),
                StatementKind::Solid(_) => ("solid", without("solid", &self.at(s.at))),
                StatementKind::Require { .. } => ("require", without("require", &self.at(s.at))),
                StatementKind::Place(_) => ("place", without("place", &self.at(s.at))),
                StatementKind::Mirror(_) => ("mirror", without("mirror", &self.at(s.at))),
                _ => continue,
            };
            facts.push(Fact { label: label.into(), value, about: s.doc.clone() });
        }
        let given = parameters.first().map(|p| format!(" {{ {} = {} }}", p.name, p.default));
        let example = format!("place one = {}{} at (0 mm, 0 mm)", m.name.node, given.unwrap_or_default());
        let (name, about) = (m.name.node.clone(), m.doc.clone());
        Entry { kind: "mechanism".into(), name, replaces: None, about, parameters, free, facts, example }
    }

    fn flexure(&self, f: &Flexure) -> Entry {
        let (parameters, free) = self.values(&f.statements);
        let mut facts = Vec::new();
        let mut bodies = 2;
        for s in &f.statements {
            match &s.kind {
                StatementKind::Rod(rod) => {
                    let ends = [&rod.from.body.node, &rod.to.body.node];
                    // Bodies of the joint are called a, b, c, …
                    let letters = ends.iter().filter(|e| e.len() == 1).filter_map(|e| e.bytes().next());
                    bodies =
                        letters.map(|b| usize::from(b.saturating_sub(b'a')) + 1).fold(bodies, usize::max);
                    let mut value =
                        format!("{}: {} to {}, {}", rod.name.node, ends[0], ends[1], self.at(rod.section.at));
                    if let Some(to) = &rod.section_to {
                        value.push_str(&format!(" to {}", self.at(to.at)));
                    }
                    facts.push(Fact { label: "rod".into(), value, about: s.doc.clone() });
                }
                StatementKind::OwnBody { name, .. } => {
                    facts.push(Fact { label: "body".into(), value: name.node.clone(), about: s.doc.clone() });
                }
                _ => {}
            }
        }
        let (name, kind) = (f.name.node.clone(), f.replaces.node.clone());
        let others = ["link1", "link2", "link3", "link4"].into_iter().take(bodies).skip(1);
        let axis = match kind.as_str() {
            "universal" => "  axis x and z",
            "slider" => "  axis x",
            "hinge" => "  axis z",
            _ => "",
        };
        let given = parameters.iter().find(|p| p.name == "thickness" || p.name == "diameter");
        let given = given.map_or("", |p| {
            if p.name == "diameter" { " { diameter = 1.2 mm }" } else { " { thickness = 1 mm }" }
        });
        let example = format!(
            "{kind} joint: link1 to {} at P{axis}  as {name}{given}",
            others.collect::<Vec<_>>().join(", ")
        );
        let about = f.doc.clone();
        Entry { kind: "flexure".into(), name, replaces: Some(kind), about, parameters, free, facts, example }
    }

    fn record(&self, r: &Record) -> Entry {
        let fact = |(name, value): &(Ident, Expr)| Fact {
            label: name.node.clone(),
            value: self.at(value.at),
            about: String::new(),
        };
        let (kind, name) = (r.kind.node.clone(), r.name.node.clone());
        let example = match kind.as_str() {
            "material" => format!("material {name}"),
            "process" => format!("print on {name}"),
            _ => format!("drive motor from 0 deg to 90 deg with {name}"),
        };
        let facts = r.fields.iter().map(fact).collect();
        let (parameters, free) = (Vec::new(), Vec::new());
        Entry { kind, name, replaces: None, about: r.doc.clone(), parameters, free, facts, example }
    }
}

/// `knee: coupler to rocker, as crossed_leaves`.
fn joint(j: &Joint) -> String {
    let mut names = j.bodies.iter().map(|b| b.node.as_str());
    let first = names.next().unwrap_or_default();
    let mut shown = format!("{}: {first} to {}", j.name.node, names.collect::<Vec<_>>().join(", "));
    if let Some(template) = &j.template {
        shown.push_str(&format!(", as {}", template.name.node));
    }
    shown
}

fn without(keyword: &str, text: &str) -> String {
    text.strip_prefix(keyword).unwrap_or(text).trim_start().to_string()
}
