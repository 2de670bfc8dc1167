//! The visible contours of a surface of revolution.

use super::drawer::Drawer;
use super::rays::Spans;
use super::samples::Samples;
use super::sight::Sight;
use super::silhouettes::is_speck;
use crate::contours::Contours;
use crate::geom::{Affine, Revolution};
use crate::render::Camera;
use crate::render::simd::vectorised;
use std::cell::RefCell;

/// Buffers reused from call to call.
#[derive(Default)]
struct Scratch {
    samples: Samples,
    spans: Spans,
    /// Visible pieces, and room for more.
    out: Contours,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::new(Scratch::default());
}

/// Surfaces beyond this depth (scene units) are not drawn, as meshes.
const HUGE: f64 = 1e9;

impl Contours {
    /// The contours of a placed surface of revolution in a camera's image, computed
    /// without a mesh; none if the placement is not invertible.
    pub fn of_revolution(surface: &Revolution, affine: &Affine, camera: &Camera) -> Contours {
        let Some(sight) = Sight::new(camera, affine) else {
            return Contours::new(camera.width, camera.height);
        };
        SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
            Ok(mut scratch) => scratch.contours(surface, &sight, camera),
            Err(_) => Scratch::default().contours(surface, &sight, camera),
        })
    }
}

impl Scratch {
    fn contours(&mut self, surface: &Revolution, sight: &Sight, camera: &Camera) -> Contours {
        let range = sight.range(surface);
        if !(range.far > Camera::NEAR && range.far < HUGE) {
            return Contours::new(camera.width, camera.height);
        }
        let whole = range.near > Camera::NEAR;
        let extent = range.far - range.near.max(Camera::NEAR);
        let Scratch { samples, spans, out } = self;
        vectorised(
            #[inline(always)]
            move || {
                samples.clear();
                samples.add_silhouettes(surface, sight, whole);
                samples.add_rims(surface, sight, whole);
                samples.project(sight);
                spans.set(surface);
                let open = surface.rims().iter().any(|rim| {
                    let ring = surface.rings().get(rim.ring);
                    rim.spans.contains(&None) && ring.is_some_and(|r| !is_speck(r, sight, whole))
                });
                let size = [f64::from(camera.width), f64::from(camera.height)];
                let mut drawer = Drawer {
                    surface,
                    sight,
                    samples,
                    spans,
                    open,
                    whole,
                    extent,
                    size,
                    count: 0,
                    out,
                };
                drawer.silhouettes();
                drawer.rims();
                drawer.pieces(camera)
            },
        )
    }
}

#[cfg(test)]
#[path = "contours_tests.rs"]
mod tests;
