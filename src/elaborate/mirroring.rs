//! `mirror`: the image of an instance, the bodies and motors it has in common with it, and whether one solution
//! serves both.
//!
//! A motor turns its image the other way. A motor that both have in common cannot do both: what the image then sees
//! is the motor's angle reversed (if the axis lies in the mirror plane). Over a cycle whose values are closed under
//! that reversal the image only goes through the same states in another order.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use super::instances::Parts;
use super::sheet::Sheet;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::assembly::PlacedDrive;
use crate::ir::{Design, Drive, Instance, Joint, JointKind, Placement};
use crate::syntax::ast;
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Directions that differ by less are one, and points of one axis (mm).
const SAME: f64 = 1e-9;
/// Mirror planes with the axis normal to each.
const PLANES: [(&str, usize); 3] = [("yz", 0), ("zx", 1), ("xy", 2)];

/// How a drive of an image belongs to one of the original.
#[derive(Clone, Copy)]
struct Image {
    /// The image's value is this (1 or −1) times the original's.
    factor: f64,
    /// They have one motor.
    common: bool,
}

impl<'a> Evaluator<'a> {
    /// All mirror images, whatever their order in the text.
    pub(super) fn mirrors(&mut self, sheet: &Sheet<'a>, parts: &mut Parts) {
        let mut left: Vec<_> = sheet.mirrors.iter().collect();
        while !left.is_empty() {
            let ready = |m: &ast::Mirror, p: &Parts| {
                p.instance(&m.of.node).is_some() || p.failed.contains(&m.of.node)
            };
            let Some(next) = left.iter().position(|(m, _)| ready(m, parts)) else { break };
            let (mirror, at) = left.remove(next);
            if self.mirror(mirror, *at, parts).is_err() {
                parts.failed.insert(mirror.name.node.clone());
            }
        }
        let waiting: BTreeSet<&str> = left.iter().map(|(m, _)| m.name.node.as_str()).collect();
        for (mirror, _) in &left {
            parts.failed.insert(mirror.name.node.clone());
            if waiting.contains(mirror.of.node.as_str()) {
                self.mirror_circle(mirror, &left);
            } else {
                let known = parts.instances.iter().enumerate().map(|(i, n)| (n.name.clone(), i)).collect();
                let _ = self.thing(0, &known, &mirror.of, "instance");
            }
        }
    }

