//! In which order the bodies of a large mechanism are eliminated, so that cost grows with the number of bodies and not with
//! its cube: minimum degree (Tinney and Walker, Proc. IEEE 55 (1967) 1801) on the graph of what couples them, groups of
//! few bodies being one front (Duff and Reid, ACM Trans. Math. Softw. 9 (1983) 302).

/// Unknowns of a body.
pub const NODE: usize = 6;
/// Up to so many bodies one dense front is as fast.
const DENSE: usize = 16;
/// Bodies of one front, unless its neighbours are more: large enough for dense loops and free choice of pivots.
const GROUP: usize = 8;

/// The bodies that something couples; none is ground.
pub type Pair = [Option<usize>; 2];

/// Unknowns that are eliminated together.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    /// What is eliminated here: bodies' unknowns, then rows.
    pub own: Vec<usize>,
    /// Unknowns of later fronts that it is coupled with.
    pub boundary: Vec<usize>,
    /// The front that takes over what is left of this one.
    pub parent: Option<usize>,
}

/// Fronts in the order of their elimination. Unknowns are six a body, then one a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Elimination {
    /// Children before parents.
    pub fronts: Vec<Front>,
    /// Number of bodies' unknowns.
    pub freedoms: usize,
    /// Per unknown its front and its place there.
    owner: Vec<(usize, usize)>,
}

impl Elimination {
    /// For `bodies` moving bodies, of which `pairs` are coupled, and rows (multipliers) that belong to the bodies `rows`.
    pub fn new(bodies: usize, pairs: &[Pair], rows: &[Pair]) -> Self {
        let freedoms = NODE * bodies;
        let groups = if bodies <= DENSE {
            vec![Group { bodies: (0..bodies).collect(), boundary: Vec::new(), parent: None }]
        } else {
            Group::all(bodies, pairs.iter().chain(rows))
        };
        let mut group_of = vec![0; bodies];
        for (g, group) in groups.iter().enumerate() {
            group.bodies.iter().for_each(|b| group_of[*b] = g);
        }
        let unknowns = |bodies: &[usize]| bodies.iter().flat_map(|b| NODE * b..NODE * (b + 1)).collect();
        let mut fronts: Vec<Front> = groups
            .iter()
            .map(|g| Front { own: unknowns(&g.bodies), boundary: unknowns(&g.boundary), parent: g.parent })
            .collect();
        for (row, pair) in rows.iter().enumerate() {
            let first = pair.iter().flatten().map(|b| group_of[*b]).min();
            if let Some(front) = fronts.get_mut(first.unwrap_or(groups.len() - 1)) {
                front.own.push(freedoms + row);
            }
        }
        let mut owner = vec![(0, 0); freedoms + rows.len()];
        for (f, front) in fronts.iter().enumerate() {
            front.own.iter().enumerate().for_each(|(place, unknown)| owner[*unknown] = (f, place));
        }
        Self { fronts, freedoms, owner }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.owner.len()
    }

    /// Whether all is one front, in the order of the unknowns.
    pub fn is_dense(&self) -> bool {
        self.fronts.len() == 1
    }

    /// The front in which the block of two unknowns is, and the place there of each.
    pub fn place(&self, i: usize, j: usize) -> (usize, usize, usize) {
        let front = self.owner[i].0.min(self.owner[j].0);
        (front, self.local(front, i), self.local(front, j))
    }

    fn local(&self, front: usize, unknown: usize) -> usize {
        let (own, place) = self.owner[unknown];
        if own == front {
            return place;
        }
        let front = &self.fronts[front];
        // What is coupled is on the boundary.
        front.own.len() + front.boundary.binary_search(&unknown).unwrap_or_default()
    }

    /// Work of one elimination: the cube of the number of bodies where all is one front.
    pub fn work(&self) -> f64 {
        let part = |f: &Front| {
            let own = f.own.iter().filter(|u| **u < self.freedoms).count() as f64 / NODE as f64;
            own * (own + f.boundary.len() as f64 / NODE as f64).powi(2)
        };
        self.fronts.iter().map(part).sum()
    }
}

/// A front, as bodies.
struct Group {
    bodies: Vec<usize>,
    boundary: Vec<usize>,
    parent: Option<usize>,
}

