//! How a part lies on the bed. A flexure is printed best standing in the layers: its centre line runs within a layer, so
//! that bending pulls along printed lines and not layers apart, and its width stands upright, so that its thickness is
//! drawn and not stacked. What lies otherwise is named.

use super::check::{MeshFacts, check_mesh};
use super::mesh::Mesh;
use super::parts::FlexureSolid;
use super::sweep::tangents;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Sine of the angle by which a flexure may leave its layer. A leaf of 20 mm then rises by 1 mm.
const IN_LAYER: f64 = 0.05;
/// Sine of the angle by which the width of a flexure may lean.
const UPRIGHT: f64 = 0.1;
/// Directions nearer than this (sine) are one candidate: a part is not tilted by three degrees for a flexure's sake.
const SAME: f64 = 0.06;
/// Angles out of the layers are compared, summed, in steps of this, rad: what is drawn upright stays so where little is won.
const LEAN_STEP: f64 = 0.1;
/// Directions that are tried at most: those that more of a part's flexures ask for come first.
const CANDIDATES: usize = 48;
/// Faces this near to the bed rest on it, mm: bosses stay 0.02 mm, bars 0.25 mm below a layer's face.
const RESTS_MM: f64 = 0.3;
/// Places that are tried for a part, and how far one is beside the other, mm.
const PLACES: usize = 24;
const ASIDE_MM: f64 = 1.0 / 512.0;
/// Heights that differ by less are equal, mm.
const EQUAL_MM: f64 = 0.1;

/// A part as it lies on the bed.
#[derive(Clone, Debug, PartialEq)]
pub struct Lying {
    /// What points upwards, in the coordinates of the assembly.
    pub up: Vector3<f64>,
    /// From the assembly's axes to the bed's.
    pub rotation: Matrix3<f64>,
    /// x on the bed = rotation · X + translation, mm: the box around the part begins at the origin.
    pub translation: Vector3<f64>,
    /// Size on the bed, mm.
    pub size_mm: Vector3<f64>,
    /// Area that rests on the bed, mm².
    pub contact_mm2: f64,
    /// What each flexure of the part does, in the order given.
    pub flexures: Vec<Posture>,
}

/// How a flexure lies in the layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Posture {
    /// In the layers, its width upright: the thickness is drawn.
    Standing,
    /// In the layers, but its thickness is stacked; or it is round.
    Flat,
    /// Out of the layers, at most by this angle, rad.
    Leaning(f64),
}

impl Lying {
    /// The part on the bed, with coordinates exact in `f32`, and what it is like there. A part that is only moved or turned by right angles
    /// keeps its shape to the last bit. Where another is, its coordinates round otherwise, and slender triangles may then cross: of
    /// the first few places beside each other, all nearer than a printer resolves, the first where the part is sound is
    /// taken (the first of all where none is, or the part is not sound where it was made).
    pub fn mesh(&self, mesh: &Mesh) -> (Mesh, MeshFacts) {
        let placed = |k: usize| {
            let shift = Vector3::new(1.0, 1.0, 0.25) * (k as f64 * ASIDE_MM);
            let place = |p: &Vector3<f64>| self.rotation * p + self.translation + shift;
            let vertices = mesh.vertices.iter().map(place).collect();
            let lying = Mesh { vertices, triangles: mesh.triangles.clone() }.rounded_to_f32().sorted();
            let facts = check_mesh(&lying);
            (lying, facts)
        };
        let first = placed(0);
        let exact = self.rotation.iter().all(|x| *x == 0.0 || x.abs() == 1.0);
        if exact || first.1.is_sound() {
            return first;
        }
        (1..PLACES).map(placed).find(|(_, facts)| facts.is_sound()).unwrap_or(first)
    }

    /// The flexures that leave the layers, with their angles (rad).
    pub fn leaning(&self) -> impl Iterator<Item = (usize, f64)> {
        self.flexures.iter().enumerate().filter_map(|(i, p)| match p {
            Posture::Leaning(angle) => Some((i, *angle)),
            _ => None,
        })
    }
}

