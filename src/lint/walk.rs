//! Ways through a syntax tree: the expressions of a statement, and the names it refers to.

use super::shapes::Flexure;
use super::views::{OfFlexures, OfMotion};
use crate::diagnostic::{Edit, Fix};
use crate::geometry::skeleton::connect;
use crate::kinematics::motion::State;
use crate::syntax::ast::{Expr, ExprKind, Ident, Load, Profile, Statement, StatementKind};
use nalgebra::Vector3;

/// Calls `f` with every expression in `e`, itself first.
pub fn each<'a>(e: &'a Expr, f: &mut dyn FnMut(&'a Expr)) {
    f(e);
    match &e.kind {
        ExprKind::Tuple(items) => items.iter().for_each(|i| each(i, f)),
        ExprKind::Negate(inner) => each(inner, f),
        ExprKind::Binary(_, l, r) => [l, r].into_iter().for_each(|i| each(i, f)),
        ExprKind::Call { arguments, .. } => arguments.iter().for_each(|a| each(&a.value, f)),
        ExprKind::Free { start, lower, upper } => {
            [start, lower, upper].into_iter().for_each(|i| each(i, f));
        }
        ExprKind::About { axis, .. } => each(axis, f),
        ExprKind::Number { .. } | ExprKind::Name(_) | ExprKind::Text(_) | ExprKind::Broken => {}
    }
}

/// Calls `f` with every expression that stands directly in a statement.
pub fn expressions<'a>(s: &'a Statement, f: &mut dyn FnMut(&'a Expr)) {
    use StatementKind as K;
    match &s.kind {
        K::Param { value, .. } | K::Let { value, .. } | K::Point { value, .. } => f(value),
        K::Rest { value, .. } | K::Output { value, .. } | K::Target { value, .. } => f(value),
        K::Links { height, fillet } => height.iter().chain(fillet).for_each(f),
        K::Body { layer, .. } => layer.iter().for_each(f),
        K::Joint(j) => {
            f(&j.point);
            [&j.axis, &j.second_axis, &j.layer, &j.pin, &j.fillet].into_iter().flatten().for_each(&mut *f);
            j.into.iter().for_each(|(_, q)| f(q));
            j.template.iter().flat_map(|t| &t.overrides).for_each(|(_, v)| f(v));
        }
        K::Cycle { steps, over } => {
            f(steps);
            over.iter().for_each(f);
        }
        K::Drive { profile, drum, .. } => {
            match profile {
                Profile::Range(a, b) => [a, b].into_iter().for_each(&mut *f),
                Profile::By(e) => f(e),
                Profile::Keys { keys, .. } => keys.iter().for_each(|(t, v)| {
                    f(t);
                    f(v);
                }),
            }
            drum.iter().for_each(f);
        }
        K::Trace { point, .. } => f(point),
        K::Minimize(terms) => terms.iter().for_each(|t| {
            f(&t.call);
            t.weight.iter().for_each(&mut *f);
        }),
        K::Require { left, right, .. } => [left, right].into_iter().for_each(f),
        K::Export(list) => list.iter().for_each(f),
        K::String(c) => {
            f(&c.at);
            c.via.iter().for_each(f);
        }
        K::Load(load) => match &**load {
            Load::Gravity { direction } => f(direction),
            Load::Moment { size, about, .. } => [size, about].into_iter().for_each(f),
            Load::Force { size, along, point, .. } => [size, along, point].into_iter().for_each(f),
        },
        K::Hole(hole) => {
            [&hole.diameter, &hole.point].into_iter().for_each(&mut *f);
            hole.along.iter().for_each(f);
        }
        K::Mount(m) | K::Horn(m) => {
            f(&m.point);
            m.clauses.iter().for_each(|(_, e)| f(e));
        }
        K::Plate(p) => {
            f(&p.thickness);
            p.margin.iter().for_each(f);
        }
        K::Solid(s) => {
            s.point.iter().chain(&s.scale).for_each(&mut *f);
            s.turned.iter().for_each(|(angle, axis)| [angle, axis].into_iter().for_each(&mut *f));
        }
        K::Rod(r) => {
            for end in [&r.from, &r.to] {
                f(&end.position);
                f(&end.along);
            }
            f(&r.section);
            r.section_to.iter().for_each(f);
        }
        K::Assert(a) => [&a.left, &a.right].into_iter().for_each(f),
        K::Variant(v) => v.settings.iter().for_each(|(_, e)| f(e)),
        K::Workspace(w) => {
            w.wanted.iter().for_each(&mut *f);
            w.stretches.iter().for_each(|s| {
                [&s.from, &s.to].into_iter().for_each(&mut *f);
                s.steps.iter().for_each(&mut *f);
            });
        }
        K::For(l) => {
            [&l.first, &l.last].into_iter().for_each(&mut *f);
            l.statements.iter().for_each(|s| expressions(s, f));
        }
        K::Case(c) => c.statements.iter().for_each(|s| expressions(s, f)),
        K::Place(p) => {
            f(&p.point);
            p.overrides.iter().for_each(|(_, v)| f(v));
            p.turned.iter().for_each(|(a, d)| {
                f(a);
                f(d);
            });
            p.scale.iter().for_each(f);
        }
        K::Material(_) | K::PrintOn(_) | K::Model(_) | K::Mirror(_) | K::OwnBody { .. } => {}
        K::Allow(_) | K::Later { .. } | K::Broken { .. } => {}
    }
}

