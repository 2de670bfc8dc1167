//! Which detector the bytes of a file are.

use crate::forest::Forest;
use crate::onnx::Network;
use crate::options::NetworkOptions;
use pcadlang_scene::vision::{ContourDetector, VisionError};
use std::sync::Arc;

/// Reads a detector from the bytes of its file. The options apply to networks.
///
/// # Errors
/// If the kind of file is unknown, the file is damaged, or the options do not fit the
/// detector.
pub fn read(
    bytes: &[u8],
    options: &NetworkOptions,
) -> Result<Arc<dyn ContourDetector>, VisionError> {
    if Forest::is_forest(bytes) {
        if *options != NetworkOptions::default() {
            return Err(VisionError::Detector("a structured forest has no options".into()));
        }
        return Ok(Arc::new(Forest::read(bytes)?));
    }
    if let Some(why) = options.wrong() {
        return Err(VisionError::Detector(why.into()));
    }
    match looks_like_onnx(bytes) {
        true => Ok(Arc::new(Network::read(bytes, options)?)),
        false if bytes.is_empty() => Err(VisionError::Empty),
        false => Err(VisionError::Detector(
            "neither a structured forest (OpenCV's model.yml or model.yml.gz) nor a network (ONNX)"
                .into(),
        )),
    }
}

/// ONNX files are protocol buffers without a magic number. All begin with a field of the
/// model: its version (8), its producer (0x12), its graph (0x3a), or its operator sets
/// (0x42). The last two are letters, so a control character must follow soon.
fn looks_like_onnx(bytes: &[u8]) -> bool {
    match bytes {
        [0x08 | 0x12, _, ..] => true,
        [0x3a | 0x42, rest @ ..] => rest.iter().take(8).any(|b| *b < 0x09),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(bytes: &[u8], options: &NetworkOptions) -> String {
        read(bytes, options).unwrap_err().to_string()
    }

    #[test]
    fn files_are_told_apart() {
        let plain = NetworkOptions::default();
        assert_eq!(error(b"", &plain), "the file is empty");
        assert!(error(b"\x89PNG\r\n", &plain).starts_with("neither a structured forest"));
        assert!(error(b"Breakfast", &plain).starts_with("neither a structured forest"));
        assert!(error(b"%YAML:1.0\n", &plain).contains("there are no `options`"));
        assert!(error(b"\x1f\x8b", &plain).contains("line 1"));
        assert_eq!(
            error(b"%YAML:1.0", &NetworkOptions { bgr: true, ..NetworkOptions::default() }),
            "a structured forest has no options"
        );
        let bad = NetworkOptions { spread: [1.0, 0.0, 1.0], ..NetworkOptions::default() };
        assert_eq!(error(b"\x08\x07", &bad), "`spread` must be above 0");
    }
}
