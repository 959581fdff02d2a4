//! Exporters, one file (or folder) each: plain results in, bytes out.

pub mod arduino;
pub mod code;
pub mod csv;
pub mod glb;
pub mod lock;
pub mod motion;
mod normals;
pub mod scene;
pub mod stl;
mod template;
