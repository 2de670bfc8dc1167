//! Visibility of pieces of contour, decided by testing the depth image beside it.
//!
//! On a contour itself the depth image is ambiguous by a pixel, so the tests read it
//! about one pixel to the side. This is not an exact hidden-line method: surfaces closer
//! together than about a pixel may be confused. A test outside of the image reads the
//! nearest pixel inside. Everything that a test needs besides the depth image and the
//! object's depth range is computed when the piece is made, so a piece can be kept and
//! tested again when something else has moved.

use crate::render::pixels::project::DepthRange;

/// Distance from a piece to the positions tested, in pixels.
pub(in crate::render) const BESIDE: f64 = 1.2;

/// Segments of this length or longer, in pixels, are divided.
pub(in crate::render) const LONGEST: f64 = 1.5;

/// Depth tolerance as a fraction of the object's depth range.
pub(in crate::render) const TOLERANCE: f64 = 0.006;

/// Largest slack for the slope of an edge's own faces, as a fraction of the depth range.
pub(in crate::render) const EDGE_SLACK: f64 = 0.06;

/// Largest slack for the extent of a silhouette's own face, as a fraction of the depth
/// range.
pub(in crate::render) const SILHOUETTE_SLACK: f64 = 0.15;

/// On which sides a piece is tested.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) enum TestSides {
    /// On the outward side only; `slack` is how much nearer (scene units) the piece's own
    /// face reaches.
    Outward {
        /// Unit vector in the image.
        direction: [f64; 2],
        slack: f64,
    },
    /// On both sides, at least one of which must be free; `slack` per side is how much
    /// nearer the edge's own faces come there.
    BothSides {
        /// Unit vector in the image; the second side is the opposite one.
        direction: [f64; 2],
        slack: [f64; 2],
    },
}

/// The depth test on one side of a piece.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// The pixel tested; [`NOWHERE`] if this side is not tested.
    pixel: u32,
    /// True if the position tested is inside the image.
    inside: bool,
    /// How much nearer the piece's own faces reach, before this is limited relative to
    /// the depth range.
    slack: f64,
}

/// No pixel: every image has fewer pixels than this.
const NOWHERE: u32 = u32::MAX;

/// A piece of contour that may be hidden; a function of its own mesh, placement and
/// camera alone.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Piece {
    /// As in [`Contours`](crate::render::Contours).
    pub x: f32,
    pub y: f32,
    pub tx: f32,
    pub ty: f32,
    pub length: f32,
    /// True if it is a crease or boundary, not a smooth silhouette.
    pub edge: bool,
    /// In scene units.
    pub depth: f64,
    sides: [Side; 2],
}

/// A depth test without its pixel: everything that decides its result, except the depth
/// there and the depth range.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::render) struct DepthTest {
    depth: f64,
    slack: f64,
    /// The piece tested, as numbered by the caller.
    pub piece: u32,
    /// The side of the piece.
    pub side: u8,
    inside: bool,
    edge: bool,
}

impl Piece {
    /// The pixel tested on the first or the second side.
    #[inline]
    pub fn pixel(&self, side: usize) -> Option<u32> {
        self.sides.get(side).map(|side| side.pixel).filter(|&pixel| pixel != NOWHERE)
    }

    /// The test on the first or the second side, and the pixel tested; `number` is the
    /// caller's number of the piece.
    #[inline]
    pub fn depth_test(&self, side: u8, number: u32) -> Option<(u32, DepthTest)> {
        let Side { pixel, inside, slack } = *self.sides.get(usize::from(side))?;
        let depth_test =
            DepthTest { depth: self.depth, slack, piece: number, side, inside, edge: self.edge };
        (pixel != NOWHERE).then_some((pixel, depth_test))
    }
}

/// Makes the pieces of an image of a given size.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Image {
    width: usize,
    height: usize,
}

impl Image {
    /// `None` for an image without pixels, or with more than can be numbered.
    pub fn new(width: u32, height: u32) -> Option<Image> {
        let pixels = u64::from(width) * u64::from(height);
        (pixels > 0 && pixels < u64::from(NOWHERE))
            .then_some(Image { width: width as usize, height: height as usize })
    }

