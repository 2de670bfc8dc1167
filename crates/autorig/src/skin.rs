//! Skin weights: mixtures of joints, and weights by distance to bones.

use crate::near::to_segment;
use crate::rigging::Bone;
use glam::Vec3;
use pcadlang_scene::geom::armature::{Influence, MOST_WEIGHTS};

/// Joints with unnormalised weights.
#[derive(Clone, Debug, Default)]
pub(super) struct Mix(Vec<(usize, f64)>);

impl Mix {
    /// Adds to a joint's weight; ignores amounts that are not positive.
    pub fn add(&mut self, joint: usize, amount: f64) {
        match self.0.iter_mut().find(|(j, _)| *j == joint) {
            Some((_, a)) => *a += amount.max(0.0),
            None if amount > 0.0 => self.0.push((joint, amount)),
            None => {}
        }
    }

    /// Returns the four heaviest joints, the lower indices on ties, with weights that sum
    /// to 1.
    pub fn influence(&self) -> Influence {
        let mut most = self.0.clone();
        most.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        most.truncate(MOST_WEIGHTS);
        let sum: f64 = most.iter().map(|(_, a)| a).sum();
        let mut out = Influence::default();
        for (k, (joint, amount)) in most.iter().enumerate() {
            (out.joints[k], out.weights[k]) = (*joint as u16, (amount / sum) as f32);
        }
        if sum <= 0.0 {
            out.weights[0] = 1.0;
        }
        out
    }
}

/// Weights each vertex's nearest bone and that bone's parent, children and siblings by
/// ((least / distance)^2 - 1/4)^2, which is 0 from twice the least distance on.
pub(super) fn by_distance(positions: &[Vec3], bones: &[Bone]) -> Vec<Influence> {
    let one = |p: &Vec3| {
        let p = p.as_dvec3();
        let far: Vec<f64> = bones.iter().map(|b| to_segment(p, b.head, b.tail)).collect();
        let nearest = (0..bones.len()).fold(0, |best, i| if far[i] < far[best] { i } else { best });
        let (least, mut mix) = (far[nearest], Mix::default());
        mix.add(nearest, 0.5625);
        for (i, b) in bones.iter().enumerate().filter(|(i, _)| *i != nearest) {
            let up = bones[nearest].parent;
            if b.parent == Some(nearest) || up == Some(i) || (up.is_some() && b.parent == up) {
                // On a bone itself (least = 0), only bones through the same point count,
                // with the same weight.
                let ratio = if far[i] > 0.0 { least / far[i] } else { 1.0 };
                let over = (ratio * ratio - 0.25).max(0.0);
                mix.add(i, over * over);
            }
        }
        mix.influence()
    };
    positions.iter().map(one).collect()
}
