//! Small shared mathematics: rotations, rigid poses, dual numbers, banded and dense factors.

pub mod banded;
pub mod dual;
mod ldlt;
mod pose;

pub use ldlt::{Inertia, Ldlt};
pub use pose::{Pose, exp_so3, log_so3, skew};
