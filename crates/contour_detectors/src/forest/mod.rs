//! Structured forests (Dollár & Zitnick 2013, "Structured forests for fast edge
//! detection", ICCV, 1841-1848): decision trees that read patches of 32 x 32 pixels and
//! predict the edges in their central 16 x 16; predictions of overlapping patches are
//! averaged. Forests are read from OpenCV's files (`model.yml.gz`); there is no training
//! here.
//!
//! The result equals that of OpenCV's code for pictures whose sides are multiples of 4.
//! Other pictures are padded to such sides, as in the authors' own code; OpenCV resamples
//! them by non-integer factors.

mod features;
mod options;
mod read;
mod trees;
mod yaml;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod writer;

pub use options::ForestOptions;

use features::Features;
use pcadlang_scene::vision::photo::fitted;
use pcadlang_scene::vision::{ContourDetector, Photo, Shows, SoftMap, VisionError};
use std::fmt;

/// A node of a tree. The first child has a larger index than its parent, so every path
/// ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    /// The feature that is compared.
    feature: u32,
    /// Smaller values lead to the left child.
    threshold: f32,
    /// The left child; the right one is the next node. 0: a leaf.
    left: u32,
}

/// A structured forest.
#[derive(Clone, PartialEq)]
pub struct Forest {
    options: ForestOptions,
    /// The nodes of all trees; all trees have the same number of nodes.
    nodes: Vec<Node>,
    /// Start of the edge pixels of each node in `pixels`, and finally their end.
    begins: Vec<u32>,
    /// Edge pixels, as column-major indices into the central part of a patch.
    pixels: Vec<u16>,
}

impl fmt::Debug for Forest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Forest")
            .field("options", &self.options)
            .field("nodes", &self.nodes.len())
            .finish_non_exhaustive()
    }
}

impl Forest {
    /// Reads OpenCV's YAML (`model.yml`), optionally compressed by gzip (`model.yml.gz`).
    ///
    /// # Errors
    /// If the text is not a forest, or the forest is invalid: children before their
    /// parents, or unknown features.
    pub fn read(bytes: &[u8]) -> Result<Forest, VisionError> {
        read::forest(bytes).map_err(VisionError::Detector)
    }

    /// True if bytes begin like such a file.
    pub fn is_forest(bytes: &[u8]) -> bool {
        read::is_gzip(bytes) || bytes.starts_with(b"%YAML")
    }

    /// The parameters of the forest.
    pub fn options(&self) -> &ForestOptions {
        &self.options
    }

    /// Computes the probability of each pixel of a photograph to be on an edge, at a
    /// longer side of at most `size` pixels.
    pub fn map(&self, photo: &Photo, size: u32) -> SoftMap {
        let (width, height) = fitted(photo.width(), photo.height(), size);
        let small = photo.srgb(width, height);
        let features = Features::of(&small, width as usize, height as usize, &self.options);
        let values = trees::edges(self, &features, width as usize, height as usize);
        SoftMap { width, height, values, shows: Shows::Contours }
    }
}

impl ContourDetector for Forest {
    fn map(&self, photo: &Photo, size: u32) -> Result<SoftMap, VisionError> {
        Ok(Forest::map(self, photo, size))
    }

    fn sigma(&self) -> f32 {
        1.0
    }

    /// Edges whose presence all trees agree on, but not their exact position, are about this
    /// strong; few pixels come close to 1.
    fn strength(&self) -> f32 {
        0.1
    }
}