/// Calls `f` with every name in an expression, part by part: `one.tip` gives both.
pub fn names<'a>(e: &'a Expr, f: &mut dyn FnMut(&'a Ident)) {
    each(e, &mut |e| match &e.kind {
        ExprKind::Name(path) => path.iter().for_each(&mut *f),
        ExprKind::About { body, .. } => f(body),
        _ => {}
    });
}

/// Calls `f` with every name that a statement refers to; not with the one it declares, nor with the names of a
/// template's parameters.
pub fn references<'a>(s: &'a Statement, f: &mut dyn FnMut(&'a Ident)) {
    use StatementKind as K;
    match &s.kind {
        K::Body { points, .. } => points.iter().for_each(&mut *f),
        K::Joint(j) => {
            j.bodies.iter().for_each(&mut *f);
            j.into.iter().for_each(|(b, _)| f(b));
            j.template.iter().for_each(|t| f(&t.name));
        }
        K::Material(name) | K::PrintOn(name) => f(name),
        K::Drive { joint, motor, .. } => {
            f(joint);
            motor.iter().for_each(&mut *f);
        }
        K::Rest { joint, .. } => f(joint),
        K::Trace { body, .. } => f(body),
        K::Target { trace, .. } => f(trace),
        K::String(c) => [&c.from, &c.to].into_iter().for_each(&mut *f),
        K::Load(load) => match &**load {
            Load::Gravity { .. } => {}
            Load::Moment { body, .. } | Load::Force { body, .. } => f(body),
        },
        K::Rod(r) => [&r.from.body, &r.to.body].into_iter().for_each(&mut *f),
        K::Place(p) => {
            f(&p.mechanism);
            p.merging.iter().for_each(|(a, b)| {
                f(a);
                f(b);
            });
        }
        K::Mirror(m) => {
            f(&m.of);
            m.sharing.iter().for_each(&mut *f);
        }
        K::Variant(v) => v.settings.iter().for_each(|(name, _)| f(name)),
        K::Workspace(w) => w.stretches.iter().for_each(|s| f(&s.drive)),
        K::For(l) => return l.statements.iter().for_each(|s| references(s, f)),
        K::Case(c) => return c.statements.iter().for_each(|s| references(s, f)),
        _ => {}
    }
    expressions(s, &mut |e| names(e, f));
}

/// The `free` expression that stands at a place.
pub fn free_at(statements: &[Statement], at: crate::diagnostic::Origin) -> Option<[&Expr; 3]> {
    let mut found = None;
    for s in statements.iter().filter(|s| s.at.start <= at.start && at.end <= s.at.end) {
        expressions(s, &mut |e| {
            each(e, &mut |e| {
                if let ExprKind::Free { start, lower, upper } = &e.kind
                    && e.at == at
                {
                    found = Some([&**start, &**lower, &**upper]);
                }
            });
        });
    }
    found
}