impl Group {
    fn all<'a>(bodies: usize, pairs: impl Iterator<Item = &'a Pair>) -> Vec<Self> {
        let mut graph = Graph::new(bodies);
        for pair in pairs {
            if let [Some(a), Some(b)] = pair
                && a != b
            {
                graph.couple(*a, *b);
            }
        }
        let order = graph.eliminate();
        let mut turn = vec![0; bodies];
        order.iter().enumerate().for_each(|(t, (body, _))| turn[*body] = t);
        // Each body's front goes to that of the neighbour eliminated next.
        let parent: Vec<Option<usize>> =
            order.iter().map(|(_, around)| around.iter().map(|b| turn[*b]).min()).collect();
        // The last body of each group, as its turn; small groups join their parents.
        let mut top: Vec<usize> = (0..bodies).collect();
        let mut members: Vec<Vec<usize>> = order.iter().map(|(body, _)| vec![*body]).collect();
        for t in 0..bodies {
            if let Some(p) = parent[t]
                && members[t].len() + members[p].len() <= GROUP
            {
                let own = std::mem::take(&mut members[t]);
                members[p].extend(own);
                top[t] = p;
            }
        }
        let tops: Vec<usize> = (0..bodies).filter(|t| top[*t] == *t).collect();
        // Parents have later turns: their tops are known when they are asked for.
        for t in (0..bodies).rev() {
            top[t] = top[top[t]];
        }
        let number = |t: usize| tops.binary_search(&top[t]).ok();
        tops.iter()
            .map(|t| {
                let mut bodies = std::mem::take(&mut members[*t]);
                bodies.sort_unstable();
                Self { bodies, boundary: order[*t].1.clone(), parent: parent[*t].and_then(number) }
            })
            .collect()
    }
}

/// Who is coupled with whom, a row of bits a body.
struct Graph {
    bits: Vec<Vec<u64>>,
}

impl Graph {
    fn new(bodies: usize) -> Self {
        Self { bits: vec![vec![0; bodies.div_ceil(64)]; bodies] }
    }

    fn couple(&mut self, a: usize, b: usize) {
        self.bits[a][b / 64] |= 1 << (b % 64);
        self.bits[b][a / 64] |= 1 << (a % 64);
    }

    fn around(&self, a: usize) -> Vec<usize> {
        let bit = |b: &usize| self.bits[a][b / 64] >> (b % 64) & 1 == 1;
        (0..self.bits.len()).filter(bit).collect()
    }

    /// Bodies by least number of neighbours when their turn comes, each with these.
    fn eliminate(mut self) -> Vec<(usize, Vec<usize>)> {
        let mut left: Vec<usize> = (0..self.bits.len()).collect();
        let mut order = Vec::with_capacity(left.len());
        let degree = |row: &[u64]| row.iter().map(|w| w.count_ones()).sum::<u32>();
        let mut degrees: Vec<u32> = self.bits.iter().map(|row| degree(row)).collect();
        while let Some(at) = (0..left.len()).min_by_key(|i| (degrees[left[*i]], left[*i])) {
            let body = left.swap_remove(at);
            let around = self.around(body);
            let row = std::mem::take(&mut self.bits[body]);
            for a in &around {
                let own = &mut self.bits[*a];
                own.iter_mut().zip(&row).for_each(|(to, from)| *to |= from);
                own[a / 64] &= !(1 << (a % 64));
                own[body / 64] &= !(1 << (body % 64));
                degrees[*a] = degree(own);
            }
            order.push((body, around));
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_on_a_hub_leave_small_fronts() {
        // Forty chains of five bodies, all of them on body 0.
        let mut pairs = vec![[Some(0), None]];
        for chain in 0..40 {
            for k in 0..5 {
                let body = 1 + 5 * chain + k;
                pairs.push([Some(if k == 0 { 0 } else { body - 1 }), Some(body)]);
            }
        }
        let rows: Vec<Pair> = pairs.clone();
        let e = Elimination::new(201, &pairs, &rows);
        let largest = e.fronts.iter().map(|f| f.own.len() + f.boundary.len()).max();
        assert!(largest <= Some((NODE + 1) * (GROUP + 1)), "{largest:?}");
        assert!(e.work() < 1e-3 * 201f64.powi(3));
        let mut seen: Vec<usize> = e.fronts.iter().flat_map(|f| f.own.clone()).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..e.unknowns()).collect::<Vec<_>>());
        for (f, front) in e.fronts.iter().enumerate() {
            assert_eq!(front.parent.is_none(), front.boundary.is_empty());
            assert!(front.parent.is_none_or(|p| p > f));
            for u in &front.boundary {
                assert!(e.owner[*u].0 > f);
                // What is left of it fits into the parent.
                let parent = &e.fronts[front.parent.unwrap()];
                assert!(parent.own.contains(u) || parent.boundary.contains(u));
            }
        }
        for (row, pair) in rows.iter().enumerate() {
            for body in pair.iter().flatten() {
                let (front, i, j) = e.place(e.freedoms + row, NODE * body);
                let list: Vec<usize> =
                    e.fronts[front].own.iter().chain(&e.fronts[front].boundary).copied().collect();
                assert_eq!((list[i], list[j]), (e.freedoms + row, NODE * body));
            }
        }
    }
}
