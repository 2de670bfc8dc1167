//! A solid seen by a camera, with its frames and contours computed on demand.
//!
//! Not a scene graph and not mutable: another pose is another `View`. Invariant: for one
//! image size the frame, the depth and the contours are computed once, and every caller
//! gets the same `Arc`.

use super::canvas::Canvas;
use super::pixels::fractions::Fractions;
use super::{Camera, Channels, ContourChange, Contours, Frame};
use crate::geom::{Affine, Solid};
use glam::DVec3;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A channel of the picture of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Parts and normals, with depth.
    Frame,
    /// Depth, or what it covers.
    Depth,
    /// The fraction of each pixel that is covered.
    Fractions,
    /// Contours.
    Contours,
}

/// The pictures of one size, each drawn on first use.
#[derive(Default)]
struct Pictures {
    frame: OnceLock<Arc<Frame>>,
    depth: OnceLock<Arc<Frame>>,
    fractions: OnceLock<Arc<Fractions>>,
    contours: OnceLock<Arc<Contours>>,
    /// `None` where the picture is better drawn in full.
    change: OnceLock<Option<Arc<ContourChange>>>,
}

/// A solid and the camera that sees it. `Send` and `Sync`; share it in an `Arc`.
pub struct View {
    solid: Solid,
    camera: Camera,
    /// The length of a metre in scene units, if it is known.
    metre: Option<f64>,
    /// Shared with the views before and after it.
    canvas: Canvas,
    /// The pictures by size; few sizes are ever requested, so a list is enough.
    pictures: Mutex<Vec<(u32, Arc<Pictures>)>>,
    /// The channels that comparators declared, of this view and of the one before it: where one
    /// reads contours and another depth, contours are read from the depth.
    read: Mutex<Vec<(Channel, u32)>>,
    read_before: Vec<(Channel, u32)>,
    /// By size, the coverage of the last view before it whose coverage was needed.
    covered_before: Vec<(u32, Arc<Fractions>)>,
    /// See [`View::image_bounds`].
    pub(super) bounds: OnceLock<[f64; 4]>,
}

impl View {
    /// A view; nothing is drawn yet.
    pub fn new(solid: Solid, camera: Camera) -> View {
        View {
            solid,
            camera,
            metre: None,
            canvas: Canvas::default(),
            pictures: Mutex::default(),
            read: Mutex::default(),
            read_before: Vec::new(),
            covered_before: Vec::new(),
            bounds: OnceLock::new(),
        }
    }

    /// The view of a scene whose metre has this length, positive and finite, in scene units.
    #[must_use]
    pub fn in_metres(self, metre: f64) -> View {
        View { metre: Some(metre), ..self }
    }

    /// The length of a metre in scene units, if it is known.
    pub fn metre(&self) -> Option<f64> {
        self.metre
    }

