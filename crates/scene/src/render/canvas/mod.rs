//! State shared by successive drawings of one scene. A view that follows another one in a node
//! of a trace takes over its canvas, so a drawing costs what the change costs.
//!
//! The meshes of a scene are **layers** of a picture. Those that stand still are merged
//! into one static layer, whose pieces of contour are indexed by the pixels at which their
//! visibility is tested. When a mesh moves, depth is recomposed only where it was and is,
//! only the pieces tested there are tested again, and the difference is reported as a
//! [`ContourChange`].
//!
//! Invariant: a picture depends on the solid and the camera alone, bit for bit: a canvas
//! only saves work.

mod dynamic_mesh;
mod layer;
mod meshes;
mod picture;
mod static_layer;

use self::layer::{Shows, Tools};
use self::picture::IncrementalImage;
use super::{Camera, ContourChange, Contours};
use crate::geom::Solid;
pub(super) use layer::{affine_bits, camera_bits};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

/// The number of pictures that a canvas keeps: several cameras or sizes, with contours or with
/// depth alone.
const PICTURES: usize = 4;

/// A shared canvas. Clones draw on the same one; a new canvas is empty.
#[derive(Clone, Debug, Default)]
pub(super) struct Canvas(Arc<Mutex<ImageCache>>);

/// The pictures of a canvas, the one drawn last first.
#[derive(Default)]
struct ImageCache {
    pictures: Vec<IncrementalImage>,
    /// Large, and most canvases are never drawn on: made when it is needed.
    tools: Option<Box<Tools>>,
}

impl std::fmt::Debug for ImageCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ImageCache").field("count", &self.pictures.len()).finish()
    }
}

impl Canvas {
    /// The canvas for the drawings that follow: this one, or an empty one while another
    /// thread draws on it, since forks that run side by side would wait for each other.
    #[must_use]
    pub fn for_next(&self) -> Canvas {
        match self.0.try_lock() {
            Err(TryLockError::WouldBlock) => Canvas::default(),
            _ => self.clone(),
        }
    }

    /// The contours of a solid in a camera's picture, as [`Contours::of`].
    pub fn contours(&self, solid: &Solid, camera: &Camera) -> Contours {
        self.shown(solid, (camera, Shows::Contours), |picture| picture.contours(camera))
            .unwrap_or_else(|| Contours::of(solid, camera))
    }

    /// The depth of a solid, row by row, in the picture with contours or in that without;
    /// `None` if it is better drawn in full.
    pub(super) fn depth(&self, solid: &Solid, camera: &Camera, contours: bool) -> Option<Vec<f32>> {
        let shows = if contours { Shows::Contours } else { Shows::Depth };
        self.shown(solid, (camera, shows), |picture| picture.depth().to_vec())
    }

    /// The change from the previous contours in this picture; `None` if the solid is
    /// better drawn in full.
    pub(super) fn change(&self, solid: &Solid, camera: &Camera) -> Option<ContourChange> {
        self.with_picture((camera, Shows::Contours), |picture, tools| {
            picture.draw(solid, camera, tools)
        })
    }

    /// Takes something from the picture that shows a solid, which is drawn only if it is
    /// not there yet.
    fn shown<T>(
        &self,
        solid: &Solid,
        (camera, shows): (&Camera, Shows),
        take: impl FnOnce(&IncrementalImage) -> T,
    ) -> Option<T> {
        self.with_picture((camera, shows), |picture, tools| {
            if !picture.shows(solid) {
                picture.draw(solid, camera, tools)?;
            }
            Some(take(picture))
        })
    }

    fn with_picture<T>(
        &self,
        (camera, shows): (&Camera, Shows),
        work: impl FnOnce(&mut IncrementalImage, &mut Tools) -> Option<T>,
    ) -> Option<T> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let ImageCache { pictures, tools } = &mut *all;
        let eye = camera_bits(camera);
        match pictures.iter().position(|p| p.is_of(&eye, shows)) {
            Some(at) => pictures[..=at].rotate_right(1),
            None => {
                pictures.truncate(PICTURES - 1);
                pictures.insert(0, IncrementalImage::new(eye, shows));
            }
        }
        work(pictures.first_mut()?, tools.get_or_insert_default())
    }
}
