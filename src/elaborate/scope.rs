//! Scopes: the names of a mechanism or of one instance of a template, each with its state of evaluation.

use super::eval::Env;
use super::value::Value;
use crate::diagnostic::Origin;
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
