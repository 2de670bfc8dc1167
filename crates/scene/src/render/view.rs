//! A solid seen by a camera, with its frames and contours computed on demand.
//!
//! Not a scene graph and not mutable: another pose is another `View`. Invariant: for one
//! image size the frame, the depth and the contours are computed once, and every caller
//! gets the same `Arc`.

use super::canvas::Canvas;
use super::pixels::fractions::Fractions;
use super::{Camera, Channels, ContourChange, Contours, Frame, FrameChange};
use crate::geom::Solid;
use glam::DVec3;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Values by image size; few sizes are ever requested, so a list is enough.
type BySize<T> = Mutex<Vec<(u32, T)>>;

/// A solid and the camera that sees it. `Send` and `Sync`; share it in an `Arc`.
pub struct View {
    solid: Solid,
    camera: Camera,
    /// What it shares with the views before and after it.
    canvas: Canvas,
    frames: BySize<Arc<Frame>>,
    /// `None` where the picture is better drawn in full.
    frame_changes: BySize<Option<Arc<FrameChange>>>,
    depths: BySize<Arc<Frame>>,
    fractions: BySize<Arc<Fractions>>,
    contours: BySize<Arc<Contours>>,
    /// `None` where the picture is better drawn in full.
    changes: BySize<Option<Arc<ContourChange>>>,
    expected: Expected,
}

/// The sizes at which the view before this one drew in full: comparators ask each view of a
/// trace's node for the same, so contours are read from the drawing that will be asked for
/// next, instead of drawing what they need by themselves.
#[derive(Default)]
struct Expected {
    frames: Vec<u32>,
    depths: Vec<u32>,
    contours: Vec<u32>,
}

impl View {
    /// A view; nothing is drawn yet.
    pub fn new(solid: Solid, camera: Camera) -> View {
        View {
            solid,
            camera,
            canvas: Canvas::default(),
            frames: Mutex::default(),
            frame_changes: Mutex::default(),
            depths: Mutex::default(),
            fractions: Mutex::default(),
            contours: Mutex::default(),
            changes: Mutex::default(),
            expected: Expected::default(),
        }
    }

    /// Draws on the canvas of the view that this one follows, so that a drawing costs what
    /// differs between the two.
    #[must_use]
    pub fn after(self, previous: &View) -> View {
        // A view whose density was not needed has drawn nothing.
        fn or(drawn: Vec<u32>, expected: &[u32]) -> Vec<u32> {
            if drawn.is_empty() { expected.to_vec() } else { drawn }
        }
        let contours = [sizes(&previous.contours), sizes(&previous.changes)].concat();
        let expected = Expected {
            frames: or(sizes(&previous.frames), &previous.expected.frames),
            depths: or(sizes(&previous.depths), &previous.expected.depths),
            contours: or(contours, &previous.expected.contours),
        };
        View { canvas: previous.canvas.for_next(), expected, ..self }
    }

    /// The solid.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The camera at its full image size.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// All channels of the picture whose longer side has `size` pixels (0 counts as 1).
    pub fn frame(&self, size: u32) -> Arc<Frame> {
        // Not while the frames are locked: `frame_change` locks both the other way round.
        let on_canvas = find(&self.frame_changes, size).flatten();
        once(&self.frames, size, || {
            let camera = self.camera.scaled_to(size);
            let kept = on_canvas.and_then(|_| self.canvas.frame(&self.solid, &camera));
            Arc::new(kept.unwrap_or_else(|| drawn_frame(&self.solid, &camera, Channels::All)))
        })
    }

    /// The difference of [`View::frame`] from the frame drawn last on the same canvas, without
    /// building the frame; `None` if the picture is better drawn in full.
    pub fn frame_change(&self, size: u32) -> Option<Arc<FrameChange>> {
        once(&self.frame_changes, size, || {
            // The canvas has meshes only.
            if self.solid.revolution().is_some() || find(&self.frames, size).is_some() {
                return None;
            }
            let change = self.canvas.frame_change(&self.solid, &self.camera.scaled_to(size));
            change.map(Arc::new)
        })
    }

