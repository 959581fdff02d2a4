//! The root of a flexure with a fillet: how much longer it is than one that is clamped where the fillet begins, and how
//! much its largest stress exceeds the rod's. Both are of the printed form; no rod knows of them.

/// Length by which a root counts beyond the place where its fillet begins: e/t = c₀ + c₁ √(r/t) + c₂ r/t in bending about the wide
/// direction, of a leaf and of a round wire. Fitted to plane and to axisymmetric finite elements of our own for
/// 0.06 ≤ r/t ≤ 3.3 (`docs/rod-model.md`), to 0.009 t and 0.005 t; the root of r/t is what a fillet alone gives where it is long.
const LEAF: [f64; 3] = [0.358, 0.254, 0.108];
const WIRE: [f64; 3] = [0.177, 0.268, 0.080];

/// Beyond the place where its fillet begins a root is as compliant in bending as this length (mm) of the flexure. `thick_mm` is
/// the full thickness; `roundness` the thickness by the width, 0 of a wide leaf, 1 of a round wire (in between the
/// square of it is assumed). Zero without a fillet.
pub fn extra_length_mm(thick_mm: f64, radius_mm: f64, roundness: f64) -> f64 {
    if radius_mm <= 0.0 || thick_mm <= 0.0 {
        return 0.0;
    }
    let ratio = radius_mm / thick_mm;
    let of = |[c0, c1, c2]: [f64; 3]| thick_mm * (c0 + c1 * ratio.sqrt() + c2 * ratio);
    let round = roundness.clamp(0.0, 1.0).powi(2);
    of(LEAF) + (of(WIRE) - of(LEAF)) * round
}

/// Coefficients of the shoulder's formula by √(h/r) and h/r for one range of h/r.
type Shoulder = [[f64; 3]; 4];

/// Shoulder of a flat bar in bending, up to h/r = 2 and above (Pilkey, Peterson's Stress Concentration Factors, chapter 3;
/// Young, Roark's Formulas, table 17.1).
const FLAT: [Shoulder; 2] = [
    [[1.007, 1.000, -0.031], [-0.270, -2.404, 0.749], [0.677, 1.133, -0.904], [-0.414, 0.271, 0.186]],
    [[1.042, 0.982, -0.036], [-3.599, 1.619, -0.431], [6.084, -5.607, 1.158], [-2.527, 3.006, -0.691]],
];
/// The same of a round shaft.
const SHAFT: [Shoulder; 2] = [
    [[0.927, 1.149, -0.086], [0.015, -3.281, 0.837], [0.847, 1.716, -0.506], [-0.790, 0.417, -0.246]],
    [[1.225, 0.831, -0.010], [-3.790, 0.958, -0.257], [7.374, -4.834, 0.862], [-3.809, 3.046, -0.595]],
];
/// Where the formulas are given: least h/r of the flat bar and of the shaft, and the largest of both.
const LEAST_H_R: [f64; 2] = [0.1, 0.25];
const LARGEST_H_R: f64 = 20.0;

/// Stress concentration of a fillet in bending: the largest stress by the nominal one of the thinner section. The root is
/// a step from `thick_mm` to `wide_mm`, of a flat bar or of a round shaft. None where the handbook gives none: a radius
/// below h/20 or above 10 h (shaft 4 h), with h half of the step.
pub fn concentration(thick_mm: f64, radius_mm: f64, wide_mm: f64, round: bool) -> Option<f64> {
    let h = (wide_mm - thick_mm) / 2.0;
    let ratio = h / radius_mm;
    let least = LEAST_H_R[usize::from(round)];
    if !(radius_mm > 0.0 && thick_mm > 0.0 && ratio >= least && ratio <= LARGEST_H_R) {
        return None;
    }
    let table = if round { &SHAFT } else { &FLAT };
    let step = 2.0 * h / wide_mm;
    let sum = table[usize::from(ratio > 2.0)]
        .iter()
        .rev()
        .fold(0.0, |sum, c| sum * step + c[0] + c[1] * ratio.sqrt() + c[2] * ratio);
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thickness, radius, extra length by thickness and largest stress by finite elements (`docs/rod-model.md`); stubs 4.4 mm wide.
    const LEAVES: [[f64; 4]; 10] = [
        [0.8, 0.1, 0.467, 1.821],
        [0.8, 0.3, 0.554, 1.351],
        [0.8, 0.5, 0.627, 1.225],
        [0.8, 1.0, 0.780, 1.121],
        [0.8, 1.6, 0.929, 1.078],
        [0.5, 0.2, 0.566, 1.331],
        [0.5, 1.0, 0.936, 1.078],
        [1.2, 0.2, 0.476, 1.664],
        [1.2, 0.5, 0.558, 1.322],
        [1.2, 1.0, 0.672, 1.175],
    ];
    const WIRES: [[f64; 4]; 7] = [
        [1.0, 0.1, 0.274, 1.861],
        [1.0, 0.5, 0.404, 1.222],
        [1.0, 2.0, 0.715, 1.056],
        [0.6, 0.25, 0.379, 1.259],
        [0.6, 0.75, 0.581, 1.091],
        [1.6, 0.5, 0.351, 1.337],
        [1.6, 1.0, 0.437, 1.177],
    ];
    /// Fits are off by 0.009 and 0.005.
    const EXTRA: f64 = 0.01;
    /// The handbook reads up to 4.4 % below finite elements.
    const FACTOR: f64 = 0.045;

    #[test]
    fn as_finite_elements() {
        for (rows, roundness) in [(&LEAVES[..], 0.0), (&WIRES[..], 1.0)] {
            for [t, r, extra, factor] in rows {
                let here = extra_length_mm(*t, *r, roundness) / t;
                assert!((here - extra).abs() < EXTRA, "t {t}, r {r}: {here} for {extra}");
                let here = concentration(*t, *r, 4.4, roundness == 1.0).unwrap();
                assert!((here / factor - 1.0).abs() < FACTOR, "t {t}, r {r}: {here} for {factor}");
            }
        }
    }

    #[test]
    fn nothing_is_made_up() {
        assert_eq!(extra_length_mm(0.8, 0.0, 0.0), 0.0);
        for (t, r, d) in
            [(0.8, 0.0, 4.4), (0.8, 0.08, 4.4), (0.8, 20.0, 4.4), (4.4, 0.5, 4.4), (5.0, 0.5, 4.4)]
        {
            assert_eq!(concentration(t, r, d, false), None, "{t} {r} {d}");
        }
        // Both ranges give the same where they meet, to the rounding of their coefficients.
        let at = |h_r: f64| concentration(0.8, 1.8 / h_r, 4.4, false).unwrap();
        assert!((at(2.0) - at(2.0 + 1e-9)).abs() < 0.01, "{} {}", at(2.0), at(2.0 + 1e-9));
    }
}
