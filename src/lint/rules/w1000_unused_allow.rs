//! ## What it finds
//!
//! An `allow` that silences nothing: what it was for is gone, stands elsewhere, or never was.
//!
//! ## Why it matters
//!
//! An `allow` tells the next reader that somebody looked at a finding and accepted it. One that is left over hides the
//! finding when it comes back for another reason. An `allow` of what only a build looks for is judged by a build.
//!
//! ## Example
//!
//! ```text
//! allow W1001 "drawn for the next version"    // but there is no point that nothing uses
//! ```
//!
//! ## Fix
//!
//! `--fix` removes the line. That is safe: it silences nothing.
use crate::lint::prelude::*;

/// See the module.
pub const RULE: Rule =
    Rule { code: "W1000", name: "unused-allow", severity: Severity::Warning, check: Check::Findings };
