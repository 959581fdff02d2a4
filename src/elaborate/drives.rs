//! Drives and their rest values.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::{DriveText, Sheet};
use super::structure::Structure;
use crate::diagnostic::Diagnostic;
use crate::ir::expr::ExprId;
use crate::ir::{Drive, DriveOn, DriveUnit, JointKind, MotorInterface};
use crate::syntax::ast::{Expr, Ident};

impl<'a> Evaluator<'a> {
    pub(super) fn drives(
        &mut self,
        scope: usize,
        module: usize,
        sheet: &Sheet<'a>,
        s: &Structure<'a>,
    ) -> Outcome<Vec<Drive>> {
        let mut out: Vec<Drive> = Vec::new();
        let mut ok = Ok(());
        let at = sheet.drives.get(1).map(|d| d.at).or(sheet.rests.get(1).map(|r| r.2)).unwrap_or_default();
        self.limit(sheet.drives.len().max(sheet.rests.len()), "drives", at)?;
        for text in &sheet.drives {
            match self.drive(scope, module, text, s, &out) {
                Ok(d) => out.push(d),
                Err(Failed) => ok = Err(Failed),
            }
        }
        for (i, (name, value, at)) in sheet.rests.iter().enumerate() {
            if sheet.later && !self.is_declared(scope, name) {
                // It may be the value of a statement that is not available yet.
                ok = Err(Failed);
                continue;
            }
            let rest = self.rest(scope, name, value);
            let earlier = sheet.rests.iter().take(i).find(|(n, ..)| n.node == name.node);
            if let Some((_, _, first)) = earlier {
                ok = self.fail(
                    Diagnostic::error(
                        codes::REPEATED,
                        format!("`rest {}` may stand only once", name.node),
                        *at,
                    )
                    .label("again here")
                    .also(*first, "first here"),
                );
                continue;
            }
            let Ok(on) = self.driven(scope, s, name) else {
                ok = Err(Failed);
                continue;
            };
            match out.iter_mut().find(|d| d.on == on) {
                Some(drive) => match rest {
                    Ok((start, free)) => (drive.rest, drive.free_rest) = (start, free),
                    Err(Failed) => ok = Err(Failed),
                },
                // A drive that is wrong itself has been reported.
                None if sheet.drives.iter().any(|d| d.joint.node == name.node) => ok = Err(Failed),
                None => {
                    ok = self.fail(
                        Diagnostic::error(
                            codes::REST,
                            format!("joint `{}` is not driven", name.node),
                            name.at,
                        )
                        .help("`rest` says at which value of its drive the part is printed"),
                    );
                }
            }
        }
        ok.map(|()| out)
    }

    fn is_declared(&self, scope: usize, name: &Ident) -> bool {
        self.scopes.get(scope).is_some_and(|s| s.index.contains_key(&name.node))
    }

    /// Value at the start of the free variables, and the expression if it depends on one.
    fn rest(&mut self, scope: usize, name: &Ident, value: &'a Expr) -> Outcome<(f64, Option<ExprId>)> {
        let dimension = match self.sliders.contains(&name.node) {
            true => Dimension::LENGTH,
            false => Dimension::ANGLE,
        };
        let env = Env::named(scope, format!("{}.rest", name.node));
        let id = self.eval_scalar(&env, value, dimension, "the rest value")?;
        let start = self.start_value(id);
        if !start.is_finite() {
            return self.fail(
                Diagnostic::error(
                    codes::NOT_FINITE,
                    "the rest value is not finite at the start values",
                    value.at,
                )
                .label("a division by zero, or a root of a negative number"),
            );
        }
        Ok((start, self.exprs.is_free(id).then_some(id)))
    }

