//! Evaluation of expressions into the design's expression graph: names are forced on demand, so
//! declarations may stand in any order; a name met while it is being forced closes a circle.

use super::codes;
use super::dimension::Dimension;
use super::load::{Program, item_kind};
use super::scope::{Key, Scope, State};
use super::settings::Settings;
use super::units;
use super::value::{Scalar, Value, with_article};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::FreeVariable;
use crate::ir::expr::{ExprGraph, ExprId, Node};
use crate::syntax::ast::{BinaryOp, Expr, ExprKind, Ident, UnitFactor};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;

/// A diagnostic has been given; nothing more is to be said.
#[derive(Clone, Copy, Debug)]
pub struct Failed;

/// Result of evaluation.
pub type Outcome<T> = Result<T, Failed>;

/// Deepest nesting of expressions and of declarations that need each other. Measured: 200 levels fit
/// into 384 KiB of stack in a development build, not into 256 KiB.
const MAX_DEPTH: usize = 200;
/// Most nodes of the expression graph; Chebyshev's linkage needs 111.
const MAX_NODES: usize = 20_000;
/// Most expressions evaluated, templates counted at each use. Measured: a text that uses
/// them up is refused within a second in a development build.
const MAX_WORK: usize = 400_000;

/// Where an expression is evaluated.
#[derive(Clone)]
pub struct Env {
    /// Scope index.
    pub scope: usize,
    /// Path given to a `free` met here; none: nothing may vary here.
    pub path: Option<Rc<str>>,
    /// Take the start of a `free` instead of making a variable (to learn a default's dimension).
    pub probe: bool,
    /// What `t` stands for, where the time of the cycle may stand.
    pub time: Option<ExprId>,
}

impl Env {
    /// A place where nothing may vary.
    pub fn fixed(scope: usize) -> Self {
        Self { scope, path: None, probe: false, time: None }
    }

    /// A place whose free values are named `path`.
    pub fn named(scope: usize, path: impl Into<Rc<str>>) -> Self {
        Self { scope, path: Some(path.into()), probe: false, time: None }
    }
}

/// State of evaluation of one design.
pub struct Evaluator<'a> {
    pub(super) program: &'a Program,
    pub(super) settings: &'a Settings,
    pub(super) exprs: ExprGraph,
    pub(super) free: Vec<FreeVariable>,
    pub(super) out: Vec<Diagnostic>,
    pub(super) scopes: Vec<Scope<'a>>,
    /// State of record fields by (module, item, field).
    pub(super) fields: BTreeMap<(usize, usize, usize), State>,
    /// Uses that brought a name that was needed: (module, use).
    pub(super) used: BTreeSet<(usize, usize)>,
    /// Entries of `--set` that found their target.
    pub(super) set_used: BTreeSet<usize>,
    /// Everything `--set` could have named, for suggestions.
    pub(super) settable: BTreeSet<String>,
    pub(super) busy: Vec<(Key, String, Origin)>,
    depth: usize,
    work: usize,
    /// The limits are exceeded: this has been said, nothing more is evaluated.
    full: bool,
    pub(super) paths: BTreeSet<String>,
    /// Words of statements that could not be understood: such a name may have been declared there.
    pub(super) half_said: BTreeSet<String>,
    /// Where each node is: only looked up, never listed.
    interned: HashMap<(u8, u64, u64), ExprId>,
    /// Nothing is driven: the conventional mechanism has no path.
    pub(super) undriven: bool,
    /// Whether loads act where goals are looked at: those of the mechanism, or of the case.
    pub(super) loaded: bool,
    /// Directions, outputs and targets of the mechanism.
    pub(super) aims: super::aims::AimNames,
    /// Names of the strings.
    pub(super) cables: BTreeSet<String>,
    /// Names of the joints that slide, and of the strings.
    pub(super) sliders: BTreeSet<String>,
    /// Values of all nodes at the start values of the free variables, and those start values.
    pub(super) starts: (Vec<f64>, Vec<f64>),
    /// Drawn lengths are multiplied by this (`place … scale = k`) …
    pub(super) scale: f64,
    /// … but not what is evaluated while this is set: records, bought parts, goals.
    pub(super) as_is: bool,
    /// What names came to in the mechanisms that this one places.
    pub(super) placed_values: Vec<super::KnownValue>,
    /// Instances whose points can be named.
    pub(super) drawn: super::drawn::Drawings,
}

