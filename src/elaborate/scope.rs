//! Scopes: the names of a mechanism or of one instance of a template, each with its state of evaluation.

use super::codes;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::load::item_kind;
use super::scaling::is_limit;
use super::value::Value;
use crate::diagnostic::{Diagnostic, Origin};
use crate::syntax::ast::{Expr, Ident};
use std::collections::BTreeMap;

/// The names of a mechanism or template instance.
pub struct Scope<'a> {
    /// Module whose top-level names are seen from here.
    pub module: usize,
    /// Declarations in order.
    pub locals: Vec<Local<'a>>,
    /// Index by name.
    pub index: BTreeMap<String, usize>,
}

/// A declared name.
pub struct Local<'a> {
    /// Name.
    pub name: String,
    /// Where it is declared.
    pub at: Origin,
    /// How its value comes about.
    pub kind: LocalKind<'a>,
    /// State of evaluation.
    pub state: State,
}

/// How the value of a name comes about.
#[derive(Clone)]
pub enum LocalKind<'a> {
    /// By an expression.
    Value {
        /// Where the expression is evaluated.
        env: Env,
        /// The expression.
        value: &'a Expr,
        /// Declared type.
        ty: Option<&'a Ident>,
        /// It must be a point.
        point: bool,
        /// Scope and default value that `value` replaces: without a declared type its dimension counts.
        default: Option<(usize, &'a Expr)>,
    },
    /// Given by the compiler.
    Given,
    /// A body, joint or trace: it has a name but is no value.
    Thing(&'static str),
}

/// State of evaluation.
#[derive(Clone, Debug)]
pub enum State {
    /// Not yet asked for.
    Waiting,
    /// Being evaluated.
    Busy,
    /// Evaluated.
    Done(Value),
    /// A diagnostic has been given.
    Failed,
}

/// What is being evaluated, to find circles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A name of a scope.
    Local(usize, usize),
    /// A field of a record: module, item, field.
    Field(usize, usize, usize),
}

impl<'a> Evaluator<'a> {
    /// Declares a name; reports duplicates and shadowing. Returns its index unless it is a duplicate.
    pub(super) fn declare(&mut self, scope: usize, local: Local<'a>) -> Option<usize> {
        let s = self.scopes.get(scope)?;
        let (name, at) = (local.name.clone(), local.at);
        if let Some(first) = s.index.get(&name).and_then(|i| s.locals.get(*i)) {
            let first_at = first.at;
            let d = Diagnostic::error(codes::DUPLICATE, format!("`{name}` is declared twice"), at)
                .label("again here")
                .help("rename one of them");
            let d = if first_at == Origin::default() {
                d.label("this name is given by the compiler")
            } else {
                d.also(first_at, "first here")
            };
            self.out.push(d);
            return None;
        }
        let outer = self.program.modules.get(s.module).and_then(|m| Some((m, m.names.get(&name)?)));
        if let Some((module, visible)) = outer {
            let place = match visible.by_use {
                Some(u) => module.file.uses.get(u).map(|u| u.at),
                None => self.program.item(visible.item).map(|i| super::load::item_name(i).at),
            };
            let kind = self.program.item(visible.item).map_or("item", item_kind).to_string();
            let mut d =
                Diagnostic::error(codes::SHADOWING, format!("`{name}` would hide the {kind} `{name}`"), at)
                    .help("choose another name: nothing shadows");
            if let Some(place) = place {
                d = d.also(place, format!("the {kind} comes from here"));
            }
            self.out.push(d);
        }
        let s = self.scopes.get_mut(scope)?;
        s.locals.push(local);
        let index = s.locals.len() - 1;
        s.index.insert(name, index);
        Some(index)
    }

    /// Adds a scope.
    pub(super) fn scope(&mut self, module: usize) -> usize {
        self.scopes.push(Scope { module, locals: Vec::new(), index: BTreeMap::new() });
        self.scopes.len() - 1
    }

    /// Forces a declared name; `asked_at` is where it is used.
    pub(super) fn force(&mut self, scope: usize, local: usize, asked_at: Origin) -> Outcome<Value> {
        let Some(entry) = self.scopes.get(scope).and_then(|s| s.locals.get(local)) else {
            return Err(Failed);
        };
        match &entry.state {
            State::Done(v) => return Ok(v.clone()),
            State::Failed => return Err(Failed),
            State::Busy => {
                let key = Key::Local(scope, local);
                let name = entry.name.clone();
                return self.circle(key, &name, asked_at);
            }
            State::Waiting => {}
        }
        if let LocalKind::Thing(kind) = entry.kind {
            let name = Ident { node: entry.name.clone(), at: asked_at };
            return self.wrong_kind(&name, kind, "a value");
        }
        let (name, kind) = (entry.name.clone(), entry.kind.clone());
        self.set_state(scope, local, State::Busy);
        self.busy.push((Key::Local(scope, local), name, asked_at));
        // Nothing is multiplied at scale 1: then it is not looked for.
        let limit = self.scale != 1.0 && is_limit(&kind);
        let around = std::mem::replace(&mut self.as_is, limit);
        let value = self.declared(&kind);
        self.as_is = around;
        self.busy.pop();
        let state = value.as_ref().map_or(State::Failed, |v| State::Done(v.clone()));
        self.set_state(scope, local, state);
        value
    }

    fn set_state(&mut self, scope: usize, local: usize, state: State) {
        if let Some(l) = self.scopes.get_mut(scope).and_then(|s| s.locals.get_mut(local)) {
            l.state = state;
        }
    }

    /// Reports declarations that need each other.
    pub(super) fn circle<T>(&mut self, key: Key, name: &str, asked_at: Origin) -> Outcome<T> {
        let first = self.busy.iter().position(|(k, ..)| *k == key).unwrap_or(0);
        let members: Vec<(String, Origin)> =
            self.busy.iter().skip(first).map(|(_, n, at)| (n.clone(), *at)).collect();
        let mut chain: Vec<&str> = members.iter().map(|(n, _)| n.as_str()).collect();
        chain.push(name);
        let mut d = Diagnostic::error(
            codes::CYCLE,
            format!("these need each other in a circle: {}", chain.join(" → ")),
            asked_at,
        )
        .label(format!("needs `{name}`, which is being worked out"))
        .help("give one of them a value of its own");
        for (n, at) in members.iter().skip(1) {
            d = d.also(*at, format!("needs `{n}`"));
        }
        self.fail(d)
    }

    /// Value of a declaration with its checks.
    fn declared(&mut self, kind: &LocalKind<'a>) -> Outcome<Value> {
        let LocalKind::Value { env, value, ty, point, default } = kind else { return Err(Failed) };
        let v = self.eval(env, value)?;
        if *point {
            let p = self.as_point(v, value)?;
            return Ok(Value::Point(p));
        }
        // A tuple kept under a name is a vector from now on.
        let v = match v {
            Value::Vector { v, dim, .. } => Value::Vector { v, dim, literal: false },
            other => other,
        };
        match (ty, default) {
            (Some(ty), _) => self.check_type(&v, value, ty)?,
            (None, Some((scope, default))) => {
                let probe = Env { scope: *scope, path: None, probe: true, time: None };
                let expected = self.eval(&probe, default)?;
                self.check_like(&v, value, &expected, default.at)?;
            }
            (None, None) => {}
        }
        Ok(v)
    }
}
