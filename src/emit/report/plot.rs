//! A quantity over the cycle as inline SVG. Colours are the page's own (classes), so that it follows light and dark; the
//! page's script moves the cursor.

use super::text::{escaped, number};
use std::fmt::Write;

/// Size of a plot and of the room for its axes, in the units of its view box: pixels on a phone.
const SIZE: [f64; 2] = [360.0, 190.0];
const LEFT: f64 = 44.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 24.0;
/// Ticks of an axis, at most.
const TICKS: f64 = 5.0;
/// What is left free above and below, as a part of the range.
const AIR: f64 = 0.06;
/// A limit farther away than so many ranges is told in words only: it would press the curves flat.
const FAR: f64 = 3.0;

/// A quantity over the cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    /// Name in the page.
    pub id: String,
    /// What it shows.
    pub title: String,
    /// Unit.
    pub unit: String,
    /// Curves.
    pub series: Vec<Series>,
    /// What is not to be passed: name and value.
    pub limits: Vec<(String, f64)>,
    /// Its range includes zero.
    pub from_zero: bool,
}

/// A curve, one value a state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name.
    pub name: String,
    /// Of the result.
    pub after: Vec<f64>,
    /// At the start of the optimisation; empty where it is not known.
    pub before: Vec<f64>,
}

impl Plot {
    /// Curves that are one become one, named after all.
    pub fn merged(mut self) -> Self {
        let mut kept: Vec<(Series, Vec<String>)> = Vec::new();
        for s in self.series.drain(..) {
            match kept.iter_mut().find(|(k, _)| k.after == s.after && k.before == s.before) {
                Some((_, names)) => names.push(s.name.clone()),
                None => kept.push((s.clone(), vec![s.name])),
            }
        }
        let named = |(s, names): (Series, Vec<String>)| Series { name: names.join(", "), ..s };
        self.series = kept.into_iter().map(named).collect();
        self
    }

    /// Whether there is something to see.
    pub fn is_empty(&self) -> bool {
        !self.series.iter().any(|s| s.after.len() > 1 && s.after.iter().all(|v| v.is_finite()))
    }

    /// Least and largest value of all curves.
    fn ends(&self) -> [f64; 2] {
        let all = self.series.iter().flat_map(|s| s.after.iter().chain(&s.before)).filter(|v| v.is_finite());
        let [lo, hi] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
        if self.from_zero { [lo.min(0.0), hi.max(0.0)] } else { [lo, hi] }
    }

    /// Limits that are drawn.
    fn drawn(&self) -> Vec<&(String, f64)> {
        let [lo, hi] = self.ends();
        let way = (hi - lo).max(1e-12);
        self.limits.iter().filter(|(_, v)| *v < hi + FAR * way && *v > lo - FAR * way).collect()
    }

    /// Least and largest value of the axis.
    pub fn range(&self) -> [f64; 2] {
        let [mut lo, mut hi] = self.ends();
        for (_, v) in self.drawn() {
            (lo, hi) = (lo.min(*v), hi.max(*v));
        }
        if !(lo.is_finite() && hi.is_finite()) {
            return [0.0, 1.0];
        }
        let way = if hi > lo { hi - lo } else { hi.abs().max(1e-9) };
        let below = if self.from_zero && lo == 0.0 { 0.0 } else { AIR * way };
        [lo - below, hi + AIR * way]
    }

    /// Limits that would lie far outside.
    pub fn far(&self) -> Vec<String> {
        let drawn = self.drawn();
        let far = self.limits.iter().filter(|l| !drawn.contains(l));
        far.map(|(name, v)| format!("{name} {} {}", number(*v), self.unit)).collect()
    }

