//! Flexures as solids: an elliptical or rectangular section swept along the rest centreline (paper, section 3.3),
//! carried on into the stubs at both ends so that the union there is clear of touching faces.

use super::fillet::Fillet;
use super::mesh::Mesh;
use super::parts::FlexureSolid;
use super::slot::Slot;
use crate::rod::SectionShape;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Extension into the stub: (depth mm, factor on a, factor on b). The section shrinks, so that it
/// leaves the stub's faces at a clear angle and never ends flush with one.
const ROOT: [(f64, f64, f64); 3] = [(0.7, 0.97, 0.95), (1.5, 0.9, 0.86), (2.2, 0.7, 0.7)];

/// Largest step between two stations of the swept surface, mm.
const LARGEST_STEP_MM: f64 = 0.8;

/// Stations nearer to each other than this are one, mm.
const SAME_STATION_MM: f64 = 0.05;
/// A fillet of a flat section has its full size where the section has this part of its thickness.
const FLARE_FROM: f64 = 0.3;

/// One section of the swept solid.
#[derive(Clone, Copy, Debug)]
struct Station {
    center: Vector3<f64>,
    m1: Vector3<f64>,
    m2: Vector3<f64>,
    a: f64,
    b: f64,
    /// By how much a fillet moves both faces outwards, mm.
    flare: f64,
}

impl FlexureSolid {
    /// Outward unit tangent at an end, pointing from the flexure into the body; zero if the
    /// centreline has no two distinct points.
    pub fn outward(&self, at_end: bool) -> Vector3<f64> {
        let n = self.centreline.len();
        if n < 2 {
            return Vector3::zeros();
        }
        let (m1, m2, chord) = if at_end {
            (self.m1.last(), self.m2.last(), self.centreline[n - 1] - self.centreline[n - 2])
        } else {
            (self.m1.first(), self.m2.first(), self.centreline[0] - self.centreline[1])
        };
        // The frame knows the tangent better than the chord of a curved centreline.
        let tangent = match (m1, m2) {
            (Some(m1), Some(m2)) => m1.cross(m2),
            _ => chord,
        };
        let tangent = if tangent.dot(&chord) < 0.0 { -tangent } else { tangent };
        tangent.try_normalize(1e-12).unwrap_or_else(Vector3::zeros)
    }

    /// Centre of an end section.
    pub fn end_point(&self, at_end: bool) -> Vector3<f64> {
        let p = if at_end { self.centreline.last() } else { self.centreline.first() };
        p.copied().unwrap_or_default()
    }

    /// Semi-axes (a, b) of an end section, mm.
    pub fn end_axes(&self, at_end: bool) -> (f64, f64) {
        let pick = |v: &[f64]| if at_end { v.last() } else { v.first() }.copied().unwrap_or(0.0);
        (pick(&self.a_mm), pick(&self.b_mm))
    }

