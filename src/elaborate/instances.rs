//! A mechanism made of instances of others: `place` and `mirror`, what they have in common, requirements and exports.

use super::codes;
use super::dimension::Dimension;
use super::drawn::{Drawn, Places};
use super::eval::{Env, Evaluator, Failed, Outcome};
use super::given::{Given, GivenKey};
use super::load::Program;
use super::loops;
use super::mechanism::{Outside, quote};
use super::placing;
use super::queries::{Queries, Query, drive_texts};
use super::scope::{Local, LocalKind, State};
use super::settings::Settings;
use super::sheet::Sheet;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::assembly::{AssemblyExport, AssemblyRequirement, InstanceDrive, Joined, PlacedDrive};
use crate::ir::{Assembly, CodeKind, Design, Export, ExportKind, ExprPoint, Instance, JointKind, Placement};
use crate::syntax::ast::{self, Expr, Ident, Item, Mechanism, StatementKind};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// Whether a mechanism is made of others.
pub fn is_assembly(m: &Mechanism) -> bool {
    m.statements
        .iter()
        .any(|s| matches!(s.kind, StatementKind::Place(_) | StatementKind::Mirror(_) | StatementKind::For(_)))
}

/// What elaborating an assembly gives.
pub struct Assembled {
    /// None when there are errors.
    pub assembly: Option<Assembly>,
    /// Findings.
    pub out: Vec<Diagnostic>,
    /// Uses that brought a name that was needed: (module, use).
    pub used: BTreeSet<(usize, usize)>,
    /// What names came to.
    pub values: Vec<super::KnownValue>,
}

/// An item of the program: module and index.
type ItemRef = (usize, usize);

/// What is being put together.
#[derive(Default)]
pub(super) struct Parts {
    pub designs: Vec<Design>,
    /// Of each design: which mechanism it is.
    pub items: Vec<ItemRef>,
    pub instances: Vec<Instance>,
    pub joined: Vec<Joined>,
    pub motors: Vec<InstanceDrive>,
    /// Design by mechanism, bits of the scale and what is given for its parameters.
    scaled: BTreeMap<(ItemRef, u64, Vec<GivenKey>), Option<usize>>,
    /// Design by another one and the sign of each of its drives.
    pub turned: BTreeMap<(usize, Vec<bool>), usize>,
    /// Names that were declared but went wrong: what refers to them is not reported.
    pub failed: BTreeSet<String>,
}

impl Parts {
    pub fn instance(&self, name: &str) -> Option<usize> {
        self.instances.iter().position(|i| i.name == name)
    }

    /// Makes bodies of two instances one; `name` is what a new group is called.
    pub fn join(&mut self, first: Option<(usize, usize)>, second: (usize, usize), name: String, at: Origin) {
        let known = self.joined.iter_mut().find(|j| match first {
            Some(first) => j.members.contains(&first),
            None => j.name == name,
        });
        match known {
            Some(group) => group.members.push(second),
            None => {
                let members = first.into_iter().chain([second]).collect();
                let (skeleton, holes, fittings, hinged) = Default::default();
                self.joined.push(Joined { name, members, skeleton, holes, fittings, hinged, origin: at });
            }
        }
    }

    /// A drive of an instance with a motor of its own.
    pub fn own_motor(&mut self, instance: usize, drive: usize, sign: f64) -> PlacedDrive {
        self.motors.push(InstanceDrive { instance, drive });
        PlacedDrive { motor: self.motors.len() - 1, sign }
    }
}

/// Elaborates a mechanism that places others.
pub fn assemble(
    program: &Program,
    settings: &Settings,
    m: &Mechanism,
    outside: &Outside<'_>,
    is_root: bool,
) -> Assembled {
    let written = loops::written_out(program, settings, m, outside.module);
    let queries = Queries::of(&written.mechanism, &written.turns);
    let mut e = Evaluator::new(program, settings);
    (e.out, e.used) = (written.out, written.used);
    let assembly = e.assembly(&written.mechanism, outside, &queries);
    if is_root {
        e.unused_settings();
    }
    let bad = e.out.iter().any(Diagnostic::is_error);
    let values = e.known();
    Assembled { assembly: assembly.filter(|_| !bad), out: e.out, used: e.used, values }
}

