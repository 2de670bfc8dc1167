//! The stationary meshes of a scene: their depth, and their pieces of contour by the
//! pixels at which they are tested.

use crate::render::Camera;
use crate::render::lines::visibility::{DepthTest, Depths, Piece};
use crate::render::pixels::area::Area;
use crate::render::pixels::project::DepthRange;
use std::sync::Arc;

/// Relative half width of the first interval of depth ranges that a static layer is
/// prepared for.
const FIRST_WIDTH: f64 = 0.005;

/// A bit for each side on which a piece passes its depth test.
const FREE: u8 = 0b11;
/// Set if the piece was last reported as shown.
const SHOWN: u8 = 0b100;

/// The depth and contours of the stationary meshes.
#[derive(Default)]
pub struct StaticLayer {
    pub depth: Vec<f32>,
    pub range: DepthRange,
    /// All pieces, with the index of their mesh.
    pub pieces: Vec<(Piece, usize)>,
    /// Identifies the preparation of all fields below; renewed by
    /// [`StaticLayer::sort_pieces`].
    pub prepared: Arc<()>,
    /// Least and greatest depth range of the scene for which the fields below are valid.
    extents: [f64; 2],
    /// Half the relative width of this interval.
    width: f64,
    /// Pieces that the layer does not hide at the greatest of these depth ranges, with
    /// the index of their mesh.
    live: Vec<(Piece, usize)>,
    /// For each live piece, the sides on which it passes its test, and whether it is
    /// shown: bits of [`FREE`] and [`SHOWN`].
    state: Vec<u8>,
    /// Tests that fail at the least of these depth ranges and pass at the greatest: the
    /// least depth range at which the test passes, its index in `looks`, and its pixel;
    /// sorted by the depth range.
    unsure: Vec<(f64, u32, u32)>,
    /// By pixel: at a depth below this, all tests there fail, at any of these depth
    /// ranges.
    pub nearest: Vec<f32>,
    /// Where the tests at each pixel begin in `looks`.
    start: Vec<u32>,
    looks: Vec<DepthTest>,
    /// Pieces with a test whose result has changed.
    touched: Vec<u32>,
}

impl StaticLayer {
    /// The layer of an empty picture.
    pub fn new(camera: &Camera) -> StaticLayer {
        StaticLayer {
            depth: vec![f32::INFINITY; camera.pixels()],
            width: FIRST_WIDTH,
            ..StaticLayer::default()
        }
    }

    /// True if this layer hides a whole mesh, contours included, whose depth range is
    /// `range` and whose pixels all lie in `area`.
    pub fn hides(&self, range: &DepthRange, area: &Area, camera: &Camera) -> bool {
        let (limit, width) = (Depths::hiding(self.extents[1], range), camera.width as usize);
        // Pieces, and the pixels at which they are tested, may lie slightly outside of
        // the area.
        const REACH: usize = 4;
        let (left, right) = (area.left.saturating_sub(REACH), (area.right + REACH).min(width));
        let rows =
            area.top.saturating_sub(REACH)..(area.bottom + REACH).min(camera.height as usize);
        let near = |d: &f32| f64::from(*d) < limit;
        area.pixels() > 0
            && rows
                .map(|row| row * width + left..row * width + right)
                .all(|row| self.depth.get(row).is_some_and(|row| row.iter().all(near)))
    }

    /// True if the sorted pieces are valid for a depth range.
    pub fn holds(&self, extent: f64) -> bool {
        let [least, most] = self.extents;
        self.pieces.is_empty() || least <= extent && extent <= most
    }

    /// Sorts the pieces for an interval of depth ranges around `extent`; with `again`,
    /// for a wider interval than before.
    pub fn sort_pieces(&mut self, camera: &Camera, extent: f64, again: bool) -> Option<()> {
        self.prepared = Arc::default();
        self.width = if again { (2.0 * self.width).min(0.5) } else { self.width };
        self.extents = [extent * (1.0 - self.width), extent * (1.0 + self.width)];
        let depths = |extent: f64| Depths::new(&self.depth, camera.width, camera.height, extent);
        let (least, most) = (depths(self.extents[0])?, depths(self.extents[1])?);
        self.live.clear();
        self.live.extend(self.pieces.iter().filter(|(piece, _)| most.visible(piece)));
        self.state.clear();
        self.state.resize(self.live.len(), 0);
        // A counting sort by pixel.
        self.start.clear();
        self.start.resize(self.depth.len() + 2, 0);
        let depth_tests = |i: usize, piece: &Piece| {
            [0, 1].map(|side| piece.depth_test(side, i as u32)).into_iter().flatten()
        };
        for (i, (piece, _)) in self.live.iter().enumerate() {
            depth_tests(i, piece).for_each(|(pixel, _)| self.start[pixel as usize + 2] += 1);
        }
        let mut sum = 0;
        for start in &mut self.start {
            sum += *start;
            *start = sum;
        }
        self.looks.clear();
        self.looks.resize(sum as usize, DepthTest::default());
        for (i, (piece, _)) in self.live.iter().enumerate() {
            for (pixel, depth_test) in depth_tests(i, piece) {
                let place = &mut self.start[pixel as usize + 1];
                self.looks[*place as usize] = depth_test;
                *place += 1;
            }
        }
        self.nearest.clear();
        self.unsure.clear();
        for (pixel, depth) in self.depth.iter().enumerate() {
            let mut nearest = f32::INFINITY;
            for at in self.start[pixel]..self.start[pixel + 1] {
                let depth_test = &self.looks[at as usize];
                nearest = nearest.min(rounded_up(most.least(depth_test)));
                if most.passes(depth_test, *depth) && !least.passes(depth_test, *depth) {
                    let free =
                        |extent: f64| depths(extent).is_some_and(|d| d.passes(depth_test, *depth));
                    self.unsure.push((first_true(self.extents, free), at, pixel as u32));
                }
            }
            self.nearest.push(nearest);
        }
        self.unsure.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        Some(())
    }

