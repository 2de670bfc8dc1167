//! Errors of pictures and arrays of pixels. Messages describe the faulty input in the
//! user's terms.

/// An error of reading or comparing pictures.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VisionError {
    /// The file could not be read.
    #[error("cannot read the file: {0}")]
    Io(#[from] std::io::Error),
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// The bytes are not those of a PNG or JPEG picture.
    #[error("not a picture: the file does not start like a PNG or JPEG file{0}")]
    NotAnImage(&'static str),
    /// The picture ends early.
    #[error("the picture is truncated: the file ends before the last pixel")]
    Truncated,
    /// The picture cannot be decoded.
    #[error("the picture is damaged or its format is not supported: {0}")]
    Damaged(String),
    /// The picture is larger than allowed.
    #[error(
        "the picture is too large: {width} x {height} pixels; at most {max_side} per side and \
             {max_pixels} in total"
    )]
    TooLarge {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// The longest side allowed, pixels.
        max_side: u32,
        /// The most pixels allowed.
        max_pixels: u64,
    },
    /// A `.npy` file that cannot be used.
    #[error("not a usable .npy array: {0}")]
    Npy(String),
    /// An unusable contour detector file, or a detector that failed on a picture.
    #[error("{0}")]
    Detector(String),
    /// Something pointed out in a photograph that cannot be there.
    #[error("{0}")]
    Hint(String),
    /// A picture that the camera's lens cannot have taken.
    #[error(
        "the camera is of a picture of {} x {} pixels, this one has {} x {}: the proportions differ",
        lens.0, lens.1, picture.0, picture.1
    )]
    Lens {
        /// Width and height of the pictures of the lens.
        lens: (u32, u32),
        /// Width and height of the picture.
        picture: (u32, u32),
    },
    /// Two pictures that must have the same size do not.
    #[error("sizes differ: expected {expected_width} x {expected_height} pixels, got {got}")]
    Size {
        /// Width expected, pixels.
        expected_width: u32,
        /// Height expected, pixels.
        expected_height: u32,
        /// The actual size.
        got: String,
    },
    /// A parameter or value out of its range.
    #[error("{name} must be {rule}, not {value}")]
    Range {
        /// Name of the parameter or value.
        name: &'static str,
        /// The allowed range.
        rule: &'static str,
        /// The actual value.
        value: f64,
    },
}

impl VisionError {
    /// An error of differing sizes.
    pub(crate) fn size(expected_width: u32, expected_height: u32, got: impl Into<String>) -> Self {
        VisionError::Size { expected_width, expected_height, got: got.into() }
    }
}
