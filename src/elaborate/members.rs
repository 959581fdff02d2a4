//! Which bodies a template joins: those of the joint, by letters, and bodies of its own.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use super::scope::{Local, LocalKind, State};
use super::structure::MAX_PARTS;
use super::template::Site;
use crate::diagnostic::Diagnostic;
use crate::ir::{Body, BodyId};
use crate::syntax::ast::{self, Flexure, Ident, StatementKind};
use std::collections::BTreeSet;

/// Names of the bodies that a template's rods may be clamped in.
pub(super) struct Members {
    /// `a`, `b`, … of the joint, then the template's own.
    names: Vec<(String, BodyId)>,
    /// How many of them are the joint's.
    joined: usize,
}

fn rods(flexure: &Flexure) -> impl Iterator<Item = &ast::Rod> {
    flexure.statements.iter().filter_map(|s| match &s.kind {
        StatementKind::Rod(rod) => Some(&**rod),
        _ => None,
    })
}

fn is_letter(name: &str) -> bool {
    name.len() == 1 && name.bytes().all(|b| b.is_ascii_lowercase())
}

fn letters() -> impl Iterator<Item = String> {
    ('a'..='z').map(String::from)
}

impl<'a> Evaluator<'a> {
    /// Declares the template's own bodies, and checks that its rods join all of them and as many bodies as the joint
    /// has. New bodies are added to `bodies`. None where the rods cannot be looked at.
    pub(super) fn members(
        &mut self,
        inner: usize,
        flexure: &'a Flexure,
        used_at: crate::diagnostic::Origin,
        site: &Site<'_>,
        bodies: &mut Vec<Body>,
    ) -> (Option<Members>, Outcome<()>) {
        let mut names: Vec<(String, BodyId)> = letters().zip(site.bodies.iter().copied()).collect();
        let joined = names.len();
        let mut ok = Ok(());
        for s in &flexure.statements {
            let StatementKind::OwnBody { name, points } = &s.kind else { continue };
            if let Some(point) = points.first() {
                ok = self.fail(
                    Diagnostic::error(codes::MISPLACED, "a flexure's own body has no points", point.at)
                        .help(format!("write `body {}`: it reaches from rod to rod", name.node)),
                );
            }
            if is_letter(&name.node) {
                let message = format!("`{}` stands for a body of the joint", name.node);
                ok = self.fail(
                    Diagnostic::error(codes::DUPLICATE, message, name.at)
                        .help("give the flexure's own body a longer name"),
                );
                continue;
            }
            let kind = LocalKind::Thing("body");
            let local = Local { name: name.node.clone(), at: name.at, kind, state: State::Waiting };
            if self.declare(inner, local).is_none() {
                ok = Err(Failed);
            }
            if bodies.len() >= MAX_PARTS {
                let message = format!("more than {MAX_PARTS} bodies, those of flexures counted");
                return (None, self.fail(Diagnostic::error(codes::TOO_LARGE, message, used_at)));
            }
            names.push((name.node.clone(), bodies.len()));
            bodies.push(Body {
                name: format!("{}.{}", site.joint_name, name.node),
                ground: false,
                skeleton: Vec::new(),
                layer: site.layer,
                owner: Some(site.joint),
                holes: Vec::new(),
                fittings: Default::default(),
                printed: None,
                origin: s.at,
            });
        }
        let members = Members { names, joined };
        if let Err(Failed) = self.count(flexure, used_at, &members) {
            return (None, Err(Failed));
        }
        let joined = self.joined(flexure, used_at, &members);
        (Some(members), ok.and(joined))
    }

    /// How many bodies a template joins follows from the letters of its rods.
    fn count(
        &mut self,
        flexure: &Flexure,
        used_at: crate::diagnostic::Origin,
        members: &Members,
    ) -> Outcome<()> {
        let ends = rods(flexure).flat_map(|r| [&r.from.body.node, &r.to.body.node]);
        let used: BTreeSet<&String> = ends.filter(|n| is_letter(n)).collect();
        let without_gap = used.iter().zip(letters()).all(|(u, l)| **u == l);
        // Otherwise a letter is a mistake of the template, told at the rod.
        if !without_gap || used.len() == members.joined || used.is_empty() {
            return Ok(());
        }
        let (name, n) = (&flexure.name.node, used.len());
        let message = format!("`{name}` joins {n} bodies, this joint has {}", members.joined);
        let example: Vec<String> = letters().take(n).map(|l| l.to_uppercase()).collect();
        let (first, later) = example.split_first().ok_or(Failed)?;
        self.fail(
            Diagnostic::error(codes::JOINT_BODIES, message, used_at)
                .also(flexure.name.at, "declared here")
                .help(format!("it replaces a joint `{first} to {}`", later.join(", "))),
        )
    }

    /// Every body must hang together with the others by rods: one that does not would float.
    fn joined(
        &mut self,
        flexure: &'a Flexure,
        used_at: crate::diagnostic::Origin,
        members: &Members,
    ) -> Outcome<()> {
        let ends: Vec<[BodyId; 2]> = rods(flexure)
            .filter_map(|r| Some([members.find(&r.from.body)?, members.find(&r.to.body)?]))
            .collect();
        if ends.len() < rods(flexure).count() || ends.is_empty() {
            return Ok(()); // told at the rod, or where there is none
        }
        let mut reached: BTreeSet<BodyId> = members.names.first().map(|(_, b)| *b).into_iter().collect();
        for _ in &members.names {
            for [a, b] in &ends {
                if reached.contains(a) || reached.contains(b) {
                    reached.extend([*a, *b]);
                }
            }
        }
        let loose = members.names.iter().find(|(_, b)| !reached.contains(b));
        let ending = members.names.iter().skip(members.joined).find(|(_, b)| {
            let own = |e: &&[BodyId; 2]| e.contains(b);
            ends.iter().filter(own).count() < 2
        });
        let (name, message) = match (loose, ending) {
            (Some((name, _)), _) => (name, format!("no rod joins body `{name}` to the others")),
            (None, Some((name, _))) => (name, format!("body `{name}` leads nowhere: only one rod holds it")),
            (None, None) => return Ok(()),
        };
        let own = flexure.statements.iter().find_map(|s| match &s.kind {
            StatementKind::OwnBody { name: n, .. } if n.node == *name => Some(n.at),
            _ => None,
        });
        self.fail(
            Diagnostic::error(codes::JOINT_BODIES, message, own.unwrap_or(flexure.name.at))
                .also(used_at, "used here")
                .help("a flexure leads from each body of its joint to the others, by bodies of its own or without"),
        )
    }

    /// The body of a rod's end.
    pub(super) fn member(&mut self, name: &Ident, members: &Members) -> Outcome<BodyId> {
        match members.find(name) {
            Some(b) => Ok(b),
            None => {
                let message = format!("the joint has no body `{}`", name.node);
                let known: Vec<&str> = members.names.iter().map(|(n, _)| n.as_str()).collect();
                self.fail(
                    Diagnostic::error(codes::UNKNOWN_NAME, message, name.at)
                        .help(format!("its bodies are {} in the order written", known.join(", "))),
                )
            }
        }
    }
}

impl Members {
    fn find(&self, name: &Ident) -> Option<BodyId> {
        self.names.iter().find(|(n, _)| *n == name.node).map(|(_, b)| *b)
    }
}
