//! A host comparator's access to a rendered scene.

use super::ViewValue;
use super::compare::{by_contours, by_silhouette};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::Args;
use pcadlang_engine::lang::error::Fault;
use pcadlang_scene::render::{Channel, View};
use std::fmt;
use std::sync::Arc;

/// A solid in front of a camera (the result of `scene.render`), rendered on first use and
/// once per size. `longer` is the longer side of the picture in pixels.
#[derive(Clone)]
pub struct SceneView(Arc<View>);

impl fmt::Debug for SceneView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a view")
    }
}

/// A view that was rendered elsewhere.
impl From<Arc<View>> for SceneView {
    fn from(view: Arc<View>) -> SceneView {
        SceneView(view)
    }
}

impl SceneView {
    /// Returns argument `i` as a view.
    ///
    /// # Errors
    /// If it is not a view.
    pub fn of(a: &Args, i: usize) -> Result<SceneView, Fault> {
        a.object::<ViewValue>(i, "a view").map(|v| SceneView(Arc::clone(&v.0)))
    }

    /// Returns the width and height of the picture.
    pub fn size(&self, longer: u32) -> (u32, u32) {
        let camera = self.0.camera().scaled_to(longer);
        (camera.width, camera.height)
    }

    /// Returns whether each pixel shows the solid, row by row.
    pub fn mask(&self, longer: u32) -> Vec<bool> {
        self.0.declare(Channel::Frame, longer);
        self.0.frame(longer).mask().collect()
    }

    /// Returns the depth of each pixel, row by row, in scene units; infinite where the
    /// pixel does not show the solid.
    pub fn depth(&self, longer: u32) -> Vec<f32> {
        self.0.declare(Channel::Depth, longer);
        self.0.depth(longer).depth.clone()
    }

    /// Returns the pieces of the contours: x, y and length in pixels, and the angle in
    /// radians, measured from right towards down.
    pub fn contours(&self, longer: u32) -> Vec<[f64; 4]> {
        self.0.declare(Channel::Contours, longer);
        let c = self.0.contours(longer);
        let piece = |i: usize| {
            let angle = libm::atan2(f64::from(c.ty[i]), f64::from(c.tx[i]));
            [f64::from(c.x[i]), f64::from(c.y[i]), f64::from(c.length[i]), angle]
        };
        (0..c.x.len()).map(piece).collect()
    }

    /// Returns the adjoint of the view, given the derivatives with respect to the pieces
    /// of its contours.
    pub fn by_contours(&self, longer: u32, by_piece: &[[f64; 4]]) -> Adjoint {
        by_contours(&self.0, longer, by_piece)
    }

    /// Returns the adjoint of the view, given the derivative with respect to the coverage
    /// of each pixel: the outline moves and covers or uncovers pixels.
    pub fn by_mask(&self, longer: u32, gains: &[f64]) -> Adjoint {
        by_silhouette(&self.0, longer, gains)
    }
}
