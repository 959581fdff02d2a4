//! Baselines: findings of an old design that are known, so that only new ones are told. A finding is known again by its
//! code, its file, the block around it and the text it points at, not by its line or by numbers in its message: what
//! moves stays known, and what is changed is told anew.

use crate::diagnostic::{Diagnostic, Origin, SourceMap};
use crate::elaborate::OwnFile;
use crate::syntax::ast::Item;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

const ABOUT: &str =
    "Findings that are known, written by `flexura check --write-baseline`. They are not told again.";

/// Findings that are known, each with how often it is there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Baseline(BTreeMap<Key, usize>);

/// What a finding is known by.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Key {
    code: String,
    /// Path below the design's folder.
    file: String,
    /// Name of the mechanism or flexure around it; empty outside of one.
    block: String,
    /// The text it points at, white space squeezed.
    text: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    about: String,
    findings: Vec<Known>,
}

#[derive(Serialize, Deserialize)]
struct Known {
    #[serde(flatten)]
    key: Key,
    count: usize,
}

/// What of a baseline has not been met yet.
pub(super) struct Remaining(BTreeMap<Key, usize>);

impl Remaining {
    /// Whether a finding is known; each entry counts as often as it was there.
    pub fn takes(&mut self, d: &Diagnostic, sources: &SourceMap, files: &[OwnFile]) -> bool {
        let left = key(d, sources, files).and_then(|k| self.0.get_mut(&k)).filter(|n| **n > 0);
        left.is_some_and(|n| {
            *n -= 1;
            true
        })
    }
}

impl Baseline {
    /// The baseline of these findings; errors are none of it.
    pub fn of(found: &[Diagnostic], sources: &SourceMap, files: &[OwnFile]) -> Self {
        let mut known = BTreeMap::new();
        // What is denied is no error of its own.
        let own = found.iter().filter(|d| !d.code.starts_with('E'));
        for key in own.filter_map(|d| key(d, sources, files)) {
            *known.entry(key).or_default() += 1;
        }
        Self(known)
    }

    /// How many findings it knows.
    pub fn count(&self) -> usize {
        self.0.values().sum()
    }

    pub(super) fn remaining(&self) -> Remaining {
        Remaining(self.0.clone())
    }

    /// Its file: sorted, one entry a finding.
    ///
    /// # Errors
    /// What serde_json reports; for these types that does not happen.
    pub fn write(&self) -> Result<String, serde_json::Error> {
        let findings = self.0.iter().map(|(key, count)| Known { key: key.clone(), count: *count }).collect();
        let mut text = serde_json::to_string_pretty(&File { about: ABOUT.into(), findings })?;
        text.push('\n');
        Ok(text)
    }

    /// Reads a file; `file` is its index in the source map.
    ///
    /// # Errors
    /// E0742 at the place where it is no baseline.
    pub fn parse(text: &str, file: u32) -> Result<Self, Vec<Diagnostic>> {
        let read: File = serde_json::from_str(text).map_err(|e| {
            let line =
                text.split_inclusive('\n').take(e.line().saturating_sub(1)).map(str::len).sum::<usize>();
            let start = (line + e.column().saturating_sub(1)).min(text.len()) as u32;
            let at = Origin { file, start, end: start };
            let message = format!("this is no baseline: {e}");
            vec![
                Diagnostic::error("E0742", message, at)
                    .help("write it anew with `flexura check --write-baseline FILE`"),
            ]
        })?;
        Ok(Self(read.findings.into_iter().map(|k| (k.key, k.count)).collect()))
    }
}

fn key(d: &Diagnostic, sources: &SourceMap, files: &[OwnFile]) -> Option<Key> {
    let at = d.labels.first()?.at;
    let source = sources.files.get(at.file as usize)?;
    let own = files.iter().find(|f| f.id == at.file);
    let around = |item: &&Item| {
        let place = item_place(item);
        place.start <= at.start && at.end <= place.end
    };
    let block = own.and_then(|f| f.ast.items.iter().find(around)).map_or("", item_name);
    // A finding at a whole block is known by the block's name: its text changes with everything in it.
    let whole = own.is_some_and(|f| f.ast.items.iter().any(|i| item_place(i) == at));
    let text = if whole { "" } else { source.text.get(at.start as usize..at.end as usize).unwrap_or("") };
    Some(Key {
        code: d.code.clone(),
        file: own.map_or_else(|| source.name.clone(), |f| f.path.clone()),
        block: block.into(),
        text: text.split_whitespace().collect::<Vec<_>>().join(" "),
    })
}

fn item_place(item: &Item) -> Origin {
    match item {
        Item::Mechanism(m) => m.at,
        Item::Flexure(f) => f.at,
        Item::Record(r) => r.at,
    }
}

fn item_name(item: &Item) -> &str {
    match item {
        Item::Mechanism(m) => &m.name.node,
        Item::Flexure(f) => &f.name.node,
        Item::Record(r) => &r.name.node,
    }
}
