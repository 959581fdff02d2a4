//! Bodies, joints and layers of a mechanism.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::{BodyText, Sheet};
use super::value::Value;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Body, ExprPoint, Joint, JointKind, Layers, NamedPoint, Realization};
use crate::syntax::ast::{self, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// Height of a link where the text is silent, mm.
const DEFAULT_HEIGHT_MM: f64 = 12.0;
/// Points nearer than this are one point, mm. Drawn points are exact to about 1e-13 mm.
const SAME_POINT_MM: f64 = 1e-9;
/// An end frame whose e1 is shorter than this, mm, is not determined.
const LEAST_E1_MM: f64 = 1e-6;
/// Farthest layer.
const MAX_LAYER: f64 = 100.0;
/// Most bodies, and most joints.
const MAX_PARTS: usize = 256;

/// Bodies and joints with their names.
#[derive(Default)]
pub struct Structure<'a> {
    pub bodies: Vec<Body>,
    pub body_index: BTreeMap<String, usize>,
    pub joints: Vec<Joint>,
    pub joint_index: BTreeMap<String, usize>,
    /// A body or joint was wrong: what seems to be missing may be there.
    pub incomplete: bool,
    /// The statement of each joint.
    pub texts: Vec<&'a ast::Joint>,
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl<'a> Evaluator<'a> {
    /// Position of a point at the start values, mm.
    pub(super) fn start_point(&self, p: ExprPoint) -> [f64; 3] {
        p.map(|id| self.start_value(id))
    }

    pub(super) fn structure(&mut self, scope: usize, sheet: &Sheet<'a>, origin: Origin) -> Structure<'a> {
        let mut s = Structure::default();
        if sheet.bodies.len() > MAX_PARTS || sheet.joints.len() > MAX_PARTS {
            self.out.push(Diagnostic::error(
                codes::TOO_LARGE,
                format!("more than {MAX_PARTS} bodies or joints"),
                origin,
            ));
            return s;
        }
        // The first ground body is body 0, whatever the order of the text.
        let first_ground = sheet.bodies.iter().position(|b| b.ground);
        if first_ground.is_none() && !sheet.broken && !sheet.later {
            self.out.push(
                Diagnostic::error(codes::NO_GROUND, "the mechanism has no ground body", origin)
                    .help("declare the fixed body with `ground NAME { … }`"),
            );
        }
        let order =
            first_ground.into_iter().chain((0..sheet.bodies.len()).filter(|i| Some(*i) != first_ground));
        for text in order.filter_map(|i| sheet.bodies.get(i)) {
            if let Ok(body) = self.body(scope, text) {
                s.body_index.insert(body.name.clone(), s.bodies.len());
                s.bodies.push(body);
            }
        }
        let planar = self.all_at_z0(scope);
        for (text, at) in &sheet.joints {
            if let Ok(joint) = self.joint(scope, &s, text, *at, planar) {
                s.joint_index.insert(joint.name.clone(), s.joints.len());
                s.joints.push(joint);
                s.texts.push(text);
            } else {
                s.incomplete = true;
            }
        }
        self.complete_skeletons(&mut s);
        if !s.incomplete && !sheet.broken && !sheet.later {
            self.check_end_frames(&s);
        }
        s
    }

    fn body(&mut self, scope: usize, text: &BodyText<'a>) -> Outcome<Body> {
        let mut skeleton: Vec<NamedPoint> = Vec::new();
        self.limit(text.points.len(), "points of a body", text.at)?;
        for name in text.points {
            if skeleton.iter().any(|p| p.name == name.node) {
                self.out.push(Diagnostic::error(
                    codes::DUPLICATE,
                    format!("`{}` is listed twice", name.node),
                    name.at,
                ));
                continue;
            }
            // A body with a bad point is kept, so that what refers to it is not reported too.
            if let Ok(position) = self.named_point(scope, name) {
                skeleton.push(NamedPoint { name: name.node.clone(), position });
            }
        }
        let layer = self.layer(scope, text.layer);
        Ok(Body {
            name: text.name.node.clone(),
            ground: text.ground,
            skeleton,
            layer: layer.unwrap_or(0),
            origin: text.at,
        })
    }

    fn named_point(&mut self, scope: usize, name: &Ident) -> Outcome<ExprPoint> {
        match self.lookup(scope, name)? {
            Value::Point(p) => Ok(p),
            other => {
                let is = other.describe();
                self.wrong_kind(name, &is, "a point")
            }
        }
    }

    /// Lists that are compared pair by pair must be short.
    pub(super) fn limit(&mut self, n: usize, what: &str, at: Origin) -> Outcome<()> {
        if n <= MAX_PARTS {
            return Ok(());
        }
        self.fail(Diagnostic::error(codes::TOO_LARGE, format!("more than {MAX_PARTS} {what}"), at))
    }

    fn layer(&mut self, scope: usize, e: Option<&'a Expr>) -> Outcome<i32> {
        let Some(e) = e else { return Ok(0) };
        let v = self.eval_fixed(scope, e, Dimension::NUMBER, "a layer")?;
        if v.fract() != 0.0 || v.abs() > MAX_LAYER {
            return self.fail(
                Diagnostic::error(codes::COUNT, "a layer is a whole number", e.at)
                    .label(format!("this is {v}"))
                    .help("0 is the layer of the drawing, 1 lies above it along the axis, -1 below"),
            );
        }
        Ok(v as i32)
    }

    fn all_at_z0(&mut self, scope: usize) -> bool {
        let points: Vec<ExprPoint> = self
            .scopes
            .get(scope)
            .map(|s| {
                s.locals
                    .iter()
                    .filter_map(|l| match &l.state {
                        super::scope::State::Done(Value::Point(p)) => Some(*p),
                        _ => None,
                    })
                    .collect()
            })
            .unwrap_or_default();
        points.into_iter().all(|p| self.start_value(p[2]).abs() < SAME_POINT_MM)
    }

    fn joint(
        &mut self,
        scope: usize,
        s: &Structure<'a>,
        text: &'a ast::Joint,
        at: Origin,
        planar: bool,
    ) -> Outcome<Joint> {
        let mut bodies = Vec::new();
        self.limit(text.bodies.len() + text.into.len(), "bodies of a joint", at)?;
        self.joint_kind(&text.kind)?;
        let mut ok = Ok(());
        for name in &text.bodies {
            match self.thing(scope, &s.body_index, name, "body") {
                Ok(i) if bodies.contains(&i) => {
                    self.out.push(
                        Diagnostic::error(
                            codes::JOINT_BODIES,
                            format!("`{}` is joined to itself", name.node),
                            name.at,
                        )
                        .help("a joint connects different bodies"),
                    );
                    ok = Err(Failed);
                }
                Ok(i) => bodies.push(i),
                Err(Failed) => ok = Err(Failed),
            }
        }
        if let Some(third) = text.bodies.get(2) {
            ok = self.fail(
                Diagnostic::error(
                    codes::LATER_JOINT,
                    "a joint of more than two bodies is not available yet",
                    third.at,
                )
                .help("it is planned for a later version"),
            );
        }
        let point = self.eval(&Env::fixed(scope), &text.point).and_then(|v| self.as_point(v, &text.point));
        let axis = self.axis(scope, text, planar);
        let layer = self.layer(scope, text.layer.as_ref());
        let pin = self.pin(scope, text);
        let toward = self.toward(scope, s, text, &bodies);
        ok?;
        Ok(Joint {
            name: text.name.node.clone(),
            kind: JointKind::Hinge,
            bodies,
            point: point?,
            axis: axis?,
            layer: layer?,
            toward: toward?,
            realization: Realization::Conventional { pin_diameter_mm: pin? },
            origin: at,
        })
    }

    fn joint_kind(&mut self, kind: &Ident) -> Outcome<()> {
        const KINDS: [&str; 6] = ["hinge", "ball", "universal", "slider", "cylindrical", "fixed"];
        let name = kind.node.as_str();
        if name == "hinge" {
            return Ok(());
        }
        if KINDS.contains(&name) {
            return self.later(codes::LATER_JOINT, name, kind.at);
        }
        let d =
            Diagnostic::error(codes::UNKNOWN_NAME, format!("there is no kind of joint `{name}`"), kind.at);
        self.fail(match super::names::suggestion(name, KINDS) {
            Some(near) => d.help(format!("did you mean `{near}`?")),
            None => d.help(format!("kinds are {}", KINDS.join(", "))),
        })
    }

    fn axis(&mut self, scope: usize, text: &'a ast::Joint, planar: bool) -> Outcome<[f64; 3]> {
        let Some(e) = &text.axis else {
            if planar {
                return Ok([0.0, 0.0, 1.0]);
            }
            return self.fail(
                Diagnostic::error(
                    codes::AXIS,
                    format!("joint `{}` needs an axis", text.name.node),
                    text.name.at,
                )
                .label("z is meant only where every point lies at z = 0")
                .help("write `axis z` or `axis (0, 1, 0.25)`"),
            );
        };
        if let Some(axis) = named_axis(e) {
            return Ok(axis);
        }
        let v = match self.eval(&Env::fixed(scope), e)? {
            Value::Vector { v, dim, .. } if dim.is_number() => v,
            other => {
                return self.fail(
                    Diagnostic::error(
                        codes::TYPE,
                        format!("an axis is a direction, this is {}", other.a()),
                        e.at,
                    )
                    .help("write `axis z` or `axis (0, 1, 0.25)`"),
                );
            }
        };
        let mut d = [0.0; 3];
        for (slot, id) in d.iter_mut().zip(v) {
            *slot = self.fixed(id, e.at, "an axis")?;
        }
        let length = norm(d);
        if length < 1e-12 {
            return self.fail(Diagnostic::error(
                codes::AXIS,
                "an axis of length zero has no direction",
                e.at,
            ));
        }
        Ok(d.map(|x| x / length))
    }

    fn pin(&mut self, scope: usize, text: &'a ast::Joint) -> Outcome<Option<f64>> {
        let Some(e) = &text.pin else { return Ok(None) };
        if text.template.is_some() {
            return self.fail(
                Diagnostic::error(codes::MISPLACED, "a compliant joint has no pin", e.at)
                    .help("leave out `pin`, or `as …`"),
            );
        }
        let d = self.eval_fixed(scope, e, Dimension::LENGTH, "the pin's diameter")?;
        if d <= 0.0 {
            return self.fail(Diagnostic::error(codes::SIZE, "the pin's diameter must be positive", e.at));
        }
        Ok(Some(d))
    }

    fn toward(
        &mut self,
        scope: usize,
        s: &Structure<'a>,
        text: &'a ast::Joint,
        bodies: &[usize],
    ) -> Outcome<Vec<(usize, ExprPoint)>> {
        let mut out: Vec<(usize, ExprPoint)> = Vec::new();
        for (name, point) in &text.into {
            let body = self.thing(scope, &s.body_index, name, "body")?;
            if !bodies.contains(&body) {
                return self.fail(
                    Diagnostic::error(
                        codes::JOINT_BODIES,
                        format!("`{}` is not a body of joint `{}`", name.node, text.name.node),
                        name.at,
                    )
                    .help(format!(
                        "it joins {}",
                        text.bodies.iter().map(|b| format!("`{}`", b.node)).collect::<Vec<_>>().join(" and ")
                    )),
                );
            }
            if out.iter().any(|(b, _)| *b == body) {
                return self.fail(Diagnostic::error(
                    codes::DUPLICATE,
                    format!("`into {}` is given twice", name.node),
                    name.at,
                ));
            }
            let v = self.eval(&Env::fixed(scope), point)?;
            out.push((body, self.as_point(v, point)?));
        }
        Ok(out)
    }

    /// Adds to every body the joint points that its list does not have.
    fn complete_skeletons(&mut self, s: &mut Structure<'a>) {
        for (joint, text) in s.joints.iter().zip(&s.texts) {
            let name = match &text.point.kind {
                ExprKind::Name(path) if path.len() == 1 => path.iter().map(|p| p.node.clone()).collect(),
                _ => joint.name.clone(),
            };
            let here = self.start_point(joint.point);
            for b in &joint.bodies {
                let Some(body) = s.bodies.get_mut(*b) else { continue };
                let known = body.skeleton.iter().any(|p| {
                    p.position == joint.point
                        || norm(minus(self.start_point(p.position), here)) < SAME_POINT_MM
                });
                if !known {
                    body.skeleton.push(NamedPoint { name: name.clone(), position: joint.point });
                }
            }
        }
    }

    /// The frame of every template end must be determined: e1 points at the body's other joints, or at Q.
    fn check_end_frames(&mut self, s: &Structure<'a>) {
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
            None => DEFAULT_HEIGHT_MM,
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
        let axis = s.joints.first().map_or([0.0, 0.0, 1.0], |j| j.axis);
        let used = s.bodies.iter().any(|b| b.layer != 0) || s.joints.iter().any(|j| j.layer != 0);
        if used && let Some(j) = s.joints.iter().find(|j| dot(j.axis, axis) < 1.0 - 1e-9) {
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

/// `x`, `y`, `z` and their negatives.
fn named_axis(e: &Expr) -> Option<[f64; 3]> {
    match &e.kind {
        ExprKind::Name(path) if path.len() == 1 => match path.first().map(|p| p.node.as_str()) {
            Some("x") => Some([1.0, 0.0, 0.0]),
            Some("y") => Some([0.0, 1.0, 0.0]),
            Some("z") => Some([0.0, 0.0, 1.0]),
            _ => None,
        },
        ExprKind::Negate(inner) => named_axis(inner).map(|a| a.map(|x| if x == 0.0 { 0.0 } else { -x })),
        _ => None,
    }
}
