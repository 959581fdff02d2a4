//! How a body's nodes are joined by bars: a chain (minimum spanning tree, Prim 1957) or a hub at the
//! geometric median (Weiszfeld 1937), whichever needs less bar.

use nalgebra::{Matrix3, Vector3};

/// Bars between nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Net {
    /// An extra node, if bars meet in one; its index is the number of given points.
    pub hub: Option<Vector3<f64>>,
    /// Pairs of node indices.
    pub edges: Vec<(usize, usize)>,
}

/// Steps of Weiszfeld's iteration: converged to 1e-6 of the size for link-like point sets.
const MEDIAN_STEPS: usize = 200;

/// Steps of Newton's method after that.
const POLISH_STEPS: usize = 4;

/// A hub must save this part of the chain's length: an equal chain looks and prints simpler.
const HUB_SAVES: f64 = 0.02;

/// What a blocked bar costs beyond its length, mm: more than any detour.
const BLOCKED_MM: f64 = 1e4;

/// Joins the points.
///
/// Bars that are `blocked` (they would run into something) are taken only where nothing else is
/// left.
pub fn connect(points: &[Vector3<f64>], blocked: impl Fn(&Vector3<f64>, &Vector3<f64>) -> bool) -> Net {
    let cost =
        |p: &Vector3<f64>, q: &Vector3<f64>| (p - q).norm() + if blocked(p, q) { BLOCKED_MM } else { 0.0 };
    let costs: Vec<Vec<f64>> =
        points.iter().enumerate().map(|(i, p)| points[..i].iter().map(|q| cost(p, q)).collect()).collect();
    let between = |i: usize, j: usize| costs[i.max(j)][i.min(j)];
    let chain = spanning_tree(points.len(), &between);
    if points.len() < 3 {
        return Net { hub: None, edges: chain };
    }
    let hub = median(points);
    let tree: f64 = chain.iter().map(|(i, j)| between(*i, *j)).sum();
    let enough = (1.0 - HUB_SAVES) * tree;
    let plain: f64 = points.iter().map(|p| (p - hub).norm()).sum();
    // What runs into something only makes it dearer, and is dear to find out.
    let star = if plain < enough { points.iter().map(|p| cost(p, &hub)).sum() } else { plain };
    // A hub that falls on a node is that node: the chain then is the star.
    let apart = points.iter().map(|p| (p - hub).norm()).fold(f64::INFINITY, f64::min);
    if star < enough && apart > 2.0 {
        let edges = (0..points.len()).map(|i| (i, points.len())).collect();
        return Net { hub: Some(hub), edges };
    }
    Net { hub: None, edges: chain }
}

/// Shortest tree through `count` nodes, as pairs of indices.
pub fn spanning_tree(count: usize, cost: &impl Fn(usize, usize) -> f64) -> Vec<(usize, usize)> {
    let mut edges = Vec::new();
    let mut inside = vec![false; count];
    if let Some(first) = inside.first_mut() {
        *first = true;
    }
    for _ in 1..count {
        let mut best: Option<(f64, usize, usize)> = None;
        for i in (0..count).filter(|i| inside[*i]) {
            for j in (0..count).filter(|j| !inside[*j]) {
                let d = cost(i, j);
                if best.is_none_or(|b| d < b.0) {
                    best = Some((d, i, j));
                }
            }
        }
        if let Some((_, i, j)) = best {
            inside[j] = true;
            edges.push((i, j));
        }
    }
    edges
}

fn median(points: &[Vector3<f64>]) -> Vector3<f64> {
    let mut x = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    for _ in 0..MEDIAN_STEPS {
        let (mut sum, mut weight) = (Vector3::zeros(), 0.0);
        for p in points {
            // Softened at a node, where the iteration would divide by zero.
            let w = 1.0 / (p - x).norm().max(1e-9);
            sum += p * w;
            weight += w;
        }
        x = sum / weight;
    }
    // To rounding, as long as that helps: at a node, where the distance has no derivative, it does not.
    for _ in 0..POLISH_STEPS {
        let (pull, hessian) = pull(points, &x);
        let Some(inverse) = hessian.try_inverse() else { break };
        let next = x - inverse * pull;
        let length = |x: &Vector3<f64>| points.iter().map(|p| (p - x).norm()).sum::<f64>();
        // Rounding of the sum must not stop a step that still matters.
        if !next.iter().all(|v| v.is_finite()) || length(&next) > length(&x) * (1.0 + 1e-14) {
            break;
        }
        x = next;
    }
    x
}

/// Gradient of the sum of distances and its Hessian.
fn pull(points: &[Vector3<f64>], x: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let (mut gradient, mut hessian) = (Vector3::zeros(), Matrix3::zeros());
    for p in points {
        let (u, curvature) = direction(p, x);
        gradient += u;
        hessian += curvature;
    }
    (gradient, hessian)
}

/// From a node to the median: unit vector, and the Hessian of the distance.
fn direction(p: &Vector3<f64>, x: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let d = x - p;
    let length = d.norm().max(1e-9);
    let u = d / length;
    (u, (Matrix3::identity() - u * u.transpose()) / length)
}

/// Derivatives of the median by each of its nodes: Σ u = 0 differentiated implicitly.
pub fn median_derivative(points: &[Vector3<f64>], median: &Vector3<f64>) -> Vec<Matrix3<f64>> {
    let inverse = pull(points, median).1.try_inverse().unwrap_or_else(Matrix3::zeros);
    points.iter().map(|p| inverse * direction(p, median).1).collect()
}
