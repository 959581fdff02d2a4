//! How a body's nodes are joined by bars: a chain (minimum spanning tree, Prim 1957) or a hub at the
//! geometric median (Weiszfeld 1937), whichever needs less bar.

use nalgebra::Vector3;

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
    let chain = spanning_tree(points, &cost);
    if points.len() < 3 {
        return Net { hub: None, edges: chain };
    }
    let hub = median(points);
    let star: f64 = points.iter().map(|p| cost(p, &hub)).sum();
    let tree: f64 = chain.iter().map(|(i, j)| cost(&points[*i], &points[*j])).sum();
    // A hub that falls on a node is that node: the chain then is the star.
    let apart = points.iter().map(|p| (p - hub).norm()).fold(f64::INFINITY, f64::min);
    if star < (1.0 - HUB_SAVES) * tree && apart > 2.0 {
        let edges = (0..points.len()).map(|i| (i, points.len())).collect();
        return Net { hub: Some(hub), edges };
    }
    Net { hub: None, edges: chain }
}

/// Shortest tree through the points, as pairs of indices.
pub fn spanning_tree(
    points: &[Vector3<f64>],
    cost: &impl Fn(&Vector3<f64>, &Vector3<f64>) -> f64,
) -> Vec<(usize, usize)> {
    let mut edges = Vec::new();
    let mut inside = vec![false; points.len()];
    if let Some(first) = inside.first_mut() {
        *first = true;
    }
    for _ in 1..points.len() {
        let mut best: Option<(f64, usize, usize)> = None;
        for (i, p) in points.iter().enumerate().filter(|(i, _)| inside[*i]) {
            for (j, q) in points.iter().enumerate().filter(|(j, _)| !inside[*j]) {
                let d = cost(p, q);
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
    x
}
