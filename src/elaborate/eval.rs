//! Evaluation of expressions into the design's expression graph: names are forced on demand, so
//! declarations may stand in any order; a name met while it is being forced closes a circle.

use super::codes;
use super::dimension::Dimension;
use super::load::{Program, item_kind};
use super::scope::{Key, Local, LocalKind, Scope, State};
use super::settings::Settings;
use super::units;
use super::value::{Scalar, Value, with_article};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::expr::{ExprGraph, ExprId, Node};
use crate::ir::{ExprPoint, FreeVariable};
use crate::syntax::ast::{BinaryOp, Expr, ExprKind, Ident, UnitFactor};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;

/// A diagnostic has been given; nothing more is to be said.
#[derive(Clone, Copy, Debug)]
pub struct Failed;

/// Result of evaluation.
pub type Outcome<T> = Result<T, Failed>;

/// Deepest nesting of expressions and of declarations that need each other. Measured: 200 levels take
/// less than 0.5 MB of stack in a debug build; the samples need 12.
const MAX_DEPTH: usize = 200;
/// Most nodes of the expression graph; Jansen's leg needs about 3,000.
const MAX_NODES: usize = 20_000;
/// Most expressions evaluated, templates counted at each use; Jansen's leg needs about 5,000.
const MAX_WORK: usize = 400_000;
/// Most free variables.
const MAX_FREE: usize = 1_000;

/// Where an expression is evaluated.
#[derive(Clone)]
pub struct Env {
    /// Scope index.
    pub scope: usize,
    /// Path given to a `free` met here; none: nothing may vary here.
    pub path: Option<Rc<str>>,
    /// Take the start of a `free` instead of making a variable (to learn a default's dimension).
    pub probe: bool,
}

impl Env {
    /// A place where nothing may vary.
    pub fn fixed(scope: usize) -> Self {
        Self { scope, path: None, probe: false }
    }

