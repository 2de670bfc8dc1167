//! The parameters of a forest, and the sizes that follow from them.

/// The parameters of a forest: sizes in pixels, and the computation of its features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForestOptions {
    /// Distance from one patch to the next in pixels.
    pub stride: usize,
    /// Factor by which features are smaller than the picture.
    pub shrink: usize,
    /// The side of the patches that trees read.
    pub patch: usize,
    /// The side of the central part that trees predict.
    pub inner: usize,
    /// Number of gradient orientations.
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
    /// Number of positions along each side of a patch whose features are compared.
    pub grid: usize,
    /// The number of trees.
    pub trees: usize,
    /// Number of trees that are evaluated per patch.
    pub evaluated: usize,
}

impl ForestOptions {
    /// Number of features of a pixel: three of colour, and at two scales the gradient's
    /// magnitude and its parts by direction.
    pub(super) fn channels(&self) -> usize {
        2 * (self.orientations + 1) + 3
    }

    /// The side of a patch in pixels of the features.
    pub(super) fn cells(&self) -> usize {
        self.patch / self.shrink
    }

    /// Number of features that are used individually.
    pub(super) fn plain(&self) -> usize {
        self.cells() * self.cells() * self.channels()
    }

    /// Number of differences of features between two positions of the grid.
    pub(super) fn pairs(&self) -> usize {
        let places = self.grid * self.grid;
        places * places.saturating_sub(1) / 2 * self.channels()
    }
}
