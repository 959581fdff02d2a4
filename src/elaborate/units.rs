//! Units as designers write them, each with its factor to the internal system mm, N, MPa, rad, s.
//! The mass that closes this system is the tonne: 1 N = 1 t·mm/s².

use super::dimension::Dimension;
use std::f64::consts::PI;

/// A unit: symbol, dimension, factor to the internal unit.
pub struct Unit {
    /// As written.
    pub symbol: &'static str,
    /// Its dimension.
    pub dimension: Dimension,
    /// Internal units in one of it.
    pub factor: f64,
}

const fn unit(symbol: &'static str, dimension: Dimension, factor: f64) -> Unit {
    Unit { symbol, dimension, factor }
}

/// Pound-force: 0.45359237 kg times 9.80665 m/s², both exact by definition.
const LBF_N: f64 = 4.448_221_615_260_5;

/// All units.
pub const UNITS: &[Unit] = &[
    unit("um", Dimension::LENGTH, 1e-3),
    unit("µm", Dimension::LENGTH, 1e-3),
    unit("mm", Dimension::LENGTH, 1.0),
    unit("cm", Dimension::LENGTH, 10.0),
    unit("m", Dimension::LENGTH, 1e3),
    unit("in", Dimension::LENGTH, 25.4),
    unit("rad", Dimension::ANGLE, 1.0),
    unit("deg", Dimension::ANGLE, PI / 180.0),
    unit("°", Dimension::ANGLE, PI / 180.0),
    unit("turn", Dimension::ANGLE, 2.0 * PI),
    unit("mN", Dimension::FORCE, 1e-3),
    unit("N", Dimension::FORCE, 1.0),
    unit("kN", Dimension::FORCE, 1e3),
    unit("lbf", Dimension::FORCE, LBF_N),
    unit("Pa", Dimension::STRESS, 1e-6),
    unit("kPa", Dimension::STRESS, 1e-3),
    unit("MPa", Dimension::STRESS, 1.0),
    unit("GPa", Dimension::STRESS, 1e3),
    unit("g", Dimension::MASS, 1e-6),
    unit("kg", Dimension::MASS, 1e-3),
    unit("ms", Dimension::TIME, 1e-3),
    unit("s", Dimension::TIME, 1.0),
    unit("%", Dimension::NUMBER, 0.01),
];

/// Grams in the internal mass unit.
pub const GRAMS_PER_TONNE: f64 = 1e6;

/// The unit written as `symbol`.
pub fn find(symbol: &str) -> Option<&'static Unit> {
    UNITS.iter().find(|u| u.symbol == symbol)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_are_unique_and_factors_positive() {
        for (i, u) in UNITS.iter().enumerate() {
            assert!(u.factor > 0.0 && u.factor.is_finite());
            assert!(UNITS.iter().skip(i + 1).all(|v| v.symbol != u.symbol), "{}", u.symbol);
        }
    }

    #[test]
    fn the_system_is_coherent() {
        // 1 kg · 1 m/s² = 1 N
        let f = |s: &str| find(s).map_or(f64::NAN, |u| u.factor);
        assert!((f("kg") * f("m") - f("N")).abs() < 1e-15);
        // 1 N/m² = 1 Pa
        assert!((f("N") / (f("m") * f("m")) - f("Pa")).abs() < 1e-20);
    }
}
