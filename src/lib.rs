//! Flexura: a declarative language and compiler for compliant mechanisms.
//!
//! The way of the data, stage by stage, is described in `docs/architecture.md`;
//! the folders of this crate carry the names used there.

pub mod coupon;
pub mod diagnostic;
pub mod diff;
pub mod doc;
pub mod elaborate;
pub mod emit;
pub mod equilibrium;
pub mod geometry;
pub mod ir;
pub mod kinematics;
pub mod lint;
pub mod lsp;
pub mod math;
pub mod optimize;
pub mod pipeline;
pub mod rod;
pub mod syntax;
