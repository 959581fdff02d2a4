//! Parts as they lie on the machine's bed: plain data for the STL and 3MF files and the print sheet.

use crate::geometry::{Lying, Mesh, MeshFacts, Posture};
use crate::ir::{Material, Process};
use nalgebra::Vector3;

/// Between parts that lie side by side, mm.
const BETWEEN_MM: f64 = 5.0;
/// How wide parts are laid out where no bed is stated, mm.
const ROW_MM: f64 = 200.0;

/// What is printed.
#[derive(Clone, Debug, PartialEq)]
pub struct Plate {
    /// Name of what is built.
    pub name: String,
    /// Its parts.
    pub parts: Vec<Laid>,
    /// What is bought besides.
    pub bought: Vec<Bought>,
}

/// Something that is bought.
#[derive(Clone, Debug, PartialEq)]
pub struct Bought {
    /// How many.
    pub count: usize,
    /// What.
    pub name: String,
    /// For what.
    pub purpose: String,
}

/// A part on the bed.
#[derive(Clone, Debug, PartialEq)]
pub struct Laid {
    /// Name of its file, without the format.
    pub name: String,
    /// As it lies, the box around it from the origin on, mm.
    pub mesh: Mesh,
    /// What that mesh is like.
    pub facts: MeshFacts,
    /// How it lies.
    pub lying: Lying,
    /// What it is made of.
    pub material: Material,
    /// How it is made.
    pub process: Process,
    /// Its flexures, in the order of [`Lying::flexures`].
    pub flexures: Vec<Leaf>,
}

/// A flexure of a part.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Path.
    pub path: String,
    /// Least and largest thickness over its length, mm.
    pub thickness_mm: [f64; 2],
    /// Least and largest width, mm.
    pub width_mm: [f64; 2],
}

impl Laid {
    /// Its mass, where the density is stated, g.
    pub fn mass_g(&self) -> Option<f64> {
        Some(self.mesh.volume_mm3() * self.material.density_g_mm3?)
    }

    /// Whether it fits the machine; none: no bed is stated.
    pub fn fits(&self) -> Option<bool> {
        let bed = Vector3::from(self.process.machine.bed_mm?);
        Some((0..3).all(|k| self.lying.size_mm[k] <= bed[k]))
    }

    /// Its flexures with what they do in the layers.
    pub fn postures(&self) -> impl Iterator<Item = (&Leaf, Posture)> {
        self.flexures.iter().zip(self.lying.flexures.iter().copied())
    }
}

impl Plate {
    /// Where each part goes, its corner on the bed in mm: in rows as wide as the bed, in the order of the parts.
    pub fn places(&self) -> Vec<[f64; 2]> {
        let bed = self.parts.first().and_then(|p| p.process.machine.bed_mm);
        let wide = bed.map_or(ROW_MM, |b| b[0]);
        let (mut x, mut y, mut row) = (0.0_f64, 0.0_f64, 0.0_f64);
        let place = |part: &Laid| {
            let size = part.lying.size_mm;
            if x > 0.0 && x + size.x > wide {
                (x, y, row) = (0.0, y + row + BETWEEN_MM, 0.0);
            }
            let at = [x, y];
            (x, row) = (x + size.x + BETWEEN_MM, row.max(size.y));
            at
        };
        self.parts.iter().map(place).collect()
    }

    /// Room that all parts take together, mm.
    pub fn room_mm(&self) -> [f64; 2] {
        let corners = self.places().into_iter().zip(&self.parts);
        corners.fold([0.0; 2], |[w, d], ([x, y], part)| {
            [f64::max(w, x + part.lying.size_mm.x), f64::max(d, y + part.lying.size_mm.y)]
        })
    }
}
