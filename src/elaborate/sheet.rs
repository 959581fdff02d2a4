//! First look at a mechanism: its statements sorted by kind and its names declared, nothing evaluated.

use super::codes;
use super::eval::{Env, Evaluator};
use super::scope::{Local, LocalKind, State};
use crate::diagnostic::{Diagnostic, Origin};
use crate::syntax::ast::{self, Expr, Ident, Mechanism, Statement, StatementKind};

/// A body as written.
pub struct BodyText<'a> {
    pub ground: bool,
    pub name: &'a Ident,
    pub points: &'a [Ident],
    pub layer: Option<&'a Expr>,
    pub at: Origin,
}

/// A drive as written.
pub struct DriveText<'a> {
    pub joint: &'a Ident,
    pub profile: &'a ast::Profile,
    pub motor: Option<&'a Ident>,
    pub continuous: bool,
    pub drum: Option<&'a Expr>,
    pub at: Origin,
}

/// A trace as written.
pub struct TraceText<'a> {
    pub name: &'a Ident,
    pub point: &'a Expr,
    pub body: &'a Ident,
    pub at: Origin,
}

/// A requirement as written.
pub struct RequireText<'a> {
    pub left: &'a Expr,
    pub op: ast::Compare,
    pub right: &'a Expr,
    pub at: Origin,
}

