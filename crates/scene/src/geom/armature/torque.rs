//! The vector-Jacobian product of posing by rotation vectors: accumulates forces on
//! points into torques about joints, in time linear in the number of joints.
//! [`Rig::transforms_vjp`] is the general method, for any pose.

use super::{Armature, JointPose, RestGradient, Rules, Turn};
use crate::geom::GeomError;
use glam::{DAffine3, DMat3, DVec3};

/// Derivatives with respect to the inputs of posing.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyGradient {
    /// With respect to each joint's rotation vector.
    pub turns: Vec<DVec3>,
    /// With respect to the body at rest.
    pub rest: RestGradient,
}

impl Armature {
    /// The vector-Jacobian product of [`Armature::posed`] for rotation vectors, given the
    /// derivatives with respect to the posed keypoints (empty if nothing depends on them) and
    /// vertices. `None` if the pose has anything but rotation vectors, or if scales are
    /// inherited. `joints` are the transforms of the pose, if they are known.
    ///
    /// # Errors
    /// A pose that is not finite.
    pub fn vjp_posed(
        &self,
        pose: &[JointPose],
        rules: &Rules,
        by_keypoint: &[DVec3],
        by_vertex: &[(u32, DVec3)],
        joints: Option<&[DAffine3]>,
    ) -> Result<Option<BodyGradient>, GeomError> {
        let rig = self.rig();
        let plain = |p: &JointPose| {
            p.location == DVec3::ZERO && p.scale == DVec3::ONE && vector(p).is_some()
        };
        if rules.inherit_scale || !pose.iter().all(plain) {
            return Ok(None);
        }
        let count = rig.joints().len();
        let made: Vec<DAffine3>;
        let transforms = match joints.filter(|joints| joints.len() == count) {
            Some(joints) => joints,
            None => {
                made = rig.transforms(pose, rules)?;
                &made
            }
        };
        let back = |joint: usize, g: DVec3| transforms[joint].matrix3.transpose() * g;
        let points = rig.keypoints().iter().zip(by_keypoint);
        let keypoints = points.map(|(k, g)| back(k.joint, *g)).collect();
        let vertex = |(v, g): &(u32, DVec3)| {
            Some((*v, self.vertex(*v)?.1.joints().map(|(j, w)| back(j, *g * w)).sum()))
        };
        let vertices = by_vertex.iter().filter_map(vertex).collect();
        // For each joint, sums over everything attached to it: the derivatives (forces),
        // and p x g (torques about the origin), p being linear in the point at rest.
        let by_transform = self.transforms_gradient(by_vertex, by_keypoint);
        let mut force: Vec<DVec3> = by_transform.iter().map(|by| by.translation).collect();
        let about = |(t, by): (&DAffine3, &DAffine3)| {
            let axes = (0..3).map(|k| t.matrix3.col(k).cross(by.matrix3.col(k)));
            axes.sum::<DVec3>() + t.translation.cross(by.translation)
        };
        let mut torque: Vec<DVec3> = transforms.iter().zip(&by_transform).map(about).collect();
        let (mut turns, mut heads) = (vec![DVec3::ZERO; count], vec![DVec3::ZERO; count]);
        for j in (0..count).rev() {
            let joint = &rig.joints()[j];
            let (f, t) = (force[j], torque[j]);
            let up = joint.parent.map_or(DMat3::IDENTITY, |p| transforms[p].matrix3);
            // The parent determines the head's position; the joint's own rotation leaves
            // it fixed.
            let pivot = transforms[j].transform_point3(joint.head);
            let local = up.transpose() * (t - pivot.cross(f));
            turns[j] = transposed_left_jacobian(
                pose.get(j).and_then(vector).unwrap_or(DVec3::ZERO),
                local,
            );
            // x -> R (x - h) + h.
            heads[j] = (up.transpose() - transforms[j].matrix3.transpose()) * f;
            if let Some(p) = joint.parent {
                force[p] += f;
                torque[p] += t;
            }
        }
        let rest = RestGradient { heads, tails: vec![DVec3::ZERO; count], keypoints, vertices };
        Ok(Some(BodyGradient { turns, rest }))
    }
}

fn vector(p: &JointPose) -> Option<DVec3> {
    match p.turn {
        Turn::Vector(v) => Some(v),
        _ => None,
    }
}

/// Returns J' t, where exp(w + dw) = exp(J dw) exp(w): J = I + a [w]x + b [w]x^2 with a =
/// (1 - cos |w|) / |w|^2, b = (|w| - sin |w|) / |w|^3.
fn transposed_left_jacobian(w: DVec3, t: DVec3) -> DVec3 {
    let square = w.length_squared();
    let angle = square.sqrt();
    let (a, b) = if angle < 1e-3 {
        // Taylor series; the omitted terms are below double precision.
        (
            0.5 - square / 24.0 + square * square / 720.0,
            1.0 / 6.0 - square / 120.0 + square * square / 5040.0,
        )
    } else {
        ((1.0 - libm::cos(angle)) / square, (angle - libm::sin(angle)) / (square * angle))
    };
    let c = w.cross(t);
    t - c * a + w.cross(c) * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_left_jacobian_is_that_of_differences() {
        for w in [
            DVec3::ZERO,
            DVec3::new(1e-5, 2e-4, -1e-4),
            DVec3::new(0.3, -1.2, 0.5),
            DVec3::new(2.0, 1.0, -2.5),
        ] {
            let (x, g) = (DVec3::new(0.3, -0.4, 1.1), DVec3::new(0.7, 0.2, -0.6));
            let f = |w: DVec3| (glam::DQuat::from_scaled_axis(w) * x).dot(g);
            let torque = (glam::DQuat::from_scaled_axis(w) * x).cross(g);
            let found = transposed_left_jacobian(w, torque);
            for (axis, found) in DVec3::AXES.into_iter().zip(found.to_array()) {
                let slope = (f(w + axis * 1e-5) - f(w - axis * 1e-5)) / 2e-5;
                assert!((found - slope).abs() < 1e-8, "{w}: {found} {slope}");
            }
        }
    }
}
