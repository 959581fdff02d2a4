//! `workspace`: which outputs are aimed at by which drives; and the arguments of motor code.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Evaluator, Failed, Outcome};
use super::sheet::{DriveText, Sheet};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{CodeKind, Drive, DriveUnit, Export, ExportKind, Stretch, Wanted, Workspace};
use crate::syntax::ast::{self, Argument, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// Steps where none are written, of one drive and of each of two.
const STEPS: [usize; 2] = [32, 12];
/// Most steps, likewise: the table is to fit a microcontroller's flash.
const MOST_STEPS: [usize; 2] = [512, 24];

impl<'a> Evaluator<'a> {
    pub(super) fn workspaces(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        driven: &BTreeMap<String, usize>,
        drives: Option<&[Drive]>,
    ) {
        for (text, at) in &sheet.workspaces {
            if let Ok(made) = self.workspace(scope, text, *at, driven, drives) {
                self.aims.made.workspaces.push(made);
            }
        }
    }

    fn workspace(
        &mut self,
        scope: usize,
        text: &'a ast::Workspace,
        at: Origin,
        driven: &BTreeMap<String, usize>,
        drives: Option<&[Drive]>,
    ) -> Outcome<Workspace> {
        let n = text.stretches.len();
        if text.wanted.len() != n || !(1..=2).contains(&n) {
            return self.fail(
                Diagnostic::error(codes::WORKSPACE, "a workspace has as many outputs as drives", at)
                    .label(format!("{} and {n}", text.wanted.len()))
                    .help("write `workspace curl by cable from 0 mm to 5 mm`, or two outputs and two drives"),
            );
        }
        let wanted: Vec<Wanted> =
            text.wanted.iter().map(|e| self.wanted(scope, e)).collect::<Outcome<Vec<_>>>()?;
        let mut stretches: Vec<Stretch> = Vec::new();
        for s in &text.stretches {
            let drive = self.drive_named(scope, &s.drive, driven)?;
            let unit = drives.and_then(|d| d.get(drive)).ok_or(Failed)?.unit;
            let dimension = match unit {
                DriveUnit::Rad => Dimension::ANGLE,
                DriveUnit::Mm => Dimension::LENGTH,
            };
            let from = self.eval_fixed(scope, &s.from, dimension, "the workspace's start")?;
            let to = self.eval_fixed(scope, &s.to, dimension, "the workspace's end")?;
            let steps = match &s.steps {
                Some(e) => self.eval_fixed(scope, e, Dimension::NUMBER, "the number of steps")?,
                None => STEPS.get(n - 1).copied().unwrap_or_default() as f64,
            };
            let most = MOST_STEPS.get(n - 1).copied().unwrap_or_default();
            if steps.fract() != 0.0 || !(2.0..=most as f64).contains(&steps) {
                return self.fail(
                    Diagnostic::error(codes::COUNT, "the number of steps must be a whole number", at)
                        .label(format!("from 2 to {most}")),
                );
            }
            let twice = stretches.iter().any(|s| s.drive == drive);
            if from >= to || twice {
                let message = match twice {
                    true => "a workspace's two drives must be different",
                    false => "a workspace's drive must go from the smaller value to the larger",
                };
                return self.fail(Diagnostic::error(codes::WORKSPACE, message, s.drive.at));
            }
            stretches.push(Stretch { drive, from, to, steps: steps as usize });
        }
        Ok(Workspace { wanted, stretches, origin: at })
    }

    /// `steering`, `tip.x`
    fn wanted(&mut self, scope: usize, e: &'a Expr) -> Outcome<Wanted> {
        let path = match &e.kind {
            ExprKind::Name(path) => path.as_slice(),
            _ => return Err(Failed),
        };
        if let [output] = path {
            let outputs = self.aims.outputs.clone();
            return self.thing(scope, &outputs, output, "output").map(Wanted::Angle);
        }
        let [of, component] = path else { return self.no_component(e.at) };
        let Some(axis) = ["x", "y", "z"].iter().position(|a| *a == component.node) else {
            return self.no_component(component.at);
        };
        if let Some(direction) = self.aims.directions.get(&of.node) {
            return Ok(Wanted::Direction { direction: *direction, axis });
        }
        let traces = self.aims.traces.clone();
        self.thing(scope, &traces, of, "trace").map(|trace| Wanted::Place { trace, axis })
    }

    fn no_component<T>(&mut self, at: Origin) -> Outcome<T> {
        self.fail(
            Diagnostic::error(codes::WORKSPACE, "an output or a component of a trace is needed", at)
                .help("such as `curl`, `tip.x` or `gaze.y`"),
        )
    }

    /// `micropython`, `arduino(yaw, pitch)`: of all drives where none is named.
    pub(super) fn code_export(
        &mut self,
        scope: usize,
        name: &'a Ident,
        args: &'a [Argument],
        drives: &BTreeMap<String, usize>,
        texts: &[DriveText<'a>],
        at: Origin,
    ) -> Outcome<Export> {
        let Some(kind) = CodeKind::named(&name.node) else { return Err(Failed) };
        let mut chosen = Vec::new();
        for a in args {
            let drive = self.plain_name(Some(&a.value), "drive")?;
            let index = self.drive_named(scope, drive, drives)?;
            if chosen.contains(&index) {
                return self.fail(Diagnostic::error(codes::EXPORT, "this drive is named twice", drive.at));
            }
            chosen.push(index);
        }
        for text in texts.iter().filter(|_| kind.needs_motors()) {
            let asked = args.is_empty() || drives.get(&text.joint.node).is_some_and(|i| chosen.contains(i));
            if asked && text.motor.is_none() {
                let message = format!("`{}` has no motor to write code for", text.joint.node);
                return self.fail(
                    Diagnostic::error(codes::EXPORT, message, at)
                        .also(text.at, "driven here")
                        .help("write `drive … with sg90`, or name the drives that have one"),
                );
            }
        }
        Ok(Export { kind: ExportKind::Code(kind, chosen), origin: at })
    }
}
