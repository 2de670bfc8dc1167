//! Pictures and maps: reading, colours, sizes.

pub mod color;
pub mod contour_map;
mod exif;
pub(crate) mod floats;
pub mod npy;
pub(crate) mod palette;
pub mod photo;
