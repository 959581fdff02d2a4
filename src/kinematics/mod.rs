//! The conventional mechanism: constraints, assembly, mobility, motion.

pub mod constraint;
mod linear;
pub mod mechanism;
pub mod mobility;
pub mod motion;
mod path;

pub use constraint::{Constraint, GeometryChange, HingeAngle, Jacobian};
pub use linear::RANK_TOLERANCE;
pub use mechanism::Mechanism;
pub use mobility::Mobility;
pub use motion::{JointSpan, Motion, State, solve_motion};
