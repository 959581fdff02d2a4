//! Names of an assembly that reach into an instance: `torque(right.servo)` is the query `torque(servo)` put to
//! `right`. It is taken apart before evaluation, so that every query of a mechanism can be put to an instance.

use super::sheet::DriveText;
use crate::diagnostic::Origin;
use crate::syntax::ast::{self, Argument, Expr, ExprKind, Ident, Mechanism, StatementKind};
use std::collections::{BTreeMap, BTreeSet};

/// A statement without the instances' names in it.
pub struct Query<T> {
    /// The instances it names, each once.
    pub instances: Vec<Ident>,
    /// What is left.
    pub text: T,
    /// The whole statement.
    pub at: Origin,
    /// Of a repeated one, in which turn: ` (i = 2)`.
    pub turn: String,
}

/// `require` and `export` statements of an assembly.
pub struct Queries {
    /// Left side, comparison, right side.
    pub requires: Vec<Query<(Expr, ast::Compare, Expr)>>,
    /// Each export; one of drives of several instances as that of each drive.
    pub exports: Vec<Vec<Query<Expr>>>,
}

impl Queries {
    /// Those of a mechanism that places others.
    /// `turns` tells repeated statements apart, by their index.
    pub fn of(m: &Mechanism, turns: &BTreeMap<usize, String>) -> Self {
        let names: BTreeSet<&str> = m
            .statements
            .iter()
            .filter_map(|s| match &s.kind {
                StatementKind::Place(p) => Some(p.name.node.as_str()),
                StatementKind::Mirror(p) => Some(p.name.node.as_str()),
                _ => None,
            })
            .collect();
        let mut out = Self { requires: Vec::new(), exports: Vec::new() };
        for (k, s) in m.statements.iter().enumerate() {
            let turn = turns.get(&k).cloned().unwrap_or_default();
            match &s.kind {
                StatementKind::Require { left, op, right } => {
                    let mut found = Vec::new();
                    let text =
                        (stripped(left, &names, &mut found), op.node, stripped(right, &names, &mut found));
                    out.requires.push(Query { instances: found, text, at: s.at, turn });
                }
                StatementKind::Export(list) => out.exports.extend(list.iter().map(|e| {
                    let query = |e: &Expr| {
                        let mut found = Vec::new();
                        let text = stripped(e, &names, &mut found);
                        Query { instances: found, text, at: e.at, turn: turn.clone() }
                    };
                    let whole = query(e);
                    match &e.kind {
                        ExprKind::Call { function, arguments } if whole.instances.len() > 1 => {
                            let alone = |a: &Argument| {
                                let (function, arguments) = (function.clone(), vec![a.clone()]);
                                query(&Expr { kind: ExprKind::Call { function, arguments }, at: e.at })
                            };
                            arguments.iter().map(alone).collect()
                        }
                        _ => vec![whole],
                    }
                })),
                _ => {}
            }
        }
        out
    }
}

/// The drives of a mechanism as written.
pub fn drive_texts(m: &Mechanism) -> Vec<DriveText<'_>> {
    m.statements
        .iter()
        .filter_map(|s| match &s.kind {
            StatementKind::Drive { joint, profile, motor, continuous, drum } => {
                let (motor, drum) = (motor.as_ref(), drum.as_ref());
                Some(DriveText { joint, profile, motor, continuous: *continuous, drum, at: s.at })
            }
            _ => None,
        })
        .collect()
}

/// An expression with `INSTANCE.NAME` made `NAME`, and an argument that is only an instance left out.
fn stripped(e: &Expr, names: &BTreeSet<&str>, found: &mut Vec<Ident>) -> Expr {
    let kind = match &e.kind {
        ExprKind::Name(path) => match path.split_first() {
            Some((first, rest)) if !rest.is_empty() && names.contains(first.node.as_str()) => {
                meet(found, first);
                ExprKind::Name(rest.to_vec())
            }
            _ => e.kind.clone(),
        },
        ExprKind::Call { function, arguments } => {
            let mut kept = Vec::new();
            for a in arguments {
                match &a.value.kind {
                    ExprKind::Name(path)
                        if a.name.is_none()
                            && path.len() == 1
                            && path.iter().all(|p| names.contains(p.node.as_str())) =>
                    {
                        path.iter().for_each(|p| meet(found, p));
                    }
                    _ => {
                        kept.push(Argument { name: a.name.clone(), value: stripped(&a.value, names, found) })
                    }
                }
            }
            ExprKind::Call { function: function.clone(), arguments: kept }
        }
        ExprKind::Negate(inner) => ExprKind::Negate(Box::new(stripped(inner, names, found))),
        ExprKind::Binary(op, a, b) => {
            ExprKind::Binary(*op, Box::new(stripped(a, names, found)), Box::new(stripped(b, names, found)))
        }
        ExprKind::Tuple(items) => ExprKind::Tuple(items.iter().map(|i| stripped(i, names, found)).collect()),
        ExprKind::About { .. } => e.kind.clone(),
        ExprKind::Number { .. } | ExprKind::Text(_) | ExprKind::Free { .. } | ExprKind::Broken => {
            e.kind.clone()
        }
    };
    Expr { kind, at: e.at }
}

fn meet(found: &mut Vec<Ident>, name: &Ident) {
    if !found.iter().any(|f| f.node == name.node) {
        found.push(name.clone());
    }
}
