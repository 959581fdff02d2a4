//! The six mechanisms of the examples, from disk.

#[path = "../../tests/common/folder.rs"]
mod folder;

use flexura::elaborate::{Options, elaborate};
use flexura::emit::lock::Lock;
use flexura::equilibrium::Layout;
use flexura::ir::{Assembly, Design};
use flexura::kinematics::solve_motion;
use folder::Folder;
use std::collections::BTreeMap;
use std::path::PathBuf;

pub const NAMES: [&str; 6] = ["chebyshev", "jansen", "car", "dragon", "eye", "hand"];
/// Those and Chebyshev's linkage with every term of the paper: what is optimised.
pub const OPTIMISED: [&str; 7] =
    ["chebyshev", "chebyshev_all_terms", "jansen", "car", "dragon", "eye", "hand"];

/// An example as it is written.
pub fn example(name: &str) -> Assembly {
    let folder = name.split('_').next().unwrap_or(name);
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples").join(folder);
    let out = elaborate(&format!("{name}.mech"), &Folder(folder), &Options::default());
    out.assembly.unwrap_or_else(|| panic!("{name}: {:?}", out.diagnostics))
}

/// A text as a design.
pub fn design(name: &str, text: String) -> Design {
    let files = BTreeMap::from([(name.to_string(), text)]);
    let out = elaborate(name, &files, &Options::default());
    out.design.unwrap_or_else(|| panic!("{name}: {:?}", out.diagnostics.first()))
}

/// The solved values of each design of an example, as its lock has them.
pub fn solved(name: &str, assembly: &Assembly) -> Vec<Vec<f64>> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("examples/{name}/{name}.lock"));
    let lock =
        std::fs::read_to_string(path).ok().and_then(|text| Lock::parse(&text, 0).ok()).unwrap_or_default();
    let several = assembly.designs.len() > 1;
    let own = |d: &Design| if several { lock.part(&d.name).start_values(d) } else { lock.start_values(d) };
    assembly.designs.iter().map(own).collect()
}

pub fn starts(design: &Design) -> Vec<f64> {
    design.free.iter().map(|f| f.start).collect()
}

pub fn layout(design: &Design) -> Layout {
    let start = starts(design);
    Layout::new(design, &solve_motion(design, &start).expect("it can be assembled"), &start)
}
