//! What a build tells: the numbers before and after, what was required, what was made, how long it took.

use super::aims::{DirectionMeasures, OutputMeasures};
use super::history::History;
use super::parameters::Parameter;
use super::stability::Stability;
use crate::diagnostic::{Diagnostic, SourceMap};
use crate::elaborate::OwnFile;
use crate::ir::{Assembly, Design, Solution};
use crate::lint::Stage;
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The mechanism's measures over the cycle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// By trace.
    pub traces: BTreeMap<String, TraceMeasures>,
    /// By traced direction.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub directions: BTreeMap<String, DirectionMeasures>,
    /// By output.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub outputs: BTreeMap<String, OutputMeasures>,
    /// By drive.
    pub drives: BTreeMap<String, DriveMeasures>,
    /// Of all rods.
    pub stress: StressMeasures,
    /// Between moving solids.
    pub gap: GapMeasures,
    /// With the drives released.
    pub stability: Stability,
    /// Under each load case, without gap and stability.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub cases: BTreeMap<String, Measures>,
}

/// A trace against its target: the place of the same time, or where it is tracked by form only, the nearest one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceMeasures {
    /// Mean distance (a closed cycle's last state counts once), mm.
    #[serde(deserialize_with = "or_nan")]
    pub mean_error_mm: f64,
    /// Largest distance, mm.
    #[serde(deserialize_with = "or_nan")]
    pub max_error_mm: f64,
    /// Length of the traced path, mm.
    #[serde(deserialize_with = "or_nan")]
    pub path_length_mm: f64,
}

/// A drive's load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum DriveMeasures {
    /// Of a turning drive.
    Torque {
        /// Largest size of the torque, N·mm.
        #[serde(deserialize_with = "or_nan")]
        max_torque_n_mm: f64,
    },
    /// Of a sliding drive.
    Force {
        /// Largest size of the force, N.
        #[serde(deserialize_with = "or_nan")]
        max_force_n: f64,
    },
}

impl DriveMeasures {
    /// What was measured, its size, and its unit.
    pub fn parts(self) -> (&'static str, f64, &'static str) {
        match self {
            Self::Torque { max_torque_n_mm } => ("largest torque", max_torque_n_mm, "N·mm"),
            Self::Force { max_force_n } => ("largest force", max_force_n, "N"),
        }
    }
}

/// Stress over the cycle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StressMeasures {
    /// True largest von Mises stress, MPa; none without rods.
    pub max_mpa: Option<f64>,
    /// The rod, and when.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<Place>,
}

/// Distance of the printed solids over the cycle: bodies and flexures, without what is joined by construction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapMeasures {
    /// Least distance, mm, negative where two overlap; none where there is nothing to compare.
    pub least_mm: Option<f64>,
    /// Between which two, and when.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<Place>,
}

/// Where something is at its worst.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Bodies and flexures.
    pub of: Vec<String>,
    /// Index of the state.
    pub state: usize,
}

/// Where a cycle is at its worst, with the value there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Worst {
    /// Largest von Mises stress, MPa.
    pub stress: Option<(f64, Place)>,
    /// Least gap, mm.
    pub gap: Option<(f64, Place)>,
}

impl Worst {
    /// Takes what is worse in another one.
    pub fn take(&mut self, other: &Self) {
        let worse = |own: &mut Option<(f64, Place)>, other: &Option<(f64, Place)>, sign: f64| {
            if let Some(o) = other
                && own.as_ref().is_none_or(|w| sign * o.0 > sign * w.0)
            {
                *own = Some(o.clone());
            }
        };
        worse(&mut self.stress, &other.stress, 1.0);
        worse(&mut self.gap, &other.gap, -1.0);
    }
}

impl Place {
    /// In words.
    pub fn told(&self) -> String {
        let names: Vec<String> = self.of.iter().map(|n| format!("`{n}`")).collect();
        let where_ = if names.len() > 1 { "between" } else { "in" };
        format!("{where_} {} at state {}", names.join(" and "), self.state)
    }
}

/// Wall-clock time a stage, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// The whole build.
    pub total: f64,
    /// Reading, elaboration, the conventional motion.
    pub check: f64,
    /// Optimisation and simulation.
    pub solve: f64,
    /// Solids.
    pub mesh: f64,
    /// Artefacts as bytes.
    pub emit: f64,
}

/// A `require` line and what was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RequirementResult {
    /// The line as written.
    pub text: String,
    /// Measured value; none if it could not be measured.
    pub value: Option<f64>,
    /// Unit of value and bound.
    pub unit: Cow<'static, str>,
    /// The bound.
    #[serde(deserialize_with = "or_nan")]
    pub bound: f64,
    /// Whether it holds.
    pub pass: bool,
}

/// A number that JSON has as null where it is not finite.
pub(super) fn or_nan<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// A file to write: a path relative to the output folder, with `/`, and its content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Artefact {
    /// Relative path.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// A file that stands as it would be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kept {
    /// Relative path.
    pub name: String,
    /// Its size.
    pub bytes: usize,
}

/// Where the values came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// Nothing was solved.
    #[default]
    Nothing,
    /// Solved from the design's own start.
    Start,
    /// Solved, starting from the values of an older lock.
    OldLock,
    /// Taken from the lock.
    Lock,
}

/// All that a build gives. What could not be reached stays empty; `diagnostics` says why.
#[derive(Clone, Debug, Default)]
pub struct BuildOutcome {
    /// The files read.
    pub sources: SourceMap,
    /// The design's own files as understood.
    pub files: Vec<OwnFile>,
    /// How far it came.
    pub reached: Stage,
    /// Findings of all stages, in their order.
    pub diagnostics: Vec<Diagnostic>,
    /// What is built.
    pub assembly: Option<Assembly>,
    /// Names of its variants.
    pub variants: Vec<String>,
    /// Its design, if it is one mechanism that places no others.
    pub design: Option<Design>,
    /// The solved values.
    pub solution: Option<Solution>,
    /// Where they came from.
    pub solved_from: Origin,
    /// How the optimiser came to them, one a design; empty where nothing tells of it.
    pub histories: Vec<History>,
    /// The parameters of what is built.
    pub parameters: Vec<Parameter>,
    /// Measures at the design's start.
    pub before: Option<Measures>,
    /// Measures of the result.
    pub after: Option<Measures>,
    /// Acceptance tests.
    pub requirements: Vec<RequirementResult>,
    /// Files to write.
    pub artefacts: Vec<Artefact>,
    /// Nothing has changed since the last build: there is nothing to write but perhaps a lock.
    pub unchanged: bool,
    /// Files that stand already, in place of `artefacts`.
    pub kept: Vec<Kept>,
    /// What to write after the artefacts, so that the next build can tell whether anything has changed.
    pub manifest: Option<Artefact>,
    /// Text of the lock, if it is to be written.
    pub lock: Option<String>,
    /// Times.
    pub seconds: Seconds,
}

impl BuildOutcome {
    /// Names and sizes of the files that stand in the output folder afterwards.
    pub fn made(&self) -> impl Iterator<Item = (&str, usize)> {
        let new = self.artefacts.iter().map(|a| (a.name.as_str(), a.bytes.len()));
        new.chain(self.kept.iter().map(|k| (k.name.as_str(), k.bytes)))
    }

    /// Whether the design has errors or a requirement fails.
    pub fn failed(&self) -> bool {
        self.diagnostics.iter().any(Diagnostic::is_error) || self.requirements.iter().any(|r| !r.pass)
    }
}
