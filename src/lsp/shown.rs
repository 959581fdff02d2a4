//! A finding as the protocol has it.

use super::names::Names;
use super::text::Lines;
use super::uri;
use crate::diagnostic::{Diagnostic, Origin, Severity, SourceMap};
use lsp_types::{DiagnosticRelatedInformation, DiagnosticSeverity, Location, NumberOrString};
use std::collections::BTreeMap;

/// Findings of one design; the lines of a text are counted once.
pub(super) struct Shown<'a> {
    folder: &'a str,
    sources: &'a SourceMap,
    lines: BTreeMap<u32, Lines>,
}

impl<'a> Shown<'a> {
    /// Of a design in a folder.
    pub fn new(folder: &'a str, sources: &'a SourceMap) -> Self {
        Self { folder, sources, lines: BTreeMap::new() }
    }

    fn place(&mut self, at: &Origin) -> Option<Location> {
        let file = self.sources.files.get(at.file as usize)?;
        let lines = self.lines.entry(at.file).or_insert_with(|| Lines::of(&file.text));
        let range = lines.range(&file.text, &(at.start as usize..at.end as usize));
        Some(Location::new(uri::of(&format!("{}/{}", self.folder, file.name))?, range))
    }

    /// One finding. What is in an imported file stands at the import, and leads there.
    pub fn of(&mut self, d: &Diagnostic) -> lsp_types::Diagnostic {
        let sources = self.sources;
        let primary = d.labels.first();
        let here = primary.is_none_or(|l| l.at.file == 0);
        let range = match primary {
            Some(l) if here => self.place(&l.at).map(|l| l.range).unwrap_or_default(),
            Some(l) => import(l.at.file, sources),
            None => Default::default(),
        };
        let mut message = d.message.clone();
        if let Some(file) = primary.filter(|_| !here).and_then(|l| sources.files.get(l.at.file as usize)) {
            message = format!("in `{}`: {message}", file.name);
        }
        for text in [primary.map(|l| l.text.as_str()), d.help.as_deref()].into_iter().flatten() {
            if !text.is_empty() {
                message.push_str(&format!("\n{text}"));
            }
        }
        let related: Vec<DiagnosticRelatedInformation> = d
            .labels
            .iter()
            .skip(usize::from(here))
            .filter_map(|l| {
                let message = if l.text.is_empty() { "here".into() } else { l.text.clone() };
                Some(DiagnosticRelatedInformation { location: self.place(&l.at)?, message })
            })
            .collect();
        lsp_types::Diagnostic {
            range,
            severity: Some(match d.severity {
                Severity::Error => DiagnosticSeverity::ERROR,
                Severity::Warning => DiagnosticSeverity::WARNING,
                Severity::Advice => DiagnosticSeverity::INFORMATION,
            }),
            code: Some(NumberOrString::String(d.code.clone())),
            source: Some("flexura".into()),
            message,
            related_information: (!related.is_empty()).then_some(related),
            ..Default::default()
        }
    }
}

/// The line of the root file that imports another file, or its beginning.
fn import(file: u32, sources: &SourceMap) -> lsp_types::Range {
    let (Some(root), Some(other)) = (sources.files.first(), sources.files.get(file as usize)) else {
        return Default::default();
    };
    let names = Names::of(&crate::syntax::parse(0, &root.text).tree, &root.text);
    let found = names.uses.iter().find(|u| u.file && other.name == u.target);
    found.map(|u| Lines::of(&root.text).range(&root.text, &u.at)).unwrap_or_default()
}
