//! How far an answer is from a known truth: surfaces, joints, posteriors.
//!
//! Numbers only: no files, no traces, nothing printed. Every error is zero for the truth itself, and finite for any answer at all: an
//! answer that says nothing costs what the worst of its kind does, so that errors can be averaged.

mod joints;
mod posterior;
mod surface;

pub use joints::{JointsError, JointsTruth};
pub use posterior::{Normal, Reference};
pub use surface::{Surface, SurfaceError, SurfaceTruth};
