//! How far an answer is from a known truth: surfaces, joints, posteriors.
//!
//! Numbers only: no files, no traces, nothing printed. Every error is zero for the truth
//! itself, and known for answers that say nothing, too: that costs as much as all of it
//! in the wrong place, so that errors can be averaged. Answers may be worse than none.

mod joints;
mod posterior;
mod surface;

pub use joints::{JointsError, JointsTruth};
pub use posterior::{Normal, Reference};
pub use surface::{Surface, SurfaceError, SurfaceTruth};
