//! Files of the printed parts and of what they do, as the exports ask for them.

use super::joined::{Printed, Solid};
use super::lay;
use super::report::Artefact;
use super::scene::{Moving, scene};
use super::stages::Parts;
use crate::diagnostic::Diagnostic;
use crate::emit::drawing::svg_drawing;
use crate::emit::glb::glb_bytes;
use crate::emit::outlines::dxf_bytes;
use crate::emit::picture::png_bytes;
use crate::emit::plate::{Laid, Plate};
use crate::emit::scene::Scene;
use crate::emit::sheet::print_sheet;
use crate::emit::stl::stl_bytes;
use crate::emit::threemf::threemf_bytes;
use crate::geometry::{Band, bands};
use crate::ir::assembly::AssemblyExport;
use crate::ir::{Assembly, ExportKind};
use rayon::prelude::*;

/// Pixels of a picture, and of the thumbnail in an archive of parts.
const PICTURE: (u32, u32) = (960, 720);
const THUMBNAIL: (u32, u32) = (320, 240);

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

/// A file, or why there is none with the code of that finding and what it should have been.
type Written = Result<Artefact, (&'static str, &'static str, String)>;

/// Every export of parts that is asked for, in the order of the text, each kind once; and what is to say of them.
pub fn artefacts(built: &Built<'_>) -> Parts {
    let Built { assembly, solids, moving, printed } = *built;
    let asked = |what: fn(&ExportKind) -> bool| assembly.exports.iter().any(|e| what(&e.export.kind));
    // What several files show is made before, not when first asked for: they are written on all threads.
    let shown = asked(ExportKind::of_solids).then(|| {
        rayon::join(|| scene(assembly, moving, solids, printed), || lay::plate(assembly, moving, printed))
    });
    let parts = shown.iter().flat_map(|(_, plate)| &plate.parts).collect::<Vec<_>>();
    let sections: Vec<Vec<Band>> = match asked(|kind| *kind == ExportKind::Dxf) {
        true => parts.par_iter().map(|p| bands(&p.mesh)).collect(),
        false => Vec::new(),
    };
    let first = |(k, placed): &(usize, &AssemblyExport)| {
        !assembly.exports.iter().take(*k).any(|e| e.export.kind == placed.export.kind)
    };
    let exports: Vec<_> = assembly.exports.iter().enumerate().filter(first).map(|(_, e)| &e.export).collect();
    let (mut out, mut found) = (Vec::new(), Vec::new());
    let write = |(scene, plate): &(Scene, Plate)| -> Vec<Vec<Written>> {
        let known = Known { name: &assembly.name, printed, scene, plate, sections: &sections };
        exports.par_iter().map(|e| files(&e.kind, &known)).collect()
    };
    let files = shown.as_ref().map(write).unwrap_or_default();
    for (export, written) in
        exports.iter().zip(files).flat_map(|(e, all)| all.into_iter().map(move |w| (e, w)))
    {
        match written {
            Ok(artefact) => out.push(artefact),
            Err((code, what, why)) => {
                let message = format!("no {what} can be written: {why}");
                found.push(
                    Diagnostic::error(code, message, export.origin)
                        .help("build without this export, and report what was said"),
                );
            }
        }
    }
    if !assembly.exports.iter().any(|e| e.export.kind.of_solids()) {
        for part in printed {
            match stl_bytes(&part.mesh) {
                Ok(bytes) => out.push(Artefact { name: format!("{}.stl", part.name), bytes }),
                Err(e) => {
                    found.push(Diagnostic::error("E0631", format!("no STL can be written: {e}"), part.at))
                }
            }
        }
    }
    if let Some((_, plate)) = shown.as_ref().filter(|_| asked(shows_plate)) {
        found.extend(lay::findings(assembly, plate, printed));
        if let Some(drawn) = assembly.exports.iter().find(|e| e.export.kind == ExportKind::Dxf) {
            found.extend(lay::uneven(plate, &sections, drawn.export.origin));
        }
    }
    // The report is written when all else is known.
    let reported = asked(|kind| *kind == ExportKind::Report);
    Parts { artefacts: out, diagnostics: found, shown: shown.filter(|_| reported) }
}

/// Whether a file shows parts on the bed.
fn shows_plate(kind: &ExportKind) -> bool {
    matches!(
        kind,
        ExportKind::Stl | ExportKind::ThreeMf | ExportKind::Sheet | ExportKind::Dxf | ExportKind::Report
    )
}

/// What files are written of.
struct Known<'k> {
    name: &'k str,
    printed: &'k [Printed],
    scene: &'k Scene,
    plate: &'k Plate,
    sections: &'k [Vec<Band>],
}

fn files(kind: &ExportKind, known: &Known<'_>) -> Vec<Written> {
    let Known { name, printed, scene, plate, sections } = *known;
    let file = |name: String, bytes: Result<Vec<u8>, String>, code: &'static str, what: &'static str| {
        bytes.map(|bytes| Artefact { name, bytes }).map_err(|why| (code, what, why))
    };
    let stl =
        |name: &str, mesh| file(name.to_string(), stl_bytes(mesh).map_err(|e| e.to_string()), "E0631", "STL");
    let picture = |(width, height)| png_bytes(scene, width, height);
    match kind {
        ExportKind::Stl => plate.parts.iter().map(|p| stl(&format!("{}.stl", p.name), &p.mesh)).collect(),
        ExportKind::StlAssembled => {
            printed.iter().map(|p| stl(&format!("assembled/{}.stl", p.name), &p.mesh)).collect()
        }
        ExportKind::Glb => {
            let bytes = glb_bytes(scene).map_err(|e| e.to_string());
            vec![file(format!("{name}.glb"), bytes, "E0643", "glTF")]
        }
        ExportKind::ThreeMf => {
            let bytes = picture(THUMBNAIL).and_then(|thumbnail| threemf_bytes(plate, &thumbnail));
            vec![file(format!("{name}.3mf"), bytes, "E0646", "3MF")]
        }
        ExportKind::Sheet => {
            let bytes = Ok(print_sheet(plate).into_bytes());
            vec![file(format!("{name}.print.md"), bytes, "E0646", "print sheet")]
        }
        ExportKind::Dxf => {
            let drawn = |(p, bands): (&Laid, &Vec<Band>)| {
                file(format!("{}.dxf", p.name), dxf_bytes(bands), "E0647", "DXF")
            };
            plate.parts.iter().zip(sections).map(drawn).collect()
        }
        ExportKind::Png => vec![file(format!("{name}.png"), picture(PICTURE), "E0647", "picture")],
        ExportKind::Svg => {
            let bytes = Ok(svg_drawing(scene).into_bytes());
            vec![file(format!("{name}.svg"), bytes, "E0647", "drawing")]
        }
        ExportKind::Report | ExportKind::Arduino(_) | ExportKind::Code(..) => Vec::new(),
    }
}
