//! Block-structured symmetric systems, eliminated front by front (Duff and Reid, ACM Trans. Math. Softw. 9 (1983) 302):
//! definite ones in order, indefinite ones L D Lᵀ with 1×1 and 2×2 pivots of a threshold. What has no pivot in its front
//! (redundant constraints among them) waits for the next one, so that no small pivot is ever divided by.

use super::elimination::Elimination;
use super::ldlt::{Inertia, Ldlt, in_blocks};
use nalgebra::DMatrix;

/// A pivot counts if no multiplier becomes larger than the inverse of this.
const THRESHOLD: f64 = 0.05;

/// The entries of a system: of each front those of its own unknowns with each other and with its boundary.
#[derive(Clone, Debug)]
pub struct Blocks {
    parts: Vec<DMatrix<f64>>,
}

impl Blocks {
    /// Zero. Of symmetric systems the lower triangles are read, in the order of each front's unknowns.
    pub fn new(order: &Elimination) -> Self {
        let size = |f: &super::elimination::Front| f.own.len() + f.boundary.len();
        Self { parts: order.fronts.iter().map(|f| DMatrix::zeros(size(f), size(f))).collect() }
    }

    /// Adds the block of two bodies of which these are the first unknowns; `entry` is asked by row and column.
    pub fn add(&mut self, order: &Elimination, i: usize, j: usize, entry: impl Fn(usize, usize) -> f64) {
        let (front, row, column) = order.place(i, j);
        let part = &mut self.parts[front];
        for c in 0..super::elimination::NODE {
            for r in 0..super::elimination::NODE {
                part[(row + r, column + c)] += entry(r, c);
            }
        }
    }

    /// Adds to the entries of a row's unknown with a body's, on both sides of the diagonal.
    pub fn add_row(
        &mut self,
        order: &Elimination,
        unknown: usize,
        body: usize,
        entry: impl Fn(usize) -> f64,
    ) {
        let (front, row, column) = order.place(unknown, body);
        let part = &mut self.parts[front];
        for c in 0..super::elimination::NODE {
            part[(row, column + c)] += entry(c);
            part[(column + c, row)] += entry(c);
        }
    }

    /// Sets an entry of the diagonal.
    pub fn set_diagonal(&mut self, order: &Elimination, i: usize, value: f64) {
        let (front, at, _) = order.place(i, i);
        self.parts[front][(at, at)] = value;
    }

    /// An entry of the diagonal.
    pub fn diagonal(&self, order: &Elimination, i: usize) -> f64 {
        let (front, at, _) = order.place(i, i);
        self.parts[front][(at, at)]
    }

    /// Calls `f(i, j, entry)` for all lower triangles.
    pub fn for_each(&mut self, order: &Elimination, mut f: impl FnMut(usize, usize, &mut f64)) {
        for (part, front) in self.parts.iter_mut().zip(&order.fronts) {
            let n = part.nrows();
            let unknown = |k: usize| match front.own.get(k) {
                Some(u) => *u,
                None => front.boundary[k - front.own.len()],
            };
            let unknowns: Vec<usize> = (0..n).map(unknown).collect();
            for (j, column) in unknowns.iter().enumerate() {
                for (i, row) in unknowns.iter().enumerate().skip(j) {
                    f(*row, *column, &mut part[(i, j)]);
                }
            }
        }
    }

    /// Factors it as it is.
    pub fn factor(&self, order: &Elimination) -> Factors {
        if let ([all], true) = (&self.parts[..], order.is_dense()) {
            return Factors::Dense(Ldlt::new(all.clone()));
        }
        Factors::Fronts(Fronts::new(order, self))
    }

