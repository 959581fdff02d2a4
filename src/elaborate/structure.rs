//! Bodies, joints and layers of a mechanism.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::frames::{minus, norm};
use super::sheet::{BodyText, Sheet};
use super::value::Value;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Body, ExprPoint, Joint, JointKind, NamedPoint, Realization};
use crate::syntax::ast::{self, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// Points nearer than this are one point, mm. Drawn points are exact to about 1e-13 mm.
pub(super) const SAME_POINT_MM: f64 = 1e-9;
/// Cosine of the angle between axes that count as square. Drawn axes are exact to 1e-16.
const SQUARE: f64 = 1e-9;
/// Farthest layer.
const MAX_LAYER: f64 = 100.0;
/// Most bodies, and most joints.
pub(super) const MAX_PARTS: usize = 256;

/// Bodies and joints with their names.
#[derive(Default)]
pub struct Structure<'a> {
    pub bodies: Vec<Body>,
    pub body_index: BTreeMap<String, usize>,
    pub joints: Vec<Joint>,
    pub joint_index: BTreeMap<String, usize>,
    pub strings: Vec<crate::ir::Cable>,
    pub string_index: BTreeMap<String, usize>,
    /// A body or joint was wrong: what seems to be missing may be there.
    pub incomplete: bool,
    /// The statement of each joint.
    pub texts: Vec<&'a ast::Joint>,
    /// Beside instances, in place of joints: those that a motor could turn.
    pub standing: Vec<StandingHinge>,
}