    fn drive(
        &mut self,
        scope: usize,
        module: usize,
        text: &DriveText<'a>,
        s: &Structure<'a>,
        before: &[Drive],
    ) -> Outcome<Drive> {
        let on = self.driven(scope, s, text.joint);
        let joint = match on {
            Ok(DriveOn::Joint(joint)) => s.joints.get(joint),
            Ok(DriveOn::String(_)) | Err(Failed) => None,
        };
        let unit = match joint {
            Some(joint) => self.drive_unit(joint.kind, text.joint),
            None if self.sliders.contains(&text.joint.node) => Ok(DriveUnit::Mm),
            None => Ok(DriveUnit::Rad),
        };
        let profile = match unit {
            Ok(unit) => self.profile(scope, text.profile, unit),
            Err(Failed) => Err(Failed),
        };
        let motor = match text.motor {
            None => Ok(None),
            Some(name) => {
                self.record_named(module, name, "motor").and_then(|item| self.motor(item).map(Some))
            }
        };
        let drum = text.drum.map(|e| self.unscaled(|s| s.drum(scope, e))).transpose();
        let (on, unit, profile, motor, drum_radius_mm) = (on?, unit?, profile?, motor?, drum?);
        if let Some(first) = before.iter().find(|d| d.on == on) {
            return self.fail(
                Diagnostic::error(codes::REPEATED, format!("`{}` is driven twice", text.joint.node), text.at)
                    .label("again here")
                    .also(first.origin, "first here"),
            );
        }
        if let (DriveUnit::Mm, Some(name), None) = (unit, text.motor, text.drum) {
            return self.fail(
                Diagnostic::error(
                    codes::DRUM,
                    format!("`{}` slides: a motor moves it by a drum", text.joint.node),
                    name.at,
                )
                .help(format!("write `with {} drum 8 mm`, its diameter, or leave out `with …`", name.node)),
            );
        }
        if let (DriveUnit::Rad, Some(drum)) = (unit, text.drum) {
            return self.fail(
                Diagnostic::error(
                    codes::DRUM,
                    format!("`{}` turns: it needs no drum", text.joint.node),
                    drum.at,
                )
                .help("leave out `drum …`"),
            );
        }
        let range = motor.as_ref().and_then(|m| match m.interface {
            MotorInterface::Stepper { .. } => None,
            MotorInterface::Pwm { range_rad } | MotorInterface::Dynamixel { range_rad } => Some(range_rad),
        });
        let span = super::profiles::span(&profile) / drum_radius_mm.unwrap_or(1.0);
        if let Some(range) = range
            && !text.continuous
            && span > range * (1.0 + 1e-9)
        {
            return self.fail(
                Diagnostic::error(codes::MOTOR_RANGE, "the drive goes beyond its motor's range", text.at)
                    .label(format!(
                        "turns {}, the motor {}",
                        self.show(span, Dimension::ANGLE),
                        self.show(range, Dimension::ANGLE)
                    ))
                    .help("if this motor turns without end, write `continuous` after its name"),
            );
        }
        Ok(Drive {
            name: text.joint.node.clone(),
            on,
            unit,
            profile,
            rest: 0.0,
            free_rest: None,
            motor,
            continuous: text.continuous,
            drum_radius_mm,
            origin: text.at,
        })
    }

    /// The joint or string of a name.
    fn driven(&mut self, scope: usize, s: &Structure<'a>, name: &Ident) -> Outcome<DriveOn> {
        if self.cables.contains(&name.node) {
            return self.thing(scope, &s.string_index, name, "string").map(DriveOn::String);
        }
        self.thing(scope, &s.joint_index, name, "joint").map(DriveOn::Joint)
    }

    /// Radius of a drum, mm.
    fn drum(&mut self, scope: usize, e: &'a Expr) -> Outcome<f64> {
        let diameter = self.eval_fixed(scope, e, Dimension::LENGTH, "the drum's diameter")?;
        if diameter <= 0.0 {
            return self.fail(Diagnostic::error(codes::SIZE, "the drum's diameter must be positive", e.at));
        }
        Ok(diameter / 2.0)
    }

    /// What a drive of a joint of this kind is measured in.
    fn drive_unit(&mut self, kind: JointKind, name: &Ident) -> Outcome<DriveUnit> {
        match kind {
            JointKind::Hinge => Ok(DriveUnit::Rad),
            JointKind::Slider => Ok(DriveUnit::Mm),
            _ => self.fail(
                Diagnostic::error(
                    codes::NOT_DRIVEN,
                    format!("a {} joint cannot be driven", kind.name()),
                    name.at,
                )
                .help("hinges and sliders can"),
            ),
        }
    }
}
