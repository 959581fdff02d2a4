//! The one client of the boolean kernel (boolmesh): unions and differences of closed meshes.
//!
//! The kernel is asked only for clear crossings: who builds the operands keeps coplanar and tangent
//! faces out. A panic inside it becomes an error here, because its code cannot be vouched for.

use super::mesh::Mesh;
use super::touch::{layers, neighbours};
use boolmesh::prelude::{Manifold, OpType, compute_boolean};
use nalgebra::Vector3;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a solid could not be made.
#[derive(Clone, Debug, PartialEq)]
pub enum BooleanError {
    /// The kernel refused an operand or a result.
    Kernel(String),
    /// The kernel panicked.
    Panic,
    /// Nothing to unite.
    Empty,
}

impl fmt::Display for BooleanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BooleanError::Kernel(text) => write!(f, "the boolean kernel failed: {text}"),
            BooleanError::Panic => write!(f, "the boolean kernel broke down"),
            BooleanError::Empty => write!(f, "there is nothing to unite"),
        }
    }
}

impl std::error::Error for BooleanError {}

/// Operands are shaken by this much before they are united, mm: symmetric solids give ties, and the
/// kernel breaks ties in the order of a hash table, differently in every run. Measured: without it
/// two runs of one design differed in some diagonals, from 1e-12 on (140 roundings at 60 mm) 20 runs
/// agreed; above 1e-11 flat faces no longer count as flat and fill with slivers.
const SHAKE_MM: f64 = 1e-12;

/// Union of all meshes. Those that do not touch each other are one mesh as they stand; the layers of such are united
/// pairwise as a balanced tree: the same tree on any number of threads.
///
/// # Errors
/// No mesh, an operand that is not closed, or a failure of the kernel.
pub fn union_all(meshes: &[Mesh]) -> Result<Mesh, BooleanError> {
    let solids = meshes.iter().enumerate().filter(|(_, m)| !m.triangles.is_empty());
    let shaken: Vec<Mesh> = solids.map(|(i, m)| shaken(m, i as u64)).collect();
    let all: Vec<usize> = (0..shaken.len()).collect();
    union_layers(&shaken, &all, &neighbours(&shaken))
}

/// A mesh in general position; each has a seed of its own.
pub(super) fn shaken(mesh: &Mesh, seed: u64) -> Mesh {
    mesh.clone().shaken(SHAKE_MM, seed)
}

/// Union of some of many meshes, which have been shaken, with those that each of them touches.
pub(super) fn union_layers(
    shaken: &[Mesh],
    members: &[usize],
    neighbours: &[Vec<usize>],
) -> Result<Mesh, BooleanError> {
    union_tree(&layers(members, neighbours).iter().map(|l| together(shaken, l)).collect::<Vec<_>>())
}

fn together(meshes: &[Mesh], layer: &[usize]) -> Mesh {
    let mut out = Mesh::default();
    layer.iter().for_each(|i| out.append(&meshes[*i]));
    out
}

/// `solid` without `tools`, those that do not touch each other at once.
///
/// # Errors
/// An operand that is not closed, or a failure of the kernel.
pub fn subtract_all(solid: &Mesh, tools: &[Mesh]) -> Result<Mesh, BooleanError> {
    let shaken: Vec<Mesh> = tools.iter().enumerate().map(|(i, t)| shaken(t, 1000 + i as u64)).collect();
    let all: Vec<usize> = (0..shaken.len()).collect();
    let mut left = solid.clone();
    for layer in layers(&all, &neighbours(&shaken)) {
        left = boolean(&left, &together(&shaken, &layer), OpType::Subtract)?;
    }
    Ok(left)
}

fn union_tree(meshes: &[Mesh]) -> Result<Mesh, BooleanError> {
    match meshes {
        [] => Err(BooleanError::Empty),
        [one] => Ok(one.clone()),
        _ => {
            let (left, right) = meshes.split_at(meshes.len() / 2);
            let (a, b) = rayon::join(|| union_tree(left), || union_tree(right));
            boolean(&a?, &b?, OpType::Add)
        }
    }
}

/// One operation; the result in sorted order, which forgets the kernel's own.
fn boolean(a: &Mesh, b: &Mesh, op: OpType) -> Result<Mesh, BooleanError> {
    let (a, b) = (to_kernel(a)?, to_kernel(b)?);
    let result = catch_unwind(AssertUnwindSafe(|| compute_boolean(&a, &b, op)))
        .map_err(|_| BooleanError::Panic)?
        .map_err(BooleanError::Kernel)?;
    Ok(from_kernel(&result).sorted())
}

fn to_kernel(mesh: &Mesh) -> Result<Manifold, BooleanError> {
    let positions: Vec<f64> = mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let indices: Vec<usize> = mesh.triangles.iter().flatten().copied().collect();
    catch_unwind(AssertUnwindSafe(|| Manifold::new(&positions, &indices)))
        .map_err(|_| BooleanError::Panic)?
        .map_err(BooleanError::Kernel)
}

fn from_kernel(solid: &Manifold) -> Mesh {
    let vertices = solid.ps.iter().map(|p| Vector3::new(p.x, p.y, p.z)).collect();
    let triangles = solid
        .hs
        .chunks_exact(3)
        .filter(|t| t.iter().all(|h| h.tail < solid.ps.len()))
        .map(|t| [t[0].tail, t[1].tail, t[2].tail])
        .collect();
    Mesh { vertices, triangles }
}
