//! Printable solids: from the rest pose of bodies and flexures to one closed triangle mesh a printed
//! part, and the checks and measurements that prove it (physics.md "Geometry").
//!
//! | file | holds |
//! | --- | --- |
//! | `parts` | the input, the grouping into printed parts, the build |
//! | `link`, `skeleton` | a body as stubs, bosses, bars, eyes and risers |
//! | `slot`, `sweep` | meshes of the primitives and of flexures |
//! | `tidy` | removal of tiny edges before rounding to `f32` |
//! | `union` | the boolean kernel's only client |
//! | `mesh`, `check`, `ray` | triangle meshes, their facts, measurements on them |
//! | `joined` | parts of several instances |
//! | `distance`, `gap`, `cycle` | least distances, overlaps in the rest pose, gaps over a cycle |

pub mod check;
pub mod cycle;
pub mod distance;
pub mod gap;
pub mod joined;
pub mod link;
pub mod mesh;
pub mod parts;
pub mod ray;
pub mod skeleton;
pub mod slot;
pub mod sweep;
pub mod tidy;
pub mod union;

#[cfg(test)]
mod tests;

pub use check::{MeshFacts, check_mesh};
pub use cycle::{CycleGaps, LeastGap, MovedState, cycle_gaps};
pub use gap::{Fusion, Member};
pub use mesh::Mesh;
pub use parts::{
    BodySolid, Bore, Eye, FlexureSolid, GeometryError, Part, Parts, PartsInput, build_parts, plan_bodies,
};
pub use ray::Probe;
pub use slot::{Facets, Slot};