impl<'a> Evaluator<'a> {
    fn assembly(
        &mut self,
        m: &'a Mechanism,
        outside: &Outside<'_>,
        queries: &'a Queries,
    ) -> Option<Assembly> {
        let scope = self.scope(outside.module);
        let sheet = self.sheet(scope, m);
        self.only_instances(&sheet, m);
        let grounds: BTreeSet<&str> = sheet.bodies.iter().map(|b| b.name.node.as_str()).collect();
        let mut parts = Parts::default();
        self.limit(sheet.places.len() + sheet.mirrors.len(), "instances", m.name.at).ok()?;
        for (place, at) in &sheet.places {
            if self.put(scope, place, *at, outside, &grounds, &mut parts).is_err() {
                parts.failed.insert(place.name.node.clone());
            }
            self.stands(&place.name, &parts);
        }
        self.mirrors(&sheet, &mut parts);
        for (mirror, _) in &sheet.mirrors {
            self.stands(&mirror.name, &parts);
        }
        // Names may mean points of instances.
        self.force_all(scope);
        self.assertions(scope, &sheet);
        let mut places = Places::default();
        self.own_shapes(scope, &sheet, &mut parts, &mut places);
        self.own_fittings(scope, &sheet, &mut parts, outside, &mut places);
        let Places { exprs, free } = places;
        self.same_cycles(&parts);
        self.same_stuff(&parts);
        let requirements = queries
            .requires
            .iter()
            .filter_map(|q| self.instance_requirement(scope, q, &parts, outside).ok())
            .collect();
        let exports =
            queries.exports.iter().filter_map(|q| self.export_of_all(scope, q, &parts).ok()).collect();
        let Parts { designs, instances, joined, motors, .. } = parts;
        let name = m.name.node.clone();
        Some(Assembly {
            name,
            designs,
            instances,
            joined,
            motors,
            requirements,
            exports,
            exprs,
            free,
            origin: m.name.at,
        })
    }

    /// Only instances and what concerns the whole may stand beside instances.
    fn only_instances(&mut self, sheet: &Sheet<'a>, m: &Mechanism) {
        for s in &m.statements {
            let what = match &s.kind {
                StatementKind::Body { ground: false, .. } => "link",
                StatementKind::Body { layer: Some(layer), .. } => {
                    self.out.push(
                        Diagnostic::error(
                            codes::LATER_STATEMENT,
                            "a ground beside instances in a layer is not available yet",
                            layer.at,
                        )
                        .help("it has no joints of its own: put its points at the height where they belong"),
                    );
                    continue;
                }
                StatementKind::Plate(_) => {
                    let message = "`plate` beside instances is not available yet";
                    let help = "write it in the mechanism that is placed, or unite a slab with the ground: `solid \"slab.stl\" on GROUND`";
                    self.out.push(
                        Diagnostic::error(codes::LATER_STATEMENT, message, s.at)
                            .label("a plate lies in a layer, and those of several instances have no plane in common")
                            .help(help),
                    );
                    continue;
                }
                StatementKind::Joint(j) => j.kind.node.as_str(),
                StatementKind::Material(_) => "material",
                StatementKind::PrintOn(_) => "print on",
                StatementKind::Links { .. } => "links",
                StatementKind::Cycle { .. } => "cycle",
                StatementKind::Drive { .. } => "drive",
                StatementKind::Rest { .. } => "rest",
                StatementKind::Trace { .. } => "trace",
                StatementKind::Minimize(_) => "minimize",
                StatementKind::Load(_) => "load",
                StatementKind::Output { .. } => "output",
                StatementKind::Target { .. } => "target",
                StatementKind::Workspace(_) => "workspace",
                StatementKind::Model(_) => "links model",
                _ => continue,
            };
            let message = format!("`{what}` beside instances is not available yet");
            self.out.push(
                Diagnostic::error(codes::LATER_STATEMENT, message, s.at)
                    .help("what moves, and how it is made, stands in the mechanisms that are placed"),
            );
        }
        if sheet.places.is_empty() && !sheet.broken {
            self.out.push(
                Diagnostic::error(codes::MISSING, "there is nothing to mirror", m.name.at)
                    .help("add for instance `place right = half at (0 mm, 0 mm)`"),
            );
        }
    }

