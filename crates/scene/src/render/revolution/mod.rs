//! Surfaces of revolution drawn exactly, without a mesh.
//!
//! In the coordinates of the surface, turned about its axis so that the camera lies in the
//! plane z = 0, everything is symmetric in z: each curve is traced on one side of that
//! plane, and its visibility tested there, for both. The placement may be any invertible
//! affine map. The contours are those of the mesh of a lathe as the number of its sides
//! grows.
//!
//! `sight` has the camera and the surface in each other's coordinates, `silhouettes` makes
//! curves (`samples`), `chords` orients their pieces, `rays` decides what is visible, `drawer`
//! puts this together, and `contours` and `frame` are what others call.

mod chords;
mod contours;
mod cover;
mod drawer;
mod frame;
mod lanes;
mod rays;
mod samples;
mod scan;
mod shading;
mod sight;
mod silhouettes;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod view_tests;
