//! The meshes of a posed body, by part. A pose shares the mesh of each part that moves as
//! in the pose before it; renderers draw shared meshes once.

use super::body::{Armature, Part};
use super::{JointPose, Keypoint, PosedBody, Rules};
use crate::geom::{GeomError, Instance, Landmark, Solid};
use glam::{Affine3A, DAffine3, Vec3};
use smallvec::SmallVec;
use std::sync::{Arc, OnceLock};

/// A pose's transforms and meshes, from which the next pose starts. Meshes are made when
/// they are needed.
#[derive(Debug)]
pub struct Posed(Arc<Pose>);

/// A body's surface in a pose, made when it is needed.
#[derive(Debug)]
pub(crate) struct Pose {
    pub body: Arc<Armature>,
    transforms: Arc<[Affine3A]>,
    /// The vertices of the surface as one mesh, before the body is placed.
    positions: OnceLock<Vec<Vec3>>,
    parts: OnceLock<Vec<Instance>>,
}

/// For each part, whether it moves as in another pose.
pub(crate) type Stays = SmallVec<[bool; 64]>;

/// The bits that identify a transform. Equal numbers do not suffice: 0 and -0 can produce
/// results that differ in the sign of zeros.
fn bits(t: &Affine3A) -> [u32; 12] {
    t.to_cols_array().map(f32::to_bits)
}

impl Pose {
    /// Which parts move as in a pose before; none if that is of another body.
    pub fn stays(&self, before: Option<&Pose>) -> Stays {
        let Some(before) = before.filter(|b| Arc::ptr_eq(&b.body, &self.body)) else {
            return SmallVec::from_elem(false, self.body.parts().len());
        };
        let both = self.transforms.iter().zip(before.transforms.iter());
        let same: SmallVec<[bool; 64]> = both.map(|(a, b)| bits(a) == bits(b)).collect();
        let stays = |part: &Part| part.joints.iter().all(|j| same[usize::from(*j)]);
        self.body.parts().iter().map(stays).collect()
    }

    /// The vertices of the surface as one mesh, before the body is placed. If they were not
    /// known, those of parts that move as in `before` are its, if they are known there.
    pub fn positions(&self, before: Option<&Pose>) -> &[Vec3] {
        self.positions.get_or_init(|| {
            let before = before.filter(|before| before.positions.get().is_some());
            let known = before.and_then(|b| b.positions.get()).map_or(&[][..], |all| all);
            let stretches = &self.body.whole().stretches;
            let mut positions = Vec::with_capacity(self.body.whole().order.len());
            for (k, (stretch, stays)) in stretches.iter().zip(self.stays(before)).enumerate() {
                match known.get(stretch.vertices.clone()).filter(|_| stays) {
                    Some(same) => positions.extend_from_slice(same),
                    None => self.body.skin_stretch(k, &self.transforms, &mut positions),
                }
            }
            positions
        })
    }

    /// The mesh of each part; those that moved in the same way in `before` are its.
    fn parts(&self, before: Option<&Pose>) -> &[Instance] {
        self.parts.get_or_init(|| {
            let known = before.and_then(|b| b.parts.get()).map_or(&[][..], |all| all);
            let make = |(i, stays): (usize, bool)| match known.get(i).filter(|_| stays) {
                Some(same) => same.clone(),
                None => self.body.skinned(i, &self.transforms, self.positions(before)),
            };
            self.stays(before).into_iter().enumerate().map(make).collect()
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
        let (positions, parts) = (OnceLock::new(), OnceLock::new());
        let pose = Arc::new(Pose { body: Arc::clone(body), transforms, positions, parts });
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
        let posed_body = PosedBody::new(Arc::clone(&posed.0), transforms);
        let solid = Solid::of_parts(parts).with_body(posed_body);
        // A rig's keypoints have different names; `#` starts the numbers of others.
        let solid = match self.rig().keypoints().iter().any(|k| k.name.contains('#')) {
            true => solid.with_landmarks_of(move || landmarks().to_vec()),
            false => solid.with_distinct_landmarks_of(landmarks),
        };
        Ok((solid, posed))
    }
}
