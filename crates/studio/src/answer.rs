//! Answers of the studio: JSON, bytes, or an error.

use super::protocol;
use axum::body::Bytes;
use pcadlang_runs::failure::{Failure, STOPPED};
use pcadlang_syntax::diag::{Diagnostic, Severity, SourceMap};
use pcadlang_workbench::lsp::positions::Encoding;
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// An answer to a request.
pub enum Answer {
    /// JSON.
    Json(Value),
    /// Data with a header.
    Bytes(Map<String, Value>, Arc<Vec<u8>>),
}

/// A frame for the page.
#[derive(Clone, Debug)]
pub enum Frame {
    /// JSON.
    Text(String),
    /// A binary frame.
    Binary(Bytes),
}

/// Returns the frame of an answer to the request with this number.
pub fn frame(id: u64, done: Result<Answer, Failure>) -> Frame {
    match done {
        Ok(Answer::Json(value)) => Frame::Text(protocol::result(id, &value)),
        Ok(Answer::Bytes(header, data)) => {
            Frame::Binary(protocol::binary(id, header, &data).into())
        }
        Err(failure) => Frame::Text(refusal(id, &failure)),
    }
}

fn refusal(id: u64, failure: &Failure) -> String {
    let error = |message: &str, hint: Option<&str>, diagnostics| {
        protocol::error(Some(id), message, hint, diagnostics)
    };
    match failure {
        Failure::Plain(message, hint) => error(message, hint.as_deref(), json!([])),
        Failure::Interrupted => error(STOPPED, None, json!([])),
        Failure::Program(e) => {
            let first = e.diagnostics.first();
            let message = first.map_or("", |d| &d.message);
            let hint = first.and_then(|d| d.hints.first()).map(String::as_str);
            let all: Vec<Value> = e.diagnostics.iter().map(|d| place(d, &e.sources)).collect();
            error(message, hint, json!(all))
        }
    }
}

impl From<Value> for Answer {
    fn from(value: Value) -> Answer {
        Answer::Json(value)
    }
}

/// Returns a diagnostic with its place as the page counts: lines and columns from 0,
/// columns in UTF-16 units.
fn place(d: &Diagnostic, sources: &SourceMap) -> Value {
    let label = d.labels.iter().find(|l| l.primary).or(d.labels.first());
    let mut said = d.message.clone();
    if let Some(text) = label.map(|l| &l.text).filter(|t| !t.is_empty()) {
        said = format!("{said}: {text}");
    }
    let severity = match d.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    };
    let mut out = json!({ "severity": severity, "message": said, "hint": d.hints.first() });
    if let Some((label, file)) = label.and_then(|l| Some((l, sources.get(l.span.file)?))) {
        let range = Encoding::Utf16.range(file, label.span);
        out["file"] = json!(file.name());
        out["line"] = json!(range.start.line);
        out["column"] = json!(range.start.character);
        out["end_line"] = json!(range.end.line);
        out["end_column"] = json!(range.end.character);
    }
    out
}
