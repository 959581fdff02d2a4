//! A drawing of the rest pose as SVG: links as their bars, flexures, joints with their names, traces with their targets,
//! lengths. Made for a page and for a diff: millimetres with two decimals, one item a line, always in the same order.

use super::scene::{Ribbon, Scene};
use nalgebra::Vector3;
use std::fmt::Write;

/// Width of the picture on a page, pixels.
const PAGE: f64 = 900.0;
/// Height of the letters as a part of the drawing.
const LETTERS: f64 = 0.018;
/// Bars in a drawing of which the length is told are longer than so many letters.
const TELLABLE: f64 = 7.0;

/// A direction from which the mechanism is seen.
struct View {
    title: &'static str,
    right: Vector3<f64>,
    up: Vector3<f64>,
    /// Where its origin is put, mm.
    shift: [f64; 2],
    /// Least and largest coordinates, before the shift.
    bounds: [[f64; 2]; 2],
}

/// The text of an SVG file: same scene, same text. What moves in one plane is seen along its axis, all else in three views,
/// the upper one from above and the right one from the right (third angle).
pub fn svg_drawing(scene: &Scene) -> String {
    let mut views = match scene.flat {
        Some(axis) => vec![along(&axis)],
        None => vec![
            View::new("front", Vector3::x(), Vector3::y()),
            View::new("above", Vector3::x(), -Vector3::z()),
            View::new("right", -Vector3::z(), Vector3::y()),
        ],
    };
    views.iter_mut().for_each(|v| v.measure(scene));
    let size =
        |k: usize, views: &[View]| views.iter().map(|v| v.bounds[1][k] - v.bounds[0][k]).fold(0.0, f64::max);
    let letter = LETTERS * size(0, &views).max(size(1, &views)) * if views.len() > 1 { 1.8 } else { 1.0 };
    let gap = 5.0 * letter;
    if let [front, above, right] = views.as_mut_slice() {
        above.shift = [0.0, front.bounds[1][1] - above.bounds[0][1] + gap];
        right.shift = [front.bounds[1][0] - right.bounds[0][0] + gap, 0.0];
    }
    let corner = |k: usize, end: usize| views.iter().map(move |v| v.bounds[end][k] + v.shift[k]);
    let low = [0, 1].map(|k| corner(k, 0).fold(f64::INFINITY, f64::min));
    let high = [0, 1].map(|k| corner(k, 1).fold(f64::NEG_INFINITY, f64::max));
    let margin = 4.5 * letter;
    let (x, y) = (low[0] - margin, -high[1] - margin);
    let (width, height) = (high[0] - low[0] + 2.0 * margin, high[1] - low[1] + 2.0 * margin + 2.0 * letter);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{PAGE:.0}\" height=\"{:.0}\" viewBox=\"{} {} {} {}\" \
         font-family=\"sans-serif\" font-size=\"{}\">\n<title>{}, at rest, in mm</title>\n\
         <rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"white\"/>\n",
        PAGE * height / width,
        mm(x),
        mm(y),
        mm(width),
        mm(height),
        mm(letter),
        escaped(&scene.name),
        mm(x),
        mm(y),
        mm(width),
        mm(height),
    );
    for view in &views {
        view.draw(scene, letter, views.len() > 1, &mut out);
    }
    let legend = format!("{} at rest, mm · trace red, target blue · flexures green", escaped(&scene.name));
    let at = [low[0] - margin + letter, -low[1] + margin + letter];
    let _ = writeln!(out, "<text x=\"{}\" y=\"{}\" fill=\"#444\">{legend}</text>", mm(at[0]), mm(at[1]));
    out.push_str("</svg>\n");
    out
}

/// The plane of a planar mechanism, x to the right as far as it can be.
fn along(axis: &Vector3<f64>) -> View {
    let right = if axis.x.abs() > 0.9 { Vector3::y() } else { Vector3::x() };
    let right = (right - axis * right.dot(axis)).normalize();
    View::new("", right, axis.cross(&right))
}

