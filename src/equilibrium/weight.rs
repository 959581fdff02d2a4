//! What links weigh. Flat bars of the links' height and width along the shortest tree through a link's points, with round
//! ends, follow the design with exact derivatives. What the printed form has beyond them (bosses, stubs, risers, less
//! bores and rounded edges) is measured beforehand (`geometry/weigh.rs`) and added as a constant.

use super::load::{PointForce, PointForceChange};
use crate::geometry::link::BAR_PER_HEIGHT;
use crate::geometry::skeleton::spanning_tree;
use crate::ir::expr::ExprId;
use crate::ir::{Body, Design, Material};
use crate::kinematics::{Motion, Twist};
use crate::math::Pose;
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
            let (more, shift) = extra(b);
            let rest = motion.rest_point(body, &(center + shift));
            PointForce { body, rest, force_n: specific_n_mm3 * (volume + more) }
        })
        .collect()
}

/// Volume and shift of the centre that the printed form adds to the bars.
fn extra(body: &Body) -> (f64, Vector3<f64>) {
    body.printed.map_or((0.0, Vector3::zeros()), |p| (p.volume_mm3, Vector3::from(p.center_mm)))
}

/// How that of a link changes when its drawn points move by `rates` and its rest pose by `twist`.
pub(super) fn link_change(
    body: &Body,
    points: &[Vector3<f64>],
    rates: &[Vector3<f64>],
    height_mm: f64,
    (rest, twist): (&Pose, &Twist),
    specific_n_mm3: &Vector3<f64>,
) -> PointForceChange {
    let [(_, center), (volume, moved)] = volume_and_center_moving(points, rates, height_mm);
    PointForceChange {
        rest: twist.at(&rest.point(&(center + extra(body).1))) + rest.direction(&moved),
        force_n: specific_n_mm3 * volume,
    }
}

/// Volume (mm³) and centre of mass of the bars through points.
pub fn volume_and_center(points: &[Vector3<f64>], height_mm: f64) -> (f64, Vector3<f64>) {
    let still = vec![Vector3::zeros(); points.len()];
    let [value, _] = volume_and_center_moving(points, &still, height_mm);
    value
}

/// The same, and their derivatives when the points move by `rates`. Which points are joined is taken as it is.
pub(super) fn volume_and_center_moving(
    points: &[Vector3<f64>],
    rates: &[Vector3<f64>],
    height_mm: f64,
) -> [(f64, Vector3<f64>); 2] {
    let radius = height_mm * BAR_PER_HEIGHT;
    let disc = PI * radius * radius * height_mm;
    let bars = spanning_tree(points.len(), &|i, j| (points[i] - points[j]).norm());
    let section = 2.0 * radius * height_mm;
    // Volume and centre of each part, then their rates.
    let mut parts: Vec<[(f64, Vector3<f64>); 2]> = bars
        .iter()
        .map(|&(i, j)| {
            let (way, rate) = (points[i] - points[j], rates[i] - rates[j]);
            let length = way.norm();
            let longer = way.dot(&rate) / length.max(f64::MIN_POSITIVE);
            let (middle, moved) = ((points[i] + points[j]) / 2.0, (rates[i] + rates[j]) / 2.0);
            [(section * length, middle), (section * longer, moved)]
        })
        .collect();
    for (i, (p, rate)) in points.iter().zip(rates).enumerate() {
        match bars.iter().filter(|(a, b)| *a == i || *b == i).count() {
            0 => parts.push([(disc, *p), (0.0, *rate)]),
            1 => parts.push([(disc / 2.0, *p), (0.0, *rate)]),
            _ => {}
        }
    }
    let volume: f64 = parts.iter().map(|[p, _]| p.0).sum();
    let more: f64 = parts.iter().map(|[_, d]| d.0).sum();
    let moment: Vector3<f64> = parts.iter().map(|[(v, at), _]| at * *v).sum();
    let by_moment: Vector3<f64> = parts.iter().map(|[(v, at), (dv, d)]| at * *dv + d * *v).sum();
    if volume <= 0.0 {
        return [(volume, Vector3::zeros()), (more, Vector3::zeros())];
    }
    let center = moment / volume;
    [(volume, center), (more, (by_moment - center * more) / volume)]
}
