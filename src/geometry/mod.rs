//! Printable solids: from the rest pose of bodies and flexures to one closed triangle mesh a printed
//! part, and the checks and measurements that prove it (physics.md "Geometry").
//!
//! | file | holds |
//! | --- | --- |
//! | `input`, `layers` | a design and its rods as the input of all others |
//! | `parts` | the input, the grouping into printed parts, the build |
//! | `link`, `skeleton` | a body as stubs, bosses, bars, eyes and risers |
//! | `anchor`, `capsules` | how these follow the flexures; a body as capsules with derivatives by the design parameters |
//! | `space`, `guide`, `riser` | a body whose joints point different ways; sliders; ways into other layers |
//! | `carve`, `field`, `wall` | links that make way for their own flexures, and what is left of them |
//! | `slot`, `sweep` | meshes of the primitives and of flexures |
//! | `fillet` | fillets where flexures enter their stubs |
//! | `tidy` | removal of tiny edges before rounding to `f32` |
//! | `union` | the boolean kernel's only client |
//! | `touch`, `graft` | what touches, and so has to be united; flexures put onto their links |
//! | `mesh`, `check`, `exact`, `ray` | triangle meshes, their facts by exact arithmetic, measurements on them |
//! | `solid`, `filled` | meshes from files as parts of links: distances, what is inside, what is wrong with them |
//! | `weigh` | what links weigh, before anything is meshed |
//! | `joined` | parts of several instances |
//! | `lie` | how a part lies on the bed |
//! | `distance`, `gap`, `cycle` | least distances, overlaps in the rest pose, gaps over a cycle |

pub mod anchor;
pub mod capsules;
pub mod carve;
pub mod check;
pub mod cycle;
pub mod distance;
pub mod exact;
mod field;
mod filled;
pub mod fillet;
pub mod fitted;
pub mod gap;
mod graft;
mod guide;
mod hole;
pub mod input;
pub mod joined;
mod layers;
pub mod lie;
pub mod link;
pub mod mesh;
mod mount;
pub mod parts;
pub mod plate;
pub mod ray;
mod riser;
mod seat;
mod section;
pub mod skeleton;
pub mod slot;
pub mod solid;
mod space;
pub mod sweep;
pub mod tidy;
mod touch;
pub mod union;
mod wall;
pub mod weigh;

#[cfg(test)]
mod tests;

pub use anchor::{Anchor, FlexureEnd, Follow, SizeBy};
pub use capsules::{SkeletonCapsule, follows_geometry, skeleton_capsules};
pub use carve::{Carving, Cut, carve};
pub use check::{MeshFacts, check_mesh};
pub use cycle::{CycleGaps, LeastGap, MovedState, carved_cycle_gaps, cycle_gaps};
pub use fillet::Fillet;
pub use fitted::{FitFault, FitFaultKind, MountSolid, Pocket, SeatSolid, out_of_reach};
pub use gap::{Fusion, Member};
pub use input::{flexure_solid, parts_input};
pub use lie::{Lying, Posture, lie};
pub use mesh::Mesh;
pub use parts::{
    BodySolid, Bore, Eye, FlexureSolid, GeometryError, Guide, Part, Parts, PartsInput, build_carved_parts,
    build_parts, build_planned, plan_bodies,
};
pub use ray::Probe;
pub use section::{Band, bands, section};
pub use slot::{Facets, Slot};
pub use solid::PlacedSolid;
pub use weigh::{has_gravity, printed_volume_and_center, weigh};