impl View {
    fn new(title: &'static str, right: Vector3<f64>, up: Vector3<f64>) -> Self {
        Self { title, right, up, shift: [0.0; 2], bounds: [[0.0; 2]; 2] }
    }

    fn measure(&mut self, scene: &Scene) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut take = |p: &Vector3<f64>, r: f64| {
            for (k, x) in [p.dot(&self.right), p.dot(&self.up)].into_iter().enumerate() {
                (low[k], high[k]) = (low[k].min(x - r), high[k].max(x + r));
            }
        };
        for bar in scene.outlines.iter().flat_map(|o| &o.bars) {
            bar.ends.iter().for_each(|p| take(p, bar.radius_mm));
        }
        scene.traces.iter().flat_map(|t| t.path.iter().chain(&t.target)).for_each(|p| take(p, 0.0));
        scene.ribbons.iter().flat_map(|r| &r.rest).for_each(|f| take(&f.origin, 0.0));
        if low[0] <= high[0] {
            self.bounds = [low, high];
        }
    }

    /// On the page, y downwards.
    fn at(&self, p: &Vector3<f64>) -> [f64; 2] {
        [p.dot(&self.right) + self.shift[0], -(p.dot(&self.up) + self.shift[1])]
    }

    fn draw(&self, scene: &Scene, letter: f64, titled: bool, out: &mut String) {
        let _ = writeln!(out, "<g stroke-linecap=\"round\" stroke-linejoin=\"round\" fill=\"none\">");
        for outline in &scene.outlines {
            let colour = if outline.ground { "#b9bcc2" } else { "#cfd8e6" };
            let _ = writeln!(
                out,
                "<g stroke=\"{colour}\" opacity=\"0.8\"><title>{}</title>",
                escaped(&outline.name)
            );
            let mut lines: Vec<String> = Vec::new();
            for bar in &outline.bars {
                let [a, b] = bar.ends.map(|p| self.at(&p));
                let line =
                    format!("<path d=\"{}\" stroke-width=\"{}\"/>", path(&[a, b]), mm(2.0 * bar.radius_mm));
                if !lines.contains(&line) {
                    lines.push(line);
                }
            }
            lines.iter().for_each(|l| out.extend([l.as_str(), "\n"]));
            out.push_str("</g>\n");
        }
        for ribbon in &scene.ribbons {
            let points: Vec<[f64; 2]> = ribbon.rest.iter().map(|f| self.at(&f.origin)).collect();
            let _ = writeln!(
                out,
                "<path d=\"{}\" stroke=\"#1f8a4c\" stroke-width=\"{}\" stroke-linecap=\"butt\" opacity=\"{}\"><title>{}</title></path>",
                path(&points),
                mm(self.thickness(ribbon)),
                // A leaf seen on its wide side does not hide what is behind.
                if self.thickness(ribbon) > 3.0 * thin(ribbon) { "0.45" } else { "1" },
                escaped(&ribbon.name)
            );
        }
        for trace in &scene.traces {
            for (points, look, what) in [
                (&trace.target, "stroke=\"#2b62c9\" stroke-dasharray=\"2 1.5\"", "target"),
                (&trace.path, "stroke=\"#cc2a1f\"", "trace"),
            ] {
                let points: Vec<[f64; 2]> = points.iter().map(|p| self.at(p)).collect();
                if points.len() > 1 {
                    let _ = writeln!(
                        out,
                        "<path d=\"{}\" {look} stroke-width=\"{}\"><title>{} ({what})</title></path>",
                        path(&points),
                        mm(letter * 0.12),
                        escaped(&trace.name)
                    );
                }
            }
        }
        out.push_str("</g>\n<g fill=\"#222\" text-anchor=\"middle\">\n");
        // Joints at one place share a name; other views than the first have the marks alone.
        let mut named: Vec<([f64; 2], f64, Vec<&str>)> = Vec::new();
        for mark in &scene.marks {
            let [x, y] = self.at(&mark.at);
            let (r, fill) = match mark.bore_mm {
                Some(d) => (d / 2.0, "white"),
                None => (letter * 0.22, if mark.flexible { "#1f8a4c" } else { "white" }),
            };
            let _ = writeln!(
                out,
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{fill}\" stroke=\"#222\" stroke-width=\"{}\"/>",
                mm(x),
                mm(y),
                mm(r),
                mm(letter * 0.08)
            );
            match named.iter_mut().find(|(at, ..)| (at[0] - x).hypot(at[1] - y) < letter) {
                Some((_, most, names)) => {
                    *most = most.max(r);
                    names.push(&mark.name);
                }
                None => named.push(([x, y], r, vec![&mark.name])),
            }
        }
        for ([x, y], r, names) in named.iter().filter(|_| matches!(self.title, "" | "front")) {
            let text = escaped(&names.join(", "));
            let _ = writeln!(out, "<text x=\"{}\" y=\"{}\">{text}</text>", mm(*x), mm(y - r - 0.45 * letter));
        }
        self.lengths(scene, letter, out);
        out.push_str("</g>\n");
        self.overall(letter, out);
        if titled {
            let at = [self.bounds[0][0] + self.shift[0], -(self.bounds[1][1] + self.shift[1]) - 1.2 * letter];
            let _ = writeln!(
                out,
                "<text x=\"{}\" y=\"{}\" fill=\"#444\">{}</text>",
                mm(at[0]),
                mm(at[1]),
                self.title
            );
        }
    }

    /// How thick a flexure looks from here, at its middle.
    fn thickness(&self, ribbon: &Ribbon) -> f64 {
        let k = ribbon.rest.len() / 2;
        let (Some(frame), Some([a, b])) = (ribbon.rest.get(k), ribbon.half_widths_mm.get(k)) else {
            return 0.5;
        };
        let towards = self.right.cross(&self.up);
        let way = frame.rotation.column(2).into_owned();
        let across = towards.cross(&way).try_normalize(1e-6).unwrap_or(self.right);
        let half =
            (a * frame.rotation.column(0).dot(&across)).hypot(b * frame.rotation.column(1).dot(&across));
        2.0 * half
    }

    /// Distances of the joints of each body, along its bars. Those that are seen shortened are left to other views.
    fn lengths(&self, scene: &Scene, letter: f64, out: &mut String) {
        let mut told: Vec<String> = Vec::new();
        for ghost in &scene.ghosts {
            for [a, b] in &ghost.bars {
                let (p, q, length) = (self.at(a), self.at(b), (b - a).norm());
                let seen = (q[0] - p[0]).hypot(q[1] - p[1]);
                if seen < TELLABLE * letter || seen < 0.999 * length {
                    continue;
                }
                let (x, y) = ((p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0);
                let mut turn = (q[1] - p[1]).atan2(q[0] - p[0]).to_degrees();
                // Never upside down.
                if turn > 90.5 {
                    turn -= 180.0;
                } else if turn < -89.5 {
                    turn += 180.0;
                }
                let line = format!(
                    "<text transform=\"translate({} {}) rotate({turn:.1})\" y=\"{}\" fill=\"#666\">{length:.1}</text>",
                    mm(x),
                    mm(y),
                    mm(0.35 * letter)
                );
                if !told.contains(&line) {
                    told.push(line);
                }
            }
        }
        told.iter().for_each(|l| out.extend([l.as_str(), "\n"]));
    }

    /// Width below and height at the left, with arrows.
    fn overall(&self, letter: f64, out: &mut String) {
        let [low, high] = self.bounds;
        let (left, right) = (low[0] + self.shift[0], high[0] + self.shift[0]);
        let (bottom, top) = (-(low[1] + self.shift[1]), -(high[1] + self.shift[1]));
        let (y, x) = (bottom + 1.6 * letter, left - 1.6 * letter);
        let a = 0.6 * letter;
        let _ = writeln!(out, "<g stroke=\"#666\" stroke-width=\"{}\" fill=\"none\">", mm(letter * 0.06));
        let lines = [
            path(&[[left, bottom], [left, y + a]]),
            path(&[[right, bottom], [right, y + a]]),
            path(&[[left, y], [right, y]]),
            path(&[[left + a, y - a / 3.0], [left, y], [left + a, y + a / 3.0]]),
            path(&[[right - a, y - a / 3.0], [right, y], [right - a, y + a / 3.0]]),
            path(&[[left, bottom], [x - a, bottom]]),
            path(&[[left, top], [x - a, top]]),
            path(&[[x, bottom], [x, top]]),
            path(&[[x - a / 3.0, bottom - a], [x, bottom], [x + a / 3.0, bottom - a]]),
            path(&[[x - a / 3.0, top + a], [x, top], [x + a / 3.0, top + a]]),
        ];
        for line in lines {
            let _ = writeln!(out, "<path d=\"{line}\"/>");
        }
        out.push_str("</g>\n<g fill=\"#444\" text-anchor=\"middle\">\n");
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{}\">{:.1}</text>",
            mm((left + right) / 2.0),
            mm(y + 1.2 * letter),
            right - left
        );
        let _ = writeln!(
            out,
            "<text transform=\"translate({} {}) rotate(-90)\">{:.1}</text>\n</g>",
            mm(x - 0.5 * letter),
            mm((top + bottom) / 2.0),
            bottom - top
        );
    }
}

