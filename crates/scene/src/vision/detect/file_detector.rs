//! Contour detectors read from files: structured forests and, with the feature `onnx`,
//! networks.

use crate::vision::VisionError;
use crate::vision::detect::detector::ContourDetector;
use crate::vision::detect::forest::Forest;
pub use crate::vision::detect::network_options::{NetworkOptions, Output};
#[cfg(feature = "onnx")]
use crate::vision::detect::onnx::Network;
use crate::vision::detect::soft_map::{Shows, SoftMap};
use crate::vision::pictures::contour_map::ContourMap;
use crate::vision::pictures::photo::Photo;
use crate::vision::pictures::resize::fitted;

/// A detector that was read from a file. Computing the map of a photograph is slow, and
/// extracting contours from the map is fast: to try several settings, keep the map.
#[derive(Debug)]
pub struct FileDetector(Kind);

#[derive(Debug)]
enum Kind {
    Forest(Forest),
    #[cfg(feature = "onnx")]
    Network(Box<Network>),
}

impl FileDetector {
    /// The default longer side of the picture that the detector works on, pixels.
    pub const SIZE: u32 = 512;
    /// The maximum longer side of the picture that the detector works on, pixels.
    pub const MOST: u32 = 2048;

    /// Reads a detector from the bytes of its file. The options apply to networks.
    ///
    /// # Errors
    /// If the kind of file is unknown, the file is damaged or needs a feature that this
    /// build lacks, or the options do not fit the detector.
    pub fn read(bytes: &[u8], options: &NetworkOptions) -> Result<FileDetector, VisionError> {
        if Forest::is_forest(bytes) {
            if *options != NetworkOptions::default() {
                return Err(VisionError::Detector("a structured forest has no options".into()));
            }
            return Ok(FileDetector(Kind::Forest(Forest::read(bytes)?)));
        }
        if let Some(why) = options.wrong() {
            return Err(VisionError::Detector(why.into()));
        }
        match looks_like_onnx(bytes) {
            true => network(bytes, options),
            false if bytes.is_empty() => Err(VisionError::Empty),
            false => Err(VisionError::Detector(
                "neither a structured forest (OpenCV's model.yml or model.yml.gz) nor a network (ONNX)".into(),
            )),
        }
    }

    /// Computes the map of a photograph. Forests, and networks that accept any size, work
    /// at a longer side of at most `size` pixels; other networks work at their own size.
    ///
    /// # Errors
    /// If a network fails while it runs, or does not return a map.
    pub fn map(&self, photo: &Photo, size: u32) -> Result<SoftMap, VisionError> {
        let size = size.clamp(1, FileDetector::MOST);
        match &self.0 {
            Kind::Forest(forest) => Ok(forest.map(photo, size)),
            #[cfg(feature = "onnx")]
            Kind::Network(network) => network.map(photo, size),
        }
    }

    /// Returns the contours in a map of a photograph after smoothing by `sigma` pixels,
    /// scaled to the photograph's aspect ratio.
    pub fn contours(&self, map: &SoftMap, photo: &Photo, sigma: f32) -> ContourMap {
        let found = map.contours(sigma);
        let shape = fitted(photo.width(), photo.height(), map.width.max(map.height));
        if shape == (map.width, map.height) { found } else { found.scaled_to(shape.0, shape.1) }
    }

    /// The default smoothing of its maps, pixels of the map.
    pub fn sigma(&self) -> f32 {
        match self.shows() {
            Shows::Contours => 1.0,
            Shows::Objects => 1.6,
        }
    }

    /// The default threshold on the strength of contours, in 0..=1.
    pub fn strength(&self) -> f32 {
        match &self.0 {
            // Edges whose presence all trees agree on, but not their exact position, are
            // about this strong; few pixels come close to 1.
            Kind::Forest(_) => 0.1,
            // HED's best threshold against human outlines is 0.65; a few more edges help
            // where the object is dim.
            #[cfg(feature = "onnx")]
            Kind::Network(_) => 0.5,
        }
    }

    fn shows(&self) -> Shows {
        match &self.0 {
            Kind::Forest(_) => Shows::Contours,
            #[cfg(feature = "onnx")]
            Kind::Network(network) => network.shows(),
        }
    }
}

impl ContourDetector for FileDetector {
    fn detect(&self, photo: &Photo) -> Result<ContourMap, VisionError> {
        Ok(self.contours(&self.map(photo, FileDetector::SIZE)?, photo, self.sigma()))
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

#[cfg(feature = "onnx")]
fn network(bytes: &[u8], options: &NetworkOptions) -> Result<FileDetector, VisionError> {
    Network::read(bytes, options).map(|n| FileDetector(Kind::Network(Box::new(n))))
}

#[cfg(not(feature = "onnx"))]
fn network(_: &[u8], _: &NetworkOptions) -> Result<FileDetector, VisionError> {
    Err(VisionError::Detector(
        "this build cannot run networks (ONNX): it was made without the feature `onnx`; build it \
         with `cargo install --path . --features onnx`"
            .into(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(bytes: &[u8], options: &NetworkOptions) -> String {
        FileDetector::read(bytes, options).unwrap_err().to_string()
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
        #[cfg(not(feature = "onnx"))]
        assert!(error(b"\x08\x07", &plain).contains("--features onnx"));
    }
}
