//! The print sheet: what goes onto the machine, how it lies there, and why. As Markdown, and in words for the report.

use super::plate::{Laid, Leaf, Notch, Plate};
use crate::geometry::Posture;
use std::fmt::Write;

/// Thicknesses nearer to a whole number of lines than this part of a line count as whole.
const WHOLE: f64 = 0.05;

/// The text of the sheet: same plate, same text.
pub fn print_sheet(plate: &Plate) -> String {
    let mut out = format!("# Print sheet: {}\n\n", plate.name);
    let mut told: Vec<(&str, &str)> = Vec::new();
    for part in &plate.parts {
        let key = (part.process.name.as_str(), part.material.name.as_str());
        if !told.contains(&key) {
            told.push(key);
            process(&mut out, part);
        }
    }
    out.push_str("| part | size on the bed, mm | volume, cm³ | mass, g | fits the bed |\n| --- | --- | --- | --- | --- |\n");
    for part in &plate.parts {
        let size = part.lying.size_mm;
        let mass = part.mass_g().map_or("density not stated".into(), |m| format!("{m:.1}"));
        let fits = match part.fits() {
            Some(true) => "yes",
            Some(false) => "**no**",
            None => "bed not stated",
        };
        let volume = part.mesh.volume_mm3() / 1000.0;
        let _ = writeln!(
            out,
            "| {} | {:.1} × {:.1} × {:.1} | {volume:.2} | {mass} | {fits} |",
            part.name, size.x, size.y, size.z
        );
    }
    let [wide, deep] = plate.room_mm();
    if plate.parts.len() > 1 {
        let _ = writeln!(out, "\nSide by side they take {wide:.0} × {deep:.0} mm.");
    }
    materials(&mut out, plate);
    for part in &plate.parts {
        lies(&mut out, part);
    }
    out
}

/// What is bought besides.
fn materials(out: &mut String, plate: &Plate) {
    if plate.bought.is_empty() {
        return;
    }
    out.push_str("\n## To be bought\n\n| number | what | for |\n| --- | --- | --- |\n");
    for thing in &plate.bought {
        let _ = writeln!(out, "| {} | {} | {} |", thing.count, thing.name, thing.purpose);
    }
}

fn process(out: &mut String, part: &Laid) {
    let (p, m) = (&part.process, &part.material);
    let _ = writeln!(out, "`{}` in `{}`:\n", p.name, m.name);
    for (what, value) in settings(part) {
        let _ = writeln!(out, "- {what}: {value}");
    }
    out.push('\n');
}

/// What is to be set on the machine, or is to be known of it.
fn settings(part: &Laid) -> Vec<(&'static str, String)> {
    let (p, m) = (&part.process, &part.material);
    [
        ("layers", p.machine.layer_mm.map(|x| format!("{x} mm"))),
        ("lines", p.machine.line_mm.map(|x| format!("{x} mm wide"))),
        ("bed", p.machine.bed_mm.map(|[x, y, z]| format!("{x} × {y} × {z} mm"))),
        ("least wall", Some(format!("{} mm", p.least_wall_mm))),
        ("clearance of moving parts", Some(format!("{} mm", p.clearance_mm))),
        ("E the design counts on", Some(format!("{} MPa", m.e_mpa))),
    ]
    .into_iter()
    .filter_map(|(what, value)| Some((what, value?)))
    .collect()
}

