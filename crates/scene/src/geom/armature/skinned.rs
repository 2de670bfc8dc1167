//! A body as files that keep it posable see it.

use super::body::Armature;
use crate::geom::posed_skin::{RestJoint, Skinned, Weights};
use glam::Vec3;

impl Skinned for Armature {
    fn joints(&self) -> Vec<RestJoint> {
        let joints = self.rig().joints().iter();
        joints.map(|j| RestJoint { name: j.name.clone(), parent: j.parent, head: j.head }).collect()
    }

    fn positions(&self) -> &[Vec3] {
        Armature::positions(self)
    }

    fn normals(&self) -> &[Vec3] {
        Armature::normals(self)
    }

    fn triangles(&self) -> &[[u32; 3]] {
        Armature::triangles(self)
    }

    fn weights(&self) -> Vec<Weights> {
        self.influences().iter().map(|i| (i.joints, i.weights)).collect()
    }

    fn joints_of_part(&self, part: usize) -> &[u16] {
        Armature::joints_of_part(self, part)
    }

    fn identity(&self) -> usize {
        Armature::identity(self)
    }
}
