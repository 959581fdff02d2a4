//! The text front end: text to tree to AST, recovery, diagnostics and how they are shown.

// Tests fail by panicking.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
#[path = "syntax/read.rs"]
mod read;
#[path = "syntax/render.rs"]
mod render;
#[path = "syntax/robust.rs"]
mod robust;

use std::path::Path;

/// The sample designs.
pub const CHEBYSHEV: &str = include_str!("syntax/samples/chebyshev.mech");
/// A template.
pub const CROSSED_LEAVES: &str = include_str!("syntax/samples/crossed_leaves.mech");

#[test]
fn every_mistake_is_told_at_its_own_place() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/syntax/errors");
    common::annotated::check_folder(&folder, |_, text| flexura::syntax::parse(0, text).diagnostics);
}

/// Compares with `tests/syntax/snapshots/NAME.snap`.
fn snapshot(name: &str, text: String) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("syntax/snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(name, text));
}