    /// Sign of the determinant, of all entries and not of the lower triangles: −1, 0 or 1. Fronts are eliminated by rows, without what a
    /// later front could give: for matrices whose diagonal blocks are sound.
    pub fn determinant_sign(&self, order: &Elimination) -> f64 {
        let mut sign = 1.0;
        let mut open: Vec<Vec<(Vec<usize>, DMatrix<f64>)>> = vec![Vec::new(); order.fronts.len()];
        let mut local = vec![0; order.unknowns()];
        for (f, (front, part)) in order.fronts.iter().zip(&self.parts).enumerate() {
            let mut a = part.clone();
            let unknowns = front.own.iter().chain(&front.boundary);
            unknowns.enumerate().for_each(|(k, u)| local[*u] = k);
            for (left, from) in std::mem::take(&mut open[f]) {
                for (j, column) in left.iter().enumerate() {
                    for (i, row) in left.iter().enumerate() {
                        a[(local[*row], local[*column])] += from[(i, j)];
                    }
                }
            }
            let (n, s) = (a.nrows(), front.own.len());
            for k in 0..s {
                let largest = (k..s).max_by(|i, j| a[(*i, k)].abs().total_cmp(&a[(*j, k)].abs()));
                let pivot = largest.unwrap_or(k);
                if pivot != k {
                    a.swap_rows(k, pivot);
                    sign = -sign;
                }
                let d = a[(k, k)];
                if d == 0.0 || d.is_nan() {
                    return 0.0;
                }
                sign *= d.signum();
                for j in k + 1..n {
                    let w = a[(k, j)] / d;
                    if w != 0.0 {
                        let (left, right) = a.as_mut_slice().split_at_mut(j * n);
                        let from = &left[k * n + k + 1..(k + 1) * n];
                        right[k + 1..n].iter_mut().zip(from).for_each(|(to, from)| *to -= from * w);
                    }
                }
            }
            if let Some(parent) = front.parent {
                open[parent].push((front.boundary.clone(), a.view((s, s), (n - s, n - s)).into_owned()));
            }
        }
        sign
    }
}

/// Factors of a block-structured symmetric system.
#[derive(Clone, Debug)]
pub enum Factors {
    /// Of one front.
    Dense(Ldlt),
    /// Of several.
    Fronts(Fronts),
}

impl Factors {
    /// Pivot signs.
    pub fn inertia(&self) -> Inertia {
        match self {
            Self::Dense(f) => f.inertia(),
            Self::Fronts(f) => f.inertia,
        }
    }

    /// Least size of a pivot.
    pub fn least_pivot(&self) -> f64 {
        match self {
            Self::Dense(f) => f.least_pivot(),
            Self::Fronts(f) => f.parts.iter().map(Part::least_pivot).fold(f64::INFINITY, f64::min),
        }
    }

    /// Solves for each column in place. Zero pivots give zero components.
    pub fn solve_in_place(&self, b: &mut DMatrix<f64>) {
        match self {
            Self::Dense(f) => f.solve_in_place(b),
            Self::Fronts(f) => f.solve_in_place(b),
        }
    }

    /// Solves for one right-hand side in place.
    pub fn solve_column(&self, b: &mut [f64]) {
        match self {
            Self::Dense(f) => f.solve_column(b),
            Self::Fronts(f) => f.solve_rows(b.as_chunks_mut::<1>().0),
        }
    }
}

/// D of a pivot.
#[derive(Clone, Copy, Debug)]
enum Pivot {
    One(f64),
    /// d, e, f of ((d, e), (e, f)).
    Two(f64, f64, f64),
}

impl Pivot {
    /// Of two, about that of the lesser eigenvalue.
    fn size(&self) -> f64 {
        match *self {
            Self::One(d) => d.abs(),
            Self::Two(d, e, f) => ((d / e) * (f / e) - 1.0).abs() * e.abs(),
        }
    }
}

#[derive(Clone, Debug)]
enum Part {
    /// The last front of a connected part: all is eliminated.
    Last { unknowns: Vec<usize>, factors: Ldlt },
    Inner {
        /// In the order of the pivots; behind them what is left.
        unknowns: Vec<usize>,
        pivots: Vec<Pivot>,
        /// Columns of L.
        l: DMatrix<f64>,
    },
}

impl Part {
    fn least_pivot(&self) -> f64 {
        match self {
            Self::Last { factors, .. } => factors.least_pivot(),
            Self::Inner { pivots, .. } => pivots.iter().map(Pivot::size).fold(f64::INFINITY, f64::min),
        }
    }
}

