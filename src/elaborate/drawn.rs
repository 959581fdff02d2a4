//! Points of instances: `right.S` beside instances is the point S as its mechanism draws it, in the place of `right`. It may
//! depend on what is optimised there: then it is an expression of the free variables of that design.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use super::scope::{LocalKind, State};
use super::value::Value;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::assembly::DesignFree;
use crate::ir::expr::{ExprGraph, ExprId, Node};
use crate::ir::{ExprPoint, FreeVariable, Placement, prune, with_operands};
use crate::syntax::ast::Ident;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// What is known of instances while an assembly is put together.
#[derive(Default)]
pub struct Drawings {
    /// Of each design, what its mechanism draws.
    pub of: Vec<Rc<Drawn>>,
    /// Instances that stand already: the design and the place.
    pub placed: BTreeMap<String, (usize, Placement)>,
    /// Instances that were declared but went wrong.
    pub failed: BTreeSet<String>,
    /// Free variables of designs by what they are called here, in the assembly's own graph.
    pub free: BTreeMap<usize, DesignFree>,
}

/// The points of a mechanism, before what its design does not use is dropped.
#[derive(Default)]
pub struct Drawn {
    exprs: ExprGraph,
    free: Vec<FreeVariable>,
    points: BTreeMap<String, ExprPoint>,
}

/// Places beside instances, mm.
#[derive(Default)]
pub struct Places {
    /// Their expressions.
    pub exprs: ExprGraph,
    /// The free variables in them.
    pub free: Vec<DesignFree>,
}

impl Drawn {
    /// What an evaluator has made of a mechanism, whose scope is the first.
    pub fn of(inner: &mut Evaluator<'_>, free: &[FreeVariable]) -> Self {
        let locals = inner.scopes.first().map(|s| s.locals.as_slice()).unwrap_or_default();
        let point = |l: &super::scope::Local<'_>| match &l.state {
            State::Done(Value::Point(p)) => Some((l.name.clone(), *p)),
            _ => None,
        };
        let points = locals.iter().filter_map(point).collect();
        Self { exprs: std::mem::take(&mut inner.exprs), free: free.to_vec(), points }
    }
}

impl<'a> Evaluator<'a> {
    /// The value of `INSTANCE.POINT`; none: the path does not begin with an instance.
    pub(super) fn instance_point(
        &mut self,
        scope: usize,
        path: &'a [Ident],
        at: Origin,
    ) -> Option<Outcome<Value>> {
        let [first, rest @ ..] = path else { return None };
        let scope = self.scopes.get(scope)?;
        let local = scope.index.get(&first.node).and_then(|i| scope.locals.get(*i))?;
        let is_instance = matches!(local.kind, LocalKind::Thing("instance"));
        (is_instance && !rest.is_empty()).then(|| self.point_of(first, rest, at).map(Value::Point))
    }

    fn point_of(&mut self, instance: &Ident, rest: &[Ident], at: Origin) -> Outcome<ExprPoint> {
        let name = &instance.node;
        let Some((design, placement)) = self.drawn.placed.get(name).copied() else {
            if self.drawn.failed.contains(name) {
                return Err(Failed);
            }
            return self.fail(
                Diagnostic::error(
                    codes::LATER_STATEMENT,
                    format!("`{name}` does not stand yet"),
                    instance.at,
                )
                .label("its place is needed here")
                .help("write its `place` further up; images stand after all that is placed"),
            );
        };
        let drawn = self.drawn.of.get(design).cloned().ok_or(Failed)?;
        let [point] = rest else {
            return self.fail(
                Diagnostic::error(codes::TYPE, "a point of an instance has no fields", at)
                    .help("write `INSTANCE.POINT`"),
            );
        };
        let Some(position) = drawn.points.get(&point.node) else {
            let message = format!("`{name}` has no point `{}`", point.node);
            let d = Diagnostic::error(codes::UNKNOWN_NAME, message, point.at);
            let names = drawn.points.keys().map(String::as_str);
            return self.fail(match super::names::suggestion(&point.node, names) {
                Some(near) => super::lookup::meant(d, point, &near),
                None if drawn.points.is_empty() => d.help("its mechanism names no points"),
                None => {
                    let names: Vec<&str> = drawn.points.keys().map(String::as_str).take(12).collect();
                    d.help(format!("it has {}", names.join(", ")))
                }
            });
        };
        let here = self.brought(design, &drawn, *position, at)?;
        self.placed_point(here, &placement, at)
    }

