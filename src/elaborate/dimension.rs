//! Dimensions as vectors of exponents over length, mass, time and angle. Angle is a dimension of its
//! own, so that degrees never pass for plain numbers.

use std::fmt;

/// Exponents of (length, mass, time, angle).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Dimension(pub [i8; 4]);

/// Largest exponent a dimension may reach; what is beyond is a mistake, not physics.
const MAX_EXPONENT: i32 = 24;

impl Dimension {
    /// A plain number.
    pub const NUMBER: Self = Self([0, 0, 0, 0]);
    /// Length, mm.
    pub const LENGTH: Self = Self([1, 0, 0, 0]);
    /// Area, mm².
    pub const AREA: Self = Self([2, 0, 0, 0]);
    /// Mass, t (the mass that goes with mm, N and s).
    pub const MASS: Self = Self([0, 1, 0, 0]);
    /// Time, s.
    pub const TIME: Self = Self([0, 0, 1, 0]);
    /// Angle, rad.
    pub const ANGLE: Self = Self([0, 0, 0, 1]);
    /// Angular speed, rad/s.
    pub const SPEED: Self = Self([0, 0, -1, 1]);
    /// Angular acceleration, rad/s².
    pub const ACCELERATION: Self = Self([0, 0, -2, 1]);
    /// Force, N.
    pub const FORCE: Self = Self([1, 1, -2, 0]);
    /// Torque, N·mm.
    pub const TORQUE: Self = Self([2, 1, -2, 0]);
    /// Stress, MPa.
    pub const STRESS: Self = Self([-1, 1, -2, 0]);
    /// Density, t/mm³.
    pub const DENSITY: Self = Self([-3, 1, 0, 0]);

    fn zip(self, other: Self, f: impl Fn(i32, i32) -> i32) -> Option<Self> {
        let mut out = [0i8; 4];
        for (o, (a, b)) in out.iter_mut().zip(self.0.iter().zip(other.0)) {
            let e = f(i32::from(*a), i32::from(b));
            if e.abs() > MAX_EXPONENT {
                return None;
            }
            *o = i8::try_from(e).ok()?;
        }
        Some(Self(out))
    }

    /// Dimension of a product; none when an exponent gets out of hand.
    pub fn times(self, other: Self) -> Option<Self> {
        self.zip(other, |a, b| a + b)
    }

    /// Dimension of a quotient; none when an exponent gets out of hand.
    pub fn over(self, other: Self) -> Option<Self> {
        self.zip(other, |a, b| a - b)
    }

    /// Dimension of the n-th power; none when an exponent gets out of hand.
    pub fn power(self, n: i32) -> Option<Self> {
        self.zip(Self::NUMBER, |a, _| a.saturating_mul(n))
    }

    /// Dimension of the square root; none when an exponent is odd.
    pub fn root(self) -> Option<Self> {
        if self.0.iter().any(|e| e % 2 != 0) {
            return None;
        }
        self.zip(Self::NUMBER, |a, _| a / 2)
    }

    /// Whether this is a plain number.
    pub fn is_number(self) -> bool {
        self == Self::NUMBER
    }

    fn known(self) -> Option<&'static Known> {
        KNOWN.iter().find(|k| k.dimension == self)
    }

    /// The internal unit in which quantities of this dimension are stored, as ASCII: `mm`, `rad`,
    /// `N*mm`, `1`, or a product of base units such as `mm^-1*rad`.
    pub fn unit(self) -> String {
        if let Some(k) = self.known() {
            return k.unit.into();
        }
        let parts: Vec<String> = self
            .0
            .iter()
            .zip(["mm", "t", "s", "rad"])
            .filter(|(e, _)| **e != 0)
            .map(|(e, u)| if *e == 1 { u.to_string() } else { format!("{u}^{e}") })
            .collect();
        parts.join("*")
    }

    /// A unit a designer would write for this dimension, for help texts.
    pub fn suggestion(self) -> Option<&'static str> {
        self.known().filter(|k| !k.dimension.is_number()).map(|k| k.written)
    }

    /// The unit a designer would write for a declared type such as `length`; `1` for plain numbers.
    pub fn unit_of_type(name: &str) -> Option<&'static str> {
        let known = KNOWN.iter().find(|k| k.name == name)?;
        Some(if known.written.is_empty() { known.unit } else { known.written })
    }

    /// Dimension of a declared type such as `length`.
    pub fn of_type(name: &str) -> Option<Self> {
        KNOWN.iter().find(|k| k.name == name).map(|k| k.dimension)
    }

    /// Names of all declarable dimensions.
    pub fn type_names() -> impl Iterator<Item = &'static str> {
        KNOWN.iter().map(|k| k.name)
    }
}

