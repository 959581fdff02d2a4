//! A mechanism in motion as plain data: what a viewer, a picture or a report shows. No file format knows of another one
//! here; [`super::glb`] writes it for viewers. Lengths in mm, times in s, stresses in MPa, coordinates those of the assembly.

use crate::geometry::Mesh;
use crate::rod::{SECTION_POINTS, SectionShape};
use nalgebra::{Matrix3, Vector3};

/// How far a flexure is drawn into its links, mm: a stub's nose is flush with the flexure's end to 0.05 mm.
const ROOT_MM: f64 = 0.7;
/// Of a root, how much thinner it ends: its rim must not lie in a face of its link.
const ROOT_SHRINKS: f64 = 0.97;
/// Every so many points of a section are drawn; the corners of a rectangle are among them.
const STRIDE: usize = 2;

/// Links, flexures, the conventional mechanism and the traces over a cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Name of what is built.
    pub name: String,
    /// Time of each state, s.
    pub times_s: Vec<f64>,
    /// Stress that the last colour stands for, MPa: the material's strength where it is stated, else the largest of all.
    pub full_stress_mpa: f64,
    /// Rigid bodies.
    pub links: Vec<Link>,
    /// Flexures.
    pub ribbons: Vec<Ribbon>,
    /// Bodies of the conventional mechanism.
    pub ghosts: Vec<Ghost>,
    /// Traced points.
    pub traces: Vec<Trace>,
    /// The common axis of all joints, where there is one.
    pub flat: Option<Vector3<f64>>,
    /// Bodies as bars, at rest.
    pub outlines: Vec<Outline>,
    /// Joints, at rest.
    pub marks: Vec<Mark>,
}

/// A body as it is drawn: the bars of its solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Name of the body.
    pub name: String,
    /// It stands still.
    pub ground: bool,
    /// In the rest pose.
    pub bars: Vec<Bar>,
}

/// A bar between two places, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Its ends.
    pub ends: [Vector3<f64>; 2],
    /// Half its width.
    pub radius_mm: f64,
}

/// A joint as it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Name.
    pub name: String,
    /// Where it is in the rest pose, mm.
    pub at: Vector3<f64>,
    /// Made of flexures.
    pub flexible: bool,
    /// Diameter of its bore, mm.
    pub bore_mm: Option<f64>,
}

/// A place with axes: x = origin + rotation · X.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// mm.
    pub origin: Vector3<f64>,
    /// Proper rotation.
    pub rotation: Matrix3<f64>,
}

impl Frame {
    /// Where a point of the frame is.
    pub fn point(&self, local: &Vector3<f64>) -> Vector3<f64> {
        self.origin + self.rotation * local
    }
}

/// That something is an earlier one of the same kind, put elsewhere: instances of one design have their form and motion
/// in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twin {
    /// Index of the earlier one.
    pub of: usize,
    /// From there to here.
    pub put: Frame,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name, of an instance's body with the instance's.
    pub name: String,
    /// The printed part it belongs to, counted from 0.
    pub part: usize,
    /// Its solid in the rest pose, in the assembly's coordinates.
    pub mesh: Mesh,
    /// A point of the body in the rest pose about which it is described.
    pub center: Vector3<f64>,
    /// Where that point is and how the body is turned from the rest pose, a state each.
    pub states: Vec<Frame>,
    /// An earlier link of the same form and motion.
    pub twin: Option<Twin>,
}

/// A flexure: a section carried along stations. z of a station's frame runs along the centre line, x across the thin side.
#[derive(Clone, Debug, PartialEq)]
pub struct Ribbon {
    /// Path, e.g. `knee.upper`.
    pub name: String,
    /// The printed part it belongs to.
    pub part: usize,
    /// Shape of the section.
    pub section: SectionShape,
    /// Half widths along x and y at each station, mm.
    pub half_widths_mm: Vec<[f64; 2]>,
    /// The stations in the rest pose.
    pub rest: Vec<Frame>,
    /// The stations in each state.
    pub states: Vec<Vec<Frame>>,
    /// Largest von Mises stress over the cycle at each station's boundary points, MPa.
    pub peaks_mpa: Vec<[f64; SECTION_POINTS]>,
    /// Largest von Mises stress of each station in each state, MPa.
    pub stresses_mpa: Vec<Vec<f64>>,
    /// An earlier flexure of the same form and motion.
    pub twin: Option<Twin>,
}

