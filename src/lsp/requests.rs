//! One function a request: places to bytes, the answer's bytes to places.

use super::server::{Server, View};
use super::space::{Place, Space};
use super::text::Lines;
use super::{commands, complete, edits, hints, hover, offers, outline, signature, tokens, uri};
use lsp_server::ErrorCode;
use lsp_types::*;
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range as Bytes;
use std::sync::Arc;

type Answer = Result<Value, (ErrorCode, String)>;

/// What the server can do.
pub(super) fn capabilities() -> ServerCapabilities {
    let letters = |text: &str| Some(text.chars().map(String::from).collect::<Vec<String>>());
    ServerCapabilities {
        text_document_sync: Some(TextDocumentSyncCapability::Options(TextDocumentSyncOptions {
            open_close: Some(true),
            change: Some(TextDocumentSyncKind::INCREMENTAL),
            save: Some(TextDocumentSyncSaveOptions::Supported(true)),
            ..Default::default()
        })),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        completion_provider: Some(CompletionOptions {
            trigger_characters: letters(". {"),
            ..Default::default()
        }),
        signature_help_provider: Some(SignatureHelpOptions {
            trigger_characters: letters("(,"),
            ..Default::default()
        }),
        definition_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: Default::default(),
        })),
        document_symbol_provider: Some(OneOf::Left(true)),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        document_formatting_provider: Some(OneOf::Left(true)),
        code_action_provider: Some(CodeActionProviderCapability::Options(CodeActionOptions {
            code_action_kinds: Some(offers::KINDS.map(CodeActionKind::from).to_vec()),
            ..Default::default()
        })),
        code_lens_provider: Some(CodeLensOptions { resolve_provider: Some(false) }),
        execute_command_provider: Some(ExecuteCommandOptions {
            commands: commands::ALL.map(|(command, _)| command.to_string()).to_vec(),
            work_done_progress_options: WorkDoneProgressOptions { work_done_progress: Some(true) },
        }),
        inlay_hint_provider: Some(OneOf::Left(true)),
        semantic_tokens_provider: Some(
            SemanticTokensOptions {
                legend: SemanticTokensLegend {
                    token_types: tokens::LEGEND.iter().map(|t| SemanticTokenType::new(t)).collect(),
                    token_modifiers: Vec::new(),
                },
                full: Some(SemanticTokensFullOptions::Bool(true)),
                ..Default::default()
            }
            .into(),
        ),
        ..Default::default()
    }
}

/// Answers a request.
pub(super) fn answer(server: &mut Server, method: &str, params: Value) -> Answer {
    let params: Params = match serde_json::from_value(params.clone()) {
        Ok(params) => params,
        Err(e) => return Err((ErrorCode::InvalidParams, e.to_string())),
    };
    let path = uri::path(&params.text_document.uri);
    let view = server.view(&path);
    let here = Here { byte: params.position.map_or(0, |p| view.lines.byte(view.text(), p)), view, server };
    match method {
        "textDocument/hover" => value(here.hover()),
        "textDocument/completion" => value(here.completion()),
        "textDocument/signatureHelp" => value(here.signature()),
        "textDocument/definition" => value(here.definition()),
        "textDocument/references" => {
            value(here.references(params.context.is_none_or(|c| c.include_declaration)))
        }
        "textDocument/documentHighlight" => value(here.highlights()),
        "textDocument/prepareRename" => value(here.renamed().map(|(_, range)| here.range(&range)).ok()),
        "textDocument/rename" => value(here.rename(params.new_name.as_deref().unwrap_or(""))?),
        "textDocument/documentSymbol" => value(here.symbols()),
        "textDocument/foldingRange" => value(here.folds()),
        "textDocument/formatting" => value(here.formatting()),
        "textDocument/inlayHint" => value(here.hints(params.range)),
        "textDocument/semanticTokens/full" => value(here.tokens()),
        "textDocument/codeAction" => {
            value(here.actions(params.range.unwrap_or_default(), params.context.and_then(|c| c.only)))
        }
        "textDocument/codeLens" => value(here.lenses()),
        other => Err((ErrorCode::MethodNotFound, format!("`{other}` is not offered"))),
    }
}