    /// The flexure as slots from station to station, each a filled fan of capsules of the section's
    /// thickness, which holds the section: for distances. Fillets are capsules of their largest thickness before the nose.
    pub fn slots(&self) -> Vec<Slot> {
        let count = self.centreline.len().min(self.m2.len()).min(self.a_mm.len()).min(self.b_mm.len());
        let zones = [false, true].map(|at_end| {
            let fillet = self.fillets[usize::from(at_end)]?;
            let (place, stations) = self.place_from_end(at_end, fillet.start_mm);
            Some((place, if at_end { count.saturating_sub(stations) } else { stations }, fillet))
        });
        (1..count)
            .map(|i| {
                let larger = |v: &[f64]| v[i - 1].max(v[i]);
                (i, larger(&self.a_mm), larger(&self.b_mm))
            })
            .flat_map(|(i, a, b)| {
                let (p, q) = (self.centreline[i - 1], self.centreline[i]);
                // The piece within the first fillet, the free one, that within the last fillet.
                let (mut from, mut to) = (p, q);
                let mut pieces = Vec::with_capacity(1);
                let grown = |f: &Fillet| (a + f.flare_mm(), b + f.flare_mm() * f.all_round);
                if let Some((place, station, f)) = zones[0].as_ref().filter(|(_, station, _)| i <= *station) {
                    from = if i == *station { *place } else { q };
                    let (a, b) = grown(f);
                    pieces.push((i, p, from, a, b));
                }
                let mut last = None;
                if let Some((place, station, f)) = zones[1].as_ref().filter(|(_, station, _)| i >= *station) {
                    to = if i == *station { *place } else { p };
                    let (a, b) = grown(f);
                    last = Some((i, to, q, a, b));
                }
                if (zones[0].is_none() && zones[1].is_none()) || (to - from).dot(&(q - p)) > 0.0 {
                    pieces.push((i, from, to, a, b));
                }
                pieces.extend(last);
                pieces
            })
            .map(|(i, start, end, a, b)| Slot {
                start,
                end,
                axis: self.m2[i - 1],
                disc_radius_mm: 0.0,
                // The fan reaches round a rectangle's corners, and just to an ellipse's rim.
                half_height_mm: match self.section {
                    SectionShape::Ellipse => (b - a).max(0.0),
                    SectionShape::Rectangle => b,
                },
                round_mm: a,
            })
            .collect()
    }

    /// The swept mesh, with its roots inside the stubs, `facets` round the section: rounded to a
    /// multiple of 4, so that both axes end in vertices and the mesh is exactly as thick as the design
    /// (64 facets: 0.16 % less area). A rectangle has its four corners.
    pub fn mesh(&self, facets: usize) -> Mesh {
        self.swept(&self.stations(), facets)
    }

    /// What the fillet of an end adds to its link: the root, closed where the fillet begins; none without a fillet.
    pub fn root_mesh(&self, at_end: bool, facets: usize) -> Option<Mesh> {
        self.fillets[usize::from(at_end)]?;
        let (_, [head, tail]) = self.pieces();
        let mut root = if at_end { tail } else { head };
        if !at_end {
            root.reverse();
        }
        Some(self.swept(&root, facets))
    }

    fn swept(&self, stations: &[Station], facets: usize) -> Mesh {
        let boundary: Vec<(f64, f64)> = match self.section {
            SectionShape::Ellipse => {
                let n = (facets / 4).max(2) * 4;
                let turn = |k: usize| (TAU * k as f64 / n as f64).sin_cos();
                (0..n).map(turn).map(|(sin, cos)| (cos, sin)).collect()
            }
            SectionShape::Rectangle => vec![(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)],
        };
        let n = boundary.len();
        let mut mesh = Mesh::default();
        for s in stations {
            for (x, y) in &boundary {
                // The rim of an ellipse stays an edge.
                let flare = s.flare * (x.abs() / FLARE_FROM).min(1.0).copysign(*x);
                mesh.vertices.push(s.center + s.m1 * (s.a * x + flare) + s.m2 * (s.b * y));
            }
        }
        // m1 × m2 is the direction of travel, so sections run counter-clockwise seen from the end.
        for i in 1..stations.len() {
            for j in 0..n {
                let k = (j + 1) % n;
                let (a, b, c, d) = ((i - 1) * n + j, (i - 1) * n + k, i * n + j, i * n + k);
                // The shorter diagonal, so that a strongly curved leaf stays smooth.
                let (ad, bc) = (mesh.vertices[d] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[b]);
                if ad.norm_squared() <= bc.norm_squared() {
                    mesh.triangles.extend([[a, b, d], [a, d, c]]);
                } else {
                    mesh.triangles.extend([[a, b, c], [b, d, c]]);
                }
            }
        }
        if let (Some(first), Some(last)) = (stations.first(), stations.last()) {
            let (start, end) = (mesh.vertices.len(), mesh.vertices.len() + 1);
            mesh.vertices.extend([first.center, last.center]);
            let base = (stations.len() - 1) * n;
            for j in 0..n {
                let k = (j + 1) % n;
                mesh.triangles.push([k, j, start]);
                mesh.triangles.push([base + j, base + k, end]);
            }
        }
        mesh
    }

