//! What is wrong with a bank, or with making one.

use crate::lang::error::RunError;
use std::io;

/// Why a bank cannot be made, read or used.
#[derive(Debug, thiserror::Error)]
pub enum BankError {
    /// The file cannot be read or written.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file is something else.
    #[error("it is not a bank; `pcadlang learn` makes one")]
    NoBank,
    /// It was written by another version.
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
    /// Its end is missing, or its parts do not fit.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// It was learnt from another program.
    #[error(
        "it was made from another program, or from another version or other parameters of this \
         one ({name}, hash {found}; this one has {expected}); rebuild it with `pcadlang learn`"
    )]
    Program {
        /// The program's file, as it was called.
        name: String,
        /// The hash in the bank.
        found: String,
        /// The hash of the program that is run.
        expected: String,
    },
    /// The run does not observe what the features are of.
    #[error("{0}")]
    Observed(String),
    /// The program fails.
    #[error("{0}")]
    Run(Box<RunError>),
    /// A detector fails.
    #[error("{0}")]
    Command(String),
}