    /// In one sentence, for those who do not see it.
    pub fn told(&self) -> String {
        let one = |s: &Series| {
            let ends = |v: &[f64]| {
                v.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(*x), h.max(*x)])
            };
            let [lo, hi] = ends(&s.after);
            let mut out = format!("{}: {} to {} {}", s.name, number(lo), number(hi), self.unit);
            if !s.before.is_empty() {
                let [lo, hi] = ends(&s.before);
                let _ = write!(out, " (at the start {} to {})", number(lo), number(hi));
            }
            out
        };
        format!(
            "{} over the cycle. {}",
            self.title,
            self.series.iter().map(one).collect::<Vec<_>>().join("; ")
        )
    }

    /// The drawing; `times_s` has a time a state.
    pub fn svg(&self, times_s: &[f64]) -> String {
        let [w, h] = SIZE;
        let [lo, hi] = self.range();
        let last = times_s.last().copied().filter(|t| *t > 0.0).unwrap_or(1.0);
        let x = |t: f64| LEFT + (w - LEFT - RIGHT) * t / last;
        let y = |v: f64| h - BOTTOM - (h - BOTTOM - TOP) * (v - lo) / (hi - lo);
        let mut out = format!(
            "<svg viewBox=\"0 0 {w:.0} {h:.0}\" role=\"img\" aria-label=\"{}\" data-plot=\"{}\">",
            escaped(&self.told()),
            escaped(&self.id)
        );
        for v in ticks(lo, hi) {
            let at = y(v);
            let _ = write!(
                out,
                "<path class=\"grid\" d=\"M{LEFT:.0} {at:.1}H{:.0}\"/><text class=\"tick end\" x=\"{:.0}\" y=\"{:.1}\">{}</text>",
                w - RIGHT,
                LEFT - 6.0,
                at + 3.5,
                tick(v, hi - lo)
            );
        }
        let t_ticks = ticks(0.0, last);
        for (k, t) in t_ticks.iter().enumerate() {
            let unit = if k + 1 == t_ticks.len() { " s" } else { "" };
            let _ = write!(
                out,
                "<text class=\"tick mid\" x=\"{:.1}\" y=\"{:.0}\">{}{unit}</text>",
                x(*t).min(w - RIGHT - 6.0),
                h - 7.0,
                tick(*t, last)
            );
        }
        for (name, v) in self.drawn() {
            let at = y(*v);
            let above = if at < TOP + 14.0 { at + 12.0 } else { at - 4.0 };
            let _ = write!(
                out,
                "<path class=\"limit\" d=\"M{LEFT:.0} {at:.1}H{:.0}\"/><text class=\"tick limit-name end\" x=\"{:.0}\" y=\"{above:.1}\">{}</text>",
                w - RIGHT,
                w - RIGHT,
                escaped(name)
            );
        }
        let path = |values: &[f64]| {
            let points = values.iter().zip(times_s).filter(|(v, _)| v.is_finite());
            let mut d = String::new();
            for (k, (v, t)) in points.enumerate() {
                let _ = write!(d, "{}{:.1} {:.1}", if k == 0 { "M" } else { "L" }, x(*t), y(*v));
            }
            d
        };
        for (k, s) in self.series.iter().enumerate() {
            if !s.before.is_empty() {
                let _ = write!(out, "<path class=\"curve before c{}\" d=\"{}\"/>", k % 6, path(&s.before));
            }
        }
        for (k, s) in self.series.iter().enumerate() {
            let _ = write!(out, "<path class=\"curve c{}\" d=\"{}\"/>", k % 6, path(&s.after));
        }
        let _ = write!(
            out,
            "<g class=\"cursor\"><path d=\"M{LEFT:.0} {TOP:.0}V{:.0}\"/>{}</g></svg>",
            h - BOTTOM,
            (0..self.series.len())
                .map(|k| format!("<circle class=\"c{}\" r=\"3.5\" cx=\"{LEFT:.0}\" cy=\"-9\"/>", k % 6))
                .collect::<String>()
        );
        out
    }

    /// What the script needs to place its cursor: left and right end, bottom, top, least and largest value.
    pub fn frame(&self) -> [f64; 6] {
        let [lo, hi] = self.range();
        [LEFT, SIZE[0] - RIGHT, SIZE[1] - BOTTOM, TOP, lo, hi]
    }
}

/// Whole steps of 1, 2 or 5 times a power of ten.
fn ticks(lo: f64, hi: f64) -> Vec<f64> {
    let raw = (hi - lo) / TICKS;
    if !(raw.is_finite() && raw > 0.0) {
        return Vec::new();
    }
    let power = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(raw);
    let (first, last) = ((lo / step).ceil() as i64, (hi / step + 1e-9).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// A tick with as many digits as the range asks for.
fn tick(v: f64, range: f64) -> String {
    let digits = (1.0 - range.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    let plain = format!("{v:.digits$}");
    let plain = if plain.contains('.') { plain.trim_end_matches('0').trim_end_matches('.') } else { &plain };
    if plain == "-0" { "0".into() } else { plain.replace('-', "−") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Plot {
        let series =
            |name: &str, after: [f64; 3]| Series { name: name.into(), after: after.into(), before: vec![] };
        Plot {
            id: "stress".into(),
            title: "Stress".into(),
            unit: "MPa".into(),
            series: vec![
                series("a", [0.0, 10.0, 5.0]),
                series("b", [0.0, 10.0, 5.0]),
                series("c", [1.0, 2.0, 3.0]),
            ],
            limits: vec![("near <".into(), 20.0), ("far".into(), 500.0)],
            from_zero: true,
        }
    }

    #[test]
    fn equal_curves_are_one_and_far_limits_are_told() {
        let plot = plot().merged();
        let names: Vec<&str> = plot.series.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["a, b", "c"]);
        assert_eq!(plot.range(), [0.0, 20.0 + 20.0 * AIR]);
        assert_eq!(plot.far(), ["far 500 MPa"]);
        assert_eq!(plot.told(), "Stress over the cycle. a, b: 0 to 10 MPa; c: 1 to 3 MPa");
    }

    #[test]
    fn a_plot_is_xml_and_stays_inside() {
        let svg = plot().svg(&[0.0, 1.0, 2.0]);
        let tree = roxmltree::Document::parse(&svg).unwrap();
        let curves =
            tree.descendants().filter(|n| n.attribute("class").is_some_and(|c| c.starts_with("curve")));
        let mut seen = 0;
        for curve in curves {
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
        assert_eq!(seen, 9);
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks(0.0, 2.0), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(ticks(-3.0, 4.0), [-2.0, 0.0, 2.0, 4.0]);
        assert!(ticks(1.0, 1.0).is_empty());
    }
}
