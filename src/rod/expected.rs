//! Forces that an increment leads to, to first order, and the Hessian formed with them.
//!
//! A thin rod is 10⁴ times stiffer in stretch than in bending, so an increment that is right but for its curvature
//! leaves axial forces far beyond those of any equilibrium near. Newton's method then spends its iterations on them, or
//! finds a Hessian that is not definite. Where the geometric stiffness is formed with the forces *expected* by the
//! linear increment, as if they were unknowns of their own, it does neither: the residual, and so what is converged to,
//! stay the same (Magisano, Leonetti & Garcea, Comput. Methods Appl. Mech. Eng. 313 (2017), "mixed integration
//! points"). At an accepted state the Hessian is the exact one.

use super::Rod;
use super::assemble::{FIRST_INTERNAL, RodSystem, end_coordinates};
use super::stencil::Local;
use nalgebra::{SVector, Vector3};

/// Axial force per edge (N) and the moments conjugate to κ₁, κ₂, τ per vertex (N·mm), or changes of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RodForces {
    /// Per edge; zero in the clamped ones.
    pub axial: Vec<f64>,
    /// Per vertex; the first is unused.
    pub moments: Vec<[f64; 3]>,
}

impl RodForces {
    pub(crate) fn zeros(n: usize) -> Self {
        Self { axial: vec![0.0; n], moments: vec![[0.0; 3]; n] }
    }

    /// Adds `scale` times others.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        for (to, from) in self.axial.iter_mut().zip(&other.axial) {
            *to += scale * from;
        }
        for (to, from) in self.moments.iter_mut().zip(&other.moments) {
            for (to, from) in to.iter_mut().zip(from) {
                *to += scale * from;
            }
        }
    }
}

impl RodSystem {
    /// Forces of the last assembled state.
    pub fn forces(&self) -> &RodForces {
        &self.forces
    }

    /// First-order change of the forces by an increment from [`Self::back_substitute`] or
    /// [`Self::back_substitute_rate`] for the links' `d_link`.
    pub fn force_change(
        &mut self,
        rod: &Rod,
        increment: &[f64],
        d_link: &SVector<f64, 12>,
        out: &mut RodForces,
    ) {
        let n = self.n;
        let mut chain = *d_link;
        let band = 4 * n - 11;
        if let Some(slip) = increment.get(band..band + 3) {
            let mut b = chain.fixed_rows_mut::<3>(6);
            b -= Vector3::from_column_slice(slip);
        }
        let ends = [0, 1].map(|end| self.jacobians[end] * chain.fixed_rows::<6>(6 * end));
        let mut all = std::mem::take(&mut self.coordinates);
        for (end, carried) in ends.iter().enumerate() {
            for (at, value) in end_coordinates(end, n).into_iter().zip(carried.iter()) {
                all[at] = *value;
            }
        }
        for (to, from) in all[FIRST_INTERNAL..FIRST_INTERNAL + band].iter_mut().zip(increment) {
            *to = *from;
        }
        let slot = |k: usize| Vector3::new(all[4 * k], all[4 * k + 1], all[4 * k + 2]);
        let mut before: Local = [0.0; 4];
        let mut start = Vector3::zeros();
        for j in 0..n {
            let end = slot(j + 1);
            // Slot 0 and slot n are those of the clamped edges themselves.
            let e = match j {
                0 => slot(0),
                j if j == n - 1 => end,
                _ => end - start,
            };
            start = end;
            let f = &self.frames[j];
            let r = 1.0 / f.l;
            let local = [f.m1.dot(&e) * r, f.m2.dot(&e) * r, f.t.dot(&e) * r, all[4 * j + 3]];
            out.axial[j] =
                if j > 0 && j < n - 1 { rod.ea[j] / rod.stretch_lengths[j] * f.l * local[2] } else { 0.0 };
            if j > 0 {
                let m = &self.measures[j];
                let stiffness = &self.tangents[j];
                out.moments[j] = std::array::from_fn(|k| {
                    let by: f64 = (0..4).map(|c| m.before[k][c] * before[c] + m.after[k][c] * local[c]).sum();
                    stiffness[k] * by
                });
            }
            before = local;
        }
        self.coordinates = all;
    }

    /// The next assembly forms its geometric stiffness with the forces expected after `fraction` of the increment
    /// of the last [`Self::back_substitute`].
    pub fn expect(&mut self, rod: &Rod, fraction: f64) {
        let mut change = std::mem::take(&mut self.changing);
        let (increment, link) = (std::mem::take(&mut self.increment), self.last_link);
        self.force_change(rod, &increment, &link, &mut change);
        self.increment = increment;
        self.expected.clone_from(&self.forces);
        self.expected.add_scaled(fraction, &change);
        self.changing = change;
        self.expecting = true;
    }

    /// The same with forces given.
    pub fn expect_forces(&mut self, forces: &RodForces) {
        self.expected.clone_from(forces);
        self.expecting = true;
    }

    /// Takes back what the next assembly was to expect.
    pub fn forget_expected(&mut self) {
        self.expecting = false;
    }

    /// Whether the last assembly's Hessian is the exact one but for forces of this size, N.
    pub fn is_exact(&self, tolerance_n: f64) -> bool {
        if self.exact {
            return true;
        }
        let (now, then) = (&self.forces, &self.expected);
        let axial = now.axial.iter().zip(&then.axial).all(|(a, b)| (a - b).abs() <= tolerance_n);
        let moments = now.moments.iter().flatten().zip(then.moments.iter().flatten());
        axial && moments.skip(3).all(|(a, b)| (a - b).abs() <= tolerance_n * self.twist_scale)
    }

    /// What the forces expected add to the gradient of edge `j` in its local coordinates.
    pub(crate) fn expected_excess(&self, j: usize) -> Local {
        let n = self.n;
        let mut g = [0.0; 4];
        g[2] = (self.expected.axial[j] - self.forces.axial[j]) * self.frames[j].l;
        for (i, of) in [(j, 1), (j + 1, 0)] {
            if i == 0 || i >= n {
                continue;
            }
            let m = &self.measures[i];
            let rows = if of == 0 { &m.before } else { &m.after };
            for (k, row) in rows.iter().enumerate() {
                let excess = self.expected.moments[i][k] - self.forces.moments[i][k];
                for (g, r) in g.iter_mut().zip(row) {
                    *g += excess * r;
                }
            }
        }
        g
    }
}
