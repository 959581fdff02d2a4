//! Holes of links: a boss with a wall round the hole, and what is cut out of it.

use super::anchor::Anchor;
use super::link::{BORE_WALL_MM, BOSS_BELOW_MM, BOSS_EXTRA_MM, BoreCut, Builder, FLAT, ROUND_MM, Role};
use super::parts::HoleSolid;
use super::slot::Slot;
use crate::ir::{ExprPoint, Hole};
use nalgebra::Vector3;

/// How far a hole is cut beyond the faces of its boss, mm.
const BEYOND_MM: f64 = 0.3;

impl HoleSolid {
    /// A hole as it is declared; `point` and `direction` place a point (mm) and a unit direction of the drawing pose.
    pub fn of(
        hole: &Hole,
        point: impl Fn(ExprPoint) -> Vector3<f64>,
        direction: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Self {
        Self {
            point: point(hole.position),
            axis: direction(&Vector3::from(hole.axis)),
            diameter_mm: hole.diameter_mm,
        }
    }
}

impl Builder<'_> {
    /// A hole in a body of layers: upright in the body's own layer, or across it.
    pub(super) fn add_hole(&mut self, hole: &HoleSolid) {
        let at = self.at_level(&hole.point, self.level);
        if hole.axis.cross(&self.axis()).norm() < FLAT {
            let radius = self.boss_radius().max(self.radius_round(hole));
            self.boss(at, radius, &Anchor::Fixed);
            self.cut(&HoleSolid { point: at, ..hole.clone() }, self.half());
        } else {
            self.hole_in_space(&HoleSolid { point: at, ..hole.clone() });
        }
        self.node(at, None, Anchor::Fixed);
    }

    /// A short tube along the hole.
    pub(super) fn hole_in_space(&mut self, hole: &HoleSolid) {
        let radius = (self.ball_radius() + BOSS_EXTRA_MM).max(self.radius_round(hole));
        let half = self.half().max(self.ball_radius() + BOSS_EXTRA_MM);
        let slot = Slot::bar(hole.point, hole.point, hole.axis, radius, half - BOSS_BELOW_MM, ROUND_MM);
        self.push(Role::Boss, slot);
        self.cut(hole, half);
    }

    /// Radius that leaves a wall round the hole.
    fn radius_round(&self, hole: &HoleSolid) -> f64 {
        hole.diameter_mm / 2.0 + BORE_WALL_MM.max(self.input.least_wall_mm)
    }

    fn cut(&mut self, hole: &HoleSolid, half: f64) {
        let reach = hole.axis * (half + BEYOND_MM);
        let (start, end) = (hole.point - reach, hole.point + reach);
        self.plan.bores.push(BoreCut { joint: None, start, end, diameter_mm: hole.diameter_mm });
    }
}