/// "length (mm)", "number (no unit)", "a quantity in mm^3*s".
impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.known() {
            Some(k) => write!(f, "{} ({})", k.name, k.shown),
            None => write!(f, "a quantity in {}", self.unit()),
        }
    }
}

struct Known {
    name: &'static str,
    dimension: Dimension,
    /// Internal unit.
    unit: &'static str,
    /// As shown in messages.
    shown: &'static str,
    /// As a designer would write it.
    written: &'static str,
}

const fn known(
    name: &'static str,
    dimension: Dimension,
    unit: &'static str,
    shown: &'static str,
    written: &'static str,
) -> Known {
    Known { name, dimension, unit, shown, written }
}

/// Torque stands before energy would: they share exponents, and mechanisms speak of torque.
const KNOWN: &[Known] = &[
    known("number", Dimension::NUMBER, "1", "no unit", ""),
    known("length", Dimension::LENGTH, "mm", "mm", "mm"),
    known("angle", Dimension::ANGLE, "rad", "deg", "deg"),
    known("force", Dimension::FORCE, "N", "N", "N"),
    known("torque", Dimension::TORQUE, "N*mm", "N·mm", "N*mm"),
    known("stress", Dimension::STRESS, "MPa", "MPa", "MPa"),
    known("time", Dimension::TIME, "s", "s", "s"),
    known("mass", Dimension::MASS, "t", "g", "g"),
    known("area", Dimension::AREA, "mm^2", "mm²", "mm^2"),
    known("volume", Dimension([3, 0, 0, 0]), "mm^3", "mm³", "mm^3"),
    known("density", Dimension::DENSITY, "t/mm^3", "g/cm³", "g/cm^3"),
    known("speed", Dimension([1, 0, -1, 0]), "mm/s", "mm/s", "mm/s"),
    known("acceleration", Dimension([1, 0, -2, 0]), "mm/s^2", "mm/s²", "mm/s^2"),
    known("stiffness", Dimension([0, 1, -2, 0]), "N/mm", "N/mm", "N/mm"),
    known("frequency", Dimension([0, 0, -1, 0]), "1/s", "1/s", "1/s"),
    known("angular_speed", Dimension([0, 0, -1, 1]), "rad/s", "deg/s", "deg/s"),
    known("curvature", Dimension([-1, 0, 0, 0]), "1/mm", "1/mm", "1/mm"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_roots_follow_the_exponents() {
        let l = Dimension::LENGTH;
        assert_eq!(l.times(l), Some(Dimension::AREA));
        assert_eq!(Dimension::AREA.root(), Some(l));
        assert_eq!(l.root(), None);
        assert_eq!(Dimension::FORCE.times(l), Some(Dimension::TORQUE));
        assert_eq!(Dimension::FORCE.over(Dimension::AREA), Some(Dimension::STRESS));
        assert_eq!(l.power(30), None);
        assert_eq!(l.power(i32::MAX), None);
    }

    #[test]
    fn dimensions_read_as_words() {
        assert_eq!(Dimension::LENGTH.to_string(), "length (mm)");
        assert_eq!(Dimension::AREA.to_string(), "area (mm²)");
        assert_eq!(Dimension([1, 0, 0, 1]).to_string(), "a quantity in mm*rad");
    }
}
