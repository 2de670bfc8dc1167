//! A solid seen by a camera, with its frames and contours computed when first asked for.
//!
//! Not a scene graph and not mutable: another pose is another `View`. Invariant: for one image size the frame, the depth and the
//! contours are computed once, and every caller gets the same `Arc`.

use super::{Camera, Channels, Contours, Frame, Scene};
use crate::geom::Solid;
use glam::DVec3;
use std::sync::{Arc, Mutex, PoisonError};

/// Values by image size; few sizes are ever asked for, so a list is enough.
type BySize<T> = Mutex<Vec<(u32, Arc<T>)>>;

/// A solid and the camera that looks at it. `Send` and `Sync`; share it in an `Arc`.
pub struct View {
    solid: Solid,
    camera: Camera,
    frames: BySize<Frame>,
    depths: BySize<Frame>,
    contours: BySize<Contours>,
}

impl View {
    /// A view; nothing is drawn yet.
    pub fn new(solid: Solid, camera: Camera) -> View {
        View { solid, camera, frames: Mutex::default(), depths: Mutex::default(), contours: Mutex::default() }
    }

    /// The solid.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The camera at its full image size.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// What is drawn in the picture whose longer side has `size` pixels (0 counts as 1).
    pub fn scene(&self, size: u32) -> Scene {
        Scene { solid: self.solid.clone(), camera: self.camera.scaled_to(size) }
    }

    /// All channels of the picture whose longer side has `size` pixels (0 counts as 1).
    pub fn frame(&self, size: u32) -> Arc<Frame> {
        once(&self.frames, size, || Frame::render(&self.solid, &self.camera.scaled_to(size), Channels::All))
    }

    /// A frame that has depth at least, in the picture whose longer side has `size` pixels (0 counts as 1): cheaper than
    /// [`View::frame`], and contours of that size that are asked for later use it.
    pub fn depth(&self, size: u32) -> Arc<Frame> {
        match find(&self.frames.lock().unwrap_or_else(PoisonError::into_inner), size) {
            Some(frame) => frame,
            None => {
                once(&self.depths, size, || Frame::render(&self.solid, &self.camera.scaled_to(size), Channels::Depth))
            }
        }
    }

    /// The contours in the picture whose longer side has `size` pixels (0 counts as 1).
    pub fn contours(&self, size: u32) -> Arc<Contours> {
        once(&self.contours, size, || {
            let drawn = |cache: &BySize<Frame>| find(&cache.lock().unwrap_or_else(PoisonError::into_inner), size);
            let frame = drawn(&self.frames).or_else(|| drawn(&self.depths));
            let camera = self.camera.scaled_to(size);
            match frame {
                Some(frame) => Contours::with_depth(&self.solid, &camera, &frame.depth),
                None => Contours::of(&self.solid, &camera),
            }
        })
    }

    /// The vector-Jacobian product of [`View::contours`] by the solid's vertices: [`Contours::pull`].
    pub fn pull_contours(&self, size: u32, by_piece: &[[f64; 4]]) -> Vec<DVec3> {
        self.contours(size).pull(&self.solid, &self.camera.scaled_to(size), by_piece)
    }
}

impl std::fmt::Debug for View {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("View").field("camera", &self.camera).finish_non_exhaustive()
    }
}

fn find<T>(entries: &[(u32, Arc<T>)], size: u32) -> Option<Arc<T>> {
    entries.iter().find(|(at, _)| *at == size).map(|(_, value)| value.clone())
}

/// The entry of a size, computed under the lock when missing: a second thread waits rather than computing it again.
fn once<T>(cache: &BySize<T>, size: u32, make: impl FnOnce() -> T) -> Arc<T> {
    let mut entries = cache.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(value) = find(&entries, size) {
        return value;
    }
    let value = Arc::new(make());
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
        let depth = c.depth(96);
        assert!(depth.part.is_empty() && Arc::ptr_eq(&depth, &c.depth(96)));
        assert_eq!(depth.depth, b.frame(96).depth);
        assert!(Arc::ptr_eq(&b.depth(96), &b.frame(96)));
        assert_eq!(*a.contours(96), *b.contours(96));
        assert_eq!(*a.contours(96), *c.contours(96));
        assert_eq!(*a.depth(96), *depth);
        assert!(!a.contours(96).x.is_empty());
    }
}
