//! Small shared mathematics: rotations, rigid poses, dense symmetric indefinite factors.

mod ldlt;
mod pose;

pub use ldlt::{Inertia, Ldlt};
pub use pose::{Pose, exp_so3, log_so3, skew};
