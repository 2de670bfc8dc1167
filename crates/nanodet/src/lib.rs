//! NanoDet's files, unmodified: a graph model of TensorFlow.js, for
//! `pcadlang_detectors::objects`. See `README.md` for their source and licences.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

/// The network's operators, and the names, shapes and types of its constants:
/// `nanodet.json`.
pub static MODEL: &[u8] = include_bytes!("../nanodet.json");

/// The values of its constants, in the model's order: `nanodet.bin`.
pub static WEIGHTS: &[u8] = include_bytes!("../nanodet.bin");
