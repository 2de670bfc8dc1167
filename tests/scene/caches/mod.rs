//! Every cached value depends on all of its inputs: each input is changed alone, and the
//! result with all caches warm from the old input equals, to the last bit, the result on
//! a fresh thread and with fresh data. docs/explanation/caches.md lists the caches, their
//! keys, and the test here that changes each key.

mod pictures;
mod scores;
mod shapes;

use crate::shipped;
use pcadlang_scene::geom::Mesh;
use pcadlang_scene::geom::Solid;
use pcadlang_scene::render::{Camera, Contours, Frame, View};
use std::sync::Arc;

/// Runs a function on a new thread, whose caches are empty.
pub fn afresh<T: Send>(make: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|s| s.spawn(make).join().unwrap())
}

/// Views that follow one another, each drawn from the one before.
#[derive(Default)]
pub struct Views(Option<View>);

impl Views {
    /// The next view.
    pub fn next(&mut self, solid: &Solid, camera: &Camera) -> &View {
        let view = View::new(solid.clone(), *camera);
        let view = match &self.0 {
            Some(before) => view.after(before),
            None => view,
        };
        self.0.insert(view)
    }

    /// The contours of the next view, at its full size.
    pub fn contours(&mut self, solid: &Solid, camera: &Camera) -> Arc<Contours> {
        self.next(solid, camera).contours(camera.width.max(camera.height))
    }
}

pub fn contour_bits(c: &Contours) -> Vec<u32> {
    let lists = [&c.x, &c.y, &c.tx, &c.ty, &c.length];
    [c.width, c.height]
        .into_iter()
        .chain(lists.into_iter().flatten().map(|v| v.to_bits()))
        .collect()
}

pub fn frame_bits(f: &Frame) -> Vec<u32> {
    let normals = f.normal.iter().flatten().chain(&f.depth).map(|v| v.to_bits());
    [f.width, f.height]
        .into_iter()
        .chain(normals)
        .chain(f.part.iter().map(|p| u32::from(*p)))
        .collect()
}

pub fn mesh_bits(m: &Mesh) -> String {
    let numbers = m.positions.iter().chain(&m.normals).map(|v| v.to_array().map(f32::to_bits));
    format!("{:?} {:?}", numbers.collect::<Vec<_>>(), m.topology)
}
