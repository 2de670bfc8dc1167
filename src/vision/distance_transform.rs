//! The exact Euclidean distance transform in linear time (Felzenszwalb and Huttenlocher 2012, "Distance Transforms of
//! Sampled Functions"), with the nearest point.

/// In [`DistanceMap::nearest`]: there is no set pixel.
pub const NOWHERE: u32 = u32::MAX;

/// For each pixel the distance between its centre and that of the nearest set one.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Distances in pixels; the picture's diagonal everywhere if no pixel is set.
    pub values: Vec<f32>,
    /// The nearest set pixel, `y * width + x`; [`NOWHERE`] if none is set.
    pub nearest: Vec<u32>,
}

/// Distances to the set pixels of a picture; pixels that `set` is too short for are not set.
pub fn distance_transform(width: u32, height: u32, set: &[bool]) -> DistanceMap {
    let (w, h) = (width as usize, height as usize);
    // First the nearest set pixel in each column, in two sweeps.
    let mut row_of = vec![NOWHERE; w * h];
    for x in 0..w {
        let mut last = NOWHERE;
        for y in 0..h {
            if set.get(y * w + x) == Some(&true) {
                last = y as u32;
            }
            row_of[y * w + x] = last;
        }
        let mut below = NOWHERE;
        for y in (0..h).rev() {
            if set.get(y * w + x) == Some(&true) {
                below = y as u32;
            }
            let above = row_of[y * w + x];
            let gap = |row: u32| if row == NOWHERE { u32::MAX } else { row.abs_diff(y as u32) };
            if gap(below) < gap(above) {
                row_of[y * w + x] = below;
            }
        }
    }
    // Then along each row the lower envelope of the parabolas above its columns.
    let diagonal = libm::hypot(w as f64, h as f64) as f32;
    let mut map = DistanceMap { width, height, values: vec![diagonal; w * h], nearest: vec![NOWHERE; w * h] };
    let (mut columns, mut starts) = (vec![0usize; w], vec![0f64; w + 1]);
    for y in 0..h {
        let rows = &row_of[y * w..(y + 1) * w];
        let height_of = |x: usize| {
            let d = f64::from(rows[x]) - y as f64;
            d * d
        };
        let mut count = 0;
        for x in (0..w).filter(|x| rows[*x] != NOWHERE) {
            let crossing = |c: usize| {
                let (xf, cf) = (x as f64, c as f64);
                ((height_of(x) + xf * xf) - (height_of(c) + cf * cf)) / (2.0 * (xf - cf))
            };
            while count > 0 && crossing(columns[count - 1]) <= starts[count - 1] {
                count -= 1;
            }
            starts[count] = if count == 0 { f64::NEG_INFINITY } else { crossing(columns[count - 1]) };
            columns[count] = x;
            count += 1;
        }
        if count == 0 {
            continue;
        }
        let mut k = 0;
        for x in 0..w {
            while k + 1 < count && starts[k + 1] < x as f64 {
                k += 1;
            }
            let c = columns[k];
            let dx = x as f64 - c as f64;
            map.values[y * w + x] = (dx * dx + height_of(c)).sqrt() as f32;
            map.nearest[y * w + x] = rows[c] * width + c as u32;
        }
    }
    map
}

impl DistanceMap {
    /// The distance at a place (pixel centres at +0.5) by bilinear interpolation, and its derivatives. Outside of the picture
    /// it is the value at the border plus the distance from there.
    pub fn sample(&self, x: f32, y: f32) -> (f32, f32, f32) {
        let (w, h) = (self.width as usize, self.height as usize);
        if w == 0 || h == 0 {
            return (0.0, 0.0, 0.0);
        }
        let (u, v) = (x - 0.5, y - 0.5);
        let (cu, cv) = (u.clamp(0.0, (w - 1) as f32), v.clamp(0.0, (h - 1) as f32));
        let (x0, y0) = ((cu as usize).min(w.saturating_sub(2)), (cv as usize).min(h.saturating_sub(2)));
        let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
        let (fx, fy) = (cu - x0 as f32, cv - y0 as f32);
        let at = |x: usize, y: usize| self.values[y * w + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        let (top, bottom) = (a + (b - a) * fx, c + (d - c) * fx);
        let value = top + (bottom - top) * fy;
        let mut dx = (b - a) * (1.0 - fy) + (d - c) * fy;
        let mut dy = bottom - top;
        let (ox, oy) = (u - cu, v - cv);
        let out = ox.hypot(oy);
        if out > 0.0 {
            if ox != 0.0 {
                dx = ox / out;
            }
            if oy != 0.0 {
                dy = oy / out;
            }
        }
        (value + out, dx, dy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slow(w: usize, h: usize, set: &[bool]) -> Vec<f32> {
        let near = |x: usize, y: usize| {
            let d = |i: usize| ((i % w) as f64 - x as f64).powi(2) + ((i / w) as f64 - y as f64).powi(2);
            (0..w * h).filter(|i| set[*i]).map(d).fold(f64::INFINITY, f64::min).sqrt() as f32
        };
        (0..w * h).map(|i| near(i % w, i / w)).collect()
    }

    #[test]
    fn equal_to_brute_force() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / f64::from(1u32 << 31)
        };
        for (w, h) in [(1, 1), (1, 9), (9, 1), (13, 7), (20, 31)] {
            for density in [0.02, 0.2, 0.9, 1.1] {
                let mut set: Vec<bool> = (0..w * h).map(|_| next() < density).collect();
                set[w * h / 2] = true;
                let map = distance_transform(w as u32, h as u32, &set);
                assert_eq!(map.values, slow(w, h, &set), "{w}x{h} at {density}");
                for (i, n) in map.nearest.iter().enumerate() {
                    let n = *n as usize;
                    assert!(set[n]);
                    let d = ((n % w) as f64 - (i % w) as f64).hypot((n / w) as f64 - (i / w) as f64);
                    assert!((d as f32 - map.values[i]).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn nothing_set_is_the_diagonal() {
        let map = distance_transform(3, 4, &[false; 12]);
        assert!(map.values.iter().all(|v| *v == 5.0) && map.nearest.iter().all(|n| *n == NOWHERE));
        assert!(distance_transform(0, 5, &[]).values.is_empty());
    }

    #[test]
    fn reading_is_continuous_and_has_its_derivative() {
        let mut set = [false; 80];
        set[33] = true;
        let map = distance_transform(10, 8, &set);
        assert_eq!(map.sample(3.5, 3.5).0, 0.0);
        let h = 1e-3;
        for (x, y) in [(2.3, 5.1), (7.9, 1.2), (-2.0, 4.3), (12.0, -3.0), (5.2, 9.5)] {
            let (v, dx, dy) = map.sample(x, y);
            assert!(((map.sample(x + h, y).0 - map.sample(x - h, y).0) / (2.0 * h) - dx).abs() < 2e-2, "{x} {y}");
            assert!(((map.sample(x, y + h).0 - map.sample(x, y - h).0) / (2.0 * h) - dy).abs() < 2e-2, "{x} {y}");
            assert!((map.sample(x + 1e-4, y).0 - v).abs() < 1e-3);
        }
    }
}
