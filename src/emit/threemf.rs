//! 3MF: every part as an object with its name, laid out on the bed, with units, material, metadata and a thumbnail.

use super::plate::{Laid, Plate};
use std::io::Cursor;
use threemf2::model::builder::{ModelBuilder, ObjectType, Unit};
use threemf2::package::ThreemfPackageBuilder;

/// Colour in which slicers show the material.
const COLOUR: &str = "#C8CCD4FF";
/// Coordinates are written to 1e-6 mm: near zero the lattice of the meshes, elsewhere finer than `f32`.
const DECIMALS: f64 = 1e6;

/// The bytes of a `.3mf` file: same plate, same bytes (the archive's times are those of its epoch). `thumbnail` is a PNG.
///
/// # Errors
/// What the writer says.
pub fn threemf_bytes(plate: &Plate, thumbnail: &[u8]) -> Result<Vec<u8>, String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let mut model = ModelBuilder::new(Unit::Millimeter, true);
    model
        .add_metadata("Title", Some(&plate.name))
        .add_metadata("Application", Some(concat!("flexura ", env!("CARGO_PKG_VERSION"))))
        .add_metadata("Description", Some(&description(plate)));
    model.add_build(None).map_err(|e| text(&e))?;
    let mut materials: Vec<&str> = Vec::new();
    for part in &plate.parts {
        if !materials.contains(&part.material.name.as_str()) {
            materials.push(&part.material.name);
        }
    }
    model.add_base_materials(|m| {
        for name in &materials {
            m.add_base(name, COLOUR);
        }
    });
    // Numbers of resources are unique in a file; the builder counts materials and objects apart.
    let group = plate.parts.len() as u32 + 1;
    let round = |x: f64| (x * DECIMALS).round() / DECIMALS + 0.0;
    for (part, [x, y]) in plate.parts.iter().zip(plate.places()) {
        let material = materials.iter().position(|m| *m == part.material.name).unwrap_or(0);
        let object = model
            .add_mesh_object(|o| {
                o.object_type(ObjectType::Model).name(&part.name).part_number(&part.name);
                o.pid(group).pindex(material as u32);
                for v in &part.mesh.vertices {
                    o.add_vertex(&[v.x, v.y, v.z].map(round));
                }
                o.add_triangles(&part.mesh.triangles);
                Ok(())
            })
            .map_err(|e| text(&e))?;
        let (x, y) = (round(x), round(y));
        // Rows of the matrix that is applied to columns.
        let place = [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        model
            .add_build_item_advanced(object, |item| {
                item.partnumber(&part.name).transform(&place);
            })
            .map_err(|e| text(&e))?;
    }
    let mut model = model.build().map_err(|e| text(&e))?;
    for base in &mut model.resources.basematerials {
        base.id = group;
    }
    // Plain materials belong to the core of the format; the builder demands their extension.
    model.requiredextensions = model.recommendedextensions.clone();
    let mut package = ThreemfPackageBuilder::new();
    package.set_root_model(model);
    package.add_thumbnail("/Metadata/thumbnail.png", thumbnail.to_vec()).map_err(|e| text(&e))?;
    let mut out = Cursor::new(Vec::new());
    package.build().map_err(|e| text(&e))?.write(&mut out).map_err(|e| text(&e))?;
    Ok(out.into_inner())
}

fn description(plate: &Plate) -> String {
    let mut made: Vec<String> = Vec::new();
    for Laid { process, material, .. } in &plate.parts {
        let layers = process.machine.layer_mm.map_or(String::new(), |l| format!(", layers of {l} mm"));
        let text = format!("{} in {}{layers}", process.name, material.name);
        if !made.contains(&text) {
            made.push(text);
        }
    }
    made.join("; ")
}
