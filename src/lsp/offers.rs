//! What the server offers to do at a place: repairs of findings, optimised start values, and commands above the mechanism.

use super::actions::{Edits, all_safe, repairs};
use super::changes::workspace_edit;
use super::names::What;
use super::requests::Here;
use super::server::Below;
use super::shown::Shown;
use super::solver::lock_name;
use super::{apply, commands, uri};
use crate::syntax::tree::{Kind, Node};
use lsp_types::{CodeAction, CodeActionKind, CodeLens, Command, Range, WorkspaceEdit};
use std::ops::Range as Bytes;

/// All safe repairs at once, as editors ask for it on saving.
const FIX_ALL: &str = "source.fixAll.flexura";
const QUICK: &str = "quickfix";
const REWRITE: &str = "refactor.rewrite";

/// Kinds of actions.
pub(super) const KINDS: [&str; 3] = [QUICK, REWRITE, FIX_ALL];

impl Here<'_> {
    /// The path of the file.
    fn path(&self) -> String {
        format!("{}/{}", self.view.folder, self.view.file)
    }

    fn edit(&self, edits: &Edits) -> WorkspaceEdit {
        let versions = self.server.client.document_changes.then_some(&self.server.versions);
        workspace_edit(&self.view.folder, edits, &self.server.texts, versions)
    }

    /// Actions at a range; `only` picks kinds, and those below them.
    pub(super) fn actions(&self, range: Range, only: Option<Vec<String>>) -> Vec<CodeAction> {
        let wanted = |kind: &str| {
            only.as_ref().is_none_or(|o| o.iter().any(|o| kind == o || kind.starts_with(&format!("{o}."))))
        };
        // What more is known than the text tells may not have come yet.
        let known = self.server.findings.board.newest(&self.path());
        let found = known.unwrap_or_else(|| self.view.found.clone());
        let mut all = Vec::new();
        if wanted(QUICK) {
            let mut places = Shown::new(&self.view.folder, &found.sources);
            for d in &found.diagnostics {
                let mut fixes = repairs(d, &found.sources).into_iter().peekable();
                if fixes.peek().is_none() {
                    continue;
                }
                let shown = places.of(d);
                if shown.range.end < range.start || range.end < shown.range.start {
                    continue;
                }
                all.extend(fixes.enumerate().map(|(i, (fix, edits))| CodeAction {
                    title: format!("{} ({})", capital(&fix.title), d.code),
                    kind: Some(CodeActionKind::QUICKFIX),
                    diagnostics: Some(vec![shown.clone()]),
                    edit: Some(self.edit(&edits)),
                    is_preferred: Some(i == 0),
                    ..Default::default()
                }));
            }
        }
        if wanted(REWRITE) {
            all.extend(self.optimised(range));
        }
        if wanted(FIX_ALL) {
            let files = Below { folder: &self.view.folder, texts: &self.server.texts };
            let safe = all_safe(&self.view.file, &files, &found.diagnostics, &found.sources);
            all.extend(safe.map(|(count, edits)| CodeAction {
                title: if count == 1 {
                    "Make 1 safe repair".into()
                } else {
                    format!("Make {count} safe repairs")
                },
                kind: Some(CodeActionKind::new(FIX_ALL)),
                edit: Some(self.edit(&edits)),
                ..Default::default()
            }));
        }
        all
    }

    /// Where a `free` is in range that the optimiser moved: to let it start there.
    fn optimised(&self, range: Range) -> Option<CodeAction> {
        if self.view.known.solved.is_empty() {
            return None;
        }
        let text = self.view.text();
        let bytes = self.view.lines.byte(text, range.start)..self.view.lines.byte(text, range.end);
        let within = frees(&self.view.space.files.get(&self.view.file)?.tree, &bytes)?;
        let host = &self.server.texts.host;
        let lock = host.read(&self.view.folder, &lock_name(&self.view.file)).ok();
        let files = Below { folder: &self.view.folder, texts: &self.server.texts };
        let applied = apply::optimised(&self.view.file, &files, lock.as_deref(), Some(&within)).ok()?;
        let values: Vec<&str> = applied.edits.values().flatten().map(|(_, text)| text.as_str()).collect();
        let title = match values.as_slice() {
            [] => return None,
            [one] => format!("Start where it was optimised to: {one}"),
            many => format!("Start {} values where they were optimised to", many.len()),
        };
        let (kind, edit) = (Some(CodeActionKind::REFACTOR_REWRITE), Some(self.edit(&applied.edits)));
        Some(CodeAction { title, kind, edit, ..Default::default() })
    }

    /// Commands above what the file builds.
    pub(super) fn lenses(&self) -> Vec<CodeLens> {
        let Some(built) = &self.view.built else { return Vec::new() };
        let Some(text) = self.view.space.files.get(&self.view.file) else { return Vec::new() };
        let own = |s: &&super::names::Symbol| s.what == What::Mechanism && s.name == built.name;
        let (Some(symbol), Some(uri)) = (text.names.symbols.iter().find(own), uri::of(&self.path())) else {
            return Vec::new();
        };
        let range = self.range(&symbol.at);
        let found = self.server.findings.board.newest(&self.path());
        let better = found.is_some_and(|f| f.diagnostics.iter().any(|d| d.code == "W1107"));
        let own_free = self.view.known.solved.keys().any(|(file, _)| *file == self.view.file);
        let offers = [
            (true, "Build", commands::BUILD),
            (true, "Simulate", commands::SIMULATE),
            (built.report, "Show the report", commands::SHOW_REPORT),
            (own_free, "Apply the optimised values", commands::APPLY),
            (better, "Choose the better rest pose", commands::BETTER_REST),
        ];
        let argument = serde_json::to_value(uri).unwrap_or_default();
        let lens = |(_, title, command): (bool, &str, &str)| CodeLens {
            range,
            command: Some(Command::new(title.into(), command.into(), Some(vec![argument.clone()]))),
            data: None,
        };
        offers.into_iter().filter(|(offered, ..)| *offered).map(lens).collect()
    }
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map(|c| c.to_uppercase().chain(chars).collect()).unwrap_or_default()
}

/// The smallest range that holds the beginnings of all `free` expressions that touch a range; none where there are none.
fn frees(tree: &Node, at: &Bytes<usize>) -> Option<Bytes<usize>> {
    let (start, end) = (tree.start as usize, tree.end as usize);
    if end < at.start || at.end < start {
        return None;
    }
    if tree.kind == Kind::Free {
        return Some(start..start);
    }
    let inner = tree.children.iter().filter_map(|n| frees(n, at));
    inner.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
}
