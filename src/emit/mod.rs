//! Exporters, one file (or folder) each: plain results in, bytes out.

pub mod arduino;
pub mod csv;
pub mod lock;
pub mod stl;