/// Each process with its material, once: `polyjet in rigur`, and what is to be set.
pub fn machines(plate: &Plate) -> Vec<(String, Vec<(&'static str, String)>)> {
    let mut out: Vec<(String, Vec<(&'static str, String)>)> = Vec::new();
    for part in &plate.parts {
        let name = format!("{} in {}", part.process.name, part.material.name);
        if out.iter().all(|(n, _)| *n != name) {
            out.push((name, settings(part)));
        }
    }
    out
}

/// A part of the sheet in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Name.
    pub name: String,
    /// As it lies, mm.
    pub size: String,
    /// cm³.
    pub volume: String,
    /// With its unit, or that the density is not stated.
    pub mass: String,
    /// Whether it fits on the bed; none: no bed is stated.
    pub fits: Option<bool>,
    /// How it lies, and why so.
    pub lies: String,
    /// Its flexures: path, thickness, width, what they do in the layers, radius of the fillets with the stress there.
    pub flexures: Vec<[String; 5]>,
    /// What to say of fillets, where it has any.
    pub fillets: Option<&'static str>,
}

/// A part in words.
pub fn told(part: &Laid) -> Told {
    let size = part.lying.size_mm;
    let row = |(leaf, posture): (&Leaf, Posture)| {
        [leaf.path.clone(), range(leaf.thickness_mm), range(leaf.width_mm), stands(posture), notch(leaf)]
    };
    Told {
        name: part.name.clone(),
        size: format!("{:.1} × {:.1} × {:.1}", size.x, size.y, size.z),
        volume: format!("{:.2}", part.mesh.volume_mm3() / 1000.0),
        mass: part.mass_g().map_or("density not stated".into(), |m| format!("{m:.1} g")),
        fits: part.fits(),
        lies: orientation(part),
        flexures: part.postures().map(row).collect(),
        fillets: has_fillets(part).then_some(KT),
    }
}

fn has_fillets(part: &Laid) -> bool {
    part.flexures.iter().any(|f| f.fillet.is_some())
}

/// Radius of the fillets, and by what the largest stress there exceeds the flexure's own.
fn notch(leaf: &Leaf) -> String {
    match leaf.fillet {
        None => "none".into(),
        Some(Notch { radius_mm, concentration: Some(k) }) => format!("{radius_mm:.2}, Kt {k:.2}"),
        Some(Notch { radius_mm, concentration: None }) => format!("{radius_mm:.2}, Kt not known"),
    }
}

/// What Kt is, beside a table that shows it.
const KT: &str = "Kt is the stress concentration of the fillet in bending (a handbook's, for the step from the flexure to its \
                  stub): the largest stress at the root is that of the flexure, as it is reported, times Kt. Reported stresses are \
                  without it.";

/// What a flexure does in the layers.
fn stands(posture: Posture) -> String {
    match posture {
        Posture::Standing => "upright".to_string(),
        Posture::Flat => "flat".to_string(),
        Posture::Leaning(angle) => format!("leaves them by up to {:.0}°", angle.to_degrees()),
    }
}

/// How a part lies, and why so, in two sentences.
fn orientation(part: &Laid) -> String {
    let up = part.lying.up;
    let named = |v: f64| if v.abs() < 5e-4 { 0.0 } else { v };
    let how = if up.z > 0.999_999 {
        "It lies as it is drawn".to_string()
    } else {
        format!(
            "It is turned: ({:.3}, {:.3}, {:.3}) of the assembly points upwards",
            named(up.x),
            named(up.y),
            named(up.z)
        )
    };
    let (count, leaning) = (part.flexures.len(), part.lying.leaning().count());
    let why = match (count, leaning) {
        (0, _) => "it has no flexures, lies low and on its largest face".to_string(),
        (1, 0) => "so its flexure runs within the layers, and bending does not pull layers apart".to_string(),
        (n, 0) => {
            format!("so all its {n} flexures run within the layers, and bending does not pull layers apart")
        }
        (n, k) => format!(
            "no way of laying it keeps all its {n} flexures within the layers: {k} of them leave the layers, which part there first"
        ),
    };
    format!("{how}; {why}. {:.0} mm² rest on the bed.", part.lying.contact_mm2)
}

fn lies(out: &mut String, part: &Laid) {
    let _ = writeln!(out, "\n## {}\n\n{}", part.name, orientation(part));
    if part.flexures.is_empty() {
        return;
    }
    let lines = part.process.machine.line_mm;
    let fillets = has_fillets(part);
    let (mut heading, mut rule) = (String::new(), String::new());
    for (_, title) in [(lines.is_some(), " wall lines |"), (fillets, " fillet, mm |")].iter().filter(|c| c.0)
    {
        heading += title;
        rule += " --- |";
    }
    let _ = writeln!(
        out,
        "\n| flexure | thickness, mm | width, mm | in the layers |{heading}\n| --- | --- | --- | --- |{rule}"
    );
    for (leaf, posture) in part.postures() {
        let mut more = lines.map_or(String::new(), |line| format!(" {} |", wall_lines(leaf, posture, line)));
        if fillets {
            more += &format!(" {} |", notch(leaf));
        }
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} |{more}",
            leaf.path,
            range(leaf.thickness_mm),
            range(leaf.width_mm),
            stands(posture)
        );
    }
    if fillets {
        let _ = writeln!(out, "\n{KT}");
    }
}

fn range([least, most]: [f64; 2]) -> String {
    if most - least < 0.005 { format!("{most:.2}") } else { format!("{least:.2} to {most:.2}") }
}

/// How many lines make the thickness of an upright flexure, and how wide they are to be where it is no whole number.
fn wall_lines(leaf: &Leaf, posture: Posture, line_mm: f64) -> String {
    let [least, most] = leaf.thickness_mm;
    if posture != Posture::Standing || most - least >= 0.005 || line_mm <= 0.0 {
        return "—".into();
    }
    let count = (most / line_mm).round().max(1.0);
    if (most / line_mm - count).abs() < WHOLE {
        format!("{count:.0}")
    } else {
        format!("{count:.0} of {:.2} mm", most / count)
    }
}
