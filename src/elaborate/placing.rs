//! Where instances stand, and which mechanisms place which.

use super::codes;
use super::load::Program;
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::Placement;
use crate::syntax::ast::{Ident, Item, Mechanism, Statement, StatementKind};
use nalgebra::{Rotation3, Unit, Vector3};

/// Sines and cosines this near to 0 and ±1 are exact: quarter turns keep flat faces flat.
const EXACT: f64 = 1e-15;

/// Turned by an angle (rad) about a unit axis through the origin, then moved there (mm).
pub fn placement(at: [f64; 3], angle_rad: f64, axis: [f64; 3]) -> Placement {
    let turned = Rotation3::from_axis_angle(&Unit::new_unchecked(Vector3::from(axis)), angle_rad);
    let exact = |x: f64| if (x - x.round()).abs() < EXACT { x.round() + 0.0 } else { x };
    Placement::new(&turned.matrix().map(exact), &Vector3::from(at))
}

/// The mechanisms that a mechanism places, with the place of each name.
fn places(m: &Mechanism) -> Vec<&Ident> {
    fn collect<'m>(statements: &'m [Statement], into: &mut Vec<&'m Ident>) {
        for s in statements {
            match &s.kind {
                StatementKind::Place(p) => into.push(&p.mechanism),
                StatementKind::For(f) => collect(&f.statements, into),
                _ => {}
            }
        }
    }
    let mut found = Vec::new();
    collect(&m.statements, &mut found);
    found
}

/// Items that the mechanism at `item` places.
pub fn placed_by(program: &Program, item: (usize, usize)) -> Vec<((usize, usize), Origin)> {
    let Some(Item::Mechanism(m)) = program.item(item) else { return Vec::new() };
    let Some(module) = program.modules.get(item.0) else { return Vec::new() };
    places(m).into_iter().filter_map(|name| Some((module.names.get(&name.node)?.item, name.at))).collect()
}

/// A circle that can be reached from `item`: its members in order, each with the place of the name that leads to
/// the next.
pub fn circle(program: &Program, item: (usize, usize)) -> Option<Vec<((usize, usize), Origin)>> {
    let mut chain: Vec<((usize, usize), Origin)> = Vec::new();
    let mut done = std::collections::BTreeSet::new();
    walk(program, item, &mut chain, &mut done)
}

type Step = ((usize, usize), Origin);

fn walk(
    program: &Program,
    item: (usize, usize),
    chain: &mut Vec<Step>,
    done: &mut std::collections::BTreeSet<(usize, usize)>,
) -> Option<Vec<Step>> {
    if let Some(first) = chain.iter().position(|(i, _)| *i == item) {
        return Some(chain.split_off(first));
    }
    if !done.insert(item) {
        return None;
    }
    for (next, at) in placed_by(program, item) {
        chain.push((item, at));
        if let Some(found) = walk(program, next, chain, done) {
            return Some(found);
        }
        chain.pop();
    }
    None
}

/// Reports mechanisms that place each other, each circle once.
pub fn circles(program: &Program, module: usize, out: &mut Vec<Diagnostic>) -> bool {
    let items = program.modules.get(module).map_or(0, |m| m.file.items.len());
    let mut told = std::collections::BTreeSet::new();
    let mut any = false;
    for i in 0..items {
        let Some(mut steps) = circle(program, (module, i)) else { continue };
        any = true;
        // From the member that stands first, so that it is one circle wherever it is entered.
        let first = steps.iter().enumerate().min_by_key(|(_, s)| s.0).map_or(0, |(k, _)| k);
        steps.rotate_left(first);
        let Some(((start, at), rest)) = steps.split_first().map(|(a, b)| (*a, b)) else { continue };
        if !told.insert(start) {
            continue;
        }
        let name = |item: (usize, usize)| match program.item(item) {
            Some(Item::Mechanism(m)) => m.name.node.clone(),
            _ => String::new(),
        };
        let mut chain: Vec<String> = steps.iter().map(|(i, _)| name(*i)).collect();
        chain.push(name(start));
        let mut d = Diagnostic::error(
            codes::CYCLE,
            format!("mechanisms place each other in a circle: {}", chain.join(" → ")),
            at,
        )
        .help("a mechanism cannot be a part of itself: take one of these lines out");
        for (item, place) in rest {
            d = d.also(*place, format!("`{}` places the next", name(*item)));
        }
        out.push(d);
    }
    any
}