/// A body of the conventional mechanism, as bars between its joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Ghost {
    /// Name of the body.
    pub name: String,
    /// Ends of its bars in the rest pose, mm.
    pub bars: Vec<[Vector3<f64>; 2]>,
    /// Radius of a bar, mm.
    pub radius_mm: f64,
    /// As [`Link::center`].
    pub center: Vector3<f64>,
    /// As [`Link::states`].
    pub states: Vec<Frame>,
}

/// A traced point over the cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Name.
    pub name: String,
    /// Where it is in each state, mm.
    pub path: Vec<Vector3<f64>>,
    /// Where it should be, mm; empty without a target.
    pub target: Vec<Vector3<f64>>,
}

/// A surface whose every vertex belongs to a station.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// In the frame of its station, mm.
    pub local: Vec<Vector3<f64>>,
    /// Unit normal in the frame of its station.
    pub normals: Vec<Vector3<f64>>,
    /// Station of each vertex.
    pub stations: Vec<usize>,
    /// Largest stress of the cycle there, MPa.
    pub stresses_mpa: Vec<f64>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
}

/// A corner or point of a section: its index, and the normal of the side it is seen from.
struct Rim {
    point: usize,
    normal: [f64; 2],
}

impl Ribbon {
    /// The flexure's side, vertices and normals in the frames of the stations.
    pub fn surface(&self) -> Surface {
        let mut out = Surface::default();
        let stations = self.rest.len().min(self.half_widths_mm.len()).min(self.peaks_mpa.len());
        // The roots are stiff: they ride with the first and the last station.
        let mut rows: Vec<(usize, f64, f64)> = vec![(0, -ROOT_MM, ROOT_SHRINKS)];
        rows.extend((0..stations).map(|k| (k, 0.0, 1.0)));
        rows.push((stations.saturating_sub(1), ROOT_MM, ROOT_SHRINKS));
        for strip in self.strips() {
            let (first, wide) = (out.local.len(), strip.len());
            for (station, z, factor) in &rows {
                let (Some([a, b]), Some(peaks)) =
                    (self.half_widths_mm.get(*station), self.peaks_mpa.get(*station))
                else {
                    continue;
                };
                for rim in &strip {
                    let (x, y) = self.section.boundary(rim.point);
                    out.local.push(Vector3::new(a * x * factor, b * y * factor, *z));
                    // Of an ellipse (x/a, y/b); of a rectangle the side's own.
                    let across = match self.section {
                        SectionShape::Ellipse => Vector3::new(x / a, y / b, 0.0),
                        SectionShape::Rectangle => Vector3::new(rim.normal[0], rim.normal[1], 0.0),
                    };
                    out.normals.push(across.try_normalize(0.0).unwrap_or_else(Vector3::x));
                    out.stations.push(*station);
                    out.stresses_mpa.push(peaks.get(rim.point % SECTION_POINTS).copied().unwrap_or(0.0));
                }
            }
            for row in 1..rows.len() {
                for j in 1..wide {
                    let at = |r: usize, j: usize| first + r * wide + j;
                    let (a, b, c, d) = (at(row - 1, j - 1), at(row - 1, j), at(row, j - 1), at(row, j));
                    out.triangles.extend([[a, b, d], [a, d, c]]);
                }
            }
        }
        out
    }