/// Factors of several fronts.
#[derive(Clone, Debug)]
pub struct Fronts {
    parts: Vec<Part>,
    inertia: Inertia,
}

/// What is left of a front: unknowns, of which the first so many wait for a pivot.
struct Left {
    unknowns: Vec<usize>,
    waiting: usize,
    matrix: DMatrix<f64>,
}

impl Fronts {
    fn new(order: &Elimination, blocks: &Blocks) -> Self {
        let mut this = Self { parts: Vec::with_capacity(order.fronts.len()), inertia: Inertia::default() };
        let mut open: Vec<Vec<Left>> = order.fronts.iter().map(|_| Vec::new()).collect();
        let mut local = vec![0; order.unknowns()];
        for (f, (front, block)) in order.fronts.iter().zip(&blocks.parts).enumerate() {
            let children = std::mem::take(&mut open[f]);
            let mut unknowns: Vec<usize> =
                children.iter().flat_map(|c| c.unknowns[..c.waiting].iter().copied()).collect();
            let waiting = unknowns.len();
            unknowns.extend(front.own.iter().chain(&front.boundary));
            unknowns.iter().enumerate().for_each(|(k, u)| local[*u] = k);
            let n = unknowns.len();
            let mut a = DMatrix::zeros(n, n);
            a.view_mut((waiting, waiting), block.shape()).copy_from(block);
            for child in &children {
                for (j, column) in child.unknowns.iter().enumerate() {
                    for (i, row) in child.unknowns.iter().enumerate().skip(j) {
                        let (r, c) = (local[*row], local[*column]);
                        a[(r.max(c), r.min(c))] += child.matrix[(i, j)];
                    }
                }
            }
            let Some(parent) = front.parent else {
                let factors = Ldlt::new(a);
                this.count(factors.inertia());
                this.parts.push(Part::Last { unknowns, factors });
                continue;
            };
            let count = waiting + front.own.len();
            let pivots = this.eliminate(&mut a, &mut unknowns, count);
            let done: usize = pivots.iter().map(|p| if matches!(p, Pivot::One(_)) { 1 } else { 2 }).sum();
            open[parent].push(Left {
                unknowns: unknowns[done..].to_vec(),
                waiting: count - done,
                matrix: a.view((done, done), (n - done, n - done)).into_owned(),
            });
            this.parts.push(Part::Inner { unknowns, pivots, l: a.columns(0, done).into_owned() });
        }
        this
    }

    fn count(&mut self, more: Inertia) {
        self.inertia.positive += more.positive;
        self.inertia.negative += more.negative;
        self.inertia.zero += more.zero;
    }

    /// Eliminates what has a pivot among the first `count` unknowns.
    fn eliminate(&mut self, a: &mut DMatrix<f64>, unknowns: &mut [usize], count: usize) -> Vec<Pivot> {
        let mut pivots = Vec::with_capacity(count);
        let mut k = 0;
        while let Some((p, q)) = pivot(a, k, count) {
            swap(a, unknowns, k, p);
            match q {
                None => {
                    let d = a[(k, k)];
                    if d == 0.0 {
                        self.inertia.zero += 1;
                    } else if d > 0.0 {
                        self.inertia.positive += 1;
                    } else {
                        self.inertia.negative += 1;
                    }
                    eliminate_one(a, k);
                    pivots.push(Pivot::One(d));
                    k += 1;
                }
                Some(q) => {
                    // The first swap may have moved it.
                    swap(a, unknowns, k + 1, if q == k { p } else { q });
                    let (d, e, f) = (a[(k, k)], a[(k + 1, k)], a[(k + 1, k + 1)]);
                    if (d / e) * (f / e) < 1.0 {
                        self.inertia.positive += 1;
                        self.inertia.negative += 1;
                    } else if d + f > 0.0 {
                        self.inertia.positive += 2;
                    } else {
                        self.inertia.negative += 2;
                    }
                    eliminate_two(a, k);
                    pivots.push(Pivot::Two(d, e, f));
                    k += 2;
                }
            }
        }
        pivots
    }

