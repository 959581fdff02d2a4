//! Cross sections: areas, second moments, St Venant torsion constants and boundary stresses of the ellipse
//! and the rectangle (Timoshenko and Goodier, Theory of Elasticity, arts. 107–109).

use super::stress::SECTION_POINTS;
use crate::math::dual::{Dual, Real};
use std::f64::consts::{PI, TAU};

/// Σ 1/n⁵ over odd n, (31/32) ζ(5).
const SUM_ODD_FIFTH: f64 = 1.004_523_762_795_139_6;
/// Σ (−1)^k cos((2k + 1)πp/2)/(2k + 1)² at p = 0 (Catalan's constant), ¼, ½, ¾.
const FACE_SUMS: [f64; 4] =
    [0.915_965_594_177_219, 0.876_903_824_465_439_7, 0.752_880_752_505_898_6, 0.515_133_201_595_918_2];
/// Terms of the torsion series left out are below this.
const LEAST_TERM: f64 = 1e-18;

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

/// Shape of a cross section with half thickness a along m₁ and half width b along m₂.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SectionShape {
    /// Semi-axes a and b.
    #[default]
    Ellipse,
    /// Sides 2a and 2b.
    Rectangle,
}

impl SectionShape {
    /// Stiffnesses of the section with half widths `a` and `b`, mm.
    pub fn stiffness<T: Real>(self, a: T, b: T, material: &RodMaterial) -> Stiffness<T> {
        match self {
            Self::Ellipse => ellipse_stiffness(a, b, material),
            Self::Rectangle => rectangle_stiffness(a, b, material),
        }
    }

    /// E ∫r² dA and E ∫r⁴ dA, N·mm² and N·mm⁴, r from the centre.
    pub(crate) fn polar_moments<T: Real>(self, a: T, b: T, material: &RodMaterial) -> [T; 2] {
        let (a2, b2) = (a * a, b * b);
        let (area, square, fourth, mixed) = match self {
            Self::Ellipse => (PI, 0.25, 0.125, 1.0 / 12.0),
            Self::Rectangle => (4.0, 1.0 / 3.0, 0.2, 2.0 / 9.0),
        };
        let ea = (a * b).scale(area * material.e_mpa);
        let polar = ea * (a2 + b2).scale(square);
        [polar, ea * ((a2 * a2 + b2 * b2).scale(fourth) + (a2 * b2).scale(mixed))]
    }

    /// Boundary point `k` of [`SECTION_POINTS`], in half widths: (x/a, y/b). Both axes are hit, and the
    /// rectangle's corners (k = 4, 12, 20, 28) with equal steps along each side between them.
    pub fn boundary(self, k: usize) -> (f64, f64) {
        let turn = k as f64 / SECTION_POINTS as f64;
        match self {
            Self::Ellipse => {
                let (s, c) = (TAU * k as f64 / SECTION_POINTS as f64).sin_cos();
                (c, s)
            }
            Self::Rectangle => {
                // Triangle wave of period one, cut off: both coordinates run between −1 and 1.
                let side = |t: f64| (2.0 - (8.0 * t - 4.0).abs()).clamp(-1.0, 1.0);
                let wave = |t: f64| side(t - t.floor());
                (wave(turn + 0.5), wave(turn + 0.25))
            }
        }
    }

    /// Factor k_s of the shear stiffness k_s G A: 0.9 and 5/6 (Cowper 1966 gives 0.9 and 0.84–0.85 at
    /// ν 0.3–0.4; these are the values of the references).
    pub fn shear_factor(self) -> f64 {
        match self {
            Self::Ellipse => 0.9,
            Self::Rectangle => 5.0 / 6.0,
        }
    }
}