    /// Tests all pieces and returns the number of those shown.
    pub fn test_all(&mut self, depths: &Depths<'_>) -> usize {
        let mut shown = 0;
        for ((piece, _), state) in self.live.iter().zip(&mut self.state) {
            let [first, second] =
                [0, 1].map(|side| u8::from(depths.visible_by(piece, side)) << side);
            let free = first | second;
            *state = if free == 0 { 0 } else { free | SHOWN };
            shown += usize::from(free != 0);
        }
        shown
    }

    /// Repeats the depth tests at some pixels, and those whose result depends on which of
    /// two depth ranges (before and now) applies. Calls `changed` once for each piece
    /// that is no longer shown (`false`) or newly shown (`true`).
    pub fn retest(
        &mut self,
        depths: &Depths<'_>,
        pixels: &[u32],
        extents: [f64; 2],
        mut changed: impl FnMut(&Piece, bool),
    ) {
        let StaticLayer { looks, start, state, touched, live, unsure, .. } = self;
        touched.clear();
        let mut look = |depth_test: &DepthTest, pixel: usize| {
            let Some(state) = state.get_mut(depth_test.piece as usize) else { return };
            let free = u8::from(depths.passes(depth_test, depths.at(pixel))) << depth_test.side;
            let now = (*state & !(1 << depth_test.side)) | free;
            if now != *state {
                *state = now;
                touched.push(depth_test.piece);
            }
        };
        for pixel in pixels.iter().map(|p| *p as usize) {
            let ends = [pixel, pixel + 1].map(|i| start.get(i).map_or(0, |s| *s as usize));
            looks
                .get(ends[0]..ends[1])
                .unwrap_or_default()
                .iter()
                .for_each(|depth_test| look(depth_test, pixel));
        }
        let [low, high] = [extents[0].min(extents[1]), extents[0].max(extents[1])];
        let between =
            [low, high].map(|extent| unsure.partition_point(|(flip, ..)| *flip <= extent));
        for (_, at, pixel) in unsure.get(between[0]..between[1]).unwrap_or_default() {
            looks
                .get(*at as usize)
                .into_iter()
                .for_each(|depth_test| look(depth_test, *pixel as usize));
        }
        for piece in &*touched {
            let (Some(state), Some((piece, _))) =
                (state.get_mut(*piece as usize), live.get(*piece as usize))
            else {
                continue;
            };
            let shown = *state & FREE != 0;
            if shown != (*state & SHOWN != 0) {
                *state ^= SHOWN;
                changed(piece, shown);
            }
        }
    }

    /// The pieces that are shown, with the index of their mesh.
    pub fn shown(&self) -> impl Iterator<Item = &(Piece, usize)> {
        self.live
            .iter()
            .zip(&self.state)
            .filter(|(_, state)| **state & SHOWN != 0)
            .map(|(live, _)| live)
    }
}

/// The least `f32` that is not less than `v`: `f64::from(x) < v` exactly if
/// `x < rounded_up(v)`.
fn rounded_up(v: f64) -> f32 {
    let rounded = v as f32;
    if f64::from(rounded) < v { rounded.next_up() } else { rounded }
}

/// The least number between two positive ones at which a monotone condition holds; it
/// must fail at `low` and hold at `high`.
fn first_true([low, high]: [f64; 2], holds: impl Fn(f64) -> bool) -> f64 {
    // Positive numbers are ordered as their bits.
    let (mut low, mut high) = (low.to_bits(), high.to_bits());
    while low + 1 < high {
        let middle = low + (high - low) / 2;
        if holds(f64::from_bits(middle)) { high = middle } else { low = middle }
    }
    f64::from_bits(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_number_at_which_a_condition_holds() {
        let third = 1.0 / 3.0;
        assert_eq!(first_true([0.1, 0.9], |x| x >= third), third);
        assert_eq!(first_true([0.1, 0.9], |x| x >= 0.9), 0.9);
        assert_eq!(first_true([0.1, 0.9], |x| x > 0.1), 0.1f64.next_up());
    }

    #[test]
    fn comparisons_are_the_same_after_rounding_up() {
        for v in [0.1, 1.0, 1.0 + 1e-12, -0.3, 1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY] {
            let up = rounded_up(v);
            for x in [up, up.next_up(), up.next_down(), v as f32, f32::INFINITY, 0.0] {
                assert_eq!(f64::from(x) < v, x < up, "{x} {v}");
            }
        }
    }
}
