//! Holes, motors and solids beside instances: on grounds of the assembly's own, and on grounds of instances.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use super::instances::Parts;
use super::mechanism::Outside;
use super::sheet::Sheet;
use super::structure::{SAME_POINT_MM, Structure};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::expr::{ExprGraph, Node};
use crate::ir::{ExprPoint, JointKind, Mount};
use crate::syntax::ast::{Expr, ExprKind, Ident};
use nalgebra::Vector3;

impl<'a> Evaluator<'a> {
    /// All of them, each in its joined body; their places are constants of the graph that is returned.
    pub(super) fn own_fittings(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        parts: &mut Parts,
        outside: &Outside<'_>,
    ) -> ExprGraph {
        let mut places = ExprGraph::default();
        let count = sheet.holes.len() + sheet.mounts.len() + sheet.solids.len();
        let first = sheet.holes.iter().map(|h| h.1).chain(sheet.mounts.iter().map(|m| m.1)).next();
        let first = first.or(sheet.solids.first().map(|s| s.1)).unwrap_or_default();
        if count == 0 || self.limit(count, "holes, mounts and solids", first).is_err() {
            return places;
        }
        // Bodies by the names that the statements give them.
        let mut s = Structure::default();
        let bodies = sheet.holes.iter().map(|h| &h.0.body).chain(sheet.mounts.iter().map(|m| &m.0.body));
        let bodies: Vec<&Ident> = bodies.chain(sheet.solids.iter().map(|s| &s.0.body)).collect();
        for name in bodies {
            if !s.body_index.contains_key(&name.node)
                && let Ok(joined) = self.standing_body(scope, name, sheet, parts)
            {
                s.body_index.insert(name.node.clone(), joined);
            }
        }
        let mut known = |name: &Ident, point: Option<&Expr>| {
            s.body_index.contains_key(&name.node) && self.is_own_point(point, parts)
        };
        let holes: Vec<_> = sheet.holes.iter().filter(|t| known(&t.0.body, Some(&t.0.point))).collect();
        let mounts: Vec<_> = sheet.mounts.iter().filter(|t| known(&t.0.body, Some(&t.0.point))).collect();
        let solids: Vec<_> = sheet.solids.iter().filter(|t| known(&t.0.body, t.0.point.as_ref())).collect();
        for (text, at) in holes {
            let Ok((joined, mut hole)) = self.hole(scope, text, *at, &s) else { continue };
            let Ok(place) = self.standing_place(hole.position, *at, &mut places) else { continue };
            hole.position = place;
            parts.joined.get_mut(joined).into_iter().for_each(|j| j.holes.push(hole.clone()));
        }
        for (text, at) in mounts {
            let Ok((joined, mut mount)) = self.mount(scope, outside.module, text, *at, &s) else { continue };
            let Ok(place) = self.standing_place(mount.position, *at, &mut places) else { continue };
            let toward = mount.toward.map(|q| self.standing_place(q, *at, &mut places)).transpose();
            let Ok(toward) = toward else { continue };
            if self.turns_nothing(&mount, joined, parts).is_err() {
                continue;
            }
            (mount.position, mount.toward) = (place, toward);
            parts.joined.get_mut(joined).into_iter().for_each(|j| j.fittings.mounts.push(mount.clone()));
        }
        for (text, at) in solids {
            let Ok((joined, mut solid)) = self.solid(scope, text, *at, &s, outside) else { continue };
            let Ok(place) = self.standing_place(solid.position, *at, &mut places) else { continue };
            solid.position = place;
            parts.joined.get_mut(joined).into_iter().for_each(|j| j.fittings.solids.push(solid.clone()));
        }
        places
    }

    fn standing_place(&mut self, p: ExprPoint, at: Origin, places: &mut ExprGraph) -> Outcome<ExprPoint> {
        let mut out = p;
        for (slot, id) in out.iter_mut().zip(p) {
            *slot = places.push(Node::Const(self.fixed(id, at, "a place beside instances")?));
        }
        Ok(out)
    }

