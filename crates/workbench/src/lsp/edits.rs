//! Changes of a text that the editor is to make: renaming and formatting.

use super::documents::{Document, source};
use super::positions::Encoding;
use lsp_types::{Position, PrepareRenameResponse, Range, TextEdit, WorkspaceEdit};
use pcadlang_syntax::format;

/// Returns the name that would be renamed at a position.
///
/// # Errors
/// If nothing can be renamed there.
pub fn prepare_rename(
    document: &mut Document,
    at: Position,
    encoding: Encoding,
) -> Result<PrepareRenameResponse, String> {
    let analysis = document.analysis();
    let file = source(analysis).ok_or("the document has no text")?;
    let byte = encoding.byte(file, at);
    let (found, binding) =
        analysis.names.at(0, byte).ok_or("there is no name of this program here")?;
    analysis.rename(byte, &binding.name).map_err(|e| e.to_string())?;
    let (range, placeholder) = (encoding.range(file, found.span), binding.name.to_string());
    Ok(PrepareRenameResponse::RangeWithPlaceholder { range, placeholder })
}

/// Returns the changes that rename what stands at a position.
///
/// # Errors
/// If it cannot be given that name.
// The protocol's type has such keys, which it never changes.
#[allow(clippy::mutable_key_type)]
pub fn rename(
    document: &mut Document,
    at: Position,
    new: &str,
    encoding: Encoding,
) -> Result<WorkspaceEdit, String> {
    let uri = document.uri.clone();
    let analysis = document.analysis();
    let file = source(analysis).ok_or("the document has no text")?;
    let places = analysis.rename(encoding.byte(file, at), new).map_err(|e| e.to_string())?;
    let edits = places
        .into_iter()
        .map(|s| TextEdit { range: encoding.range(file, s), new_text: new.to_owned() })
        .collect();
    Ok(WorkspaceEdit { changes: Some([(uri, edits)].into()), ..WorkspaceEdit::default() })
}

/// Returns the change that formats a document; none if it is formatted, or has mistakes.
pub fn formatted(document: &mut Document, encoding: Encoding) -> Vec<TextEdit> {
    let analysis = document.analysis();
    let (Some(file), Ok(text)) = (source(analysis), format(analysis.text())) else {
        return Vec::new();
    };
    if text == analysis.text() {
        return Vec::new();
    }
    let end = encoding.position(file, analysis.text().len() as u32);
    vec![TextEdit { range: Range { start: Position::default(), end }, new_text: text }]
}
