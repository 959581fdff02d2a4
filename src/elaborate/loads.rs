//! Loads: what they act on, and whether what they do can be an energy.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::Sheet;
use super::structure::Structure;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Body, Joint, JointKind, Load, LoadKind, TargetOf};
use crate::syntax::ast::{self, Expr, Ident};

/// Sine of the angle between directions that count as parallel, cosine of those that count as square. Drawn ones are
/// exact to 1e-16.
const PARALLEL: f64 = 1e-9;
/// How a direction is written, for help texts.
const DIRECTION_HELP: &str = "write `(0, 0, -1)`, or `x`, `y`, `z`";

impl<'a> Evaluator<'a> {
    /// The loads of a mechanism or of one of its cases. `weightless` is the name of the material if it states no density.
    pub(super) fn loads(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        s: &Structure<'a>,
        weightless: Option<&str>,
    ) -> Outcome<Vec<Load>> {
        self.limit(sheet.loads.len(), "loads", sheet.loads.first().map(|l| l.1).unwrap_or_default())?;
        let mut out = Vec::new();
        let mut ok = Ok(());
        for (text, at) in &sheet.loads {
            match self.load(scope, text, *at, s, weightless) {
                Ok(kind) => out.push(Load { kind, origin: *at }),
                Err(Failed) => ok = Err(Failed),
            }
        }
        ok.map(|()| out)
    }

    fn load(
        &mut self,
        scope: usize,
        text: &'a ast::Load,
        at: Origin,
        s: &Structure<'a>,
        weightless: Option<&str>,
    ) -> Outcome<LoadKind> {
        match text {
            ast::Load::Gravity { direction } => {
                let direction = self.load_direction(scope, direction)?;
                if let Some(material) = weightless {
                    let message = format!("`{material}` states no density: nothing has a weight");
                    return self.fail(
                        Diagnostic::error(codes::WEIGHTLESS, message, at)
                            .help("add `density = 1.2 g/cm^3` to the material"),
                    );
                }
                Ok(LoadKind::Gravity { direction })
            }
            ast::Load::Force { size, along, body, point } => {
                let what = ["a load", "the size of the force"];
                let size = self.of_time(scope, size, Dimension::FORCE, what);
                let direction = self.load_direction(scope, along);
                let body = self.thing(scope, &s.body_index, body, "body");
                let point = self.eval(&Env::fixed(scope), point).and_then(|v| self.as_point(v, point));
                Ok(LoadKind::Force { body: body?, point: point?, direction: direction?, size: size? })
            }
            ast::Load::Moment { size, about, body: name } => {
                let what = ["a load", "the size of the moment"];
                let size = self.of_time(scope, size, Dimension::TORQUE, what);
                let axis = self.load_direction(scope, about);
                let body = self.thing(scope, &s.body_index, name, "body");
                let (body, axis, size) = (body?, axis?, size?);
                if !s.incomplete {
                    self.conservative(body, axis, name, about, s)?;
                }
                Ok(LoadKind::Moment { body, axis, size })
            }
        }
    }

    fn load_direction(&mut self, scope: usize, e: &'a Expr) -> Outcome<[f64; 3]> {
        self.unit_direction(scope, e, "the direction of a load", DIRECTION_HELP)
    }

    /// A moment about an axis fixed in space does work that depends on the way, unless the body turns about that
    /// axis only.
    fn conservative(
        &mut self,
        body: usize,
        axis: [f64; 3],
        name: &Ident,
        about: &Expr,
        s: &Structure<'a>,
    ) -> Outcome<()> {
        if s.joints.iter().all(|j| keeps_plane(j, axis)) || is_hinged(body, axis, &s.joints, &s.bodies) {
            return Ok(());
        }
        self.fail(
            Diagnostic::error(
                codes::NONCONSERVATIVE,
                format!("the work of this moment on `{}` would depend on the way it turns", name.node),
                about.at,
            )
            .label("the body does not turn about this axis only")
            .help("a moment acts about the axis of a planar mechanism, or of a hinge between the ground and its body; elsewhere use a pair of forces"),
        )
    }

    /// Whether the text gives a trace or a direction a target.
    fn has_own_target(&self, of: &str) -> bool {
        let direction = self.aims.directions.get(of).map(|i| TargetOf::Direction(*i));
        let named = direction.or_else(|| self.aims.traces.get(of).map(|i| TargetOf::Trace(*i)));
        named.is_some_and(|of| self.aims.made.target_of(of).is_some())
    }

    /// The error of a trace needs a path to be compared with.
    pub(super) fn needs_target(&mut self, asked: &Ident, of: &str) -> Outcome<()> {
        if !self.undriven || self.has_own_target(of) {
            return Ok(());
        }
        self.fail(
            Diagnostic::error(codes::NO_TARGET, "there is no target to compare with", asked.at)
                .label("nothing is driven: with ordinary joints the trace would stand still")
                .help("leave this out, or drive a joint: the target is the path that the drive then gives"),
        )
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn is_parallel(a: [f64; 3], b: [f64; 3]) -> bool {
    super::frames::norm(cross(a, b)) < PARALLEL
}

/// Whether a joint, as drawn, lets its bodies move in the planes normal to `axis` only.
fn keeps_plane(joint: &Joint, axis: [f64; 3]) -> bool {
    match joint.kind {
        JointKind::Hinge => is_parallel(joint.axis, axis),
        JointKind::Slider => super::frames::dot(joint.axis, axis).abs() < PARALLEL,
        JointKind::Fixed => true,
        JointKind::Ball | JointKind::Universal | JointKind::Cylindrical => false,
    }
}

/// Whether a hinge about `axis` joins the body to the ground.
fn is_hinged(body: usize, axis: [f64; 3], joints: &[Joint], bodies: &[Body]) -> bool {
    joints.iter().filter(|j| j.kind == JointKind::Hinge && is_parallel(j.axis, axis)).any(|j| {
        j.pairs()
            .any(|pair| pair.contains(&body) && pair.iter().any(|b| bodies.get(*b).is_some_and(|b| b.ground)))
    })
}
