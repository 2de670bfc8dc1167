//! Neural networks: reads TFLite files of convolutional networks and runs them, on one
//! thread and with the same bits everywhere.
//!
//! As much of the format as networks that find people need: pictures one at a time,
//! numbers of 32 or 16 bits, sparse weights. What a file may contain is checked when it
//! is read, so that running what was read cannot fail, and takes bounded time and memory.

mod assemble;
mod convolution;
mod file;
mod flatbuffer;
mod network;
mod operator;
mod resampling;
mod schema;
mod shape;
mod sparse;
#[cfg(test)]
mod tests;

pub use network::Network;
pub use operator::sigmoid;

/// Why a file is no network that can be run, or an input none for it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    /// The file is cut short, or not of the format.
    #[error("not a readable TFLite file: {0}")]
    Format(String),
    /// An operator, by its place in the file, is not one of those that are known, or does
    /// not fit its tensors.
    #[error("operator {index} of the network, {name}: {why}")]
    Operator {
        /// Its place in the file, from 0.
        index: usize,
        /// What it is called.
        name: String,
        /// What is wrong.
        why: String,
    },
    /// The network is larger than any that finds people.
    #[error("the network is too large: {0}")]
    TooLarge(String),
    /// An input of the wrong length.
    #[error("the network takes {expected} numbers, got {got}")]
    Input {
        /// How many numbers it takes.
        expected: usize,
        /// How many there were.
        got: usize,
    },
}
