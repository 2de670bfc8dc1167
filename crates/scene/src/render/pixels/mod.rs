//! From triangles to pixels: projection, coverage, depth, shading.

pub(in crate::render) mod area;
pub(in crate::render) mod body_outline;
pub(in crate::render) mod candidates;
pub(in crate::render) mod coverage;
pub(in crate::render) mod fractions;
pub(in crate::render) mod frame;
pub(in crate::render) mod pixel_bitmap;
pub(in crate::render) mod place;
pub(in crate::render) mod project;
pub(in crate::render) mod raster;
pub(in crate::render) mod shade;
pub(in crate::render) mod simd_raster;
pub(in crate::render) mod sparse_depth;
pub(in crate::render) mod triangle;
