#![allow(clippy::unwrap_used)]
use super::*;

/// Large deflections of a cantilever under an end load, F L² / (E I) = 1: tip down by 0.3017 L (Bisshopp and Drucker 1945).
#[test]
fn a_long_drop_is_that_of_the_elastica() {
    let coupon = Coupon::new("pla", "fdm").unwrap();
    // With hardly an arm: the beam is long against it.
    let (t, e) = (1.0, 3000.0);
    let stiffness = e * WIDE_MM * t * t * t / 12.0;
    let small = 1e-3 * stiffness / (LONG_MM * LONG_MM) / NEWTON_PER_GRAM;
    let drop = coupon.drop_mm(0, [t, WIDE_MM], small, e).unwrap();
    let (l, c) = (LONG_MM, ARM_MM);
    let euler = small * NEWTON_PER_GRAM * (l.powi(3) / 3.0 + l * l * c + l * c * c) / stiffness;
    // Shear and the width's stiffening together.
    assert!((drop / euler - 1.0).abs() < 0.03, "{drop} {euler}");
    // What is large gives less than in proportion.
    let large = coupon.drop_mm(0, [t, WIDE_MM], 1000.0 * small, e).unwrap();
    assert!(large < 950.0 * drop && large > 700.0 * drop, "{large} {drop}");
}

#[test]
fn the_modulus_of_made_up_readings_is_found_again() {
    for (material, process) in [("pla", "fdm"), ("tpu_95a", "fdm"), ("rigur", "polyjet"), ("ti6al4v", "lpbf")]
    {
        let coupon = Coupon::new(material, process).unwrap();
        let truth = 0.7 * coupon.e_mpa;
        let mut text = String::from("beam,thickness_mm,width_mm,weight_g,drop_mm\n");
        for (b, beam) in BEAMS.iter().enumerate() {
            for grams in coupon.grams[b] {
                let size = [1.04 * coupon.thick_mm[b], 6.1];
                let drop = coupon.drop_mm(b, size, grams, truth).unwrap();
                assert!(drop > 1.0 && drop < 25.0, "{material} {beam} {grams}: {drop}");
                text.push_str(&format!("{beam},{},{},{grams},{drop}\n", size[0], size[1]));
            }
        }
        let found = fit(&coupon, 0, &text).unwrap();
        assert_eq!(found.readings.len(), 6);
        assert!((found.e_mpa / truth - 1.0).abs() < 1e-6, "{material}: {} of {truth}", found.e_mpa);
        assert!(found.spread < 1e-6 && found.warnings.is_empty());
    }
}

#[test]
fn what_is_no_reading_is_told_with_its_line() {
    let coupon = Coupon::new("pla", "fdm").unwrap();
    let head = "beam,thickness_mm,width_mm,weight_g,drop_mm\n";
    for (lines, code, at) in [
        ("thin,0.8,6,10,\n", "E0771", "beam,thickness_mm,width_mm,weight_g,drop_mm"),
        ("thin,0.8,6,10,\nfat,0.8,6,10,9\n", "E0771", "fat,0.8,6,10,9"),
        ("thin,0.8,6,10,nine\n", "E0771", "thin,0.8,6,10,nine"),
        ("thin,0.8,6,10,9,9\n", "E0771", "thin,0.8,6,10,9,9"),
        ("thin,0.8,6,10,-3\r\n", "E0771", "thin,0.8,6,10,-3"),
        ("thin,0.8,6,10,59\n", "E0771", "thin,0.8,6,10,59"),
        ("thin,0.8,6,10,5\nthin,0.001,6,900,5\n", "E0772", "thin,0.001,6,900,5"),
    ] {
        let text = format!("{head}{lines}");
        let wrong = fit(&coupon, 0, &text).unwrap_err();
        let label = wrong[0].labels[0].at;
        assert_eq!((wrong[0].code.as_str(), &text[label.start as usize..label.end as usize]), (code, at));
    }
    let doubtful = fit(&coupon, 0, &format!("{head}thin,0.8,6,10,9\nthick,1.6,6,50,3\n")).unwrap();
    assert_eq!(doubtful.warnings[0].code, "W0770");
    assert!(Coupon::new("unobtainium", "fdm").is_err());
}
