//! The mistakes that the editor shows: those of each document, also in the files that it
//! includes.

use super::positions::{Encoding, address};
use crate::editor::Analysis;
use lsp_server::Notification;
use lsp_types::notification::{Notification as _, PublishDiagnostics};
use lsp_types::{
    Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, Location,
    PublishDiagnosticsParams, Range, Uri,
};
use pcadlang_syntax::diag::{self, FileId, Severity, SourceMap};
use std::collections::{BTreeMap, HashMap};
use std::str::FromStr;

/// By document, the files for which mistakes are shown on its account.
#[derive(Debug, Default)]
pub struct Published {
    by_document: HashMap<String, Vec<String>>,
    closed: Vec<String>,
}

impl Published {
    /// A document is closed: its mistakes are to disappear.
    pub fn close(&mut self, uri: &Uri) {
        self.closed.extend(self.by_document.remove(uri.as_str()).unwrap_or_default());
    }

    /// Returns the messages that remove the mistakes of closed documents.
    pub fn cleared(&mut self) -> Vec<Notification> {
        let closed = std::mem::take(&mut self.closed);
        closed.iter().filter_map(|uri| message(uri, Vec::new(), None)).collect()
    }

    /// Returns the messages that replace the mistakes of a document.
    pub fn replace(
        &mut self,
        uri: &Uri,
        version: i32,
        analysis: &Analysis,
        encoding: Encoding,
    ) -> Vec<Notification> {
        let own = uri.as_str().to_owned();
        let mut by_file: BTreeMap<String, Vec<Diagnostic>> = BTreeMap::new();
        by_file.insert(own.clone(), Vec::new());
        for before in self.by_document.remove(&own).unwrap_or_default() {
            by_file.entry(before).or_default();
        }
        let address = |file: FileId| address(analysis, uri, file);
        for d in &analysis.diagnostics {
            let at = d.labels.iter().find(|l| l.primary).or(d.labels.first());
            let file = at.and_then(|l| address(l.span.file));
            let place = file.as_ref().map_or(own.clone(), |u| u.as_str().to_owned());
            let shown = shown(d, at, file.is_some(), &analysis.sources, encoding, &address);
            by_file.entry(place).or_default().push(shown);
        }
        let files: Vec<String> =
            by_file.iter().filter(|(_, all)| !all.is_empty()).map(|(f, _)| f.clone()).collect();
        self.by_document.insert(own.clone(), files);
        let notes = by_file.into_iter().map(|(file, all)| {
            let version = (file == own).then_some(version);
            message(&file, all, version)
        });
        notes.flatten().collect()
    }
}

fn message(uri: &str, diagnostics: Vec<Diagnostic>, version: Option<i32>) -> Option<Notification> {
    let uri = Uri::from_str(uri).ok()?;
    let params = PublishDiagnosticsParams { uri, diagnostics, version };
    Some(Notification::new(PublishDiagnostics::METHOD.to_owned(), params))
}

fn shown(
    d: &diag::Diagnostic,
    at: Option<&diag::Label>,
    is_placed: bool,
    sources: &SourceMap,
    encoding: Encoding,
    address: &dyn Fn(FileId) -> Option<Uri>,
) -> Diagnostic {
    let range = |label: &diag::Label| {
        sources.get(label.span.file).map_or(Range::default(), |f| encoding.range(f, label.span))
    };
    let mut text = d.message.clone();
    if let Some(label) = at.filter(|l| !l.text.is_empty()) {
        text.push_str(&format!("\n{}", label.text));
    }
    d.notes.iter().for_each(|n| text.push_str(&format!("\n{n}")));
    d.hints.iter().for_each(|h| text.push_str(&format!("\nhint: {h}")));
    let related = d.labels.iter().filter(|l| Some(*l) != at).filter_map(|l| {
        let location = Location { uri: address(l.span.file)?, range: range(l) };
        Some(DiagnosticRelatedInformation { location, message: l.text.clone() })
    });
    Diagnostic {
        range: at.filter(|_| is_placed).map_or(Range::default(), range),
        severity: Some(match d.severity {
            Severity::Error => DiagnosticSeverity::ERROR,
            Severity::Warning => DiagnosticSeverity::WARNING,
            Severity::Note => DiagnosticSeverity::INFORMATION,
        }),
        source: Some("pcadlang".to_owned()),
        message: text,
        related_information: Some(related.collect()),
        ..Diagnostic::default()
    }
}