/// The statements of a mechanism by kind.
#[derive(Default)]
pub struct Sheet<'a> {
    pub bodies: Vec<BodyText<'a>>,
    pub joints: Vec<(&'a ast::Joint, Origin)>,
    pub material: Option<(&'a Ident, Origin)>,
    pub process: Option<(&'a Ident, Origin)>,
    pub height: Option<(&'a Expr, Origin)>,
    /// Radius of fillets.
    pub fillet: Option<(&'a Expr, Origin)>,
    pub model: Option<(&'a Ident, Origin)>,
    pub cycle: Option<(&'a Expr, Option<&'a Expr>, Origin)>,
    pub drives: Vec<DriveText<'a>>,
    pub strings: Vec<(&'a ast::Cable, Origin)>,
    pub loads: Vec<(&'a ast::Load, Origin)>,
    pub holes: Vec<(&'a ast::Hole, Origin)>,
    pub mounts: Vec<(&'a ast::Fitted, Origin)>,
    pub horns: Vec<(&'a ast::Fitted, Origin)>,
    pub plates: Vec<(&'a ast::Plate, Origin)>,
    pub solids: Vec<(&'a ast::Solid, Origin)>,
    pub rests: Vec<(&'a Ident, &'a Expr, Origin)>,
    pub traces: Vec<TraceText<'a>>,
    /// Traced directions.
    pub directions: Vec<TraceText<'a>>,
    pub outputs: Vec<(&'a Ident, &'a Expr, Origin)>,
    pub workspaces: Vec<(&'a ast::Workspace, Origin)>,
    pub targets: Vec<(&'a Ident, &'a Expr, Origin)>,
    pub minimize: Option<(&'a [ast::Term], Origin)>,
    pub requires: Vec<RequireText<'a>>,
    pub exports: Vec<&'a Expr>,
    pub asserts: Vec<(&'a ast::Assert, Origin)>,
    /// Load cases: what stands in each.
    pub cases: Vec<(&'a Ident, Sheet<'a>, Origin)>,
    pub places: Vec<(&'a ast::Place, Origin)>,
    pub mirrors: Vec<(&'a ast::Mirror, Origin)>,
    /// Something could not be understood: what seems missing may be there.
    pub broken: bool,
    /// Something is not available yet: it may be what seems missing.
    pub later: bool,
}

impl<'a> Evaluator<'a> {
    /// Sorts the statements of a mechanism and declares its names in `scope`.
    pub(super) fn sheet(&mut self, scope: usize, m: &'a Mechanism) -> Sheet<'a> {
        let mut sheet = Sheet::default();
        for s in &m.statements {
            self.statement(scope, s, &mut sheet);
        }
        sheet
    }

    fn statement(&mut self, scope: usize, s: &'a Statement, sheet: &mut Sheet<'a>) {
        let at = s.at;
        match &s.kind {
            StatementKind::Param { name, ty, value } => {
                let path = name.node.clone();
                self.settable.insert(path.clone());
                let env = Env::named(scope, path.as_str());
                let kind = match self.settings.find(&path) {
                    Some((i, set)) => {
                        self.set_used.insert(i);
                        match set {
                            Some(set) => LocalKind::Value {
                                env,
                                value: set,
                                ty: ty.as_ref(),
                                point: false,
                                default: Some((scope, value)),
                            },
                            None => {
                                LocalKind::Value { env, value, ty: ty.as_ref(), point: false, default: None }
                            }
                        }
                    }
                    None => LocalKind::Value { env, value, ty: ty.as_ref(), point: false, default: None },
                };
                self.name_value(scope, name, kind);
            }
            StatementKind::Let { name, value } => {
                let env = Env::named(scope, name.node.as_str());
                self.name_value(
                    scope,
                    name,
                    LocalKind::Value { env, value, ty: None, point: false, default: None },
                );
            }
            StatementKind::Point { name, value } => {
                let env = Env::named(scope, name.node.as_str());
                self.name_value(
                    scope,
                    name,
                    LocalKind::Value { env, value, ty: None, point: true, default: None },
                );
            }
            StatementKind::Body { ground, name, points, layer } => {
                if self.name_thing(scope, name, "body") {
                    let layer = layer.as_ref();
                    sheet.bodies.push(BodyText { ground: *ground, name, points, layer, at });
                }
            }
            StatementKind::Joint(joint) => {
                if self.name_thing(scope, &joint.name, "joint") {
                    sheet.joints.push((joint, at));
                }
            }
            StatementKind::Material(name) => {
                let first = sheet.material.map(|m| m.1);
                if self.once("material", at, first) {
                    sheet.material = Some((name, at));
                }
            }
            StatementKind::PrintOn(name) => {
                let first = sheet.process.map(|m| m.1);
                if self.once("print on", at, first) {
                    sheet.process = Some((name, at));
                }
            }
            StatementKind::Links { height, fillet } => {
                for (word, value, known) in
                    [("links height", height, &mut sheet.height), ("links fillet", fillet, &mut sheet.fillet)]
                {
                    if let Some(value) = value
                        && self.once(word, at, known.map(|m| m.1))
                    {
                        *known = Some((value, at));
                    }
                }
            }
            StatementKind::Model(name) => {
                let first = sheet.model.map(|m| m.1);
                if self.once("model", at, first) {
                    sheet.model = Some((name, at));
                }
            }
            StatementKind::Cycle { steps, over } => {
                let first = sheet.cycle.map(|m| m.2);
                if self.once("cycle", at, first) {
                    sheet.cycle = Some((steps, over.as_ref(), at));
                }
            }
            StatementKind::Drive { joint, profile, motor, continuous, drum } => {
                let (motor, continuous) = (motor.as_ref(), *continuous);
                sheet.drives.push(DriveText { joint, profile, motor, continuous, drum: drum.as_ref(), at });
            }
            StatementKind::String(cable) => {
                if self.name_thing(scope, &cable.name, "string") {
                    sheet.strings.push((cable, at));
                }
            }
            StatementKind::Load(load) => sheet.loads.push((load, at)),
            StatementKind::Hole(hole) => sheet.holes.push((hole, at)),
            StatementKind::Mount(mount) => sheet.mounts.push((mount, at)),
            StatementKind::Horn(horn) => sheet.horns.push((horn, at)),
            StatementKind::Plate(plate) => sheet.plates.push((plate, at)),
            StatementKind::Solid(solid) => sheet.solids.push((solid, at)),
            StatementKind::Rest { joint, value } => sheet.rests.push((joint, value, at)),
            StatementKind::Trace { name, direction: true, point, body } => {
                if self.name_thing(scope, name, "direction") {
                    sheet.directions.push(TraceText { name, point, body, at });
                }
            }
            StatementKind::Output { name, value } => {
                if self.name_thing(scope, name, "output") {
                    sheet.outputs.push((name, value, at));
                }
            }
            StatementKind::Workspace(w) => sheet.workspaces.push((w, at)),
            StatementKind::Target { trace, value } => sheet.targets.push((trace, value, at)),
            StatementKind::Trace { name, point, body, .. } => {
                if self.name_thing(scope, name, "trace") {
                    sheet.traces.push(TraceText { name, point, body, at });
                }
            }
            StatementKind::Minimize(terms) => {
                let first = sheet.minimize.map(|m| m.1);
                if self.once("minimize", at, first) {
                    sheet.minimize = Some((terms, at));
                }
            }
            StatementKind::Require { left, op, right } => {
                sheet.requires.push(RequireText { left, op: op.node, right, at });
            }
            StatementKind::Export(list) => sheet.exports.extend(list),
            StatementKind::Place(place) => {
                if self.name_thing(scope, &place.name, "instance") {
                    sheet.places.push((place, at));
                }
            }
            StatementKind::Mirror(mirror) => {
                if self.name_thing(scope, &mirror.name, "instance") {
                    sheet.mirrors.push((mirror, at));
                }
            }
            StatementKind::Assert(assert) => sheet.asserts.push((assert, at)),
            StatementKind::Case(case) => {
                if self.name_thing(scope, &case.name, "load case") {
                    let mut inner = Sheet::default();
                    case.statements.iter().for_each(|s| self.statement(scope, s, &mut inner));
                    sheet.broken |= inner.broken;
                    sheet.later |= inner.later;
                    sheet.cases.push((&case.name, inner, at));
                }
            }
            // Variants are set from outside; what is repeated has been written out.
            StatementKind::Variant(_) | StatementKind::For(_) => {}
            StatementKind::Rod(_) | StatementKind::OwnBody { .. } => self.out.push(
                Diagnostic::error(codes::MISPLACED, "this stands in a `flexure`, not in a mechanism", at)
                    .help("declare `flexure NAME replaces hinge { … }` and use it with `as NAME`"),
            ),
            StatementKind::Allow(_) => {}
            StatementKind::Later { keyword } => {
                sheet.later = true;
                let _: Result<(), _> = self.later(codes::LATER_STATEMENT, &keyword.node, keyword.at);
            }
            StatementKind::Broken { words } => {
                sheet.broken = true;
                self.half_said.extend(words.iter().cloned());
            }
        }
    }

    fn name_value(&mut self, scope: usize, name: &Ident, kind: LocalKind<'a>) {
        let local = Local { name: name.node.clone(), at: name.at, kind, state: State::Waiting };
        self.declare(scope, local);
    }

    fn name_thing(&mut self, scope: usize, name: &Ident, kind: &'static str) -> bool {
        let local = Local {
            name: name.node.clone(),
            at: name.at,
            kind: LocalKind::Thing(kind),
            state: State::Waiting,
        };
        self.declare(scope, local).is_some()
    }

    /// Reports a statement that stands a second time.
    fn once(&mut self, what: &str, at: Origin, first: Option<Origin>) -> bool {
        let Some(first) = first else { return true };
        self.out.push(
            Diagnostic::error(codes::REPEATED, format!("`{what}` may stand only once"), at)
                .label("again here")
                .also(first, "first here"),
        );
        false
    }
}
