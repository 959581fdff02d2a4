//! Holes, motors, horns and solids beside instances: on grounds of the assembly's own and of instances, and on hinges of
//! instances.

use super::codes;
use super::drawn::Places;
use super::eval::{Evaluator, Failed, Outcome};
use super::instances::Parts;
use super::mechanism::Outside;
use super::sheet::Sheet;
use super::structure::{SAME_POINT_MM, StandingHinge, Structure};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::assembly::{HingeFitting, Hinged, InstanceHinge};
use crate::ir::expr::Node;
use crate::ir::{Design, Horn, JointKind, Mount, Placement};
use crate::syntax::ast::Ident;
use nalgebra::Vector3;

/// Sine of the angle between axes that count as one.
const PARALLEL: f64 = 1e-6;

impl<'a> Evaluator<'a> {
    /// All of them, each in its joined body.
    pub(super) fn own_fittings(
        &mut self,
        scope: usize,
        sheet: &Sheet<'a>,
        parts: &mut Parts,
        outside: &Outside<'_>,
        places: &mut Places,
    ) {
        let fitted = || sheet.mounts.iter().chain(&sheet.horns);
        let count = sheet.holes.len() + fitted().count() + sheet.solids.len();
        let first = sheet.holes.iter().map(|h| h.1).chain(fitted().map(|m| m.1)).next();
        let first = first.or(sheet.solids.first().map(|s| s.1)).unwrap_or_default();
        if count == 0 || self.limit(count, "holes, mounts, horns and solids", first).is_err() {
            return;
        }
        // Bodies by the names that the statements give them.
        let mut s = Structure::default();
        let bodies = sheet.holes.iter().map(|h| &h.0.body).chain(fitted().map(|m| &m.0.body));
        let bodies: Vec<&Ident> = bodies.chain(sheet.solids.iter().map(|s| &s.0.body)).collect();
        for name in bodies {
            if !s.body_index.contains_key(&name.node)
                && let Ok(joined) = self.standing_body(scope, name, sheet, parts)
            {
                s.body_index.insert(name.node.clone(), joined);
            }
        }
        s.standing = standing_hinges(parts);
        let known = |name: &Ident| s.body_index.contains_key(&name.node);
        for (text, at) in sheet.holes.iter().filter(|t| known(&t.0.body)) {
            let Ok((joined, mut hole)) = self.hole(scope, text, *at, &s) else { continue };
            let Ok(place) = self.standing_place(hole.position, *at, places) else { continue };
            hole.position = place;
            if self.stands_still(joined, &text.body, parts).is_ok() {
                parts.joined.get_mut(joined).into_iter().for_each(|j| j.holes.push(hole.clone()));
            }
        }
        for (text, at) in sheet.mounts.iter().filter(|t| known(&t.0.body)) {
            let Ok((joined, mut mount)) = self.mount(scope, outside.module, text, *at, &s) else { continue };
            let Ok(place) = self.standing_place(mount.position, *at, places) else { continue };
            let start = mount.toward.map(|q| Vector3::from(self.start_point(q)));
            let toward = mount.toward.map(|q| self.standing_place(q, *at, places)).transpose();
            let Ok(toward) = toward else { continue };
            (mount.position, mount.toward) = (place, toward);
            if let Some(hinge) = mount.joint {
                let hinges = coinciding(hinge, &text.body, &s, parts);
                mount.joint = hinges.first().map(|h| h.joint);
                mount_in_designs(&mount, start, &hinges, parts);
                let hinged = Hinged { hinges, fitting: HingeFitting::Mount(mount) };
                parts.joined.get_mut(joined).into_iter().for_each(|j| j.hinged.push(hinged.clone()));
            } else if self.stands_still(joined, &text.body, parts).is_ok() {
                parts.joined.get_mut(joined).into_iter().for_each(|j| j.fittings.mounts.push(mount.clone()));
            }
        }
        for (text, at) in sheet.horns.iter().filter(|t| known(&t.0.body)) {
            let Ok((joined, mut horn)) = self.horn(scope, outside.module, text, *at, &s) else { continue };
            let hinges = coinciding(horn.joint, &text.body, &s, parts);
            let Some(first) = hinges.first() else { continue };
            horn.joint = first.joint;
            for (h, _, design) in in_all(&hinges, parts) {
                let horn = Horn { joint: h.joint, ..horn.clone() };
                design.bodies.get_mut(h.body).into_iter().for_each(|b| b.fittings.horns.push(horn.clone()));
            }
            let hinged = Hinged { hinges, fitting: HingeFitting::Horn(horn) };
            parts.joined.get_mut(joined).into_iter().for_each(|j| j.hinged.push(hinged.clone()));
        }
        for (text, at) in sheet.solids.iter().filter(|t| known(&t.0.body)) {
            let Ok((joined, mut solid)) = self.solid(scope, text, *at, &s, outside) else { continue };
            let Ok(place) = self.standing_place(solid.position, *at, places) else { continue };
            solid.position = place;
            if self.stands_still(joined, &text.body, parts).is_ok() {
                parts.joined.get_mut(joined).into_iter().for_each(|j| j.fittings.solids.push(solid.clone()));
            }
        }
    }

