//! `flexura coupon`: a test piece to print, and the stiffness that its readings give.

use super::artefacts::{WriteError, write_below};
use super::commands::{FAILED, print};
use super::doc::nearest;
use super::render;
use super::sources::read_text;
use clap::Args;
use flexura::coupon::{BEAMS, Coupon, Fit, fit, readings_to_enter, sheet};
use flexura::diagnostic::{Diagnostic, Severity, SourceMap};
use flexura::elaborate::std_modules;
use flexura::pipeline::{self, Compiler, Request, placeless};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

#[derive(Debug, Args)]
pub struct Arguments {
    /// A material of the library (`flexura doc materials`)
    material: String,
    /// The process it is printed by (`flexura doc processes`)
    #[arg(long, value_name = "PROCESS", default_value = "fdm")]
    on: String,
    /// Folder for the piece, its sheet and the table of readings
    #[arg(long, value_name = "FOLDER", default_value = "coupon")]
    out: PathBuf,
    /// Readings that have been entered: print the E they give
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    measured: Option<PathBuf>,
}

/// Where readings are entered.
const READINGS: &str = "measured.csv";

/// Runs it.
pub fn run(arguments: &Arguments) -> u8 {
    let mut sources = SourceMap::default();
    match carry_out(arguments, &mut sources) {
        Ok((text, found)) => {
            render::show(&found, &sources);
            print(&text)
        }
        Err(found) => {
            render::show(&found, &sources);
            FAILED
        }
    }
}

/// What goes to the standard output, and findings; or errors.
type Said = Result<(String, Vec<Diagnostic>), Vec<Diagnostic>>;

fn carry_out(arguments: &Arguments, sources: &mut SourceMap) -> Said {
    let (material, process) = (&arguments.material, &arguments.on);
    known("material", "materials", material)?;
    known("process", "processes", process)?;
    let coupon = Coupon::new(material, process)?;
    match &arguments.measured {
        Some(path) => {
            let failed = |e: String| vec![placeless(Severity::Error, "E0730", e)];
            let text =
                read_text(path).map_err(|e| failed(format!("cannot read `{}`: {e}", path.display())))?;
            let file = sources.add(path.display().to_string(), &text);
            let found = fit(&coupon, file, &text)?;
            Ok((told(&coupon, &found), found.warnings))
        }
        None => make(&coupon, &arguments.out),
    }
}

/// That the library has it.
fn known(kind: &str, folder: &str, name: &str) -> Result<(), Vec<Diagnostic>> {
    let all: Vec<String> = std_modules()
        .iter()
        .filter_map(|m| m.strip_prefix(&format!("{folder}.")))
        .map(String::from)
        .collect();
    if all.iter().any(|n| n == name) {
        return Ok(());
    }
    let wrong = placeless(Severity::Error, "E0770", format!("the library has no {kind} `{name}`"));
    let help = match nearest(name, all.iter().cloned()) {
        Some(near) => format!("did you mean `{near}`? There are {}", all.join(", ")),
        None => format!("there are {}", all.join(", ")),
    };
    Err(vec![wrong.help(help)])
}

/// Builds the piece. Readings that have been entered already are kept.
fn make(coupon: &Coupon, folder: &Path) -> Said {
    let files = BTreeMap::from([("coupon.mech".to_string(), coupon.text.clone())]);
    let request = Request { source: "coupon.mech".into(), ..Request::default() };
    let never = AtomicBool::new(false);
    let out = pipeline::build(&request, &Compiler::default(), &files, &super::progress::Silent, &never);
    if out.diagnostics.iter().any(Diagnostic::is_error) {
        return Err(out.diagnostics);
    }
    let failed = |e: WriteError| vec![placeless(Severity::Error, "E0731", e.to_string())];
    let mut text = String::new();
    let mut write = |name: &str, bytes: &[u8]| -> Result<(), Vec<Diagnostic>> {
        let path = write_below(folder, name, bytes).map_err(failed)?;
        text.push_str(&format!("{}\n", path.display()));
        Ok(())
    };
    write("coupon.mech", coupon.text.as_bytes())?;
    for artefact in &out.artefacts {
        write(&artefact.name, &artefact.bytes)?;
    }
    write("README.md", sheet(coupon).as_bytes())?;
    let readings = folder.join(READINGS);
    if readings.symlink_metadata().is_err() {
        write(READINGS, readings_to_enter(coupon).as_bytes())?;
    }
    text.push_str(&format!(
        "\nREADME.md says how to measure. Enter the drops in {0}, then\nflexura coupon {1} --on {2} --measured {0}\n",
        readings.display(),
        coupon.material,
        coupon.process
    ));
    Ok((text, Vec::new()))
}

/// What the readings give.
fn told(coupon: &Coupon, found: &Fit) -> String {
    let mut text = String::from("beam    thickness   weight     drop        E\n");
    for (r, e) in &found.readings {
        text.push_str(&format!(
            "{:<7} {:>6.2} mm {:>6} g {:>5.2} mm {:>5.0} MPa\n",
            BEAMS.get(r.beam).unwrap_or(&""),
            r.size_mm[0],
            r.grams,
            r.drop_mm,
            e
        ));
    }
    text.push_str(&format!(
        "\nE = {:.0} MPa, {} readings within {:.0} %; the library has {:.0} MPa. In a material of your own:\n\n    E = {:.0} MPa\n",
        found.e_mpa,
        found.readings.len(),
        100.0 * found.spread,
        coupon.e_mpa,
        found.e_mpa
    ));
    text
}
