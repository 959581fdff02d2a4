//! In which layers a design's bodies lie, which way its joints' axes point, and how its sliders are guided.

use super::parts::Guide;
use super::slot::any_normal;
use crate::equilibrium::Layout;
use crate::ir::expr::ExprId;
use crate::ir::{BodyId, Design, Joint, JointKind};
use nalgebra::Vector3;

/// Sine of the angle between axes that count as parallel.
const PARALLEL: f64 = 1e-9;
/// Heights that differ by less are the same, mm.
const SAME_HEIGHT_MM: f64 = 1e-6;

/// Axis of a joint in the rest pose, upwards where the joint is part of a stack.
pub(super) fn joint_axis(design: &Design, layout: &Layout, joint: &Joint) -> Vector3<f64> {
    upward(design, layout, joint.bodies.first().copied().unwrap_or(0), Vector3::from(joint.axis))
}

/// A direction carried by a body, in the rest pose; turned along the stacking axis if it is parallel to it as drawn.
fn upward(design: &Design, layout: &Layout, body: BodyId, drawn: Vector3<f64>) -> Vector3<f64> {
    let stack = Vector3::from(design.layers.axis);
    let parallel = drawn.cross(&stack).norm() < PARALLEL;
    let axis = if parallel && drawn.dot(&stack) < 0.0 { -drawn } else { drawn };
    let turned = layout.rest_poses.get(body).map_or(axis, |pose| pose.direction(&axis));
    // Rounding in the rest pose would only make the faces of the layers uneven.
    let axis = if (turned - axis).norm() < PARALLEL { axis } else { turned };
    axis.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// A body's own layers in the rest pose: their axis, and the height of its own one; none for a body whose hinges point
/// different ways or whose points lie at different heights.
///
/// Joints drawn at different heights along one axis (a crank between two planes) are reached from half-way.
pub(super) fn layers(
    design: &Design,
    layout: &Layout,
    body: BodyId,
    drawn: &impl Fn([ExprId; 3]) -> Vector3<f64>,
) -> Option<(Vector3<f64>, f64)> {
    let own = || design.joints.iter().filter(|j| j.bodies.contains(&body));
    let first = own().find(|j| j.kind == JointKind::Hinge)?;
    let axis = Vector3::from(first.axis).try_normalize(0.0)?;
    let across = |j: &Joint| match j.kind {
        JointKind::Hinge => Vector3::from(j.axis).cross(&axis).norm() < PARALLEL,
        JointKind::Slider => Vector3::from(j.axis).dot(&axis).abs() < PARALLEL,
        _ => true,
    };
    if !own().all(across) {
        return None;
    }
    let joints: Vec<Vector3<f64>> = own().map(|j| drawn(j.point)).collect();
    let heights = joints.iter().map(|p| p.dot(&axis));
    let (low, high) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)));
    let middle = (low + high) / 2.0;
    let others = design.bodies.get(body)?.skeleton.iter().map(|p| drawn(p.position));
    let mut others = others.filter(|p| joints.iter().all(|j| (j - p).norm() >= SAME_HEIGHT_MM));
    if !others.all(|p| (p.dot(&axis) - middle).abs() < SAME_HEIGHT_MM) {
        return None;
    }
    let turned = upward(design, layout, body, axis);
    let layer = f64::from(design.bodies.get(body)?.layer) * design.layers.pitch_mm;
    let on_level = axis * middle + Vector3::from(design.layers.axis) * layer;
    Some((turned, layout.rest_poses.get(body)?.point(&on_level).dot(&turned)))
}

/// A body's shares of the conventional sliders. The first body holds the sleeve, the second the bar.
pub(super) fn guides(design: &Design, layout: &Layout, body: BodyId) -> Vec<Guide> {
    let mut found = Vec::new();
    for (index, joint) in design.joints.iter().enumerate() {
        let [first, second, ..] = joint.bodies[..] else { continue };
        if joint.is_compliant() || joint.kind != JointKind::Slider || (body != first && body != second) {
            continue;
        }
        let Some(pose) = layout.rest_poses.get(first) else { continue };
        let direction = pose.direction(&Vector3::from(joint.axis));
        let Some(direction) = direction.try_normalize(0.0) else { continue };
        let stack = upward(design, layout, first, Vector3::from(design.layers.axis));
        let normal = (stack - direction * stack.dot(&direction))
            .try_normalize(1e-6)
            .unwrap_or_else(|| any_normal(&direction));
        let point = pose.point(&layout.joint_points[index]);
        let way = layout.conventional.iter().map(|poses| {
            let (a, b) = (&poses[first], &poses[second]);
            (b.point(&point) - a.point(&point)).dot(&a.direction(&direction))
        });
        let travel = way.fold((0.0_f64, 0.0_f64), |(low, high), d| (low.min(d), high.max(d)));
        found.push(Guide {
            joint: index,
            point,
            direction,
            normal,
            travel_mm: travel,
            sleeve: body == first,
        });
    }
    found
}
