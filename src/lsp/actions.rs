//! Repairs as an editor takes them: small replacements by file.

use super::edits::smallest;
use crate::diagnostic::{Diagnostic, Fix, SourceMap, apply};
use crate::elaborate::{FileError, Files, Options, SolidFile, elaborate};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Replacements by file, as the source map calls them, in order.
pub(super) type Edits = BTreeMap<String, Vec<(Range<usize>, String)>>;

/// The repairs of a finding: each with its replacements. Those that would change the standard library are none.
pub(super) fn repairs<'d>(d: &'d Diagnostic, sources: &SourceMap) -> Vec<(&'d Fix, Edits)> {
    d.fixes.iter().filter_map(|fix| Some((fix, edits(fix, sources)?))).collect()
}

fn edits(fix: &Fix, sources: &SourceMap) -> Option<Edits> {
    let mut all = Edits::new();
    for edit in &fix.edits {
        let file = sources.files.get(edit.at.file as usize).filter(|f| f.name.ends_with(".mech"))?;
        if file.name.starts_with("std/") {
            return None;
        }
        let at = edit.at.start as usize..edit.at.end as usize;
        let small = smallest(file.text.get(at.clone())?, &edit.text);
        let moved = |(r, t): (Range<usize>, String)| (at.start + r.start..at.start + r.end, t);
        all.entry(file.name.clone()).or_default().extend(small.map(moved));
    }
    all.values_mut().for_each(|e| e.sort_by_key(|(r, _)| r.start));
    all.retain(|_, e| !e.is_empty());
    (!all.is_empty()).then_some(all)
}

/// All safe repairs that do not get in each other's way, as one, and how many there are. Where together they would make
/// an error, there are none.
pub(super) fn all_safe(
    root: &str,
    files: &dyn Files,
    found: &[Diagnostic],
    sources: &SourceMap,
) -> Option<(usize, Edits)> {
    let safe: Vec<&Fix> = found
        .iter()
        .filter_map(|d| d.fixes.iter().find(|f| f.safe))
        .filter(|f| edits(f, sources).is_some())
        .collect();
    let mut all = Edits::new();
    let (mut count, mut texts) = (0, BTreeMap::new());
    for (file, new, n) in apply(sources, safe) {
        let file = sources.files.get(file as usize)?;
        count += n;
        all.insert(file.name.clone(), super::edits::difference(&file.text, &new));
        texts.insert(file.name.clone(), new);
    }
    let errors = |texts: &dyn Files| {
        let out = elaborate(root, texts, &Options::default());
        out.diagnostics.iter().filter(|d| d.is_error()).count()
    };
    let new = Overlay { below: files, new: &texts };
    (count > 0 && errors(&new) <= errors(files)).then_some((count, all))
}

/// Files, some of them changed.
pub(super) struct Overlay<'a> {
    pub below: &'a dyn Files,
    pub new: &'a BTreeMap<String, String>,
}

impl Files for Overlay<'_> {
    fn read(&self, path: &str) -> Result<String, FileError> {
        self.new.get(path).cloned().map_or_else(|| self.below.read(path), Ok)
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        self.below.solid(path)
    }
}
