//! Strips at a state in groups that are told apart as a whole.

use super::extent::{Bounds, Extent};
use super::strip::{Strip, StripGradient, strips};
use std::ops::Range;

/// Strips of a group at most.
const MOST: usize = 8;

/// Strips and where they are.
pub struct Placed {
    strips: Vec<Strip>,
    extents: Vec<Extent>,
    groups: Vec<Group>,
}

/// Neighbours in the list.
struct Group {
    members: Range<usize>,
    bounds: Bounds,
    /// Largest radius among them, mm.
    radius: f64,
}

impl Placed {
    /// Strips in their order; those of one group are all `together`.
    pub fn new(strips: Vec<Strip>, together: impl Fn(usize, usize) -> bool) -> Self {
        let extents: Vec<Extent> = strips.iter().map(Extent::new).collect();
        let mut groups = Vec::new();
        let mut start = 0;
        while start < strips.len() {
            let last = (start + 1..strips.len().min(start + MOST)).find(|i| !together(start, *i));
            let members = start..last.unwrap_or(strips.len().min(start + MOST));
            start = members.end;
            if let Some(bounds) = Bounds::around(&extents[members.clone()]) {
                let radius = strips[members.clone()].iter().map(|s| s.radius).fold(0.0, f64::max);
                groups.push(Group { members, bounds, radius });
            }
        }
        Self { strips, extents, groups }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.strips.len()
    }

    /// A strip and where it is.
    pub fn one(&self, i: usize) -> (&Strip, &Extent) {
        (&self.strips[i], &self.extents[i])
    }

    /// Whether none of these is nearer than the gap to one of the others.
    pub fn far(&self, others: &Self, gap_mm: f64) -> bool {
        let apart = |a: &Group, b: &Group| a.bounds.far(&b.bounds, a.radius + b.radius + gap_mm);
        self.groups.iter().all(|a| others.groups.iter().all(|b| apart(a, b)))
    }

    /// Calls `f` for each strip from number `from` on that is nearer to `a` than the gap, of those that `count`, in
    /// their order.
    pub fn near(
        &self,
        a: (&Strip, &Extent),
        from: usize,
        gap_mm: f64,
        mut f: impl FnMut(usize, f64, &[StripGradient; 2]),
        count: impl Fn(usize) -> bool,
    ) {
        let groups = self.groups.iter().filter(|g| g.members.end > from);
        for group in groups.filter(|g| !a.1.bounds.far(&g.bounds, a.0.radius + g.radius + gap_mm)) {
            for j in group.members.clone().filter(|j| *j >= from && count(*j)) {
                if let Some((value, by)) = strips(a, self.one(j), gap_mm) {
                    f(j, value, &by);
                }
            }
        }
    }
}
