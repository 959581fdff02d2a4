//! Files of the printed parts and of what they do, as the exports ask for them.

use super::joined::{Printed, Solid};
use super::report::Artefact;
use super::scene::{Moving, scene};
use crate::diagnostic::Diagnostic;
use crate::emit::glb::glb_bytes;
use crate::emit::stl::stl_bytes;
use crate::ir::{Assembly, ExportKind};
use std::cell::OnceCell;

/// A built assembly: designs in solids and in motion, and its parts.
pub struct Built<'a> {
    /// What is built.
    pub assembly: &'a Assembly,
    /// One a design.
    pub solids: &'a [Solid],
    /// One a design.
    pub moving: &'a [Moving],
    /// The printed parts.
    pub printed: &'a [Printed],
}

/// Every export of parts that is asked for, in the order of the text, each kind once; and what could not be written.
pub fn artefacts(built: &Built<'_>) -> (Vec<Artefact>, Vec<Diagnostic>) {
    let (mut out, mut found) = (Vec::new(), Vec::new());
    let name = &built.assembly.name;
    let shown = OnceCell::new();
    let scene = || shown.get_or_init(|| scene(built.assembly, built.moving, built.solids, built.printed));
    for (k, placed) in built.assembly.exports.iter().enumerate() {
        let (kind, at) = (&placed.export.kind, placed.export.origin);
        if built.assembly.exports.iter().take(k).any(|e| e.export.kind == *kind) {
            continue;
        }
        let mut keep = |name: String, bytes: Result<Vec<u8>, String>, (code, what): (&str, &str)| match bytes
        {
            Ok(bytes) => out.push(Artefact { name, bytes }),
            Err(e) => found.push(Diagnostic::error(code, format!("no {what} can be written: {e}"), at)),
        };
        match kind {
            ExportKind::Stl | ExportKind::StlAssembled => {
                for part in built.printed {
                    let bytes = stl_bytes(&part.mesh).map_err(|e| e.to_string());
                    keep(format!("{}.stl", part.name), bytes, ("E0631", "STL"));
                }
            }
            ExportKind::Glb => {
                let bytes = glb_bytes(scene()).map_err(|e| e.to_string());
                keep(format!("{name}.glb"), bytes, ("E0643", "glTF"));
            }
            ExportKind::Arduino(_) | ExportKind::Code(..) => {}
        }
    }
    (out, found)
}