    /// The points of grounds of the assembly's own: what they reach beside what is merged into them.
    fn own_shapes(&mut self, scope: usize, sheet: &Sheet<'a>, parts: &mut Parts, places: &mut Places) {
        for text in sheet.bodies.iter().filter(|b| b.ground && !b.points.is_empty()) {
            let Ok(body) = self.body(scope, text) else { continue };
            let points = body.skeleton.iter().map(|p| self.standing_place(p.position, text.at, places));
            let Ok(points) = points.collect::<Outcome<Vec<ExprPoint>>>() else { continue };
            match parts.joined.iter_mut().find(|j| j.name == body.name) {
                Some(joined) => (joined.skeleton, joined.origin) = (points, text.at),
                // A `place` that went wrong may have been the one.
                None if !parts.failed.is_empty() => {}
                None => self.out.push(
                    Diagnostic::error(
                        codes::MISSING,
                        format!("nothing is merged into `{}`, so it is of no material", body.name),
                        text.at,
                    )
                    .help(format!("write `place … merging GROUND into {}`", body.name)),
                ),
            }
        }
    }

    /// From now on an instance's points can be named.
    fn stands(&mut self, name: &Ident, parts: &Parts) {
        match parts.instance(&name.node).and_then(|i| parts.instances.get(i)) {
            Some(i) if !parts.failed.contains(&name.node) => {
                self.drawn.placed.insert(i.name.clone(), (i.design, i.placement));
            }
            _ => {
                self.drawn.failed.insert(name.node.clone());
            }
        }
    }

    fn put(
        &mut self,
        scope: usize,
        place: &'a ast::Place,
        at: Origin,
        outside: &Outside<'_>,
        grounds: &BTreeSet<&str>,
        parts: &mut Parts,
    ) -> Outcome<()> {
        let item = self.placed_mechanism(scope, outside.module, &place.mechanism);
        let placement = self.placement(scope, place);
        let scale = match &place.scale {
            None => Ok(1.0),
            Some(e) => self.place_scale(scope, e),
        };
        let given = item.and_then(|item| self.given(scope, item, &place.overrides));
        let (item, placement, scale, given) = (item?, placement?, scale?, given?);
        let key = (item, f64::to_bits(scale), given.iter().map(Given::key).collect());
        let design = match parts.scaled.get(&key) {
            Some(known) => *known,
            None => {
                let made = self.placed_design(item, scale, &given, &place.name, outside).map(|design| {
                    parts.designs.push(design);
                    parts.items.push(item);
                    parts.designs.len() - 1
                });
                parts.scaled.insert(key, made);
                made
            }
        };
        let design = design.ok_or(Failed)?;
        let drives = parts.designs.get(design).map_or(0, |d| d.drives.len());
        let index = parts.instances.len();
        let drives = (0..drives).map(|k| parts.own_motor(index, k, 1.0)).collect();
        let name = place.name.node.clone();
        parts.instances.push(Instance { name, design, placement, states: Vec::new(), drives, origin: at });
        for (ground, into) in &place.merging {
            let body = self.body_of(parts.designs.get(design), ground)?;
            if !parts.designs.get(design).and_then(|d| d.bodies.get(body)).is_some_and(|b| b.ground) {
                return self.wrong_kind(ground, "body that moves", "a ground");
            }
            if !grounds.contains(into.node.as_str()) {
                let own = grounds.iter().enumerate().map(|(i, g)| ((*g).to_string(), i)).collect();
                self.thing(scope, &own, into, "ground")?;
            }
            parts.join(None, (index, body), into.node.clone(), at);
        }
        Ok(())
    }

    /// The mechanism of a `place`; not one that is made of others itself.
    fn placed_mechanism(&mut self, scope: usize, module: usize, name: &Ident) -> Outcome<ItemRef> {
        let Some(item) = self.top_level(module, name) else {
            return self.unknown_item(scope, name, "mechanism");
        };
        match self.program.item(item) {
            Some(Item::Mechanism(m)) if is_assembly(m) => {
                if placing::circle(self.program, item).is_some() {
                    // Told where the circle begins.
                    return Err(Failed);
                }
                self.fail(
                    Diagnostic::error(
                        codes::LATER_STATEMENT,
                        format!("placing `{}`, which places others itself, is not available yet", name.node),
                        name.at,
                    )
                    .also(m.name.at, "made of instances")
                    .help("place what it is made of"),
                )
            }
            Some(Item::Mechanism(_)) => Ok(item),
            Some(other) => {
                let is = super::load::item_kind(other).to_string();
                self.wrong_kind(name, &is, "a mechanism")
            }
            None => Err(Failed),
        }
    }