    /// A frame with depth at least, in the picture whose longer side has `size` pixels (0
    /// counts as 1): cheaper than [`View::frame`], and reused by contours of that size
    /// that are requested later.
    pub fn depth(&self, size: u32) -> Arc<Frame> {
        self.depth_drawn(size).unwrap_or_else(|| {
            let contours = self.expects_contours(size);
            // The canvas has meshes only.
            let on_canvas = self.solid.revolution().is_none()
                && (!contours || self.change_on_canvas(size).is_some());
            once(&self.depths, size, || {
                let (solid, camera) = (&self.solid, self.camera.scaled_to(size));
                let drawn = || self.canvas.depth(solid, &camera, contours);
                let depth = on_canvas.then(drawn).flatten();
                Arc::new(match depth {
                    Some(depth) => Frame::of_depth(&camera, depth),
                    None => drawn_frame(solid, &camera, Channels::Depth),
                })
            })
        })
    }

    /// The fraction of each pixel that the solid covers, 0 to 1, row by row, in the picture
    /// whose longer side has `size` pixels (0 counts as 1).
    pub fn fractions(&self, size: u32) -> Arc<[f32]> {
        Arc::clone(&self.covered(size).values)
    }

    /// The same, with what its derivatives need.
    pub(super) fn covered(&self, size: u32) -> Arc<Fractions> {
        once(&self.fractions, size, || {
            let (solid, camera) = (&self.solid, self.camera.scaled_to(size));
            let samples = solid.revolution().is_none().then(|| Fractions::of(solid, &camera));
            Arc::new(samples.flatten().unwrap_or_else(|| {
                let draw = |finer: &Camera| drawn_frame(solid, finer, Channels::Depth);
                Fractions::by_pixels(&camera, draw)
            }))
        })
    }

    /// The contours in the picture whose longer side has `size` pixels (0 counts as 1).
    pub fn contours(&self, size: u32) -> Arc<Contours> {
        once(&self.contours, size, || {
            let change = self.change_on_canvas(size);
            if let Some(change) = change.as_ref().filter(|c| c.moving.len() == c.count) {
                return Arc::clone(&change.moving);
            }
            let (solid, camera) = (&self.solid, self.camera.scaled_to(size));
            if change.is_some() {
                return Arc::new(self.canvas.contours(solid, &camera));
            }
            Arc::new(match self.depth_drawn(size).or_else(|| self.depth_expected(size)) {
                Some(frame) => Contours::with_depth(solid, &camera, &frame.depth),
                None => Contours::of(solid, &camera),
            })
        })
    }

    /// The difference of [`View::contours`] from the contours drawn last on the same
    /// canvas, without building the list of those that stay.
    pub fn change(&self, size: u32) -> Arc<ContourChange> {
        let whole = || Arc::new(ContourChange::whole(self.contours(size)));
        self.change_on_canvas(size).unwrap_or_else(whole)
    }

    /// The change, unless the picture is better drawn in full, or its depth is known.
    fn change_on_canvas(&self, size: u32) -> Option<Arc<ContourChange>> {
        once(&self.changes, size, || {
            if self.solid.revolution().is_some() || self.depth_drawn(size).is_some() {
                return None;
            }
            self.canvas.change(&self.solid, &self.camera.scaled_to(size)).map(Arc::new)
        })
    }

    /// The vector-Jacobian product of [`View::contours`] with respect to the solid's
    /// vertices, as [`Contours::vjp`].
    pub fn vjp_contours(&self, size: u32, by_piece: &[[f64; 4]]) -> Vec<DVec3> {
        let camera = self.camera.scaled_to(size);
        self.contours(size).vjp(&self.solid, &camera, by_piece)
    }

    /// Whether contours of this size are drawn, or expected to be asked for.
    fn expects_contours(&self, size: u32) -> bool {
        self.expected.contours.contains(&size) || find(&self.changes, size).is_some()
    }

