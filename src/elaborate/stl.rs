//! STL files, binary and ASCII, as triangle meshes.

use crate::ir::TriangleMesh;
use nalgebra::Vector3;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt;
use std::io::Cursor;
use std::sync::{Arc, OnceLock};

/// Most triangles that are taken, and thus united and measured in a sensible time.
pub const MOST_TRIANGLES: usize = 300_000;
/// Largest file, bytes: that many triangles as text with long numbers.
pub const MOST_BYTES: usize = 96 << 20;
/// Farthest coordinate, mm: half a kilometre is what exact predicates can do, ten metres what anybody prints.
const FARTHEST_MM: f32 = 10_000.0;
/// Bytes before the triangles of a binary file, and bytes of each of these.
const HEAD: usize = 84;
const RECORD: usize = 50;

/// A file's bytes with what they hold, which is read once, when it is first asked for: who holds files may keep them.
#[derive(Debug)]
pub struct SolidFile {
    bytes: Vec<u8>,
    mesh: OnceLock<Result<Arc<TriangleMesh>, StlFault>>,
}

/// Why a file is no mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum StlFault {
    /// It is no STL, or breaks off: why.
    NotStl(String),
    /// There are no triangles in it.
    Empty,
    /// It has this many.
    TooMany(usize),
    /// Number of the first triangle with a coordinate that is no place.
    NoPlace(usize),
    /// The triangles enclose nothing.
    NoVolume,
}

impl fmt::Display for StlFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StlFault::NotStl(why) => write!(f, "it is no STL file: {why}"),
            StlFault::Empty => f.write_str("there is no triangle in it"),
            StlFault::TooMany(n) => write!(f, "it has {n} triangles, and {MOST_TRIANGLES} are the most"),
            StlFault::NoPlace(n) => {
                write!(f, "triangle {n} has a coordinate that is no number, or beyond {FARTHEST_MM} mm")
            }
            StlFault::NoVolume => f.write_str("its triangles enclose nothing"),
        }
    }
}

impl SolidFile {
    /// Of the bytes of a file.
    pub fn new(bytes: Vec<u8>) -> Self {
        Self { bytes, mesh: OnceLock::new() }
    }

    /// The mesh.
    ///
    /// # Errors
    /// Why it is none.
    pub fn mesh(&self) -> Result<Arc<TriangleMesh>, StlFault> {
        self.mesh.get_or_init(|| read(&self.bytes).map(Arc::new)).clone()
    }
}