    /// The design of a placed mechanism; it is told where it stands in what goes wrong only with a scale.
    fn placed_design(
        &mut self,
        item: ItemRef,
        scale: f64,
        given: &[Given],
        instance: &Ident,
        outside: &Outside<'_>,
    ) -> Option<Design> {
        let Some(Item::Mechanism(m)) = self.program.item(item) else { return None };
        let mut settings = self.settings.below(&m.name.node);
        for (i, s) in self.settings.0.iter().enumerate() {
            if s.path.strip_prefix(&m.name.node).is_some_and(|rest| rest.starts_with('.')) {
                self.set_used.insert(i);
            }
        }
        for g in given {
            settings.given(&g.name, g.value.clone());
        }
        let mut inner = Evaluator::new(self.program, &settings);
        inner.scale = scale;
        let own =
            Outside { module: item.0, steps: outside.steps, sources: outside.sources, files: outside.files };
        let made = inner.mechanism(m, &own);
        inner.unused_settings();
        let bad = inner.out.iter().any(Diagnostic::is_error);
        if scale != 1.0 {
            for d in &mut inner.out {
                d.labels.push(crate::diagnostic::Label {
                    at: instance.at,
                    text: format!("scaled by {scale} here"),
                });
            }
        }
        if scale == 1.0 {
            self.placed_values.append(&mut inner.known());
        }
        self.out.append(&mut inner.out);
        self.used.append(&mut inner.used);
        let mut design = made.filter(|_| !bad)?;
        let drawn = Drawn::of(&mut inner, &design.free);
        self.drawn.of.push(Rc::new(drawn));
        if scale != 1.0 || !given.is_empty() {
            design.name = instance.node.clone();
        }
        Some(design)
    }

    /// A body of a placed design.
    pub(super) fn body_of(&mut self, design: Option<&Design>, name: &Ident) -> Outcome<usize> {
        let Some(design) = design else { return Err(Failed) };
        if let Some(i) = design.bodies.iter().position(|b| b.name == name.node) {
            return Ok(i);
        }
        let names: Vec<&str> = design.bodies.iter().map(|b| b.name.as_str()).collect();
        let d = Diagnostic::error(
            codes::UNKNOWN_NAME,
            format!("`{}` has no body `{}`", design.name, name.node),
            name.at,
        );
        self.fail(match super::names::suggestion(&name.node, names.iter().copied()) {
            Some(near) => super::lookup::meant(d, name, &near),
            None => d.help(format!("it has {}", names.join(", "))),
        })
    }

    fn placement(&mut self, scope: usize, place: &'a ast::Place) -> Outcome<Placement> {
        let point = self.eval(&Env::fixed(scope), &place.point).and_then(|v| self.as_point(v, &place.point));
        let turned = match &place.turned {
            None => Ok((0.0, [0.0, 0.0, 1.0])),
            Some((angle, axis)) => {
                let angle = self.eval_fixed(scope, angle, Dimension::ANGLE, "the angle");
                let axis = self.direction(scope, axis);
                angle.and_then(|a| Ok((a, axis?)))
            }
        };
        let (point, (angle, axis)) = (point?, turned?);
        let mut at = [0.0; 3];
        for (slot, id) in at.iter_mut().zip(point) {
            *slot = self.fixed(id, place.point.at, "the place of an instance")?;
        }
        Ok(placing::placement(at, angle, axis))
    }

    fn place_scale(&mut self, scope: usize, e: &'a Expr) -> Outcome<f64> {
        let k = self.eval_fixed(scope, e, Dimension::NUMBER, "the scale")?;
        if k > 0.0 {
            return Ok(k);
        }
        self.fail(
            Diagnostic::error(codes::SIZE, "the scale must be positive", e.at)
                .help("a mirror image is made with `mirror NAME = INSTANCE across yz`"),
        )
    }

