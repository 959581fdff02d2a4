//! `for`: statements about instances, written out once for each number. Only names and numbers are put in place of the
//! variable, so everything after this sees plain statements.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Outcome};
use super::load::Program;
use super::settings::Settings;
use crate::diagnostic::{Diagnostic, Origin};
use crate::syntax::ast::{Argument, Expr, ExprKind, For, Ident, Mechanism, Statement, StatementKind};
use std::collections::{BTreeMap, BTreeSet};

/// Most statements that loops make; beyond this a bound is a slip.
const MOST: usize = 1000;

/// A mechanism without loops.
pub struct Written {
    /// Its statements.
    pub mechanism: Mechanism,
    /// For each statement that was repeated, in which turn: ` (i = 2)`.
    pub turns: BTreeMap<usize, String>,
    /// Findings.
    pub out: Vec<Diagnostic>,
    /// Uses that brought a name that was needed: (module, use).
    pub used: BTreeSet<(usize, usize)>,
}

/// Values of the variables of the loops around a statement.
type Turn = Vec<(String, i64)>;

/// Writes the loops of a mechanism out.
pub fn written_out(program: &Program, settings: &Settings, m: &Mechanism, module: usize) -> Written {
    let mut mechanism = Mechanism { statements: Vec::new(), ..m.clone() };
    let mut e = Evaluator::new(program, settings);
    let scope = e.scope(module);
    e.sheet(scope, m);
    // What is wrong with the names themselves is told where they are used.
    e.out.clear();
    let mut unroll = Unroll { e, scope, statements: Vec::new(), turns: BTreeMap::new() };
    unroll.block(&m.statements, &Turn::new());
    mechanism.statements = unroll.statements;
    Written { mechanism, turns: unroll.turns, out: unroll.e.out, used: unroll.e.used }
}

struct Unroll<'a> {
    e: Evaluator<'a>,
    scope: usize,
    statements: Vec<Statement>,
    turns: BTreeMap<usize, String>,
}

impl<'a> Unroll<'a> {
    fn block(&mut self, statements: &'a [Statement], turn: &Turn) {
        for s in statements {
            match &s.kind {
                StatementKind::For(text) => {
                    // What is wrong with a loop has been told.
                    let _ = self.turns(text, s.at, turn);
                }
                _ => self.statement(s, turn),
            }
        }
    }

    fn turns(&mut self, text: &'a For, at: Origin, turn: &Turn) -> Outcome<()> {
        let name = &text.variable;
        let outer = turn.iter().any(|(n, _)| *n == name.node);
        let declared = self.e.scopes.get(self.scope).and_then(|s| s.locals.get(*s.index.get(&name.node)?));
        if outer || declared.is_some() {
            let mut d =
                Diagnostic::error(codes::SHADOWING, format!("`{}` hides another name", name.node), name.at)
                    .help("call the loop's number otherwise");
            if let Some(declared) = declared {
                d = d.also(declared.at, "declared here");
            }
            return self.e.fail(d);
        }
        let (first, last) = (self.bound(&text.first, turn)?, self.bound(&text.last, turn)?);
        if last < first {
            let message = format!("this runs from {first} to {last}: it stands for nothing");
            return self.e.fail(
                Diagnostic::error(codes::COUNT, message, at).help("write the lower number first: both count"),
            );
        }
        for value in first..=last {
            if self.statements.len() >= MOST {
                let message = format!("loops stand for more than {MOST} statements");
                return self.e.fail(Diagnostic::error(codes::TOO_LARGE, message, at));
            }
            let mut inner = turn.clone();
            inner.push((name.node.clone(), value));
            self.block(&text.statements, &inner);
        }
        Ok(())
    }

    /// A whole number; the variables of outer loops may stand in it.
    fn bound(&mut self, e: &'a Expr, turn: &Turn) -> Outcome<i64> {
        if let ExprKind::Name(path) = &e.kind
            && let [only] = path.as_slice()
            && let Some((_, value)) = turn.iter().find(|(n, _)| *n == only.node)
        {
            return Ok(*value);
        }
        let value = self.e.eval_fixed(self.scope, e, Dimension::NUMBER, "the bound of a loop")?;
        if value.fract() == 0.0 && value.abs() <= MOST as f64 {
            return Ok(value as i64);
        }
        let message = format!("the bound of a loop must be a whole number up to {MOST}, this is {value}");
        self.e.fail(Diagnostic::error(codes::COUNT, message, e.at))
    }