    /// A place whose free values are named `path`.
    pub fn named(scope: usize, path: impl Into<Rc<str>>) -> Self {
        Self { scope, path: Some(path.into()), probe: false }
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
    paths: BTreeSet<String>,
    /// Where each node is: only looked up, never listed.
    interned: HashMap<(u8, u64, u64), ExprId>,
    /// Values of all nodes at the start values of the free variables, and those start values.
    starts: (Vec<f64>, Vec<f64>),
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
            interned: HashMap::new(),
            starts: (Vec::new(), Vec::new()),
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
                    Some(n) => d.help(format!("did you mean `{n}`?")),
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
        let id = self.constant(value * factor, at)?;
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
        let value = self.declared(&kind);
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
                let probe = Env { scope: *scope, path: None, probe: true };
                let expected = self.eval(&probe, default)?;
                self.check_like(&v, value, &expected, default.at)?;
            }
            (None, None) => {}
        }
        Ok(v)
    }

    fn check_like(&mut self, v: &Value, e: &'a Expr, expected: &Value, default: Origin) -> Outcome<()> {
        if let (Value::Scalar(_), Value::Scalar(want)) = (v, expected) {
            return self.scalar(v.clone(), e, want.dim, "").map(|_| ());
        }
        if std::mem::discriminant(v) == std::mem::discriminant(expected) {
            return Ok(());
        }
        let d =
            Diagnostic::error(codes::TYPE, format!("{} is needed, this is {}", expected.a(), v.a()), e.at)
                .also(default, "the default it replaces");
        self.fail(d)
    }

    fn check_type(&mut self, v: &Value, e: &'a Expr, ty: &Ident) -> Outcome<()> {
        let fits = match ty.node.as_str() {
            "point" => matches!(v, Value::Point(_)),
            "vector" => matches!(v, Value::Vector { dim, .. } if *dim == Dimension::LENGTH),
            "direction" => matches!(v, Value::Vector { dim, .. } if dim.is_number()),
            "text" => matches!(v, Value::Text(_)),
            name => match Dimension::of_type(name) {
                Some(want) => return self.scalar(v.clone(), e, want, &ty.node).map(|_| ()),
                None => {
                    let others = ["point", "vector", "direction", "text"];
                    let near = super::names::suggestion(name, Dimension::type_names().chain(others));
                    let mut d =
                        Diagnostic::error(codes::UNKNOWN_TYPE, format!("unknown type `{name}`"), ty.at);
                    d = match near {
                        Some(n) => d.help(format!("did you mean `{n}`?")),
                        None => d.help(format!(
                            "types are {}",
                            Dimension::type_names().chain(others).collect::<Vec<_>>().join(", ")
                        )),
                    };
                    return self.fail(d);
                }
            },
        };
        if fits {
            return Ok(());
        }
        let d = Diagnostic::error(
            codes::TYPE,
            format!("this is {}, not {}", v.a(), with_article(&ty.node)),
            e.at,
        )
        .also(ty.at, format!("declared as {} here", with_article(&ty.node)));
        self.fail(d)
    }

    /// A scalar of dimension `want`; `what` names what it is for ("the radius"), or is empty.
    pub(super) fn scalar(&mut self, v: Value, e: &Expr, want: Dimension, what: &str) -> Outcome<ExprId> {
        let found = match v {
            Value::Scalar(s) if s.dim == want => return Ok(s.id),
            Value::Scalar(s) => s.dim,
            other => {
                return self.fail(Diagnostic::error(
                    codes::TYPE,
                    format!("{} is needed, this is {}", with_article(&want.to_string()), other.a()),
                    e.at,
                ));
            }
        };
        let subject = if what.is_empty() { String::new() } else { format!("{what}: ") };
        let needed = with_article(&want.to_string());
        if found.is_number()
            && let Some(unit) = want.suggestion()
        {
            let help = match bare_number(e) {
                Some(n) => format!("write `{n} {unit}`"),
                None => format!("give it a unit, such as `{unit}`"),
            };
            return self.fail(
                Diagnostic::error(codes::MISSING_UNIT, format!("{subject}{needed} needs a unit"), e.at)
                    .label("this is a plain number")
                    .help(help),
            );
        }
        self.fail(
            Diagnostic::error(
                codes::DIMENSION,
                format!("{subject}{needed} is needed, this is {}", with_article(&found.to_string())),
                e.at,
            )
            .label(found.to_string()),
        )
    }

    /// Evaluates to a scalar of dimension `want`.
    pub(super) fn eval_scalar(
        &mut self,
        env: &Env,
        e: &'a Expr,
        want: Dimension,
        what: &str,
    ) -> Outcome<ExprId> {
        let v = self.eval(env, e)?;
        self.scalar(v, e, want, what)
    }

    /// Evaluates to a number that depends on nothing free.
    pub(super) fn eval_fixed(
        &mut self,
        scope: usize,
        e: &'a Expr,
        want: Dimension,
        what: &str,
    ) -> Outcome<f64> {
        let id = self.eval_scalar(&Env::fixed(scope), e, want, what)?;
        self.fixed(id, e.at, what)
    }

    /// The number of a node that depends on nothing free.
    pub(super) fn fixed(&mut self, id: ExprId, at: Origin, what: &str) -> Outcome<f64> {
        match self.exprs.as_constant(id) {
            Some(v) => Ok(v),
            None => {
                let mut d = Diagnostic::error(
                    codes::NOT_FIXED,
                    format!("{what} must be a fixed number, this depends on a free value"),
                    at,
                );
                if let Some(f) = self.free_behind(id) {
                    d = d.also(f, "free here");
                }
                self.fail(d)
            }
        }
    }

    /// Where a free variable that a node depends on is declared.
    pub(super) fn free_behind(&self, id: ExprId) -> Option<Origin> {
        let first = super::graph::free_variables(&self.exprs, &[id]).into_iter().next()?;
        self.free.get(first).map(|f| f.origin)
    }

    /// A point; a tuple of lengths written in place counts as one.
    pub(super) fn as_point(&mut self, v: Value, e: &Expr) -> Outcome<ExprPoint> {
        match v {
            Value::Point(p) => Ok(p),
            Value::Vector { v, dim, literal: true } if dim == Dimension::LENGTH => Ok(v),
            Value::Vector { dim, literal: true, .. } if dim.is_number() => self.fail(
                Diagnostic::error(codes::MISSING_UNIT, "the coordinates of a point need a unit", e.at)
                    .label("these are plain numbers")
                    .help("write `(10 mm, 0 mm)`"),
            ),
            other => {
                let mut d =
                    Diagnostic::error(codes::TYPE, format!("a point is needed, this is {}", other.a()), e.at);
                if matches!(other, Value::Vector { .. }) {
                    d = d.help("add it to a point: `O + …`");
                }
                self.fail(d)
            }
        }
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

    fn free_value(
        &mut self,
        env: &Env,
        start: &'a Expr,
        lower: &'a Expr,
        upper: &'a Expr,
        at: Origin,
    ) -> Outcome<Value> {
        let inner = Env { path: None, ..env.clone() };
        let s = self.eval(&inner, start);
        let l = self.eval(&inner, lower);
        let u = self.eval(&inner, upper);
        let (s, l, u) = (s?, l?, u?);
        let Value::Scalar(Scalar { id, dim }) = s else {
            return self.fail(Diagnostic::error(
                codes::TYPE,
                format!("only a number or quantity can be free, this is {}", s.a()),
                start.at,
            ));
        };
        let lower_id = self.scalar(l, lower, dim, "lower bound")?;
        let upper_id = self.scalar(u, upper, dim, "upper bound")?;
        if env.probe {
            return Ok(Value::Scalar(Scalar { id, dim }));
        }
        let Some(path) = &env.path else {
            return self.fail(
                Diagnostic::error(codes::FREE_PLACE, "nothing may be free here", at)
                    .help("`free` stands in `param`, `let` and the overrides of a template"),
            );
        };
        let mut bounds = [0.0; 3];
        for (slot, (id, e)) in bounds.iter_mut().zip([(id, start), (lower_id, lower), (upper_id, upper)]) {
            *slot = match self.exprs.as_constant(id) {
                Some(v) => v,
                None => {
                    let mut d = Diagnostic::error(
                        codes::FREE_NESTED,
                        "start and bounds must be fixed numbers, this depends on a free value",
                        e.at,
                    );
                    if let Some(f) = self.free_behind(id) {
                        d = d.also(f, "free here");
                    }
                    return self.fail(d);
                }
            };
        }
        let path = self.unique_path(path);
        self.settable.insert(path.clone());
        if let Some((index, fixed)) = self.settings.find(&path) {
            // `--set` of a free value inside a template fixes it.
            self.set_used.insert(index);
            let Some(fixed) = fixed else { return Err(Failed) };
            let id = self.eval_scalar_settings(env.scope, fixed, dim)?;
            return Ok(Value::Scalar(Scalar { id, dim }));
        }
        let [start_value, lower_value, upper_value] = bounds;
        if !(lower_value < upper_value) {
            return self.fail(
                Diagnostic::error(
                    codes::FREE_BOUNDS,
                    format!("the lower bound of `{path}` is not below the upper one"),
                    at,
                )
                .also(lower.at, self.show(lower_value, dim))
                .also(upper.at, self.show(upper_value, dim)),
            );
        }
        if !(lower_value..=upper_value).contains(&start_value) {
            return self.fail(
                Diagnostic::error(
                    codes::FREE_BOUNDS,
                    format!("the bounds of `{path}` do not contain its start"),
                    at,
                )
                .also(start.at, format!("starts at {}", self.show(start_value, dim)))
                .also(lower.at, self.show(lower_value, dim))
                .also(upper.at, self.show(upper_value, dim))
                .help("move the start between the bounds, or widen them"),
            );
        }
        if self.free.len() >= MAX_FREE {
            return self.fail(Diagnostic::error(
                codes::TOO_LARGE,
                format!("more than {MAX_FREE} free values"),
                at,
            ));
        }
        let index = self.free.len() as u32;
        self.starts.1.push(start_value);
        self.free.push(FreeVariable {
            path,
            unit: dim.unit(),
            start: start_value,
            lower: lower_value,
            upper: upper_value,
            origin: at,
        });
        let id = self.node(Node::Free(index), at)?;
        Ok(Value::Scalar(Scalar { id, dim }))
    }

    fn eval_scalar_settings(&mut self, scope: usize, e: &'a Expr, dim: Dimension) -> Outcome<ExprId> {
        self.eval_scalar(&Env::fixed(scope), e, dim, "")
    }

    /// A number in the unit a designer would write.
    pub(super) fn show(&self, v: f64, dim: Dimension) -> String {
        let unit = dim.suggestion().unwrap_or("");
        let factor = match unit {
            "deg" => 1f64.to_radians(),
            "g" => 1.0 / units::GRAMS_PER_TONNE,
            "g/cm^3" => 1e-9,
            "deg/s" => 1f64.to_radians(),
            _ => 1.0,
        };
        let text = format!("{:.6}", v / factor);
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        format!("{text} {unit}").trim_end().to_string()
    }

    /// The path itself, or with `.2`, `.3` … when it is taken.
    fn unique_path(&mut self, path: &str) -> String {
        let mut unique = path.to_string();
        let mut n = 2;
        while !self.paths.insert(unique.clone()) {
            unique = format!("{path}.{n}");
            n += 1;
        }
        unique
    }

    /// Adds a scope.
    pub(super) fn scope(&mut self, module: usize) -> usize {
        self.scopes.push(Scope { module, locals: Vec::new(), index: BTreeMap::new() });
        self.scopes.len() - 1
    }

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

/// A number literal without unit, as text.
fn bare_number(e: &Expr) -> Option<String> {
    match &e.kind {
        ExprKind::Number { value, unit } if unit.is_empty() => Some(value.to_string()),
        ExprKind::Negate(inner) => bare_number(inner).map(|n| format!("-{n}")),
        _ => None,
    }
}