    /// All instances move together: one table, one time.
    fn same_cycles(&mut self, parts: &Parts) {
        let Some(first) = parts.designs.first() else { return };
        let (a, b) = (&first.cycle, parts.designs.iter().map(|d| (&d.name, &d.cycle)));
        let other = b.into_iter().find(|(_, c)| c.steps != a.steps || c.duration_s != a.duration_s);
        if let Some((name, c)) = other {
            self.out.push(
                Diagnostic::error(
                    codes::CYCLES_DIFFER,
                    format!("`{}` and `{name}` have different cycles", first.name),
                    c.origin,
                )
                .label(format!("{} steps over {} s", c.steps, c.duration_s))
                .also(a.origin, format!("{} steps over {} s", a.steps, a.duration_s))
                .help("what stands in one assembly moves in one time: give both the same `cycle`"),
            );
        }
    }

    /// What is printed as one is of one material, on one machine.
    fn same_stuff(&mut self, parts: &Parts) {
        let of = |i: usize| parts.designs.get(parts.instances.get(i)?.design);
        for joined in &parts.joined {
            let mut designs = joined.members.iter().filter_map(|(i, _)| Some((*i, of(*i)?)));
            let Some((first, one)) = designs.next() else { continue };
            let differs = |d: &Design| d.material != one.material || d.process != one.process;
            let Some((i, other)) = designs.find(|(_, d)| differs(d)) else { continue };
            let at = |i: usize| parts.instances.get(i).map_or(joined.origin, |n| n.origin);
            let made = |d: &Design| format!("of `{}` on `{}`", d.material.name, d.process.name);
            self.out.push(
                Diagnostic::error(
                    codes::MIXED,
                    format!("`{}` cannot be one body of two materials or processes", joined.name),
                    at(i),
                )
                .label(made(other))
                .also(at(first), made(one))
                .help("give both mechanisms the same `material` and `print on`, or leave the bodies apart"),
            );
        }
    }

    /// The one instance that a statement names, with its design.
    fn one_instance<T>(
        &mut self,
        scope: usize,
        query: &'a Query<T>,
        parts: &Parts,
    ) -> Outcome<Option<usize>> {
        match query.instances.as_slice() {
            [] => Ok(None),
            [one] if parts.failed.contains(&one.node) => Err(Failed),
            [one] => {
                let known = parts.instances.iter().enumerate().map(|(i, n)| (n.name.clone(), i)).collect();
                self.thing(scope, &known, one, "instance").map(Some)
            }
            [_, second, ..] => self.fail(
                Diagnostic::error(
                    codes::LATER_TERM,
                    "a query of two instances at once is not available yet",
                    second.at,
                )
                .help("write one line for each"),
            ),
        }
    }

    /// Tells the evaluator about the instance's design: names of its traces and drives.
    fn inside(&mut self, design: Option<&Design>) -> (BTreeMap<String, usize>, BTreeMap<String, usize>) {
        let none = (BTreeMap::new(), BTreeMap::new());
        self.sliders.clear();
        self.aims = design.map(super::aims::AimNames::of).unwrap_or_default();
        let Some(d) = design else { return none };
        let sliding = d.joints.iter().filter(|j| j.kind == JointKind::Slider);
        self.sliders.extend(sliding.map(|j| j.name.clone()));
        let traces = d.traces.iter().enumerate().map(|(i, t)| (t.name.clone(), i)).collect();
        let drives = d.drives.iter().enumerate().map(|(i, t)| (t.name.clone(), i)).collect();
        (traces, drives)
    }

