//! The body that a mesh is a part of, for files that keep bodies posable.

use glam::{Affine3A, DVec3, Vec3};
use std::fmt;
use std::sync::Arc;

/// The weights of joints that move a vertex, at most four.
pub type Weights = ([u16; 4], [f32; 4]);

/// A joint of a body at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct RestJoint {
    /// Its name.
    pub name: Arc<str>,
    /// The index of its parent, less than its own; `None` for a root.
    pub parent: Option<usize>,
    /// Its pivot.
    pub head: DVec3,
}

/// A body at rest: a mesh, and the joints that move it.
pub trait Skinned: fmt::Debug + Send + Sync {
    /// Its joints, parents before children.
    fn joints(&self) -> Vec<RestJoint>;
    /// Its vertices.
    fn positions(&self) -> &[Vec3];
    /// Its normals.
    fn normals(&self) -> &[Vec3];
    /// Its triangles.
    fn triangles(&self) -> &[[u32; 3]];
    /// What moves each vertex.
    fn weights(&self) -> Vec<Weights>;
    /// The joints that move a part, by its place.
    fn joints_of_part(&self, part: usize) -> &[u16];
    /// The same for two bodies that differ in shape only: vertices and joints correspond.
    fn identity(&self) -> usize;
}

/// A posed body, as one of its parts knows it.
#[derive(Clone, Debug)]
pub struct PosedSkin {
    /// The body at rest.
    pub body: Arc<dyn Skinned>,
    /// The transform of each joint. Those of joints that do not move this part may be of
    /// an earlier pose.
    pub transforms: Arc<[Affine3A]>,
    /// The part, by its place among those of the body.
    pub part: usize,
}
