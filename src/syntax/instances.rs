//! `place` and `mirror`: concrete tree to [`ast::Place`] and [`ast::Mirror`].

use super::ast::{Mirror, Place};
use super::lower::Lower;
use super::tree::{Kind, Node};
use crate::diagnostic::Origin;

impl Lower<'_> {
    pub(super) fn place(&mut self, node: &Node) -> Option<Place> {
        let mut names = self.idents(node).into_iter();
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
        let mut names = self.idents(node).into_iter();
        let (name, of, plane) = (names.next()?, names.next()?, names.next()?);
        let sharing = node.first(Kind::Sharing).map(|n| self.idents(n)).unwrap_or_default();
        Some(Mirror { name, of, plane, sharing })
    }
}
