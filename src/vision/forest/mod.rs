//! Structured forests (Dollár & Zitnick 2013, "Structured forests for fast edge
//! detection", ICCV, 1841-1848): decision trees that look at patches of 32 x 32 pixels
//! and say where edges run in their middle 16 x 16; what the trees say of overlapping
//! patches is averaged. Read from the files of OpenCV (`model.yml.gz`); there is no
//! training here.
//!
//! The same numbers as from OpenCV's code for pictures whose sides are multiples of 4;
//! others are padded to that, as the authors' own code does, where OpenCV resamples by
//! odd factors.

mod features;
mod read;
mod trees;
mod yaml;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod writer;

use super::VisionError;
use super::photo::Photo;
use super::resize::fitted;
use super::soft_map::{Shows, SoftMap};
use features::Features;
use std::fmt;

/// What a forest says of itself: sizes in pixels, and how its features are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForestOptions {
    /// Pixels from one patch to the next.
    pub stride: usize,
    /// By how much features are smaller than the picture.
    pub shrink: usize,
    /// The side of what trees look at.
    pub patch: usize,
    /// The side of what they say something of.
    pub inner: usize,
    /// How many directions of gradients are told apart.
    pub orientations: usize,
    /// The radius of the smoothing before gradients are taken.
    pub gradient_smoothing: usize,
    /// The radius of the smoothing of features, in pixels of the picture.
    pub smoothing: usize,
    /// The radius of the smoothing of features that are compared with each other, in
    /// pixels of the picture.
    pub similarity_smoothing: usize,
    /// The radius within which gradients are normalised.
    pub normalization: usize,
    /// Places along each side of a patch whose features are compared.
    pub grid: usize,
    /// The number of trees.
    pub trees: usize,
    /// How many of them look at a patch.
    pub evaluated: usize,
}

impl ForestOptions {
    /// Features of a pixel: three of colour, and at two scales the gradient's magnitude
    /// and its parts by direction.
    fn channels(&self) -> usize {
        2 * (self.orientations + 1) + 3
    }

    /// The side of a patch in pixels of the features.
    fn cells(&self) -> usize {
        self.patch / self.shrink
    }

    /// Features that are looked at by themselves.
    fn plain(&self) -> usize {
        self.cells() * self.cells() * self.channels()
    }

    /// Differences of features at two places of the grid.
    fn pairs(&self) -> usize {
        let places = self.grid * self.grid;
        places * places.saturating_sub(1) / 2 * self.channels()
    }
}

/// One node of a tree; the first child has a larger number than its parent, so every way
/// down ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    /// The feature that is looked at.
    feature: u32,
    /// Below this it goes on at the left child.
    threshold: f32,
    /// The left child; the right one is the next. 0: a leaf.
    left: u32,
}

/// A structured forest.
#[derive(Clone, PartialEq)]
pub struct Forest {
    options: ForestOptions,
    /// The nodes of all trees, each tree as many.
    nodes: Vec<Node>,
    /// Where the edge pixels of each node begin, and behind the last one where they end.
    begins: Vec<u32>,
    /// Edge pixels, column by column from the upper left of a patch's middle.
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
    /// Reads OpenCV's text (`model.yml`), or the same compressed by gzip
    /// (`model.yml.gz`).
    ///
    /// # Errors
    /// If it is no such text, or a forest that cannot be used: children before their
    /// parents, features that there are none of.
    pub fn read(bytes: &[u8]) -> Result<Forest, VisionError> {
        read::forest(bytes).map_err(VisionError::Detector)
    }

    /// Whether bytes begin as such files do.
    pub fn is_forest(bytes: &[u8]) -> bool {
        read::is_gzip(bytes) || bytes.starts_with(b"%YAML")
    }

    /// What the forest says of itself.
    pub fn options(&self) -> &ForestOptions {
        &self.options
    }

    /// How likely each pixel of a photograph is to be on an edge, worked out at a longer
    /// side of at most `size` pixels.
    pub fn map(&self, photo: &Photo, size: u32) -> SoftMap {
        let (width, height) = fitted(photo.width(), photo.height(), size);
        let small = photo.srgb(width, height);
        let features = Features::of(&small, width as usize, height as usize, &self.options);
        let values = trees::edges(self, &features, width as usize, height as usize);
        SoftMap { width, height, values, shows: Shows::Contours }
    }
}