impl<'a> Evaluator<'a> {
    pub(super) fn new(program: &'a Program, settings: &'a Settings) -> Self {
        Self {
            program,
            settings,
            exprs: ExprGraph::default(),
            free: Vec::new(),
            out: Vec::new(),
            scopes: Vec::new(),
            fields: BTreeMap::new(),
            used: BTreeSet::new(),
            set_used: BTreeSet::new(),
            settable: BTreeSet::new(),
            busy: Vec::new(),
            depth: 0,
            work: 0,
            full: false,
            paths: BTreeSet::new(),
            half_said: BTreeSet::new(),
            interned: HashMap::new(),
            undriven: false,
            loaded: false,
            aims: super::aims::AimNames::default(),
            cables: BTreeSet::new(),
            sliders: BTreeSet::new(),
            starts: (Vec::new(), Vec::new()),
            scale: 1.0,
            placed_values: Vec::new(),
            drawn: Default::default(),
            as_is: false,
        }
    }

    /// Gives a diagnostic.
    pub(super) fn fail<T>(&mut self, diagnostic: Diagnostic) -> Outcome<T> {
        self.out.push(diagnostic);
        Err(Failed)
    }

    /// Adds a node; errors when the graph is full or a constant is not finite.
    pub(super) fn node(&mut self, node: Node, at: Origin) -> Outcome<ExprId> {
        let node = self.exprs.fold(node);
        let key = node_key(&node);
        let id = match self.interned.get(&key) {
            Some(id) => *id,
            None => {
                if self.exprs.nodes.len() >= MAX_NODES {
                    return self.too_large(at);
                }
                self.exprs.nodes.push(node);
                self.exprs.extend_values(&mut self.starts.0, &self.starts.1);
                let id = ExprId((self.exprs.nodes.len() - 1) as u32);
                self.interned.insert(key, id);
                id
            }
        };
        match self.exprs.as_constant(id) {
            Some(v) if !v.is_finite() => self.fail(
                Diagnostic::error(codes::NOT_FINITE, "this is not a finite number", at)
                    .label("a division by zero, a root of a negative number, or a number out of range"),
            ),
            _ => Ok(id),
        }
    }

    fn too_large<T>(&mut self, at: Origin) -> Outcome<T> {
        if std::mem::replace(&mut self.full, true) {
            return Err(Failed);
        }
        self.fail(
            Diagnostic::error(codes::TOO_LARGE, "the design is too large to be worked out", at).help(format!(
                "at most {MAX_NODES} different expressions and {MAX_WORK} evaluated ones, templates counted at each use"
            )),
        )
    }

    /// Value of a node at the start values of the free variables.
    pub(super) fn start_value(&self, id: ExprId) -> f64 {
        self.starts.0.get(id.0 as usize).copied().unwrap_or(f64::NAN)
    }

    pub(super) fn constant(&mut self, v: f64, at: Origin) -> Outcome<ExprId> {
        self.node(Node::Const(v), at)
    }

    /// Evaluates an expression.
    pub(super) fn eval(&mut self, env: &Env, e: &'a Expr) -> Outcome<Value> {
        if self.depth >= MAX_DEPTH {
            return self.fail(
                Diagnostic::error(codes::TOO_LARGE, "expressions are nested too deeply", e.at)
                    .help(format!("at most {MAX_DEPTH} levels, counted through the names they use")),
            );
        }
        self.work += 1;
        if self.work > MAX_WORK || self.full {
            return self.too_large(e.at);
        }
        self.depth += 1;
        let value = self.eval_inner(env, e);
        self.depth -= 1;
        value
    }

