//! Seats of motors' horns: a recess that centres a round horn, holes for its screws; or a bore for a toothed shaft.

use super::fitted::{FitFault, FitFaultKind, SeatSolid};
use super::link::{BORE_WALL_MM, BOSS_BELOW_MM, BoreCut, Builder, ROUND_MM, Role};
use super::mount::HEAD;
use super::parts::BodySolid;
use super::slot::Slot;
use std::f64::consts::{PI, TAU};

/// How far cuts go beyond faces, mm.
const BEYOND_MM: f64 = 0.5;
/// What the screws of a horn hold, mm; what is higher gives way to their heads.
const HELD_MM: f64 = 3.0;

impl Builder<'_> {
    /// Makes the eye of a joint the seat of a horn.
    pub(super) fn add_seat(&mut self, seat: &SeatSolid, body: &BodySolid) {
        let Some(eye) = body.eyes.iter().find(|e| e.joint == seat.joint) else { return };
        let shape = self.eye_shape(eye);
        let wall = BORE_WALL_MM.max(self.input.least_wall_mm);
        let c = seat.clearance_mm;
        let form = &seat.form;
        let recess = form.diameter_mm.map(|d| d + 2.0 * c);
        let bore = form.spline_mm.map(|d| if recess.is_some() { d + 2.0 * c } else { d });
        let screws = form.screws.map(|(n, circle, d)| (n, circle, d, d + c));
        let outside = [
            recess.map(|d| d / 2.0),
            bore.map(|d| d / 2.0),
            screws.map(|(_, circle, d, hole)| (circle + hole.max(HEAD * d)) / 2.0),
        ];
        let radius = outside.into_iter().flatten().fold(0.0, f64::max) + wall;
        if radius > shape.radius {
            let half = shape.half_height - 2.0 * BOSS_BELOW_MM;
            let slot = Slot::bar(shape.center, shape.center, eye.axis, radius, half, ROUND_MM);
            self.push(Role::Eye(eye.joint), slot);
        }
        // Heights towards the motor, from the middle of the eye.
        let face = shape.half_height;
        let level = if body.axis.is_some() { self.level } else { shape.center.dot(&seat.side) };
        let above = (level - shape.center.dot(&eye.axis)).abs();
        let back = face.max(if body.axis.is_some() { above + self.half() } else { 0.0 }) + BEYOND_MM;
        let mut cut = |across: nalgebra::Vector3<f64>, from: f64, to: f64, diameter_mm: f64| {
            let [start, end] = [from, to].map(|h| shape.center + across + seat.side * h);
            self.plan.bores.push(BoreCut { joint: None, start, end, diameter_mm });
        };
        let zero = nalgebra::Vector3::zeros();
        let deep = seat.deep_mm.min(2.0 * face - self.input.least_wall_mm).max(0.0);
        let floor = if recess.is_some() { face - deep } else { face };
        if let Some(d) = recess {
            cut(zero, floor, face + BEYOND_MM, d);
        }
        if let Some(d) = bore {
            cut(zero, -back, face + BEYOND_MM, d);
        }
        let Some((count, circle, d, hole)) = screws else { return };
        let first = super::slot::any_normal(&seat.side);
        let second = seat.side.cross(&first);
        for k in 0..count {
            let (sin, cos) = (TAU * (k as f64 + 0.5) / count as f64).sin_cos();
            let at = (first * cos + second * sin) * (circle / 2.0);
            cut(at, -back, face + BEYOND_MM, hole);
            if floor - HELD_MM > -face + BEYOND_MM {
                cut(at, -back, floor - HELD_MM, HEAD * d);
            }
        }
        let between = circle * (PI / count.max(2) as f64).sin() - hole;
        let inside = circle / 2.0 - hole / 2.0 - bore.unwrap_or(0.0) / 2.0;
        let left = between.min(inside);
        if left < self.input.least_wall_mm - 1e-9 {
            let (motor, kind) = (form.name.clone(), FitFaultKind::Wall(left));
            self.plan.faults.push(FitFault { motor, kind, at: shape.center, origin: seat.origin });
        }
    }
}
