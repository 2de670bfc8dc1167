//! Body proportions: bones lengthened or shortened at rest, with everything attached to
//! them moved along.

use super::{Armature, Influence, RestGradient, Rig};
use crate::geom::{GeomError, outer};
use glam::{DAffine3, DMat3, DVec3, Vec3};

/// A stretch of a bone's surroundings about its head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stretch {
    /// By a factor along the bone.
    Along(f64),
    /// By factors along the axes, at rest.
    Axes(DVec3),
}

impl Stretch {
    /// Returns the linear map about the origin, for a bone with direction `tail - head`.
    fn linear(self, bone: DVec3) -> DMat3 {
        match self {
            Stretch::Along(f) => {
                let along = bone.normalize_or_zero();
                DMat3::IDENTITY + outer(along, along) * (f - 1.0)
            }
            Stretch::Axes(f) => DMat3::from_diagonal(f),
        }
    }

    fn usable(self) -> bool {
        let one = |f: f64| f > 0.0 && f.is_finite();
        match self {
            Stretch::Along(f) => one(f),
            Stretch::Axes(f) => f.to_array().into_iter().all(one),
        }
    }
}

impl Armature {
    /// Returns the same body with some bones stretched, by joint in rig order. A parent's
    /// stretch moves the heads of its children, a joint's stretch moves its keypoints,
    /// and vertices move by the weighted stretches of their joints.
    ///
    /// # Errors
    /// A joint that does not exist; a factor that is not positive and finite.
    pub fn stretched(&self, by_joint: &[(usize, Stretch)]) -> Result<Armature, GeomError> {
        let maps = maps(self.rig(), by_joint)?;
        let offset = |j: usize, at: DVec3| maps[j].transform_point3(at) - at;
        let joints = || self.rig().joints().iter().enumerate();
        let heads: Vec<DVec3> = joints().map(|(i, j)| offset(i, j.head)).collect();
        let tails: Vec<DVec3> = joints().map(|(i, j)| offset(i, j.tail)).collect();
        let points: Vec<DVec3> =
            self.rig().keypoints().iter().map(|k| offset(k.joint, k.rest)).collect();
        let skin = self.skin();
        Ok(self.reshaped(&heads, &tails, &points, move |positions| {
            let blended = |(p, i): (&Vec3, &Influence)| i.blend(&maps, p.as_dvec3()).as_vec3();
            positions.iter().zip(&skin.influences).map(blended).collect()
        }))
    }
}

impl Armature {
    /// The vector-Jacobian product of [`Armature::stretched`], given derivatives with
    /// respect to the stretched body at rest. Returns the derivatives with respect to
    /// each stretch (its three factors; the first component counts for
    /// [`Stretch::Along`]) and to this body at rest.
    ///
    /// # Errors
    /// As [`Armature::stretched`].
    pub fn vjp_stretched(
        &self,
        by_joint: &[(usize, Stretch)],
        by: &RestGradient,
    ) -> Result<(Vec<DVec3>, RestGradient), GeomError> {
        let rig = self.rig();
        let (joints, stretches) = (rig.joints(), stretches(rig, by_joint)?);
        let linear: Vec<DMat3> = joints
            .iter()
            .zip(&stretches)
            .map(|(joint, s)| s.linear(joint.tail - joint.head))
            .collect();
        // A joint takes a point x to L (x - head) + head'.
        let (mut by_linear, mut by_new_head) = (vec![DMat3::ZERO; joints.len()], by.heads.clone());
        let mut out =
            RestGradient { heads: vec![DVec3::ZERO; joints.len()], ..RestGradient::default() };
        let heads = &mut out.heads;
        let mut take = |j: usize, x: DVec3, g: DVec3| {
            let back = linear[j].transpose() * g;
            by_linear[j] += outer(g, x - joints[j].head);
            by_new_head[j] += g;
            heads[j] -= back;
            back
        };
        let tails = by.tails.iter().enumerate();
        out.tails = tails.map(|(j, g)| take(j, joints[j].tail, *g)).collect();
        let points = rig.keypoints().iter().zip(&by.keypoints);
        out.keypoints = points.map(|(k, g)| take(k.joint, k.rest, *g)).collect();
        let vertex = |(v, g): &(u32, DVec3)| {
            let (p, i) = self.vertex(*v)?;
            Some((*v, i.joints().map(|(j, w)| take(j, p, *g * w)).sum()))
        };
        out.vertices = by.vertices.iter().filter_map(vertex).collect();
        for j in (0..joints.len()).rev() {
            let g = by_new_head[j];
            match joints[j].parent {
                Some(p) => {
                    let back = linear[p].transpose() * g;
                    by_linear[p] += outer(g, joints[j].head - joints[p].head);
                    by_new_head[p] += g;
                    out.heads[p] -= back;
                    out.heads[j] += back;
                }
                None => out.heads[j] += g,
            }
        }
        let mut factors = vec![DVec3::ZERO; joints.len()];
        for (j, stretch) in stretches.iter().enumerate() {
            let g = by_linear[j];
            match stretch {
                Stretch::Axes(_) => factors[j] = DVec3::new(g.x_axis.x, g.y_axis.y, g.z_axis.z),
                Stretch::Along(f) => {
                    let bone = joints[j].tail - joints[j].head;
                    let along = bone.normalize_or_zero();
                    factors[j] = DVec3::splat(along.dot(g * along));
                    let turn = (g + g.transpose()) * along * (f - 1.0);
                    let across = turn - along * along.dot(turn);
                    let by_bone =
                        if along == DVec3::ZERO { DVec3::ZERO } else { across / bone.length() };
                    out.heads[j] -= by_bone;
                    if let Some(tail) = out.tails.get_mut(j) {
                        *tail += by_bone;
                    }
                }
            }
        }
        Ok((by_joint.iter().map(|(j, _)| factors[*j]).collect(), out))
    }
}

/// Returns the stretch of each joint.
fn stretches(rig: &Rig, by_joint: &[(usize, Stretch)]) -> Result<Vec<Stretch>, GeomError> {
    let mut stretches = vec![Stretch::Along(1.0); rig.joints().len()];
    for (j, stretch) in by_joint {
        let Some(place) = stretches.get_mut(*j) else {
            return Err(GeomError::invalid(format!("the rig has no joint {j}")));
        };
        if !stretch.usable() {
            let name = &rig.joints()[*j].name;
            return Err(GeomError::domain(format!(
                "the stretch of `{name}` must be positive and finite"
            )));
        }
        *place = *stretch;
    }
    Ok(stretches)
}

/// Returns the affine map of points at rest for each joint.
fn maps(rig: &Rig, by_joint: &[(usize, Stretch)]) -> Result<Vec<DAffine3>, GeomError> {
    let stretches = stretches(rig, by_joint)?;
    let mut maps: Vec<DAffine3> = Vec::with_capacity(stretches.len());
    for (joint, stretch) in rig.joints().iter().zip(stretches) {
        let head = joint.parent.map_or(joint.head, |p| maps[p].transform_point3(joint.head));
        let linear = stretch.linear(joint.tail - joint.head);
        maps.push(DAffine3 { matrix3: linear, translation: head - linear * joint.head });
    }
    Ok(maps)
}
