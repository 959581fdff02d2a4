//! Templates: `as crossed_leaves { … }` becomes rods between the joint's bodies, once per joint.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::load::item_kind;
use super::members::Members;
use super::scope::{Local, LocalKind, State};
use super::value::{ItemRef, Scalar, Value};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Body, BodyId, JointId, JointKind, Rod, RodEnd, Section};
use crate::syntax::ast::{self, Expr, ExprKind, Flexure, Ident, Item, Statement, StatementKind, TemplateUse};

/// Most rods of a design.
const MAX_RODS: usize = 1024;

/// What the compiler tells a template about the joint it replaces.
pub struct Site<'s> {
    /// Name of the joint: the first part of every path.
    pub joint_name: &'s str,
    pub joint: JointId,
    pub bodies: &'s [BodyId],
    /// The joint's.
    pub layer: i32,
    /// The joint statement.
    pub statement: Origin,
    /// Kind written in the text.
    pub kind: &'s str,
    pub shorter_link_mm: f64,
    pub layer_height_mm: f64,
    /// None: wrong or missing, which has been reported.
    pub process: Option<ItemRef>,
}

impl<'a> Evaluator<'a> {
    /// Elaborates one use of a template; returns its rods, and adds its own bodies. What goes wrong inside the template also
    /// points at this use.
    pub(super) fn template(
        &mut self,
        scope: usize,
        module: usize,
        text: &'a TemplateUse,
        site: &Site<'_>,
        (rods, bodies): (&mut Vec<Rod>, &mut Vec<Body>),
    ) -> Outcome<Vec<usize>> {
        let before = self.out.len();
        let made = self.instance(scope, module, text, site, (rods, bodies));
        let (here, s) = (text.name.at, site.statement);
        let near = |at: Origin| at.file == s.file && s.start <= at.start && at.end <= s.end;
        for d in self.out.iter_mut().skip(before) {
            if d.labels.first().is_some_and(|l| !near(l.at)) {
                d.labels.push(crate::diagnostic::Label {
                    at: here,
                    text: format!("in this use, joint `{}`", site.joint_name),
                });
            }
        }
        made
    }