    fn eval_inner(&mut self, env: &Env, e: &'a Expr) -> Outcome<Value> {
        match &e.kind {
            ExprKind::Number { value, unit } => self.number(*value, unit, e.at),
            ExprKind::Name(path) => self.name(env, path, e.at),
            ExprKind::Text(t) => Ok(Value::Text(t.clone())),
            ExprKind::Tuple(items) => self.tuple(env, items, e.at),
            ExprKind::Negate(inner) => {
                let v = self.eval(env, inner)?;
                self.negate(v, e.at)
            }
            ExprKind::Binary(BinaryOp::Power, base, exponent) => self.power(env, base, exponent, e.at),
            ExprKind::Binary(op, l, r) => {
                let a = self.eval(env, l);
                let b = self.eval(env, r);
                let (a, b) = (a?, b?);
                self.binary(env, *op, (l, a), (r, b), e.at)
            }
            ExprKind::Call { function, arguments } => self.call(env, function, arguments, e.at),
            ExprKind::Free { start, lower, upper } => self.free_value(env, start, lower, upper, e.at),
            ExprKind::About { .. } => self.fail(
                Diagnostic::error(codes::TYPE, "`about` stands only in `angle(BODY about D)`", e.at)
                    .help("write for instance `output curl = angle(distal about z)`"),
            ),
            ExprKind::Broken => Err(Failed),
        }
    }

    fn number(&mut self, value: f64, unit: &[UnitFactor], at: Origin) -> Outcome<Value> {
        let mut factor = 1.0;
        let mut dim = Dimension::NUMBER;
        for part in unit {
            let symbol = &part.symbol.node;
            let Some(u) = units::find(symbol) else {
                let near = super::names::suggestion(symbol, units::UNITS.iter().map(|u| u.symbol));
                let mut d = Diagnostic::error(
                    codes::UNKNOWN_UNIT,
                    format!("unknown unit `{symbol}`"),
                    part.symbol.at,
                );
                d = match near {
                    Some(n) => super::lookup::meant(d, &part.symbol, &n),
                    None => d.help(format!(
                        "units are {}",
                        units::UNITS.iter().map(|u| u.symbol).collect::<Vec<_>>().join(" ")
                    )),
                };
                return self.fail(d);
            };
            factor *= u.factor.powi(part.exponent);
            let next = u.dimension.power(part.exponent).and_then(|d| dim.times(d));
            dim = self.dimension(next, at)?;
        }
        let id = self.constant(value * factor * self.drawn(dim), at)?;
        Ok(Value::Scalar(Scalar { id, dim }))
    }

    pub(super) fn dimension(&mut self, d: Option<Dimension>, at: Origin) -> Outcome<Dimension> {
        match d {
            Some(d) => Ok(d),
            None => self.fail(Diagnostic::error(
                codes::EXPONENT,
                "the dimension of this has an exponent out of reach",
                at,
            )),
        }
    }

    fn name(&mut self, env: &Env, path: &'a [Ident], at: Origin) -> Outcome<Value> {
        let Some((first, rest)) = path.split_first() else { return Err(Failed) };
        if let Some(id) = env.time
            && first.node == super::profiles::TIME
            && rest.is_empty()
        {
            return Ok(Value::Scalar(Scalar { id, dim: Dimension::NUMBER }));
        }
        if let Some(point) = self.instance_point(env.scope, path, at) {
            return point;
        }
        let mut value = self.lookup(env.scope, first)?;
        let mut so_far = first.node.clone();
        for field in rest {
            value = match value {
                Value::Record(item) => self.record_field(item, field)?,
                other => {
                    return self.fail(
                        Diagnostic::error(
                            codes::TYPE,
                            format!("`{so_far}` is {} and has no field `{}`", other.a(), field.node),
                            at,
                        )
                        .help("only materials, processes and motors have fields"),
                    );
                }
            };
            so_far = format!("{so_far}.{}", field.node);
        }
        Ok(value)
    }

