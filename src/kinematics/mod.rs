//! The conventional mechanism: constraints, assembly, mobility, motion.

pub mod constraint;

pub use constraint::{Constraint, GeometryChange, HingeAngle, Jacobian};