/// Whether a value may vary.
pub fn is_free(e: &Expr) -> bool {
    let mut free = false;
    each(e, &mut |e| free |= matches!(e.kind, ExprKind::Free { .. }));
    free
}

/// The name that a statement declares, and whether it is a value (else a body, a joint and the like).
pub fn declared(kind: &StatementKind) -> Option<(&Ident, bool)> {
    use StatementKind as K;
    Some(match kind {
        K::Param { name, .. } | K::Let { name, .. } | K::Point { name, .. } => (name, true),
        K::Body { name, .. } | K::Trace { name, .. } | K::Output { name, .. } | K::OwnBody { name, .. } => {
            (name, false)
        }
        K::Joint(j) => (&j.name, false),
        K::String(c) => (&c.name, false),
        K::Rod(r) => (&r.name, false),
        K::Place(p) => (&p.name, false),
        K::Mirror(m) => (&m.name, false),
        _ => return None,
    })
}

/// A number in the unit of a free value, as it is written: `0.6 mm`, `30 deg`; none for other units.
pub fn quantity(value: f64, unit: &str) -> Option<String> {
    // Three decimals, without those that are zero.
    let short = |v: f64| {
        let text = format!("{v:.3}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" { "0".to_string() } else { text.to_string() }
    };
    match unit {
        "mm" => Some(format!("{} mm", short(value))),
        "rad" => Some(format!("{} deg", short(value.to_degrees()))),
        _ => None,
    }
}

/// Whether a requirement is about something that is never negative.
pub fn is_size(r: &crate::ir::Requirement) -> bool {
    use crate::ir::Quantity as Q;
    let size = matches!(
        r.quantity,
        Q::Error(_) | Q::ErrorClosest(_) | Q::AimError(_) | Q::Stress | Q::Torque(_) | Q::Force(_)
    );
    size || r.aggregate == crate::ir::Aggregate::Span
}

/// The repair that makes a drive rest at a value, rad or mm: in its `rest` line, or in a new one below its `drive`.
pub fn rest_fix(
    of: &super::views::OfDesign,
    drive: &str,
    value: f64,
    unit: crate::ir::DriveUnit,
) -> Option<Fix> {
    let unit = match unit {
        crate::ir::DriveUnit::Rad => "rad",
        crate::ir::DriveUnit::Mm => "mm",
    };
    let text = quantity(value, unit)?;
    let mut below = None;
    for s in of.statements() {
        match &s.kind {
            StatementKind::Rest { joint, value } if joint.node == drive => {
                let edit = Edit::replace(value.at, &text);
                return Some(Fix::risky(format!("rest at {text}"), vec![edit]));
            }
            StatementKind::Drive { joint, .. } if joint.node == drive => below = Some(s.at),
            _ => {}
        }
    }
    let at = below?;
    let source = of.text.of(at.file);
    let line = source.get(..at.start as usize)?.rfind('\n').map_or(0, |n| n + 1);
    let indent: String =
        source.get(line..)?.chars().take_while(|c| c.is_whitespace() && *c != '\n').collect();
    let end = crate::diagnostic::Origin { start: at.end, ..at };
    let edit = Edit::replace(end, format!("\n{indent}rest {drive} at {text}"));
    // A comment behind the drive stays with it only where there is none.
    let behind = source.get(at.end as usize..)?.split('\n').next()?.trim();
    behind.is_empty().then(|| Fix::risky(format!("rest at {text}"), vec![edit]))
}

/// The values of the drives in a state, in words.
pub fn drives_at(view: &OfMotion, state: &State) -> String {
    let shown = view.of.design.drives.iter().zip(&state.drives);
    let shown: Vec<String> = shown.map(|(d, v)| format!("`{}` = {}", d.name, d.unit.show(*v))).collect();
    shown.join(", ")
}

/// Pairs of bodies of a planar mechanism in one layer, without a joint in common.
pub fn strangers(view: &OfMotion) -> Vec<[usize; 2]> {
    let design = view.of.design;
    if !view.of.is_planar() {
        return Vec::new();
    }
    let joined =
        |a: usize, b: usize| design.joints.iter().any(|j| j.bodies.contains(&a) && j.bodies.contains(&b));
    let bodies: Vec<_> = design.bodies.iter().enumerate().filter(|(_, b)| b.owner.is_none()).collect();
    let mut pairs = Vec::new();
    for (i, (a, first)) in bodies.iter().enumerate() {
        for (b, second) in bodies.iter().skip(i + 1) {
            let still = first.ground && second.ground;
            if first.layer == second.layer && !still && !joined(*a, *b) {
                pairs.push([*a, *b]);
            }
        }
    }
    pairs
}

/// The bars of every body as drawn, mm: joined once and for all.
pub fn bars(view: &OfMotion) -> Vec<Vec<[Vector3<f64>; 2]>> {
    let of_body = |b: &crate::ir::Body| {
        let drawn: Vec<Vector3<f64>> = b.skeleton.iter().map(|p| view.of.point(p.position)).collect();
        let net = connect(&drawn, |_, _| false);
        let all: Vec<Vector3<f64>> = drawn.iter().chain(&net.hub).copied().collect();
        net.edges.iter().filter_map(|(i, j)| Some([*all.get(*i)?, *all.get(*j)?])).collect()
    };
    view.of.design.bodies.iter().map(of_body).collect()
}

/// Whether the bars of two bodies cross in a state, seen along the stacking axis.
pub fn cross(view: &OfMotion, bars: &[Vec<[Vector3<f64>; 2]>], state: &State, [a, b]: [usize; 2]) -> bool {
    let axis = Vector3::from(view.of.design.layers.axis);
    let moved = |body: usize| -> Vec<[Vector3<f64>; 2]> {
        let (Some(bars), Some(pose)) = (bars.get(body), state.poses.get(body)) else { return Vec::new() };
        bars.iter().map(|bar| bar.map(|p| pose.point(&p))).collect()
    };
    let side = |p: &Vector3<f64>, q: &Vector3<f64>, r: &Vector3<f64>| (q - p).cross(&(r - p)).dot(&axis);
    let (first, second) = (moved(a), moved(b));
    first.iter().any(|[p, q]| {
        second.iter().any(|[r, s]| side(p, q, r) * side(p, q, s) < 0.0 && side(r, s, p) * side(r, s, q) < 0.0)
    })
}

/// Of each joint for one of whose flexures `bad` says something, the flexure for which it says most.
pub fn worst_of_joints<'v>(
    view: &OfFlexures<'v>,
    bad: impl Fn(&Flexure) -> Option<f64>,
) -> Vec<(&'v crate::ir::Joint, &'v Flexure)> {
    let mut found = Vec::new();
    for (id, joint) in view.of.design.joints.iter().enumerate() {
        let own = view.flexures.iter().filter(|f| f.joint == id).filter_map(|f| Some((bad(f)?, f)));
        if let Some((_, f)) = own.max_by(|a, b| a.0.total_cmp(&b.0)) {
            found.push((joint, f));
        }
    }
    found
}

/// The declaration of the joint to which a flexure of a place belongs.
pub fn joint_of(
    design: &crate::ir::Design,
    place: &crate::pipeline::Place,
) -> Option<crate::diagnostic::Origin> {
    let rod = design.rods.iter().find(|r| place.of.contains(&r.path))?;
    design.joints.get(rod.joint).map(|j| j.origin)
}

/// Length of the path of a trace, mm.
pub fn path_mm(simulation: &crate::pipeline::Simulation, trace: usize) -> f64 {
    let at = |s: &crate::emit::csv::MotionState| s.traces_mm.get(trace).copied().map(Vector3::from);
    let points: Vec<Vector3<f64>> = simulation.motion.states.iter().filter_map(at).collect();
    points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

/// Where parts are asked for.
pub fn export(assembly: &crate::ir::Assembly) -> crate::diagnostic::Origin {
    let stl = assembly.exports.iter().find(|e| e.export.kind == crate::ir::ExportKind::Stl);
    stl.map_or(assembly.origin, |e| e.export.origin)
}
