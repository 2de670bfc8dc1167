//! Every cached value depends on all of its inputs: each input is changed alone, and the
//! result with all caches warm from the old input equals, to the last bit, the result on
//! a fresh thread and with fresh data. docs/explanation/caches.md lists the caches, their
//! keys, and the test here that changes each key.

mod pictures;
mod scores;
mod shapes;

use crate::subjects::shipped;
use pcadlang::geom::Mesh;
use pcadlang::render::{Contours, Frame};

/// Runs a function on a new thread, whose caches are empty.
pub fn afresh<T: Send>(make: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|s| s.spawn(make).join().unwrap())
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