    /// Sections from root to root.
    fn stations(&self) -> Vec<Station> {
        let (free, [head, tail]) = self.pieces();
        head.into_iter().rev().chain(free).chain(tail).collect()
    }

    /// Sections between the roots, refined by a cubic through the given stations, and those of both roots, each from the flexure
    /// into its stub.
    fn pieces(&self) -> (Vec<Station>, [Vec<Station>; 2]) {
        let count = [self.m1.len(), self.m2.len(), self.a_mm.len(), self.b_mm.len()]
            .iter()
            .fold(self.centreline.len(), |n, k| n.min(*k));
        let given: Vec<Station> = (0..count)
            .map(|i| {
                let tangent = self.m1[i].cross(&self.m2[i]);
                let chord = if i + 1 < count {
                    self.centreline[i + 1] - self.centreline[i]
                } else {
                    self.centreline[i] - self.centreline[i.max(1) - 1]
                };
                // A left-handed frame is turned, or the solid would be inside out.
                let m1 = if tangent.dot(&chord) < 0.0 { -self.m1[i] } else { self.m1[i] };
                Station {
                    center: self.centreline[i],
                    m1,
                    m2: self.m2[i],
                    a: self.a_mm[i],
                    b: self.b_mm[i],
                    flare: 0.0,
                }
            })
            .collect();
        let mut out: Vec<Station> = Vec::new();
        let (Some(first), Some(last)) = (given.first(), given.last()) else { return Default::default() };
        let sharp = |s: &Station, outward: Vector3<f64>, (depth, fa, fb): (f64, f64, f64)| Station {
            center: s.center + outward * depth,
            a: s.a * fa,
            b: s.b * fb,
            ..*s
        };
        for (i, pair) in given.windows(2).enumerate() {
            let (p, q) = (&pair[0], &pair[1]);
            let h = (q.center - p.center).norm();
            let tangent = |i: usize| {
                let s = &given[i];
                s.m1.cross(&s.m2) * h
            };
            let (tp, tq) = (tangent(i), tangent(i + 1));
            let steps = ((h / LARGEST_STEP_MM).ceil() as usize).clamp(1, 64);
            for k in 0..steps {
                let u = k as f64 / steps as f64;
                out.push(between(p, q, &tp, &tq, u));
            }
        }
        out.push(*last);
        let roots = [(false, first), (true, last)].map(|(at_end, station)| {
            let outward = self.outward(at_end);
            match &self.fillets[usize::from(at_end)] {
                None => ROOT.iter().map(|r| sharp(station, outward, *r)).collect(),
                Some(fillet) => {
                    let free = without_fillet(&mut out, at_end, fillet.start_mm);
                    rounded(fillet, station, outward, &free)
                }
            }
        });
        (out, roots)
    }
}

/// Takes the stations nearer to an end than `way_mm` out; returns them, the end first, and the one at that way last.
fn without_fillet(stations: &mut Vec<Station>, at_end: bool, way_mm: f64) -> Vec<Station> {
    if at_end {
        stations.reverse();
    }
    let (mut left, mut k) = (way_mm, 0);
    let mut step = 0.0;
    while k + 1 < stations.len() {
        step = (stations[k + 1].center - stations[k].center).norm();
        if step >= left {
            break;
        }
        left -= step;
        k += 1;
    }
    let mut taken = stations.get(..=k).map(<[Station]>::to_vec).unwrap_or_default();
    if let (Some(p), Some(q)) = (stations.get(k), stations.get(k + 1))
        && step > 0.0
    {
        taken.push(straight(p, q, left / step));
    }
    stations.drain(..(k + 1).min(stations.len()));
    // What is left begins where the fillet does; a station as good as there would be a sliver.
    if let (Some(first), Some(begin)) = (stations.first(), taken.last())
        && stations.len() > 1
        && (first.center - begin.center).norm() < SAME_STATION_MM
    {
        stations.remove(0);
    }
    if at_end {
        stations.reverse();
    }
    taken
}

