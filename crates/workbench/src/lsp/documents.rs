//! The documents that the editor has open, with their analyses.

use super::positions::{Encoding, path_of};
use super::published::Published;
use crate::editor::Analysis;
use lsp_server::Notification;
use lsp_types::Uri;
use pcadlang_syntax::diag::{FileId, SourceFile};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// One open document.
pub struct Document {
    /// Its address.
    pub uri: Uri,
    /// Its path.
    pub path: String,
    /// The number of this version of its text.
    pub version: i32,
    text: String,
    analysis: Option<Analysis>,
    /// The analysis of an earlier version.
    before: Option<Analysis>,
    is_published: bool,
}

impl Document {
    /// Returns the analysis of the present text.
    pub fn analysis(&mut self) -> &Analysis {
        let Document { path, text, before, .. } = self;
        self.analysis.get_or_insert_with(|| match before.take() {
            Some(before) => before.edited(text),
            None => Analysis::of(path, text),
        })
    }

    /// Returns the folder to which paths in the document are relative.
    pub fn folder(&self) -> PathBuf {
        Path::new(&self.path).parent().map_or_else(PathBuf::new, Path::to_owned)
    }
}

/// Returns the text of an analysis with its lines.
pub fn source(analysis: &Analysis) -> Option<&SourceFile> {
    analysis.sources.get(FileId(0))
}

/// The open documents.
pub struct Documents {
    /// The units of columns.
    pub encoding: Encoding,
    open: HashMap<String, Document>,
    published: Published,
}

impl Documents {
    /// Returns the state before any document is open.
    pub fn new(encoding: Encoding) -> Self {
        Documents { encoding, open: HashMap::new(), published: Published::default() }
    }

    /// Opens a document, or gives it a new text.
    pub fn set(&mut self, uri: &Uri, text: String, version: i32) {
        let known = self.open.remove(uri.as_str());
        let before = known.and_then(|d| d.analysis.or(d.before));
        let (path, key, uri) = (path_of(uri), uri.as_str().to_owned(), uri.clone());
        let (analysis, is_published) = (None, false);
        let document = Document { uri, path, version, text, analysis, before, is_published };
        self.open.insert(key, document);
    }

    /// A document was saved: what is read from the disk may have changed, for others too.
    pub fn saved(&mut self) {
        for document in self.open.values_mut() {
            (document.analysis, document.before) = (None, None);
            document.is_published = false;
        }
    }

    /// Closes a document.
    pub fn close(&mut self, uri: &Uri) {
        self.open.remove(uri.as_str());
        self.published.close(uri);
    }

    /// Returns an open document.
    ///
    /// # Errors
    /// If it is not open.
    pub fn get(&mut self, uri: &Uri) -> Result<&mut Document, String> {
        self.open.get_mut(uri.as_str()).ok_or_else(|| format!("{} is not open", uri.as_str()))
    }

    /// Returns messages with the mistakes of the documents that have changed.
    pub fn publish(&mut self) -> Vec<Notification> {
        let mut notes = self.published.cleared();
        for document in self.open.values_mut().filter(|d| !d.is_published) {
            document.is_published = true;
            document.analysis();
            if let Some(analysis) = &document.analysis {
                let (uri, version) = (&document.uri, document.version);
                notes.extend(self.published.replace(uri, version, analysis, self.encoding));
            }
        }
        notes
    }
}