fn read(bytes: &[u8]) -> Result<TriangleMesh, StlFault> {
    let corners = triangles(bytes)?;
    let mut mesh = TriangleMesh { digest: digest(bytes), ..TriangleMesh::default() };
    let mut known: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for (t, corners) in corners.iter().enumerate() {
        if corners.iter().flatten().any(|x| !x.is_finite() || x.abs() > FARTHEST_MM) {
            return Err(StlFault::NoPlace(t + 1));
        }
        let ids = corners.map(|p| {
            // Adding zero turns -0.0 into 0.0.
            let p = p.map(|x| x + 0.0);
            *known.entry(p.map(f32::to_bits)).or_insert_with(|| {
                mesh.vertices.push(p.map(f64::from));
                mesh.vertices.len() - 1
            })
        });
        // Many programs leave triangles that have shrunk to an edge: nothing is missing without them.
        if ids[0] != ids[1] && ids[1] != ids[2] && ids[2] != ids[0] {
            mesh.triangles.push(ids);
        }
    }
    if mesh.triangles.is_empty() {
        return Err(StlFault::Empty);
    }
    let volume = volume_mm3(&mesh);
    if volume == 0.0 {
        return Err(StlFault::NoVolume);
    }
    mesh.inside_out = volume < 0.0;
    if mesh.inside_out {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    Ok(mesh)
}

/// The corners of all triangles. A binary file tells its length, so what begins like a text may be one: the length decides.
fn triangles(bytes: &[u8]) -> Result<Vec<[[f32; 3]; 3]>, StlFault> {
    let count = bytes.get(HEAD - 4..HEAD).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let told = count.map(|n| n as usize);
    let is_binary =
        told.is_some_and(|n| n.checked_mul(RECORD).and_then(|n| n.checked_add(HEAD)) == Some(bytes.len()));
    let mut text = Vec::new();
    if is_binary {
        match told {
            Some(0) | None => return Err(StlFault::Empty),
            Some(n) if n > MOST_TRIANGLES => return Err(StlFault::TooMany(n)),
            Some(_) => {}
        }
        // The reader takes for text what begins so.
        text.extend_from_slice(bytes);
        text.iter_mut().take(5).for_each(|b| *b = 0);
    } else if let Some(rest) = bytes.strip_prefix(b"solid") {
        // A name may be missing, the blank before it not.
        text.extend_from_slice(b"solid ");
        text.extend_from_slice(rest);
    } else if let Some(n) = told.filter(|n| *n > 0 && bytes.len() > HEAD) {
        let whole = (bytes.len() - HEAD) / RECORD;
        return Err(StlFault::NotStl(format!(
            "it does not begin with `solid`, and as a binary file it would have {n} triangles where there is room for {whole}"
        )));
    } else {
        return Err(StlFault::NotStl(
            "it neither begins with `solid` nor has the length of a binary file".into(),
        ));
    }
    let mut reader = Cursor::new(text);
    let all = stl_io::create_stl_reader(&mut reader).map_err(|e| StlFault::NotStl(e.to_string()))?;
    let mut found = Vec::new();
    for triangle in all {
        let triangle =
            triangle.map_err(|e| StlFault::NotStl(format!("after triangle {}: {e}", found.len())))?;
        found.push(triangle.vertices.map(|v| v.0));
        if found.len() > MOST_TRIANGLES {
            return Err(StlFault::TooMany(found.len()));
        }
    }
    if found.is_empty() { Err(StlFault::Empty) } else { Ok(found) }
}

/// Enclosed volume by the divergence theorem; negative for a mesh turned inside out.
fn volume_mm3(mesh: &TriangleMesh) -> f64 {
    let origin = Vector3::from(mesh.vertices.first().copied().unwrap_or_default());
    let corner = |i: usize| Vector3::from(mesh.vertices.get(i).copied().unwrap_or_default()) - origin;
    mesh.triangles.iter().map(|t| t.map(corner)).map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
}

fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]];
    const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    fn binary(head: &str, faces: &[[usize; 3]]) -> Vec<u8> {
        let mut out = head.as_bytes().to_vec();
        out.resize(80, b' ');
        out.extend((faces.len() as u32).to_le_bytes());
        for face in faces {
            out.extend([0; 12]);
            face.iter().flat_map(|i| CORNERS[*i]).for_each(|x| out.extend(x.to_le_bytes()));
            out.extend([0; 2]);
        }
        out
    }

    fn ascii(head: &str) -> Vec<u8> {
        let corner = |i: &usize| format!("vertex {} {} {}\n", CORNERS[*i][0], CORNERS[*i][1], CORNERS[*i][2]);
        let face = |f: &[usize; 3]| {
            let corners: String = f.iter().map(corner).collect();
            format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
        };
        format!("{head}\n{}endsolid\n", FACES.iter().map(face).collect::<String>()).into_bytes()
    }

    #[test]
    fn both_forms_give_the_same_mesh_whatever_the_heading() {
        for bytes in
            [binary("made by", &FACES), binary("solid block", &FACES), ascii("solid"), ascii("solid a b")]
        {
            let mesh = read(&bytes).unwrap();
            assert_eq!((mesh.vertices.len(), mesh.triangles.len(), mesh.inside_out), (4, 4, false));
            assert!((volume_mm3(&mesh) - 4.5).abs() < 1e-12);
        }
    }

    #[test]
    fn a_mesh_inside_out_is_turned() {
        let turned = FACES.map(|[a, b, c]| [a, c, b]);
        let mesh = read(&binary("", &turned)).unwrap();
        assert!(mesh.inside_out && volume_mm3(&mesh) > 0.0);
    }

    #[test]
    fn what_is_no_mesh_says_why() {
        let fault = |bytes: &[u8]| read(bytes).unwrap_err();
        assert!(matches!(fault(b"PK\x03\x04"), StlFault::NotStl(_)));
        assert!(matches!(fault(b""), StlFault::NotStl(_)));
        assert_eq!(fault(&binary("", &[])), StlFault::Empty);
        assert_eq!(fault(b"solid nothing\nendsolid\n"), StlFault::Empty);
        let whole = binary("", &FACES);
        let StlFault::NotStl(why) = fault(&whole[..whole.len() - 50]) else { panic!() };
        assert!(why.contains("4 triangles where there is room for 3"), "{why}");
        let text = ascii("solid");
        let StlFault::NotStl(why) = fault(&text[..text.len() / 2]) else { panic!() };
        assert!(why.starts_with("after triangle 2"), "{why}");
        let mut bad = whole.clone();
        bad[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        assert_eq!(fault(&bad), StlFault::NoPlace(2));
        bad[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&1e30_f32.to_le_bytes());
        assert_eq!(fault(&bad), StlFault::NoPlace(2));
        // One triangle is not much of a solid, three flat ones are none.
        assert_eq!(fault(&binary("", &[[0, 1, 2], [0, 2, 1]])), StlFault::NoVolume);
        assert_eq!(fault(&binary("", &[[0, 0, 1]])), StlFault::Empty);
        let many = vec![FACES[0]; MOST_TRIANGLES + 1];
        assert_eq!(fault(&binary("", &many)), StlFault::TooMany(MOST_TRIANGLES + 1));
    }
}
