//! Time, traces and exports of a mechanism.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::sheet::{DriveText, Sheet, TraceText};
use super::structure::Structure;
use crate::diagnostic::Diagnostic;
use crate::ir::{CodeKind, Cycle, Export, ExportKind, Trace};
use crate::syntax::ast::{Argument, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// Most steps of a cycle.
const MAX_STEPS: f64 = 100_000.0;
/// What can be exported.
pub const EXPORTS: &[&str] = &[
    "stl",
    "3mf",
    "sheet",
    "dxf",
    "glb",
    "svg",
    "png",
    "report",
    "arduino",
    "dynamixel",
    "micropython",
    "c",
    "csv",
    "json",
    "ros2",
];
const LATER_EXPORTS: &[&str] = &["step"];

impl<'a> Evaluator<'a> {
    pub(super) fn cycle(&mut self, scope: usize, sheet: &Sheet<'a>, steps: Option<usize>) -> Outcome<Cycle> {
        let Some((text, over, at)) = sheet.cycle else { return Err(Failed) };
        let written = self.eval_fixed(scope, text, Dimension::NUMBER, "the number of steps")?;
        if written < 1.0 || written.fract() != 0.0 || written > MAX_STEPS {
            return self.fail(
                Diagnostic::error(codes::COUNT, "the number of steps must be a whole number", text.at)
                    .label(format!("from 1 to {MAX_STEPS}")),
            );
        }
        if let Some(n) = steps
            && (n == 0 || n as f64 > MAX_STEPS)
        {
            return self.fail(Diagnostic::error(
                codes::COUNT,
                format!("`--steps {n}` is not from 1 to {MAX_STEPS}"),
                at,
            ));
        }
        let duration_s = match over {
            Some(e) => {
                let t = self.eval_fixed(scope, e, Dimension::TIME, "the duration")?;
                if t <= 0.0 {
                    return self.fail(Diagnostic::error(codes::COUNT, "the duration must be positive", e.at));
                }
                t
            }
            None => 1.0,
        };
        Ok(Cycle { steps: steps.unwrap_or(written as usize), duration_s, origin: at })
    }

    pub(super) fn trace(&mut self, scope: usize, text: &TraceText<'a>, s: &Structure<'a>) -> Outcome<Trace> {
        let body = self.thing(scope, &s.body_index, text.body, "body");
        let point = self.eval(&Env::fixed(scope), text.point).and_then(|v| self.as_point(v, text.point));
        Ok(Trace { name: text.name.node.clone(), body: body?, point: point?, origin: text.at })
    }

    pub(super) fn unknown_of<T>(&mut self, name: &Ident, what: &str, known: &[&str]) -> Outcome<T> {
        let d = Diagnostic::error(
            codes::UNKNOWN_FUNCTION,
            format!("there is no {what} `{}`", name.node),
            name.at,
        );
        self.fail(match super::names::suggestion(&name.node, known.iter().copied()) {
            Some(near) => super::lookup::meant(d, name, &near),
            None => d.help(format!("there are {}", known.join(", "))),
        })
    }

    pub(super) fn trace_argument(
        &mut self,
        scope: usize,
        e: Option<&'a Expr>,
        traces: &BTreeMap<String, usize>,
    ) -> Outcome<usize> {
        let name = self.plain_name(e, "trace")?;
        self.thing(scope, traces, name, "trace")
    }

    pub(super) fn plain_name(&mut self, e: Option<&'a Expr>, what: &str) -> Outcome<&'a Ident> {
        let Some(e) = e else { return Err(Failed) };
        match &e.kind {
            ExprKind::Name(path) if path.len() == 1 => path.first().ok_or(Failed),
            ExprKind::Broken => Err(Failed),
            ExprKind::Name(path) => {
                let name: Vec<&str> = path.iter().map(|p| p.node.as_str()).collect();
                self.later(codes::LATER_TERM, &name.join("."), e.at)
            }
            _ => self.fail(Diagnostic::error(codes::TYPE, format!("the name of a {what} is needed"), e.at)),
        }
    }

    pub(super) fn export(
        &mut self,
        scope: usize,
        e: &'a Expr,
        drives: &BTreeMap<String, usize>,
        texts: &[DriveText<'a>],
    ) -> Outcome<Export> {
        let (name, args): (&'a Ident, &'a [Argument]) = match &e.kind {
            ExprKind::Name(path) if path.len() == 1 => (path.first().ok_or(Failed)?, &[]),
            ExprKind::Call { function, arguments } => (function, arguments),
            ExprKind::Broken => return Err(Failed),
            _ => {
                return self.fail(
                    Diagnostic::error(codes::EXPORT, "the name of an export is needed", e.at)
                        .help("such as `stl` or `arduino(motor)`"),
                );
            }
        };
        match name.node.as_str() {
            "stl" => {
                let slots = self.arguments(name, args, &["place"], 0)?;
                let kind = match slots.first().copied().flatten() {
                    None => ExportKind::Stl,
                    place => match self.plain_name(place, "place")? {
                        at if at.node == "assembled" => ExportKind::StlAssembled,
                        other => return self.unknown_of(other, "place of parts", &["assembled"]),
                    },
                };
                Ok(Export { kind, origin: e.at })
            }
            plain @ ("glb" | "3mf" | "threemf" | "sheet" | "dxf" | "svg" | "png" | "report") => {
                self.arguments(name, args, &[], 0)?;
                let kind = match plain {
                    "glb" => ExportKind::Glb,
                    "3mf" | "threemf" => ExportKind::ThreeMf,
                    "sheet" => ExportKind::Sheet,
                    "dxf" => ExportKind::Dxf,
                    "svg" => ExportKind::Svg,
                    "report" => ExportKind::Report,
                    _ => ExportKind::Png,
                };
                Ok(Export { kind, origin: e.at })
            }
            code if CodeKind::named(code).is_some() && !(code == "arduino" && args.len() == 1) => {
                self.code_export(scope, name, args, drives, texts, e.at)
            }
            "arduino" => {
                let slots = self.arguments(name, args, &["drive"], 1)?;
                let drive = self.plain_name(slots.first().copied().flatten(), "drive")?;
                let index = self.drive_named(scope, drive, drives)?;
                let drum = texts.iter().any(|d| d.joint.node == drive.node && d.drum.is_some());
                if self.sliders.contains(&drive.node) && !drum {
                    return self.fail(
                        Diagnostic::error(
                            codes::EXPORT,
                            "this drive slides, and no drum says how a motor turns for it",
                            drive.at,
                        )
                        .help("write `drive … with nema17 drum 8 mm`"),
                    );
                }
                if texts.iter().any(|d| d.joint.node == drive.node && d.motor.is_none()) {
                    return self.fail(
                        Diagnostic::error(
                            codes::EXPORT,
                            "this drive has no motor to write code for",
                            drive.at,
                        )
                        .help("write `drive … with nema17`"),
                    );
                }
                Ok(Export { kind: ExportKind::Arduino(index), origin: e.at })
            }
            later if LATER_EXPORTS.contains(&later) => {
                let later = later.to_string();
                self.later(codes::LATER_TERM, &later, name.at)
            }
            _ => self.unknown_of(name, "export", EXPORTS),
        }
    }
}
