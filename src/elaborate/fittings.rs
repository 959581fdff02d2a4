//! Motors on bodies, seats of their horns, and bodies that are plates.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::Sheet;
use super::structure::{SAME_POINT_MM, Structure};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{ExprPoint, Horn, JointId, JointKind, LinkPlate, Mount};
use crate::syntax::ast::{self, Expr, Ident};

/// Depth of a horn's recess where none is stated, mm: it centres the horn, screws hold it.
const RECESS_MM: f64 = 1.0;

impl<'a> Evaluator<'a> {
    /// All mounts, horns and plates, each in its body.
    pub(super) fn fittings(&mut self, scope: usize, module: usize, sheet: &Sheet<'a>, s: &mut Structure<'a>) {
        let count = sheet.mounts.len() + sheet.horns.len() + sheet.plates.len();
        let first = sheet.mounts.iter().chain(&sheet.horns).map(|m| m.1).next();
        let first = first.or(sheet.plates.first().map(|p| p.1)).unwrap_or_default();
        if self.limit(count, "mounts, horns and plates", first).is_err() {
            return;
        }
        for (text, at) in &sheet.mounts {
            let Ok((body, mount)) = self.mount(scope, module, text, *at, s) else { continue };
            s.bodies.get_mut(body).into_iter().for_each(|b| b.fittings.mounts.push(mount.clone()));
        }
        for (text, at) in &sheet.horns {
            let Ok((body, horn)) = self.horn(scope, module, text, *at, s) else { continue };
            s.bodies.get_mut(body).into_iter().for_each(|b| b.fittings.horns.push(horn.clone()));
        }
        for (text, at) in &sheet.plates {
            let Ok((body, plate)) = self.link_plate(scope, text, *at, s) else { continue };
            let Some(body) = s.bodies.get_mut(body) else { continue };
            match &body.fittings.plate {
                None => body.fittings.plate = Some(plate),
                Some(first) => {
                    let message = format!("`{}` is a plate already", body.name);
                    let first = first.origin;
                    self.out.push(
                        Diagnostic::error(codes::REPEATED, message, *at)
                            .label("again here")
                            .also(first, "first here"),
                    );
                }
            }
        }
    }

    pub(super) fn mount(
        &mut self,
        scope: usize,
        module: usize,
        text: &'a ast::Fitted,
        at: Origin,
        s: &Structure<'a>,
    ) -> Outcome<(usize, Mount)> {
        let motor = self.record_named(module, &text.motor, "motor");
        let motor = motor.and_then(|item| self.motor_body(item, &text.motor));
        let (motor, body, position, given) = self.fitted(scope, text, s, motor)?;
        let joint = self.turned_at(body, position, s);
        let Given { along, toward, clearance_mm, thick: thick_mm, .. } = given;
        if let Some(q) = toward {
            let (p, q) = (self.start_point(position), self.start_point(q));
            let hinge = joint
                .and_then(|j| s.joints.get(j).map(|j| j.axis).or_else(|| s.standing.get(j).map(|h| h.axis)));
            let axis = along.or(hinge).unwrap_or([0.0, 0.0, 1.0]);
            let d = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
            let up: f64 = d.iter().zip(axis).map(|(d, a)| d * a).sum();
            let off = d.iter().zip(axis).map(|(d, a)| (d - a * up).powi(2)).sum::<f64>().sqrt();
            if off < SAME_POINT_MM {
                let message = "the motor's box is to point along its shaft";
                let e = text.clauses.iter().find(|c| c.0.node == "toward").map_or(at, |c| c.1.at);
                return self.fail(
                    Diagnostic::error(codes::FITTING, message, e)
                        .help("choose a point beside the axis of the shaft"),
                );
            }
        }
        Ok((body, Mount { motor, position, along, joint, toward, thick_mm, clearance_mm, origin: at }))
    }

    pub(super) fn horn(
        &mut self,
        scope: usize,
        module: usize,
        text: &'a ast::Fitted,
        at: Origin,
        s: &Structure<'a>,
    ) -> Outcome<(usize, Horn)> {
        let form = self.record_named(module, &text.motor, "motor");
        let form = form.and_then(|item| self.horn_form(item, &text.motor));
        let (form, body, position, given) = self.fitted(scope, text, s, form)?;
        let Some(joint) = self.turned_at(body, position, s) else {
            let message = format!("`{}` has no ordinary hinge here that a motor could turn", text.body.node);
            return self.fail(
                Diagnostic::error(codes::FITTING, message, text.point.at)
                    .help("a horn sits on the axis of a hinge without `as`: write the hinge's point"),
            );
        };
        let (deep_mm, clearance_mm) = (given.deep.unwrap_or(RECESS_MM), given.clearance_mm);
        Ok((body, Horn { form, joint, deep_mm, clearance_mm, origin: at }))
    }

