//! The requests of the protocol.

use super::documents::{Documents, source};
use super::edits;
use super::positions::address;
use super::tokens::tokens;
use crate::editor::{Analysis, BindingKind, Candidate, CandidateKind};
use lsp_types::request::*;
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionParams, CompletionTextEdit,
    DocumentFormattingParams, DocumentHighlight, DocumentHighlightParams, DocumentSymbol,
    DocumentSymbolParams, Documentation, GotoDefinitionParams, Hover, HoverContents, HoverParams,
    InlayHint, InlayHintLabel, InlayHintParams, Location, MarkupContent, MarkupKind,
    ParameterInformation, ParameterLabel, ReferenceParams, RenameParams, SemanticTokensParams,
    SignatureHelp, SignatureHelpParams, SignatureInformation, SymbolKind,
    TextDocumentPositionParams, TextEdit, Uri,
};
use pcadlang_syntax::diag::{FileId, Span};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

type Answer<T> = Result<T, String>;

/// Answers a request; `None` if its method is not known.
///
/// # Errors
/// If the parameters are not those of the method, or it cannot be done.
pub fn handle(documents: &mut Documents, method: &str, params: Value) -> Answer<Option<Value>> {
    match method {
        HoverRequest::METHOD => with(documents, params, hover),
        Completion::METHOD => with(documents, params, completion),
        SignatureHelpRequest::METHOD => with(documents, params, signature),
        GotoDefinition::METHOD => with(documents, params, definition),
        References::METHOD => with(documents, params, references),
        DocumentHighlightRequest::METHOD => with(documents, params, highlights),
        PrepareRenameRequest::METHOD => {
            with(documents, params, |d, p: TextDocumentPositionParams| {
                let encoding = d.encoding;
                edits::prepare_rename(d.get(&p.text_document.uri)?, p.position, encoding)
            })
        }
        Rename::METHOD => with(documents, params, |d, p: RenameParams| {
            let (at, encoding) = (p.text_document_position, d.encoding);
            edits::rename(d.get(&at.text_document.uri)?, at.position, &p.new_name, encoding)
        }),
        Formatting::METHOD => with(documents, params, |d, p: DocumentFormattingParams| {
            let encoding = d.encoding;
            Ok(edits::formatted(d.get(&p.text_document.uri)?, encoding))
        }),
        DocumentSymbolRequest::METHOD => with(documents, params, symbols),
        SemanticTokensFullRequest::METHOD => {
            with(documents, params, |d, p: SemanticTokensParams| {
                let encoding = d.encoding;
                Ok(tokens(d.get(&p.text_document.uri)?.analysis(), encoding))
            })
        }
        InlayHintRequest::METHOD => with(documents, params, hints),
        _ => Ok(None),
    }
}

fn with<P: DeserializeOwned, R: Serialize>(
    documents: &mut Documents,
    params: Value,
    work: impl FnOnce(&mut Documents, P) -> Answer<R>,
) -> Answer<Option<Value>> {
    let params = serde_json::from_value(params).map_err(|e| e.to_string())?;
    let result = work(documents, params)?;
    serde_json::to_value(result).map(Some).map_err(|e| e.to_string())
}

fn hover(documents: &mut Documents, p: HoverParams) -> Answer<Option<Hover>> {
    let (encoding, at) = (documents.encoding, p.text_document_position_params);
    let analysis = documents.get(&at.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(None) };
    Ok(analysis.hover(encoding.byte(file, at.position)).map(|(span, value)| Hover {
        contents: HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value }),
        range: Some(encoding.range(file, span)),
    }))
}

fn completion(documents: &mut Documents, p: CompletionParams) -> Answer<Vec<CompletionItem>> {
    let (encoding, at) = (documents.encoding, p.text_document_position);
    let document = documents.get(&at.text_document.uri)?;
    let folder = document.folder();
    let analysis = document.analysis();
    let Some(file) = source(analysis) else { return Ok(Vec::new()) };
    let byte = encoding.byte(file, at.position);
    let (start, found) = analysis.complete(byte as usize, &folder);
    let range = encoding.range(file, Span::new(FileId(0), start, byte as usize));
    let item = |(i, c): (usize, Candidate)| CompletionItem {
        sort_text: Some(format!("{i:05}")),
        kind: Some(item_kind(c.kind)),
        detail: Some(c.detail).filter(|d| !d.is_empty()),
        text_edit: Some(CompletionTextEdit::Edit(TextEdit { range, new_text: c.word.clone() })),
        filter_text: Some(c.word.clone()),
        label: c.word,
        ..CompletionItem::default()
    };
    Ok(found.into_iter().enumerate().map(item).collect())
}

fn signature(documents: &mut Documents, p: SignatureHelpParams) -> Answer<Option<SignatureHelp>> {
    let (encoding, at) = (documents.encoding, p.text_document_position_params);
    let analysis = documents.get(&at.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(None) };
    let found = analysis.signature(encoding.byte(file, at.position) as usize);
    let argument = |(label, doc): ([u32; 2], String)| ParameterInformation {
        label: ParameterLabel::LabelOffsets(label),
        documentation: (!doc.is_empty()).then_some(Documentation::String(doc)),
    };
    Ok(found.map(|s| SignatureHelp {
        active_signature: Some(0),
        active_parameter: None,
        signatures: vec![SignatureInformation {
            label: s.label,
            documentation: (!s.doc.is_empty()).then_some(Documentation::String(s.doc)),
            // Beyond the arguments, none is marked.
            active_parameter: Some(s.active.unwrap_or(s.arguments.len()) as u32),
            parameters: Some(s.arguments.into_iter().map(argument).collect()),
        }],
    }))
}