    /// A frame with depth at least, if one is expected to be asked for.
    fn depth_expected(&self, size: u32) -> Option<Arc<Frame>> {
        if self.expected.frames.contains(&size) {
            return Some(self.frame(size));
        }
        self.expected.depths.contains(&size).then(|| self.depth(size))
    }

    /// A frame with depth at least, if one was drawn.
    fn depth_drawn(&self, size: u32) -> Option<Arc<Frame>> {
        find(&self.frames, size).or_else(|| find(&self.depths, size))
    }
}

impl std::fmt::Debug for View {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("View").field("camera", &self.camera).finish_non_exhaustive()
    }
}

/// Draws a solid, without a mesh if it is a surface of revolution.
fn drawn_frame(solid: &Solid, camera: &Camera, channels: Channels) -> Frame {
    match solid.revolution() {
        Some(r) => Frame::of_revolution(&r.surface, &r.affine, camera, channels),
        None => Frame::render(solid, camera, channels),
    }
}

fn lock<T>(cache: &BySize<T>) -> MutexGuard<'_, Vec<(u32, T)>> {
    cache.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The sizes for which there are values.
fn sizes<T>(cache: &BySize<T>) -> Vec<u32> {
    lock(cache).iter().map(|(size, _)| *size).collect()
}

fn find<T: Clone>(cache: &BySize<T>, size: u32) -> Option<T> {
    lock(cache).iter().find(|(at, _)| *at == size).map(|(_, value)| value.clone())
}

/// The entry of a size, computed under the lock if missing: a second thread waits rather
/// than computing it again.
fn once<T: Clone>(cache: &BySize<T>, size: u32, make: impl FnOnce() -> T) -> T {
    let mut entries = lock(cache);
    if let Some((_, value)) = entries.iter().find(|(at, _)| *at == size) {
        return value.clone();
    }
    let value = make();
    entries.push((size, value.clone()));
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing::sphere;

    #[test]
    fn each_size_is_computed_once_and_shared_between_threads() {
        let view = Arc::new(View::new(sphere(32, 16), Camera::default_for(200, 100)));
        let frames: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| view.frame(64))).collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        assert!(frames.iter().all(|f| Arc::ptr_eq(f, &frames[0])));
        assert_eq!((frames[0].width, frames[0].height), (64, 32));
        assert!(!Arc::ptr_eq(&view.frame(65), &frames[0]));
        assert!(Arc::ptr_eq(&view.contours(64), &view.contours(64)));
        assert_eq!(view.camera().width, 200);
        assert_eq!(view.solid().instances().len(), 1);
        assert!(format!("{view:?}").contains("camera"));
    }

    #[test]
    fn contours_are_the_same_with_and_without_a_frame() {
        let (a, b) = (View::new(sphere(32, 16), Camera::default_for(96, 96)), {
            let view = View::new(sphere(32, 16), Camera::default_for(96, 96));
            view.frame(96);
            view
        });
        let c = View::new(sphere(32, 16), Camera::default_for(96, 96));
        let after = |previous: &View| View::new(sphere(32, 16), *b.camera()).after(previous);
        let next = after(&b);
        assert_eq!(*a.contours(96), *next.contours(96));
        assert_eq!(find(&next.frames, 96).as_ref(), Some(&b.frame(96)), "drawn for the next one");
        let depth = c.depth(96);
        let next = after(&after(&c));
        assert_eq!(*a.contours(96), *next.contours(96));
        assert_eq!(find(&next.depths, 96).as_ref(), Some(&depth), "drawn for the next one");
        assert!(after(&next).expects_contours(96) && !after(&c).expects_contours(96));
        assert!(depth.part.is_empty() && Arc::ptr_eq(&depth, &c.depth(96)));
        assert_eq!(depth.depth, b.frame(96).depth);
        assert!(Arc::ptr_eq(&b.depth(96), &b.frame(96)));
        assert_eq!(*a.contours(96), *b.contours(96));
        assert_eq!(*a.contours(96), *c.contours(96));
        assert_eq!(*a.depth(96), *depth);
        assert!(!a.contours(96).x.is_empty());
    }
}
