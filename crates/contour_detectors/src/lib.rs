//! Contour detectors that users bring as files, for `detector("…")` of programs and `--edges`:
//! structured forests, and networks in ONNX. Built into the command by the feature
//! `contour_detectors`; in Rust, `Program::host(&pcadlang_contour_detectors::host())`.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod files;
mod forest;
mod onnx;
mod options;

pub use files::read;
pub use forest::{Forest, ForestOptions};
pub use onnx::Network;
pub use options::{NetworkOptions, Output};

use pcadlang_engine::lang::builtins::data::unreadable;
use pcadlang_engine::lang::value::Value;
use pcadlang_inference::host::{DataFormat, DataOptions, Fault, Host, Literal, ReadRelative};
use pcadlang_library::scene::{self, DetectorValue, Row};
use std::sync::Arc;

/// The kind of data `detector` as it is declared beside the module `scene`, with what reads it.
pub fn host() -> Host {
    let row = Row { format: Some(|| Arc::new(DetectorFile)), ..scene::DETECTOR };
    Host::new().with(scene::entry(&row).replacing())
}

#[derive(Debug)]
struct DetectorFile;

impl DataFormat for DetectorFile {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &DataOptions,
        _: &ReadRelative,
    ) -> Result<Value, Fault> {
        let network = options::network(options).map_err(|why| unreadable(file, &why))?;
        read(bytes, &network)
            .map(|d| Value::object(DetectorValue(Some(d))))
            .map_err(|e| unreadable(file, &e.to_string()))
    }

    fn without_file(&self) -> Option<Value> {
        Some(Value::object(DetectorValue::default()))
    }

    fn check_option(&self, name: &str, value: &Literal) -> Result<(), String> {
        options::network(&DataOptions::single(name, value.clone())).map(|_| ())
    }

    fn example(&self) -> Option<&'static str> {
        Some("detector(\"network.onnx\", colours = \"bgr\", white = 255, logits = true)")
    }
}
