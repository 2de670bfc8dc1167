//! Image positions rounded to 1/1024 of a pixel, and the pixels in bounding boxes of such
//! positions.
//!
//! Invariant: rounded positions are exact in single precision, so results computed from
//! them do not depend on the order of operations.

use glam::{Vec4, Vec4Swizzles};

/// Base-2 logarithm of [`UNIT`].
pub(in crate::render) const BITS: u32 = 10;
/// Units of rounded positions per pixel.
pub(in crate::render) const UNIT: i32 = 1 << BITS;

/// A position relative to the centre of the first pixel, rounded to 1/1024 of a pixel: x,
/// y, -x, -y, so that a single minimum gives least and greatest coordinates. Exact in
/// single precision; clamped to [`BOUND`].
pub(in crate::render) type Place = Vec4;

/// Beyond any image, in pixels.
const BOUND: f32 = 16384.0;

/// Rounds a coordinate in pixels, relative to the centre of the first pixel.
#[inline(always)]
pub(in crate::render) fn rounded(v: f64) -> f32 {
    // Adding and subtracting this rounds to the nearest integer.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let (v, bound) = (v - 0.5, f64::from(BOUND));
    let v = if v > -bound { v } else { -bound };
    let v = if v < bound { v } else { bound };
    (((v * f64::from(UNIT) + WHOLE) - WHOLE) / f64::from(UNIT)) as f32
}

/// Rounds a position in pixels.
#[inline(always)]
pub(in crate::render) fn place(x: f64, y: f64) -> Place {
    let (x, y) = (rounded(x), rounded(y));
    Vec4::new(x, y, -x, -y)
}

/// The columns and rows of pixels in a bounding box, each from the first to one past the
/// last: left, top, right, bottom. Kept in the lowest bits of single-precision numbers,
/// which is how they are computed.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::render) struct Extent(Vec4);

/// Adding this to a number leaves the nearest integer in the lowest 16 bits of the sum.
const LOW_BITS: f32 = 8_388_608.0;

impl Extent {
    /// The pixels of an image whose centres lie in the bounding box with these least
    /// coordinates. `size` is width and height, twice.
    #[inline(always)]
    pub fn between(least: Place, size: Vec4) -> Extent {
        // Integers in these units are centres: rounded up for the first one; rounded
        // down, plus one, for the one past the last.
        const ALMOST: f32 = (UNIT - 1) as f32 / UNIT as f32;
        let at = least * Vec4::new(1.0, 1.0, -1.0, -1.0) + Vec4::new(ALMOST, ALMOST, 1.0, 1.0);
        let at = at.max(Vec4::ZERO).min(size);
        let nearest = at + LOW_BITS;
        Extent(nearest - Vec4::select((nearest - LOW_BITS).cmpgt(at), Vec4::ONE, Vec4::ZERO))
    }

    /// The extent of a triangle.
    #[inline(always)]
    pub fn around([a, b, c]: [Place; 3], size: Vec4) -> Extent {
        Extent::between(a.min(b).min(c), size)
    }

    /// True if it contains no pixels.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.0.cmplt(self.0.zwxy()).bitmask() & 0b11 != 0b11
    }

    /// Columns and rows, each from the first to one past the last.
    #[inline(always)]
    pub fn ends(&self) -> [[usize; 2]; 2] {
        let [left, top, right, bottom] = self.0.to_array().map(|v| usize::from(v.to_bits() as u16));
        [[left, right], [top, bottom]]
    }
}

/// Width and height of an image, twice.
pub(in crate::render) fn size(width: u32, height: u32) -> Vec4 {
    let (width, height) = (width as f32, height as f32);
    Vec4::new(width, height, width, height)
}

/// True if a position, or the least coordinates of several, are within the bounds, so
/// that nothing was clamped.
#[inline(always)]
pub(in crate::render) fn is_near(least: Place) -> bool {
    least.cmpgt(Vec4::splat(-BOUND)).all()
}

/// A point in the image.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Point {
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the top edge.
    pub y: f64,
    /// A number that grows towards the camera and is linear in the picture; see `project`.
    pub nearness: f64,
}

impl Point {
    /// Rounds to single precision, in which vertices are stored.
    #[inline]
    pub fn single(self) -> Point {
        let [x, y, nearness] = [self.x, self.y, self.nearness].map(|v| f64::from(v as f32));
        Point { x, y, nearness }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing::Uniform;

    /// The first pixel whose centre lies between two rounded coordinates, and one past
    /// the last, in double precision.
    fn between(least: f64, most: f64, side: u32) -> [usize; 2] {
        let inside = |v: f64| v.clamp(0.0, f64::from(side)) as usize;
        [inside(least.ceil()), inside(most.floor() + 1.0)]
    }

    #[test]
    fn extents_are_those_of_double_precision() {
        let mut random = Uniform(51);
        let (mut some, mut none) = (0, 0);
        for round in 0..20_000 {
            let side = [7, 128, 5000, 16384][round % 4];
            let reach = f64::from(side) * [0.6, 1.5, 30.0][round % 3];
            let near =
                [random.between(-0.1, 1.1), random.between(-0.1, 1.1)].map(|v| v * f64::from(side));
            let corners: [[f64; 2]; 3] = std::array::from_fn(|_| {
                let spread = if round % 5 == 0 { reach } else { [0.3, 3.0, 40.0][round % 3] };
                let v = near.map(|v| v + random.between(-spread, spread));
                // Often exactly on centres.
                if round % 7 == 0 { v.map(|v| (v * 2.0).round() / 2.0) } else { v }
            });
            let (width, height) = (side, side / 2 + 1);
            let extent = Extent::around(corners.map(|[x, y]| place(x, y)), size(width, height));
            let ends: [[usize; 2]; 2] = std::array::from_fn(|axis| {
                let all = corners.map(|c| f64::from(rounded(c[axis])));
                let (least, most) =
                    (all[0].min(all[1]).min(all[2]), all[0].max(all[1]).max(all[2]));
                between(least, most, [width, height][axis])
            });
            let empty = ends.iter().any(|[first, past]| first >= past);
            assert_eq!(extent.is_empty(), empty, "{corners:?} in {width} x {height}");
            if !empty {
                assert_eq!(extent.ends(), ends, "{corners:?} in {width} x {height}");
            }
            (some, none) = (some + usize::from(!empty), none + usize::from(empty));
        }
        assert!(some > 5000 && none > 1000, "{some} {none}");
    }

    #[test]
    fn places_are_the_nearest_and_stay_in_bounds() {
        for (at, wanted) in [(0.5, 0.0), (1.0, 0.5), (3.25 + 0.4 / 1024.0, 2.75), (-7.5, -8.0)] {
            assert_eq!(rounded(at), wanted);
        }
        for far in [1e9, 1e300, f64::INFINITY] {
            assert_eq!([rounded(far), rounded(-far)], [BOUND, -BOUND]);
            assert!(!is_near(place(far, 0.0)) && !is_near(place(0.0, -far)));
        }
        assert!(rounded(f64::NAN).abs() <= BOUND && is_near(place(-16000.0, 16000.0)));
    }
}