    fn solve_in_place(&self, b: &mut DMatrix<f64>) {
        in_blocks(b, |rows| self.solve_rows(rows));
    }

    fn solve_rows<const N: usize>(&self, b: &mut [[f64; N]]) {
        let gather = |b: &[[f64; N]], unknowns: &[usize]| unknowns.iter().map(|u| b[*u]).collect::<Vec<_>>();
        for part in &self.parts {
            match part {
                Part::Last { unknowns, factors } => {
                    let mut x = gather(b, unknowns);
                    factors.solve_rows(&mut x);
                    unknowns.iter().zip(x).for_each(|(u, x)| b[*u] = x);
                }
                Part::Inner { unknowns, pivots, l } => {
                    let mut x = gather(b, unknowns);
                    forward(pivots, l, &mut x);
                    unknowns.iter().zip(x).for_each(|(u, x)| b[*u] = x);
                }
            }
        }
        for part in self.parts.iter().rev() {
            if let Part::Inner { unknowns, l, .. } = part {
                let mut x = gather(b, unknowns);
                backward(l, &mut x);
                unknowns.iter().zip(x).take(l.ncols()).for_each(|(u, x)| b[*u] = x);
            }
        }
    }
}

/// L z = b, then D y = z.
fn forward<const N: usize>(pivots: &[Pivot], l: &DMatrix<f64>, x: &mut [[f64; N]]) {
    let mut k = 0;
    let take = |x: &mut [[f64; N]], k: usize, first: usize| {
        let from = x[k];
        for (to, w) in x[first..].iter_mut().zip(&l.as_slice()[k * l.nrows() + first..]) {
            (0..N).for_each(|c| to[c] -= w * from[c]);
        }
    };
    for pivot in pivots {
        match *pivot {
            Pivot::One(d) => {
                take(x, k, k + 1);
                x[k] = if d == 0.0 { [0.0; N] } else { x[k].map(|v| v / d) };
                k += 1;
            }
            Pivot::Two(d, e, f) => {
                take(x, k, k + 2);
                take(x, k + 1, k + 2);
                let determinant = (d / e) * (f / e) - 1.0;
                let (a, b) = (x[k], x[k + 1]);
                for c in 0..N {
                    x[k][c] = ((f / e) * (a[c] / e) - b[c] / e) / determinant;
                    x[k + 1][c] = ((d / e) * (b[c] / e) - a[c] / e) / determinant;
                }
                k += 2;
            }
        }
    }
}

/// Lᵀ x = y.
fn backward<const N: usize>(l: &DMatrix<f64>, x: &mut [[f64; N]]) {
    let n = l.nrows();
    for k in (0..l.ncols()).rev() {
        let mut own = x[k];
        for (from, w) in x[k + 1..].iter().zip(&l.as_slice()[k * n + k + 1..]) {
            (0..N).for_each(|c| own[c] -= w * from[c]);
        }
        x[k] = own;
    }
}

/// The first unknown from `k` on that is a sound pivot, by itself or with the second one; none if all that is left before
/// `count` has to wait.
fn pivot(a: &DMatrix<f64>, k: usize, count: usize) -> Option<(usize, Option<usize>)> {
    let n = a.nrows();
    let entry = |i: usize, j: usize| a[(i.max(j), i.min(j))].abs();
    for p in k..count {
        let (mut partner, mut inner, mut outer) = (p, 0.0, 0.0f64);
        for i in (k..n).filter(|i| *i != p) {
            let size = entry(i, p);
            if i < count && size > inner {
                (partner, inner) = (i, size);
            }
            outer = outer.max(size);
        }
        let d = a[(p, p)];
        if d.abs() >= THRESHOLD * outer {
            return Some((p, None));
        }
        if inner > 0.0 {
            let f = a[(partner, partner)];
            let rest = |c: usize| {
                (k..n).filter(|i| *i != p && *i != partner).map(|i| entry(i, c)).fold(0.0, f64::max)
            };
            let (x, y) = (rest(p), rest(partner));
            // Multipliers are at most |P⁻¹| (x, y).
            let determinant = ((d / inner) * (f / inner) - 1.0).abs() * inner;
            let first = (f.abs() / inner * x + y) / determinant;
            let second = (x + d.abs() / inner * y) / determinant;
            if first.max(second) <= 1.0 / THRESHOLD {
                return Some((p, Some(partner)));
            }
        }
    }
    None
}

