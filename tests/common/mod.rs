//! Shared by the integration tests.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod annotated;
pub mod folder;
pub mod gradient;
pub mod parts;

use flexura::elaborate::{FileError, Files};
use flexura::ir::Design;
use flexura::pipeline::{Artefact, Progress};
use std::process::Command;

/// For builds whose times nobody asks for.
pub struct NoClock;

impl Progress for NoClock {
    fn seconds(&self) -> f64 {
        0.0
    }
}

/// Files of the Chebyshev example.
pub struct ExampleFiles;

impl Files for ExampleFiles {
    fn read(&self, path: &str) -> Result<String, FileError> {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/chebyshev");
        std::fs::read_to_string(folder.join(path)).map_err(|_| FileError::NotFound)
    }
}

/// Text of a file of the Chebyshev example.
pub fn example(name: &str) -> String {
    ExampleFiles.read(name).unwrap()
}

/// Header and rows of a CSV table of numbers; an empty field is not a number.
pub fn table(csv: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = csv.lines();
    let header = lines.next().unwrap().split(',').map(String::from).collect();
    let number = |field: &str| if field.is_empty() { f64::NAN } else { field.parse().unwrap() };
    (header, lines.map(|line| line.split(',').map(number).collect()).collect())
}

/// Every free variable moved from its start by up to a tenth of its bounds, inside them.
pub fn shaken(design: &Design, seed: u64) -> Vec<f64> {
    let mut s = seed;
    design
        .free
        .iter()
        .map(|f| {
            s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let r = ((s >> 11) as f64) / (1u64 << 53) as f64 - 0.5;
            let width = f.upper - f.lower;
            (f.start + 0.2 * r * width).clamp(f.lower + 0.01 * width, f.upper - 0.01 * width)
        })
        .collect()
}

/// Numbers in −1..1, the same for the same seed.
pub fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut s = seed;
    let mut next = || {
        s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        2.0 * ((s >> 11) as f64 / (1u64 << 53) as f64) - 1.0
    };
    (0..n).map(|_| next()).collect()
}

/// Whether what takes long is left out here (see `tests/extended.rs`); says so.
pub fn skipped() -> bool {
    let skip = std::env::var_os("FLEXURA_EXTENDED").is_none();
    if skip {
        eprintln!("skipped: set FLEXURA_EXTENDED=1 to run it");
    }
    skip
}

/// Asks trimesh, Manifold and CGAL about written parts (`tests/external/check_meshes.py`). Without them it says so and
/// passes, unless `FLEXURA_EXTERNAL=1` demands them; `FLEXURA_PYTHON` names the interpreter that has them.
pub fn accepted_by_others(parts: &[Artefact]) {
    let python = std::env::var("FLEXURA_PYTHON").unwrap_or_else(|_| "python3".into());
    let asked = |arguments: &[&std::ffi::OsStr]| Command::new(&python).args(arguments).output();
    let tools = asked(&["-c".as_ref(), "import trimesh, manifold3d, CGAL".as_ref()]);
    if !tools.is_ok_and(|o| o.status.success()) {
        let needs = format!("{python} needs trimesh, manifold3d and cgal");
        assert!(std::env::var_os("FLEXURA_EXTERNAL").is_none(), "FLEXURA_EXTERNAL is set: {needs}");
        eprintln!("skipped: {needs}");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/external/check_meshes.py");
    let mut arguments = vec![script.into_os_string()];
    for part in parts {
        let path = folder.path().join(&part.name);
        std::fs::write(&path, &part.bytes).unwrap();
        arguments.push(path.into_os_string());
    }
    assert!(arguments.len() > 1, "there are parts");
    let arguments: Vec<&std::ffi::OsStr> = arguments.iter().map(|a| a.as_os_str()).collect();
    let out = asked(&arguments).unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(out.status.success(), "{}{}", text(&out.stdout), text(&out.stderr));
}
