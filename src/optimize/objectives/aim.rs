//! Orientation tracking (beyond Megaro et al. 2017): ½ Σ θ_t², θ the angle between a direction d that a body carries and
//! its target d̄. The residual is the vector from d̄ to d along their great circle, r = θ/sin θ · (d − d̄ cos θ): of
//! length θ, and smooth up to opposite directions.

use super::track::Emphasis;
use super::{Objective, StateView, StatesSensitivity};
use crate::equilibrium::{LayoutDirection, angle_between};
use crate::math::skew;
use crate::optimize::Normal;
use nalgebra::{Matrix3, Matrix3xX, Vector3};

/// Below this 1 − cos θ the series of θ/sin θ are exact to rounding.
const SMALL: f64 = 1e-3;

/// See the module.
pub struct Aim {
    name: String,
    direction: usize,
    /// Weight over scale², per rad².
    factor: f64,
    emphasis: Emphasis,
}

impl Aim {
    /// Tracks direction number `direction`; `scale_rad` is the angle that counts as one.
    pub fn new(
        direction_name: &str,
        direction: usize,
        scale_rad: Option<f64>,
        weight: f64,
        emphasis: Emphasis,
    ) -> Self {
        let scale = scale_rad.unwrap_or(1.0);
        Self {
            name: format!("track({direction_name})"),
            direction,
            factor: weight / (scale * scale),
            emphasis,
        }
    }

    fn layout<'a>(&self, view: &'a StateView) -> &'a LayoutDirection {
        &view.model.layout.directions[self.direction]
    }

    /// Present direction and its target.
    fn pair(&self, view: &StateView) -> (Vector3<f64>, Vector3<f64>) {
        let d = self.layout(view);
        (view.equilibrium.state.poses[d.body].direction(&d.rest), d.target[view.state])
    }

    fn weight(&self, view: &StateView) -> f64 {
        self.factor * view.share * self.emphasis.at(view.state)
    }
}

/// f = θ/sin θ as a function of cos θ, and its derivative.
fn factor(d: &Vector3<f64>, target: &Vector3<f64>) -> (f64, f64) {
    let cos = d.dot(target);
    let u = 1.0 - cos;
    if u < SMALL {
        // arcsin(x)/(x √(1 − x²)) with x² = u/2.
        (
            1.0 + u * (1.0 / 3.0 + u * (2.0 / 15.0 + u * (2.0 / 35.0 + u * 8.0 / 315.0))),
            -(1.0 / 3.0 + u * (4.0 / 15.0 + u * (6.0 / 35.0 + u * (32.0 / 315.0 + u * 40.0 / 693.0)))),
        )
    } else {
        let angle = angle_between(d, target);
        let sin = angle.sin();
        (angle / sin, (angle * cos / sin - 1.0) / (sin * sin))
    }
}

/// The residual, of length θ, and its derivatives by d.
fn residual(d: &Vector3<f64>, target: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let (f, slope) = factor(d, target);
    let off = d - target * d.dot(target);
    (off * f, Matrix3::identity() * f + (off * slope - target * f) * target.transpose())
}

/// Derivatives of the residual by the target: r = f(c) (d − d̄ c) with c = d·d̄.
fn by_target(d: &Vector3<f64>, target: &Vector3<f64>) -> Matrix3<f64> {
    let (f, slope) = factor(d, target);
    let cos = d.dot(target);
    (d - target * cos) * d.transpose() * slope - (Matrix3::identity() * cos + target * d.transpose()) * f
}

impl Objective for Aim {
    fn name(&self) -> &str {
        &self.name
    }

    fn cost(&self, view: &StateView) -> f64 {
        let (d, target) = self.pair(view);
        0.5 * self.weight(view) * residual(&d, &target).0.norm_squared()
    }

    fn accumulate(&self, view: &StateView, at: &StatesSensitivity, out: &mut Normal) {
        let (d, target) = self.pair(view);
        let (residual, by_d) = residual(&d, &target);
        let weight = self.weight(view);
        let layout = &view.model.layout;
        let body = self.layout(view).body;
        let mut rows = match layout.bodies[body].first_dof {
            // δd = δφ × d
            Some(first) => -(by_d * skew(&d)) * at.free.links.fixed_rows::<3>(first + 3),
            None => Matrix3xX::zeros(at.free.links.ncols()),
        };
        let by_target = by_target(&d, &target);
        for change in layout.changes.iter().flatten() {
            let own = &change.directions[self.direction];
            let carried = view.equilibrium.state.poses[body].direction(&own.rest);
            let mut column = rows.column_mut(change.parameter);
            column += by_d * carried + by_target * own.target[view.state];
        }
        for c in 0..3 {
            let row: Vec<f64> = rows.row(c).iter().copied().collect();
            out.add(weight, residual[c], &row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(angle: f64) -> Vector3<f64> {
        Vector3::new(angle.sin() * 0.6, angle.sin() * 0.8, angle.cos())
    }

    #[test]
    fn its_length_is_the_angle_and_its_derivatives_are_exact() {
        let target = Vector3::z();
        for angle in [0.0, 1e-9, 1e-4, 0.0446, 0.0448, 0.3, 1.2, 2.5, 3.0_f64] {
            let d = turned(angle);
            let (r, by_d) = residual(&d, &target);
            assert!((r.norm() - angle).abs() < 1e-14 * angle.max(1.0), "{angle}: {}", r.norm());
            // Along both tangents of the sphere.
            let tangents = [turned(angle + std::f64::consts::FRAC_PI_2), Vector3::new(-0.8, 0.6, 0.0)];
            for t in tangents {
                let h = 1e-4;
                let at = |k: f64| residual(&(d * (k * h).cos() + t * (k * h).sin()), &target).0;
                let difference = (at(-2.0) - at(-1.0) * 8.0 + at(1.0) * 8.0 - at(2.0)) / (12.0 * h);
                let off = (difference - by_d * t).norm();
                assert!(off < 1e-9 * by_d.norm(), "{angle}: {off:e}");
            }
        }
    }
}
