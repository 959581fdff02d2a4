//! (being written)

pub mod stl;
