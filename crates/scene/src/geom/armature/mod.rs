//! Armatures: trees of joints that move a mesh, as in Kulkarni et al. 2014, section
//! 2.1.2.

mod body;
pub mod bvh;
mod kinematics;
mod morph;
mod pose;
mod posed;
mod rig;
mod rig_json;
mod skeleton;
mod stretch;
mod torque;
mod whole;

pub use body::{Armature, Influence, MOST_WEIGHTS, RestGradient};
pub use kinematics::JointGradient;
pub use morph::Morph;
pub use pose::{JointPose, Rules, Turn};
pub(crate) use posed::Pose;
pub use posed::Posed;
pub use rig::{Joint, Keypoint, MOST_JOINTS, NamedJoint, Rig};
pub use rig_json::{RigFile, morphs_from_json, rig_from_json};
pub use skeleton::{Bone, PosedBody, quaternion, rotation_vector};
pub use stretch::Stretch;
pub use torque::BodyGradient;
pub(crate) use whole::{Stretch as SurfaceStretch, Whole};
