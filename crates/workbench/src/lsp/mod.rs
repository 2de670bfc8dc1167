//! `pcadlang lsp`: a language server over standard input and output, for editors that
//! speak the Language Server Protocol 3.17.

mod documents;
mod edits;
pub mod positions;
mod published;
mod requests;
mod tokens;

use crate::failure::{Failure, plain};
use documents::Documents;
use lsp_server::{Connection, ErrorCode, Message, Notification, Request, Response};
use lsp_types::notification::{
    DidChangeTextDocument, DidCloseTextDocument, DidOpenTextDocument, DidSaveTextDocument,
    Notification as _,
};
use lsp_types::{
    CompletionOptions, DidChangeTextDocumentParams, DidCloseTextDocumentParams,
    DidOpenTextDocumentParams, HoverProviderCapability, InitializeParams, OneOf,
    PositionEncodingKind, RenameOptions, SemanticTokensFullOptions, SemanticTokensOptions,
    ServerCapabilities, SignatureHelpOptions, TextDocumentSyncCapability, TextDocumentSyncKind,
    TextDocumentSyncOptions, TextDocumentSyncSaveOptions,
};
use positions::Encoding;

/// Serves one editor until it says goodbye.
pub fn lsp() -> Result<(), Failure> {
    let (connection, threads) = Connection::stdio();
    let served = serve(&connection);
    // Its threads end when the connection is closed.
    drop(connection);
    threads.join().map_err(|e| plain(format!("the connection failed: {e}")))?;
    served
}

/// Serves a client over a connection until it says goodbye or leaves.
pub fn serve(connection: &Connection) -> Result<(), Failure> {
    let failed = |e: &dyn std::fmt::Display| plain(format!("the language server stopped: {e}"));
    let (id, params) = connection.initialize_start().map_err(|e| failed(&e))?;
    let client: InitializeParams = serde_json::from_value(params).unwrap_or_default();
    let encoding = encoding(&client);
    let offer = serde_json::json!({
        "capabilities": capabilities(encoding),
        "serverInfo": { "name": "pcadlang", "version": env!("CARGO_PKG_VERSION") },
    });
    connection.initialize_finish(id, offer).map_err(|e| failed(&e))?;

    let mut documents = Documents::new(encoding);
    for message in &connection.receiver {
        match message {
            Message::Request(request) => {
                if connection.handle_shutdown(&request).map_err(|e| failed(&e))? {
                    return Ok(());
                }
                let answer = answer(&mut documents, request);
                connection.sender.send(answer.into()).map_err(|e| failed(&e))?;
            }
            Message::Notification(n) => heard(&mut documents, n),
            Message::Response(_) => {}
        }
        // While the editor goes on sending, mistakes can wait.
        if connection.receiver.is_empty() {
            for note in documents.publish() {
                connection.sender.send(note.into()).map_err(|e| failed(&e))?;
            }
        }
    }
    Ok(())
}

fn encoding(client: &InitializeParams) -> Encoding {
    let offered = client.capabilities.general.as_ref().and_then(|g| g.position_encodings.as_ref());
    match offered.is_some_and(|all| all.contains(&PositionEncodingKind::UTF8)) {
        true => Encoding::Utf8,
        false => Encoding::Utf16,
    }
}

fn capabilities(encoding: Encoding) -> ServerCapabilities {
    ServerCapabilities {
        position_encoding: Some(match encoding {
            Encoding::Utf8 => PositionEncodingKind::UTF8,
            Encoding::Utf16 => PositionEncodingKind::UTF16,
        }),
        text_document_sync: Some(TextDocumentSyncCapability::Options(TextDocumentSyncOptions {
            open_close: Some(true),
            change: Some(TextDocumentSyncKind::FULL),
            save: Some(TextDocumentSyncSaveOptions::Supported(true)),
            ..TextDocumentSyncOptions::default()
        })),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        completion_provider: Some(CompletionOptions {
            trigger_characters: Some([".", "@", "$", "\"", "/"].map(str::to_owned).into()),
            ..CompletionOptions::default()
        }),
        signature_help_provider: Some(SignatureHelpOptions {
            trigger_characters: Some(["(", ","].map(str::to_owned).into()),
            ..SignatureHelpOptions::default()
        }),
        definition_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: lsp_types::WorkDoneProgressOptions::default(),
        })),
        document_symbol_provider: Some(OneOf::Left(true)),
        document_formatting_provider: Some(OneOf::Left(true)),
        semantic_tokens_provider: Some(
            SemanticTokensOptions {
                legend: tokens::legend(),
                full: Some(SemanticTokensFullOptions::Bool(true)),
                ..SemanticTokensOptions::default()
            }
            .into(),
        ),
        inlay_hint_provider: Some(OneOf::Left(true)),
        ..ServerCapabilities::default()
    }
}

fn answer(documents: &mut Documents, request: Request) -> Response {
    let id = request.id.clone();
    match requests::handle(documents, &request.method, request.params) {
        Ok(Some(result)) => Response::new_ok(id, result),
        Ok(None) => {
            let message = format!("`{}` is not supported", request.method);
            Response::new_err(id, ErrorCode::MethodNotFound as i32, message)
        }
        Err(message) => Response::new_err(id, ErrorCode::InvalidParams as i32, message),
    }
}

/// Follows what the editor says of its documents. What cannot be understood is ignored,
/// as the protocol requires of notifications.
fn heard(documents: &mut Documents, n: Notification) {
    match n.method.as_str() {
        DidOpenTextDocument::METHOD => {
            if let Ok(p) = serde_json::from_value::<DidOpenTextDocumentParams>(n.params) {
                documents.set(&p.text_document.uri, p.text_document.text, p.text_document.version);
            }
        }
        DidChangeTextDocument::METHOD => {
            if let Ok(p) = serde_json::from_value::<DidChangeTextDocumentParams>(n.params)
                && let Some(last) = p.content_changes.into_iter().last()
            {
                documents.set(&p.text_document.uri, last.text, p.text_document.version);
            }
        }
        DidCloseTextDocument::METHOD => {
            if let Ok(p) = serde_json::from_value::<DidCloseTextDocumentParams>(n.params) {
                documents.close(&p.text_document.uri);
            }
        }
        DidSaveTextDocument::METHOD => documents.saved(),
        _ => {}
    }
}