    /// An expression of a design in the assembly's own graph.
    fn brought(&mut self, design: usize, drawn: &Drawn, p: ExprPoint, at: Origin) -> Outcome<ExprPoint> {
        let (small, place) = prune(&drawn.exprs, &p);
        let mut here: Vec<ExprId> = Vec::with_capacity(small.nodes.len());
        for node in &small.nodes {
            let node = match *node {
                Node::Free(i) => Node::Free(self.free_of(DesignFree { design, free: i as usize }, drawn)?),
                _ => with_operands(node, |id| here.get(id.0 as usize).copied().unwrap_or(id)),
            };
            here.push(self.node(node, at)?);
        }
        let mut out = p;
        for (slot, id) in out.iter_mut().zip(p) {
            let small = place.get(id.0 as usize).copied().flatten();
            *slot = small.and_then(|s| here.get(s.0 as usize).copied()).ok_or(Failed)?;
        }
        Ok(out)
    }

    /// What a free variable of a design is called here.
    fn free_of(&mut self, wanted: DesignFree, drawn: &Drawn) -> Outcome<u32> {
        if let Some((known, _)) = self.drawn.free.iter().find(|(_, of)| **of == wanted) {
            return Ok(*known as u32);
        }
        let variable = drawn.free.get(wanted.free).ok_or(Failed)?;
        let index = self.free.len();
        self.starts.1.push(variable.start);
        self.free.push(variable.clone());
        self.drawn.free.insert(index, wanted);
        Ok(index as u32)
    }

    fn placed_point(&mut self, p: ExprPoint, placement: &Placement, at: Origin) -> Outcome<ExprPoint> {
        if *placement == Placement::IDENTITY {
            return Ok(p);
        }
        let mut out = p;
        if let [Some(x), Some(y), Some(z)] = p.map(|id| self.exprs.as_constant(id)) {
            let there = placement.point(&Vector3::new(x, y, z));
            for (slot, x) in out.iter_mut().zip(there.iter()) {
                *slot = self.constant(*x, at)?;
            }
            return Ok(out);
        }
        for ((slot, row), shift) in out.iter_mut().zip(placement.rotation).zip(placement.translation) {
            let mut sum = self.constant(shift, at)?;
            for (id, factor) in p.iter().zip(row).filter(|(_, f)| *f != 0.0) {
                let factor = self.constant(factor, at)?;
                let part = self.node(Node::Mul(factor, *id), at)?;
                sum = self.node(Node::Add(sum, part), at)?;
            }
            *slot = sum;
        }
        Ok(out)
    }

    /// A place in the graph of the assembly: of numbers, and of what is free in designs.
    pub(super) fn standing_place(
        &mut self,
        p: ExprPoint,
        at: Origin,
        places: &mut Places,
    ) -> Outcome<ExprPoint> {
        let (small, place) = prune(&self.exprs, &p);
        let mut here: Vec<ExprId> = Vec::with_capacity(small.nodes.len());
        for node in &small.nodes {
            let node = match *node {
                Node::Free(i) => {
                    let Some(of) = self.drawn.free.get(&(i as usize)).copied() else {
                        for id in p {
                            self.fixed(id, at, "a place beside instances")?;
                        }
                        return Err(Failed);
                    };
                    let known = places.free.iter().position(|f| *f == of);
                    Node::Free(known.unwrap_or_else(|| {
                        places.free.push(of);
                        places.free.len() - 1
                    }) as u32)
                }
                _ => with_operands(node, |id| here.get(id.0 as usize).copied().unwrap_or(id)),
            };
            here.push(places.exprs.push(node));
        }
        let mut out = p;
        for (slot, id) in out.iter_mut().zip(p) {
            let small = place.get(id.0 as usize).copied().flatten();
            *slot = small.and_then(|s| here.get(s.0 as usize).copied()).ok_or(Failed)?;
        }
        Ok(out)
    }
}
