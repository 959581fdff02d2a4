//! Statements: concrete tree to [`ast::StatementKind`].

use super::ast::{
    Allow, At, Cable, Compare, Expr, Fitted, Hole, Ident, Joint, Load, Plate, Profile, Rod, RodEnd, Solid,
    Statement, StatementKind, TemplateUse, Term,
};
use super::lower::Lower;
use super::tree::{Kind, Node};
use crate::diagnostic::{Diagnostic, Origin};

impl Lower<'_> {
    /// What a statement node says.
    pub(super) fn statement(&mut self, node: &Node) -> StatementKind {
        if node.kind == Kind::BadStatement {
            self.bad_statement(node);
            return self.broken(node);
        }
        self.recovery.reset();
        match self.read_statement(node) {
            Some(kind) => kind,
            None => {
                // The grammar promises these parts; a mismatch must still not pass silently.
                let at = self.origin(node);
                self.report(Diagnostic::error("E0001", "this statement could not be read", at));
                self.broken(node)
            }
        }
    }

    /// What could not be understood, with the words in it.
    fn broken(&self, node: &Node) -> StatementKind {
        let words =
            self.text(node).split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty());
        StatementKind::Broken { words: words.map(String::from).collect() }
    }

    fn read_statement(&mut self, node: &Node) -> Option<StatementKind> {
        Some(match node.kind {
            Kind::Param => StatementKind::Param {
                name: self.ident(node)?,
                ty: node.first(Kind::Dimension).and_then(|n| self.ident(n)),
                value: self.value(node)?,
            },
            Kind::Let => StatementKind::Let { name: self.ident(node)?, value: self.value(node)? },
            Kind::Point => StatementKind::Point { name: self.ident(node)?, value: self.value(node)? },
            Kind::Body => StatementKind::Body {
                ground: self.text(node.first(Kind::Keyword)?) == "ground",
                name: self.ident(node)?,
                points: self.idents(node.first(Kind::Points)?),
                layer: node.first(Kind::Layer).and_then(|n| self.value(n)),
            },
            Kind::Joint => StatementKind::Joint(Box::new(self.joint(node)?)),
            Kind::MaterialUse => StatementKind::Material(self.ident(node)?),
            Kind::Print => StatementKind::PrintOn(self.ident(node)?),
            Kind::Links => StatementKind::Links {
                height: self.value(node),
                fillet: node.first(Kind::Fillet).and_then(|n| self.value(n)),
            },
            Kind::Model => StatementKind::Model(self.ident(node)?),
            Kind::Cycle => {
                let mut values = self.values(node).into_iter();
                StatementKind::Cycle { steps: values.next()?, over: values.next() }
            }
            Kind::Drive => self.drive(node)?,
            Kind::Rest => StatementKind::Rest { joint: self.ident(node)?, value: self.value(node)? },
            Kind::Trace => {
                let mut names = self.idents(node).into_iter();
                let (name, body) = (names.next()?, names.next()?);
                let direction = node.all(Kind::Keyword).any(|n| self.text(n) == "direction");
                StatementKind::Trace { name, direction, point: self.value(node)?, body }
            }
            Kind::Output => StatementKind::Output { name: self.ident(node)?, value: self.value(node)? },
            Kind::Workspace => StatementKind::Workspace(Box::new(super::ast::Workspace {
                wanted: node.all(Kind::Name).map(|n| self.expr(n)).collect(),
                stretches: node.all(Kind::Stretch).filter_map(|n| self.stretch(n)).collect(),
            })),
            Kind::Target => StatementKind::Target { trace: self.ident(node)?, value: self.value(node)? },
            Kind::Minimize => self.minimize(node),
            Kind::Require => self.require(node)?,
            Kind::Export => StatementKind::Export(
                node.all(Kind::Artefact).filter_map(|n| n.parts().next()).map(|n| self.expr(n)).collect(),
            ),
            Kind::Rod => StatementKind::Rod(Box::new(self.rod(node)?)),
            Kind::Place => StatementKind::Place(Box::new(self.place(node)?)),
            Kind::Mirror => StatementKind::Mirror(Box::new(self.mirror(node)?)),
            Kind::OwnBody => StatementKind::OwnBody {
                name: self.ident(node)?,
                points: node.first(Kind::Points).map(|n| self.idents(n)).unwrap_or_default(),
            },
            Kind::String => StatementKind::String(Box::new(self.string(node)?)),
            Kind::Load => StatementKind::Load(Box::new(self.load(node)?)),
            Kind::Hole => {
                let mut values = self.values(node).into_iter();
                let (diameter, point) = (values.next()?, values.next()?);
                let hole = Hole { diameter, body: self.body_ref(node, 0)?, point, along: values.next() };
                StatementKind::Hole(Box::new(hole))
            }
            Kind::Mount => StatementKind::Mount(Box::new(self.fitted(node)?)),
            Kind::Horn => StatementKind::Horn(Box::new(self.fitted(node)?)),
            Kind::Plate => {
                let mut values = self.values(node).into_iter();
                let (thickness, body) = (values.next()?, self.body_ref(node, 0)?);
                StatementKind::Plate(Box::new(Plate { thickness, body, margin: values.next() }))
            }
            Kind::Solid => StatementKind::Solid(Box::new(self.solid(node)?)),
            Kind::Allow => StatementKind::Allow(self.allow(node)?),
            Kind::Assert => StatementKind::Assert(Box::new(self.assertion(node)?)),
            Kind::Variant => StatementKind::Variant(Box::new(self.variant(node)?)),
            Kind::For => StatementKind::For(Box::new(self.repeated(node)?)),
            Kind::Case => StatementKind::Case(Box::new(self.case(node)?)),
            Kind::Later => StatementKind::Later { keyword: self.named(node.first(Kind::Keyword)?) },
            _ => return None,
        })
    }

    pub(super) fn values(&mut self, node: &Node) -> Vec<Expr> {
        node.all(Kind::Value).map(|n| self.expr(n)).collect()
    }

    /// A body, or one of an instance, after so many other names.
    fn body_ref(&mut self, node: &Node, before: usize) -> Option<Ident> {
        let mut names = self.indexed(node).into_iter().skip(before);
        let mut body = names.next()?;
        if let Some(inner) = names.next() {
            body.node = format!("{}.{}", body.node, inner.node);
            body.at.end = inner.at.end;
        }
        Some(body)
    }

    fn fitted(&mut self, node: &Node) -> Option<Fitted> {
        let (motor, body) = (self.ident(node)?, self.body_ref(node, 1)?);
        let point = self.value(node)?;
        let clause = |c: &Node| Some((self.named(c.first(Kind::Keyword)?), self.value(c)?));
        let clauses = node.all(Kind::Fitted).filter_map(clause).collect();
        Some(Fitted { motor, body, point, clauses })
    }

    fn solid(&mut self, node: &Node) -> Option<Solid> {
        let text = node.first(Kind::Text)?;
        let file = At { node: self.quoted(text), at: self.origin(text) };
        let body = self.body_ref(node, 0)?;
        let mut solid = Solid { file, body, point: None, turned: Vec::new(), scale: None };
        let mut seen: Vec<(Kind, Origin)> = Vec::new();
        for clause in node.parts() {
            let kind = clause.kind;
            let once = matches!(kind, Kind::At | Kind::Scaled);
            if let Some((_, first)) = seen.iter().find(|(k, _)| once && *k == kind).copied() {
                self.twice(clause, first);
                continue;
            }
            seen.push((kind, self.origin(clause)));
            match kind {
                Kind::At => solid.point = self.value(clause),
                Kind::Turned => {
                    let mut values = self.values(clause).into_iter();
                    solid.turned.extend(values.next().zip(values.next()));
                }
                Kind::Scaled => solid.scale = self.value(clause),
                _ => {}
            }
        }
        Some(solid)
    }

    fn joint(&mut self, node: &Node) -> Option<Joint> {
        let mut names = self.idents(node).into_iter();
        let (kind, name) = (names.next()?, names.next()?);
        let mut joint = Joint {
            kind,
            name,
            bodies: self.idents(node.first(Kind::Bodies)?),
            point: self.value(node)?,
            axis: None,
            second_axis: None,
            layer: None,
            pin: None,
            fillet: None,
            into: Vec::new(),
            template: None,
        };
        let mut seen: Vec<(Kind, Origin)> = Vec::new();
        for clause in node.parts() {
            let kind = clause.kind;
            use Kind::{Axis, Fillet, Into, Layer, Pin, Template};
            if !matches!(kind, Axis | Layer | Pin | Fillet | Into | Template) {
                continue;
            }
            let first = seen.iter().find(|(k, _)| *k == kind && kind != Kind::Into).map(|(_, at)| *at);
            if let Some(first) = first {
                self.twice(clause, first);
                continue;
            }
            seen.push((kind, self.origin(clause)));
            match kind {
                Kind::Axis => {
                    let mut axes = self.values(clause).into_iter();
                    (joint.axis, joint.second_axis) = (axes.next(), axes.next());
                }
                Kind::Layer => joint.layer = self.value(clause),
                Kind::Fillet => joint.fillet = self.value(clause),
                Kind::Pin => joint.pin = self.value(clause),
                Kind::Into => joint.into.extend(self.ident(clause).zip(self.value(clause))),
                _ => joint.template = self.template(clause),
            }
        }
        Some(joint)
    }

    pub(super) fn twice(&mut self, clause: &Node, first: Origin) {
        let word = clause.first(Kind::Keyword).map_or("", |n| self.text(n));
        let at = self.origin(clause);
        self.report(
            Diagnostic::error("E0008", format!("`{word}` is given twice"), at)
                .also(first, "first here")
                .help("keep one of the two"),
        );
    }

    fn template(&mut self, node: &Node) -> Option<TemplateUse> {
        Some(TemplateUse { name: self.ident(node)?, overrides: self.overrides(node) })
    }

    /// `{ name = value … }` directly in a node, if it has them.
    pub(super) fn overrides(&mut self, node: &Node) -> Vec<(Ident, Expr)> {
        match node.first(Kind::Overrides) {
            Some(list) => list.all(Kind::Field).filter_map(|n| self.field(n)).collect(),
            None => Vec::new(),
        }
    }

    fn drive(&mut self, node: &Node) -> Option<StatementKind> {
        let mut names = self.idents(node).into_iter();
        let (joint, motor) = (names.next()?, names.next());
        let mut drums = node.all(Kind::Drum);
        let (drum, again) = (drums.next(), drums.next());
        if let (Some(first), Some(again)) = (drum, again) {
            self.twice(again, self.origin(first));
        }
        let drum = drum.and_then(|n| self.value(n));
        let form = node.parts().find(|n| matches!(n.kind, Kind::Range | Kind::By | Kind::Keys))?;
        let profile = match form.kind {
            Kind::Range => {
                let mut values = self.values(form).into_iter();
                Profile::Range(values.next()?, values.next()?)
            }
            Kind::By => Profile::By(self.value(form)?),
            _ => self.keys(form),
        };
        let continuous = node.all(Kind::Keyword).any(|n| self.text(n) == "continuous");
        Some(StatementKind::Drive { joint, profile, motor, continuous, drum })
    }

    fn stretch(&mut self, node: &Node) -> Option<super::ast::Stretch> {
        let mut ends = self.values(node.first(Kind::Range)?).into_iter();
        let (from, to) = (ends.next()?, ends.next()?);
        Some(super::ast::Stretch { drive: self.ident(node)?, from, to, steps: self.value(node) })
    }

    fn keys(&mut self, node: &Node) -> Profile {
        let smooth = node.all(Kind::Keyword).any(|n| self.text(n) == "smooth");
        let mut keys = Vec::new();
        for key in node.all(Kind::Key) {
            let mut values = self.values(key).into_iter();
            keys.extend(values.next().zip(values.next()));
        }
        Profile::Keys { smooth, keys, at: self.origin(node) }
    }

    fn minimize(&mut self, node: &Node) -> StatementKind {
        let mut terms = Vec::new();
        for child in &node.children {
            match child.kind {
                Kind::Term => {
                    let Some(call) = child.first(Kind::Call) else { continue };
                    let call = self.expr(call);
                    terms.push(Term { call, weight: self.value(child), at: self.origin(child) });
                }
                Kind::BadTerm => self.bad_term(child),
                _ => {}
            }
        }
        self.closed(node);
        StatementKind::Minimize(terms)
    }

    fn require(&mut self, node: &Node) -> Option<StatementKind> {
        let mut values = self.values(node).into_iter();
        let op = self.comparison(node)?;
        Some(StatementKind::Require { left: values.next()?, op, right: values.next()? })
    }

    pub(super) fn comparison(&self, node: &Node) -> Option<At<Compare>> {
        let sign = node.first(Kind::Punctuation)?;
        let op = match self.text(sign) {
            "<=" => Compare::LessEqual,
            "<" => Compare::Less,
            ">=" => Compare::GreaterEqual,
            _ => Compare::Greater,
        };
        Some(At { node: op, at: self.origin(sign) })
    }

    fn string(&mut self, node: &Node) -> Option<Cable> {
        let mut names = self.idents(node).into_iter();
        let (name, from, to) = (names.next()?, names.next()?, names.next()?);
        let via = self.values(node.first(Kind::Via)?);
        Some(Cable { name, from, at: self.value(node)?, to, via })
    }

    fn load(&mut self, node: &Node) -> Option<Load> {
        let form = node.parts().find(|n| matches!(n.kind, Kind::Gravity | Kind::Moment | Kind::Force))?;
        let mut values = self.values(form).into_iter();
        let first = values.next()?;
        Some(match form.kind {
            Kind::Gravity => Load::Gravity { direction: first },
            Kind::Moment => Load::Moment { size: first, about: values.next()?, body: self.ident(form)? },
            _ => {
                let (along, point) = (values.next()?, values.next()?);
                Load::Force { size: first, along, body: self.ident(form)?, point }
            }
        })
    }

    pub(super) fn allow(&mut self, node: &Node) -> Option<Allow> {
        let reason = node.first(Kind::Text)?;
        let reason = At { node: self.quoted(reason), at: self.origin(reason) };
        Some(Allow { code: self.ident(node)?, reason, at: self.origin(node) })
    }

    fn rod(&mut self, node: &Node) -> Option<Rod> {
        let mut section = self.values(node.first(Kind::RodSection)?).into_iter();
        Some(Rod {
            name: self.ident(node)?,
            second_axis: node.first(Kind::RodAxis).map(|n| self.which_axis(n)),
            from: self.rod_end(node.first(Kind::RodFrom)?)?,
            to: self.rod_end(node.first(Kind::RodTo)?)?,
            section: section.next()?,
            section_to: section.next(),
        })
    }

    fn which_axis(&self, node: &Node) -> At<bool> {
        let second = node.all(Kind::Keyword).any(|n| self.text(n) == "second");
        At { node: second, at: self.origin(node) }
    }

    fn rod_end(&mut self, node: &Node) -> Option<RodEnd> {
        let body: Ident = self.ident(node)?;
        let mut values = self.values(node).into_iter();
        Some(RodEnd { body, position: values.next()?, along: values.next()? })
    }

    /// Reports statements in a block of the wrong sort and takes them out of its meaning: a
    /// mechanism has no rods, a flexure nothing but parameters and rods.
    pub(super) fn placed(&mut self, statements: &mut [Statement], mechanism: bool) {
        for statement in statements {
            let (fits, what) = match &statement.kind {
                StatementKind::Param { .. } | StatementKind::Let { .. } => (true, ""),
                StatementKind::Later { .. } | StatementKind::Allow(_) | StatementKind::Broken { .. } => {
                    (true, "")
                }
                StatementKind::Rod(_) => (!mechanism, "a rod belongs in a `flexure`"),
                StatementKind::OwnBody { .. } => (!mechanism, "a flexure's own body belongs in a `flexure`"),
                _ => (mechanism, "this statement belongs in a `mechanism`"),
            };
            if !fits {
                let help = if mechanism {
                    "a mechanism gets these from a joint's `as TEMPLATE`"
                } else {
                    "a flexure holds `param`, `let`, `body` and `rod` statements"
                };
                self.report(Diagnostic::error("E0009", what, statement.at).help(help));
                statement.kind = StatementKind::Broken { words: Vec::new() };
            }
        }
    }
}
