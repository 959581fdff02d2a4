//! A picture of the rest pose as PNG, without a display: triangles into a z-buffer, seen from the right and above.

use super::normals::shaded;
use super::scene::Scene;
use nalgebra::Vector3;

/// Each pixel is the mean of so many squared.
const SAMPLES: usize = 3;
/// Left free round the mechanism, as a part of the picture.
const MARGIN: f64 = 0.06;
/// From where it is seen: turned by so much to the side and upwards, rad.
const YAW: f64 = 0.40;
const PITCH: f64 = 0.45;
/// Printed parts in turn, sRGB.
const PARTS: [[f64; 3]; 5] =
    [[0.78, 0.80, 0.83], [0.62, 0.70, 0.80], [0.82, 0.76, 0.62], [0.66, 0.77, 0.68], [0.77, 0.67, 0.73]];
const TRACE: [f64; 3] = [0.85, 0.20, 0.15];
const TARGET: [f64; 3] = [0.25, 0.45, 0.85];
const EDGE: f64 = 0.45;

/// The bytes of a PNG file: same scene, same bytes.
///
/// # Errors
/// What the encoder says.
pub fn png_bytes(scene: &Scene, width: u32, height: u32) -> Result<Vec<u8>, String> {
    let mut canvas = Canvas::new(scene, width as usize * SAMPLES, height as usize * SAMPLES);
    for link in &scene.links {
        let seen = shaded(&link.mesh);
        let colour = PARTS[link.part % PARTS.len()];
        for t in &seen.triangles {
            canvas.triangle(t.map(|i| (seen.positions[i], seen.normals[i], colour)));
        }
    }
    for ribbon in &scene.ribbons {
        let surface = ribbon.surface();
        let Some(rest) = ribbon.rest.first() else { continue };
        let corner = |i: usize| {
            let frame = ribbon.rest.get(surface.stations[i]).unwrap_or(rest);
            let colour = scene.colour(surface.stresses_mpa[i]);
            (frame.point(&surface.local[i]), frame.rotation * surface.normals[i], colour)
        };
        for t in &surface.triangles {
            canvas.triangle(t.map(corner));
        }
    }
    canvas.edges();
    for trace in &scene.traces {
        canvas.line(&trace.target, TARGET);
        canvas.line(&trace.path, TRACE);
    }
    encode(&canvas.mean(), width, height).map_err(|e| e.to_string())
}

fn encode(pixels: &[u8], width: u32, height: u32) -> Result<Vec<u8>, png::EncodingError> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(out)
}

/// A corner of a triangle: position (mm), unit normal, colour.
type Corner = (Vector3<f64>, Vector3<f64>, [f64; 3]);

struct Canvas {
    width: usize,
    height: usize,
    colour: Vec<[f64; 3]>,
    /// Towards the viewer, mm; negative infinity where nothing is.
    depth: Vec<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
    towards: Vector3<f64>,
    light: Vector3<f64>,
    /// Samples a mm.
    scale: f64,
    /// Middle of what is seen, along right and up, mm.
    middle: [f64; 2],
}

impl Canvas {
    fn new(scene: &Scene, width: usize, height: usize) -> Self {
        let towards = Vector3::new(YAW.sin() * PITCH.cos(), PITCH.sin(), YAW.cos() * PITCH.cos());
        let right = Vector3::new(YAW.cos(), 0.0, -YAW.sin());
        let up = towards.cross(&right);
        let mut out = Self {
            width,
            height,
            colour: vec![[1.0; 3]; width * height],
            depth: vec![f64::NEG_INFINITY; width * height],
            right,
            up,
            towards,
            light: (towards + up * 0.6 - right * 0.5).normalize(),
            scale: 1.0,
            middle: [0.0; 2],
        };
        let links = scene.links.iter().flat_map(|l| &l.mesh.vertices);
        let points = links.chain(scene.traces.iter().flat_map(|t| t.path.iter().chain(&t.target)));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points {
            for (k, x) in [p.dot(&right), p.dot(&up)].into_iter().enumerate() {
                (low[k], high[k]) = (low[k].min(x), high[k].max(x));
            }
        }
        if low[0] <= high[0] {
            let fit =
                |k: usize, room: usize| room as f64 * (1.0 - 2.0 * MARGIN) / (high[k] - low[k]).max(1e-3);
            out.scale = fit(0, width).min(fit(1, height));
            out.middle = [0, 1].map(|k| (low[k] + high[k]) / 2.0);
        }
        out
    }

