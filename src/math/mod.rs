//! Small shared mathematics: rotations, rigid poses, dense symmetric indefinite factors.

mod pose;

pub use pose::{Pose, exp_so3, log_so3, skew};
