//! Small shared mathematics: rotations, rigid poses, dual numbers, banded and dense factors.

pub mod banded;
pub mod dual;
pub mod elimination;
pub mod fronts;
mod ldlt;
pub mod polyline;
mod pose;
mod turn;

pub use ldlt::{Inertia, Ldlt};
pub use pose::{Pose, exp_so3, log_so3, skew};
pub use turn::{nearest_turn, twist_about};
