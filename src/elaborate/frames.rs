//! Where bodies lie seen from a joint: end frames, layers, lengths of links.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Outcome};
use super::sheet::Sheet;
use super::structure::{SAME_POINT_MM, Structure};
use crate::diagnostic::Diagnostic;
use crate::ir::{ExprPoint, Joint, JointKind, Layers, Rod};
use crate::syntax::ast::Expr;

/// Height of a link where the text is silent, mm.
const DEFAULT_HEIGHT_MM: f64 = 12.0;
/// An end frame whose e1 is shorter than this, mm, is not determined.
const LEAST_E1_MM: f64 = 1e-6;

pub(super) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub(super) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The part of the way from a joint to where a body lies that decides its end frame, mm.
fn telling_part(joint: &Joint, way: [f64; 3]) -> f64 {
    let [x, y, z] = joint.axis;
    match (joint.kind, joint.second_axis) {
        (JointKind::Ball, _) => norm(way),
        (JointKind::Universal, Some([u, v, w])) => {
            dot(way, [y * w - z * v, z * u - x * w, x * v - y * u]).abs()
        }
        _ => {
            let along = dot(way, joint.axis);
            norm(minus(way, joint.axis.map(|a| a * along)))
        }
    }
}

impl<'a> Evaluator<'a> {
    /// The frame of every template end must be determined: e1 points at the body's other joints, or at Q.
    pub(super) fn check_end_frames(&mut self, s: &Structure<'a>) {
        for (i, (joint, text)) in s.joints.iter().zip(&s.texts).enumerate() {
            let Some(template) = &text.template else { continue };
            let here = self.start_point(joint.point);
            self.check_idle_toward(s, i);
            // A slider's flexures all use the frame of its first body.
            let framed = if joint.kind == JointKind::Slider { 1 } else { joint.bodies.len() };
            for b in joint.bodies.iter().take(framed) {
                let Some(body) = s.bodies.get(*b) else { continue };
                let toward = joint.toward.iter().find(|(t, _)| t == b).map(|(_, q)| self.start_point(*q));
                let others: Vec<[f64; 3]> = s
                    .joints
                    .iter()
                    .enumerate()
                    .filter(|(j, other)| *j != i && other.bodies.contains(b))
                    .map(|(_, other)| self.start_point(other.point))
                    .collect();
                let target = toward.or_else(|| {
                    let n = others.len() as f64;
                    let sum = others.iter().fold([0.0; 3], |a, p| [a[0] + p[0], a[1] + p[1], a[2] + p[2]]);
                    (n > 0.0).then(|| sum.map(|x| x / n))
                });
                let why = match target {
                    None => "it has no other joint".to_string(),
                    Some(q) => {
                        if telling_part(joint, minus(q, here)) >= LEAST_E1_MM {
                            continue;
                        }
                        let what = match toward {
                            Some(_) => "that point",
                            None => "the centre of its other joints",
                        };
                        let place = match joint.kind {
                            JointKind::Ball => "at the joint",
                            JointKind::Universal => "in the plane of the joint's axes",
                            _ => "on the joint's axis",
                        };
                        format!("{what} lies {place}")
                    }
                };
                let candidate = body
                    .skeleton
                    .iter()
                    .find(|p| telling_part(joint, minus(self.start_point(p.position), here)) > LEAST_E1_MM)
                    .map_or("Q", |p| p.name.as_str());
                let d = Diagnostic::error(
                    codes::END_FRAME,
                    format!("it is not clear where `{}` lies seen from joint `{}`", body.name, joint.name),
                    template.name.at,
                )
                .label(why)
                .also(body.origin, "this body")
                .help(format!("say it with `into {} toward {candidate}`", body.name));
                self.out.push(d);
            }
        }
    }

    /// `into` of a body whose frame a slider's flexures do not use must not be overlooked.
    fn check_idle_toward(&mut self, s: &Structure<'a>, joint: usize) {
        let (Some(joint), Some(text)) = (s.joints.get(joint), s.texts.get(joint)) else { return };
        let first = joint.bodies.first();
        let idle = joint.toward.iter().position(|(b, _)| joint.kind == JointKind::Slider && Some(b) != first);
        let Some((name, _)) = idle.and_then(|i| text.into.get(i)) else { return };
        let of = first.and_then(|b| s.bodies.get(*b)).map_or("", |b| b.name.as_str());
        let message =
            format!("`into {}` has no effect: a slider's flexures are placed from `{of}`", name.node);
        self.out.push(
            Diagnostic::error(codes::MISPLACED, message, name.at)
                .help(format!("write `into {of} toward …`, or exchange the two bodies")),
        );
    }