/// Sections of a filleted root, from where the fillet begins into the stub. `free`: the stations that it takes the place of, the end
/// of the flexure first.
fn rounded(fillet: &Fillet, end: &Station, outward: Vector3<f64>, free: &[Station]) -> Vec<Station> {
    let at = |along: f64| {
        if along >= 0.0 {
            return Station { center: end.center + outward * along, ..*end };
        }
        let mut left = -along;
        for w in free.windows(2) {
            let step = (w[1].center - w[0].center).norm();
            if step >= left && step > 0.0 {
                return straight(&w[0], &w[1], left / step);
            }
            left -= step;
        }
        *free.last().unwrap_or(end)
    };
    let mut out = Vec::new();
    let (mut way, mut widest) = (0.0, *end);
    for [along, grown] in fillet.stations() {
        let s = at(along);
        widest = if fillet.all_round > 0.0 {
            Station { a: s.a + grown, b: s.b + grown * fillet.all_round, ..s }
        } else {
            Station { flare: grown, ..s }
        };
        way = along;
        out.push(widest);
    }
    // On into the stub, as a sharp root goes.
    let into = |(depth, fa, fb): &(f64, f64, f64)| Station {
        center: if way >= 0.0 { widest.center + outward * *depth } else { at(way + depth).center },
        a: widest.a * fa,
        b: widest.b * fb,
        flare: widest.flare * fa,
        ..*end
    };
    out.extend(ROOT.iter().map(into));
    out
}

/// Section at u in 0..1 on the straight line between two stations.
fn straight(p: &Station, q: &Station, u: f64) -> Station {
    let m2 = (p.m2 * (1.0 - u) + q.m2 * u).try_normalize(1e-12).unwrap_or(p.m2);
    let m1 = p.m1 * (1.0 - u) + q.m1 * u;
    let m1 = (m1 - m2 * m1.dot(&m2)).try_normalize(1e-12).unwrap_or(p.m1);
    let (a, b) = (p.a + (q.a - p.a) * u, p.b + (q.b - p.b) * u);
    Station { center: p.center.lerp(&q.center, u), m1, m2, a, b, flare: 0.0 }
}

/// Unit tangents at the stations.
pub(super) fn tangents(flexure: &FlexureSolid) -> Vec<Vector3<f64>> {
    flexure.m1.iter().zip(&flexure.m2).map(|(m1, m2)| m1.cross(m2)).collect()
}

/// Section at u in 0..1 between two stations: cubic Hermite centre, frame interpolated and made
/// orthonormal again.
fn between(p: &Station, q: &Station, tp: &Vector3<f64>, tq: &Vector3<f64>, u: f64) -> Station {
    let (u2, u3) = (u * u, u * u * u);
    let center = p.center * (2.0 * u3 - 3.0 * u2 + 1.0)
        + tp * (u3 - 2.0 * u2 + u)
        + q.center * (3.0 * u2 - 2.0 * u3)
        + tq * (u3 - u2);
    let m2 = (p.m2 * (1.0 - u) + q.m2 * u).try_normalize(1e-12).unwrap_or(p.m2);
    let m1 = p.m1 * (1.0 - u) + q.m1 * u;
    let m1 = (m1 - m2 * m1.dot(&m2)).try_normalize(1e-12).unwrap_or(p.m1);
    Station { center, m1, m2, a: p.a + (q.a - p.a) * u, b: p.b + (q.b - p.b) * u, flare: 0.0 }
}