    /// The names of the assembly and, as things, those of an instance that queries tell apart by their kind.
    fn scope_inside(&mut self, scope: usize) -> usize {
        let Some(outer) = self.scopes.get(scope) else { return scope };
        let module = outer.module;
        let copy = |l: &Local<'a>| Local {
            name: l.name.clone(),
            at: l.at,
            kind: l.kind.clone(),
            state: l.state.clone(),
        };
        let mut locals: Vec<Local<'a>> = outer.locals.iter().map(copy).collect();
        let outputs = self.aims.outputs.keys().map(|n| (n.clone(), "output"));
        let directions = self.aims.directions.keys().map(|n| (n.clone(), "direction"));
        for (name, kind) in outputs.chain(directions) {
            locals.retain(|l| l.name != name);
            let (kind, at) = (LocalKind::Thing(kind), Origin::default());
            locals.push(Local { name, at, kind, state: State::Waiting });
        }
        let inner = self.scope(module);
        if let Some(s) = self.scopes.get_mut(inner) {
            s.index = locals.iter().enumerate().map(|(i, l)| (l.name.clone(), i)).collect();
            s.locals = locals;
        }
        inner
    }

    fn instance_requirement(
        &mut self,
        scope: usize,
        query: &'a Query<(Expr, ast::Compare, Expr)>,
        parts: &Parts,
        outside: &Outside<'_>,
    ) -> Outcome<AssemblyRequirement> {
        let instance = self.one_instance(scope, query, parts)?;
        let design = instance.and_then(|i| parts.designs.get(parts.instances.get(i)?.design));
        let (traces, drives) = self.inside(design);
        let (left, op, right) = &query.text;
        let text = super::sheet::RequireText { left, op: *op, right, at: query.at };
        let line = format!("{}{}", quote(outside.sources, query.at), query.turn);
        let inner = self.scope_inside(scope);
        let requirement = self.requirement(inner, &text, &traces, &drives, &line)?;
        Ok(AssemblyRequirement { instance, requirement })
    }

    /// An export; one of drives of several instances is put together of those of each.
    fn export_of_all(
        &mut self,
        scope: usize,
        each: &'a [Query<Expr>],
        parts: &Parts,
    ) -> Outcome<AssemblyExport> {
        if let [one] = each {
            return self.instance_export(scope, one, parts);
        }
        // All are looked at before any of them fails.
        let found: Vec<Outcome<AssemblyExport>> =
            each.iter().map(|q| self.instance_export(scope, q, parts)).collect();
        let found = found.into_iter().collect::<Outcome<Vec<AssemblyExport>>>()?;
        let (mut motors, mut code) = (Vec::new(), None);
        for one in &found {
            let (kind, drives) = match &one.export.kind {
                ExportKind::Arduino(drive) => (CodeKind::Arduino, vec![*drive]),
                ExportKind::Code(kind, drives) => (*kind, drives.clone()),
                _ => return Err(Failed),
            };
            code = Some(kind);
            let instance = one.instance.and_then(|i| parts.instances.get(i)).ok_or(Failed)?;
            // Without a drive, all of the instance.
            let all = || (0..instance.drives.len()).collect();
            let drives: Vec<usize> = if drives.is_empty() { all() } else { drives };
            for motor in drives.iter().filter_map(|d| instance.drives.get(*d)).map(|d| d.motor) {
                // One that instances have in common is there once.
                if !motors.contains(&motor) {
                    motors.push(motor);
                }
            }
        }
        let kind = ExportKind::Code(code.ok_or(Failed)?, Vec::new());
        let origin = each.first().map(|q| q.at).unwrap_or_default();
        Ok(AssemblyExport { instance: None, export: Export { kind, origin }, motors })
    }

    fn instance_export(
        &mut self,
        scope: usize,
        query: &'a Query<Expr>,
        parts: &Parts,
    ) -> Outcome<AssemblyExport> {
        let mut instance = self.one_instance(scope, query, parts)?;
        let found = instance.and_then(|i| parts.instances.get(i));
        let (_, drives) = self.inside(found.and_then(|i| parts.designs.get(i.design)));
        let item = found.and_then(|i| parts.items.get(i.design));
        let texts = match item.and_then(|i| self.program.item(*i)) {
            Some(Item::Mechanism(m)) => drive_texts(m),
            _ => Vec::new(),
        };
        let mut export = self.export(scope, &query.text, &drives, &texts)?;
        // The code for a motor that instances have in common is that of the first.
        if let (ExportKind::Arduino(drive), Some(found)) = (&mut export.kind, found)
            && let Some(motor) = found.drives.get(*drive).and_then(|d| parts.motors.get(d.motor))
        {
            (instance, *drive) = (Some(motor.instance), motor.drive);
        }
        Ok(AssemblyExport { instance, export: Export { origin: query.at, ..export }, motors: Vec::new() })
    }
}
