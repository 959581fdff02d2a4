//! The scene as the page's script reads it: a small description as JSON, and all arrays in one compressed block.
//!
//! Numbers are as coarse as a screen allows: positions in 16 bits of the box they lie in (a link of 200 mm to 3 µm),
//! normals in 8, turns in 16. Exact geometry is what STL, 3MF and glTF are for.

use super::Report;
use crate::emit::normals::shaded;
use crate::emit::scene::{Frame, Scene};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use std::io::Write;

/// Colours of the scale of stress.
const SHADES: usize = 33;

/// The arrays, one after the other, each from a multiple of four bytes on.
#[derive(Default)]
struct Block(Vec<u8>);

impl Block {
    /// Where the next array begins.
    fn here(&mut self) -> usize {
        while !self.0.len().is_multiple_of(4) {
            self.0.push(0);
        }
        self.0.len()
    }

    /// Positions in 16 bits of their box: `[offset, count, x, y, z, wide, high, deep]`.
    fn positions(&mut self, points: &[Vector3<f64>]) -> Value {
        let at = self.here();
        let first = points.first().copied().unwrap_or_default();
        let (lo, hi) = points.iter().fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        let size = hi - lo;
        for p in points {
            for k in 0..3 {
                let share = if size[k] > 0.0 { (p[k] - lo[k]) / size[k] } else { 0.0 };
                self.0.extend(((share * 65535.0).round() as u16).to_le_bytes());
            }
        }
        json!([
            at,
            points.len(),
            short(lo.x),
            short(lo.y),
            short(lo.z),
            short(size.x),
            short(size.y),
            short(size.z)
        ])
    }

    /// Unit vectors in 8 bits.
    fn directions(&mut self, units: &[Vector3<f64>]) -> usize {
        let at = self.here();
        for u in units {
            self.0.extend([u.x, u.y, u.z].map(|x| ((x * 127.0).round() as i8) as u8));
        }
        at
    }

    /// Corners of triangles, in as many bits as their vertices need: `[offset, count, bytes each]`. Differences from
    /// corner to corner: they are small and alike, and pack well.
    fn corners(&mut self, triangles: &[[usize; 3]], vertices: usize) -> Value {
        let at = self.here();
        let wide = if vertices <= usize::from(u16::MAX) + 1 { 2 } else { 4 };
        let mut last = 0_i64;
        for i in triangles.iter().flatten() {
            let step = *i as i64 - last;
            last = *i as i64;
            if wide == 2 {
                self.0.extend((step as u16).to_le_bytes());
            } else {
                self.0.extend((step as u32).to_le_bytes());
            }
        }
        json!([at, 3 * triangles.len(), wide])
    }

    fn turns(&mut self, rotations: impl Iterator<Item = Matrix3<f64>>) -> usize {
        let at = self.here();
        for r in rotations {
            let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r));
            self.0.extend(
                [q.i, q.j, q.k, q.w].iter().flat_map(|x| ((x * 32767.0).round() as i16).to_le_bytes()),
            );
        }
        at
    }

    fn bytes(&mut self, values: impl Iterator<Item = u8>) -> usize {
        let at = self.here();
        self.0.extend(values);
        at
    }

    /// Places over the cycle: `{p: positions, q: offset of turns}`.
    fn frames(&mut self, frames: &[Frame]) -> Value {
        let places: Vec<Vector3<f64>> = frames.iter().map(|f| f.origin).collect();
        json!({"p": self.positions(&places), "q": self.turns(frames.iter().map(|f| f.rotation))})
    }
}

/// A number without digits that nobody sees.
fn short(x: f64) -> Value {
    let rounded = (x * 1e4).round() / 1e4;
    if rounded.is_finite() { json!(rounded + 0.0) } else { Value::Null }
}

fn place(v: &Vector3<f64>) -> Value {
    json!([short(v.x), short(v.y), short(v.z)])
}