/// A conventional hinge of an instance, at the start of what is free.
pub struct StandingHinge {
    /// The joined body that it is seen from.
    pub body: usize,
    /// Its point, mm.
    pub at: [f64; 3],
    /// Its axis.
    pub axis: [f64; 3],
    /// What it is there.
    pub of: crate::ir::assembly::InstanceHinge,
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
        // Also of those that are wrong otherwise: what their drives are measured in is known all the same.
        let sliding = sheet.joints.iter().filter(|(j, _)| j.kind.node == JointKind::Slider.name());
        self.sliders.extend(sliding.map(|(j, _)| j.name.node.clone()));
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
                // Its template will not be looked at: at least its overrides are.
                for (name, value) in text.template.iter().flat_map(|t| &t.overrides) {
                    let env = Env::named(scope, format!("{}.{}", text.name.node, name.node));
                    let _ = self.eval(&env, value);
                }
            }
        }
        self.complete_skeletons(&mut s);
        self.holes(scope, sheet, &mut s);
        if !s.incomplete && !sheet.broken && !sheet.later {
            self.check_end_frames(&s);
        }
        s
    }

    pub(super) fn body(&mut self, scope: usize, text: &BodyText<'a>) -> Outcome<Body> {
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
            owner: None,
            holes: Vec::new(),
            fittings: Default::default(),
            printed: None,
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
        let kind = self.joint_kind(&text.kind)?;
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
            ok = self.many(kind, third).and(ok);
        }
        let point = self.eval(&Env::fixed(scope), &text.point).and_then(|v| self.as_point(v, &text.point));
        let axes = self.axes(scope, text, kind, planar);
        let layer = self.layer(scope, text.layer.as_ref());
        let pin = self.pin(scope, text, kind);
        let toward = self.toward(scope, s, text, &bodies);
        ok?;
        let (axis, second_axis) = axes?;
        Ok(Joint {
            name: text.name.node.clone(),
            kind,
            bodies,
            point: point?,
            axis,
            second_axis,
            layer: layer?,
            toward: toward?,
            realization: Realization::Conventional { pin_diameter_mm: pin? },
            origin: at,
        })
    }

    fn joint_kind(&mut self, kind: &Ident) -> Outcome<JointKind> {
        let name = kind.node.as_str();
        if let Some(found) = JointKind::ALL.into_iter().find(|k| k.name() == name) {
            return Ok(found);
        }
        let kinds = JointKind::ALL.map(JointKind::name);
        let d =
            Diagnostic::error(codes::UNKNOWN_NAME, format!("there is no kind of joint `{name}`"), kind.at);
        self.fail(match super::names::suggestion(name, kinds) {
            Some(near) => super::lookup::meant(d, kind, &near),
            None => d.help(format!("kinds are {}", kinds.join(", "))),
        })
    }

    /// Only a hinge may join more than two bodies.
    fn many(&mut self, kind: JointKind, third: &Ident) -> Outcome<()> {
        if kind != JointKind::Hinge {
            let message = format!("a {} joint connects two bodies", kind.name());
            return self.fail(
                Diagnostic::error(codes::JOINT_BODIES, message, third.at)
                    .help("write one joint for each pair of bodies"),
            );
        }
        Ok(())
    }

    /// The axis of a joint, and the second one of a universal joint.
    fn axes(
        &mut self,
        scope: usize,
        text: &'a ast::Joint,
        kind: JointKind,
        planar: bool,
    ) -> Outcome<([f64; 3], Option<[f64; 3]>)> {
        let universal = kind == JointKind::Universal;
        match (&text.axis, &text.second_axis) {
            (Some(e), _) if matches!(kind, JointKind::Ball | JointKind::Fixed) => self.fail(
                Diagnostic::error(codes::MISPLACED, format!("a {} joint has no axis", kind.name()), e.at)
                    .help("leave out `axis …`"),
            ),
            (_, Some(e)) if !universal => self.fail(
                Diagnostic::error(codes::MISPLACED, format!("a {} joint has one axis", kind.name()), e.at)
                    .help("only a universal joint has two"),
            ),
            (first, None) if universal => self.fail(
                Diagnostic::error(
                    codes::AXIS,
                    format!("universal joint `{}` needs two axes", text.name.node),
                    first.as_ref().map_or(text.name.at, |e| e.at),
                )
                .label("the first is the first body's, the second the second body's")
                .help("write `axis y and x`"),
            ),
            (_, Some(e)) => {
                let first = self.axis(scope, text, kind, planar);
                let (first, second) = (first?, self.direction(scope, e)?);
                let along = super::frames::dot(first, second);
                if along.abs() > SQUARE {
                    return self.fail(
                        Diagnostic::error(codes::AXIS, "the axes of a universal joint are square", e.at)
                            .label(format!("this is {:.1} deg from the first", along.acos().to_degrees())),
                    );
                }
                Ok((first, Some(second)))
            }
            (None, None) if matches!(kind, JointKind::Ball | JointKind::Fixed) => Ok(([0.0, 0.0, 1.0], None)),
            _ => Ok((self.axis(scope, text, kind, planar)?, None)),
        }
    }

    fn axis(
        &mut self,
        scope: usize,
        text: &'a ast::Joint,
        kind: JointKind,
        planar: bool,
    ) -> Outcome<[f64; 3]> {
        let Some(e) = &text.axis else {
            let turns = matches!(kind, JointKind::Hinge | JointKind::Cylindrical);
            if planar && turns {
                return Ok([0.0, 0.0, 1.0]);
            }
            let d = Diagnostic::error(
                codes::AXIS,
                format!("joint `{}` needs an axis", text.name.node),
                text.name.at,
            );
            let d = if turns { d.label("z is meant only where every point lies at z = 0") } else { d };
            return self.fail(d.help("write `axis z` or `axis (0, 1, 0.25)`"));
        };
        self.direction(scope, e)
    }

    pub(super) fn direction(&mut self, scope: usize, e: &'a Expr) -> Outcome<[f64; 3]> {
        self.unit_direction(scope, e, "an axis", "write `axis z` or `axis (0, 1, 0.25)`")
    }

    /// A fixed direction of length one; `what` names what it is for ("an axis"), `how` how one is written.
    pub(super) fn unit_direction(
        &mut self,
        scope: usize,
        e: &'a Expr,
        what: &str,
        help: &str,
    ) -> Outcome<[f64; 3]> {
        if let Some(axis) = named_axis(e) {
            return Ok(axis);
        }
        let v = match self.eval(&Env::fixed(scope), e)? {
            Value::Vector { v, dim, .. } if dim.is_number() => v,
            other => {
                return self.fail(
                    Diagnostic::error(
                        codes::TYPE,
                        format!("{what} is a direction, this is {}", other.a()),
                        e.at,
                    )
                    .help(help),
                );
            }
        };
        let mut d = [0.0; 3];
        for (slot, id) in d.iter_mut().zip(v) {
            *slot = self.fixed(id, e.at, what)?;
        }
        let length = norm(d);
        if length < 1e-12 {
            return self.fail(Diagnostic::error(
                codes::AXIS,
                format!("{what} of length zero has no direction"),
                e.at,
            ));
        }
        Ok(d.map(|x| x / length))
    }

    fn pin(&mut self, scope: usize, text: &'a ast::Joint, kind: JointKind) -> Outcome<Option<f64>> {
        let Some(e) = &text.pin else { return Ok(None) };
        if kind != JointKind::Hinge {
            return self.fail(
                Diagnostic::error(codes::MISPLACED, format!("a {} joint has no pin", kind.name()), e.at)
                    .help("leave out `pin`"),
            );
        }
        if text.template.is_some() {
            return self.fail(
                Diagnostic::error(codes::MISPLACED, "a compliant joint has no pin", e.at)
                    .help("leave out `pin`, or `as …`"),
            );
        }
        let d = self.unscaled(|s| s.eval_fixed(scope, e, Dimension::LENGTH, "the pin's diameter"))?;
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
                    // Points that only meet where the free variables start are different points.
                    let fixed = !p.position.iter().chain(&joint.point).any(|id| self.exprs.is_free(*id));
                    p.position == joint.point
                        || fixed && norm(minus(self.start_point(p.position), here)) < SAME_POINT_MM
                });
                if !known {
                    body.skeleton.push(NamedPoint { name: name.clone(), position: joint.point });
                }
            }
        }
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