    /// The value of a plain name.
    pub(super) fn lookup(&mut self, scope: usize, name: &Ident) -> Outcome<Value> {
        let found = self.scopes.get(scope).and_then(|s| s.index.get(&name.node)).copied();
        if let Some(local) = found {
            return self.force(scope, local, name.at);
        }
        let module = self.scopes.get(scope).map_or(0, |s| s.module);
        match self.top_level(module, name) {
            Some(item) => match self.program.item(item) {
                Some(crate::syntax::ast::Item::Record(_)) => Ok(Value::Record(item)),
                Some(other) => {
                    let kind = item_kind(other).to_string();
                    self.wrong_kind(name, &kind, "a value")
                }
                None => Err(Failed),
            },
            None => self.unknown_name(scope, name),
        }
    }

    /// An item visible in a module; marks its import as used.
    pub(super) fn top_level(&mut self, module: usize, name: &Ident) -> Option<(usize, usize)> {
        let visible = *self.program.modules.get(module)?.names.get(&name.node)?;
        if let Some(u) = visible.by_use {
            self.used.insert((module, u));
        }
        Some(visible.item)
    }

    pub(super) fn wrong_kind<T>(&mut self, name: &Ident, is: &str, wanted: &str) -> Outcome<T> {
        self.fail(
            Diagnostic::error(
                codes::WRONG_KIND,
                format!("`{}` is {}, not {wanted}", name.node, with_article(is)),
                name.at,
            )
            .label(format!("{wanted} is needed here")),
        )
    }

    fn tuple(&mut self, env: &Env, items: &'a [Expr], at: Origin) -> Outcome<Value> {
        if items.len() != 2 && items.len() != 3 {
            return self.fail(
                Diagnostic::error(codes::ARGUMENTS, format!("a tuple of {} numbers", items.len()), at)
                    .help("points and vectors have two or three components"),
            );
        }
        let values: Vec<Outcome<Value>> = items.iter().map(|i| self.eval(env, i)).collect();
        let mut parts: Vec<Scalar> = Vec::new();
        for (v, e) in values.into_iter().zip(items) {
            match v? {
                Value::Scalar(s) => parts.push(s),
                other => {
                    return self.fail(Diagnostic::error(
                        codes::TYPE,
                        format!("a component must be a number or quantity, this is {}", other.a()),
                        e.at,
                    ));
                }
            }
        }
        // The first component with a unit says what the others must be.
        let dim = parts.iter().map(|p| p.dim).find(|d| !d.is_number()).unwrap_or_default();
        let mut v = Vec::new();
        for (p, e) in parts.into_iter().zip(items) {
            v.push(self.scalar(Value::Scalar(p), e, dim, "component")?);
        }
        let zero = self.constant(0.0, at)?;
        let component = |i: usize| v.get(i).copied().unwrap_or(zero);
        Ok(Value::Vector { v: [component(0), component(1), component(2)], dim, literal: true })
    }
}

/// Equal nodes have equal keys.
fn node_key(node: &Node) -> (u8, u64, u64) {
    let id = |a: &ExprId| u64::from(a.0);
    match node {
        Node::Const(v) => (0, v.to_bits(), 0),
        Node::Free(i) => (1, u64::from(*i), 0),
        Node::Neg(a) => (2, id(a), 0),
        Node::Add(a, b) => (3, id(a), id(b)),
        Node::Sub(a, b) => (4, id(a), id(b)),
        Node::Mul(a, b) => (5, id(a), id(b)),
        Node::Div(a, b) => (6, id(a), id(b)),
        Node::Powi(a, n) => (7, id(a), u64::from(n.unsigned_abs()) << 1 | u64::from(*n < 0)),
        Node::Sqrt(a) => (8, id(a), 0),
        Node::Sin(a) => (9, id(a), 0),
        Node::Cos(a) => (10, id(a), 0),
        Node::Tan(a) => (11, id(a), 0),
        Node::Atan2(a, b) => (12, id(a), id(b)),
        Node::Asin(a) => (13, id(a), 0),
        Node::Acos(a) => (14, id(a), 0),
        Node::Min(a, b) => (15, id(a), id(b)),
        Node::Max(a, b) => (16, id(a), id(b)),
        Node::Abs(a) => (17, id(a), 0),
    }
}
