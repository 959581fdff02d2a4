//! Exporters, one file (or folder) each: plain results in, bytes out.

pub mod arduino;
pub mod code;
pub mod csv;
pub mod drawing;
pub mod glb;
pub mod lock;
pub mod motion;
mod normals;
pub mod outlines;
pub mod picture;
pub mod plate;
pub mod report;
pub mod scene;
pub mod sheet;
pub mod stl;
mod template;
pub mod threemf;
