//! What is printed with the test piece: how to measure, and where to enter it.

use super::{BEAMS, Coupon};
use std::fmt::Write;

/// How to measure, and what the library's E lets expect.
pub fn sheet(coupon: &Coupon) -> String {
    let mut out = format!(
        "# How stiff is your {material}?\n\n\
         1. Print `coupon_comb.stl` on your machine, lying as it is, with the settings of your real parts.\n\
         2. Measure thickness and width of each beam with calipers, in three places; enter the means.\n\
         3. Clamp the tab so that the beams are level and their thin direction is upright, a ruler behind the holes.\n\
         4. Hang a weight on a hole by a thread and read, within a minute, how far the hole drops. Enter it in `measured.csv`.\n\
         5. `flexura coupon {material} --on {process} --measured measured.csv`\n\n\
         | beam | thickness, mm | weight, g | drop if E is {e:.0} MPa, mm |\n| --- | --- | --- | --- |\n",
        material = coupon.material,
        process = coupon.process,
        e = coupon.e_mpa,
    );
    for (b, beam) in BEAMS.iter().enumerate() {
        for grams in coupon.grams[b] {
            let drop = coupon.drop_mm(b, [coupon.thick_mm[b], coupon.wide_mm], grams, coupon.e_mpa);
            let drop = drop.map_or("too far".into(), |d| format!("{d:.1}"));
            let _ = writeln!(out, "| {beam} | {} | {grams} | {drop} |", coupon.thick_mm[b]);
        }
    }
    out.push_str(
        "\nE goes with the third power of the thickness: 0.05 mm in 1 mm are 15 %. A second reading an hour later shows how\n\
         much the material creeps.\n",
    );
    out
}

/// A table to enter readings: sizes as drawn, drops left empty.
pub fn readings_to_enter(coupon: &Coupon) -> String {
    let mut out = String::from("beam,thickness_mm,width_mm,weight_g,drop_mm\n");
    for (b, beam) in BEAMS.iter().enumerate() {
        for grams in coupon.grams[b] {
            let _ = writeln!(out, "{beam},{},{},{grams},", coupon.thick_mm[b], coupon.wide_mm);
        }
    }
    out
}