/// The best way to lay a part: as few flexures out of the layers as possible, as many upright, then low, then on the
/// largest face, then as drawn. `bed_mm` turns it by a right angle where it would not fit otherwise.
pub fn lie(mesh: &Mesh, flexures: &[&FlexureSolid], bed_mm: Option<[f64; 3]>) -> Option<Lying> {
    mesh.bounding_box()?;
    let whole = |x: f64, step: f64| (x / step).round() as i64;
    let asked = |up: &Vector3<f64>| {
        let postures: Vec<Posture> = flexures.iter().map(|f| posture(f, up)).collect();
        let leaning: Vec<f64> = postures
            .iter()
            .filter_map(|p| if let Posture::Leaning(a) = p { Some(*a) } else { None })
            .collect();
        let standing = postures.iter().filter(|p| **p == Posture::Standing).count();
        [leaning.len() as i64, whole(leaning.iter().sum::<f64>(), LEAN_STEP), -(standing as i64)]
    };
    // One question after the other, of those that are left: the last ones look at the whole mesh.
    let left = least(candidates(flexures), asked);
    let left = least(left, |up| {
        let (low, high) = extent(mesh, up);
        whole(high - low, EQUAL_MM)
    });
    let left = least(left, |up| -whole(contact(mesh, up, extent(mesh, up).0), 1.0));
    let up = *left.first()?;
    let mut rotation = upright(&up);
    let size = |r: &Matrix3<f64>| {
        let along = |row: usize| extent(mesh, &r.row(row).transpose());
        let [x, y, z] = [along(0), along(1), along(2)];
        (Vector3::new(x.0, y.0, z.0), Vector3::new(x.1 - x.0, y.1 - y.0, z.1 - z.0))
    };
    let (_, straight) = size(&rotation);
    if let Some([x, y, _]) = bed_mm
        && (straight.x > x || straight.y > y)
        && straight.y <= x
        && straight.x <= y
    {
        rotation = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0) * rotation;
    }
    let (least, size_mm) = size(&rotation);
    Some(Lying {
        up,
        rotation,
        translation: -least,
        size_mm,
        contact_mm2: contact(mesh, &up, extent(mesh, &up).0),
        flexures: flexures.iter().map(|f| posture(f, &up)).collect(),
    })
}

/// Those of some directions of which a measure is least, in their order; nothing is measured of one alone.
fn least<K: Ord + Send>(
    of: Vec<Vector3<f64>>,
    measure: impl Fn(&Vector3<f64>) -> K + Sync + Send,
) -> Vec<Vector3<f64>> {
    if of.len() < 2 {
        return of;
    }
    let measured: Vec<K> = of.par_iter().map(measure).collect();
    let best = measured.iter().min();
    of.into_iter().zip(&measured).filter(|(_, key)| Some(*key) == best).map(|(v, _)| v).collect()
}

/// Directions to try: as drawn first, then the other axes, then what flexures ask for.
fn candidates(flexures: &[&FlexureSolid]) -> Vec<Vector3<f64>> {
    let mut out: Vec<Vector3<f64>> = Vec::new();
    let mut add = |v: Vector3<f64>| {
        if let Some(v) = v.try_normalize(1e-6)
            && out.iter().all(|o| o.cross(&v).norm() > SAME)
        {
            out.push(v);
        }
    };
    [Vector3::z(), Vector3::y(), Vector3::x()].into_iter().for_each(&mut add);
    let middle = |v: &[Vector3<f64>]| v.get(v.len() / 2).copied().unwrap_or_default();
    flexures.iter().for_each(|f| add(middle(&f.m2)));
    let ways: Vec<Vector3<f64>> = flexures.iter().map(|f| f.end_point(true) - f.end_point(false)).collect();
    for (i, a) in ways.iter().enumerate() {
        for b in &ways[..i] {
            if a.cross(b).norm() > SAME * a.norm() * b.norm() {
                add(a.cross(b));
            }
        }
    }
    flexures.iter().for_each(|f| add(middle(&f.m1)));
    out.truncate(CANDIDATES);
    out.iter().flat_map(|v| [*v, -v]).collect()
}

fn posture(flexure: &FlexureSolid, up: &Vector3<f64>) -> Posture {
    let rise = tangents(flexure).iter().fold(0.0, |m: f64, t| m.max(t.dot(up).abs()));
    if rise > IN_LAYER {
        return Posture::Leaning(rise.min(1.0).asin());
    }
    let (a, b) = flexure.end_axes(false);
    let upright = flexure.m2.iter().all(|m| m.cross(up).norm() < UPRIGHT);
    if upright && b > a { Posture::Standing } else { Posture::Flat }
}

fn extent(mesh: &Mesh, along: &Vector3<f64>) -> (f64, f64) {
    let heights = mesh.vertices.iter().map(|p| p.dot(along));
    heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), h| (lo.min(h), hi.max(h)))
}

