//! Horizontal sections of a mesh, for what is cut from plates.

use super::mesh::Mesh;
use std::collections::BTreeMap;

/// Facets whose corners are as high as each other to this belong to one level, mm; meshes lie on a lattice that is finer.
const LEVEL_MM: f64 = 1e-6;
/// Faces of a level are at least this large together, mm²: rounded rims leave slivers.
const LEAST_FACE_MM2: f64 = 1.0;
/// What lies between levels nearer to each other than this is rims, and steps between a link and its stubs, mm: it goes half to the band below
/// and half to that above, or all to the only one.
const LEAST_BAND_MM: f64 = 0.5;
/// A point this near to the line of its neighbours says nothing, mm.
const STRAIGHT_MM: f64 = 1e-6;

/// What lies between two levels at which a part has faces that look up or down.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Lower and upper level, mm.
    pub z_mm: [f64; 2],
    /// Outlines half-way, mm: counter-clockwise round material, clockwise round what is open.
    pub outlines: Vec<Vec<[f64; 2]>>,
    /// By how much the sections at a quarter and at three quarters differ in area from that, as a part of it.
    pub uneven: f64,
}

/// The bands of a closed mesh from below: of one made of plates all that there is to say about it.
pub fn bands(mesh: &Mesh) -> Vec<Band> {
    let mut faces: Vec<(f64, f64)> = (0..mesh.triangles.len())
        .filter_map(|t| {
            let [a, b, c] = mesh.corners(t);
            let flat = (a.z - b.z).abs() <= LEVEL_MM && (a.z - c.z).abs() <= LEVEL_MM;
            flat.then(|| (a.z, (b - a).cross(&(c - a)).norm() / 2.0))
        })
        .collect();
    faces.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut levels: Vec<f64> = Vec::new();
    for same in faces.chunk_by(|a, b| b.0 - a.0 <= LEVEL_MM) {
        if same.iter().map(|f| f.1).sum::<f64>() >= LEAST_FACE_MM2 {
            levels.push(same[0].0);
        }
    }
    let between = |w: &[f64]| {
        let at = |part: f64| section(mesh, w[0] + part * (w[1] - w[0]));
        let outlines = at(0.5);
        let area = area_mm2(&outlines);
        let off = |part: f64| (area_mm2(&at(part)) - area).abs() / area.max(f64::MIN_POSITIVE);
        let uneven = off(0.25).max(off(0.75));
        Band { z_mm: [w[0], w[1]], outlines, uneven }
    };
    let thick = levels.windows(2).filter(|w| w[1] - w[0] >= LEAST_BAND_MM);
    let mut bands: Vec<Band> = thick.map(between).filter(|b| !b.outlines.is_empty()).collect();
    let small = |gap: f64| gap < 2.0 * LEAST_BAND_MM;
    for i in 1..bands.len() {
        let (below, above) = (bands[i - 1].z_mm[1], bands[i].z_mm[0]);
        if small(above - below) {
            let middle = (below + above) / 2.0;
            (bands[i - 1].z_mm[1], bands[i].z_mm[0]) = (middle, middle);
        }
    }
    if let (Some(first), Some(lowest)) = (bands.first_mut(), levels.first())
        && small(first.z_mm[0] - lowest)
    {
        first.z_mm[0] = *lowest;
    }
    if let (Some(last), Some(highest)) = (bands.last_mut(), levels.last())
        && small(highest - last.z_mm[1])
    {
        last.z_mm[1] = *highest;
    }
    bands
}