    /// Column, row and nearness.
    fn project(&self, p: &Vector3<f64>) -> [f64; 3] {
        let x = (p.dot(&self.right) - self.middle[0]) * self.scale + self.width as f64 / 2.0;
        let y = self.height as f64 / 2.0 - (p.dot(&self.up) - self.middle[1]) * self.scale;
        [x, y, p.dot(&self.towards)]
    }

    fn triangle(&mut self, corners: [Corner; 3]) {
        let [a, b, c] = corners.map(|(p, ..)| self.project(&p));
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        // Rows run downwards: what faces the viewer is clockwise here.
        if area >= 0.0 {
            return;
        }
        let shades = corners.map(|(_, n, colour)| {
            let bright = 0.42 + 0.58 * n.dot(&self.light).max(0.0);
            colour.map(|x| x * bright)
        });
        let span = |k: usize, limit: usize| {
            let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            (low - 0.5).ceil().max(0.0) as usize
                ..((high - 0.5).floor() + 1.0).clamp(0.0, limit as f64) as usize
        };
        for row in span(1, self.height) {
            for column in span(0, self.width) {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let side = |p: [f64; 3], q: [f64; 3]| {
                    ((q[0] - p[0]) * (y - p[1]) - (x - p[0]) * (q[1] - p[1])) / area
                };
                let w = [side(b, c), side(c, a), side(a, b)];
                if w.iter().any(|w| *w < 0.0) {
                    continue;
                }
                let depth = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                let at = row * self.width + column;
                if depth > self.depth[at] {
                    self.depth[at] = depth;
                    self.colour[at] = std::array::from_fn(|k| (0..3).map(|i| w[i] * shades[i][k]).sum());
                }
            }
        }
    }

    /// Darkens where something stands before what is far behind.
    fn edges(&mut self) {
        let behind = 6.0 / self.scale.max(1e-9) + 0.8;
        let mut dark = Vec::new();
        for row in 0..self.height {
            for column in 0..self.width {
                let at = row * self.width + column;
                let here = self.depth[at];
                let farther = |other: usize| here > self.depth[other] + behind;
                let edge = (column > 0 && farther(at - 1))
                    || (column + 1 < self.width && farther(at + 1))
                    || (row > 0 && farther(at - self.width))
                    || (row + 1 < self.height && farther(at + self.width));
                if here > f64::NEG_INFINITY && edge {
                    dark.push(at);
                }
            }
        }
        for at in dark {
            self.colour[at] = self.colour[at].map(|x| x * EDGE);
        }
    }

    /// A line before everything else.
    fn line(&mut self, points: &[Vector3<f64>], colour: [f64; 3]) {
        for pair in points.windows(2) {
            let (a, b) = (self.project(&pair[0]), self.project(&pair[1]));
            let steps = ((b[0] - a[0]).abs().max((b[1] - a[1]).abs()).ceil() as usize).clamp(1, 100_000);
            for k in 0..=steps {
                let u = k as f64 / steps as f64;
                let (x, y) = (a[0] + (b[0] - a[0]) * u, a[1] + (b[1] - a[1]) * u);
                let reach = SAMPLES as f64 * 0.6;
                let range = |m: f64, limit: usize| {
                    (m - reach).floor().max(0.0) as usize
                        ..((m + reach).ceil().clamp(0.0, limit as f64) as usize)
                };
                for row in range(y, self.height) {
                    for column in range(x, self.width) {
                        self.colour[row * self.width + column] = colour;
                    }
                }
            }
        }
    }

    /// Pixels in bytes.
    fn mean(&self) -> Vec<u8> {
        let (width, height) = (self.width / SAMPLES, self.height / SAMPLES);
        let mut out = Vec::with_capacity(width * height * 3);
        for row in 0..height {
            for column in 0..width {
                for k in 0..3 {
                    let samples = (0..SAMPLES * SAMPLES).map(|s| {
                        let (y, x) = (row * SAMPLES + s / SAMPLES, column * SAMPLES + s % SAMPLES);
                        self.colour[y * self.width + x][k]
                    });
                    let mean = samples.sum::<f64>() / (SAMPLES * SAMPLES) as f64;
                    out.push((mean.clamp(0.0, 1.0) * 255.0).round() as u8);
                }
            }
        }
        out
    }
}