    /// Points of instances move with what is optimised in them, and are not known here.
    fn is_own_point(&mut self, point: Option<&Expr>, parts: &Parts) -> bool {
        let Some(Expr { kind: ExprKind::Name(path), at }) = point else { return true };
        let of_instance = |first: &Ident| parts.instance(&first.node).is_some();
        if path.len() < 2 || !path.first().is_some_and(of_instance) {
            return true;
        }
        self.out.push(
            Diagnostic::error(codes::LATER_STATEMENT, "a point of an instance is not available here yet", *at).help(
                "write its place in the assembly; what belongs to a joint stands in the mechanism that is placed",
            ),
        );
        false
    }

    /// The joined body that a name means: a ground of the assembly's own, or `INSTANCE.GROUND`.
    fn standing_body(
        &mut self,
        scope: usize,
        name: &Ident,
        sheet: &Sheet<'a>,
        parts: &mut Parts,
    ) -> Outcome<usize> {
        let own = sheet.bodies.iter().find(|b| b.ground && b.name.node == name.node);
        if let Some(own) = own {
            let merged = parts.joined.iter().position(|j| j.name == name.node);
            if merged.is_none() && parts.failed.is_empty() {
                let message = format!("nothing is merged into `{}`, so it is of no material", name.node);
                return self.fail(
                    Diagnostic::error(codes::MISSING, message, own.at)
                        .help(format!("write `place … merging GROUND into {}`", name.node)),
                );
            }
            return merged.ok_or(Failed);
        }
        let Some((instance, body)) = name.node.split_once('.') else {
            let grounds = sheet.bodies.iter().filter(|b| b.ground);
            let grounds = grounds.enumerate().map(|(i, b)| (b.name.node.clone(), i)).collect();
            return self.thing(scope, &grounds, name, "ground");
        };
        if parts.failed.contains(instance) {
            return Err(Failed);
        }
        let part = |node: &str, from: usize| {
            let start = name.at.start + from as u32;
            let at = Origin { start, end: start + node.len() as u32, ..name.at };
            Ident { node: node.into(), at }
        };
        let known = parts.instances.iter().enumerate().map(|(i, n)| (n.name.clone(), i)).collect();
        let i = self.thing(scope, &known, &part(instance, 0), "instance")?;
        let design = parts.instances.get(i).and_then(|n| parts.designs.get(n.design));
        let b = self.body_of(design, &part(body, instance.len() + 1))?;
        if !design.and_then(|d| d.bodies.get(b)).is_some_and(|b| b.ground) {
            return self.fail(
                Diagnostic::error(codes::FITTING, format!("`{}` moves", name.node), name.at)
                    .label("what is fitted beside instances stands still")
                    .help("write it in the mechanism that is placed, so that it moves along"),
            );
        }
        if let Some(joined) = parts.joined.iter().position(|j| j.members.contains(&(i, b))) {
            return Ok(joined);
        }
        let called = format!("{instance}_{body}");
        parts.join(None, (i, b), called, name.at);
        Ok(parts.joined.len() - 1)
    }

    /// A motor that turns a hinge of an instance takes the place of its bearing, and stands in its mechanism.
    fn turns_nothing(&mut self, mount: &Mount, joined: usize, parts: &Parts) -> Outcome<()> {
        let at = Vector3::from(self.start_point(mount.position));
        let members = parts.joined.get(joined).map_or(&[][..], |j| j.members.as_slice());
        for (i, b) in members {
            let Some(instance) = parts.instances.get(*i) else { continue };
            let Some(design) = parts.designs.get(instance.design) else { continue };
            let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
            let values = design.exprs.evaluate(&start);
            let here = design.joints.iter().find(|j| {
                !j.is_compliant()
                    && j.kind == JointKind::Hinge
                    && j.bodies.contains(b)
                    && (instance.placement.point(&values.point(j.point)) - at).norm() < SAME_POINT_MM
            });
            if let Some(joint) = here {
                let (name, joint) = (&design.name, instance.of(&joint.name));
                let message = format!("the motor of `{joint}` has to be mounted in `{name}` itself");
                return self.fail(
                    Diagnostic::error(codes::FITTING, message, mount.origin)
                        .label("it takes the place of a bearing of that hinge")
                        .help(format!(
                            "write the `mount` in `mechanism {name}`: every copy then has its own"
                        )),
                );
            }
        }
        Ok(())
    }
}
