//! Many scenes and their contours, as flat lists, and the CPU's cores that draw the same.

use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::geom::Solid;
use pcadlang_scene::render::{Camera, ContourSlice, Contours};

/// A scene to be drawn.
///
/// Its meshes ([`Solid::instances`]) are triangle lists: `positions` and `normals` are
/// three `f32` per vertex without gaps, in scene units, y up; `triangles` are three `u32`
/// indices each, counter-clockwise as seen from outside; placements are `f64`, column by
/// column, from the mesh's coordinates to the world's. Scenes share meshes: the same
/// `Arc` is the same data, so a device may cache meshes by address as long as it holds
/// the `Arc`.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The solid to be drawn.
    pub solid: Solid,
    /// The camera, at the size of the picture.
    pub camera: Camera,
}

/// The contours of many scenes. Those of scene `i` are the entries `ends[i - 1]..ends[i]`
/// of each list (from 0 for the first). All are `f32`, in pixels of the scene's picture,
/// x to the right and y down, as in [`Contours`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContourBatch {
    /// Middle of each piece, from the left edge.
    pub x: Vec<f32>,
    /// Middle of each piece, from the top edge.
    pub y: Vec<f32>,
    /// Unit tangent, component to the right.
    pub tx: Vec<f32>,
    /// Unit tangent, downward component.
    pub ty: Vec<f32>,
    /// Length of each piece.
    pub length: Vec<f32>,
    /// Where the pieces of each scene end.
    pub ends: Vec<usize>,
    /// Width and height of each scene's picture.
    pub sizes: Vec<[u32; 2]>,
}

impl ContourBatch {
    /// The number of scenes.
    pub fn len(&self) -> usize {
        self.ends.len().min(self.sizes.len())
    }

    /// True if there are no scenes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The contours of a scene; empty if there is no such scene.
    pub fn scene(&self, i: usize) -> ContourSlice<'_> {
        let past = self.ends.get(i).copied().unwrap_or_default();
        let first = i.checked_sub(1).and_then(|i| self.ends.get(i)).copied().unwrap_or_default();
        let part = |list: &'_ Vec<f32>| -> std::ops::Range<usize> {
            first.min(list.len())..past.clamp(first, list.len())
        };
        let [width, height] = self.sizes.get(i).copied().unwrap_or_default();
        ContourSlice {
            x: &self.x[part(&self.x)],
            y: &self.y[part(&self.y)],
            tx: &self.tx[part(&self.tx)],
            ty: &self.ty[part(&self.ty)],
            length: &self.length[part(&self.length)],
            width,
            height,
        }
    }

    /// Adds a scene's contours after the others.
    pub fn push(&mut self, contours: &Contours) {
        self.x.extend_from_slice(&contours.x);
        self.y.extend_from_slice(&contours.y);
        self.tx.extend_from_slice(&contours.tx);
        self.ty.extend_from_slice(&contours.ty);
        self.length.extend_from_slice(&contours.length);
        self.ends.push(self.x.len());
        self.sizes.push([contours.width, contours.height]);
    }
}

/// Draws on several cores of the CPU.
pub struct Cores {
    pool: Pool,
}

impl Cores {
    /// Starts a number of threads (0: one for each core). They live until this is
    /// dropped, and so do their drawing caches.
    pub fn new(threads: usize) -> Cores {
        Cores { pool: Pool::new(threads) }
    }

    /// The contours of each scene, in the order given: those of [`Contours::of`].
    pub fn contours(&self, scenes: &[Scene]) -> ContourBatch {
        let draw = |scene: &Scene| Contours::of(&scene.solid, &scene.camera);
        let drawn = self.pool.map(scenes.iter().collect(), draw);
        let mut batch = ContourBatch::default();
        drawn.iter().for_each(|contours| batch.push(contours));
        batch
    }
}
