//! The analysis of one version of a program's text.

use super::names::{BindingKind, Names};
use pcadlang_engine::lang::builtins::Table;
use pcadlang_engine::lang::load::load_partly;
use pcadlang_library::{Model, Program, shipped, standard};
use pcadlang_syntax::diag::{Diagnostic, SourceMap};
use pcadlang_syntax::span::{FileId, Span};
use std::sync::Arc;

/// The analysis of a program's text, as if it were a file with that name. The text is
/// file 0; the files it includes follow.
pub struct Analysis {
    /// The text and the files that it includes.
    pub sources: SourceMap,
    /// The mistakes in them.
    pub diagnostics: Vec<Diagnostic>,
    /// The names in them.
    pub names: Names,
    /// The program, if it has no mistakes.
    pub(super) model: Option<Model>,
    /// The last version that could be parsed, with the data files that were read for it.
    program: Option<Program>,
    pub(super) builtins: Arc<Table>,
}

/// A name that cannot be given to all places of a binding.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CannotRename {
    /// There is no name of the program.
    #[error("there is no name of this program here")]
    Nothing,
    /// The new name is not one.
    #[error("`{0}` is not a name: letters, digits and `_`, no keyword")]
    NotAName(String),
    /// The name is bound in another file.
    #[error("`{0}` is bound in {1}: rename it there")]
    Elsewhere(String, String),
    /// Addresses may name the choice by a path that is not resolved.
    #[error("addresses in this program have `{0}` below another name: rename it by hand")]
    InAddresses(String),
    /// The new name is taken.
    #[error("`{0}` is bound already")]
    Taken(String),
}

impl Analysis {
    /// Analyses a text.
    pub fn of(name: &str, text: &str) -> Analysis {
        Analysis::from_program(name, text, None)
    }

    /// Analyses another version of the text. Data files that have been read are not read
    /// again.
    #[must_use]
    pub fn edited(self, text: &str) -> Analysis {
        let name = self.sources.get(FileId(0)).map_or("", |f| f.name()).to_owned();
        Analysis::from_program(&name, text, self.program)
    }

    fn from_program(name: &str, text: &str, mut program: Option<Program>) -> Analysis {
        let parsed = match &program {
            Some(before) => before.edited(text),
            None => Program::named(name, text).map(Program::without_data),
        };
        let (names, sources, compiled) = match parsed {
            Ok(parsed) => {
                let (loaded, sources) = parsed.loaded();
                let (names, sources) = (Names::of(loaded), sources.clone());
                (names, sources, program.insert(parsed).clone().compile())
            }
            Err(e) => {
                let mut sources = SourceMap::new();
                let reach = shipped::reach().of(name);
                let (loaded, _) = load_partly(name, text, &reach, &mut sources);
                (Names::of(&loaded), sources, Err(e))
            }
        };
        let (model, diagnostics) = match compiled {
            Ok(model) => {
                let warnings = model.warnings().1.to_vec();
                (Some(model), warnings)
            }
            Err(e) => (None, e.diagnostics),
        };
        Analysis { sources, diagnostics, names, model, program, builtins: standard::table() }
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        self.sources.get(FileId(0)).map_or("", |f| f.text())
    }

    /// Returns where the name at a byte is bound.
    pub fn definition(&self, byte: u32) -> Option<Span> {
        self.names.at(0, byte).map(|(_, binding)| binding.span)
    }

    /// Returns all places of the name at a byte, its binding included.
    pub fn references(&self, byte: u32) -> Vec<Span> {
        self.names.at(0, byte).map_or(Vec::new(), |(o, _)| self.names.places(o.binding))
    }

    /// Returns the places that change if the name at a byte becomes another one.
    ///
    /// # Errors
    /// If that is not possible in this text alone, or the name would not be one.
    pub fn rename(&self, byte: u32, new: &str) -> Result<Vec<Span>, CannotRename> {
        let (found, binding) = self.names.at(0, byte).ok_or(CannotRename::Nothing)?;
        let old = binding.name.to_string();
        if !pcadlang_syntax::is_name(new) || pcadlang_syntax::is_keyword(new) {
            return Err(CannotRename::NotAName(new.to_owned()));
        }
        if binding.span.file != FileId(0) {
            let file = self.sources.get(binding.span.file).map_or("", |f| f.name());
            return Err(CannotRename::Elsewhere(old, file.to_owned()));
        }
        let is_addressed =
            !matches!(binding.kind, BindingKind::Argument | BindingKind::Loop | BindingKind::Plan);
        if is_addressed && self.names.is_segment(&old) {
            return Err(CannotRename::InAddresses(old));
        }
        let places = self.names.places(found.binding);
        let is_taken = |at: &Span| {
            self.names.visible(0, at.start).any(|b| &*b.name == new && b.span != binding.span)
        };
        match old != new && places.iter().any(is_taken) {
            true => Err(CannotRename::Taken(new.to_owned())),
            false => Ok(places),
        }
    }
}
