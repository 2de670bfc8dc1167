//! Neural networks: reads TFLite files and TensorFlow.js graph models of convolutional
//! networks and runs them, on one thread and with the same bits on every machine.
//!
//! Supports as much of the formats as detectors need: one image at a time, 32- or 16-bit
//! floats, sparse weights in TFLite files. A file is checked when it is read, so running a
//! network cannot fail, and takes bounded time and memory.

mod assemble;
mod convolution;
mod depthwise;
mod file;
mod flatbuffer;
mod fuse;
mod graph_model;
mod network;
mod operator;
mod plan;
mod read;
mod resampling;
mod schema;
mod shape;
mod sparse;
#[cfg(test)]
pub(crate) mod tests;
mod transposed;
mod weights;
mod winograd;

pub use network::{Memory, Network};
pub use operator::sigmoid;

/// The reason why a file cannot be run as a network, or why an input does not fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    /// The file is truncated, not of the format, or of a network for something else.
    #[error("not a readable network: {0}")]
    Format(String),
    /// An operator is unknown or does not match its tensors.
    #[error("operator {index} of the network, {name}: {why}")]
    Operator {
        /// Its index in the file, from 0.
        index: usize,
        /// Its name.
        name: String,
        /// The reason.
        why: String,
    },
    /// The network exceeds the limits, which allow for any detector here.
    #[error("the network is too large: {0}")]
    TooLarge(String),
    /// An input has the wrong length.
    #[error("the network takes {expected} numbers, got {got}")]
    Input {
        /// The number of inputs that the network takes.
        expected: usize,
        /// The number of inputs given.
        got: usize,
    },
}
