//! The manifest beside the artefacts: of what they were made, and what the build told. Where everything agrees (the
//! elaborated designs with their exports and requirements, the solved values, the compiler itself, and every byte of
//! every artefact), a build has nothing to do but to tell it again.
//!
//! It is JSON, written after the artefacts. Findings are kept by the item of the design at which they point, not by
//! their place in the text: a comment moves items and changes nothing.

use super::report::{Artefact, BuildOutcome, Kept, Measures, RequirementResult};
use super::stages::Made;
use crate::diagnostic::{Diagnostic, Label, Origin, Severity};
use crate::emit::lock::{SOLVER_VERSION, digest};
use crate::ir::Assembly;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write;

/// This compiler: its version and a digest of its sources. Another one may write other bytes for the same design.
pub const COMPILER: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("FLEXURA_SOURCES"));

const ABOUT: &str = "What `flexura build` has made in this folder, and of what. While all of it agrees, nothing is \
                     made again; without this file everything is.";

/// The file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Manifest {
    about: String,
    /// Digest of the record: notices an edit.
    digest: String,
    record: Record,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Record {
    compiler: String,
    /// See [`Fingerprint`].
    design: String,
    artefacts: Vec<File>,
    before: Option<Measures>,
    after: Option<Measures>,
    requirements: Vec<RequirementResult>,
    /// Of the stages after the solver.
    findings: Vec<Finding>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct File {
    name: String,
    bytes: usize,
    digest: String,
}

/// A diagnostic without places in the text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Finding {
    code: String,
    severity: Severity,
    message: String,
    /// Number of the item in the [`Fingerprint`], and what to say there.
    labels: Vec<(usize, String)>,
    help: Option<String>,
}

/// What is built, as a digest.
#[derive(Clone, Debug, PartialEq)]
pub struct Fingerprint {
    /// Of the designs, instances, exports, requirements and values; not of comments and places.
    pub digest: String,
    /// The places of its items, each once, in the order in which they are met. Which items share a place is part of
    /// the digest, so that the numbers mean the same items in every text of this fingerprint.
    places: Vec<Origin>,
}

impl Fingerprint {
    /// Of an assembly with the values of its designs.
    pub fn of(assembly: &Assembly, values: &[Vec<f64>]) -> Self {
        let mut walk = Walk { text: format!("flexura build, solver {SOLVER_VERSION}\n"), ..Walk::default() };
        match serde_json::to_value(assembly) {
            Ok(value) => walk.value(&value),
            // Plain data always serialises; a text without a design matches no manifest.
            Err(e) => walk.text.push_str(&e.to_string()),
        }
        for value in values.iter().flatten() {
            let _ = write!(walk.text, " {value:?}");
        }
        Self { digest: digest(walk.text.as_bytes()), places: walk.places }
    }

    /// Of the same, where something else is shown as well.
    pub fn with(self, also: &str) -> Self {
        Self { digest: digest(format!("{}\n{also}", self.digest).as_bytes()), ..self }
    }
}

/// Canonical text of a design: sorted keys, numbered places.
#[derive(Default)]
struct Walk {
    text: String,
    places: Vec<Origin>,
    numbers: BTreeMap<(u32, u32, u32), usize>,
}

impl Walk {
    fn value(&mut self, value: &Value) {
        match value {
            Value::Object(fields) => {
                let sorted: BTreeMap<_, _> = fields.iter().collect();
                self.text.push('{');
                for (key, value) in sorted {
                    let _ = write!(self.text, "{key:?}:");
                    match origin(value).filter(|_| key == "origin") {
                        Some(at) => self.place(at),
                        None => self.value(value),
                    }
                    self.text.push(',');
                }
                self.text.push('}');
            }
            Value::Array(items) => {
                self.text.push('[');
                for item in items {
                    self.value(item);
                    self.text.push(',');
                }
                self.text.push(']');
            }
            plain => {
                let _ = write!(self.text, "{plain}");
            }
        }
    }

    fn place(&mut self, at: Origin) {
        let next = self.places.len();
        let number = *self.numbers.entry((at.file, at.start, at.end)).or_insert(next);
        if number == next {
            self.places.push(at);
        }
        let _ = write!(self.text, "@{number}");
    }
}

