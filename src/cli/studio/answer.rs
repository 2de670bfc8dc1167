//! What the studio answers: JSON, bytes, or why not.

use super::protocol;
use crate::cli::failure::Failure;
use axum::body::Bytes;
use pcadlang::diag::{Diagnostic, Severity, SourceMap};
use pcadlang::session::Trouble;
use serde_json::{Map, Value, json};
use std::fmt;
use std::sync::Arc;

/// An answer to a request.
pub enum Answer {
    /// JSON.
    Json(Value),
    /// Data with a header.
    Bytes(Map<String, Value>, Arc<Vec<u8>>),
}

/// Why a request was not done.
#[derive(Debug)]
pub struct Problem {
    message: String,
    hint: Option<String>,
    diagnostics: Value,
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
pub fn frame(id: u64, done: Result<Answer, Problem>) -> Frame {
    match done {
        Ok(Answer::Json(value)) => Frame::Text(protocol::result(id, &value)),
        Ok(Answer::Bytes(header, data)) => {
            Frame::Binary(protocol::binary(id, header, &data).into())
        }
        Err(p) => {
            Frame::Text(protocol::error(Some(id), &p.message, p.hint.as_deref(), p.diagnostics))
        }
    }
}

impl From<Value> for Answer {
    fn from(value: Value) -> Answer {
        Answer::Json(value)
    }
}

impl Problem {
    /// A message without a place in a program.
    pub fn plain(message: impl Into<String>) -> Problem {
        Problem { message: message.into(), hint: None, diagnostics: json!([]) }
    }

    /// Adds what may help.
    pub fn hint(self, hint: impl Into<String>) -> Problem {
        Problem { hint: Some(hint.into()), ..self }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<pcadlang::Error> for Problem {
    fn from(e: pcadlang::Error) -> Problem {
        let first = e.diagnostics.first().map_or_else(String::new, |d| d.message.clone());
        let hint = e.diagnostics.first().and_then(|d| d.hints.first().cloned());
        let all: Vec<Value> = e.diagnostics.iter().map(|d| place(d, &e.sources)).collect();
        Problem { message: first, hint, diagnostics: json!(all) }
    }
}

impl From<Failure> for Problem {
    fn from(f: Failure) -> Problem {
        match f {
            Failure::Program(e) => (*e).into(),
            Failure::Plain(message, hint) => Problem { hint, ..Problem::plain(message) },
            Failure::Interrupted => Problem::plain("interrupted"),
        }
    }
}

impl From<Trouble> for Problem {
    fn from(t: Trouble) -> Problem {
        match t {
            Trouble::Program(e) => (*e).into(),
            Trouble::Plain(message, hint) => Problem { hint, ..Problem::plain(message) },
            stopped @ Trouble::Stopped => Problem::plain(stopped.to_string()),
        }
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
    let file = label.and_then(|l| Some((l, sources.get(l.span.file)?)));
    if let Some((label, file)) = file {
        let at = |byte: u32| {
            let line = file.line_index(byte as usize);
            let start = file.line_range(line).start;
            let before = file.text().get(start..byte as usize).unwrap_or_default();
            (line, before.encode_utf16().count())
        };
        let (from, to) = (at(label.span.start), at(label.span.end));
        out["file"] = json!(file.name());
        out["line"] = json!(from.0);
        out["column"] = json!(from.1);
        out["end_line"] = json!(to.0);
        out["end_column"] = json!(to.1);
    }
    out
}