    fn instance(
        &mut self,
        scope: usize,
        module: usize,
        text: &'a TemplateUse,
        site: &Site<'_>,
        (rods, bodies): (&mut Vec<Rod>, &mut Vec<Body>),
    ) -> Outcome<Vec<usize>> {
        let (owner, flexure) = self.flexure(scope, module, &text.name)?;
        let made = [JointKind::Hinge, JointKind::Ball, JointKind::Universal, JointKind::Slider];
        if !made.iter().any(|k| k.name() == site.kind) && flexure.replaces.node == site.kind {
            let message = format!("a flexure for a {} joint is not available yet", site.kind);
            return self.fail(
                Diagnostic::error(codes::LATER_JOINT, message, text.name.at)
                    .help("leave out `as …`: the joint then stays conventional"),
            );
        }
        if flexure.replaces.node != site.kind {
            return self.fail(
                Diagnostic::error(
                    codes::TEMPLATE_KIND,
                    format!(
                        "`{}` replaces a {}, this joint is a {}",
                        flexure.name.node, flexure.replaces.node, site.kind
                    ),
                    text.name.at,
                )
                .also(flexure.replaces.at, "declared here"),
            );
        }
        self.limit(text.overrides.len(), "overrides", text.name.at)?;
        let inner = self.scope(owner);
        self.given_names(inner, site, text.name.at)?;
        let mut ok = self.check_overrides(&flexure.name.node, &flexure.statements, &text.overrides);
        for s in &flexure.statements {
            match &s.kind {
                StatementKind::Param { name, ty, value } => {
                    self.template_param(scope, inner, (name, ty.as_ref(), value), text, site.joint_name);
                }
                StatementKind::Let { name, value } => {
                    let env = Env::named(inner, format!("{}.{}", site.joint_name, name.node));
                    let kind = LocalKind::Value { env, value, ty: None, point: false, default: None };
                    self.declare(
                        inner,
                        Local { name: name.node.clone(), at: name.at, kind, state: State::Waiting },
                    );
                }
                StatementKind::Rod(_) | StatementKind::OwnBody { .. } | StatementKind::Allow(_) => {}
                StatementKind::Broken { .. } => ok = Err(Failed),
                StatementKind::Later { keyword } => {
                    ok = self.later(codes::LATER_STATEMENT, &keyword.node, keyword.at);
                }
                _ => {
                    ok = self.fail(
                        Diagnostic::error(codes::MISPLACED, "this does not belong in a flexure", s.at)
                            .help("a flexure holds `param`, `let`, `body` and `rod`"),
                    );
                }
            }
        }
        let (members, joined) = self.members(inner, flexure, text.name.at, site, bodies);
        ok = ok.and(joined);
        for i in 0..self.scopes.get(inner).map_or(0, |s| s.locals.len()) {
            let local = self.scopes.get(inner).and_then(|s| s.locals.get(i));
            let Some(at) = local.filter(|l| !matches!(l.kind, LocalKind::Thing(_))).map(|l| l.at) else {
                continue;
            };
            if self.force(inner, i, at).is_err() {
                ok = Err(Failed);
            }
        }
        let Some(members) = members else { return Err(Failed) };
        let mut made = Vec::new();
        let mut names: Vec<&Ident> = Vec::new();
        for s in &flexure.statements {
            let StatementKind::Rod(rod) = &s.kind else { continue };
            if let Some(first) = names.iter().find(|n| n.node == rod.name.node) {
                ok = self.fail(
                    Diagnostic::error(
                        codes::DUPLICATE,
                        format!("rod `{}` stands twice", rod.name.node),
                        rod.name.at,
                    )
                    .label("again here")
                    .also(first.at, "first here"),
                );
                continue;
            }
            names.push(&rod.name);
            if rods.len() >= MAX_RODS {
                return self.fail(Diagnostic::error(
                    codes::TOO_LARGE,
                    format!("more than {MAX_RODS} rods"),
                    text.name.at,
                ));
            }
            match self.rod(inner, rod, s.at, site, &members) {
                Ok(rod) => {
                    made.push(rods.len());
                    rods.push(rod);
                }
                Err(Failed) => ok = Err(Failed),
            }
        }
        if names.is_empty() && ok.is_ok() {
            return self.fail(Diagnostic::error(
                codes::MISSING,
                format!("flexure `{}` has no rod", flexure.name.node),
                flexure.name.at,
            ));
        }
        ok.map(|()| made)
    }

    fn flexure(&mut self, scope: usize, module: usize, name: &Ident) -> Outcome<(usize, &'a Flexure)> {
        let Some(item) = self.top_level(module, name) else {
            return self.unknown_item(scope, name, "flexure");
        };
        match self.program.item(item) {
            Some(Item::Flexure(f)) => Ok((item.0, f)),
            Some(other) => {
                let is = item_kind(other).to_string();
                self.wrong_kind(name, &is, "a flexure")
            }
            None => Err(Failed),
        }
    }

    fn given_names(&mut self, inner: usize, site: &Site<'_>, at: Origin) -> Outcome<()> {
        let shorter = self.constant(site.shorter_link_mm, at)?;
        let height = self.constant(site.layer_height_mm, at)?;
        let length = |id| State::Done(Value::Scalar(Scalar { id, dim: Dimension::LENGTH }));
        let process = site.process.map_or(State::Failed, |item| State::Done(Value::Record(item)));
        for (name, state) in
            [("shorter_link", length(shorter)), ("layer_height", length(height)), ("process", process)]
        {
            let local = Local { name: name.into(), at: Origin::default(), kind: LocalKind::Given, state };
            self.declare(inner, local);
        }
        Ok(())
    }