/// Outlines of a closed, oriented mesh at a height, mm. Corners at that very height count as above it.
pub fn section(mesh: &Mesh, z_mm: f64) -> Vec<Vec<[f64; 2]>> {
    type Edge = (usize, usize);
    let height = |i: usize| mesh.vertices.get(i).map_or(f64::NAN, |p| p.z);
    let above = |i: usize| height(i) >= z_mm;
    // Of each triangle that is cut, from the edge by which its boundary comes down to that by which it goes up: material on the left.
    let mut next: BTreeMap<Edge, Vec<Edge>> = BTreeMap::new();
    for t in &mesh.triangles {
        let edges = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
        let key = |(i, j): Edge| (i.min(j), i.max(j));
        let down = edges.into_iter().find(|(i, j)| above(*i) && !above(*j));
        let up = edges.into_iter().find(|(i, j)| !above(*i) && above(*j));
        if let (Some(down), Some(up)) = (down, up) {
            next.entry(key(down)).or_default().push(key(up));
        }
    }
    let point = |(i, j): Edge| -> [f64; 2] {
        let (Some(a), Some(b)) = (mesh.vertices.get(i), mesh.vertices.get(j)) else { return [f64::NAN; 2] };
        let p = a.lerp(b, (z_mm - a.z) / (b.z - a.z));
        [p.x, p.y]
    };
    let mut out = Vec::new();
    while let Some((&first, _)) = next.iter().next() {
        let (mut outline, mut at) = (Vec::new(), first);
        while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
            if next.get(&at).is_some_and(Vec::is_empty) {
                next.remove(&at);
            }
            outline.push(point(at));
            at = to;
        }
        let outline = corners(&outline);
        if outline.len() >= 3 {
            out.push(outline);
        }
    }
    out
}

/// An outline without the points at which it does not turn.
fn corners(outline: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let near = |p: &[f64; 2], q: &[f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]) <= STRAIGHT_MM;
    // A cut through a corner of the mesh gives one point several times.
    let mut outline = outline.to_vec();
    outline.dedup_by(|p, q| near(p, q));
    while outline.len() > 1 && near(&outline[0], &outline[outline.len() - 1]) {
        outline.pop();
    }
    let mut kept: Vec<[f64; 2]> = Vec::with_capacity(outline.len());
    let n = outline.len();
    for (i, p) in outline.iter().enumerate() {
        let before = kept.last().copied().unwrap_or(outline[(i + n - 1) % n]);
        let after = outline[(i + 1) % n];
        let (dx, dy) = (after[0] - before[0], after[1] - before[1]);
        let length = dx.hypot(dy);
        let off = (dx * (p[1] - before[1]) - dy * (p[0] - before[0])).abs();
        if length <= STRAIGHT_MM || off > STRAIGHT_MM * length {
            kept.push(*p);
        }
    }
    kept
}

/// Area inside outlines, mm².
pub fn area_mm2(outlines: &[Vec<[f64; 2]>]) -> f64 {
    let one = |o: &Vec<[f64; 2]>| -> f64 {
        let following = o.iter().cycle().skip(1);
        o.iter().zip(following).map(|(p, q)| 0.5 * (p[0] * q[1] - p[1] * q[0])).sum()
    };
    outlines.iter().map(one).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A square tower of two storeys, cut at every height: through facets, through corners half-way up, and where it begins.
    #[test]
    fn a_cut_through_corners_is_the_same_outline() {
        let mut mesh = Mesh::default();
        for z in [0.0, 5.0, 10.0] {
            for (x, y) in [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)] {
                mesh.vertices.push(Vector3::new(x, y, z));
            }
        }
        mesh.triangles.extend([[0, 2, 1], [0, 3, 2], [8, 9, 10], [8, 10, 11]]);
        for storey in [0, 4] {
            for k in 0..4 {
                let (a, b) = (storey + k, storey + (k + 1) % 4);
                mesh.triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
            }
        }
        for z in [1e-3, 2.0, 5.0, 5.0 + 1e-9, 7.0] {
            let outlines = section(&mesh, z);
            assert_eq!(outlines.iter().map(Vec::len).collect::<Vec<_>>(), [4], "at {z}: {outlines:?}");
            assert!((area_mm2(&outlines) - 12.0).abs() < 1e-6, "at {z}");
        }
        let bands = bands(&mesh);
        assert_eq!(bands.len(), 1);
        assert!(bands[0].z_mm == [0.0, 10.0] && bands[0].uneven < 1e-9, "{bands:?}");
    }
}