    /// What is fitted beside instances moves with a body only on a hinge, which tells how.
    fn stands_still(&mut self, joined: usize, name: &Ident, parts: &Parts) -> Outcome<()> {
        let members = parts.joined.get(joined).map_or(&[][..], |j| j.members.as_slice());
        let moves = members.iter().any(|(i, b)| {
            let design = parts.instances.get(*i).and_then(|i| parts.designs.get(i.design));
            design.and_then(|d| d.bodies.get(*b)).is_some_and(|b| !b.ground)
        });
        if !moves {
            return Ok(());
        }
        self.fail(
            Diagnostic::error(codes::FITTING, format!("`{}` moves", name.node), name.at)
                .label("what is fitted beside instances stands still, but for motors and horns on a hinge")
                .help("write it in the mechanism that is placed, so that it moves along"),
        )
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
        if let Some(joined) = parts.joined.iter().position(|j| j.members.contains(&(i, b))) {
            return Ok(joined);
        }
        let called = format!("{instance}_{body}");
        parts.join(None, (i, b), called, name.at);
        Ok(parts.joined.len() - 1)
    }
}

/// Every conventional hinge of a member of a joined body, where it is at the start.
fn standing_hinges(parts: &Parts) -> Vec<StandingHinge> {
    let mut out = Vec::new();
    for (body, joined) in parts.joined.iter().enumerate() {
        for (i, b) in &joined.members {
            let Some(instance) = parts.instances.get(*i) else { continue };
            let Some(design) = parts.designs.get(instance.design) else { continue };
            let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
            let values = design.exprs.evaluate(&start);
            for (j, joint) in design.joints.iter().enumerate() {
                if joint.is_compliant() || joint.kind != JointKind::Hinge || !joint.bodies.contains(b) {
                    continue;
                }
                let place = &instance.placement;
                out.push(StandingHinge {
                    body,
                    at: place.point(&values.point(joint.point)).into(),
                    axis: place.direction(&Vector3::from(joint.axis)).into(),
                    of: InstanceHinge { instance: *i, joint: j, body: *b },
                });
            }
        }
    }
    out
}

/// A hinge with all that lie in its place and turn about its axis, that of the instance which `name` names first.
fn coinciding(hinge: usize, name: &Ident, s: &Structure<'_>, parts: &Parts) -> Vec<InstanceHinge> {
    let Some(first) = s.standing.get(hinge) else { return Vec::new() };
    let (at, axis) = (Vector3::from(first.at), Vector3::from(first.axis));
    let same = |h: &&StandingHinge| {
        h.body == first.body
            && (Vector3::from(h.at) - at).norm() < SAME_POINT_MM
            && Vector3::from(h.axis).cross(&axis).norm() < PARALLEL
    };
    let mut out: Vec<InstanceHinge> = s.standing.iter().filter(same).map(|h| h.of).collect();
    let named = name.node.split_once('.').and_then(|(i, _)| parts.instance(i));
    out.sort_by_key(|h| (Some(h.instance) != named, h.instance, h.joint));
    // Within one mechanism a motor stands on one hinge.
    out.dedup_by_key(|h| h.instance);
    out
}

/// Designs every instance of which has one of the hinges, each with its first hinge and the place of that instance: what stands
/// there stands in the design too, whose own gaps and collisions are with it.
fn in_all<'p>(
    hinges: &[InstanceHinge],
    parts: &'p mut Parts,
) -> impl Iterator<Item = (InstanceHinge, Placement, &'p mut Design)> {
    let Parts { designs, instances, .. } = parts;
    let of: Vec<_> = (0..designs.len())
        .map(|d| {
            let mut own = instances.iter().enumerate().filter(|(_, n)| n.design == d).map(|(i, _)| {
                let hinge = hinges.iter().find(|h| h.instance == i).copied();
                hinge.zip(instances.get(i).map(|n| n.placement))
            });
            let first = own.next().flatten();
            // Where hinges differ, no one of them stands for all.
            first.filter(|(f, _)| own.all(|o| o.is_some_and(|(h, _)| (h.joint, h.body) == (f.joint, f.body))))
        })
        .collect();
    designs.iter_mut().zip(of).filter_map(|(design, of)| of.map(|(hinge, place)| (hinge, place, design)))
}

fn mount_in_designs(
    mount: &Mount,
    toward: Option<Vector3<f64>>,
    hinges: &[InstanceHinge],
    parts: &mut Parts,
) {
    for (hinge, place, design) in in_all(hinges, parts) {
        let Some(position) = design.joints.get(hinge.joint).map(|j| j.point) else { continue };
        let along = mount.along.map(|d| place.direction_within(&Vector3::from(d)).into());
        let toward = toward.map(|q| {
            let q = place.point_within(&q);
            [q.x, q.y, q.z].map(|x| design.exprs.push(Node::Const(x)))
        });
        let mount = Mount { position, along, joint: Some(hinge.joint), toward, ..mount.clone() };
        design.bodies.get_mut(hinge.body).into_iter().for_each(|b| b.fittings.mounts.push(mount.clone()));
    }
}
