//! Semantic tokens: the classes of the pieces of a text, in the protocol's encoding.

use super::documents::source;
use super::positions::Encoding;
use crate::editor::{Analysis, BindingKind, PieceKind};
use lsp_types::{SemanticToken, SemanticTokenType, SemanticTokens, SemanticTokensLegend};
use pcadlang_syntax::Class;

const TYPES: [SemanticTokenType; 10] = [
    SemanticTokenType::KEYWORD,
    SemanticTokenType::VARIABLE,
    SemanticTokenType::NUMBER,
    SemanticTokenType::STRING,
    SemanticTokenType::DECORATOR,
    SemanticTokenType::COMMENT,
    SemanticTokenType::FUNCTION,
    SemanticTokenType::PARAMETER,
    SemanticTokenType::NAMESPACE,
    SemanticTokenType::MACRO,
];

/// The types of tokens, by number.
pub fn legend() -> SemanticTokensLegend {
    SemanticTokensLegend { token_types: TYPES.to_vec(), token_modifiers: Vec::new() }
}

fn number(kind: PieceKind) -> u32 {
    match kind {
        PieceKind::Text(Class::Keyword) => 0,
        PieceKind::Text(Class::Name) => 1,
        PieceKind::Text(Class::Number) => 2,
        PieceKind::Text(Class::String) => 3,
        PieceKind::Text(Class::Address) => 4,
        PieceKind::Text(Class::Comment) => 5,
        PieceKind::Function | PieceKind::Bound(BindingKind::Function) => 6,
        PieceKind::Bound(BindingKind::Argument) => 7,
        PieceKind::Bound(BindingKind::Namespace) => 8,
        PieceKind::Kernel | PieceKind::Bound(BindingKind::Kernel | BindingKind::Plan) => 9,
        PieceKind::Bound(_) => 1,
    }
}

/// Returns the tokens of a text, each relative to the one before.
pub fn tokens(analysis: &Analysis, encoding: Encoding) -> SemanticTokens {
    let mut data = Vec::new();
    let Some(file) = source(analysis) else { return SemanticTokens::default() };
    let (mut line, mut column) = (0, 0);
    for piece in analysis.pieces() {
        let mut start = piece.range.start;
        // A token does not go beyond its line.
        for part in analysis.text()[piece.range].split_inclusive('\n') {
            let at = encoding.position(file, start as u32);
            let shown = part.trim_end_matches(['\n', '\r']);
            let end = encoding.position(file, (start + shown.len()) as u32);
            start += part.len();
            if shown.is_empty() {
                continue;
            }
            data.push(SemanticToken {
                delta_line: at.line - line,
                delta_start: if at.line == line { at.character - column } else { at.character },
                length: end.character - at.character,
                token_type: number(piece.kind),
                token_modifiers_bitset: 0,
            });
            (line, column) = (at.line, at.character);
        }
    }
    SemanticTokens { result_id: None, data }
}