    fn statement(&mut self, s: &Statement, turn: &Turn) {
        let mut put = Put { turn, out: &mut self.e.out };
        let mut s = s.clone();
        match &mut s.kind {
            StatementKind::Place(p) => {
                put.name(&mut p.name, true);
                put.expr(&mut p.point);
                if let Some((angle, axis)) = &mut p.turned {
                    put.expr(angle);
                    put.expr(axis);
                }
                p.scale.iter_mut().for_each(|e| put.expr(e));
            }
            StatementKind::Mirror(m) => {
                put.name(&mut m.name, true);
                put.name(&mut m.of, true);
            }
            StatementKind::Require { left, right, .. } => {
                put.expr(left);
                put.expr(right);
            }
            StatementKind::Export(list) => list.iter_mut().for_each(|e| put.expr(e)),
            _ => {}
        }
        if !turn.is_empty() {
            let told: Vec<String> = turn.iter().map(|(name, value)| format!("{name} = {value}")).collect();
            self.turns.insert(self.statements.len(), format!(" ({})", told.join(", ")));
        }
        self.statements.push(s);
    }
}

/// Puts numbers in place of the variables.
struct Put<'t> {
    turn: &'t Turn,
    out: &'t mut Vec<Diagnostic>,
}

impl Put<'_> {
    fn value(&self, name: &str) -> Option<i64> {
        self.turn.iter().find(|(n, _)| n == name).map(|(_, v)| *v)
    }

    /// `finger[i+1]` to `finger[2]`; a name without an index stays.
    fn name(&mut self, name: &mut Ident, declares: bool) {
        let Some((stem, index)) = name.node.split_once('[') else {
            if declares && !self.turn.is_empty() {
                let message = format!("`{}` needs an index: a loop repeats it", name.node);
                let (variable, at) = (self.turn.last().map_or("i", |t| t.0.as_str()), name.at);
                self.out.push(
                    Diagnostic::error(codes::INDEX, message, at)
                        .help(format!("write `{}[{variable}]`", name.node)),
                );
            }
            return;
        };
        let mut sum = Some(0i64);
        let (mut sign, mut part) = (1i64, String::new());
        for c in index.trim_end_matches(']').chars().chain(['+']) {
            if c != '+' && c != '-' {
                part.push(c);
                continue;
            }
            let value = part.parse::<i64>().ok().filter(|v| *v <= MOST as i64).or(self.value(&part));
            sum = sum.zip(value).map(|(sum, value)| sum + sign * value);
            sign = if c == '-' { -1 } else { 1 };
            part.clear();
        }
        match sum {
            Some(sum) if sum >= 0 => name.node = format!("{stem}[{sum}]"),
            _ => self.out.push(
                Diagnostic::error(codes::INDEX, format!("`{}` is no whole number here", index.trim_end_matches(']')), name.at)
                    .help("an index is made of whole numbers and of the variables of the loops around it, and not below 0"),
            ),
        }
    }

    fn expr(&mut self, e: &mut Expr) {
        match &mut e.kind {
            ExprKind::Name(path) => {
                if let [only] = path.as_slice()
                    && let Some(value) = self.value(&only.node)
                {
                    let number = ExprKind::Number { value: value.unsigned_abs() as f64, unit: Vec::new() };
                    let number = Expr { kind: number, at: e.at };
                    e.kind = if value < 0 { ExprKind::Negate(Box::new(number)) } else { number.kind };
                    return;
                }
                path.iter_mut().for_each(|p| self.name(p, false));
            }
            ExprKind::Tuple(items) => items.iter_mut().for_each(|i| self.expr(i)),
            ExprKind::Negate(inner) => self.expr(inner),
            ExprKind::Binary(_, a, b) => {
                self.expr(a);
                self.expr(b);
            }
            ExprKind::Call { arguments, .. } => {
                arguments.iter_mut().for_each(|Argument { value, .. }| self.expr(value));
            }
            ExprKind::Free { start, lower, upper } => {
                [start, lower, upper].into_iter().for_each(|e| self.expr(e));
            }
            ExprKind::About { axis, .. } => self.expr(axis),
            ExprKind::Number { .. } | ExprKind::Text(_) | ExprKind::Broken => {}
        }
    }
}
