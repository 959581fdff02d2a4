//! What makes a rest shape a rod: slender, gently curved, with ends that lead somewhere. Beyond these
//! limits rod theory says nothing reliable, whatever the optimiser would like.

use super::{PARAMETERS, Rod};
use crate::math::dual::{Dual, Real};

/// Least length of a rod, in thicknesses.
pub const LEAST_SLENDERNESS: f64 = 10.0;
/// Largest rest curvature times the semi-axis in its direction: strains at the inner fibre are off by
/// about half of it.
pub const LARGEST_CURVATURE: f64 = 0.2;
/// Least Hermite speed at an end, in lengths: slower ends make a kink beside the clamp.
pub const LEAST_SPEED: f64 = 0.2;

type Value = Dual<PARAMETERS>;

impl Rod {
    /// By how much, relative to each limit, the rest shape is no sound rod: positive entries violate,
    /// each with its derivatives by the 19 parameters. Always the same limits in the same order; none
    /// for a rod built without derivatives.
    pub fn shape_excesses(&self) -> Vec<(f64, [f64; PARAMETERS])> {
        let Some(shape) = self.derivatives.as_deref() else { return Vec::new() };
        let q = self.parameters.to_array();
        let variable = |i: usize| Value::variable(q[i], i);
        let one = Value::constant(1.0);
        // Of a tapered rod the mean.
        let thickness = variable(15) + variable(if self.options.taper { 17 } else { 15 });
        let mut out = vec![one - shape.length / thickness.scale(LEAST_SLENDERNESS)];
        for first in [3, 9] {
            let d = [variable(first), variable(first + 1), variable(first + 2)];
            let speed = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            out.push(one - speed / shape.length.scale(LEAST_SPEED));
        }
        for i in 1..self.edges {
            for k in 0..2 {
                let axis = (shape.sections[i - 1][k] + shape.sections[i][k]).scale(0.5);
                let bend = shape.measures[i][k] / shape.voronoi[i] * axis.scale(1.0 / LARGEST_CURVATURE);
                let size = if bend.value() < 0.0 { -bend } else { bend };
                out.push(size - one);
            }
        }
        out.into_iter().map(|v| (v.re, v.eps)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodMaterial, RodParameters};
    use nalgebra::Vector3;

    const MATERIAL: RodMaterial = RodMaterial { e_mpa: 1900.0, nu: 0.4 };

    fn stubby() -> RodParameters {
        // Short, sharply bent and slow at one end: violates every limit.
        RodParameters {
            position_a: Vector3::zeros(),
            derivative_a: Vector3::new(0.9, 0.1, 0.0),
            position_b: Vector3::new(4.0, 3.0, 0.0),
            derivative_b: Vector3::new(-1.0, 9.0, 0.0),
            axis: Vector3::z(),
            a: 1.2,
            b: 2.0,
            a_to: 1.2,
            b_to: 2.0,
        }
    }

    #[test]
    fn a_sound_leaf_has_none() {
        let q = RodParameters::straight(Vector3::zeros(), Vector3::x() * 20.0, Vector3::z(), 0.4, 2.5);
        let excesses = Rod::with_derivatives(&q, MATERIAL, 20).unwrap().shape_excesses();
        assert_eq!(excesses.len(), 3 + 2 * 19);
        assert!(excesses.iter().all(|(e, _)| *e < 0.0));
    }

    #[test]
    fn every_limit_can_be_violated_and_is_differentiated() {
        let q = stubby();
        let rod = Rod::with_derivatives(&q, MATERIAL, 12).unwrap();
        let found = rod.shape_excesses();
        assert!(
            found[0].0 > 0.0 && found[1].0 > 0.0 && found[3..].iter().any(|(e, _)| *e > 0.0),
            "{found:?}"
        );
        let base = q.to_array();
        for i in 0..PARAMETERS {
            let at = |h: f64| {
                let mut q = base;
                q[i] += h;
                let q = RodParameters::from_array(&q);
                Rod::with_derivatives(&q, MATERIAL, 12).unwrap().shape_excesses()
            };
            let h = 1e-5;
            let (plus, minus) = (at(h), at(-h));
            for ((p, m), (excess, d)) in plus.iter().zip(&minus).zip(&found) {
                if *excess < -0.999 {
                    continue; // |κ̄| = 0 has no derivative, and is no limit
                }
                let difference = (p.0 - m.0) / (2.0 * h);
                assert!((difference - d[i]).abs() < 1e-6 * (1.0 + d[i].abs()), "{i}: {difference} {}", d[i]);
            }
        }
    }
}
