//! How thin a carved link is: the widest way between any two of its ends, at its narrowest place.

use super::field::Field;
use super::link::{BodyPlan, Role};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;

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

/// The least wall of a planned link without what each flexure of `swept` takes out of it; that leaves the stub of the
/// flexure itself alone.
pub(super) fn least_wall(plan: &BodyPlan, swept: &[(usize, &Field)]) -> Wall {
    let least = plan.slots.iter().map(|(_, s)| s.start.inf(&s.end) - s.extent());
    let least = least.fold(Vector3::repeat(f64::INFINITY), |low, corner| low.inf(&corner));
    if plan.slots.is_empty() {
        return Wall::Apart;
    }
    let depth = Depth::new(least, plan, swept);
    // The ends: where something is attached, and where bars meet.
    let ends = plan.slots.iter().filter_map(|(role, s)| match role {
        Role::Bar | Role::Mount | Role::Plate(_) => None,
        Role::Stub(_) | Role::Eye(_) | Role::Boss | Role::Riser | Role::Guide(_) => Some(s.start),
    });
    let Some(mut ends) = ends.map(|p| depth.nearest(&p)).collect::<Option<Vec<usize>>>() else {
        return Wall::Apart;
    };
    ends.sort_unstable();
    ends.dedup();
    match narrowest(&depth, &ends) {
        Some(narrow) => Wall::Least(2.0 * narrow + 2.0 * BETWEEN * STEP_MM),
        None => Wall::Apart,
    }
}

/// Place of a node in the grid, by z, y and x.
type Place = [i32; 3];

/// How deep the nodes of a grid lie inside of a link. Only those inside are held: a frame of long bars fills little of the
/// box around it.
struct Depth {
    origin: Vector3<f64>,
    places: Vec<Place>,
    values: Vec<f64>,
    index: HashMap<Place, usize>,
}

impl Depth {
    fn new(origin: Vector3<f64>, plan: &BodyPlan, swept: &[(usize, &Field)]) -> Self {
        let mut all: Vec<(Place, f64)> = plan
            .slots
            .par_iter()
            .flat_map_iter(|(role, slot)| {
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
                                let p = origin + Vector3::new(x, y, z).cast::<f64>() * STEP_MM;
                                let mut inside = -slot.signed_distance(&p);
                                for (flexure, field) in swept {
                                    if inside > 0.0 && *role != Role::Stub(*flexure) {
                                        inside = inside.min(field.at(&p, f64::INFINITY));
                                    }
                                }
                                if inside > 0.0 {
                                    own.push(([z, y, x], inside));
                                }
                            }
                        }
                    }
                }
                own
            })
            .collect();
        // The deepest of each place counts.
        all.par_sort_unstable_by(|(p, a), (q, b)| p.cmp(q).then(b.total_cmp(a)));
        all.dedup_by_key(|(place, _)| *place);
        let (places, values): (Vec<Place>, Vec<f64>) = all.into_iter().unzip();
        let index = places.iter().enumerate().map(|(i, p)| (*p, i)).collect();
        Self { origin, places, values, index }
    }

    /// Those of the six neighbours of a node that are inside.
    fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> {
        let [z, y, x] = self.places[i];
        let all = [[z, y, x - 1], [z, y, x + 1], [z, y - 1, x], [z, y + 1, x], [z - 1, y, x], [z + 1, y, x]];
        all.into_iter().filter_map(|p| self.index.get(&p).copied())
    }

    /// The node nearest to a point, if it is inside.
    fn nearest(&self, p: &Vector3<f64>) -> Option<usize> {
        let at = ((p - self.origin) / STEP_MM).map(|x| x.round() as i32);
        self.index.get(&[at.z, at.y, at.x]).copied()
    }
}

/// Depth at the narrowest place of the widest ways that join all `ends`: nodes are taken from the deepest on until the
/// ends hang together.
fn narrowest(depth: &Depth, ends: &[usize]) -> Option<f64> {
    let mut order: Vec<usize> = (0..depth.values.len()).collect();
    order.sort_by(|i, j| depth.values[*j].total_cmp(&depth.values[*i]).then(i.cmp(j)));
    // Leader of each node that was taken, and how many ends hang at a leader.
    let mut leader = vec![usize::MAX; depth.values.len()];
    let mut hanging = vec![0_u32; depth.values.len()];
    ends.iter().for_each(|i| hanging[*i] = 1);
    let all = ends.len() as u32;
    for i in order {
        leader[i] = i;
        let mut own = i;
        for j in depth.neighbours(i) {
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
            return Some(depth.values[i]);
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
