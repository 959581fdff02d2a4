//! Where bodies lie seen from a joint: end frames, layers, lengths of links.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Outcome};
use super::sheet::Sheet;
use super::structure::{SAME_POINT_MM, Structure};
use crate::diagnostic::Diagnostic;
use crate::ir::{ExprPoint, JointKind, Layers};

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

impl<'a> Evaluator<'a> {
    /// The frame of every template end must be determined: e1 points at the body's other joints, or at Q.
    pub(super) fn check_end_frames(&mut self, s: &Structure<'a>) {
        for (i, (joint, text)) in s.joints.iter().zip(&s.texts).enumerate() {
            let Some(template) = &text.template else { continue };
            let here = self.start_point(joint.point);
            for b in &joint.bodies {
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
                        let d = minus(q, here);
                        let along = dot(d, joint.axis);
                        let flat = [0, 1, 2].map(|k: usize| {
                            d.get(k).copied().unwrap_or(0.0)
                                - along * joint.axis.get(k).copied().unwrap_or(0.0)
                        });
                        if norm(flat) >= LEAST_E1_MM {
                            continue;
                        }
                        if toward.is_some() {
                            "that point lies on the joint's axis".to_string()
                        } else {
                            "the centre of its other joints lies on this joint's axis".to_string()
                        }
                    }
                };
                let candidate = body
                    .skeleton
                    .iter()
                    .find(|p| norm(minus(self.start_point(p.position), here)) > LEAST_E1_MM)
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
