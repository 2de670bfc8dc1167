//! The documents that the editor has open, with their analyses.

use super::positions::{Encoding, path_of};
use super::published::Published;
use lsp_server::Notification;
use lsp_types::Uri;
use pcadlang::diag::{FileId, SourceFile};
use pcadlang::editor::Analysis;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// One open document.
#[derive(Debug)]
pub struct Document {
    /// Its address.
    pub uri: Uri,
    /// Its path.
    pub path: String,
    /// The number of this version of its text.
    pub version: i32,
    text: String,
    analysis: Option<Analysis>,
    is_published: bool,
}

impl Document {
    /// Returns the analysis of the present text.
    pub fn analysis(&mut self) -> &Analysis {
        self.analysis.get_or_insert_with(|| Analysis::of(&self.path, &self.text))
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
#[derive(Debug)]
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
        let path = path_of(uri);
        let (uri, analysis, is_published) = (uri.clone(), None, false);
        let key = uri.as_str().to_owned();
        self.open.insert(key, Document { uri, path, version, text, analysis, is_published });
        // Others may include it. They read it as it was saved.
        for other in self.open.values_mut().filter(|d| d.analysis.is_some()) {
            let names_it =
                other.analysis.as_ref().is_some_and(|a| a.sources.get(FileId(1)).is_some());
            if names_it {
                (other.analysis, other.is_published) = (None, false);
            }
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