/// Area of the faces that look straight down and lie at the bottom.
fn contact(mesh: &Mesh, up: &Vector3<f64>, bottom: f64) -> f64 {
    let area = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        if [a, b, c].iter().any(|p| p.dot(up) > bottom + RESTS_MM) {
            return 0.0;
        }
        let normal = (b - a).cross(&(c - a)) / 2.0;
        if normal.dot(up) < -0.99 * normal.norm() { normal.norm() } else { 0.0 }
    };
    (0..mesh.triangles.len()).map(area).sum()
}

/// The shortest turn that takes a direction upwards; exact for the axes.
fn upright(up: &Vector3<f64>) -> Matrix3<f64> {
    let z = Vector3::z();
    let (axis, cos) = (up.cross(&z), up.dot(&z));
    if axis.norm() < 1e-9 {
        return if cos > 0.0 {
            Matrix3::identity()
        } else {
            Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0))
        };
    }
    let k = crate::math::skew(&axis);
    // Rodrigues with sin = |axis|.
    Matrix3::identity() + k + k * k / (1.0 + cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Facets, Slot};
    use crate::rod::SectionShape;

    fn leaf(from: Vector3<f64>, to: Vector3<f64>, wide: Vector3<f64>) -> FlexureSolid {
        let t = (to - from).normalize();
        let m1 = wide.cross(&t);
        let n = 5;
        FlexureSolid {
            fillets: [None; 2],
            path: "leaf".into(),
            joint: 0,
            joint_point: from,
            bodies: (0, 1),
            section: SectionShape::Rectangle,
            centreline: (0..n).map(|k| from + (to - from) * (f64::from(k) / f64::from(n - 1))).collect(),
            m1: vec![m1; n as usize],
            m2: vec![wide; n as usize],
            a_mm: vec![0.4; n as usize],
            b_mm: vec![3.0; n as usize],
        }
    }

    fn bar(to: Vector3<f64>) -> Mesh {
        Slot::bar(Vector3::zeros(), to, Vector3::z(), 3.0, 6.0, 0.5).mesh(&Facets::default(), 0.0)
    }

    #[test]
    fn a_planar_part_stays_as_drawn_and_moves_to_the_origin() {
        let leaves = [leaf(Vector3::zeros(), Vector3::new(9.0, 9.0, 0.0), Vector3::z())];
        let mesh = bar(Vector3::x() * 40.0);
        let lying = lie(&mesh, &leaves.iter().collect::<Vec<_>>(), None).unwrap();
        assert_eq!(lying.rotation, Matrix3::identity());
        assert_eq!(lying.flexures, [Posture::Standing]);
        let (low, high) = lying.mesh(&mesh).0.bounding_box().unwrap();
        assert!(low.norm() < 1e-5 && (high - lying.size_mm).norm() < 1e-5, "{low} {high}");
        assert!((lying.mesh(&mesh).0.volume_mm3() - mesh.volume_mm3()).abs() < 1e-3 * mesh.volume_mm3());
    }

    #[test]
    fn a_part_drawn_standing_is_laid_down() {
        // Both leaves run in the plane of y and z, with their width along x.
        let leaves = [
            leaf(Vector3::zeros(), Vector3::new(0.0, 9.0, 9.0), Vector3::x()),
            leaf(Vector3::zeros(), Vector3::new(0.0, 9.0, -9.0), Vector3::x()),
        ];
        let lying = lie(&bar(Vector3::y() * 40.0), &leaves.iter().collect::<Vec<_>>(), None).unwrap();
        assert!(lying.up.x.abs() > 0.999, "{}", lying.up);
        assert!(lying.flexures.iter().all(|p| *p == Posture::Standing));
        assert!((lying.rotation.determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn flexures_in_three_directions_cannot_all_lie() {
        let wide = Vector3::new(1.0, 1.0, 1.0).normalize();
        let directions = [Vector3::x(), Vector3::y(), Vector3::z()];
        let leaves =
            directions.map(|d| leaf(Vector3::zeros(), d * 12.0, (wide - d * wide.dot(&d)).normalize()));
        let lying = lie(&bar(Vector3::x() * 40.0), &leaves.iter().collect::<Vec<_>>(), None).unwrap();
        let leaning: Vec<(usize, f64)> = lying.leaning().collect();
        assert_eq!(leaning.len(), 1, "two directions span a layer: {leaning:?}");
        assert!((leaning[0].1 - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    }

    #[test]
    fn a_long_part_is_turned_onto_the_bed() {
        let mesh = bar(Vector3::x() * 90.0);
        let lying = lie(&mesh, &[], Some([50.0, 120.0, 50.0])).unwrap();
        assert!(lying.size_mm.x < 50.0 && lying.size_mm.y > 90.0, "{}", lying.size_mm);
    }
}
