//! Answers to an editor about the text of a program: its mistakes, what a name means and
//! where else it stands, what may be written here, which choices there are. Nothing is
//! run; protocols are the command's affair (`pcadlang lsp`).

mod analysis;
mod completion;
mod names;
mod resolve;
mod signature;
mod symbols;
pub mod words;

pub use analysis::{Analysis, CannotRename};
pub use completion::{Candidate, CandidateKind};
pub use names::{Binding, BindingId, BindingKind, Names, Occurrence};
pub use signature::Signature;
pub use symbols::{Hint, Piece, PieceKind};
