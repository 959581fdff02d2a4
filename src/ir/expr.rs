//! Flat graph of scalar expressions of the free variables: what depends on a free variable is kept
//! as an expression, not a number, so that geometry can be differentiated.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Index into [`ExprGraph::nodes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ExprId(pub u32);

/// A node; operands stand earlier in the graph.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Node {
    /// A number.
    Const(f64),
    /// A free variable: index into `Design::free`.
    Free(u32),
    /// −a
    Neg(ExprId),
    /// a + b
    Add(ExprId, ExprId),
    /// a − b
    Sub(ExprId, ExprId),
    /// a · b
    Mul(ExprId, ExprId),
    /// a / b
    Div(ExprId, ExprId),
    /// aⁿ
    Powi(ExprId, i32),
    /// √a
    Sqrt(ExprId),
    /// sin a
    Sin(ExprId),
    /// cos a
    Cos(ExprId),
    /// tan a
    Tan(ExprId),
    /// atan2(a, b): a the ordinate
    Atan2(ExprId, ExprId),
    /// asin a
    Asin(ExprId),
    /// acos a
    Acos(ExprId),
    /// min(a, b)
    Min(ExprId, ExprId),
    /// max(a, b)
    Max(ExprId, ExprId),
    /// |a|
    Abs(ExprId),
}

impl Node {
    /// Operands, none for a number or a variable.
    pub fn operands(&self) -> [Option<ExprId>; 2] {
        match *self {
            Node::Const(_) | Node::Free(_) => [None, None],
            Node::Neg(a)
            | Node::Powi(a, _)
            | Node::Sqrt(a)
            | Node::Sin(a)
            | Node::Cos(a)
            | Node::Tan(a)
            | Node::Asin(a)
            | Node::Acos(a)
            | Node::Abs(a) => [Some(a), None],
            Node::Add(a, b)
            | Node::Sub(a, b)
            | Node::Mul(a, b)
            | Node::Div(a, b)
            | Node::Atan2(a, b)
            | Node::Min(a, b)
            | Node::Max(a, b) => [Some(a), Some(b)],
        }
    }
}

/// Nodes in topological order; constants are folded and equal nodes shared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExprGraph {
    /// The nodes.
    pub nodes: Vec<Node>,
}

/// Values of every node, and their derivatives by the free variables.
#[derive(Clone, Debug)]
pub struct Evaluated {
    values: Vec<f64>,
    gradients: Vec<f64>,
    n: usize,
}

impl Evaluated {
    /// Value of a node.
    pub fn value(&self, id: ExprId) -> f64 {
        self.values[id.0 as usize]
    }

    /// Values of a point.
    pub fn point(&self, p: [ExprId; 3]) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::new(self.value(p[0]), self.value(p[1]), self.value(p[2]))
    }

    /// Derivatives of a node by the free variables.
    pub fn gradient(&self, id: ExprId) -> &[f64] {
        let i = id.0 as usize * self.n;
        &self.gradients[i..i + self.n]
    }
}

impl ExprGraph {
    /// Adds a node, folding constants and sharing equal nodes among the last ones.
    pub fn push(&mut self, node: Node) -> ExprId {
        let node = self.fold(node);
        if let Some(i) = self.nodes.iter().rposition(|n| same(n, &node)) {
            return ExprId(i as u32);
        }
        self.nodes.push(node);
        ExprId((self.nodes.len() - 1) as u32)
    }

    /// A constant.
    pub fn constant(&mut self, value: f64) -> ExprId {
        self.push(Node::Const(value))
    }

    /// The node's number if it is constant.
    pub fn as_constant(&self, id: ExprId) -> Option<f64> {
        match self.nodes.get(id.0 as usize) {
            Some(Node::Const(v)) => Some(*v),
            _ => None,
        }
    }

    /// Whether a node depends on a free variable.
    pub fn is_free(&self, id: ExprId) -> bool {
        self.as_constant(id).is_none()
    }

    /// The node itself, or the constant it comes to when its operands are constant.
    pub(crate) fn fold(&self, node: Node) -> Node {
        let operands = node.operands();
        if matches!(node, Node::Const(_) | Node::Free(_)) {
            return node;
        }
        let mut v = [0.0; 2];
        for (slot, id) in v.iter_mut().zip(operands.iter().flatten()) {
            match self.as_constant(*id) {
                Some(x) => *slot = x,
                None => return node,
            }
        }
        Node::Const(apply(&node, v[0], v[1]))
    }

    /// Marks every node that `roots` depend on, themselves too.
    pub fn reachable(&self, roots: &[ExprId]) -> Vec<bool> {
        let mut seen = vec![false; self.nodes.len()];
        let mark = |seen: &mut Vec<bool>, id: ExprId| {
            if let Some(s) = seen.get_mut(id.0 as usize) {
                *s = true;
            }
        };
        for r in roots {
            mark(&mut seen, *r);
        }
        // Operands stand earlier, so one pass backwards is enough.
        for (i, node) in self.nodes.iter().enumerate().rev() {
            if seen.get(i).copied().unwrap_or(false) {
                for id in node.operands().into_iter().flatten() {
                    mark(&mut seen, id);
                }
            }
        }
        seen
    }

