//! `place`, `mirror`, `for`, `case`, `variant` and `assert`: concrete tree to their views in [`ast`](super::ast).

use super::ast::{Assert, At, Case, For, Mirror, Place, Statement, StatementKind, Variant};
use super::lower::Lower;
use super::tree::{Kind, Node};
use crate::diagnostic::{Diagnostic, Origin};

impl Lower<'_> {
    pub(super) fn place(&mut self, node: &Node) -> Option<Place> {
        let mut names = self.indexed(node).into_iter();
        let (name, mechanism) = (names.next()?, names.next()?);
        let point = self.value(node)?;
        let overrides = self.overrides(node);
        let (turned, scale, merging) = (None, None, Vec::new());
        let mut place = Place { name, mechanism, overrides, point, turned, scale, merging };
        let mut seen: Vec<(Kind, Origin)> = Vec::new();
        for clause in node.parts() {
            let kind = clause.kind;
            if !matches!(kind, Kind::Turned | Kind::Scaled | Kind::Merging) {
                continue;
            }
            let first = seen.iter().find(|(k, _)| *k == kind && kind != Kind::Merging).map(|(_, at)| *at);
            if let Some(first) = first {
                self.twice(clause, first);
                continue;
            }
            seen.push((kind, self.origin(clause)));
            match kind {
                Kind::Turned => {
                    let mut values = self.values(clause).into_iter();
                    place.turned = values.next().zip(values.next());
                }
                Kind::Scaled => place.scale = self.value(clause),
                _ => {
                    let mut names = self.idents(clause).into_iter();
                    place.merging.extend(names.next().zip(names.next()));
                }
            }
        }
        Some(place)
    }

    pub(super) fn mirror(&mut self, node: &Node) -> Option<Mirror> {
        let mut names = self.indexed(node).into_iter();
        let (name, of, plane) = (names.next()?, names.next()?, names.next()?);
        let sharing = node.first(Kind::Sharing).map(|n| self.idents(n)).unwrap_or_default();
        Some(Mirror { name, of, plane, sharing })
    }

    pub(super) fn assertion(&mut self, node: &Node) -> Option<Assert> {
        let mut values = self.values(node).into_iter();
        let (left, right) = (values.next()?, values.next()?);
        let text = node.first(Kind::Text)?;
        let message = At { node: self.quoted(text), at: self.origin(text) };
        Some(Assert { left, op: self.comparison(node)?, right, message })
    }

    pub(super) fn variant(&mut self, node: &Node) -> Option<Variant> {
        let name = self.ident(node)?;
        let mut settings = Vec::new();
        for setting in node.all(Kind::Setting) {
            let names = self.idents(setting);
            let (first, last) = (names.first()?, names.last()?);
            let at = Origin { end: last.at.end, ..first.at };
            let path: Vec<&str> = names.iter().map(|n| n.node.as_str()).collect();
            settings.push((At { node: path.join("."), at }, self.value(setting)?));
        }
        Some(Variant { name, settings })
    }

    pub(super) fn repeated(&mut self, node: &Node) -> Option<For> {
        let variable = self.ident(node)?;
        let mut values = self.values(node).into_iter();
        let (first, last) = (values.next()?, values.next()?);
        let mut statements = self.statements(node);
        self.only(
            &mut statements,
            |kind| {
                use StatementKind::{Export, For, Mirror, Place, Require};
                matches!(kind, Place(_) | Mirror(_) | Require { .. } | Export(_) | For(_))
            },
            [
                "this statement cannot be repeated",
                "a `for` holds `place`, `mirror`, `require`, `export` and further `for`s",
            ],
        );
        Some(For { variable, first, last, statements })
    }

    pub(super) fn case(&mut self, node: &Node) -> Option<Case> {
        let name = self.ident(node)?;
        let mut statements = self.statements(node);
        self.only(
            &mut statements,
            |kind| {
                use StatementKind::{Load, Minimize, Require};
                matches!(kind, Load(_) | Minimize(_) | Require { .. })
            },
            [
                "a load case cannot change this",
                "a `case` holds `load`, `minimize` and `require`; all else it shares with the mechanism",
            ],
        );
        Some(Case { name, statements })
    }

    /// Takes statements out of a block that are not of its sort, with a message and a help.
    fn only(
        &mut self,
        statements: &mut [Statement],
        fits: impl Fn(&StatementKind) -> bool,
        [message, help]: [&str; 2],
    ) {
        for s in statements {
            let told = matches!(s.kind, StatementKind::Later { .. } | StatementKind::Broken { .. });
            if !told && !fits(&s.kind) {
                self.report(Diagnostic::error("E0009", message, s.at).help(help));
                s.kind = StatementKind::Broken { words: Vec::new() };
            }
        }
    }
}
