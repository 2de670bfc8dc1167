//! Whether a piece of contour can be seen, decided by looking at the depth image beside it.
//!
//! On a contour itself the depth image is ambiguous by a pixel, so the looks go about one pixel to the side. It is not
//! an exact hidden-line method: things closer together than about a pixel may be confused. A look that leaves the image
//! is answered by the nearest pixel inside.

/// How far beside a piece to look, in pixels.
const BESIDE: f64 = 1.2;

/// Depth tolerance as a share of the object's depth range.
const TOLERANCE: f64 = 0.006;

/// Largest slack for the slope of an edge's own faces, as a share of the depth range.
pub(super) const EDGE_SLACK: f64 = 0.06;

/// Largest slack for the extent of a silhouette's own face, as a share of the depth range.
pub(super) const SILHOUETTE_SLACK: f64 = 0.15;

/// How a piece is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) enum Look {
    /// Once, outward; `slack` is how much nearer (scene units) the piece's own face reaches.
    Outward {
        /// Unit vector in the image.
        direction: [f64; 2],
        slack: f64,
    },
    /// To both sides, of which one must be free; `slack` per side is how much nearer the edge's own faces come there.
    BothSides {
        /// Unit vector in the image; the second side is the opposite one.
        direction: [f64; 2],
        slack: [f64; 2],
    },
}

/// A depth image to look into.
pub(super) struct Depths<'a> {
    depth: &'a [f32],
    width: usize,
    height: usize,
    tolerance: f64,
}

impl<'a> Depths<'a> {
    /// `extent` is the depth range of the object in scene units. `None` unless the sizes agree and are not zero.
    pub fn new(depth: &'a [f32], width: u32, height: u32, extent: f64) -> Option<Depths<'a>> {
        let (width, height) = (width as usize, height as usize);
        let fits = depth.len() == width * height && !depth.is_empty();
        fits.then_some(Depths { depth, width, height, tolerance: TOLERANCE * extent })
    }

    /// Depth at the pixel that holds a position, or the nearest one; whether it was inside.
    #[inline]
    fn at(&self, x: f64, y: f64) -> (f64, bool) {
        let (last_x, last_y) = (self.width - 1, self.height - 1);
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        let (column, row) = ((x.max(0.0) as usize).min(last_x), (y.max(0.0) as usize).min(last_y));
        (self.depth.get(row * self.width + column).map_or(f64::INFINITY, |&d| f64::from(d)), inside)
    }

    /// Whether nothing beside the piece is nearer than its `depth` less the slack.
    #[inline]
    fn free(&self, x: f64, y: f64, depth: f64, slack: f64) -> bool {
        let (seen, inside) = self.at(x, y);
        // Outside the image only the object itself can be looked at: be generous, its side may bend towards the eye.
        let slack = if inside { slack } else { slack.max(10.0 * self.tolerance) };
        seen >= depth - slack - self.tolerance - 1e-6 * depth
    }

    /// Whether a piece at a position and depth is seen.
    #[inline]
    pub fn visible(&self, x: f64, y: f64, depth: f64, look: &Look) -> bool {
        match *look {
            Look::Outward { direction: [dx, dy], slack } => self.free(x + BESIDE * dx, y + BESIDE * dy, depth, slack),
            Look::BothSides { direction: [dx, dy], slack: [first, second] } => {
                self.free(x + BESIDE * dx, y + BESIDE * dy, depth, first)
                    || self.free(x - BESIDE * dx, y - BESIDE * dy, depth, second)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The left half shows a wall at depth 1, the right half nothing.
    fn half() -> Vec<f32> {
        (0..64).map(|i| if i % 8 < 4 { 1.0 } else { f32::INFINITY }).collect()
    }

    #[test]
    fn looks_outward_past_its_own_object() {
        let depth = half();
        let depths = Depths::new(&depth, 8, 8, 1.0).unwrap();
        let out = Look::Outward { direction: [1.0, 0.0], slack: 0.0 };
        let back = Look::Outward { direction: [-1.0, 0.0], slack: 0.0 };
        assert!(depths.visible(4.0, 4.0, 2.0, &out));
        assert!(!depths.visible(4.0, 4.0, 2.0, &back));
        assert!(!depths.visible(2.0, 4.0, 2.0, &out));
        assert!(depths.visible(2.0, 4.0, 0.999, &back));
        let slack = Look::Outward { direction: [1.0, 0.0], slack: 1.0 };
        assert!(depths.visible(2.0, 4.0, 2.0, &slack));
    }

    #[test]
    fn one_free_side_is_enough_and_the_border_does_not_panic() {
        let depth = half();
        let depths = Depths::new(&depth, 8, 8, 1.0).unwrap();
        let both = Look::BothSides { direction: [1.0, 0.0], slack: [0.0; 2] };
        assert!(depths.visible(4.0, 4.0, 2.0, &both));
        assert!(!depths.visible(2.0, 4.0, 2.0, &both));
        assert!(depths.visible(8.0, 8.0, 2.0, &both));
        assert!(!depths.visible(0.0, 0.0, 2.0, &both));
        assert!(Depths::new(&depth, 8, 7, 1.0).is_none());
        assert!(Depths::new(&[], 0, 0, 1.0).is_none());
    }
}
