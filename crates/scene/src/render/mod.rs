//! Drawing on the CPU: cameras, depth frames, contours, and simple shaded pictures.
//!
//! Meshes and transforms are in `geom`, the comparison of pictures in `vision`. Nothing
//! in this module draws random numbers, and the same input gives the same output on every
//! machine.

mod camera;
mod canvas;
mod derivatives;
mod image_bounds;
mod lines;
mod pixels;
mod revolution;
mod view;
mod work;

#[cfg(test)]
mod extremes_tests;
#[cfg(test)]
mod testing;
#[cfg(test)]
pub(crate) use testing::cases;

use pcadlang_numerics::num::simd;

pub use crate::contours::{ContourChange, ContourSlice, Contours};
pub use camera::{Camera, CameraError, Projection};
pub use pixels::frame::{Channels, Frame};
pub use pixels::shade::shade;
pub use view::{Channel, View};
pub use work::{Work, work};
