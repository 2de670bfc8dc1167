//! Drawing on the CPU: cameras, depth frames, contours, and simple shaded pictures.
//!
//! Meshes and transforms are in `geom`, the comparison of pictures in `vision`. Nothing
//! in this module draws random numbers, and the same input gives the same output on every
//! machine.

mod backdrop;
mod batch;
mod camera;
mod camera_json;
mod candidates;
mod contours;
mod coverage;
mod crossing;
mod detail;
mod extraction;
mod frame;
mod junctions;
mod layers;
mod outline;
mod pixel_bitmap;
mod place;
mod project;
mod raster;
mod shade;
mod silhouette;
mod silhouette_derivative;
mod simd_raster;
mod sparse_depth;
mod surface;
mod triangle;
mod view;
mod visibility;
mod vjp;
mod work;

#[cfg(test)]
mod extremes_tests;
#[cfg(test)]
mod testing;

use pcadlang_numerics::num::simd;

pub use backdrop::Change;
pub use batch::{BatchRenderer, ContourBatch, ContourSlice, Cores, Scene};
pub use camera::{Camera, CameraError, Projection};
pub use contours::Contours;
pub use frame::{Channels, Frame};
pub use shade::shade;
pub use view::View;
pub use work::{Work, work};
