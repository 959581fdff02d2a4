//! Many rods and links: the compliant mechanism in equilibrium over its cycle
//! (Megaro et al. 2017, eq. 1), its stability, drive torques, and the derivatives of all of it by
//! the design parameters (eqs. 17–19).
//!
//! The rods are condensed one by one onto the links they join, so what is solved here is a small
//! symmetric saddle-point system of link increments and multipliers.

mod buckling;
mod change;
mod design_load;
mod frames;
mod landscape;
mod layout;
mod load;
mod model;
mod newton;
mod predict;
mod residual;
mod saddle;
mod sensitivity;
mod step;
mod sweep;
mod target;
mod weight;

pub use buckling::{MOST_FACTOR, load_factors};
pub use change::{DirectionChange, DriveChange, EndFrameChange, LayoutChange, TraceChange};
pub use design_load::{LayoutLoad, LayoutLoadKind};
pub use frames::RodEndFrame;
pub use landscape::{Balance, Landscape, Rest, Snap, landscape};
pub use layout::Layout;
pub use load::{PointForce, PointForceChange};
pub use model::{Model, ModelError, ModelRod, State};
pub use newton::{Equilibrium, SolveError, Solver};
pub use sensitivity::{Sensitivity, SensitivityWorkspace};
pub use sweep::{Cycle, SAME_MM, SweepError, apart_mm, sweep, sweep_both_ways};
pub use target::{LayoutDirection, LayoutTrace, angle_between};
pub use weight::volume_and_center;
