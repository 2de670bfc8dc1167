//! Why a picture cannot be used.

/// A picture that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VisionError {
    /// There is nothing in the file.
    #[error("the file is empty")]
    Empty,
    /// It is not a picture of a kind that can be read.
    #[error("not a picture that can be read: PNG and JPEG files can")]
    NotAnImage,
    /// It is a picture, but damaged or cut off.
    #[error("the picture is damaged: {0}")]
    Damaged(String),
    /// It has more pixels than is allowed.
    #[error("the picture has {width} x {height} pixels; at most {side} a side and {megapixels} megapixels can be read")]
    TooLarge {
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// The longest side allowed.
        side: u32,
        /// The most megapixels allowed.
        megapixels: u64,
    },
    /// An array file that is not as expected.
    #[error("{0}")]
    Array(String),
}
