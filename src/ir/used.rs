//! Walks over the expressions of a design: dropping what no part of it uses.

use super::expr::{ExprGraph, ExprId, Node};
use super::{Design, LoadKind, Section};
use std::collections::BTreeSet;

impl Design {
    /// Drops from the graph what nothing uses. Returns the indices of the free variables that are used.
    pub fn drop_unused(&mut self) -> BTreeSet<usize> {
        let mut roots = Vec::new();
        each_expr(self, &mut |id| roots.push(*id));
        let used = self.exprs.free_variables(&roots);
        let (exprs, place) = prune(&self.exprs, &roots);
        self.exprs = exprs;
        each_expr(self, &mut |id| {
            if let Some(Some(moved)) = place.get(id.0 as usize) {
                *id = *moved;
            }
        });
        used
    }
}

/// The node with other operands.
pub(crate) fn with_operands(node: &Node, f: impl Fn(ExprId) -> ExprId) -> Node {
    match *node {
        Node::Const(v) => Node::Const(v),
        Node::Free(i) => Node::Free(i),
        Node::Neg(a) => Node::Neg(f(a)),
        Node::Powi(a, n) => Node::Powi(f(a), n),
        Node::Sqrt(a) => Node::Sqrt(f(a)),
        Node::Sin(a) => Node::Sin(f(a)),
        Node::Cos(a) => Node::Cos(f(a)),
        Node::Tan(a) => Node::Tan(f(a)),
        Node::Asin(a) => Node::Asin(f(a)),
        Node::Acos(a) => Node::Acos(f(a)),
        Node::Abs(a) => Node::Abs(f(a)),
        Node::Add(a, b) => Node::Add(f(a), f(b)),
        Node::Sub(a, b) => Node::Sub(f(a), f(b)),
        Node::Mul(a, b) => Node::Mul(f(a), f(b)),
        Node::Div(a, b) => Node::Div(f(a), f(b)),
        Node::Atan2(a, b) => Node::Atan2(f(a), f(b)),
        Node::Min(a, b) => Node::Min(f(a), f(b)),
        Node::Max(a, b) => Node::Max(f(a), f(b)),
    }
}

/// The graph of what `roots` need, and the new place of every node (none: dropped).
pub(crate) fn prune(graph: &ExprGraph, roots: &[ExprId]) -> (ExprGraph, Vec<Option<ExprId>>) {
    let seen = graph.reachable(roots);
    let mut out = ExprGraph::default();
    let mut place: Vec<Option<ExprId>> = Vec::with_capacity(graph.nodes.len());
    for (node, seen) in graph.nodes.iter().zip(seen) {
        if !seen {
            place.push(None);
            continue;
        }
        let moved = with_operands(node, |id| place.get(id.0 as usize).copied().flatten().unwrap_or(id));
        out.nodes.push(moved);
        place.push(Some(ExprId((out.nodes.len() - 1) as u32)));
    }
    (out, place)
}

/// Visits every expression of a design.
fn each_expr(design: &mut Design, f: &mut impl FnMut(&mut ExprId)) {
    for b in &mut design.bodies {
        b.skeleton.iter_mut().flat_map(|p| &mut p.position).for_each(&mut *f);
        b.holes.iter_mut().flat_map(|h| &mut h.position).for_each(&mut *f);
        let mounts = b.fittings.mounts.iter_mut();
        mounts.flat_map(|m| m.position.iter_mut().chain(m.toward.iter_mut().flatten())).for_each(&mut *f);
        b.fittings.solids.iter_mut().flat_map(|s| &mut s.position).for_each(&mut *f);
    }
    for j in &mut design.joints {
        j.point.iter_mut().for_each(&mut *f);
        j.toward.iter_mut().flat_map(|(_, p)| p).for_each(&mut *f);
    }
    for r in &mut design.rods {
        for end in [&mut r.from, &mut r.to] {
            end.position.iter_mut().for_each(&mut *f);
            end.derivative.iter_mut().for_each(&mut *f);
        }
        for section in std::iter::once(&mut r.section).chain(&mut r.section_to) {
            match section {
                Section::Ellipse { a, b } | Section::Rect { a, b } => {
                    f(a);
                    f(b);
                }
                Section::Round { r } => f(r),
            }
        }
    }
    for t in &mut design.traces {
        t.point.iter_mut().for_each(&mut *f);
    }
    design.drives.iter_mut().filter_map(|d| d.free_rest.as_mut()).for_each(&mut *f);
    for c in &mut design.strings {
        c.point.iter_mut().chain(c.via.iter_mut().flatten()).for_each(&mut *f);
    }
    for load in design.loads.iter_mut().chain(design.cases.iter_mut().flat_map(|c| &mut c.loads)) {
        if let LoadKind::Force { point, .. } = &mut load.kind {
            point.iter_mut().for_each(&mut *f);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pruning_keeps_values() {
        let mut g = ExprGraph::default();
        let x = g.push(Node::Free(0));
        let unused = g.constant(7.0);
        let y = g.push(Node::Free(1));
        let s = g.push(Node::Sin(x));
        let p = g.push(Node::Mul(s, y));
        g.push(Node::Add(p, unused));
        let (small, place) = prune(&g, &[p]);
        assert_eq!(small.nodes.len(), 4);
        let at = place[p.0 as usize].unwrap();
        let v = [0.3, 2.0];
        assert_eq!(small.values(&v)[at.0 as usize], g.values(&v)[p.0 as usize]);
        assert_eq!(g.free_variables(&[s]).into_iter().collect::<Vec<_>>(), [0]);
    }
}
