//! From measured drops to the modulus of elasticity.

use super::{BEAMS, Coupon};
use crate::diagnostic::{Diagnostic, Origin};

/// Relative change of E at which the search ends.
const SAME: f64 = 1e-9;
/// Steps of the search: a drop of a third of the beam's length takes ten.
const STEPS: usize = 100;
/// A drop beyond this part of the beam's length is no reading: the ruler slipped, or the unit is another.
const LARGEST_DROP: f64 = 0.7;
/// Results of beams that differ by more say that something was measured wrongly.
const APART: f64 = 0.15;

/// What was measured on one beam under one weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Index of the beam.
    pub beam: usize,
    /// Measured thickness and width, mm.
    pub size_mm: [f64; 2],
    /// The weight, g.
    pub grams: f64,
    /// How far the hole dropped, mm.
    pub drop_mm: f64,
    /// Where it stands in the file.
    pub at: Origin,
}

/// What the readings say.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Each reading and its E, MPa.
    pub readings: Vec<(Reading, f64)>,
    /// The geometric mean, MPa.
    pub e_mpa: f64,
    /// Largest distance from it, as a part of it.
    pub spread: f64,
    /// What is doubtful.
    pub warnings: Vec<Diagnostic>,
}

/// E by the readings of a file; `file` is its index in the source map.
///
/// # Errors
/// Lines that are no readings, and drops that no E explains.
pub fn fit(coupon: &Coupon, file: u32, text: &str) -> Result<Fit, Vec<Diagnostic>> {
    let readings = read(file, text)?;
    let mut found = Vec::new();
    let mut wrong = Vec::new();
    for reading in readings {
        match modulus(coupon, &reading) {
            Some(e) => found.push((reading, e)),
            None => wrong.push(
                Diagnostic::error("E0772", "no stiffness explains this drop", reading.at)
                    .label(format!("{} mm under {} g", reading.drop_mm, reading.grams))
                    .help("measure how far the hole drops, in mm, from where it is without the weight"),
            ),
        }
    }
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let mean = (found.iter().map(|(_, e)| e.ln()).sum::<f64>() / found.len() as f64).exp();
    let spread = found.iter().map(|(_, e)| (e / mean - 1.0).abs()).fold(0.0, f64::max);
    let mut warnings = Vec::new();
    if let Some((worst, e)) =
        found.iter().max_by(|a, b| (a.1 / mean).ln().abs().total_cmp(&(b.1 / mean).ln().abs()))
        && spread > APART
    {
        warnings.push(
            Diagnostic::warning("W0770", "the readings do not agree", worst.at)
                .label(format!("E = {e:.0} MPa by this one, {mean:.0} MPa by all"))
                .help("measure the thickness again, in three places: 5 % of it are 15 % of E"),
        );
    }
    Ok(Fit { readings: found, e_mpa: mean, spread, warnings })
}

/// E at which the solver finds the measured drop, MPa. A drop is nearly in proportion to 1 / E, so that the
/// proportion itself leads there.
fn modulus(coupon: &Coupon, reading: &Reading) -> Option<f64> {
    let mut e = coupon.e_mpa;
    for _ in 0..STEPS {
        let drop = coupon.drop_mm(reading.beam, reading.size_mm, reading.grams, e)?;
        let next = e * drop / reading.drop_mm;
        if !next.is_finite() || next <= 0.0 {
            return None;
        }
        if (next / e - 1.0).abs() < SAME {
            return Some(next);
        }
        e = next;
    }
    None
}

/// The lines of a file that have a drop.
fn read(file: u32, text: &str) -> Result<Vec<Reading>, Vec<Diagnostic>> {
    let mut readings = Vec::new();
    let mut wrong = Vec::new();
    let mut start = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        let shown = line.trim_end();
        let at = Origin { file, start: start as u32, end: (start + shown.len()) as u32 };
        start += line.len();
        let cells: Vec<&str> = shown.split([',', ';']).map(str::trim).collect();
        let empty = cells.get(4).is_none_or(|c| c.is_empty());
        if number == 0 || shown.is_empty() || empty && cells.len() <= 5 {
            continue;
        }
        match reading(&cells, at) {
            Ok(reading) => readings.push(reading),
            Err(why) => wrong.push(Diagnostic::error("E0771", why, at).help(
                "a line is `beam,thickness_mm,width_mm,weight_g,drop_mm`, such as `thin,0.84,6.1,10,9.5`",
            )),
        }
    }
    if readings.is_empty() && wrong.is_empty() {
        let at = Origin { file, start: 0, end: text.lines().next().map_or(0, |l| l.len() as u32) };
        wrong.push(
            Diagnostic::error("E0771", "nothing has been measured yet", at)
                .help("enter how far each beam drops, in the last column; lines without it are passed over"),
        );
    }
    if wrong.is_empty() { Ok(readings) } else { Err(wrong) }
}

fn reading(cells: &[&str], at: Origin) -> Result<Reading, String> {
    let [beam, numbers @ ..] = cells else { return Err("this line is empty".into()) };
    let Some(beam) = BEAMS.iter().position(|b| b == beam) else {
        return Err(format!("there is no beam `{beam}`: there are {}", BEAMS.join(", ")));
    };
    if numbers.len() != 4 {
        return Err(format!("a line has 5 values, this has {}", cells.len()));
    }
    let mut values = [0.0; 4];
    for (value, cell) in values.iter_mut().zip(numbers) {
        *value = cell
            .parse()
            .ok()
            .filter(|v: &f64| v.is_finite() && *v > 0.0)
            .ok_or_else(|| format!("`{cell}` is no positive number"))?;
    }
    let [thick, wide, grams, drop_mm] = values;
    if drop_mm > LARGEST_DROP * super::LONG_MM {
        return Err(format!("a drop of {drop_mm} mm is more than a beam of {} mm does", super::LONG_MM));
    }
    Ok(Reading { beam, size_mm: [thick, wide], grams, drop_mm, at })
}