    /// Reports images of each other, at the first of them.
    fn mirror_circle(&mut self, mirror: &ast::Mirror, left: &[&(&'a ast::Mirror, Origin)]) {
        let mut chain = vec![mirror];
        while let Some((next, _)) =
            left.iter().find(|(m, _)| chain.last().is_some_and(|c| c.of.node == m.name.node))
        {
            if next.name.node == mirror.name.node {
                let first = chain.iter().map(|m| m.name.at.start).min();
                if first != Some(mirror.name.at.start) {
                    return;
                }
                let mut names: Vec<&str> = chain.iter().map(|m| m.name.node.as_str()).collect();
                names.push(&mirror.name.node);
                self.out.push(
                    Diagnostic::error(
                        codes::CYCLE,
                        format!("these need each other in a circle: {}", names.join(" → ")),
                        mirror.of.at,
                    )
                    .help("one of them must be placed"),
                );
                return;
            }
            if chain.iter().any(|m| m.name.node == next.name.node) {
                return;
            }
            chain.push(next);
        }
    }

    fn mirror(&mut self, text: &'a ast::Mirror, at: Origin, parts: &mut Parts) -> Outcome<()> {
        let plane = PLANES.iter().find(|(name, _)| *name == text.plane.node);
        let Some((_, axis)) = plane else {
            return self.fail(
                Diagnostic::error(
                    codes::UNKNOWN_NAME,
                    format!("there is no plane `{}`", text.plane.node),
                    text.plane.at,
                )
                .help("planes are yz, zx and xy, through the origin"),
            );
        };
        let original = parts.instance(&text.of.node).ok_or(Failed)?;
        let Some(source) = parts.instances.get(original).cloned() else { return Err(Failed) };
        let Some(design) = parts.designs.get(source.design).cloned() else { return Err(Failed) };
        let placement = source.placement.mirrored(*axis);
        let mut shared: BTreeSet<usize> = BTreeSet::new();
        for name in &text.sharing {
            let body = self.body_of(Some(&design), name)?;
            if !shared.insert(body) {
                return self.fail(Diagnostic::error(
                    codes::DUPLICATE,
                    format!("`{}` is shared twice", name.node),
                    name.at,
                ));
            }
        }
        // What the original is merged with, the image is merged with.
        let merged = |b: &usize| parts.joined.iter().any(|j| j.members.contains(&(original, *b)));
        shared.extend(
            (0..design.bodies.len())
                .filter(|b| design.bodies.get(*b).is_some_and(|d| d.ground))
                .filter(merged),
        );
        for name in &text.sharing {
            let body = self.body_of(Some(&design), name)?;
            self.sharable(&design, body, &shared, name)?;
        }
        let images: Vec<Image> = design
            .drives
            .iter()
            .map(|d| self.image(&design, d, &shared, &source.placement, &placement, text))
            .collect::<Outcome<_>>()?;
        let (design_index, states) = self.states(&design, &source, &images, text, parts)?;
        let index = parts.instances.len();
        let mut drives = Vec::new();
        for (k, image) in images.iter().enumerate() {
            let kind = design.drives.get(k).and_then(|d| design.joints.get(d.joint()?)).map(|j| j.kind);
            drives.push(match source.drives.get(k) {
                Some(first) if image.common => {
                    PlacedDrive { motor: first.motor, sign: first.sign * image.factor }
                }
                // A string is shortened as much in the image.
                _ => parts.own_motor(index, k, kind.map_or(1.0, |kind| placement.sense(kind))),
            });
        }
        let name = text.name.node.clone();
        parts.instances.push(Instance { name, design: design_index, placement, states, drives, origin: at });
        for b in shared {
            let called = design.bodies.get(b).map_or("", |d| d.name.as_str());
            parts.join(Some((original, b)), (index, b), format!("{}_{called}", source.name), at);
        }
        Ok(())
    }

    /// A shared body moves alike in both halves, whatever the rest of them does: it is a ground, or a motor without
    /// flexures moves it relative to a shared body.
    fn sharable(
        &mut self,
        design: &Design,
        body: usize,
        shared: &BTreeSet<usize>,
        name: &ast::Ident,
    ) -> Outcome<()> {
        let ground = design.bodies.get(body).is_some_and(|b| b.ground);
        let held = design.drives.iter().filter_map(|d| design.joints.get(d.joint()?)).any(|j| {
            !j.is_compliant() && j.bodies.contains(&body) && j.bodies.iter().all(|b| shared.contains(b))
        });
        if ground || held {
            return Ok(());
        }
        self.fail(
            Diagnostic::error(
                codes::SHARED,
                format!("`{}` does not move alike in both halves", name.node),
                name.at,
            )
            .also(design.bodies.get(body).map_or(name.at, |b| b.origin), "this body")
            .help("grounds can be shared, and what a motor moves directly, by a conventional joint to a shared body"),
        )
    }

    fn image(
        &mut self,
        design: &Design,
        drive: &Drive,
        shared: &BTreeSet<usize>,
        from: &Placement,
        to: &Placement,
        text: &ast::Mirror,
    ) -> Outcome<Image> {
        let Some(joint) = drive.joint().and_then(|j| design.joints.get(j)) else {
            return Ok(Image { factor: 1.0, common: false });
        };
        if joint.is_compliant() || !joint.bodies.iter().all(|b| shared.contains(b)) {
            return Ok(Image { factor: 1.0, common: false });
        }
        if drive.free_rest.is_some() || !design.exprs.free_variables(&joint.point).is_empty() {
            return self.fail(
                Diagnostic::error(
                    codes::LATER_STATEMENT,
                    "a free place or rest pose of a motor in common is not available yet",
                    drive.origin,
                )
                .also(text.name.at, "in common with this image")
                .help("write numbers for them, or share grounds only"),
            );
        }
        match along_plane(design, joint, from, to) {
            Some(along) => {
                Ok(Image { factor: from.sense(joint.kind) * to.sense(joint.kind) * along, common: true })
            }
            None => self.fail(
                Diagnostic::error(
                    codes::SHARED,
                    format!("both halves cannot have the motor of `{}` in common", joint.name),
                    text.sharing.first().map_or(text.name.at, |n| n.at),
                )
                .label("its axis does not coincide with its mirror image")
                .also(joint.origin, "this joint")
                .help("its axis must lie in the mirror plane, or stand on it"),
            ),
        }
    }

    /// In which state of which design the image is at each state: the original's own where every value occurs,
    /// else a design of its own.
    fn states(
        &mut self,
        design: &Design,
        source: &Instance,
        images: &[Image],
        text: &ast::Mirror,
        parts: &mut Parts,
    ) -> Outcome<(usize, Vec<usize>)> {
        if let Some(states) = same_states(design, source, images) {
            return Ok((source.design, states));
        }
        if !source.states.is_empty() {
            return self.fail(
                Diagnostic::error(
                    codes::LATER_STATEMENT,
                    "the image of an image whose motor is driven the other way is not available yet",
                    text.of.at,
                )
                .help("mirror the placed instance instead"),
            );
        }
        let key = (source.design, images.iter().map(|i| i.factor < 0.0).collect::<Vec<_>>());
        if let Some(known) = parts.turned.get(&key) {
            return Ok((*known, Vec::new()));
        }
        let mut other = design.clone();
        other.name = text.name.node.clone();
        let Design { drives, exprs, .. } = &mut other;
        drives.iter_mut().zip(images).filter(|(_, i)| i.factor < 0.0).for_each(|(d, _)| d.reverse(exprs));
        for stretch in other.aims.workspaces.iter_mut().flat_map(|w| &mut w.stretches) {
            if images.get(stretch.drive).is_some_and(|i| i.factor < 0.0) {
                (stretch.from, stretch.to) = (-stretch.to, -stretch.from);
            }
        }
        parts.designs.push(other);
        parts.items.extend(parts.items.get(source.design).copied());
        let drawn = self.drawn.of.get(source.design).cloned();
        self.drawn.of.extend(drawn);
        let index = parts.designs.len() - 1;
        parts.turned.insert(key, index);
        Ok((index, Vec::new()))
    }
}

/// 1 if the image of a joint's axis is the axis, −1 if it is the axis reversed; none if it is another line. A slider
/// has a direction only.
fn along_plane(design: &Design, joint: &Joint, from: &Placement, to: &Placement) -> Option<f64> {
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let values = design.exprs.values(&start);
    let point = joint.point.map(|id| values.get(id.0 as usize).copied().unwrap_or(f64::NAN));
    let (p, q) = (from.point(&Vector3::from(point)), to.point(&Vector3::from(point)));
    let (a, b) = (from.direction(&Vector3::from(joint.axis)), to.direction(&Vector3::from(joint.axis)));
    let aside = (q - p).cross(&a).norm();
    if joint.kind != JointKind::Slider && (aside.is_nan() || aside > SAME) {
        return None;
    }
    [1.0, -1.0].into_iter().find(|s| (b - a * *s).norm() < SAME)
}

/// The original's state with the image's drive values, for every state; empty where they are the original's own.
/// Of several the one nearest to the cycle run backwards: then the order of time is kept. None: not all occur, or
/// the rest pose differs.
fn same_states(design: &Design, source: &Instance, images: &[Image]) -> Option<Vec<usize>> {
    let drives: Vec<(&Drive, f64)> = design.drives.iter().zip(images).map(|(d, i)| (d, i.factor)).collect();
    if drives.iter().all(|(_, f)| *f > 0.0) {
        return Some(source.states.clone());
    }
    if drives.iter().any(|(d, f)| !d.unit.closes(d.rest - f * d.rest)) {
        return None;
    }
    let n = design.cycle.steps;
    let at = |d: &Drive, s: usize| d.value(s as f64 / n as f64);
    let values: Vec<Vec<f64>> = (0..=n).map(|s| drives.iter().map(|(d, _)| at(d, s)).collect()).collect();
    // Loads keep their time: their sizes must agree too.
    let sizes = |s: usize| design.all_loads().map(move |l| l.size(s as f64 / n as f64));
    let alike = |s: usize, k: usize| {
        sizes(s).zip(sizes(k)).all(|(a, b)| (a - b).abs() <= SAME * a.abs().max(b.abs()))
    };
    let meets = |s: usize, k: usize| {
        let pairs = values.get(s)?.iter().zip(values.get(k)?).zip(&drives);
        Some(pairs.into_iter().all(|((v, w), (d, f))| d.unit.closes(w - f * v)))
    };
    (0..=n)
        .map(|s| {
            let here = source.state(s);
            let found = (0..=n).filter(|k| alike(here, *k) && meets(here, *k) == Some(true));
            found.min_by_key(|k| (k.abs_diff(n - s), *k))
        })
        .collect()
}