    /// The test at the pixel that contains a position, or at the nearest one.
    #[inline(always)]
    fn side(&self, x: f64, y: f64, slack: f64) -> Side {
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        // One comparison each, unlike `max` and `min`; NaN becomes 0.
        let index = |v: f64, side: usize| {
            let (v, last) = (if v > 0.0 { v } else { 0.0 }, (side - 1) as f64);
            (if v < last { v } else { last }) as i32 as usize
        };
        Side {
            pixel: (index(y, self.height) * self.width + index(x, self.width)) as u32,
            inside,
            slack,
        }
    }

    /// Size in pixels.
    #[inline(always)]
    pub fn size(&self) -> [f64; 2] {
        [self.width as f64, self.height as f64]
    }

    /// As [`Image::piece`] for a smooth silhouette, with the pixels tested and whether they
    /// contain the position; the second only if both sides are tested.
    #[inline(always)]
    pub fn located(
        [x, y, tx, ty, length]: [f64; 5],
        (depth, slack): (f64, f64),
        pixels: [u32; 2],
        inside: [bool; 2],
        both: bool,
    ) -> Piece {
        let [x, y, tx, ty, length] = [x, y, tx, ty, length].map(|v| v as f32);
        let side = |i: usize| Side { pixel: pixels[i], inside: inside[i], slack };
        let none = Side { pixel: NOWHERE, inside: true, slack: 0.0 };
        let sides = [side(0), if both { side(1) } else { none }];
        Piece { x, y, tx, ty, length, edge: false, depth, sides }
    }

    /// A piece with its middle at a position and depth, of an edge or of a smooth
    /// silhouette.
    #[inline(always)]
    pub fn piece(
        &self,
        [x, y]: [f64; 2],
        depth: f64,
        [tx, ty]: [f64; 2],
        length: f64,
        look: &TestSides,
        edge: bool,
    ) -> Piece {
        let sides = match *look {
            TestSides::Outward { direction: [dx, dy], slack } => {
                let none = Side { pixel: NOWHERE, inside: true, slack: 0.0 };
                [self.side(x + BESIDE * dx, y + BESIDE * dy, slack), none]
            }
            TestSides::BothSides { direction: [dx, dy], slack: [first, second] } => [
                self.side(x + BESIDE * dx, y + BESIDE * dy, first),
                self.side(x - BESIDE * dx, y - BESIDE * dy, second),
            ],
        };
        let [x, y, tx, ty, length] = [x, y, tx, ty, length].map(|v| v as f32);
        Piece { x, y, tx, ty, length, edge, depth, sides }
    }
}

/// A depth image to test pieces against.
pub(in crate::render) struct Depths<'a> {
    depth: &'a [f32],
    tolerance: f64,
    /// Largest slack of silhouettes and of edges.
    most: [f64; 2],
}

