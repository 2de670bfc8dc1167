//! What drawing contours took, counted where it is done: each thread counts its own.

use crate::geom::Mesh;
use std::cell::Cell;
use std::ops::Sub;

/// What was drawn for contours, and what was not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Pictures of which everything was drawn.
    pub whole: u64,
    /// Pictures of which only what had changed was drawn.
    pub partial: u64,
    /// Meshes that were drawn.
    pub drawn: u64,
    /// Triangles of those.
    pub triangles: u64,
    /// Of these, triangles of bodies that hide their own backs, so that those turned away
    /// were passed over.
    pub closed: u64,
    /// Meshes that were as they had been drawn before.
    pub kept: u64,
    /// Meshes that lay outside of the picture: nothing of them was drawn.
    pub outside: u64,
    /// Meshes that lay wholly behind others: nothing of them was drawn.
    pub hidden: u64,
    /// Pixels of which the depth was composed anew.
    pub pixels: u64,
}

thread_local! {
    static WORK: Cell<Work> = const { Cell::new(Work {
        whole: 0, partial: 0, drawn: 0, triangles: 0, closed: 0, kept: 0, outside: 0, hidden: 0, pixels: 0,
    }) };
}

/// What this thread has drawn so far.
pub fn work() -> Work {
    WORK.get()
}

/// Counts something.
pub(super) fn count(add: impl FnOnce(&mut Work)) {
    let mut work = WORK.get();
    add(&mut work);
    WORK.set(work);
}

/// Counts a mesh that is drawn.
pub(super) fn drawn(mesh: &Mesh) {
    let triangles = mesh.topology.triangles.len() as u64;
    count(|work| {
        work.drawn += 1;
        work.triangles += triangles;
        work.closed += if mesh.topology.encloses { triangles } else { 0 };
    });
}

/// What was done between two moments.
impl Sub for Work {
    type Output = Work;

    fn sub(self, before: Work) -> Work {
        Work {
            whole: self.whole - before.whole,
            partial: self.partial - before.partial,
            drawn: self.drawn - before.drawn,
            triangles: self.triangles - before.triangles,
            closed: self.closed - before.closed,
            kept: self.kept - before.kept,
            outside: self.outside - before.outside,
            hidden: self.hidden - before.hidden,
            pixels: self.pixels - before.pixels,
        }
    }
}