fn item_kind(kind: CandidateKind) -> CompletionItemKind {
    match kind {
        CandidateKind::Bound(BindingKind::Function) | CandidateKind::Function => {
            CompletionItemKind::FUNCTION
        }
        CandidateKind::Bound(BindingKind::Kernel | BindingKind::Plan) | CandidateKind::Kernel => {
            CompletionItemKind::METHOD
        }
        CandidateKind::Bound(BindingKind::Namespace) => CompletionItemKind::MODULE,
        CandidateKind::Bound(_) => CompletionItemKind::VARIABLE,
        CandidateKind::Constant => CompletionItemKind::CONSTANT,
        CandidateKind::Argument => CompletionItemKind::FIELD,
        CandidateKind::Keyword => CompletionItemKind::KEYWORD,
        CandidateKind::Tag | CandidateKind::Address => CompletionItemKind::REFERENCE,
        CandidateKind::File => CompletionItemKind::FILE,
    }
}

/// Returns a place in a file of the program; `None` in a shipped one, which is not on the
/// disk.
fn location(
    analysis: &Analysis,
    documents: (&Uri, super::Encoding),
    span: Span,
) -> Option<Location> {
    let (own, encoding) = documents;
    let file = analysis.sources.get(span.file)?;
    Some(Location { uri: address(analysis, own, span.file)?, range: encoding.range(file, span) })
}

fn definition(documents: &mut Documents, p: GotoDefinitionParams) -> Answer<Option<Location>> {
    let (encoding, at) = (documents.encoding, p.text_document_position_params);
    let analysis = documents.get(&at.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(None) };
    let found = analysis.definition(encoding.byte(file, at.position));
    Ok(found.and_then(|span| location(analysis, (&at.text_document.uri, encoding), span)))
}

fn references(documents: &mut Documents, p: ReferenceParams) -> Answer<Vec<Location>> {
    let (encoding, at) = (documents.encoding, p.text_document_position);
    let analysis = documents.get(&at.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(Vec::new()) };
    let byte = encoding.byte(file, at.position);
    let bound = analysis.definition(byte);
    let all = analysis.references(byte).into_iter();
    let all = all.filter(|s| p.context.include_declaration || Some(*s) != bound);
    let uri = &at.text_document.uri;
    Ok(all.filter_map(|span| location(analysis, (uri, encoding), span)).collect())
}

fn highlights(
    documents: &mut Documents,
    p: DocumentHighlightParams,
) -> Answer<Vec<DocumentHighlight>> {
    let (encoding, at) = (documents.encoding, p.text_document_position_params);
    let analysis = documents.get(&at.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(Vec::new()) };
    let all = analysis.references(encoding.byte(file, at.position)).into_iter();
    let here = all.filter(|span| span.file == FileId(0));
    Ok(here.map(|s| DocumentHighlight { range: encoding.range(file, s), kind: None }).collect())
}

fn symbols(documents: &mut Documents, p: DocumentSymbolParams) -> Answer<Vec<DocumentSymbol>> {
    let encoding = documents.encoding;
    let analysis = documents.get(&p.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(Vec::new()) };
    let symbol = |b: &crate::editor::Binding| {
        let kind = match b.kind {
            BindingKind::Function => SymbolKind::FUNCTION,
            BindingKind::Kernel | BindingKind::Plan => SymbolKind::METHOD,
            BindingKind::Namespace => SymbolKind::NAMESPACE,
            BindingKind::Param | BindingKind::Data => SymbolKind::CONSTANT,
            BindingKind::Observation => SymbolKind::EVENT,
            _ => SymbolKind::VARIABLE,
        };
        #[allow(deprecated, reason = "the protocol's type has no other constructor")]
        DocumentSymbol {
            name: b.name.to_string(),
            detail: Some(b.kind.name().to_owned()),
            kind,
            tags: None,
            deprecated: None,
            range: encoding.range(file, b.whole),
            selection_range: encoding.range(file, b.span),
            children: None,
        }
    };
    Ok(analysis.outline().into_iter().map(symbol).collect())
}

fn hints(documents: &mut Documents, p: InlayHintParams) -> Answer<Vec<InlayHint>> {
    let encoding = documents.encoding;
    let analysis = documents.get(&p.text_document.uri)?.analysis();
    let Some(file) = source(analysis) else { return Ok(Vec::new()) };
    let (from, to) = (encoding.byte(file, p.range.start), encoding.byte(file, p.range.end));
    let inside = analysis.hints().into_iter().filter(|h| from <= h.at && h.at <= to);
    Ok(inside
        .map(|h| InlayHint {
            position: encoding.position(file, h.at),
            label: InlayHintLabel::String(match h.support.is_empty() {
                true => h.address,
                false => format!("{}: {}", h.address, h.support),
            }),
            kind: None,
            text_edits: None,
            tooltip: None,
            padding_left: Some(true),
            padding_right: None,
            data: None,
        })
        .collect())
}