fn origin(value: &Value) -> Option<Origin> {
    let field = |key: &str| u32::try_from(value.get(key)?.as_u64()?).ok();
    Some(Origin { file: field("file")?, start: field("start")?, end: field("end")? })
}

/// The manifest's name for a source: several designs may share an output folder.
pub fn name(source: &str) -> String {
    format!("{}.manifest", source.strip_suffix(".mech").unwrap_or(source))
}

/// The manifest of a finished build whose findings after the solver are those from `told` on; none where a finding
/// points at something that is no item of the design.
pub fn write(out: &BuildOutcome, told: usize, fingerprint: &Fingerprint) -> Option<Vec<u8>> {
    let numbers: BTreeMap<(u32, u32, u32), usize> =
        fingerprint.places.iter().enumerate().map(|(i, at)| ((at.file, at.start, at.end), i)).collect();
    let label = |l: &Label| Some((*numbers.get(&(l.at.file, l.at.start, l.at.end))?, l.text.clone()));
    let finding = |d: &Diagnostic| {
        Some(Finding {
            code: d.code.clone(),
            severity: d.severity,
            message: d.message.clone(),
            labels: d.labels.iter().map(label).collect::<Option<_>>()?,
            help: d.help.clone(),
        })
    };
    let file = |a: &Artefact| File { name: a.name.clone(), bytes: a.bytes.len(), digest: digest(&a.bytes) };
    let record = Record {
        compiler: COMPILER.into(),
        design: fingerprint.digest.clone(),
        artefacts: out.artefacts.iter().map(file).collect(),
        before: out.before.clone(),
        after: out.after.clone(),
        requirements: out.requirements.clone(),
        findings: out.diagnostics.iter().skip(told).map(finding).collect::<Option<_>>()?,
    };
    let manifest = Manifest { about: ABOUT.into(), digest: record.digest()?, record };
    let mut text = serde_json::to_vec_pretty(&manifest).ok()?;
    text.push(b'\n');
    Some(text)
}

/// What a build of this fingerprint tells, if it has been made before by this compiler and everything it has made is
/// still there, byte by byte.
pub fn recall(made: &dyn Made, source: &str, fingerprint: &Fingerprint) -> Option<Recalled> {
    let manifest: Manifest = serde_json::from_slice(&made.read(&name(source))?).ok()?;
    let record = manifest.record;
    let own = record.compiler == COMPILER && record.design == fingerprint.digest;
    if !own || record.digest()? != manifest.digest {
        return None;
    }
    let label =
        |(item, text): (usize, String)| Some(Label { at: fingerprint.places.get(item).copied()?, text });
    let finding = |f: Finding| {
        Some(Diagnostic {
            code: f.code,
            severity: f.severity,
            message: f.message,
            labels: f.labels.into_iter().map(label).collect::<Option<_>>()?,
            help: f.help,
            // A repair is a place in a text, which may be another one by now.
            fixes: Vec::new(),
        })
    };
    let diagnostics = record.findings.into_iter().map(finding).collect::<Option<_>>()?;
    let stands = |f: &File| made.read(&f.name).is_some_and(|b| b.len() == f.bytes && digest(&b) == f.digest);
    record.artefacts.iter().all(stands).then(|| Recalled {
        kept: record.artefacts.into_iter().map(|f| Kept { name: f.name, bytes: f.bytes }).collect(),
        before: record.before,
        after: record.after,
        requirements: record.requirements,
        diagnostics,
    })
}

/// What a manifest tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Recalled {
    /// The files that stand.
    pub kept: Vec<Kept>,
    /// Measures at the design's start.
    pub before: Option<Measures>,
    /// Measures of the result.
    pub after: Option<Measures>,
    /// Acceptance tests.
    pub requirements: Vec<RequirementResult>,
    /// Findings after the solver, at their present places.
    pub diagnostics: Vec<Diagnostic>,
}

impl Record {
    fn digest(&self) -> Option<String> {
        Some(digest(&serde_json::to_vec(self).ok()?))
    }
}

#[cfg(test)]
#[path = "manifest_tests.rs"]
mod tests;
