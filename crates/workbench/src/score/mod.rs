//! Errors of answers with respect to the ground truth: surfaces, joints, posteriors.
//!
//! This module computes with numbers only: it has no files or traces and prints nothing.
//! Every error is zero for the ground truth. Errors that are averaged over cases are also
//! defined for missing answers, which cost as much as an answer that is entirely in the
//! wrong place. An answer can be worse than a missing one.

mod joints;
mod posterior;
mod surface;

pub use joints::{JointsError, JointsTruth};
pub use posterior::{Normal, Reference};
pub use surface::{Surface, SurfaceError, SurfaceTruth};
