//! How thin a carved link is: the widest way between any two of its ends, at its narrowest place.

use super::field::Field;
use super::link::{BodyPlan, Role};
use super::slot::Slot;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::Arc;

/// Step of the grid, mm.
const STEP_MM: f64 = 0.4;
/// Long bars are looked at in pieces of this length, whose boxes hold little else, mm.
const PIECE_MM: f64 = 8.0;
/// The middle of a wall lies between two nodes: on average the deeper one misses it by a quarter of a step.
const BETWEEN: f64 = 0.25;

/// The least wall on the way between a link's ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wall {
    /// There is no way.
    Apart,
    /// Its thickness, mm, to about half a step of the grid.
    Least(f64),
}

/// Place of a node in the grid, by z, y and x.
type Place = [i32; 3];
/// No node.
const NONE: u32 = u32::MAX;

/// What is left of a planned link: how deep the nodes of a grid lie inside of each of its slots. Only those inside of the
/// whole link are held: a frame of long bars fills little of the box around it.
#[derive(Clone)]
pub(super) struct Left<'p> {
    grid: Arc<Grid<'p>>,
    /// Depth of each entry of the grid.
    depths: Vec<f64>,
}

/// The nodes of a link before anything is taken out of it.
struct Grid<'p> {
    plan: &'p BodyPlan,
    origin: Vector3<f64>,
    /// Node and slot, sorted by nodes.
    entries: Vec<(u32, u32)>,
    /// Sorted.
    places: Vec<Place>,
    /// The six neighbours of each node.
    neighbours: Vec<[u32; 6]>,
}

impl<'p> Left<'p> {
    /// The whole link.
    pub(super) fn new(plan: &'p BodyPlan) -> Self {
        let least = plan.slots.iter().map(|(_, s)| s.start.inf(&s.end) - s.extent());
        let origin = least.fold(Vector3::repeat(f64::INFINITY), |low, corner| low.inf(&corner));
        let mut all: Vec<(Place, u32, f64)> = plan
            .slots
            .par_iter()
            .enumerate()
            .flat_map_iter(|(i, (_, slot))| {
                inside(slot, &origin).into_iter().map(move |(p, d)| (p, i as u32, d))
            })
            .collect();
        // A slot's pieces share the nodes on their common border.
        all.par_sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)));
        all.dedup_by_key(|(place, slot, _)| (*place, *slot));
        let mut places: Vec<Place> = Vec::new();
        let mut entries = Vec::with_capacity(all.len());
        for (place, slot, _) in &all {
            if places.last() != Some(place) {
                places.push(*place);
            }
            entries.push((places.len() as u32 - 1, *slot));
        }
        let neighbours = neighbours(&places);
        let depths = all.into_iter().map(|(_, _, depth)| depth).collect();
        Self { grid: Arc::new(Grid { plan, origin, entries, places, neighbours }), depths }
    }

    /// The same without what a flexure sweeps; that leaves the stub of the flexure itself alone.
    pub(super) fn without(&self, flexure: usize, swept: &Field) -> Self {
        let Grid { plan, origin, entries, places, .. } = &*self.grid;
        let own: Vec<bool> = plan.slots.iter().map(|(role, _)| *role == Role::Stub(flexure)).collect();
        let depths = entries.par_iter().zip(&self.depths).map(|((node, slot), depth)| {
            if *depth <= 0.0 || own[*slot as usize] {
                return *depth;
            }
            depth.min(swept.at(&point(origin, &places[*node as usize]), f64::INFINITY))
        });
        Self { grid: Arc::clone(&self.grid), depths: depths.collect() }
    }

    /// The least wall.
    pub(super) fn least_wall(&self) -> Wall {
        let Grid { plan, origin, entries, places, .. } = &*self.grid;
        if plan.slots.is_empty() {
            return Wall::Apart;
        }
        // The deepest of each place counts.
        let mut depth = vec![f64::NEG_INFINITY; places.len()];
        for ((node, _), own) in entries.iter().zip(&self.depths) {
            depth[*node as usize] = depth[*node as usize].max(*own);
        }
        // The ends: where something is attached, and where bars meet.
        let ends = plan.slots.iter().filter_map(|(role, s)| match role {
            Role::Bar | Role::Mount | Role::Plate(_) => None,
            Role::Stub(_) | Role::Eye(_) | Role::Boss | Role::Riser | Role::Guide(_) => Some(s.start),
        });
        let nearest = |p: Vector3<f64>| {
            let at = ((p - origin) / STEP_MM).map(|x| x.round() as i32);
            places.binary_search(&[at.z, at.y, at.x]).ok().filter(|i| depth[*i] > 0.0)
        };
        let Some(mut ends) = ends.map(nearest).collect::<Option<Vec<usize>>>() else {
            return Wall::Apart;
        };
        ends.sort_unstable();
        ends.dedup();
        match narrowest(&depth, &self.grid.neighbours, &ends) {
            Some(narrow) => Wall::Least(2.0 * narrow + 2.0 * BETWEEN * STEP_MM),
            None => Wall::Apart,
        }
    }
}