    /// The solid as files have it: in metres if their length is known, else in scene units.
    pub fn solid_in_files(&self) -> Solid {
        let by = |metre: f64| Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::splat(1.0 / metre));
        let scale = self.metre.map(by).filter(Affine::is_finite);
        scale.map_or_else(|| self.solid.clone(), |by| self.solid.placed(by))
    }

    /// Draws on the canvas of the view that this one follows, so that a drawing costs what
    /// differs between the two.
    #[must_use]
    pub fn after(self, previous: &View) -> View {
        let read = previous.read.lock().unwrap_or_else(PoisonError::into_inner).clone();
        // A view whose density was not needed has no comparators.
        let read_before = if read.is_empty() { previous.read_before.clone() } else { read };
        let covered = previous.all_covered();
        let covered_before =
            if covered.is_empty() { previous.covered_before.clone() } else { covered };
        View { canvas: previous.canvas.for_next(), read_before, covered_before, ..self }
    }

    /// Declares that a comparator reads a channel of the picture whose longer side has `size`
    /// pixels.
    pub fn declare(&self, channel: Channel, size: u32) {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if !read.contains(&(channel, size)) {
            read.push((channel, size));
        }
    }

    /// Returns whether a comparator reads a channel, of this view or of the one before it.
    fn is_read(&self, channel: Channel, size: u32) -> bool {
        let read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        read.contains(&(channel, size)) || self.read_before.contains(&(channel, size))
    }

    /// The pictures of a size. A second thread that asks for one waits rather than drawing it
    /// again.
    fn of(&self, size: u32) -> Arc<Pictures> {
        let mut all = self.pictures.lock().unwrap_or_else(PoisonError::into_inner);
        match all.iter().find(|(at, _)| *at == size) {
            Some((_, pictures)) => Arc::clone(pictures),
            None => {
                let pictures = Arc::default();
                all.push((size, Arc::clone(&pictures)));
                pictures
            }
        }
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
        let draw = || drawn_frame(&self.solid, &self.camera.scaled_to(size), Channels::All).into();
        Arc::clone(self.of(size).frame.get_or_init(draw))
    }

    /// A frame with depth at least, in the picture whose longer side has `size` pixels (0
    /// counts as 1): cheaper than [`View::frame`], and reused by contours of that size
    /// that are requested later.
    pub fn depth(&self, size: u32) -> Arc<Frame> {
        let pictures = self.of(size);
        if self.is_read(Channel::Frame, size) {
            return self.frame(size);
        }
        pictures.with_depth().cloned().unwrap_or_else(|| {
            let contours = pictures.change.get().is_some() || self.is_read(Channel::Contours, size);
            // The canvas has meshes only.
            let on_canvas = self.solid.revolution().is_none()
                && (!contours || self.change_on_canvas(size).is_some());
            let draw = || {
                let (solid, camera) = (&self.solid, self.camera.scaled_to(size));
                let drawn = || self.canvas.depth(solid, &camera, contours);
                Arc::new(match on_canvas.then(drawn).flatten() {
                    Some(depth) => Frame::of_depth(&camera, depth),
                    None => drawn_frame(solid, &camera, Channels::Depth),
                })
            };
            Arc::clone(pictures.depth.get_or_init(draw))
        })
    }

    /// The fraction of each pixel that the solid covers, 0 to 1, row by row, in the picture
    /// whose longer side has `size` pixels (0 counts as 1).
    pub fn fractions(&self, size: u32) -> Arc<[f32]> {
        Arc::clone(&self.covered(size).values)
    }

    /// The same, with what its derivatives need.
    pub(super) fn covered(&self, size: u32) -> Arc<Fractions> {
        let draw = || {
            let (solid, camera) = (&self.solid, self.camera.scaled_to(size));
            let before = self.covered_before.iter().find(|(at, _)| *at == size);
            let before = before.map(|(_, fractions)| &**fractions);
            let by_samples = || Fractions::of(solid, &camera, before);
            let samples = solid.revolution().is_none().then(by_samples);
            Arc::new(samples.flatten().unwrap_or_else(|| {
                let draw = |finer: &Camera| drawn_frame(solid, finer, Channels::Depth);
                Fractions::by_pixels(&camera, draw)
            }))
        };
        Arc::clone(self.of(size).fractions.get_or_init(draw))
    }

    /// The coverage that was needed so far, by size.
    fn all_covered(&self) -> Vec<(u32, Arc<Fractions>)> {
        let all = self.pictures.lock().unwrap_or_else(PoisonError::into_inner);
        let known = |(size, pictures): &(u32, Arc<Pictures>)| {
            pictures.fractions.get().map(|fractions| (*size, Arc::clone(fractions)))
        };
        all.iter().filter_map(known).collect()
    }

    /// The contours in the picture whose longer side has `size` pixels (0 counts as 1).
    pub fn contours(&self, size: u32) -> Arc<Contours> {
        let pictures = self.of(size);
        let draw = || {
            let change = self.change_on_canvas(size);
            if let Some(change) = change.as_ref().filter(|c| c.moving.len() == c.count) {
                return Arc::clone(&change.moving);
            }
            let (solid, camera) = (&self.solid, self.camera.scaled_to(size));
            if change.is_some() {
                return Arc::new(self.canvas.contours(solid, &camera));
            }
            // A surface of revolution needs no depth for its contours.
            let read = || solid.revolution().map_or_else(|| self.depth_read(size), |_| None);
            let depth = pictures.with_depth().cloned().or_else(read);
            Arc::new(match depth {
                Some(frame) => Contours::with_depth(solid, &camera, &frame.depth),
                None => Contours::of(solid, &camera),
            })
        };
        Arc::clone(pictures.contours.get_or_init(draw))
    }

    /// The difference of [`View::contours`] from the contours drawn last on the same
    /// canvas, without building the list of those that stay.
    pub fn change(&self, size: u32) -> Arc<ContourChange> {
        let whole = || Arc::new(ContourChange::whole(self.contours(size)));
        self.change_on_canvas(size).unwrap_or_else(whole)
    }

    /// The change, unless the picture is better drawn in full, or its depth is known.
    fn change_on_canvas(&self, size: u32) -> Option<Arc<ContourChange>> {
        let pictures = self.of(size);
        let draw = || {
            if self.solid.revolution().is_some() || pictures.with_depth().is_some() {
                return None;
            }
            self.canvas.change(&self.solid, &self.camera.scaled_to(size)).map(Arc::new)
        };
        pictures.change.get_or_init(draw).clone()
    }

    /// The vector-Jacobian product of [`View::contours`] with respect to the solid's
    /// vertices, as [`Contours::vjp`].
    pub fn vjp_contours(&self, size: u32, by_piece: &[[f64; 4]]) -> Vec<DVec3> {
        let camera = self.camera.scaled_to(size);
        self.contours(size).vjp(&self.solid, &camera, by_piece)
    }

    /// A frame with depth at least, if a comparator reads one.
    fn depth_read(&self, size: u32) -> Option<Arc<Frame>> {
        if self.is_read(Channel::Frame, size) {
            return Some(self.frame(size));
        }
        self.is_read(Channel::Depth, size).then(|| self.depth(size))
    }
}

impl Pictures {
    /// A frame with depth at least, if one was drawn.
    fn with_depth(&self) -> Option<&Arc<Frame>> {
        self.frame.get().or(self.depth.get())
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
        b.declare(Channel::Frame, 96);
        let next = after(&b);
        assert_eq!(*a.contours(96), *next.contours(96));
        assert_eq!(next.of(96).frame.get(), Some(&b.frame(96)), "drawn for the next one");
        let depth = c.depth(96);
        c.declare(Channel::Depth, 96);
        let next = after(&after(&c));
        assert_eq!(*a.contours(96), *next.contours(96));
        assert_eq!(next.of(96).depth.get(), Some(&depth), "drawn for the next one");
        assert!(next.is_read(Channel::Depth, 96) && !next.is_read(Channel::Contours, 96));
        assert!(depth.part.is_empty() && Arc::ptr_eq(&depth, &c.depth(96)));
        assert_eq!(depth.depth, b.frame(96).depth);
        assert!(Arc::ptr_eq(&b.depth(96), &b.frame(96)));
        assert_eq!(*a.contours(96), *b.contours(96));
        assert_eq!(*a.contours(96), *c.contours(96));
        assert_eq!(*a.depth(96), *depth);
        assert!(!a.contours(96).x.is_empty());
    }
}
