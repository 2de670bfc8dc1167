//! The meshes of a posed body, by part. A pose shares the mesh of each part that moves as
//! in the pose before it; renderers draw shared meshes once.

use super::body::{Armature, Part};
use super::{JointPose, Keypoint, PosedBody, Rules};
use crate::geom::{GeomError, Instance, Landmark, Solid};
use glam::{Affine3A, DAffine3};
use std::sync::{Arc, OnceLock};

/// A pose's transforms and meshes, from which the next pose starts. Meshes are made when
/// they are needed.
#[derive(Debug)]
pub struct Posed(Arc<Pose>);

#[derive(Debug)]
struct Pose {
    body: Arc<Armature>,
    transforms: Arc<[Affine3A]>,
    parts: OnceLock<Vec<Instance>>,
}

/// The bits that identify a transform. Equal numbers do not suffice: 0 and -0 can produce
/// results that differ in the sign of zeros.
fn bits(t: &Affine3A) -> [u32; 12] {
    t.to_cols_array().map(f32::to_bits)
}

impl Pose {
    /// The mesh of each part; those that moved in the same way in `before` are its.
    fn parts(&self, before: Option<&Pose>) -> &[Instance] {
        self.parts.get_or_init(|| {
            let before = before.and_then(|b| b.parts.get().map(|parts| (&b.transforms, parts)));
            let make = |(i, part): (usize, &Part)| {
                let moved = |t: &[Affine3A], j: &u16| t.get(usize::from(*j)).map(bits);
                let same = before.and_then(|(transforms, parts)| {
                    let mut joints = part.joints.iter();
                    let same = joints.all(|j| moved(transforms, j) == moved(&self.transforms, j));
                    parts.get(i).filter(|_| same).cloned()
                });
                same.unwrap_or_else(|| self.body.skinned(i, &self.transforms))
            };
            self.body.parts().iter().enumerate().map(make).collect()
        })
    }
}

impl Posed {
    /// A pose of a body, and the maker of its meshes. Of the pose before, only meshes that
    /// are already made are used, so that no chain of poses is kept.
    pub(super) fn new(
        body: &Arc<Armature>,
        transforms: Arc<[Affine3A]>,
        before: Option<&Posed>,
    ) -> (Posed, impl FnOnce() -> Vec<Instance> + Send + 'static) {
        let is_made = |b: &&Posed| Arc::ptr_eq(&b.0.body, body) && b.0.parts.get().is_some();
        let before = before.filter(is_made).map(|b| Arc::clone(&b.0));
        let pose = Pose { body: Arc::clone(body), transforms, parts: OnceLock::new() };
        let pose = Arc::new(pose);
        let own = Arc::clone(&pose);
        (Posed(pose), move || own.parts(before.as_deref()).to_vec())
    }
}

impl Armature {
    /// Returns the body in a pose: one instance per part, numbered by joint, and the
    /// keypoints as landmarks.
    ///
    /// # Errors
    /// A pose that is not finite, or that moves vertices beyond the range of single
    /// precision.
    pub fn posed(self: &Arc<Self>, pose: &[JointPose], rules: &Rules) -> Result<Solid, GeomError> {
        self.posed_after(pose, rules, None).map(|(solid, _)| solid)
    }

    /// As [`Armature::posed`], from a pose before, whose meshes are shared by the parts that
    /// move as in it.
    ///
    /// # Errors
    /// As [`Armature::posed`].
    pub fn posed_after(
        self: &Arc<Self>,
        pose: &[JointPose],
        rules: &Rules,
        before: Option<&Posed>,
    ) -> Result<(Solid, Posed), GeomError> {
        let transforms: Arc<[DAffine3]> = self.rig().transforms(pose, rules)?.into();
        let single: Arc<[Affine3A]> = transforms.iter().map(DAffine3::as_affine3a).collect();
        if !single.iter().all(|t| t.is_finite()) {
            return Err(GeomError::domain("the pose moves the body too far away"));
        }
        let (posed, parts) = Posed::new(self, single, before);
        let (body, of) = (Arc::clone(self), Arc::clone(&transforms));
        let landmarks = move || -> Arc<[Landmark]> {
            let landmark = |k: &Keypoint| Landmark {
                name: Arc::clone(&k.name),
                position: of[k.joint].transform_point3(k.rest),
            };
            body.rig().keypoints().iter().map(landmark).collect()
        };
        let posed_body = PosedBody::new(Arc::clone(self), transforms);
        let solid = Solid::of_parts(parts).with_body(posed_body);
        // A rig's keypoints have different names; `#` starts the numbers of others.
        let solid = match self.rig().keypoints().iter().any(|k| k.name.contains('#')) {
            true => solid.with_landmarks_of(move || landmarks().to_vec()),
            false => solid.with_distinct_landmarks_of(landmarks),
        };
        Ok((solid, posed))
    }
}
