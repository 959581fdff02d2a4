//! Exporters, one file (or folder) each: plain results in, bytes out.

pub mod arduino;
pub mod csv;
pub mod glb;
pub mod lock;
mod normals;
pub mod scene;
pub mod stl;