/// The least thickness of a flexure at its middle, mm.
fn thin(ribbon: &Ribbon) -> f64 {
    let half = ribbon.half_widths_mm.get(ribbon.half_widths_mm.len() / 2);
    half.map_or(0.0, |[a, b]| 2.0 * a.min(*b))
}

/// Two decimals, without a sign of zero and without zeros at the end.
fn mm(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn path(points: &[[f64; 2]]) -> String {
    let mut out = String::new();
    for (k, [x, y]) in points.iter().enumerate() {
        let _ = write!(out, "{}{} {}", if k == 0 { "M" } else { "L" }, mm(*x), mm(*y));
    }
    out
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emit::scene::{Bar, Mark, Outline, Trace};

    #[test]
    fn numbers_are_short_and_have_one_zero() {
        assert_eq!([mm(-0.001), mm(1.5), mm(20.0), mm(-3.456)], ["0", "1.5", "20", "-3.46"]);
    }

    #[test]
    fn a_drawing_is_seen_along_the_axis() {
        let p = |x: f64, y: f64| Vector3::new(x, y, 7.0);
        let scene = Scene {
            name: "a & b".into(),
            flat: Some(Vector3::z()),
            outlines: vec![Outline {
                name: "crank".into(),
                ground: false,
                bars: vec![Bar { ends: [p(0.0, 0.0), p(30.0, 40.0)], radius_mm: 4.0 }],
            }],
            marks: vec![Mark { name: "pin".into(), at: p(30.0, 40.0), flexible: false, bore_mm: Some(3.0) }],
            traces: vec![Trace { name: "tip".into(), path: vec![p(0.0, 0.0), p(10.0, 0.0)], target: vec![] }],
            ..Scene::default()
        };
        let svg = svg_drawing(&scene);
        assert!(svg.contains("<path d=\"M0 0L30 -40\" stroke-width=\"8\"/>"), "{svg}");
        assert!(svg.contains("<circle cx=\"30\" cy=\"-40\" r=\"1.5\""), "{svg}");
        assert!(svg.contains("a &amp; b"), "{svg}");
        assert!(svg.contains(">38.0<") && svg.contains(">48.0<"), "overall size with the bars' width: {svg}");
    }
}
