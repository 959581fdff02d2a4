//! Small shared mathematics: rotations, rigid poses, dual numbers, banded factors.

pub mod banded;
pub mod dual;
mod pose;

pub use pose::{Pose, exp_so3, log_so3, skew};