    /// Runs of boundary points with a common side: one closed run round an ellipse, one a side of a rectangle.
    fn strips(&self) -> Vec<Vec<Rim>> {
        let run = |from: usize, to: usize, normal: [f64; 2]| {
            (from..=to).step_by(STRIDE).map(|point| Rim { point, normal }).collect()
        };
        match self.section {
            SectionShape::Ellipse => vec![run(0, SECTION_POINTS, [0.0; 2])],
            SectionShape::Rectangle => {
                let corner = SECTION_POINTS / 8;
                let quarter = SECTION_POINTS / 4;
                let side = |k: usize| {
                    let from = corner + k * quarter;
                    let (x, y) = self.section.boundary(from + quarter / 2);
                    run(from, from + quarter, [x, y])
                };
                (0..4).map(side).collect()
            }
        }
    }
}

impl Scene {
    /// Share of the full stress as a colour, sRGB in 0..1: blue, cyan, green, yellow, red, in even steps of lightness
    /// as far as that is possible with these.
    pub fn colour(&self, stress_mpa: f64) -> [f64; 3] {
        const STOPS: [[f64; 3]; 5] = [
            [0.23, 0.30, 0.75],
            [0.25, 0.65, 0.80],
            [0.55, 0.80, 0.40],
            [0.95, 0.80, 0.25],
            [0.85, 0.15, 0.15],
        ];
        let share = if self.full_stress_mpa > 0.0 { stress_mpa / self.full_stress_mpa } else { 0.0 };
        let along = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
        let below = (along.floor() as usize).min(STOPS.len() - 2);
        let u = along - below as f64;
        std::array::from_fn(|c| STOPS[below][c] * (1.0 - u) + STOPS[below + 1][c] * u)
    }

    /// Least and largest corner of the links and flexures in the rest pose, mm.
    pub fn bounding_box(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let links = self.links.iter().flat_map(|l| &l.mesh.vertices);
        let stations = self.ribbons.iter().flat_map(|r| r.rest.iter().map(|f| &f.origin));
        let mut points = links.chain(stations);
        let first = *points.next()?;
        Some(points.fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ribbon(section: SectionShape) -> Ribbon {
        let frame = |z: f64| Frame { origin: Vector3::new(0.0, 0.0, z), rotation: Matrix3::identity() };
        let rest: Vec<Frame> = (0..5).map(|k| frame(f64::from(k) * 2.0)).collect();
        Ribbon {
            name: "leaf".into(),
            part: 0,
            section,
            half_widths_mm: vec![[0.4, 2.5]; 5],
            states: vec![rest.clone()],
            rest,
            peaks_mpa: vec![std::array::from_fn(|k| k as f64); 5],
            stresses_mpa: vec![vec![31.0; 5]],
            twin: None,
        }
    }

    /// Every triangle faces outwards, where its vertices' normals point too, and every vertex lies on the section.
    #[test]
    fn surfaces_face_outwards() {
        for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
            let ribbon = ribbon(section);
            let s = ribbon.surface();
            let world = |i: usize| ribbon.rest[s.stations[i]].point(&s.local[i]);
            assert!(!s.triangles.is_empty());
            for [a, b, c] in &s.triangles {
                let (p, q, r) = (world(*a), world(*b), world(*c));
                let normal = (q - p).cross(&(r - p));
                for i in [a, b, c] {
                    assert!(normal.dot(&s.normals[*i]) > 0.0, "{section:?}: {a} {b} {c}");
                }
            }
            for (p, stress) in s.local.iter().zip(&s.stresses_mpa) {
                let k = *stress as usize;
                let (x, y) = section.boundary(k);
                let shrunk = (p.x - 0.4 * x).abs().max((p.y - 2.5 * y).abs());
                assert!(shrunk < 2.5 * (1.0 - ROOT_SHRINKS) + 1e-12, "point {k} of {section:?} at {p}");
            }
        }
    }

    #[test]
    fn colours_run_from_blue_to_red() {
        let scene = Scene { full_stress_mpa: 40.0, ..Scene::default() };
        let ([r0, _, b0], [r1, _, b1]) = (scene.colour(0.0), scene.colour(40.0));
        assert!(b0 > r0 && r1 > b1);
        assert_eq!(scene.colour(80.0), scene.colour(40.0));
        assert_eq!(Scene::default().colour(1.0), scene.colour(0.0), "without a scale nothing is stressed");
    }
}
