//! Which rod is meant: section, rest frames, and the corrections beyond plain rod theory.

use super::section::SectionShape;
use crate::ir::RodModel;
use crate::math::dual::Real;

/// Stiffening of EI_thin by width, ΔEI/EI = c w/L at [`NU_MEASURED`]: three-dimensional finite elements
/// give 2.9 % at w/L 0.25 and 4.7 % at 0.42.
const WIDTH_COEFFICIENT: f64 = 0.115;
/// Poisson's ratio of those finite elements. The effect is hindered anticlastic curvature, a part of the way
/// from EI to EI/(1 − ν²); it is assumed to scale with ν²/(1 − ν²).
const NU_MEASURED: f64 = 0.4;
/// GJ/(1 − k w/L) by hindered warping at the ends: k of ellipse and rectangle.
const WARPING_COEFFICIENTS: [f64; 2] = [0.32, 0.49];
/// w/L up to which both were measured; beyond, they go on along their tangents.
const LARGEST_WIDTH: f64 = 0.5;
/// Thickness over width of the sections measured.
const THINNESS_MEASURED: f64 = 0.16;

/// How the rest frames follow the centre line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RestFrames {
    /// m₂ is the joint axis projected normal to each edge.
    #[default]
    Axis,
    /// Rotation-minimising from end A, where m₂ is the projected axis (any normal where they are parallel):
    /// for wires, whose rest curve may run along the axis. Without rest twist, end B is unstressed.
    Transport,
}

impl RodModel {
    /// Its corrections.
    pub fn corrections(self) -> Corrections {
        let all = self == Self::Corrected;
        Corrections { shear: all, width: all, warping: all }
    }
}

/// Single corrections to the plain rod.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Corrections {
    /// Transverse shear: k_s G A.
    pub shear: bool,
    /// Hindered anticlastic curvature: EI_thin (1 + 0.115 w/L) at ν 0.4, for very wide leaves EI/(1 − ν²).
    pub width: bool,
    /// Hindered warping: GJ/(1 − k w/L).
    pub warping: bool,
}

/// What a rod is besides its parameters and material.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RodOptions {
    /// Cross section.
    pub section: SectionShape,
    /// Rest frames.
    pub frames: RestFrames,
    /// Corrections; none by default.
    pub corrections: Corrections,
    /// Whether the widths run linearly in arc length from those at end A to those at end B.
    pub taper: bool,
}

impl RodOptions {
    /// Factors on EI₁, EI₂ and GJ for half widths `a`, `b` and length `length`, mm.
    pub(crate) fn factors<T: Real>(&self, a: T, b: T, length: T, nu: f64) -> [T; 3] {
        let one = T::constant(1.0);
        let mut factors = [one; 3];
        let (thin, half, bending) = if a.value() <= b.value() { (a, b, 0) } else { (b, a, 1) };
        let shape = flatness(thin / half).scale(1.0 / flatness(THINNESS_MEASURED));
        let width = (half + half) / length;
        if self.corrections.width {
            // Linear as measured, never stiffer than a plate: the plate's share is tanh x.
            let x = (shape * width).scale(WIDTH_COEFFICIENT / plate(NU_MEASURED));
            let e = x.scale(-2.0).exp();
            factors[bending] = one + ((one - e) / (one + e)).scale(plate(nu));
        }
        if self.corrections.warping {
            let k = WARPING_COEFFICIENTS[usize::from(self.section == SectionShape::Rectangle)];
            let bounded = if width.value() <= LARGEST_WIDTH {
                one / (one - width.scale(k)) - one
            } else {
                let c = 1.0 / (1.0 - k * LARGEST_WIDTH);
                T::constant(c - 1.0) + (width - T::constant(LARGEST_WIDTH)).scale(k * c * c)
            };
            factors[2] = one + shape * bounded;
        }
        factors
    }
}

/// How much stiffer than a beam a plate is in bending, EI/(1 − ν²) over EI less one.
fn plate(nu: f64) -> f64 {
    nu * nu / (1.0 - nu * nu)
}

/// ((1 − r²)/(1 + r²))² of thickness over width r: the square of an ellipse's warping function, 0 for
/// sections that neither warp nor have a wide direction, 1 for thin strips.
fn flatness<T: Real>(r: T) -> T {
    let one = T::constant(1.0);
    let w = (one - r * r) / (one + r * r);
    w * w
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two measured width factors, and no correction for a round wire.
    #[test]
    fn factors_as_measured() {
        let options = RodOptions { corrections: RodModel::Corrected.corrections(), ..RodOptions::default() };
        let at = |a, b, l| options.factors::<f64>(a, b, l, 0.4);
        let [width, other, warping] = at(0.4, 2.5, 12.0);
        // Both as printed, 4.7 and 2.9 %, to their last digit.
        assert!((width - 1.047).abs() < 5e-4 && other == 1.0, "{width}");
        assert!((at(0.4, 2.5, 20.0)[0] - 1.029).abs() < 5e-4, "{}", at(0.4, 2.5, 20.0)[0]);
        // However wide, no stiffer than a plate.
        let wide = at(0.4 * 1e3, 2.5 * 1e3, 12.0)[0];
        assert!(wide > 1.18 && wide <= 1.0 / (1.0 - 0.16) + 1e-12, "{wide}");
        assert!((warping - 1.0 / (1.0 - 0.32 * 5.0 / 12.0)).abs() < 1e-12);
        assert_eq!(at(0.4, 2.5, 12.0)[0], at(2.5, 0.4, 12.0)[1]);
        assert_eq!(at(0.5, 0.5, 12.0), [1.0; 3]);
        assert_eq!(RodOptions::default().factors::<f64>(0.4, 2.5, 12.0, 0.4), [1.0; 3]);
        // One slope on both sides of the range measured.
        let slope = |x: f64| (at(0.4, 2.5, 5.0 / (x + 1e-6))[2] - at(0.4, 2.5, 5.0 / (x - 1e-6))[2]) / 2e-6;
        assert!((slope(0.49) - slope(0.51)).abs() < 0.02, "{} {}", slope(0.49), slope(0.51));
    }
}
