//! What solving a design gives: the content of the lock file.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The solved design.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    /// Value of every free variable by path, in the unit of its `FreeVariable`.
    pub values: BTreeMap<String, f64>,
    /// Iterations the optimiser took.
    pub iterations: usize,
    /// Whether the run ended by its own stopping rule (false: interrupted, or the limit was reached).
    pub converged: bool,
}
