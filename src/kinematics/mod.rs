//! The conventional mechanism: constraints, assembly, mobility, motion.

mod carried;
mod change;
pub mod constraint;
#[cfg(test)]
mod derivative_tests;
mod forms;
mod idle;
mod linear;
pub mod mechanism;
pub mod mobility;
pub mod motion;
mod path;
mod standing;
pub mod value;

pub use carried::{ReferenceChange, Twist};
pub use change::{MotionChange, motion_changes};
pub use constraint::{Constraint, GeometryChange, Jacobian};
pub use idle::Idle;
pub use linear::RANK_TOLERANCE;
pub use mechanism::Mechanism;
pub use mobility::Mobility;
pub use motion::{JointSpan, Motion, State, solve_motion};
pub use value::{HingeAngle, JointValue, Shift};
