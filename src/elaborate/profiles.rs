//! Profiles of drives: `from … to …`, `by EXPRESSION` of t, `by keys …`.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::expr::{ExprGraph, ExprId, Node};
use crate::ir::prune;
use crate::ir::{DriveUnit, Profile};
use crate::syntax::ast::{self, Expr};

/// The time of the cycle, 0 to 1, in the expression of a drive.
pub(super) const TIME: &str = "t";
/// An expression is sampled this often to find how far it goes; only a motor's range is compared with that.
const SAMPLES: u32 = 720;

/// Largest value of a profile minus its smallest.
pub(super) fn span(profile: &Profile) -> f64 {
    let values: Vec<f64> = match profile {
        Profile::Range { from, to } => vec![*from, *to],
        // Neither form goes beyond its keys.
        Profile::Keys { keys, .. } => keys.iter().map(|k| k.1).collect(),
        Profile::Expression { .. } => {
            (0..=SAMPLES).map(|i| profile.value(f64::from(i) / f64::from(SAMPLES))).collect()
        }
    };
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (high - low).max(0.0)
}

impl<'a> Evaluator<'a> {
    pub(super) fn profile(
        &mut self,
        scope: usize,
        text: &'a ast::Profile,
        unit: DriveUnit,
    ) -> Outcome<Profile> {
        let dimension = match unit {
            DriveUnit::Rad => Dimension::ANGLE,
            DriveUnit::Mm => Dimension::LENGTH,
        };
        match text {
            ast::Profile::Range(from, to) => {
                let from = self.eval_fixed(scope, from, dimension, "the drive's start");
                let to = self.eval_fixed(scope, to, dimension, "the drive's end");
                Ok(Profile::Range { from: from?, to: to? })
            }
            ast::Profile::By(e) => self.of_time(scope, e, dimension, ["a drive", "the drive's value"]),
            ast::Profile::Keys { smooth, keys, at } => self.keys(scope, *smooth, keys, *at, unit, dimension),
        }
    }

    /// An expression of t, of something (`owner`, `what` of it) that must not depend on a free value.
    pub(super) fn of_time(
        &mut self,
        scope: usize,
        e: &'a Expr,
        dimension: Dimension,
        [owner, what]: [&str; 2],
    ) -> Outcome<Profile> {
        let (graph, [value]) =
            self.over_time(scope, e, owner, |me, env| Ok([me.eval_scalar(env, e, dimension, what)?]))?;
        Ok(Profile::Expression { graph, value })
    }

    /// What depends on t gets a graph of its own, whose only variable is t. `what` names what it is ("a drive").
    pub(super) fn over_time<const N: usize>(
        &mut self,
        scope: usize,
        e: &'a Expr,
        what: &str,
        work_out: impl FnOnce(&mut Self, &Env) -> Outcome<[ExprId; N]>,
    ) -> Outcome<(ExprGraph, [ExprId; N])> {
        let declared = self.scopes.get(scope).and_then(|s| s.locals.get(*s.index.get(TIME)?)).map(|l| l.at);
        if let Some(at) = declared {
            return self.fail(
                Diagnostic::error(codes::SHADOWING, "`t` is the time of the cycle here", e.at)
                    .also(at, "and a name of the mechanism")
                    .help("call the other one differently"),
            );
        }
        // Every free value has been met by now: the next variable is t.
        let time = self.free.len();
        self.starts.1.resize(time, f64::NAN);
        self.starts.1.push(0.0);
        let t = self.node(Node::Free(time as u32), e.at);
        let value = t.and_then(|t| work_out(self, &Env { time: Some(t), ..Env::fixed(scope) }));
        self.starts.1.truncate(time);
        let value = value?;
        let free = self.exprs.free_variables(&value).into_iter().find(|i| *i != time);
        if let Some(free) = free {
            let message = format!("{what} must be fixed, this depends on a free value");
            let d = Diagnostic::error(codes::NOT_FIXED, message, e.at);
            return self.fail(match self.free.get(free) {
                Some(f) => d.also(f.origin, "free here"),
                None => d,
            });
        }
        let (mut own, place) = prune(&self.exprs, &value);
        for node in &mut own.nodes {
            if let Node::Free(i) = node {
                *i = 0;
            }
        }
        let mut moved = value;
        for id in &mut moved {
            *id = place.get(id.0 as usize).copied().flatten().ok_or(Failed)?;
        }
        Ok((own, moved))
    }

    fn keys(
        &mut self,
        scope: usize,
        smooth: bool,
        texts: &'a [(Expr, Expr)],
        at: Origin,
        unit: DriveUnit,
        dimension: Dimension,
    ) -> Outcome<Profile> {
        self.limit(texts.len(), "keys", at)?;
        let mut keys: Vec<(f64, f64)> = Vec::new();
        let mut ok = Ok(());
        for (time, value) in texts {
            let t = self.eval_fixed(scope, time, Dimension::NUMBER, "the time of a key");
            let v = self.eval_fixed(scope, value, dimension, "the value of a key");
            let (Ok(t), Ok(v)) = (t, v) else {
                ok = Err(Failed);
                continue;
            };
            if let Some(before) = keys.last()
                && t <= before.0
            {
                ok = self.fail(
                    Diagnostic::error(codes::KEYS, "keys stand in the order of time", time.at)
                        .label("not after the key before it"),
                );
            }
            keys.push((t, v));
        }
        ok?;
        let ends = (keys.first().map(|k| k.0), keys.last().map(|k| k.0));
        if ends != (Some(0.0), Some(1.0)) {
            return self.fail(
                Diagnostic::error(codes::KEYS, "keys run from 0 % to 100 % of the cycle", at)
                    .help("write `by keys linear { 0 %: 0 deg, 50 %: 30 deg, 100 %: 0 deg }`"),
            );
        }
        let mut profile = Profile::Keys { smooth, keys, closed: false };
        let closes = unit.closes(profile.value(1.0) - profile.value(0.0));
        if let Profile::Keys { closed, .. } = &mut profile {
            *closed = closes;
        }
        Ok(profile)
    }
}
