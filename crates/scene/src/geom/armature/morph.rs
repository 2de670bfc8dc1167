//! Morphs (blend shapes): linear offsets of a body's rest shape, summed before posing.

use super::rig::{Keypoint, Rig};
use crate::geom::GeomError;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Offsets of every vertex and joint at rest, in the mesh's units, for an amount of 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Morph {
    /// The name.
    pub name: Arc<str>,
    /// The amount that the body at rest has it with, often 0.
    pub weight: f64,
    /// Offsets of the vertices.
    pub vertices: Vec<[f32; 3]>,
    /// Offsets of the joints' heads, in rig order.
    pub heads: Vec<DVec3>,
    /// Offsets of the joints' tails, in rig order.
    pub tails: Vec<DVec3>,
}

impl Morph {
    pub(super) fn check(&self, vertices: usize, joints: usize) -> Result<(), GeomError> {
        let counts = [self.vertices.len(), self.heads.len(), self.tails.len()];
        if counts != [vertices, joints, joints] {
            return Err(GeomError::invalid(format!(
                "the morph `{}` moves {} vertices, {} heads and {} tails; the body has {vertices}, {joints} and {joints}",
                self.name, counts[0], counts[1], counts[2]
            )));
        }
        let finite = self.vertices.as_flattened().iter().all(|x| x.is_finite())
            && self.heads.iter().chain(&self.tails).all(|v| v.is_finite());
        if finite {
            Ok(())
        } else {
            Err(GeomError::invalid(format!("the morph `{}` is not finite", self.name)))
        }
    }

    /// Moves the coordinates of all vertices in turn.
    #[inline(always)]
    pub(super) fn move_vertices(&self, amount: f64, coordinates: &mut [f32]) {
        let amount = amount as f32;
        let both = coordinates.iter_mut().zip(self.vertices.as_flattened());
        both.for_each(|(x, d)| *x += *d * amount);
    }

    /// Returns the offset of a vertex.
    pub(super) fn of(&self, vertex: usize) -> Option<DVec3> {
        self.vertices.get(vertex).map(|d| Vec3::from(*d).as_dvec3())
    }

    pub(super) fn move_joints(&self, amount: f64, heads: &mut [DVec3], tails: &mut [DVec3]) {
        for (at, d) in heads.iter_mut().zip(&self.heads).chain(tails.iter_mut().zip(&self.tails)) {
            *at += *d * amount;
        }
    }

    /// Returns the offset of a keypoint.
    pub(super) fn at(&self, anchor: Anchor) -> DVec3 {
        match anchor {
            Anchor::Head(j) => self.heads.get(j).copied().unwrap_or_default(),
            Anchor::Vertex(v) => self.of(v).unwrap_or_default(),
        }
    }
}

/// The vertices or joint that a keypoint follows when the shape changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    /// The head of its joint, if the keypoint is there.
    Head(usize),
    /// The nearest vertex.
    Vertex(usize),
}

impl Anchor {
    pub fn of(k: &Keypoint, rig: &Rig, positions: &[Vec3]) -> Anchor {
        if rig.joints().get(k.joint).is_some_and(|j| (j.head - k.rest).length() < 1e-4) {
            return Anchor::Head(k.joint);
        }
        let distance = |p: &Vec3| (p.as_dvec3() - k.rest).length_squared();
        let near = positions
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
        Anchor::Vertex(near.map_or(0, |(v, _)| v))
    }
}
