//! Traced directions, `output`s and the angles of bodies that requirements ask for.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use super::mechanism::Outside;
use super::scope::LocalKind;
use super::sheet::{Sheet, TraceText};
use super::structure::Structure;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Aims, BodyAngle, Design, Direction};
use crate::syntax::ast::{Argument, Expr, ExprKind, Ident};
use std::collections::BTreeMap;

/// What is known of a mechanism's aims.
#[derive(Default)]
pub(super) struct AimNames {
    /// Bodies by name.
    bodies: BTreeMap<String, usize>,
    /// Traces by name.
    pub traces: BTreeMap<String, usize>,
    /// Directions by name.
    pub directions: BTreeMap<String, usize>,
    /// Outputs by name: indices into the angles.
    pub outputs: BTreeMap<String, usize>,
    /// Steps of the cycle, where they are known.
    pub steps: Option<usize>,
    /// What has been made.
    pub made: Aims,
}

impl AimNames {
    /// Those of a placed design.
    pub fn of(design: &Design) -> Self {
        let outputs = design.aims.angles.iter().enumerate().filter_map(|(i, a)| Some((a.name.clone()?, i)));
        let directions = design.aims.directions.iter().enumerate().map(|(i, d)| (d.name.clone(), i));
        Self {
            bodies: design.bodies.iter().enumerate().map(|(i, b)| (b.name.clone(), i)).collect(),
            traces: design.traces.iter().enumerate().map(|(i, t)| (t.name.clone(), i)).collect(),
            directions: directions.collect(),
            outputs: outputs.collect(),
            steps: Some(design.cycle.steps),
            made: design.aims.clone(),
        }
    }
}

impl<'a> Evaluator<'a> {
    /// Directions, outputs and targets of a mechanism.
    pub(super) fn aims(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        s: &Structure<'a>,
        traces: &BTreeMap<String, usize>,
        steps: Option<usize>,
        outside: &Outside<'_>,
    ) {
        self.aims =
            AimNames { bodies: s.body_index.clone(), traces: traces.clone(), steps, ..AimNames::default() };
        for text in &sheet.directions {
            if let Ok(d) = self.traced_direction(scope, text) {
                self.aims.directions.insert(d.name.clone(), self.aims.made.directions.len());
                self.aims.made.directions.push(d);
            }
        }
        for (name, value, at) in &sheet.outputs {
            if let Ok(index) = self.output(scope, name, value, *at) {
                self.aims.outputs.insert(name.node.clone(), index);
            }
        }
        self.targets(scope, sheet, traces, outside);
    }

    fn traced_direction(&mut self, scope: usize, text: &TraceText<'a>) -> Outcome<Direction> {
        let bodies = self.aims.bodies.clone();
        let body = self.thing(scope, &bodies, text.body, "body");
        let (what, help) = ("a traced direction", "write `direction z` or `direction (0, 0, 1)`");
        let direction = self.unit_direction(scope, text.point, what, help);
        Ok(Direction { name: text.name.node.clone(), body: body?, direction: direction?, origin: text.at })
    }

    fn output(&mut self, scope: usize, name: &Ident, value: &'a Expr, at: Origin) -> Outcome<usize> {
        match &value.kind {
            ExprKind::Call { function, arguments } if function.node == "angle" => {
                self.angle(scope, function, arguments, Some(name), at)
            }
            ExprKind::Broken => Err(Failed),
            _ => self.fail(
                Diagnostic::error(codes::TYPE, "an output is the angle of a body", value.at)
                    .help("write for instance `output curl = angle(distal about z)`"),
            ),
        }
    }

    /// Index of the angle of a body that `angle(BODY about D)` asks for.
    pub(super) fn angle(
        &mut self,
        scope: usize,
        function: &Ident,
        arguments: &'a [Argument],
        name: Option<&Ident>,
        at: Origin,
    ) -> Outcome<usize> {
        let slots = self.arguments(function, arguments, &["body about axis"], 1)?;
        let Some(only) = slots.first().copied().flatten() else { return Err(Failed) };
        let ExprKind::About { body, axis } = &only.kind else {
            if matches!(only.kind, ExprKind::Broken) {
                return Err(Failed);
            }
            return self.fail(
                Diagnostic::error(codes::ARGUMENTS, "`angle` takes a body and an axis", only.at)
                    .help("write `angle(BODY about z)`"),
            );
        };
        let bodies = self.aims.bodies.clone();
        let body = self.thing(scope, &bodies, body, "body");
        let help = "write `angle(BODY about z)` or `angle(BODY about (0, 1, 0))`";
        let axis = self.unit_direction(scope, axis, "an axis", help);
        let name = name.map(|n| n.node.clone());
        let made = BodyAngle { name, body: body?, axis: axis?, origin: at };
        let angles = &mut self.aims.made.angles;
        let same = |a: &BodyAngle| a.body == made.body && a.axis == made.axis;
        if made.name.is_none()
            && let Some(i) = angles.iter().position(same)
        {
            return Ok(i);
        }
        angles.push(made);
        Ok(angles.len() - 1)
    }

    /// Whether a name is declared as a thing of this kind, well or badly.
    pub(super) fn is_thing(&self, scope: usize, name: &Ident, kind: &str) -> bool {
        let local = self.scopes.get(scope).and_then(|s| s.locals.get(*s.index.get(&name.node)?));
        local.is_some_and(|l| matches!(l.kind, LocalKind::Thing(k) if k == kind))
    }
}
