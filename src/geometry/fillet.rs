//! Fillets where a flexure enters its stub.
//!
//! A concave arc leads from each face of the flexure to the stub's round nose. It begins before the attachment plane, by as much as
//! the root behind is too compliant to be a clamp (`rod::extra_length_mm`): so the printed flexure bends as
//! the rod does that is clamped in the plane, and the nose stands where the arc ends.

use super::link::stub_radius;
use super::parts::{FlexureSolid, PartsInput};
use crate::rod::{SectionShape, concentration, extra_length_mm};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Angle by which the arc ends before it would touch the nose: surfaces that only touch are no business of a boolean kernel, and
/// stress is gone there.
const KINK_RAD: f64 = 0.26;
/// By this much the arc goes on inside the nose, rad.
const INSIDE_RAD: f64 = 0.13;
/// Least angle of the arc.
const LEAST_ARC_RAD: f64 = 0.2;
/// Sections of the arc are this far apart, mm, and so many.
const STEP_MM: f64 = 0.06;
const STEPS: [f64; 2] = [4.0, 10.0];
/// Thickness by width from which on the fillet goes all round: what is flatter stands on its edge in its layer.
const ROUND: f64 = 0.5;
/// Kept between the fillet and the edge of the stub, mm.
const EDGE_MM: f64 = 0.2;
/// Of its length a flexure gives this part to a fillet at most.
const MOST_OF_LENGTH: f64 = 0.25;

/// The fillet of one end of a flexure. Ways run from where it begins, towards the stub.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fillet {
    /// Radius, mm.
    pub radius_mm: f64,
    /// It begins so far before the attachment plane, mm.
    pub start_mm: f64,
    /// Radius of the stub's nose, mm.
    pub nose_radius_mm: f64,
    /// Half thickness of the flexure at this end, mm.
    pub a_mm: f64,
    /// What grows along the wide direction, by what grows along the thin one.
    pub all_round: f64,
    /// Half width by half thickness is 1: a wire.
    pub is_wire: bool,
    /// Where the arc meets the nose: angle of the arc.
    meets_rad: f64,
}

impl Fillet {
    /// The fillet of radius `radius_mm` at the end of a flexure of so many millimetres with semi-axes `a_mm`, `b_mm`, in a process with
    /// the least wall `wall_mm`; none without a radius.
    pub fn new(
        radius_mm: f64,
        section: SectionShape,
        (a_mm, b_mm): (f64, f64),
        length_mm: f64,
        wall_mm: f64,
    ) -> Option<Self> {
        if !(radius_mm > 0.0 && a_mm > 0.0 && b_mm > 0.0) {
            return None;
        }
        let nose_radius_mm = stub_radius(a_mm, wall_mm);
        let touches = ((a_mm + radius_mm) / (nose_radius_mm + radius_mm)).clamp(0.0, 1.0).acos();
        let meets_rad = (touches - KINK_RAD).max(LEAST_ARC_RAD);
        let (thin, wide) = (a_mm.min(b_mm), a_mm.max(b_mm));
        let roundness = thin / wide;
        let flare = radius_mm * (1.0 - (meets_rad + INSIDE_RAD).cos());
        let all_round = if section == SectionShape::Ellipse && roundness > ROUND {
            ((wall_mm - EDGE_MM) / flare).clamp(0.0, 1.0)
        } else {
            0.0
        };
        // What a fillet all round adds to a leaf of this width is a wire's.
        let roundness = if all_round > 0.0 { roundness } else { 0.0 };
        let start = extra_length_mm(2.0 * a_mm, radius_mm, roundness);
        Some(Self {
            radius_mm,
            start_mm: start.min(MOST_OF_LENGTH * length_mm),
            nose_radius_mm,
            a_mm,
            all_round,
            is_wire: section == SectionShape::Ellipse && (a_mm - b_mm).abs() < 1e-9,
            meets_rad,
        })
    }

    /// Where the nose's centre stands beyond the attachment plane, mm.
    pub fn nose_center_mm(&self) -> f64 {
        let (sin, cos) = self.meets_rad.sin_cos();
        let across = self.a_mm + self.radius_mm * (1.0 - cos);
        let r = self.nose_radius_mm;
        self.radius_mm * sin + (r * r - across * across).max(0.0).sqrt() - self.start_mm
    }

    /// Length of the arc as it is seen, mm.
    pub fn length_mm(&self) -> f64 {
        self.radius_mm * self.meets_rad.sin()
    }

    /// By how much the half thickness has grown at the nose, mm.
    pub fn flare_mm(&self) -> f64 {
        self.radius_mm * (1.0 - self.meets_rad.cos())
    }

    /// Stations of the fillet: way beyond the attachment plane (negative before it), growth of the half thickness, mm.
    pub(super) fn stations(&self) -> Vec<[f64; 2]> {
        let end = self.meets_rad + INSIDE_RAD;
        let steps = (self.radius_mm * end / STEP_MM).ceil().clamp(STEPS[0], STEPS[1]);
        let at = |k: usize| {
            let (sin, cos) = (end * k as f64 / steps).min(FRAC_PI_2).sin_cos();
            [self.radius_mm * sin - self.start_mm, self.radius_mm * (1.0 - cos)]
        };
        (0..=steps as usize).map(at).collect()
    }

    /// Largest stress in bending by that of the rod beside the fillet; none outside of what the handbook gives
    /// ([`concentration`]).
    pub fn concentration(&self) -> Option<f64> {
        concentration(2.0 * self.a_mm, self.radius_mm, 2.0 * self.nose_radius_mm, self.is_wire)
    }
}

impl FlexureSolid {
    /// Gives both ends fillets of a radius; none where it is zero.
    pub fn fillet(&mut self, radius_mm: f64, wall_mm: f64) {
        let length = self.centreline.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        self.fillets = [false, true]
            .map(|at_end| Fillet::new(radius_mm, self.section, self.end_axes(at_end), length, wall_mm));
    }

    /// The place at a way from an end along the centreline, with the number of the stations that lie nearer to it.
    pub(super) fn place_from_end(&self, at_end: bool, way_mm: f64) -> (Vector3<f64>, usize) {
        let n = self.centreline.len();
        let at = |k: usize| self.centreline[if at_end { n - 1 - k } else { k }];
        let mut left = way_mm;
        for k in 1..n {
            let (p, q) = (at(k - 1), at(k));
            let step = (q - p).norm();
            if step >= left {
                return (p.lerp(&q, if step > 0.0 { left / step } else { 0.0 }), k);
            }
            left -= step;
        }
        (self.end_point(!at_end), n)
    }
}

impl PartsInput {
    /// The same with sharp roots: what is solved does not depend on fillets.
    pub fn unfilleted(mut self) -> Self {
        self.flexures.iter_mut().for_each(|f| f.fillets = [None; 2]);
        self
    }
}
