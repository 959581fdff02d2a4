//! DXF: what a laser or a mill cuts. The outlines of a part as it lies, one layer of the file for each range of heights in
//! which its section is one; lengths in mm.

use crate::geometry::Band;
use chrono::{DateTime, Local, NaiveDate};
use dxf::entities::{Entity, EntityType, LwPolyline};
use dxf::enums::{AcadVersion, Units};
use dxf::tables::Layer;
use dxf::{Color, Drawing, LwPolylineVertex};

/// Colours of the layers in turn, of the format's own: red, blue, green, magenta, cyan.
const COLOURS: [u8; 5] = [1, 5, 3, 6, 4];

/// A drawing of a part's bands: same bands, same bytes.
///
/// # Errors
/// What the writer says; memory takes all it writes.
pub fn dxf_bytes(bands: &[Band]) -> Result<Vec<u8>, String> {
    let mut drawing = Drawing::new();
    // Times and identifiers would differ from build to build; the first version with closed polylines of one piece.
    let header = &mut drawing.header;
    header.version = AcadVersion::R2000;
    header.default_drawing_units = Units::Millimeters;
    let made = midnight();
    (header.creation_date, header.update_date) = (made, made);
    header.creation_date_universal = Default::default();
    header.update_date_universal = Default::default();
    header.fingerprint_guid = Default::default();
    header.version_guid = Default::default();
    for (band, colour) in bands.iter().zip(COLOURS.into_iter().cycle()) {
        let name = layer_name(band);
        drawing.add_layer(Layer { name: name.clone(), color: Color::from_index(colour), ..Layer::default() });
        for outline in &band.outlines {
            let vertices =
                outline.iter().map(|[x, y]| LwPolylineVertex { x: *x, y: *y, ..Default::default() });
            let mut line = LwPolyline { vertices: vertices.collect(), ..LwPolyline::default() };
            line.set_is_closed(true);
            let mut entity = Entity::new(EntityType::LwPolyline(line));
            entity.common.layer.clone_from(&name);
            drawing.add_entity(entity);
        }
    }
    let mut out = Vec::new();
    drawing.save(&mut out).map_err(|e| e.to_string())?;
    Ok(out)
}

/// `z 2.5 to 7.5 mm`.
pub fn layer_name(band: &Band) -> String {
    let short = |x: f64| format!("{}", (x * 1e3).round() / 1e3);
    format!("z {} to {} mm", short(band.z_mm[0]), short(band.z_mm[1]))
}

/// The same clock time everywhere.
fn midnight() -> DateTime<Local> {
    let day = NaiveDate::from_ymd_opt(2000, 1, 1).unwrap_or_default();
    day.and_time(chrono::NaiveTime::MIN).and_local_timezone(Local).earliest().unwrap_or_default()
}
