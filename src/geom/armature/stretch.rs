//! Other proportions: bones made longer or shorter at rest, with what hangs on them moved along.

use super::{Armature, Rig};
use crate::geom::{GeomError, outer};
use glam::{DAffine3, DMat3, DVec3};

/// How a bone's surroundings are stretched about its head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stretch {
    /// By a factor along the bone.
    Along(f64),
    /// By factors along the axes at rest.
    Axes(DVec3),
}

impl Stretch {
    /// About the origin, for a bone in direction `tail - head`.
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
    /// The same body with some bones longer or shorter, by joint in rig order. A joint's parent takes its head along; a
    /// vertex goes where the joints that move it take it, by their weights; a keypoint where its joint does.
    ///
    /// # Errors
    /// A joint that is not there, a factor that is not positive and finite.
    pub fn stretched(&self, by_joint: &[(usize, Stretch)]) -> Result<Armature, GeomError> {
        let maps = maps(self.rig(), by_joint)?;
        let offset = |j: usize, at: DVec3| maps[j].transform_point3(at) - at;
        let joints = || self.rig().joints().iter().enumerate();
        let heads: Vec<DVec3> = joints().map(|(i, j)| offset(i, j.head)).collect();
        let tails: Vec<DVec3> = joints().map(|(i, j)| offset(i, j.tail)).collect();
        let points: Vec<DVec3> = self.rig().keypoints().iter().map(|k| offset(k.joint, k.rest)).collect();
        let skin = self.skin();
        Ok(self.reshaped(&heads, &tails, &points, move |positions| {
            for (p, i) in positions.iter_mut().zip(&skin.influences) {
                *p = i.blend(&maps, p.as_dvec3()).as_vec3();
            }
        }))
    }
}

/// By joint: where it takes the points at rest.
fn maps(rig: &Rig, by_joint: &[(usize, Stretch)]) -> Result<Vec<DAffine3>, GeomError> {
    let mut stretches = vec![Stretch::Along(1.0); rig.joints().len()];
    for (j, stretch) in by_joint {
        let Some(place) = stretches.get_mut(*j) else {
            return Err(GeomError::invalid(format!("the rig has no joint {j}")));
        };
        if !stretch.usable() {
            let name = &rig.joints()[*j].name;
            return Err(GeomError::domain(format!("the stretch of `{name}` must be positive and finite")));
        }
        *place = *stretch;
    }
    let mut maps: Vec<DAffine3> = Vec::with_capacity(stretches.len());
    for (joint, stretch) in rig.joints().iter().zip(stretches) {
        let head = joint.parent.map_or(joint.head, |p| maps[p].transform_point3(joint.head));
        let linear = stretch.linear(joint.tail - joint.head);
        maps.push(DAffine3 { matrix3: linear, translation: head - linear * joint.head });
    }
    Ok(maps)
}
