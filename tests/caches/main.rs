//! Whatever is kept for later depends on all that it was made from: each input alone is
//! changed, and what comes out with everything warm from the old input is what comes out
//! on a thread, and for data, that has seen nothing, to the last bit. docs/reliability.md
//! lists what is kept, by what it is told, and the test here that changes that.

mod pictures;
mod scores;
mod shapes;
#[path = "../../examples/shipped/mod.rs"]
mod shipped;

use pcadlang::geom::Mesh;
use pcadlang::render::{Contours, Frame};

/// What a thread that has done nothing before makes of it.
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