impl<'a> Depths<'a> {
    /// `extent` is the depth range of the object in scene units. `None` unless the sizes
    /// agree and are not zero.
    pub fn new(depth: &'a [f32], width: u32, height: u32, extent: f64) -> Option<Depths<'a>> {
        let fits = depth.len() == width as usize * height as usize && !depth.is_empty();
        fits.then_some(Depths {
            depth,
            tolerance: TOLERANCE * extent,
            most: [SILHOUETTE_SLACK * extent, EDGE_SLACK * extent],
        })
    }

    /// True if the depth on this side is not nearer than the piece's `depth` less the
    /// slack.
    #[inline]
    fn free(&self, side: &Side, depth: f64, most: f64) -> bool {
        f64::from(self.at(side.pixel as usize))
            >= self.threshold([depth, side.slack, most], side.inside)
    }

    /// The least depth at which a test passes.
    #[inline]
    fn threshold(&self, [depth, slack, most]: [f64; 3], inside: bool) -> f64 {
        // One comparison each, unlike `max` and `min`.
        let slack = if slack < most { slack } else { most };
        // Outside of the image only the object itself can be tested: be lenient, as its
        // side may bend towards the camera.
        let lenient = 10.0 * self.tolerance;
        let slack = if inside || slack > lenient { slack } else { lenient };
        depth - slack - self.tolerance - 1e-6 * depth
    }

    /// The depth of a pixel.
    #[inline]
    pub fn at(&self, pixel: usize) -> f32 {
        self.depth.get(pixel).copied().unwrap_or(f32::INFINITY)
    }

    /// The least depth at its pixel for which a test passes; it falls as the depth range
    /// grows.
    #[inline]
    pub fn least(&self, depth_test: &DepthTest) -> f64 {
        self.threshold(
            [depth_test.depth, depth_test.slack, self.most[usize::from(depth_test.edge)]],
            depth_test.inside,
        )
    }

    /// True if a test passes with a given depth at its pixel.
    #[inline]
    pub fn passes(&self, depth_test: &DepthTest, seen: f32) -> bool {
        f64::from(seen) >= self.least(depth_test)
    }

    /// A depth below every depth at which a test of a mesh with this depth range passes.
    pub fn hiding(extent: f64, range: &DepthRange) -> f64 {
        range.near
            - (SILHOUETTE_SLACK.max(EDGE_SLACK) + TOLERANCE) * extent * 1.001
            - 2e-6 * range.far.abs()
    }

    /// True if a piece is visible.
    #[inline]
    pub fn visible(&self, piece: &Piece) -> bool {
        self.visible_by(piece, 0) || self.visible_by(piece, 1)
    }

    /// True if a piece passes its test on the first or the second side.
    #[inline]
    pub fn visible_by(&self, piece: &Piece, side: usize) -> bool {
        let most = self.most[usize::from(piece.edge)];
        piece.sides.get(side).is_some_and(|s| s.pixel != NOWHERE && self.free(s, piece.depth, most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The left half shows a wall at depth 1, the right half nothing.
    fn half() -> Vec<f32> {
        (0..64).map(|i| if i % 8 < 4 { 1.0 } else { f32::INFINITY }).collect()
    }

    fn seen(extent: f64, at: [f64; 2], depth: f64, look: &TestSides, edge: bool) -> bool {
        let image = half();
        let piece = Image::new(8, 8).unwrap().piece(at, depth, [0.0, 1.0], 1.0, look, edge);
        Depths::new(&image, 8, 8, extent).unwrap().visible(&piece)
    }

    #[test]
    fn looks_outward_past_its_own_object() {
        let out = TestSides::Outward { direction: [1.0, 0.0], slack: 0.0 };
        let back = TestSides::Outward { direction: [-1.0, 0.0], slack: 0.0 };
        assert!(seen(1.0, [4.0, 4.0], 2.0, &out, false));
        assert!(!seen(1.0, [4.0, 4.0], 2.0, &back, false));
        assert!(!seen(1.0, [2.0, 4.0], 2.0, &out, false));
        assert!(seen(1.0, [2.0, 4.0], 0.999, &back, false));
    }

    #[test]
    fn slack_is_given_up_to_a_share_of_the_depth_range() {
        let slack = TestSides::Outward { direction: [1.0, 0.0], slack: 1.0 };
        assert!(seen(10.0, [2.0, 4.0], 2.0, &slack, false));
        assert!(!seen(1.0, [2.0, 4.0], 2.0, &slack, false));
        // 0.15 and 0.06 of the depth range, and the tolerance of 0.006.
        for (depth, silhouette, edge) in
            [(1.05, true, true), (1.1, true, false), (1.2, false, false)]
        {
            assert_eq!(seen(1.0, [2.0, 4.0], depth, &slack, false), silhouette);
            assert_eq!(seen(1.0, [2.0, 4.0], depth, &slack, true), edge);
        }
    }

    #[test]
    fn one_free_side_is_enough_and_the_border_does_not_panic() {
        let both = TestSides::BothSides { direction: [1.0, 0.0], slack: [0.0; 2] };
        assert!(seen(1.0, [4.0, 4.0], 2.0, &both, true));
        assert!(!seen(1.0, [2.0, 4.0], 2.0, &both, true));
        assert!(seen(1.0, [8.0, 8.0], 2.0, &both, true));
        assert!(!seen(1.0, [0.0, 0.0], 2.0, &both, true));
        assert!(Depths::new(&half(), 8, 7, 1.0).is_none());
        assert!(Depths::new(&[], 0, 0, 1.0).is_none() && Image::new(0, 3).is_none());
    }
}