    /// Stacking of the planar links.
    pub(super) fn layers(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        s: &Structure<'a>,
        clearance_mm: Option<f64>,
    ) -> Outcome<Layers> {
        let height_mm = match sheet.height {
            None => DEFAULT_HEIGHT_MM * self.scale,
            Some((e, _)) => {
                let v = self.eval_fixed(scope, e, Dimension::LENGTH, "the links' height")?;
                if v <= 0.0 {
                    return self.fail(Diagnostic::error(
                        codes::SIZE,
                        "the links' height must be positive",
                        e.at,
                    ));
                }
                v
            }
        };
        let mut hinges = s.joints.iter().filter(|j| j.kind == JointKind::Hinge);
        let axis = hinges.clone().next().map_or([0.0, 0.0, 1.0], |j| j.axis);
        let used = s.bodies.iter().any(|b| b.layer != 0) || s.joints.iter().any(|j| j.layer != 0);
        if used && let Some(j) = hinges.find(|j| dot(j.axis, axis) < 1.0 - 1e-9) {
            return self.fail(
                Diagnostic::error(
                    codes::LATER_TERM,
                    "layers in a mechanism whose axes differ are not available yet",
                    j.origin,
                )
                .label("this axis differs from the first joint's"),
            );
        }
        Ok(Layers { height_mm, pitch_mm: height_mm + clearance_mm.unwrap_or(0.0), axis })
    }

    /// Gives the rods of all joints their fillets.
    pub(super) fn fillets(&mut self, scope: usize, sheet: &Sheet<'a>, s: &Structure<'a>, rods: &mut [Rod]) {
        let of_links = sheet.fillet.map_or(0.0, |(e, _)| self.fillet(scope, e));
        for (i, text) in s.texts.iter().enumerate() {
            let own = text.fillet.as_ref().map(|e| {
                if text.template.is_none() {
                    self.out.push(
                        Diagnostic::error(codes::MISPLACED, "only a compliant joint has fillets", e.at)
                            .help("leave out `fillet`, or make the joint of a flexure with `as …`"),
                    );
                }
                self.fillet(scope, e)
            });
            let radius = own.unwrap_or(of_links);
            rods.iter_mut().filter(|r| r.joint == i).for_each(|r| r.fillet_mm = radius);
        }
    }

    /// A radius, mm; it grows with `scale`, as thickness does. 0 where it is wrong, which is told.
    fn fillet(&mut self, scope: usize, e: &'a Expr) -> f64 {
        let radius = self.eval_fixed(scope, e, Dimension::LENGTH, "the radius of a fillet").unwrap_or(0.0);
        if radius < 0.0 {
            self.out.push(
                Diagnostic::error(codes::SIZE, "the radius of a fillet must not be negative", e.at)
                    .help("`fillet 0 mm` is none"),
            );
        }
        radius.max(0.0)
    }

    /// Least distance, over the bodies of a joint, from the joint's point to the body's nearest other
    /// joint point (or, where it has none, to its nearest other skeleton point), mm.
    pub(super) fn shorter_link(&self, s: &Structure<'a>, joint: usize) -> Option<f64> {
        let j = s.joints.get(joint)?;
        let here = self.start_point(j.point);
        let far = |p: ExprPoint| Some(norm(minus(self.start_point(p), here))).filter(|d| *d > SAME_POINT_MM);
        let mut least: Option<f64> = None;
        for b in &j.bodies {
            let joints = s.joints.iter().filter(|o| o.bodies.contains(b)).filter_map(|o| far(o.point));
            let nearest = joints.min_by(f64::total_cmp).or_else(|| {
                let body = s.bodies.get(*b)?;
                body.skeleton.iter().filter_map(|p| far(p.position)).min_by(f64::total_cmp)
            });
            least = match (least, nearest) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            };
        }
        least
    }
}