/// The parts of requests that are looked at.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Params {
    text_document: TextDocumentIdentifier,
    position: Option<Position>,
    range: Option<Range>,
    new_name: Option<String>,
    context: Option<Context>,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Context {
    #[serde(default = "yes")]
    include_declaration: bool,
    only: Option<Vec<String>>,
}

fn yes() -> bool {
    true
}

fn value<T: serde::Serialize>(answer: T) -> Answer {
    serde_json::to_value(answer).map_err(|e| (ErrorCode::InternalError, e.to_string()))
}

impl View {
    pub(super) fn text(&self) -> &str {
        self.space.files.get(&self.file).map_or("", |t| t.text.as_str())
    }
}

pub(super) struct Here<'a> {
    pub server: &'a Server,
    pub view: Arc<View>,
    byte: usize,
}

impl Here<'_> {
    pub(super) fn range(&self, bytes: &Bytes<usize>) -> Range {
        self.view.lines.range(self.view.text(), bytes)
    }

    /// A place in any file of the space.
    fn location(&self, space: &Space, file: &str, bytes: &Bytes<usize>) -> Option<Location> {
        let text = &space.files.get(file)?.text;
        let path = match file.strip_prefix("std/") {
            Some(module) => self.server.texts.host.library(module)?,
            None => format!("{}/{file}", self.view.folder),
        };
        Some(Location::new(uri::of(&path)?, Lines::of(text).range(text, bytes)))
    }

    fn hover(&self) -> Option<Hover> {
        let (at, text) = hover::hover(&self.view.space, &self.view.file, self.byte, &self.view.known)?;
        let contents = HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value: text });
        Some(Hover { contents, range: Some(self.range(&at)) })
    }

    /// Files beside this one, as imports name them.
    fn beside(&self) -> Vec<String> {
        let all = self.server.texts.host.list(&self.view.folder);
        let inside = |p: &String| Some(p.strip_prefix(&self.view.folder)?.strip_prefix('/')?.to_string());
        all.iter().filter_map(inside).filter(|f| *f != self.view.file).collect()
    }

    fn completion(&self) -> Vec<CompletionItem> {
        let found = complete::complete(&self.view.space, &self.view.file, self.byte, &self.beside());
        found
            .into_iter()
            .map(|p| CompletionItem {
                kind: Some(match p.kind {
                    "keyword" => CompletionItemKind::KEYWORD,
                    "type" => CompletionItemKind::UNIT,
                    "function" => CompletionItemKind::FUNCTION,
                    "class" => CompletionItemKind::CLASS,
                    "property" | "parameter" => CompletionItemKind::PROPERTY,
                    "module" => CompletionItemKind::MODULE,
                    _ => CompletionItemKind::VARIABLE,
                }),
                detail: (!p.detail.is_empty()).then_some(p.detail),
                documentation: (!p.doc.is_empty()).then_some(Documentation::MarkupContent(MarkupContent {
                    kind: MarkupKind::Markdown,
                    value: p.doc,
                })),
                label: p.label,
                ..Default::default()
            })
            .collect()
    }

    fn signature(&self) -> Option<SignatureHelp> {
        let found = signature::signature(self.view.text(), self.byte)?;
        let label =
            |p: String| ParameterInformation { label: ParameterLabel::Simple(p), documentation: None };
        Some(SignatureHelp {
            active_signature: Some(0),
            active_parameter: Some(found.active as u32),
            signatures: vec![SignatureInformation {
                label: found.label,
                documentation: Some(Documentation::String(found.gives)),
                parameters: Some(found.parameters.into_iter().map(label).collect()),
                active_parameter: None,
            }],
        })
    }

    fn place(&self) -> Option<(Place, Bytes<usize>)> {
        self.view.space.at(&self.view.file, self.byte)
    }

    fn definition(&self) -> Option<Location> {
        let space = &self.view.space;
        if let Some((place, _)) = self.place() {
            return self.location(space, &place.0, &space.symbol(&place)?.at);
        }
        let file = space.import_at(&self.view.file, self.byte)?;
        // An import of the library leads to what it brings, a file to its beginning.
        let first = space.files.get(&file)?.names.symbols.first().filter(|_| file.starts_with("std/"));
        self.location(space, &file, &first.map_or(0..0, |s| s.at.clone()))
    }

    /// All places of a name: in this space, and in every other file of the folder that sees it.
    fn everywhere(&self, place: &Place) -> BTreeMap<String, (Arc<str>, Vec<Bytes<usize>>)> {
        let mut all: BTreeMap<String, (Arc<str>, Vec<Bytes<usize>>)> = BTreeMap::new();
        let files = super::server::Below { folder: &self.view.folder, texts: &self.server.texts };
        let others = self.beside().into_iter().map(|f| Space::read(&f, &files));
        let mut add = |space: &Space| {
            if space.symbol(place).is_none() {
                return;
            }
            for (file, bytes) in space.references(place) {
                let text = || space.files.get(&file).map_or("", |t| t.text.as_str()).into();
                let (_, known) = all.entry(file.clone()).or_insert_with(|| (text(), Vec::new()));
                if !known.contains(&bytes) {
                    known.push(bytes);
                }
            }
        };
        add(&self.view.space);
        others.for_each(|space| add(&space));
        all
    }

    fn references(&self, declaration: bool) -> Option<Vec<Location>> {
        let (place, _) = self.place()?;
        let own = self.view.space.symbol(&place)?.at.clone();
        let mut found = Vec::new();
        for (file, (text, places)) in self.everywhere(&place) {
            let path = match file.strip_prefix("std/") {
                Some(module) => self.server.texts.host.library(module),
                None => Some(format!("{}/{file}", self.view.folder)),
            };
            let lines = Lines::of(&text);
            for bytes in places.iter().filter(|b| declaration || file != place.0 || **b != own) {
                let uri = path.as_deref().and_then(uri::of);
                found.extend(uri.map(|uri| Location::new(uri, lines.range(&text, bytes))));
            }
        }
        Some(found)
    }

    fn highlights(&self) -> Option<Vec<DocumentHighlight>> {
        let (place, _) = self.place()?;
        let here = self.view.space.references(&place).into_iter().filter(|(f, _)| *f == self.view.file);
        Some(here.map(|(_, b)| DocumentHighlight { range: self.range(&b), kind: None }).collect())
    }

    /// What would be renamed here.
    fn renamed(&self) -> Result<(Place, Bytes<usize>), (ErrorCode, String)> {
        let refuse = |why: &str| (ErrorCode::RequestFailed, why.to_string());
        let (place, range) = self.place().ok_or_else(|| refuse("there is no name here"))?;
        if place.0.starts_with("std/") {
            return Err(refuse("names of the standard library stay"));
        }
        Ok((place, range))
    }

    fn rename(&self, new: &str) -> Result<WorkspaceEdit, (ErrorCode, String)> {
        let refuse = |why: String| (ErrorCode::RequestFailed, why);
        let (place, _) = self.renamed()?;
        let letters = new.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if new.is_empty() || !letters || new.starts_with(|c: char| c.is_ascii_digit()) {
            return Err(refuse(format!("`{new}` is no name: letters, digits and `_`, a letter first")));
        }
        let all = self.everywhere(&place);
        let space = &self.view.space;
        let symbol = space.symbol(&place).ok_or_else(|| refuse("there is no name here".into()))?;
        let taken = |file: &String| {
            let names = space.files.get(file).map(|t| &t.names);
            names.is_some_and(|n| {
                n.symbols.iter().any(|s| {
                    s.name == new && (s.block == symbol.block || s.block.is_none() || symbol.block.is_none())
                })
            }) || space.top(file, new).is_some()
        };
        if let Some(file) = all.keys().find(|f| taken(f)) {
            return Err(refuse(format!("`{new}` is a name in `{file}` already, and nothing hides anything")));
        }
        // The protocol's type; its keys are written in no order that anybody sees.
        #[allow(clippy::mutable_key_type)]
        let mut changes: HashMap<Uri, Vec<TextEdit>> = HashMap::new();
        for (file, (text, places)) in all {
            let lines = Lines::of(&text);
            if let Some(uri) = uri::of(&format!("{}/{file}", self.view.folder)) {
                let edit = |b: &Bytes<usize>| TextEdit::new(lines.range(&text, b), new.into());
                changes.insert(uri, places.iter().map(edit).collect());
            }
        }
        Ok(WorkspaceEdit { changes: Some(changes), ..Default::default() })
    }

    #[allow(deprecated)] // A field of the protocol's type has to be given.
    fn symbols(&self) -> Vec<DocumentSymbol> {
        let Some(text) = self.view.space.files.get(&self.view.file) else { return Vec::new() };
        let one = |s: &super::names::Symbol, inner: Vec<DocumentSymbol>| DocumentSymbol {
            name: s.name.clone(),
            detail: Some(outline::word(s.what).into()),
            kind: match outline::word(s.what) {
                "mechanism" | "flexure" => SymbolKind::CLASS,
                "material" | "process" | "motor" => SymbolKind::STRUCT,
                "field" => SymbolKind::FIELD,
                "param" => SymbolKind::PROPERTY,
                "joint" => SymbolKind::INTERFACE,
                "body" | "instance" => SymbolKind::OBJECT,
                _ => SymbolKind::VARIABLE,
            },
            tags: None,
            deprecated: None,
            range: self.range(&s.whole),
            selection_range: self.range(&s.at),
            children: (!inner.is_empty()).then_some(inner),
        };
        let entries = outline::outline(text);
        entries.iter().map(|e| one(e.symbol, e.inner.iter().map(|s| one(s, Vec::new())).collect())).collect()
    }

    fn folds(&self) -> Vec<FoldingRange> {
        let Some(text) = self.view.space.files.get(&self.view.file) else { return Vec::new() };
        let fold = |(bytes, comment): (Bytes<usize>, bool)| {
            let range = self.range(&bytes);
            FoldingRange {
                start_line: range.start.line,
                end_line: range.end.line,
                kind: comment.then_some(FoldingRangeKind::Comment),
                ..Default::default()
            }
        };
        outline::folds(text).into_iter().map(fold).collect()
    }

    fn formatting(&self) -> Vec<TextEdit> {
        let edit = |(bytes, text): (Bytes<usize>, String)| TextEdit::new(self.range(&bytes), text);
        edits::formatting(self.view.text()).into_iter().map(edit).collect()
    }

    fn hints(&self, range: Option<Range>) -> Vec<InlayHint> {
        let all = hints::hints(&self.view.space, &self.view.file, &self.view.known);
        let hint = |(byte, label): (usize, String)| InlayHint {
            position: self.view.lines.position(self.view.text(), byte),
            label: InlayHintLabel::String(label),
            kind: None,
            text_edits: None,
            tooltip: None,
            padding_left: Some(true),
            padding_right: None,
            data: None,
        };
        let inside = |h: &InlayHint| range.is_none_or(|r| r.start <= h.position && h.position <= r.end);
        all.into_iter().map(hint).filter(inside).collect()
    }

    fn tokens(&self) -> SemanticTokens {
        let mut last = Position::default();
        let text = self.view.text();
        let token = |(bytes, kind): (Bytes<usize>, usize)| {
            let at = self.view.lines.position(text, bytes.start);
            let delta_line = at.line - last.line;
            let delta_start = if delta_line == 0 { at.character - last.character } else { at.character };
            last = at;
            let length = text.get(bytes).map_or(0, |t| t.encode_utf16().count()) as u32;
            SemanticToken {
                delta_line,
                delta_start,
                length,
                token_type: kind as u32,
                token_modifiers_bitset: 0,
            }
        };
        let data = tokens::tokens(&self.view.space, &self.view.file).into_iter().map(token).collect();
        SemanticTokens { result_id: None, data }
    }
}
