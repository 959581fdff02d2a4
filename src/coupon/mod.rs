//! A test piece: beams to be loaded by hand, and the modulus of elasticity that their drops give.
//!
//! What a filament's or resin's sheet says of E is often off by a third, and forces, torques and stresses are
//! proportional to it. The piece is a design like any other (`starts/coupon.mech`), and what is measured on it is compared with
//! the solver that designs are made with: large deflections, the stiff tip and the clamp are those of the model.

mod fit;
mod sheet;

pub use fit::{Fit, Reading, fit};
pub use sheet::{readings_to_enter, sheet};

use crate::diagnostic::Diagnostic;
use crate::elaborate::{Options, elaborate};
use crate::equilibrium::{Layout, Model, sweep};
use crate::ir::Design;
use crate::kinematics::solve_motion;
use std::collections::BTreeMap;

/// Newton per gram.
const NEWTON_PER_GRAM: f64 = 9.806_65e-3;
/// Length of the beams, mm.
const LONG_MM: f64 = 60.0;
/// Their width, mm.
const WIDE_MM: f64 = 6.0;
/// From a beam's end to the hole, mm: as in the text.
const ARM_MM: f64 = 9.0;
/// Least weight that a kitchen scale can tell within some per cent, g.
const LEAST_GRAMS: f64 = 5.0;
/// Wanted drop at the lighter weight, mm: an edge of a ruler's line is 5 % of it.
const DROP_MM: f64 = 5.0;
/// Thickness of the beams, relative to the thinnest.
const THICKER: [f64; 3] = [1.0, 1.5, 2.0];
/// Edges of a beam; 40 change a drop of 20 mm by less than 0.02 mm.
const EDGES: usize = 20;

/// The beams, by what the text calls them: thin, middle, thick.
pub const BEAMS: [&str; 3] = ["thin", "middle", "thick"];

/// A test piece for a material and a process of the standard library.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupon {
    /// Name of the material.
    pub material: String,
    /// Name of the process.
    pub process: String,
    /// E that the library states, MPa.
    pub e_mpa: f64,
    /// Thickness of each beam as drawn, mm.
    pub thick_mm: [f64; 3],
    /// Width of the beams as drawn, mm.
    pub wide_mm: f64,
    /// Two weights for each beam, g.
    pub grams: [[f64; 2]; 3],
    /// The design.
    pub text: String,
}

impl Coupon {
    /// A test piece: beams not thinner than the process prints, and thick enough that they carry 5 g.
    ///
    /// # Errors
    /// The diagnostics of a material or process that the library does not have.
    pub fn new(material: &str, process: &str) -> Result<Self, Vec<Diagnostic>> {
        let mut coupon = Self {
            material: material.into(),
            process: process.into(),
            e_mpa: 0.0,
            thick_mm: THICKER,
            wide_mm: WIDE_MM,
            grams: [[1.0; 2]; 3],
            text: String::new(),
        };
        coupon.text = coupon.write();
        let design = coupon.design(&[])?;
        coupon.e_mpa = design.material.e_mpa;
        // Euler's beam, with the arm: force over drop.
        let inertia = |t: f64| WIDE_MM * t.powi(3) / 12.0;
        let (l, c) = (LONG_MM, ARM_MM);
        let give = l.powi(3) / 3.0 + l * l * c + l * c * c;
        let grams = |t: f64| coupon.e_mpa * inertia(t) / give * DROP_MM / NEWTON_PER_GRAM;
        let carries = (LEAST_GRAMS / grams(1.0)).cbrt();
        let least = (design.process.least_wall_mm.max(carries) * 10.0).ceil() / 10.0;
        coupon.thick_mm = THICKER.map(|k| ((least * k) * 10.0).round() / 10.0);
        coupon.grams = coupon.thick_mm.map(|t| [round(grams(t)), round(2.0 * grams(t))]);
        coupon.text = coupon.write();
        Ok(coupon)
    }

    fn write(&self) -> String {
        let number = |x: f64| format!("{}", (x * 1e4).round() / 1e4);
        let mut text = include_str!("../../starts/coupon.mech").to_string();
        let mut put = |what: &str, value: &str| text = text.replace(what, value);
        for (beam, (thick, grams)) in BEAMS.iter().zip(self.thick_mm.iter().zip(&self.grams)) {
            let name = beam.to_uppercase();
            put(&format!("WEIGHT_{name} N"), &format!("{} N", number(grams[0] * NEWTON_PER_GRAM)));
            put(&format!("= {name} mm"), &format!("= {} mm", number(*thick)));
        }
        put("= LONG mm", &format!("= {} mm", number(LONG_MM)));
        put("= WIDE mm", &format!("= {} mm", number(self.wide_mm)));
        put("MATERIAL", &self.material);
        put("PROCESS", &self.process);
        crate::syntax::format::format(0, &text).map_or(text, |f| f.text)
    }

    fn design(&self, set: &[(String, String)]) -> Result<Design, Vec<Diagnostic>> {
        let files = BTreeMap::from([("coupon.mech".to_string(), self.text.clone())]);
        let options = Options { set: set.to_vec(), ..Options::default() };
        let found = elaborate("coupon.mech", &files, &options);
        found.design.ok_or(found.diagnostics)
    }

    /// How far the hole of a beam drops (mm) under a weight (g), by thickness and width (mm) and E (MPa); none where the
    /// solver finds no equilibrium, or E is no stiffness.
    pub fn drop_mm(&self, beam: usize, size_mm: [f64; 2], grams: f64, e_mpa: f64) -> Option<f64> {
        let name = BEAMS.get(beam)?;
        let set = [
            ((*name).to_string(), format!("{} mm", size_mm[0])),
            ("wide".to_string(), format!("{} mm", size_mm[1])),
            (format!("weight_{name}"), format!("{} N", grams * NEWTON_PER_GRAM)),
        ];
        let mut design = self.design(&set).ok()?;
        design.material.e_mpa = e_mpa;
        let layout = Layout::new(&design, &solve_motion(&design, &[]).ok()?, &[]);
        let model = Model::new(&design, &layout, &[], EDGES, false).ok()?;
        let states = sweep(&model).ok()?.states;
        let trace = layout.traces.get(beam)?;
        let height =
            |s: &crate::equilibrium::Equilibrium| Some(s.state.poses.get(trace.body)?.point(&trace.rest).y);
        Some(height(states.first()?)? - height(states.last()?)?)
    }
}

/// A weight that people have: 1, 2 or 5 times a power of ten.
fn round(grams: f64) -> f64 {
    let power = 10f64.powf(grams.log10().floor());
    let near = |a: &f64, b: &f64| (grams / a).ln().abs().total_cmp(&(grams / b).ln().abs());
    [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().min_by(near).unwrap_or(grams)
}

#[cfg(test)]
mod tests;
