//! The terms of the objective over the iterations of the optimiser, as inline SVG with a logarithmic scale.

use super::text::{escaped, number};
use std::fmt::Write;

/// Size of the plot and of the room for its axes.
const SIZE: [f64; 2] = [720.0, 220.0];
const LEFT: f64 = 52.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 26.0;
/// Powers of ten that are drawn at most: what is smaller than the largest by more counts for nothing.
const MOST_DECADES: i32 = 8;

/// Terms at some iterations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Way {
    /// Numbers of the iterations, rising.
    pub iterations: Vec<usize>,
    /// Each term by name, a value an iteration.
    pub terms: Vec<(String, Vec<f64>)>,
}

impl Way {
    /// Powers of ten below and above all values that are drawn.
    fn decades(&self) -> [i32; 2] {
        let all = self.terms.iter().flat_map(|t| &t.1).filter(|v| **v > 0.0 && v.is_finite());
        let [lo, hi] = all.fold([f64::INFINITY, 0.0_f64], |[l, h], v| [l.min(*v), h.max(*v)]);
        if !lo.is_finite() {
            return [-1, 0];
        }
        let (below, above) = (lo.log10().floor() as i32, hi.log10().ceil() as i32);
        [below.max(above - MOST_DECADES), above.max(below + 1)]
    }

    /// In one sentence, for those who do not see it.
    fn told(&self) -> String {
        let one = |(name, values): &(String, Vec<f64>)| match (values.first(), values.last()) {
            (Some(a), Some(b)) => format!("{name} from {} to {}", number(*a), number(*b)),
            _ => name.clone(),
        };
        let all: Vec<String> = self.terms.iter().map(one).collect();
        format!("Terms over {} iterations: {}", self.iterations.last().unwrap_or(&0), all.join("; "))
    }

    /// The drawing.
    pub fn svg(&self) -> String {
        let [w, h] = SIZE;
        let [below, above] = self.decades();
        let last = self.iterations.last().copied().unwrap_or(1).max(1) as f64;
        let x = |n: usize| LEFT + (w - LEFT - RIGHT) * n as f64 / last;
        let y = |power: f64| {
            h - BOTTOM - (h - BOTTOM - TOP) * (power - f64::from(below)) / f64::from(above - below)
        };
        let mut out = format!(
            "<svg viewBox=\"0 0 {w:.0} {h:.0}\" role=\"img\" aria-label=\"{}\">",
            escaped(&self.told())
        );
        let step = ((above - below) / 5).max(1);
        for power in (below..=above).step_by(step as usize) {
            let at = y(f64::from(power));
            let _ = write!(
                out,
                "<path class=\"grid\" d=\"M{LEFT:.0} {at:.1}H{:.0}\"/><text class=\"tick end\" x=\"{:.0}\" y=\"{:.1}\">{}</text>",
                w - RIGHT,
                LEFT - 6.0,
                at + 3.5,
                power_of_ten(power)
            );
        }
        let marks = [0, self.iterations.last().copied().unwrap_or(0) / 2, last as usize];
        for (k, n) in marks.iter().enumerate().filter(|(k, n)| *k != 1 || (**n > 0 && last > 3.0)) {
            let unit = if k == 2 { if *n == 1 { " iteration" } else { " iterations" } } else { "" };
            let place = if k == 2 { "end" } else { "mid" };
            let at = if k == 2 { w - RIGHT } else { x(*n) };
            let _ = write!(
                out,
                "<text class=\"tick {place}\" x=\"{at:.1}\" y=\"{:.0}\">{n}{unit}</text>",
                h - 8.0
            );
        }
        for (k, (_, values)) in self.terms.iter().enumerate() {
            let mut path = String::new();
            for (n, v) in self.iterations.iter().zip(values) {
                // Nothing lies at the bottom: it has no logarithm.
                let power = if *v > 0.0 { v.log10().max(f64::from(below)) } else { f64::from(below) };
                let _ =
                    write!(path, "{}{:.1} {:.1}", if path.is_empty() { "M" } else { "L" }, x(*n), y(power));
            }
            let _ = write!(out, "<path class=\"curve c{}\" d=\"{path}\"/>", k % 6);
        }
        out.push_str("</svg>");
        out
    }
}

/// 10ⁿ as it is read.
fn power_of_ten(power: i32) -> String {
    match power {
        -3..=3 => number(10.0_f64.powi(power)),
        n => format!("1e{n}").replace('-', "−"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_xml_inside_of_its_frame_also_where_a_term_is_nothing() {
        let way = Way {
            iterations: vec![0, 1, 5],
            terms: vec![("a<b".into(), vec![1200.0, 3.0, 0.0]), ("c".into(), vec![0.5, 1e-30, 0.02])],
        };
        assert_eq!(way.decades(), [-4, 4]);
        let svg = way.svg();
        let tree = roxmltree::Document::parse(&svg).unwrap();
        let mut seen = 0;
        for curve in
            tree.descendants().filter(|n| n.attribute("class").is_some_and(|c| c.starts_with("curve")))
        {
            for point in curve.attribute("d").unwrap().trim_start_matches('M').split('L') {
                let (x, y) = point.split_once(' ').unwrap();
                let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
                assert!(
                    (LEFT..=SIZE[0] - RIGHT).contains(&x) && (TOP..=SIZE[1] - BOTTOM).contains(&y),
                    "{x} {y}"
                );
                seen += 1;
            }
        }
        assert_eq!(seen, 6);
        assert!(!Way::default().svg().contains("NaN"));
    }
}