fn point(origin: &Vector3<f64>, [z, y, x]: &Place) -> Vector3<f64> {
    origin + Vector3::new(*x, *y, *z).cast::<f64>() * STEP_MM
}

/// Nodes inside of a slot, and how deep.
fn inside(slot: &Slot, origin: &Vector3<f64>) -> Vec<(Place, f64)> {
    let mut own = Vec::new();
    let pieces = ((slot.end - slot.start).norm() / PIECE_MM).ceil().max(1.0);
    for k in 0..pieces as usize {
        let [a, b] = [k, k + 1].map(|k| slot.start.lerp(&slot.end, k as f64 / pieces));
        let size = slot.extent();
        let low = ((a.inf(&b) - size - origin) / STEP_MM).map(|x| x.ceil() as i32);
        let high = ((a.sup(&b) + size - origin) / STEP_MM).map(|x| x.floor() as i32);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let depth = -slot.signed_distance(&point(origin, &[z, y, x]));
                    if depth > 0.0 {
                        own.push(([z, y, x], depth));
                    }
                }
            }
        }
    }
    own
}

/// The six neighbours of each of the places, which are sorted.
fn neighbours(places: &[Place]) -> Vec<[u32; 6]> {
    let mut out = vec![[NONE; 6]; places.len()];
    for (axis, before) in [(0, 0), (1, 2), (2, 4)] {
        // Both lists run in the same order.
        let mut at = 0;
        for (i, place) in places.iter().enumerate() {
            let mut next = *place;
            next[axis] += 1;
            while places.get(at).is_some_and(|p| *p < next) {
                at += 1;
            }
            if places.get(at) == Some(&next) {
                out[i][before + 1] = at as u32;
                out[at][before] = i as u32;
            }
        }
    }
    out
}

/// Depth at the narrowest place of the widest ways that join all `ends`: nodes are taken from the deepest on until the
/// ends hang together.
fn narrowest(depth: &[f64], neighbours: &[[u32; 6]], ends: &[usize]) -> Option<f64> {
    let mut order: Vec<usize> = (0..depth.len()).filter(|i| depth[*i] > 0.0).collect();
    order.par_sort_unstable_by(|i, j| depth[*j].total_cmp(&depth[*i]).then(i.cmp(j)));
    // Leader of each node that was taken, and how many ends hang at a leader.
    let mut leader = vec![usize::MAX; depth.len()];
    let mut hanging = vec![0_u32; depth.len()];
    ends.iter().for_each(|i| hanging[*i] = 1);
    let all = ends.len() as u32;
    for i in order {
        leader[i] = i;
        let mut own = i;
        for j in neighbours[i].iter().filter(|j| **j != NONE).map(|j| *j as usize) {
            if leader[j] == usize::MAX {
                continue;
            }
            let other = root(&mut leader, j);
            if other != own {
                leader[other] = own;
                hanging[own] += hanging[other];
            }
            own = root(&mut leader, own);
        }
        if hanging[own] == all {
            return Some(depth[i]);
        }
    }
    None
}

fn root(leader: &mut [usize], mut i: usize) -> usize {
    while leader[i] != i {
        leader[i] = leader[leader[i]];
        i = leader[i];
    }
    i
}