    fn link_plate(
        &mut self,
        scope: usize,
        text: &'a ast::Plate,
        at: Origin,
        s: &Structure<'a>,
    ) -> Outcome<(usize, LinkPlate)> {
        let thick = self.fitted_length(scope, &text.thickness, "the thickness of a plate");
        let margin = text.margin.as_ref().map(|m| self.fitted_length(scope, m, "the margin of a plate"));
        let body = self.thing(scope, &s.body_index, &text.body, "body");
        let margin_mm = margin.transpose()?;
        Ok((body?, LinkPlate { thick_mm: thick?, margin_mm, origin: at }))
    }

    /// What a mount and a horn have in common, besides what is known of the motor: body, point, clauses. All of it is looked at before any
    /// of it fails.
    fn fitted<T>(
        &mut self,
        scope: usize,
        text: &'a ast::Fitted,
        s: &Structure<'a>,
        motor: Outcome<T>,
    ) -> Outcome<(T, usize, ExprPoint, Given)> {
        let body = self.thing(scope, &s.body_index, &text.body, "body");
        let point = self.eval(&Env::fixed(scope), &text.point).and_then(|v| self.as_point(v, &text.point));
        let mut given = Given::default();
        let clauses = self.clauses(scope, text, &mut given);
        let (motor, body, point) = (motor?, body?, point?);
        clauses?;
        Ok((motor, body, point, given))
    }

    /// What is screwed on does not grow with the drawing.
    fn fitted_length(&mut self, scope: usize, e: &'a Expr, what: &str) -> Outcome<f64> {
        self.unscaled(|s| s.positive(scope, Some(e), Dimension::LENGTH, what))?.ok_or(Failed)
    }

    fn clauses(&mut self, scope: usize, text: &'a ast::Fitted, given: &mut Given) -> Outcome<()> {
        let mut ok = Ok(());
        for (i, (word, value)) in text.clauses.iter().enumerate() {
            if text.clauses.iter().take(i).any(|(w, _)| w.node == word.node) {
                let message = format!("`{}` is given twice", word.node);
                self.out.push(Diagnostic::error(codes::DUPLICATE, message, word.at).label("again here"));
                ok = Err(Failed);
                continue;
            }
            let found = self.clause(scope, word, value, given);
            ok = found.and(ok);
        }
        ok
    }

    fn clause(&mut self, scope: usize, word: &Ident, value: &'a Expr, given: &mut Given) -> Outcome<()> {
        match word.node.as_str() {
            "along" => {
                let help = "write `(0, 0, -1)`, or `x`, `y`, `z`";
                given.along = Some(self.unit_direction(scope, value, "the direction of a shaft", help)?);
            }
            "toward" => {
                let point = self.eval(&Env::fixed(scope), value).and_then(|v| self.as_point(v, value))?;
                given.toward = Some(point);
            }
            "thick" => given.thick = Some(self.fitted_length(scope, value, "the thickness of a seat")?),
            "deep" => given.deep = Some(self.fitted_length(scope, value, "the depth of a recess")?),
            _ => given.clearance_mm = Some(self.fitted_length(scope, value, "a clearance")?),
        }
        Ok(())
    }

    /// The conventional hinge of a body at a point: beside instances one of those that stand there.
    fn turned_at(&self, body: usize, at: ExprPoint, s: &Structure<'a>) -> Option<JointId> {
        let at = self.start_point(at);
        let near = |p: [f64; 3]| p.iter().zip(at).all(|(p, q)| (p - q).abs() < SAME_POINT_MM);
        let is = |j: usize| {
            let text = s.texts.get(j);
            let plain = text.is_some_and(|t| t.template.is_none());
            s.joints.get(j).is_some_and(|joint| {
                plain
                    && joint.kind == JointKind::Hinge
                    && joint.bodies.contains(&body)
                    && near(self.start_point(joint.point))
            })
        };
        let standing = || s.standing.iter().position(|h| h.body == body && near(h.at));
        (0..s.joints.len()).find(|j| is(*j)).or_else(standing)
    }
}

/// What clauses say.
#[derive(Default)]
struct Given {
    along: Option<[f64; 3]>,
    toward: Option<ExprPoint>,
    thick: Option<f64>,
    deep: Option<f64>,
    clearance_mm: Option<f64>,
}
