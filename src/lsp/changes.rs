//! Replacements as the protocol has them, for the texts they were worked out of and no others.

use super::actions::Edits;
use super::server::{Below, Texts};
use super::text::Lines;
use super::uri;
use crate::elaborate::Files;
use lsp_types::{
    DocumentChanges, OneOf, OptionalVersionedTextDocumentIdentifier, TextDocumentEdit, TextEdit, Uri,
    WorkspaceEdit,
};
use std::collections::{BTreeMap, HashMap};

/// Replacements below a folder. An editor that can is told the versions, so that a change of a text that has moved on
/// meanwhile is refused by it.
pub(super) fn workspace_edit(
    folder: &str,
    edits: &Edits,
    texts: &Texts,
    versions: Option<&BTreeMap<String, i32>>,
) -> WorkspaceEdit {
    let files = Below { folder, texts };
    let mut all: Vec<(Uri, Option<i32>, Vec<TextEdit>)> = Vec::new();
    for (file, edits) in edits {
        let path = format!("{folder}/{file}");
        let (Ok(text), Some(uri)) = (files.read(file), uri::of(&path)) else { continue };
        let lines = Lines::of(&text);
        let edits =
            edits.iter().map(|(at, new)| TextEdit::new(lines.range(&text, at), new.clone())).collect();
        all.push((uri, versions.and_then(|v| v.get(&path).copied()), edits));
    }
    if versions.is_some() {
        let change = |(uri, version, edits): (Uri, Option<i32>, Vec<TextEdit>)| TextDocumentEdit {
            text_document: OptionalVersionedTextDocumentIdentifier { uri, version },
            edits: edits.into_iter().map(OneOf::Left).collect(),
        };
        let changes = DocumentChanges::Edits(all.into_iter().map(change).collect());
        return WorkspaceEdit { document_changes: Some(changes), ..Default::default() };
    }
    // The protocol's type; its keys are written in no order that anybody sees.
    #[allow(clippy::mutable_key_type)]
    let changes: HashMap<Uri, Vec<TextEdit>> = all.into_iter().map(|(uri, _, edits)| (uri, edits)).collect();
    WorkspaceEdit { changes: Some(changes), ..Default::default() }
}