    fn template_param(
        &mut self,
        outer: usize,
        inner: usize,
        (name, ty, value): (&'a Ident, Option<&'a Ident>, &'a Expr),
        text: &'a TemplateUse,
        joint: &str,
    ) {
        let path = format!("{joint}.{}", name.node);
        let private = name.node.starts_with('_');
        if !private {
            self.settable.insert(path.clone());
        }
        let set = self.settings.find(&path).filter(|_| !private);
        let given = text.overrides.iter().find(|(n, _)| n.node == name.node && !private);
        // `--set` beats an override, an override beats the default.
        let (scope, expr) = match (set, given) {
            (Some((i, set)), _) => {
                self.set_used.insert(i);
                (outer, set)
            }
            (None, Some((_, e))) => (outer, Some(e)),
            (None, None) => (inner, None),
        };
        let kind = match expr {
            Some(expr) => LocalKind::Value {
                env: Env::named(scope, path),
                value: expr,
                ty,
                point: false,
                default: Some((inner, value)),
            },
            None => LocalKind::Value { env: Env::named(inner, path), value, ty, point: false, default: None },
        };
        self.declare(inner, Local { name: name.node.clone(), at: name.at, kind, state: State::Waiting });
    }

    /// Whether all names are parameters of what `owner` declares, each once.
    pub(super) fn check_overrides(
        &mut self,
        owner: &str,
        statements: &[Statement],
        overrides: &[(Ident, Expr)],
    ) -> Outcome<()> {
        let mut ok = Ok(());
        for (i, (name, _)) in overrides.iter().enumerate() {
            if let Some((first, _)) = overrides.iter().take(i).find(|(n, _)| n.node == name.node) {
                ok = self.fail(
                    Diagnostic::error(codes::DUPLICATE, format!("`{}` is given twice", name.node), name.at)
                        .label("again here")
                        .also(first.at, "first here"),
                );
                continue;
            }
            let declared = statements.iter().find_map(|s| match &s.kind {
                StatementKind::Param { name: n, .. } if n.node == name.node => Some((true, n)),
                StatementKind::Let { name: n, .. } if n.node == name.node => Some((false, n)),
                _ => None,
            });
            match declared {
                Some((true, n)) if n.node.starts_with('_') => {
                    ok = self.fail(
                        Diagnostic::error(
                            codes::PRIVATE,
                            format!("`{}` is private to `{owner}`", n.node),
                            name.at,
                        )
                        .also(n.at, "declared here"),
                    );
                }
                Some((true, _)) => {}
                Some((false, n)) => {
                    ok = self.fail(
                        Diagnostic::error(
                            codes::WRONG_KIND,
                            format!("`{}` is a `let` of `{owner}`, not a parameter", name.node),
                            name.at,
                        )
                        .also(n.at, "declared here"),
                    );
                }
                None => {
                    let params: Vec<&str> = statements
                        .iter()
                        .filter_map(|s| match &s.kind {
                            StatementKind::Param { name, .. } if !name.node.starts_with('_') => {
                                Some(name.node.as_str())
                            }
                            _ => None,
                        })
                        .collect();
                    let d = Diagnostic::error(
                        codes::UNKNOWN_NAME,
                        format!("`{owner}` has no parameter `{}`", name.node),
                        name.at,
                    );
                    ok = self.fail(match super::names::suggestion(&name.node, params.iter().copied()) {
                        Some(near) => super::lookup::meant(d, name, &near),
                        None => d.help(format!("it has {}", params.join(", "))),
                    });
                }
            }
        }
        ok
    }

    fn rod(
        &mut self,
        scope: usize,
        rod: &'a ast::Rod,
        at: Origin,
        site: &Site<'_>,
        members: &Members,
    ) -> Outcome<Rod> {
        let path = format!("{}.{}", site.joint_name, rod.name.node);
        let second_axis = self.second_axis(rod, site);
        let from = self.rod_end(scope, &rod.from, members, &format!("{path}.from"));
        let to = self.rod_end(scope, &rod.to, members, &format!("{path}.to"));
        let section = self.section(scope, &rod.section, &path);
        let section_to = self.section_to(scope, rod, &path);
        let (from, to) = (from?, to?);
        if from.body == to.body {
            return self.fail(Diagnostic::error(
                codes::JOINT_BODIES,
                format!("both ends of rod `{}` are in one body", rod.name.node),
                rod.name.at,
            ));
        }
        Ok(Rod {
            path,
            joint: site.joint,
            from,
            to,
            second_axis: second_axis?,
            section: section?,
            section_to: section_to?,
            fillet_mm: 0.0,
            origin: at,
        })
    }

    /// Only a universal joint has two axes to choose from.
    fn second_axis(&mut self, rod: &ast::Rod, site: &Site<'_>) -> Outcome<bool> {
        match &rod.second_axis {
            Some(said) if site.kind != JointKind::Universal.name() => self.fail(
                Diagnostic::error(
                    codes::MISPLACED,
                    format!("a {} joint has no two axes", site.kind),
                    said.at,
                )
                .help("leave out `axis …`: it chooses between the axes of a universal joint"),
            ),
            said => Ok(said.as_ref().is_some_and(|s| s.node)),
        }
    }

    fn rod_end(
        &mut self,
        scope: usize,
        end: &'a ast::RodEnd,
        members: &Members,
        path: &str,
    ) -> Outcome<RodEnd> {
        let body = self.member(&end.body, members);
        let position = self.place(scope, &end.position, &format!("{path}.at"));
        let derivative = self.place(scope, &end.along, &format!("{path}.along"));
        let (body, position, derivative) = (body?, position?, derivative?);
        if self.start_point(derivative).iter().all(|x| x.abs() < 1e-9) {
            return self.fail(
                Diagnostic::error(codes::SIZE, "the derivative at a rod's end must not vanish", end.along.at)
                    .help("its direction is that of the rod there, its size about the rod's length"),
            );
        }
        Ok(RodEnd { body, position, derivative })
    }

    /// Sections are written in full widths and stored in semi-axes.
    pub(super) fn section(&mut self, scope: usize, e: &'a Expr, path: &str) -> Outcome<Section> {
        let ExprKind::Call { function, arguments } = &e.kind else {
            if matches!(e.kind, ExprKind::Broken) {
                return Err(Failed);
            }
            return self.fail(
                Diagnostic::error(codes::TYPE, "a section is needed", e.at)
                    .help("write `ellipse(thick = …, wide = …)`"),
            );
        };
        let widths: &[&str] = match function.node.as_str() {
            "ellipse" | "rect" => &["thick", "wide"],
            "round" => &["d"],
            other => {
                let other = other.to_string();
                return self.fail(
                    Diagnostic::error(
                        codes::UNKNOWN_FUNCTION,
                        format!("there is no section `{other}`"),
                        function.at,
                    )
                    .help("sections are `ellipse(thick = …, wide = …)`, `rect(thick = …, wide = …)` and `round(d)`"),
                );
            }
        };
        let slots = self.arguments(function, arguments, widths, widths.len())?;
        let mut semi = Vec::new();
        for (slot, name) in slots.into_iter().zip(widths) {
            let Some(width) = slot else { return Err(Failed) };
            let what = format!("`{name}`");
            let env = Env::named(scope, format!("{path}.section.{name}"));
            let id = self.eval_scalar(&env, width, Dimension::LENGTH, &what)?;
            let v = self.start_value(id);
            if v.is_nan() || v <= 0.0 {
                let shown = self.show(v, Dimension::LENGTH);
                return self.fail(
                    Diagnostic::error(
                        codes::SIZE,
                        format!("{what} of joint `{path}` must be positive"),
                        width.at,
                    )
                    .label(format!("this is {shown}")),
                );
            }
            semi.push(self.half(id, e)?);
        }
        match semi.as_slice() {
            [a, b] if function.node.as_str() == "rect" => Ok(Section::Rect { a: *a, b: *b }),
            [a, b] => Ok(Section::Ellipse { a: *a, b: *b }),
            [r] => Ok(Section::Round { r: *r }),
            _ => Err(Failed),
        }
    }
}
