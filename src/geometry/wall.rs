//! How thin a carved link is: the widest way between any two of its ends, at its narrowest place.

use super::field::Field;
use super::link::{BodyPlan, Role};
use nalgebra::Vector3;

/// Step of the grid, mm.
const STEP_MM: f64 = 0.4;
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
    let far = Vector3::repeat(f64::INFINITY);
    let (least, largest) = plan.slots.iter().fold((far, -far), |(low, high), (_, s)| {
        let size = s.extent();
        (low.inf(&(s.start.inf(&s.end) - size)), high.sup(&(s.start.sup(&s.end) + size)))
    });
    if plan.slots.is_empty() {
        return Wall::Apart;
    }
    let mut depth = Field::new(&least, &largest, STEP_MM, f64::NEG_INFINITY);
    for (role, slot) in &plan.slots {
        depth.near(slot, 0.0, |p, value| {
            let mut inside = -slot.signed_distance(p);
            if inside <= value.max(0.0) {
                return;
            }
            for (flexure, field) in swept {
                if *role != Role::Stub(*flexure) {
                    inside = inside.min(field.at(p, f64::INFINITY));
                }
            }
            *value = value.max(inside);
        });
    }
    // The ends: where something is attached, and where bars meet.
    let ends = plan.slots.iter().filter_map(|(role, s)| match role {
        Role::Bar => None,
        Role::Stub(_) | Role::Eye(_) | Role::Boss | Role::Riser | Role::Guide(_) => Some(s.start),
    });
    let mut ends: Vec<usize> = ends.map(|p| depth.nearest(&p)).collect();
    ends.sort_unstable();
    ends.dedup();
    match narrowest(&depth, &ends) {
        Some(narrow) => Wall::Least(2.0 * narrow + 2.0 * BETWEEN * depth.step),
        None => Wall::Apart,
    }
}

/// Depth at the narrowest place of the widest ways that join all `ends`: nodes are taken from the deepest on until the
/// ends hang together.
fn narrowest(depth: &Field, ends: &[usize]) -> Option<f64> {
    let mut order: Vec<usize> = (0..depth.values.len()).filter(|i| depth.values[*i] > 0.0).collect();
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