/// Symmetric interchange, in L too.
fn swap(a: &mut DMatrix<f64>, unknowns: &mut [usize], p: usize, q: usize) {
    if p == q {
        return;
    }
    let (p, q) = (p.min(q), p.max(q));
    for j in 0..p {
        a.swap((p, j), (q, j));
    }
    for j in p + 1..q {
        a.swap((j, p), (q, j));
    }
    for i in q + 1..a.nrows() {
        a.swap((i, p), (i, q));
    }
    a.swap((p, p), (q, q));
    unknowns.swap(p, q);
}

fn eliminate_one(a: &mut DMatrix<f64>, k: usize) {
    let n = a.nrows();
    let d = a[(k, k)];
    let (left, right) = a.as_mut_slice().split_at_mut((k + 1) * n);
    let pivot = &mut left[k * n..];
    if d == 0.0 {
        // All of the column is zero.
        return;
    }
    for (j, column) in (k + 1..n).zip(right.chunks_exact_mut(n)) {
        let w = pivot[j] / d;
        if w != 0.0 {
            column[j..].iter_mut().zip(&pivot[j..]).for_each(|(to, from)| *to -= from * w);
        }
    }
    pivot[k + 1..].iter_mut().for_each(|v| *v /= d);
}

fn eliminate_two(a: &mut DMatrix<f64>, k: usize) {
    let n = a.nrows();
    let (d, e, f) = (a[(k, k)], a[(k + 1, k)], a[(k + 1, k + 1)]);
    let determinant = (d / e) * (f / e) - 1.0;
    let (left, right) = a.as_mut_slice().split_at_mut((k + 2) * n);
    let (first, second) = left[k * n..].split_at_mut(n);
    // L has no entry within the pivot.
    first[k + 1] = 0.0;
    for (j, column) in (k + 2..n).zip(right.chunks_exact_mut(n)) {
        let (x, y) = (first[j], second[j]);
        let w = ((f / e) * (x / e) - y / e) / determinant;
        let v = ((d / e) * (y / e) - x / e) / determinant;
        if w != 0.0 || v != 0.0 {
            for ((to, p), q) in column[j..].iter_mut().zip(&first[j..]).zip(&second[j..]) {
                *to -= p * w + q * v;
            }
        }
        // Row j of these columns is not read again by later j.
        (first[j], second[j]) = (w, v);
    }
}