/// Rectangle with sides 2a along m₁ and 2b along m₂, mm: A = 4ab, I₁ = 4a³b/3, I₂ = 4ab³/3 and, with the
/// shorter side t and the longer w, J = w t³ (1/3 − 64 t/(π⁵ w) Σ_{n odd} tanh(nπw/2t)/n⁵).
pub fn rectangle_stiffness<T: Real>(a: T, b: T, material: &RodMaterial) -> Stiffness<T> {
    let ea = (a * b).scale(4.0 * material.e_mpa);
    let (t, w) = if a.value() <= b.value() { (a + a, b + b) } else { (b + b, a + a) };
    let ratio = w / t;
    // tanh x = 1 − 2 e^{−2x}/(1 + e^{−2x}).
    let mut sum = T::constant(SUM_ODD_FIFTH);
    for n in (1..=13).step_by(2) {
        let n = f64::from(n);
        let decay = ratio.scale(-n * PI).exp();
        sum += -(decay / (T::constant(1.0) + decay)).scale(2.0 / n.powi(5));
    }
    let j = w * t * t * t * (T::constant(1.0 / 3.0) - (sum / ratio).scale(64.0 / PI.powi(5)));
    Stiffness {
        ea,
        ei1: (ea * a * a).scale(1.0 / 3.0),
        ei2: (ea * b * b).scale(1.0 / 3.0),
        gj: j.scale(material.shear_modulus_mpa()),
    }
}

/// Size of the engineering shear strain per twist rate at boundary point (±p, ±q) of a rectangle, mm, with
/// half thickness `thin` ≤ half width `wide` and p, q in 0..=1 their parts of these. The strain runs along
/// the boundary and vanishes at the corners.
fn rectangle_shear<T: Real>(thin: T, wide: T, p: f64, q: f64) -> T {
    let ratio = wide / thin;
    let one = T::constant(1.0);
    if p >= 1.0 && q >= 1.0 {
        return T::constant(0.0);
    }
    let mut sum = T::constant(0.0);
    if p >= 1.0 {
        // Long side: 2 thin (1 − 8/π² Σ cosh(nπ wide q/2 thin)/cosh(nπ wide/2 thin)/n²).
        for n in (1..400).step_by(2) {
            let n = f64::from(n);
            let h = |part: f64| ratio.scale(-0.5 * n * PI * part).exp();
            let near = h(1.0 - q);
            if near.value() / (n * n) < LEAST_TERM {
                break;
            }
            sum += ((near + h(1.0 + q)) / (one + h(2.0))).scale(1.0 / (n * n));
        }
        (thin * (one - sum.scale(8.0 / (PI * PI)))).scale(2.0)
    } else {
        // Short side: 16 thin/π² Σ ±tanh(nπ wide/2 thin) cos(nπp/2)/n².
        let at = FACE_SUMS.get((4.0 * p).round() as usize).copied().unwrap_or(0.0);
        for k in 0..20 {
            let n = f64::from(2 * k + 1);
            let decay = ratio.scale(-n * PI).exp();
            if decay.value() < LEAST_TERM {
                break;
            }
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let weight = sign * (0.5 * n * PI * p).cos() / (n * n);
            sum += (decay / (one + decay)).scale(2.0 * weight);
        }
        (thin * (T::constant(at) - sum)).scale(16.0 / (PI * PI))
    }
}

