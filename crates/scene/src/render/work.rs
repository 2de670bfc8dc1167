//! Counts of the work that drawing contours took. Each thread has its own counts.

use crate::geom::Mesh;
use std::cell::Cell;
use std::ops::Sub;

/// Counts of drawn and skipped work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Pictures that were drawn completely.
    pub whole: u64,
    /// Pictures of which only the changes were drawn.
    pub partial: u64,
    /// Meshes that were drawn.
    pub drawn: u64,
    /// Triangles of these meshes.
    pub triangles: u64,
    /// Of these, triangles of bodies known to hide their own back faces, which are
    /// skipped.
    pub closed: u64,
    /// Meshes reused from an earlier drawing.
    pub kept: u64,
    /// Meshes outside of the picture, of which nothing was drawn.
    pub outside: u64,
    /// Meshes wholly behind others, of which nothing was drawn.
    pub hidden: u64,
    /// Pixels whose depth was recomposed.
    pub pixels: u64,
}

thread_local! {
    static WORK: Cell<Work> = const { Cell::new(Work {
        whole: 0, partial: 0, drawn: 0, triangles: 0, closed: 0, kept: 0, outside: 0, hidden: 0, pixels: 0,
    }) };
}

/// The counts of this thread so far.
pub fn work() -> Work {
    WORK.get()
}

/// Updates this thread's counts.
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

/// The work done between two moments.
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
