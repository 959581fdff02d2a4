//! What only the later stages can find, as annotated designs: shapes, equilibria, solids, gaps.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use flexura::diagnostic::Diagnostic;
use flexura::pipeline::{Compiler, Stages};
use std::collections::BTreeMap;

/// Everything that is said of a design at its start, unsolved: kinematics, one iteration of the optimiser, solids.
fn findings(text: &str) -> Vec<Diagnostic> {
    let files: BTreeMap<String, String> = [("main.mech".to_string(), text.to_string())].into();
    let compiler = Compiler { iterations: 1, ..Compiler::default() };
    let checked = compiler.check("main.mech", &[], Some(12), None, &files);
    let mut found = checked.diagnostics;
    let Some(design) = checked.assembly.as_ref().and_then(|a| a.single()).cloned() else { return found };
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    match compiler.simulate(&design, &start) {
        Ok(simulation) => found.extend(simulation.diagnostics),
        Err(why) => {
            found.extend(why);
            return found;
        }
    }
    let never = std::sync::atomic::AtomicBool::new(false);
    match compiler.optimize(&design, &start, &|_| {}, &never) {
        Ok(solved) => found.extend(solved.diagnostics),
        Err(why) => found.extend(why),
    }
    match compiler.mesh(&design, &start) {
        Ok((_, said)) => found.extend(said),
        Err(why) => found.extend(why),
    }
    found
}

#[test]
fn findings_of_later_stages_point_at_their_lines() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/findings");
    common::annotated::check_folder(std::path::Path::new(folder), |_, text| findings(text));
}
