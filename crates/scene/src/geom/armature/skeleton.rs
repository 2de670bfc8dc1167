//! Bodies as they stand in a scene: where each joint is and how it is turned, as programs for
//! animation have it.

use super::{Armature, Pose};
use crate::geom::Affine;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::sync::Arc;

/// A body in a pose, and its place in the scene.
#[derive(Clone, Debug)]
pub struct PosedBody {
    /// The body.
    pub body: Arc<Armature>,
    /// The transform of points at rest of each joint, in rig order.
    pub joints: Arc<[DAffine3]>,
    /// Where the posed body is placed.
    pub place: Affine,
    /// Its surface.
    pub(crate) pose: Arc<Pose>,
}

/// A joint of a posed body. A chain of bones has it at `head` exactly: from the parent's head,
/// `offset` turned by the parent's `world`.
#[derive(Clone, Debug, PartialEq)]
pub struct Bone {
    /// The joint's name.
    pub name: Arc<str>,
    /// The index of its parent.
    pub parent: Option<usize>,
    /// Where it is.
    pub head: DVec3,
    /// Where its bone ends.
    pub tail: DVec3,
    /// From the parent's head to this one, in the parent's rotation; of a root, its head.
    pub offset: DVec3,
    /// From the head to the tail, in the joint's rotation.
    pub end: DVec3,
    /// The rotation from the world's axes at rest. Where a joint is scaled or sheared, the
    /// nearest rotation.
    pub world: DMat3,
    /// The rotation in that of the parent.
    pub local: DMat3,
}

impl PosedBody {
    /// A body that has not been placed.
    pub(super) fn new(pose: Arc<Pose>, joints: Arc<[DAffine3]>) -> PosedBody {
        PosedBody { body: Arc::clone(&pose.body), joints, place: Affine::IDENTITY, pose }
    }

    /// What returns a vertex of the posed parts' meshes, by its number, in the scene.
    pub(crate) fn vertices(&self) -> impl Fn(u32) -> Option<DVec3> {
        let (numbers, positions) = (&self.body.whole().of_parts[..], self.pose.positions(None));
        move |number| {
            let at = *numbers.get(number as usize)?;
            Some(self.place.point(positions.get(at as usize)?.as_dvec3()))
        }
    }

    /// Returns the joints in rig order, in the scene's axes, with lengths in scene units.
    pub fn bones(&self) -> Vec<Bone> {
        let mut bones: Vec<Bone> = Vec::with_capacity(self.joints.len());
        for (joint, own) in self.body.rig().joints().iter().zip(self.joints.iter()) {
            let to = self.place.0 * *own;
            let (head, tail) = (to.transform_point3(joint.head), to.transform_point3(joint.tail));
            let up = joint.parent.and_then(|p| bones.get(p));
            let turned = up.map_or(DMat3::IDENTITY, |up| up.world);
            let world = nearest_rotation(to.matrix3).unwrap_or(turned);
            let offset = up.map_or(head, |up| up.world.transpose() * (head - up.head));
            bones.push(Bone {
                name: Arc::clone(&joint.name),
                parent: joint.parent,
                head,
                tail,
                offset,
                end: world.transpose() * (tail - head),
                world,
                local: turned.transpose() * world,
            });
        }
        bones
    }

    /// Returns where the rig's named points are in the scene.
    pub fn keypoints(&self) -> impl Iterator<Item = (&str, DVec3)> {
        let at =
            |rest: DVec3, joint: usize| self.place.point(self.joints[joint].transform_point3(rest));
        self.body.rig().keypoints().iter().map(move |k| (&*k.name, at(k.rest, k.joint)))
    }
}

/// Returns the rotation vector of a rotation: the axis times the angle, 0 to pi.
pub fn rotation_vector(m: DMat3) -> DVec3 {
    let q = quaternion(m);
    let half = q.xyz().length();
    // The limit of angle / sin(angle / 2) where there is no axis.
    q.xyz() * if half > 1e-12 { 2.0 * libm::atan2(half, q.w) / half } else { 2.0 }
}

/// Returns the quaternion of a rotation whose real part is not negative.
pub fn quaternion(m: DMat3) -> DQuat {
    let q = DQuat::from_mat3(&m).normalize();
    if q.w < 0.0 { -q } else { q }
}

/// Returns the rotation nearest to a matrix (of a matrix that mirrors, to its negative): the
/// orthogonal factor of the polar decomposition, by Newton's iteration (N. J. Higham 1986,
/// "Computing the polar decomposition", SIAM J. Sci. Stat. Comput. 7(4)). `None` if the matrix
/// is singular.
fn nearest_rotation(m: DMat3) -> Option<DMat3> {
    let size = m.to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let m = m * (1.0 / size);
    let det = m.determinant();
    if det.is_nan() || det.abs() <= 1e-12 {
        return None;
    }
    let mut x = m * (1.0 / libm::cbrt(det));
    for _ in 0..60 {
        let next = (x + x.inverse().transpose()) * 0.5;
        let moved =
            (next - x).to_cols_array().into_iter().fold(0.0, |most: f64, d| most.max(d.abs()));
        x = next;
        if moved < 1e-15 {
            break;
        }
    }
    x.is_finite().then_some(x)
}
