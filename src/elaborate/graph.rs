//! Walks over the expression graph: what depends on which free variable, and dropping what no
//! part of the design uses.

use crate::ir::expr::{ExprGraph, ExprId, Node};

/// The node with other operands.
pub fn with_operands(node: &Node, f: impl Fn(ExprId) -> ExprId) -> Node {
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
pub fn prune(graph: &ExprGraph, roots: &[ExprId]) -> (ExprGraph, Vec<Option<ExprId>>) {
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
