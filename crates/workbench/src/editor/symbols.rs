//! The outline of a program, and the classes of its pieces.

use super::Analysis;
use super::names::{Binding, BindingKind};
use pcadlang_engine::lang::builtins::Kind;
use pcadlang_syntax::span::FileId;
use pcadlang_syntax::{Class, classes};
use std::ops::Range;

/// A piece of the text with its class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its bytes.
    pub range: Range<usize>,
    /// Its class.
    pub kind: PieceKind,
}

/// The class of a piece of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PieceKind {
    /// A class that the text alone has.
    Text(Class),
    /// A name of the program.
    Bound(BindingKind),
    /// A built-in function or distribution.
    Function,
    /// A built-in kernel.
    Kernel,
}

impl Analysis {
    /// Returns the bindings at the top level, in the order of the text.
    pub fn outline(&self) -> Vec<&Binding> {
        let top = |b: &&Binding| b.span.file == FileId(0) && b.scope.is_none();
        let mut all: Vec<&Binding> = self.names.bindings.iter().filter(top).collect();
        all.sort_by_key(|b| b.span.start);
        all
    }

    /// Returns the pieces of the text that have a class, in order.
    pub fn pieces(&self) -> Vec<Piece> {
        classes(self.text())
            .into_iter()
            .map(|(range, class)| {
                let kind = match class {
                    Class::Name => self.name_kind(range.start as u32),
                    class => PieceKind::Text(class),
                };
                Piece { range, kind }
            })
            .collect()
    }

    fn name_kind(&self, byte: u32) -> PieceKind {
        if let Some((_, b)) = self.names.at(0, byte + 1) {
            return PieceKind::Bound(b.kind);
        }
        let other = self.names.other_at(0, byte + 1).map(|(_, name)| name);
        let found = other.and_then(|name| self.builtins.iter().find(|b| b.full_name() == name));
        match found.map(|b| b.kind) {
            Some(Kind::Plan(_)) => PieceKind::Kernel,
            Some(_) => PieceKind::Function,
            None => PieceKind::Text(Class::Name),
        }
    }
}