#[cfg(test)]
mod tests {
    use super::super::elimination::{NODE, Pair};
    use super::super::ldlt::BLOCK;
    use super::*;
    use nalgebra::SymmetricEigen;

    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*seed >> 11) as f64) / (1u64 << 53) as f64 - 0.5
    }

    /// Chains of three on body 0; of the rows some are twice there, and the last ones hold body 0 to ground.
    fn example(chains: usize) -> (Elimination, Vec<Pair>) {
        let mut rows = Vec::new();
        for chain in 0..chains {
            for k in 0..3 {
                let body = 1 + 3 * chain + k;
                let before = if k == 0 { 0 } else { body - 1 };
                rows.extend([[Some(before), Some(body)]; 7]);
            }
        }
        rows.extend([[Some(0), None]; 4]);
        (Elimination::new(1 + 3 * chains, &[], &rows), rows)
    }

    fn filled(order: &Elimination, rows: &[Pair], seed: u64, definite: bool) -> (Blocks, DMatrix<f64>) {
        let (n, all) = (order.freedoms, order.unknowns());
        let mut seed = seed;
        let mut blocks = Blocks::new(order);
        for body in 0..n / NODE {
            let m = DMatrix::from_fn(NODE, NODE, |_, _| noise(&mut seed));
            let h = if definite {
                &m * m.transpose() + DMatrix::identity(NODE, NODE) * 9.0
            } else {
                &m + m.transpose()
            };
            blocks.add(order, NODE * body, NODE * body, |r, c| h[(r, c)]);
        }
        let mut last = [[0.0; NODE]; 2];
        for (r, pair) in rows.iter().enumerate() {
            // Every third row repeats the one before where it belongs to the same bodies.
            if r % 3 != 2 || rows[r - 1] != *pair {
                last = std::array::from_fn(|_| std::array::from_fn(|_| noise(&mut seed)));
            }
            for (half, body) in pair.iter().enumerate() {
                if let Some(body) = body {
                    blocks.add_row(order, n + r, NODE * body, |c| last[half][c]);
                }
            }
            blocks.set_diagonal(order, n + r, -1e-10);
        }
        let mut dense = DMatrix::zeros(all, all);
        blocks.clone().for_each(order, |i, j, v| {
            dense[(i, j)] += *v;
            if i != j {
                dense[(j, i)] += *v;
            }
        });
        (blocks, dense)
    }

    #[test]
    fn solves_and_counts_like_one_dense_matrix() {
        for seed in 0..6 {
            let (order, rows) = example(8);
            assert!(!order.is_dense());
            let (blocks, dense) = filled(&order, &rows, seed * 77 + 5, seed % 2 == 0);
            let factors = blocks.factor(&order);
            let eigen = SymmetricEigen::new(dense.clone()).eigenvalues;
            assert_eq!(factors.inertia().negative, eigen.iter().filter(|v| **v < 0.0).count(), "seed {seed}");
            assert_eq!(factors.inertia().positive, eigen.iter().filter(|v| **v > 0.0).count());
            let b = DMatrix::from_fn(dense.nrows(), BLOCK + 3, |i, c| (i as f64 + 0.3 * c as f64).sin());
            // In the range of what is no redundant row, or these would be divided by 1e-10.
            let b = &dense * &b;
            let mut x = b.clone();
            factors.solve_in_place(&mut x);
            assert!(
                (&dense * &x - &b).amax() < 1e-12 * b.amax().max(x.amax()),
                "{}",
                (&dense * &x - &b).amax()
            );
            let mut one = b.column(2).into_owned();
            factors.solve_column(one.as_mut_slice());
            assert_eq!(one, x.column(2));
        }
    }

    #[test]
    fn knows_the_sign_of_the_determinant() {
        for seed in 0..6 {
            let (order, rows) = example(8);
            let bare = Elimination::new(25, &rows, &[]);
            let (blocks, _) = filled(&bare, &[], seed + 1, true);
            assert_eq!(blocks.determinant_sign(&bare), 1.0);
            // Coupled, and with a few signs turned.
            let mut blocks = blocks;
            let mut state = seed + 9;
            for [a, b] in &rows {
                if let (Some(a), Some(b)) = (a, b) {
                    let (x, y) = (noise(&mut state), noise(&mut state));
                    blocks.add(&bare, NODE * a, NODE * b, |r, c| x * (r as f64 + 1.3 * c as f64).sin());
                    blocks.add(&bare, NODE * b, NODE * a, |r, c| y * (r as f64 - 0.7 * c as f64).cos());
                }
            }
            for i in 0..seed as usize {
                let d = blocks.diagonal(&bare, 7 * i);
                blocks.set_diagonal(&bare, 7 * i, -3.0 * d);
            }
            let mut plain = DMatrix::<f64>::zeros(150, 150);
            for (front, part) in bare.fronts.iter().zip(&blocks.parts) {
                let list: Vec<usize> = front.own.iter().chain(&front.boundary).copied().collect();
                list.iter().enumerate().for_each(|(i, r)| {
                    list.iter().enumerate().for_each(|(j, c)| plain[(*r, *c)] += part[(i, j)]);
                });
            }
            assert_eq!(blocks.determinant_sign(&bare), plain.lu().determinant().signum(), "seed {seed}");
            assert_eq!(order.freedoms, bare.freedoms);
        }
    }
}