/// A stress as a part of the full one, 0 to 255.
fn shade(scene: &Scene, stress_mpa: f64) -> u8 {
    let full = scene.full_stress_mpa;
    let share = if full > 0.0 { stress_mpa / full } else { 0.0 };
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// The description, safe inside of a script element, and the block in base 64.
pub fn pack(report: &Report<'_>) -> Result<(String, String), String> {
    let scene = report.scene;
    let mut block = Block::default();
    let mut links = Vec::new();
    for link in &scene.links {
        let seen = shaded(&link.mesh);
        let local: Vec<Vector3<f64>> = seen.positions.iter().map(|p| p - link.center).collect();
        links.push(json!({
            "name": link.name,
            "part": link.part,
            "v": block.positions(&local),
            "n": block.directions(&seen.normals),
            "i": block.corners(&seen.triangles, local.len()),
            "center": place(&link.center),
            "s": block.frames(&link.states),
        }));
    }
    let mut ribbons = Vec::new();
    for ribbon in &scene.ribbons {
        let surface = ribbon.surface();
        let stations = ribbon.rest.len();
        let frames: Vec<Frame> = ribbon.states.iter().flatten().copied().collect();
        let stresses = ribbon.stresses_mpa.iter().flatten();
        ribbons.push(json!({
            "name": ribbon.name,
            "stations": stations,
            "v": block.positions(&surface.local),
            "n": block.directions(&surface.normals),
            "i": block.corners(&surface.triangles, surface.local.len()),
            "at": block.bytes(surface.stations.iter().map(|k| u8::try_from(*k).unwrap_or(u8::MAX))),
            "peak": block.bytes(surface.stresses_mpa.iter().map(|s| shade(scene, *s))),
            "s": block.frames(&frames),
            "now": block.bytes(stresses.map(|s| shade(scene, *s))),
        }));
    }
    let ghosts: Vec<Value> = scene
        .ghosts
        .iter()
        .map(|g| {
            json!({
                "name": g.name,
                "radius": short(g.radius_mm),
                "bars": g.bars.iter().map(|[a, b]| json!([place(&(a - g.center)), place(&(b - g.center))])).collect::<Vec<_>>(),
                "center": place(&g.center),
                "s": block.frames(&g.states),
            })
        })
        .collect();
    let none = Vec::new();
    let mut traces = Vec::new();
    for (k, t) in scene.traces.iter().enumerate() {
        let started = report.started.get(k).unwrap_or(&none);
        traces.push(json!({
            "name": t.name,
            "path": block.positions(&t.path),
            "target": block.positions(&t.target),
            "before": block.positions(started),
        }));
    }
    let series = |values: &[f64]| values.iter().map(|v| short(*v)).collect::<Vec<Value>>();
    let plots: Vec<Value> = report
        .plots
        .iter()
        .map(|p| {
            let curves = p.series.iter().map(|s| series(&s.after)).collect::<Vec<_>>();
            json!({"id": p.id, "unit": p.unit, "frame": p.frame().map(short), "values": curves})
        })
        .collect();
    let colour = |k: usize| {
        let [r, g, b] = scene.colour(scene.full_stress_mpa * k as f64 / (SHADES - 1) as f64);
        format!("#{:02x}{:02x}{:02x}", byte(r), byte(g), byte(b))
    };
    let (lo, hi) = scene.bounding_box().unwrap_or_default();
    let data = json!({
        "name": scene.name,
        "times": scene.times_s.iter().map(|t| short(*t)).collect::<Vec<_>>(),
        "flat": scene.flat.as_ref().map(place),
        "box": [place(&lo), place(&hi)],
        "shades": (0..SHADES).map(colour).collect::<Vec<_>>(),
        "links": links,
        "ribbons": ribbons,
        "ghosts": ghosts,
        "traces": traces,
        "plots": plots,
    });
    let told = |e: std::io::Error| e.to_string();
    let mut deflate = DeflateEncoder::new(Vec::new(), Compression::new(6));
    deflate.write_all(&block.0).map_err(told)?;
    let packed = deflate.finish().map_err(told)?;
    // Names are the user's: none may end the element it stands in.
    let data = data.to_string().replace('<', "\\u003c").replace('>', "\\u003e");
    Ok((data, STANDARD.encode(packed)))
}

fn byte(x: f64) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}