    /// Indices of the free variables that `roots` depend on, in order.
    pub fn free_variables(&self, roots: &[ExprId]) -> BTreeSet<usize> {
        let seen = self.reachable(roots);
        let free = |(node, seen): (&Node, bool)| match node {
            Node::Free(i) if seen => Some(*i as usize),
            _ => None,
        };
        self.nodes.iter().zip(seen).filter_map(free).collect()
    }

    /// Value of every node at the free variables `p`.
    pub fn values(&self, p: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = Vec::with_capacity(self.nodes.len());
        self.extend_values(&mut out, p);
        out
    }

    /// Appends the values of the nodes that `out` does not have yet, at the free variables `p`.
    pub fn extend_values(&self, out: &mut Vec<f64>, p: &[f64]) {
        for node in self.nodes.iter().skip(out.len()) {
            let v = match node {
                Node::Const(v) => *v,
                Node::Free(i) => p[*i as usize],
                _ => {
                    let [a, b] = node.operands();
                    let a = a.map_or(0.0, |id| out[id.0 as usize]);
                    let b = b.map_or(0.0, |id| out[id.0 as usize]);
                    apply(node, a, b)
                }
            };
            out.push(v);
        }
    }

    /// Values and derivatives (forward mode) of every node at the free variables `p`.
    pub fn evaluate(&self, p: &[f64]) -> Evaluated {
        let n = p.len();
        let values = self.values(p);
        let mut gradients = vec![0.0; self.nodes.len() * n];
        for (i, node) in self.nodes.iter().enumerate() {
            let (done, rest) = gradients.split_at_mut(i * n);
            let out = &mut rest[..n];
            if let Node::Free(k) = node {
                out[*k as usize] = 1.0;
                continue;
            }
            let ids = node.operands();
            let x = ids[0].map_or(0.0, |id| values[id.0 as usize]);
            let y = ids[1].map_or(0.0, |id| values[id.0 as usize]);
            let partial = partials(node, x, y, values[i]);
            for (id, d) in ids.iter().zip(partial) {
                if let Some(id) = id
                    && d != 0.0
                {
                    let j = id.0 as usize * n;
                    for (o, g) in out.iter_mut().zip(&done[j..j + n]) {
                        *o += d * g;
                    }
                }
            }
        }
        Evaluated { values, gradients, n }
    }
}

fn same(a: &Node, b: &Node) -> bool {
    match (a, b) {
        (Node::Const(x), Node::Const(y)) => x.to_bits() == y.to_bits(),
        _ => a == b,
    }
}

fn apply(node: &Node, a: f64, b: f64) -> f64 {
    match node {
        Node::Const(v) => *v,
        Node::Free(_) => f64::NAN,
        Node::Neg(_) => -a,
        Node::Add(..) => a + b,
        Node::Sub(..) => a - b,
        Node::Mul(..) => a * b,
        Node::Div(..) => a / b,
        Node::Powi(_, n) => a.powi(*n),
        Node::Sqrt(_) => a.sqrt(),
        Node::Sin(_) => a.sin(),
        Node::Cos(_) => a.cos(),
        Node::Tan(_) => a.tan(),
        Node::Atan2(..) => a.atan2(b),
        Node::Asin(_) => a.asin(),
        Node::Acos(_) => a.acos(),
        Node::Min(..) => a.min(b),
        Node::Max(..) => a.max(b),
        Node::Abs(_) => a.abs(),
    }
}

fn partials(node: &Node, a: f64, b: f64, value: f64) -> [f64; 2] {
    match node {
        Node::Const(_) | Node::Free(_) => [0.0, 0.0],
        Node::Neg(_) => [-1.0, 0.0],
        Node::Add(..) => [1.0, 1.0],
        Node::Sub(..) => [1.0, -1.0],
        Node::Mul(..) => [b, a],
        Node::Div(..) => [1.0 / b, -value / b],
        Node::Powi(_, 0) => [0.0, 0.0],
        Node::Powi(_, n) => [f64::from(*n) * a.powi(n - 1), 0.0],
        Node::Sqrt(_) => [0.5 / value, 0.0],
        Node::Sin(_) => [a.cos(), 0.0],
        Node::Cos(_) => [-a.sin(), 0.0],
        Node::Tan(_) => [1.0 + value * value, 0.0],
        Node::Atan2(..) => {
            let r2 = a * a + b * b;
            [b / r2, -a / r2]
        }
        Node::Asin(_) => [1.0 / (1.0 - a * a).sqrt(), 0.0],
        Node::Acos(_) => [-1.0 / (1.0 - a * a).sqrt(), 0.0],
        Node::Min(..) => {
            if a <= b {
                [1.0, 0.0]
            } else {
                [0.0, 1.0]
            }
        }
        Node::Max(..) => {
            if a >= b {
                [1.0, 0.0]
            } else {
                [0.0, 1.0]
            }
        }
        Node::Abs(_) => [a.signum(), 0.0],
    }
}
