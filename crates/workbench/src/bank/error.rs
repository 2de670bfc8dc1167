//! Errors in making, reading or using a bank.

use pcadlang_engine::lang::error::RunError;
use std::io;

/// The reason why a bank cannot be made, read or used.
#[derive(Debug, thiserror::Error)]
pub enum BankError {
    /// The file cannot be read or written.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file is not a bank.
    #[error("it is not a bank; `pcadlang learn` makes one")]
    NotABank,
    /// The file has another format version.
    #[error(
        "it has format version {found}, but this program reads version {expected}; rebuild it \
         with `pcadlang learn`"
    )]
    Version {
        /// The version of the file.
        found: u32,
        /// The version this program reads and writes.
        expected: u32,
    },
    /// The file is truncated, or its parts are inconsistent.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// The bank was made from another program.
    #[error(
        "it was made from another program, or from another version or other parameters of this \
         one ({name}, hash {found}; this one has {expected}); rebuild it with `pcadlang learn`"
    )]
    Program {
        /// The file name of that program.
        name: String,
        /// The program hash in the bank.
        found: String,
        /// The hash of the current program.
        expected: String,
    },
    /// Banks that cannot be joined.
    #[error("{0}")]
    Parts(String),
    /// The observations that the features need are missing.
    #[error("{0}")]
    Observed(String),
    /// The program failed.
    #[error("{0}")]
    Run(Box<RunError>),
    /// A detector failed.
    #[error("{0}")]
    Command(String),
}