/// Square of the engineering shear strain per twist rate at the boundary points of a rectangle, mm², with
/// its derivatives by a and b.
pub(crate) fn rectangle_shear_forms(a: f64, b: f64) -> [[f64; 3]; SECTION_POINTS] {
    let (a, b) = (Dual::<2>::variable(a, 0), Dual::<2>::variable(b, 1));
    std::array::from_fn(|k| {
        let (x, y) = SectionShape::Rectangle.boundary(k);
        let (x, y) = (x.abs(), y.abs());
        let shear = if a.re <= b.re { rectangle_shear(a, b, x, y) } else { rectangle_shear(b, a, y, x) };
        let square = shear * shear;
        [square.re, square.eps[0], square.eps[1]]
    })
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

    /// Points run once round, counter-clockwise, and hit axes and corners.
    #[test]
    fn rectangle_boundary() {
        let at = |k| SectionShape::Rectangle.boundary(k);
        assert_eq!([at(0), at(8), at(16), at(24)], [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]);
        assert_eq!([at(4), at(12), at(20), at(28)], [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]);
        for k in 0..SECTION_POINTS {
            let ((x0, y0), (x1, y1)) = (at(k), at(k + 1));
            assert!((x0.abs().max(y0.abs()) - 1.0).abs() < 1e-15);
            assert!(((x1 - x0).abs() + (y1 - y0).abs() - 0.25).abs() < 1e-15 && x0 * y1 - x1 * y0 > 0.0);
        }
    }

    /// Torsion constants of the reference, either way round; largest shear stress of a square (Timoshenko
    /// and Goodier, art. 109: T = 0.208 b t² τ_max, J = 0.1406 b t³) and of a thin strip.
    #[test]
    fn rectangle_torsion() {
        let material = RodMaterial { e_mpa: 2.0, nu: 0.0 };
        let rows = [
            (1.0, 0.140577015),
            (1.5, 0.1957607089),
            (2.0, 0.2286816771),
            (3.0, 0.263316931),
            (5.0, 0.2913167542),
            (10.0, 0.3123250375),
        ];
        for (ratio, want) in rows {
            let s = rectangle_stiffness(0.5, 0.5 * ratio, &material);
            let turned = rectangle_stiffness(0.5 * ratio, 0.5, &material);
            assert!((s.gj / ratio - want).abs() < 1e-9, "{ratio}: {} {want}", s.gj / ratio);
            assert_eq!((s.gj, s.ei1, s.ei2), (turned.gj, turned.ei2, turned.ei1));
        }
        for (b, largest) in [(0.5, 0.1406 / 0.208), (1.0, 0.229 / 0.246), (5.0, 1.0)] {
            let forms = rectangle_shear_forms(0.5, b);
            let got = forms.iter().map(|f| f[0].sqrt()).fold(0.0, f64::max);
            assert!(got - forms[0][0].sqrt() < 1e-15);
            assert!((got - largest).abs() < 1e-3, "{b}: {got} {largest}");
            assert_eq!(forms[4], [0.0; 3]);
        }
        // Torque as the integral of stress times arm round the boundary: Prandtl's function is zero there,
        // so its normal slope integrates to twice the area over G (Bredt).
        let (a, b, pieces) = (0.4, 0.7, SECTION_POINTS / 8);
        let forms = rectangle_shear_forms(a, b);
        let mean = |points: [usize; 5]| {
            let f = points.map(|k| forms[k % SECTION_POINTS][0].sqrt());
            (7.0 * (f[0] + f[4]) + 32.0 * (f[1] + f[3]) + 12.0 * f[2]) / 90.0
        };
        assert_eq!(pieces, 4);
        let sides = 2.0 * b * (mean([28, 29, 30, 31, 32]) + mean([0, 1, 2, 3, 4]))
            + 2.0 * a * (mean([4, 5, 6, 7, 8]) + mean([8, 9, 10, 11, 12]));
        assert!((sides / (2.0 * 4.0 * a * b) - 1.0).abs() < 0.02, "{sides} {}", 8.0 * a * b);
        // Derivatives.
        let h = 1e-5;
        let (pa, ma) = (rectangle_shear_forms(a + h, b), rectangle_shear_forms(a - h, b));
        let (pb, mb) = (rectangle_shear_forms(a, b + h), rectangle_shear_forms(a, b - h));
        for k in 0..SECTION_POINTS {
            assert!(((pa[k][0] - ma[k][0]) / (2.0 * h) - forms[k][1]).abs() < 1e-8);
            assert!(((pb[k][0] - mb[k][0]) / (2.0 * h) - forms[k][2]).abs() < 1e-8);
        }
    }
}
