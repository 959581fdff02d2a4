//! Cross sections: areas, second moments and the St Venant torsion constant of the ellipse.

use crate::math::dual::Real;
use std::f64::consts::PI;

/// Isotropic linear elasticity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodMaterial {
    /// Young's modulus E, MPa.
    pub e_mpa: f64,
    /// Poisson's ratio ν.
    pub nu: f64,
}

impl RodMaterial {
    /// Shear modulus G = E/(2(1 + ν)), MPa.
    pub fn shear_modulus_mpa(&self) -> f64 {
        self.e_mpa / (2.0 * (1.0 + self.nu))
    }
}

/// Section stiffnesses of a rod (the bars of Bergou et al. 2008; Megaro et al. 2017, sec. 3.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness<T = f64> {
    /// Stretch EA, N.
    pub ea: T,
    /// Bending with κ₁, along m₁ (thin), N·mm².
    pub ei1: T,
    /// Bending with κ₂, along m₂ (wide), N·mm².
    pub ei2: T,
    /// Torsion GJ, N·mm².
    pub gj: T,
}

/// Ellipse with semi-axes `a` along m₁ and `b` along m₂, mm:
/// A = πab, I₁ = πa³b/4, I₂ = πab³/4, J = πa³b³/(a² + b²).
pub fn ellipse_stiffness<T: Real>(a: T, b: T, material: &RodMaterial) -> Stiffness<T> {
    let area = (a * b).scale(PI);
    let ea = area.scale(material.e_mpa);
    Stiffness {
        ea,
        ei1: (ea * a * a).scale(0.25),
        ei2: (ea * b * b).scale(0.25),
        gj: (area * a * a * b * b / (a * a + b * b)).scale(material.shear_modulus_mpa()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The benchmark flexure of the reference numbers.
    #[test]
    fn ellipse_matches_reference() {
        let s = ellipse_stiffness(0.4, 2.5, &RodMaterial { e_mpa: 1500.0, nu: 0.4 });
        for (got, want) in
            [(s.ea, 4712.38898), (s.ei1, 188.4955592), (s.ei2, 7363.107782), (s.gj, 262.5578884)]
        {
            assert!((got - want).abs() < 1e-9 * want, "{got} {want}");
        }
    }
}
