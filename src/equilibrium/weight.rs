//! What links weigh. Solids are made long after the equilibrium, so a link is weighed by its skeleton: flat bars of the
//! links' height and width along the shortest tree through its points, with round ends. Bosses, stubs towards
//! flexures, bores and rounded edges are not in it: of Chebyshev's printed part it sees 82 % (`tests/weight.rs`).

use super::load::PointForce;
use crate::geometry::link::BAR_PER_HEIGHT;
use crate::geometry::skeleton::spanning_tree;
use crate::ir::expr::ExprId;
use crate::ir::{Design, Material};
use crate::kinematics::Motion;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Standard acceleration of gravity, m/s² (exact by definition): a gram weighs as many mN.
const GRAVITY_M_S2: f64 = 9.80665;
const N_PER_MN: f64 = 1e-3;

/// Weight of a volume as a vector, N/mm³; zero where the material states no density.
pub(super) fn specific_n_mm3(material: &Material, direction: &[f64; 3]) -> Vector3<f64> {
    let density = material.density_g_mm3.unwrap_or(0.0);
    Vector3::from(*direction) * (density * GRAVITY_M_S2 * N_PER_MN)
}

/// The weight of every moving link at its centre of mass.
pub(super) fn links(
    design: &Design,
    motion: &Motion,
    points: impl Fn([ExprId; 3]) -> Vector3<f64>,
    specific_n_mm3: &Vector3<f64>,
) -> Vec<PointForce> {
    let moving = design.bodies.iter().enumerate().filter(|(_, b)| !b.ground);
    moving
        .map(|(body, b)| {
            let at: Vec<Vector3<f64>> = b.skeleton.iter().map(|p| points(p.position)).collect();
            let (volume, center) = volume_and_center(&at, design.layers.height_mm);
            let rest = motion.rest_point(body, &center);
            PointForce { body, rest, force_n: specific_n_mm3 * volume }
        })
        .collect()
}

/// Volume (mm³) and centre of mass of the bars through points.
pub fn volume_and_center(points: &[Vector3<f64>], height_mm: f64) -> (f64, Vector3<f64>) {
    let radius = height_mm * BAR_PER_HEIGHT;
    let disc = PI * radius * radius * height_mm;
    let bars = spanning_tree(points.len(), &|i, j| (points[i] - points[j]).norm());
    let mut parts: Vec<(f64, Vector3<f64>)> = bars
        .iter()
        .map(|&(i, j)| {
            let (p, q) = (points[i], points[j]);
            (2.0 * radius * height_mm * (p - q).norm(), (p + q) / 2.0)
        })
        .collect();
    for (i, p) in points.iter().enumerate() {
        match bars.iter().filter(|(a, b)| *a == i || *b == i).count() {
            0 => parts.push((disc, *p)),
            1 => parts.push((disc / 2.0, *p)),
            _ => {}
        }
    }
    let volume: f64 = parts.iter().map(|p| p.0).sum();
    let moment: Vector3<f64> = parts.iter().map(|(v, at)| at * *v).sum();
    let center = if volume > 0.0 { moment / volume } else { Vector3::zeros() };
    (volume, center)
}
